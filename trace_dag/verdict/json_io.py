"""Verdicts as JSON."""

from __future__ import annotations

from functools import cache

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import Failure
from trace_dag.verdict.types import Verdict


@cache
def _adapter() -> TypeAdapter[Verdict]:
    return TypeAdapter(Verdict)


def verdict_to_json(verdict: Verdict) -> bytes:
    """Return a verdict as stored: every criterion with value, threshold, unit and whether it holds."""
    return _adapter().dump_json(verdict, indent=1)


def verdict_from_json(data: bytes) -> Verdict:
    """Return a stored verdict; :class:`Failure` if it is not one of this version."""
    try:
        return _adapter().validate_json(data)
    except ValidationError as error:
        raise Failure(f"verdict: its JSON is not of this version ({error}); judge again") from error
