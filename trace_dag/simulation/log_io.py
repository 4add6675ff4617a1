"""Logs as files: states per step in Parquet, everything else in JSON. One pair of files per crash, all its hypotheses.

Both are byte for byte the same for the same logs; the wall clock is not part of them.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from trace_dag.common.errors import Failure
from trace_dag.common.schemas import TableSchema, table_from_parquet
from trace_dag.crash.trailer import Trailer
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.types import Body, Contact, SimulationLog, Termination, VehicleLog

if TYPE_CHECKING:
    import pyarrow as pa

SIMULATION_STEPS = TableSchema.of_csv(
    "trace_dag.simulation",
    "simulation_steps",
    "States of every participant, per logged step and hypothesis; local frame of the crash",
)
_SCALAR_NAMES = [field.name for field in fields(VehicleLog) if field.name not in ("number", "landmarks_m")]


@dataclass(frozen=True)
class _RunSummary:
    """A log without its states."""

    hypothesis: int
    backend: str
    backend_version: str
    step_s: float
    duration_s: float
    termination: Termination
    reason: str
    vehicle_numbers: tuple[int, ...]
    bodies: dict[int, Body]
    contacts: tuple[Contact, ...]
    objects: Annotated[tuple[FixedObject, ...], Field(exclude_if=lambda objects: not objects)] = ()
    trailers: Annotated[dict[int, Trailer], Field(exclude_if=lambda trailers: not trailers)] = field(
        default_factory=dict
    )


@cache
def _summaries() -> TypeAdapter[tuple[_RunSummary, ...]]:
    return TypeAdapter(tuple[_RunSummary, ...])


def logs_to_files(logs: Sequence[SimulationLog]) -> tuple[bytes, bytes]:
    """Return the Parquet with the columns :data:`SIMULATION_STEPS`, and JSON with contacts, bodies and terminations.

    >>> parquet, summary = logs_to_files([log])
    >>> parquet[:4], b'"termination": "at_rest"' in summary
    (b'PAR1', True)
    """
    import pyarrow.parquet as pq

    table = steps_table(logs)
    buffer = io.BytesIO()
    pq.write_table(
        table,
        buffer,
        compression="zstd",
        use_dictionary=["hypothesis", "vehicle_number"],
        use_byte_stream_split=list(_SCALAR_NAMES),  # the first bytes of all numbers, then the second ones: a sixth less
    )
    summaries = tuple(
        _RunSummary(
            hypothesis=i,
            backend=log.backend,
            backend_version=log.backend_version,
            step_s=log.step_s,
            duration_s=log.duration_s,
            termination=log.termination,
            reason=log.reason,
            vehicle_numbers=tuple(vehicle.number for vehicle in log.vehicles),
            bodies=log.bodies,
            contacts=log.contacts,
            objects=log.objects,
            trailers=dict(log.trailers),
        )
        for i, log in enumerate(logs)
    )
    return buffer.getvalue(), _summaries().dump_json(summaries, indent=1)


def steps_table(logs: Sequence[SimulationLog]) -> pa.Table:
    """Return the states of all parties of some logs, with columns as :data:`SIMULATION_STEPS`.

    The hypothesis is the index of a log.
    """
    import pyarrow as pa

    parts: list[tuple[int, VehicleLog]] = [(i, vehicle) for i, log in enumerate(logs) for vehicle in log.vehicles]
    counts = [len(vehicle.time_s) for _, vehicle in parts]
    columns: dict[str, Any] = {
        "hypothesis": np.repeat(np.array([i for i, _ in parts], np.int32), counts),
        "vehicle_number": np.repeat(np.array([vehicle.number for _, vehicle in parts], np.int32), counts),
    }
    for name in _SCALAR_NAMES:
        columns[name] = np.concatenate([getattr(vehicle, name) for _, vehicle in parts]) if parts else np.zeros(0)
    points = [vehicle.landmarks_m for _, vehicle in parts]
    widths = np.repeat([rows.shape[1] for rows in points], counts)
    starts = np.concatenate([[0], np.cumsum(widths)]).astype(np.int32)
    values = np.concatenate([rows.ravel() for rows in points]) if points else np.zeros(0)
    columns["landmarks_m"] = pa.ListArray.from_arrays(
        starts, values, type=SIMULATION_STEPS.arrow().field("landmarks_m").type
    )
    return pa.table(columns, schema=SIMULATION_STEPS.arrow())


def logs_from_files(parquet: bytes, summary: bytes) -> tuple[SimulationLog, ...]:
    """Return the logs in files of :func:`logs_to_files`.

    Raises :class:`Failure` if the two files are no such pair.
    """

    try:
        summaries = _summaries().validate_json(summary)
    except ValidationError as error:
        raise Failure(f"simulation log: its JSON is not of this version ({error}); simulate again") from error
    table = table_from_parquet(parquet)
    missing = {column.name for column in SIMULATION_STEPS.columns} - set(table.column_names)
    if missing:
        raise Failure(f"simulation log: columns {sorted(missing)} missing in its Parquet file; simulate again")
    # By DLPack: to_numpy of an array imports pandas, which takes longer than reading a log.
    whole = table.combine_chunks()
    columns = {name: np.from_dlpack(whole[name].chunk(0)) for name in ("hypothesis", "vehicle_number", *_SCALAR_NAMES)}
    landmarks = whole["landmarks_m"].chunk(0)
    starts, values = np.from_dlpack(landmarks.offsets), np.asarray(np.from_dlpack(landmarks.values), float)
    logs = []
    for run in summaries:
        vehicles = []
        for number in run.vehicle_numbers:
            rows = (columns["hypothesis"] == run.hypothesis) & (columns["vehicle_number"] == number)
            if not rows.any():
                where = f"vehicle {number} in hypothesis {run.hypothesis}"
                raise Failure(f"simulation log: no steps of {where}; simulate again")
            first, last = np.flatnonzero(rows)[[0, -1]]  # rows of one participant are written together
            points = values[starts[first] : starts[last + 1]].reshape(last + 1 - first, -1)
            states = {name: columns[name][rows] for name in _SCALAR_NAMES}
            vehicles.append(VehicleLog(number=number, **states, landmarks_m=points))
        logs.append(
            SimulationLog(
                backend=run.backend,
                backend_version=run.backend_version,
                step_s=run.step_s,
                vehicles=tuple(vehicles),
                contacts=run.contacts,
                bodies=run.bodies,
                termination=run.termination,
                reason=run.reason,
                duration_s=run.duration_s,
                objects=run.objects,
                trailers=run.trailers,
            )
        )
    return tuple(logs)
