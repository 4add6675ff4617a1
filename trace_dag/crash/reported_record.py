"""A record as its source read it, before it is completed: the raw report of a register that is a table.

A JSON document of the fields that are not at their defaults. CrashAPI's own XML is kept as it is served.
"""

from __future__ import annotations

from functools import cache

from pydantic import TypeAdapter, ValidationError

from trace_dag.crash.fields import malformed
from trace_dag.crash.record import CrashRecord


def reported_to_json(record: CrashRecord) -> bytes:
    """The document of a record."""
    return _adapter().dump_json(record, exclude_defaults=True, indent=1) + b"\n"


def reported_from_json(data: bytes, *, name: str, expected_key: str | None = None) -> CrashRecord:
    """The record of a document. Raises :class:`trace_dag.errors.Rejection` (``malformed_report``) for another one's.

    >>> reported_from_json(reported_to_json(record), name="a report").key
    '2023-319003'
    """
    try:
        record = _adapter().validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise malformed(f"{name}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    if expected_key is not None and record.key != expected_key:
        raise malformed(f"{name} is the report of crash {record.key}; expected crash {expected_key}")
    return record


@cache
def _adapter() -> TypeAdapter[CrashRecord]:
    return TypeAdapter(CrashRecord)
