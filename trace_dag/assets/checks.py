"""Checks over all crashes, made from the warehouse: failed crashes, and totals that must agree.

They are not partitioned: each counts the crashes that pass and names the others. They belong to the warehouse, whose
run evaluates them; on a stage, every run of that stage would show them as skipped.

The job of the summaries evaluates them. The stages have no job of their own. A backfill of a *job* counts whole runs
and not crashes, and Dagster cannot execute one again from failure where a run covers a range of partitions; a backfill
of *assets* does both.
"""

from typing import Any

from dagster import (
    AssetCheckExecutionContext,
    AssetCheckResult,
    AssetCheckSeverity,
    AssetSelection,
    MetadataValue,
    asset_check,
    define_asset_job,
    in_process_executor,
)

from trace_dag.assets.summaries import SUMMARY, benchmark, warehouse
from trace_dag.common.messages import markdown
from trace_dag.common.stage import Stage
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.query import query

_NAMED = 50


def _ask(context: AssetCheckExecutionContext, sql: str) -> list[tuple[Any, ...]]:
    workspace: Workspace = context.resources.workspace
    return query(workspace.warehouse, sql)[1]


def _listing(names: list[str], rows: list[tuple[Any, ...]]) -> MetadataValue:
    return MetadataValue.md(markdown.table(names, rows[:_NAMED]))


@asset_check(
    asset=warehouse,
    required_resource_keys={"workspace"},
    description="No crash stands failed or outdated. The ones that do are named, with the stage and what happened.",
)
def no_failed_crashes(context: AssetCheckExecutionContext) -> AssetCheckResult:
    """Check that no crash is in the state failed."""
    rows = _ask(context, "SELECT key, final_state, stage, message FROM failures ORDER BY key")
    return AssetCheckResult(
        passed=not rows,
        metadata={"failed": len(rows), "crashes": _listing(["crash", "stands", "stage", "what happened"], rows)},
    )


@asset_check(
    asset=warehouse,
    required_resource_keys={"workspace"},
    description="Every registered crash is in exactly one final state, and the funnel only narrows.",
)
def everything_adds_up(context: AssetCheckExecutionContext) -> AssetCheckResult:
    """Check the counts of the tables against each other."""
    ((crashes, keys, rejected, verified),) = _ask(
        context,
        "SELECT count(*), count(DISTINCT key), count(*) FILTER (final_state = 'rejected'),"
        " count(*) FILTER (final_state = 'verified') FROM crashes",
    )
    steps = [row[0] for row in _ask(context, "SELECT crashes FROM funnel")]
    ((reasons,),) = _ask(context, "SELECT coalesce(sum(crashes), 0) FROM failure_reasons")
    adds_up = (
        crashes == keys == steps[0]
        and verified == steps[-1]
        and rejected == reasons
        and steps == sorted(steps, reverse=True)
    )
    return AssetCheckResult(
        passed=adds_up,
        metadata={"crashes": crashes, "rejected": rejected, "reasons": int(reasons), "verified": verified},
    )


@asset_check(
    asset=warehouse,
    required_resource_keys={"workspace"},
    description="Every accepted road map passes every gate.",
)
def maps_pass_their_gates(context: AssetCheckExecutionContext) -> AssetCheckResult:
    """Check the gates of all maps."""
    rows = _ask(
        context,
        "SELECT key, gate, value, threshold, unit, detail FROM map_checks WHERE passed = false ORDER BY key, gate",
    )
    ((maps, gates),) = _ask(context, "SELECT count(DISTINCT key), count(*) FROM map_checks")
    return AssetCheckResult(
        passed=not rows,
        metadata={
            "maps": maps,
            "gates": gates,
            "do not hold": _listing(["crash", "gate", "value", "threshold", "unit", "detail"], rows),
        },
    )


@asset_check(
    asset=warehouse,
    required_resource_keys={"workspace"},
    description="How each criterion that decides does over all verdicts. Rejections are data, so this only warns when "
    "a criterion could be evaluated for no crash at all.",
)
def criteria_are_evaluated(context: AssetCheckExecutionContext) -> AssetCheckResult:
    """Count how often each criterion passes, fails and is undecided."""
    rows = _ask(
        context,
        "SELECT criterion, count(*) FILTER (passed), count(*) FILTER (NOT passed), count(*) FILTER (passed IS NULL)"
        " FROM verdict_criteria WHERE reason IS NOT NULL GROUP BY criterion ORDER BY criterion",
    )
    return AssetCheckResult(
        passed=all(row[1] + row[2] > 0 for row in rows),
        severity=AssetCheckSeverity.WARN,
        metadata={"criteria": _listing(["criterion", "holds", "fails", "not evaluated"], rows)},
    )


CHECKS = (no_failed_crashes, everything_adds_up, maps_pass_their_gates, criteria_are_evaluated)


# --- jobs ------------------------------------------------------------------------------------------------------------
STAGES = AssetSelection.assets(*(stage.value for stage in Stage))

SUMMARY_JOB = define_asset_job(
    SUMMARY,
    AssetSelection.assets(warehouse, benchmark) | AssetSelection.checks(*CHECKS),
    description="What is made of all crashes together: the warehouse, its checks, the benchmark.",
    executor_def=in_process_executor,
)
