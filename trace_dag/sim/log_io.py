"""Logs as files: states per step in Parquet, everything else in JSON. One pair of files per crash, all its hypotheses.

Both are byte for byte the same for the same logs; the wall clock is not part of them.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from trace_dag.errors import Failure
from trace_dag.schemas import Column, ColumnType, TableSchema
from trace_dag.sim.types import Body, Contact, SimulationLog, Termination, VehicleLog

SIMULATION_STEPS = TableSchema(
    "simulation_steps",
    "States of every vehicle, per logged step and hypothesis; local frame of the crash",
    (
        Column("hypothesis", ColumnType.INTEGER, "Index of the hypothesis in the state estimate", required=True),
        Column(
            "vehicle_number", ColumnType.INTEGER, "Number of the vehicle in the report", source="VEH_NO", required=True
        ),
        Column("time_s", ColumnType.REAL, "Time since the start of the reconstruction", unit="s", required=True),
        Column("x_m", ColumnType.REAL, "East of the reported point, of the body's centre", unit="m", required=True),
        Column("y_m", ColumnType.REAL, "North of the reported point, of the body's centre", unit="m", required=True),
        Column("z_m", ColumnType.REAL, "Height of the road under the body", unit="m", required=True),
        Column("heading_rad", ColumnType.REAL, "Heading, counter-clockwise from east", unit="rad", required=True),
        Column("speed_mps", ColumnType.REAL, "Speed along the body, negative backward", unit="mps", required=True),
        Column("velocity_x_mps", ColumnType.REAL, "Velocity toward east", unit="mps", required=True),
        Column("velocity_y_mps", ColumnType.REAL, "Velocity toward north", unit="mps", required=True),
        Column("yaw_rate_rps", ColumnType.REAL, "Yaw rate, counter-clockwise", unit="rps", required=True),
        Column("acceleration_mps2", ColumnType.REAL, "Acceleration along the body", unit="mps2", required=True),
        Column(
            "steer_rad", ColumnType.REAL, "Angle of the front wheels, positive to the left", unit="rad", required=True
        ),
        Column("throttle", ColumnType.REAL, "Throttle, 0 to 1", required=True),
        Column("brake", ColumnType.REAL, "Brake, 0 to 1", required=True),
    ),
)
_STATE_NAMES = [field.name for field in fields(VehicleLog) if field.name != "number"]


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


@cache
def _summaries() -> TypeAdapter[tuple[_RunSummary, ...]]:
    return TypeAdapter(tuple[_RunSummary, ...])


def logs_to_files(logs: Sequence[SimulationLog]) -> tuple[bytes, bytes]:
    """Parquet with the columns :data:`SIMULATION_STEPS`, and JSON with contacts, bodies and terminations."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts: list[tuple[int, VehicleLog]] = [(i, vehicle) for i, log in enumerate(logs) for vehicle in log.vehicles]
    counts = [len(vehicle.time_s) for _, vehicle in parts]
    columns: dict[str, np.ndarray[Any, Any]] = {
        "hypothesis": np.repeat(np.array([i for i, _ in parts], np.int32), counts),
        "vehicle_number": np.repeat(np.array([vehicle.number for _, vehicle in parts], np.int32), counts),
    }
    for name in _STATE_NAMES:
        columns[name] = np.concatenate([getattr(vehicle, name) for _, vehicle in parts]) if parts else np.zeros(0)
    table = pa.table(columns, schema=SIMULATION_STEPS.arrow())
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd", use_dictionary=["hypothesis", "vehicle_number"])
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
        )
        for i, log in enumerate(logs)
    )
    return buffer.getvalue(), _summaries().dump_json(summaries, indent=1)


def logs_from_files(parquet: bytes, summary: bytes) -> tuple[SimulationLog, ...]:
    """The logs of :func:`logs_to_files`; :class:`Failure` if the two files are not such a pair."""
    import pyarrow.parquet as pq

    try:
        summaries = _summaries().validate_json(summary)
    except ValidationError as error:
        raise Failure(f"simulation log: its JSON is not of this version ({error}); simulate again") from error
    table = pq.read_table(io.BytesIO(parquet))
    missing = {column.name for column in SIMULATION_STEPS.columns} - set(table.column_names)
    if missing:
        raise Failure(f"simulation log: columns {sorted(missing)} missing in its Parquet file; simulate again")
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    logs = []
    for run in summaries:
        vehicles = []
        for number in run.vehicle_numbers:
            rows = (columns["hypothesis"] == run.hypothesis) & (columns["vehicle_number"] == number)
            if not rows.any():
                where = f"vehicle {number} in hypothesis {run.hypothesis}"
                raise Failure(f"simulation log: no steps of {where}; simulate again")
            vehicles.append(VehicleLog(number=number, **{name: columns[name][rows] for name in _STATE_NAMES}))
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
            )
        )
    return tuple(logs)
