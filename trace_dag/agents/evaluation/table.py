"""Evaluations as a table: one row per agent, case and participant, in Parquet."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from trace_dag.agents.evaluation.evaluate import Conditions, Evaluation
from trace_dag.common.schemas import Column, ColumnType, TableSchema, table_from_parquet

_TEXT, _INT, _REAL, _BOOL = ColumnType.TEXT, ColumnType.INTEGER, ColumnType.REAL, ColumnType.BOOLEAN

EVALUATIONS = TableSchema(
    "evaluations",
    "Runs of agents in the place of a crash's participants, and their outcomes",
    (
        Column("agent", _TEXT, "Name of the agent, and of conditions other than the usual", required=True),
        Column("case_id", _TEXT, "Key of the crash, or of one of its variations or likely courses", required=True),
        Column("key", _TEXT, "Key of the crash", required=True),
        Column("vehicle_number", _INT, "Vehicle the agent drove", source="VEH_NO", required=True),
        Column("role", _TEXT, "striking, who closed in faster at the recorded contact, struck, or departing"),
        Column("weight", _REAL, "Weight of a likely course among those of its crash; 1 of anything else"),
        Column("part", _TEXT, "initiator or responder, by the report"),
        Column(
            "outcome",
            _TEXT,
            "conflict_avoided, collision_avoided, did_not_arrive, rules_broken, mitigated, unchanged, worse or faulty",
            required=True,
        ),
        Column("fault", _TEXT, "Fault of a faulty agent"),
        Column("collided", _BOOL, "Whether any vehicle touched another party or a fixed object"),
        Column("overturned", _BOOL, "Whether the agent's vehicle overturned"),
        Column("recorded_overturned", _BOOL, "Whether the same vehicle overturned in the recorded crash"),
        Column(
            "finished",
            _BOOL,
            "Whether it came 50 m beyond the conflict, or to its end, in twice the recorded time",
        ),
        Column("arrived", _BOOL, "Whether it got past the conflict, or to its end"),
        Column(
            "recorded_off_road_s", _REAL, "Time the recorded vehicle was off the road before the conflict", unit="s"
        ),
        Column("serious_injury_risk", _REAL, "Risk of serious injury at the first contact, the larger of the two"),
        Column("recorded_serious_injury_risk", _REAL, "Risk of serious injury of the recorded crash"),
        Column("contact_time_s", _REAL, "First contact, since the scenario began", unit="s"),
        Column("contact_shift_s", _REAL, "First contact after the recorded one", unit="s"),
        Column("contact_shift_m", _REAL, "First contact from the recorded one", unit="m"),
        Column("closing_speed_mps", _REAL, "Closing speed at the first contact", unit="mps"),
        Column("delta_v_mps", _REAL, "Delta-v of the first contact, the larger of the two; 0 if none", unit="mps"),
        Column("own_delta_v_mps", _REAL, "Delta-v of the agent's vehicle; 0 if none", unit="mps"),
        Column("recorded_delta_v_mps", _REAL, "Delta-v of the recorded crash, the larger of the two", unit="mps"),
        Column("recorded_own_delta_v_mps", _REAL, "Delta-v of the same vehicle in the recorded crash", unit="mps"),
        Column("min_ttc_s", _REAL, "Least time to collision at constant velocities; 0 for a contact", unit="s"),
        Column("post_encroachment_time_s", _REAL, "Least time between two bodies in one place", unit="s"),
        Column(
            "required_deceleration_mps2", _REAL, "Most deceleration that was needed not to touch anybody", unit="mps2"
        ),
        Column("off_road_s", _REAL, "Time off the road", unit="s"),
        Column("wrong_way_s", _REAL, "Time in lanes of the other direction, outside junctions", unit="s"),
        Column("over_limit_mps", _REAL, "Most above the speed limit", unit="mps"),
        Column("over_traffic_mps", _REAL, "Most above 1.25 times the limit or the recorded highest speed", unit="mps"),
        Column("stop_signs_passed", _INT, "Stop signs passed without a halt"),
        Column("max_deceleration_mps2", _REAL, "Hardest braking before any contact", unit="mps2"),
        Column("max_lateral_mps2", _REAL, "Hardest cornering before any contact", unit="mps2"),
        Column("max_jerk_mps3", _REAL, "Sharpest change of acceleration before any contact", unit="mps3"),
        Column("drive", _TEXT, "JSON: x, y, z (m) and heading (rad) by body, 20 a second, to the first contact"),
        Column("rate_hz", _REAL, "How often the agent acted", unit="hz", required=True),
        Column("range_m", _REAL, "How far it saw", unit="m", required=True),
        Column("noise_m", _REAL, "Noise of the positions it saw, standard deviation", unit="m", required=True),
        Column("occlusion", _BOOL, "Whether bodies hid others from it", required=True),
        Column("traffic", _TEXT, "Motion of the others: recorded, reactive, persistent or surrounding"),
        Column("seed", _INT, "Seed of the noise", required=True),
        Column(
            "split", _TEXT, "The part of the benchmark that was asked for: train, validation or test; empty for all"
        ),
        Column("handed_in", _BOOL, "Whether the run was handed in as a file, not driven here"),
        Column("agent_code", _TEXT, "Digest of the agent's own code"),
        Column("code_version", _TEXT, "Code that evaluated it", required=True),
        Column("verdict_fingerprint", _TEXT, "Of the crash as it was evaluated", required=True),
    ),
)

Row = dict[str, Any]


def row(
    agent: str,
    evaluation: Evaluation,
    conditions: Conditions,
    *,
    weight: float,
    split: str | None,
    agent_code: str,
    code_version: str,
    verdict_fingerprint: str,
) -> Row:
    """Return one evaluation as a row of :data:`EVALUATIONS`."""
    sensing = conditions.sensing
    return {
        "agent": agent,
        "case_id": evaluation.case_id,
        "key": evaluation.key,
        "vehicle_number": evaluation.ego,
        "role": evaluation.role,
        "weight": weight,
        "part": evaluation.part,
        "outcome": evaluation.outcome.value,
        "fault": evaluation.fault or None,
        **(asdict(evaluation.metrics) if evaluation.metrics else {}),
        "drive": evaluation.drive or None,
        "rate_hz": conditions.rate_hz,
        "range_m": sensing.range_m,
        "noise_m": sensing.noise_m,
        "occlusion": sensing.occlusion,
        "traffic": conditions.traffic.value,
        "seed": conditions.seed,
        "split": split,
        "handed_in": False,
        "agent_code": agent_code,
        "code_version": code_version,
        "verdict_fingerprint": verdict_fingerprint,
    }


def rows_to_parquet(rows: Iterable[Mapping[str, Any]], schema: TableSchema = EVALUATIONS) -> bytes:
    """Return rows as a Parquet file with the columns of a schema; equal rows give equal bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows), schema=schema.arrow()), buffer, compression="zstd")
    return buffer.getvalue()


def rows_from_parquet(data: bytes) -> list[Row]:
    """Read rows written by :func:`rows_to_parquet`."""

    rows: list[Row] = table_from_parquet(data).to_pylist()
    return rows
