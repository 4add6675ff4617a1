"""Evaluations as a table: one row per agent, case and participant, in Parquet."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from trace_dag.agents.evaluation.evaluate import Conditions, Evaluation
from trace_dag.common.schemas import TableSchema, table_from_parquet

EVALUATIONS = TableSchema.of_csv(
    "trace_dag.agents.evaluation",
    "evaluations",
    "Runs of agents in the place of a crash's participants, and their outcomes",
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
