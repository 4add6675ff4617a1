"""Estimates as JSON and back, by pydantic's type adapter over the dataclasses.

Deterministic: the same estimate gives the same bytes. Numbers were rounded to a micrometre when the trajectories were
made, so that they also do not depend on the machine.
"""

from __future__ import annotations

from functools import lru_cache

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import Failure
from trace_dag.simulation.states import EstimatorRun, StateEstimate


@lru_cache(maxsize=1)
def _adapter() -> TypeAdapter[StateEstimate]:
    return TypeAdapter(StateEstimate)


def estimate_to_json(estimate: StateEstimate) -> bytes:
    """Return the estimate as UTF-8 JSON, ending with a newline.

    >>> estimate_from_json(estimate_to_json(state_estimate)).key
    '2023-319003'
    """
    return _adapter().dump_json(estimate) + b"\n"


def run_to_json(run: EstimatorRun) -> bytes:
    """Return the run of an estimator without an estimate, as UTF-8 JSON, ending with a newline."""
    return _runs().dump_json(run, indent=1) + b"\n"


@lru_cache(maxsize=1)
def _runs() -> TypeAdapter[EstimatorRun]:
    return TypeAdapter(EstimatorRun)


def estimate_from_json(data: bytes, *, name: str = "state estimate") -> StateEstimate:
    """Read an estimate written by :func:`estimate_to_json`.

    Raises :class:`Failure`, which names the file ``name``, for other content.

    >>> estimate_from_json(estimate_to_json(state_estimate)).hypotheses[0].participants[0].vehicle_number
    1
    """
    try:
        return _adapter().validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the document"
        raise Failure(
            f"{name}: not a state estimate: {where}: {first['msg']}; delete the file and run the stage again"
        ) from error
