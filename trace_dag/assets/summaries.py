"""Assets of all crashes together, the warehouse and the benchmark, unpartitioned, with their checks and job.

The checks are of failed crashes, and of totals that must agree: each counts the crashes that pass and names the others.
They belong to the warehouse, whose run evaluates them; on a stage, every run of that stage would show them as skipped.

The job of the summaries evaluates them. The stages have no job of their own. A backfill of a *job* counts whole runs
and not crashes, and Dagster cannot execute one again from failure where a run covers a range of partitions; a backfill
of *assets* does both. Crashes that failed or lost their verdict between two builds of the warehouse are worth an alert.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dagster import (
    AssetCheckExecutionContext,
    AssetCheckResult,
    AssetCheckSeverity,
    AssetExecutionContext,
    AssetSelection,
    Failure,
    MaterializeResult,
    MetadataValue,
    TableColumn,
    TableSchema,
    asset,
    asset_check,
    define_asset_job,
    in_process_executor,
)

from trace_dag.assets.specs import OWNERS, as_markdown
from trace_dag.common.errors import BudgetSpent, DamagedFile, UserError
from trace_dag.common.messages import markdown
from trace_dag.common.messages.wording import count_of, last_line
from trace_dag.common.network.alerts import Alert, AlertedCrash, AlertKind, alerts_go_out, send
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.export.build import INDEX, PAGES_LATER, build_benchmark
from trace_dag.flow.crash_status import FinalState
from trace_dag.flow.records import read_records
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse, table_documentation
from trace_dag.warehouse.query import open_warehouse, query

_SHOWN = ("funnel", "failure_reasons", "coverage")
_ERRORS_NAMED = 10
SUMMARY = "summary"  # the job that runs and sensors end with
DAMAGED = "damaged"  # metadata of a warehouse that lacks what is damaged: a sentence for each file


@asset(
    deps=[Stage.VERDICT.value],
    group_name="warehouse",
    kinds={"duckdb", "sql"},
    owners=OWNERS,
    required_resource_keys={"workspace"},
    description="All crashes in one DuckDB file: where each stands, what every stage said, vehicles, maps, estimates, "
    "contacts, criteria, and as views the funnel, the reasons, the coverage and its gaps.",
)
def warehouse(context: AssetExecutionContext) -> MaterializeResult[Any]:
    """Build the warehouse beside the old one and put it in its place."""
    workspace: Workspace = context.resources.workspace
    alert = alerts_go_out(workspace.settings.automation)
    before = standings_in(workspace.warehouse) if alert else {}
    report = build_warehouse(workspace.storage, workspace.local_folder)
    for each in alerts_since(before, workspace.storage, workspace.warehouse) if alert else ():
        send(each, workspace.settings.automation)
    metadata: dict[str, Any] = {
        "file": MetadataValue.path(str(workspace.warehouse)),
        "size_bytes": report.size,
        "duration_s": round(report.duration_s, 2),
        "crashes": report.rows["crashes"],
        "dagster/row_count": report.rows["crashes"],
    }
    if report.damaged:
        metadata[DAMAGED] = MetadataValue.json([str(damaged) for damaged in report.damaged])
    with open_warehouse(workspace.warehouse) as connection:
        for view in _SHOWN:
            metadata[view] = MetadataValue.md(markdown.table(*query(workspace.warehouse, f"SELECT * FROM {view}")))  # noqa: S608
        columns = [
            TableColumn(f"{table}.{name}", type=kind.lower(), description=as_markdown(comment))
            for table, documented in table_documentation(connection).items()
            for name, kind, comment in documented
        ]
    metadata["dagster/column_schema"] = TableSchema(columns=columns)
    return MaterializeResult(metadata=metadata)


@asset(
    deps=[warehouse],
    group_name="benchmark",
    kinds={"html", "openscenario"},
    owners=OWNERS,
    required_resource_keys={"workspace"},
    description="A scenario package for every verified crash, and a static page about all of them that opens from a "
    "file.",
)
def benchmark(context: AssetExecutionContext) -> MaterializeResult[Any]:
    """Bring packages and pages up to date; with many crashes, not at the end of a run but only on request."""
    workspace: Workspace = context.resources.workspace
    if context.run.job_name == SUMMARY and not workspace.pages_in_runs:
        context.log.info(PAGES_LATER)
        return MaterializeResult(metadata={"pages": PAGES_LATER})
    report = build_benchmark(workspace)
    if report.errors:
        named = list(report.errors.items())[:_ERRORS_NAMED]
        raise Failure(
            f"no page of {len(report.errors)} of {count_of(report.pages, 'crash', 'crashes')}: "
            + "; ".join(map(_said, named)),
            metadata={key: MetadataValue.text(error) for key, error in named},
            allow_retries=False,
        )
    return MaterializeResult(
        metadata={
            "index": MetadataValue.path(workspace.storage.path(INDEX)),
            "packages": report.packages,
            "pages": report.pages,
            "made_now": report.made,
        }
    )


def _said(error: tuple[str, str]) -> str:
    return f"{error[0]}: {last_line(error[1])}"


# --- checks ----------------------------------------------------------------------------------------------------------
_NAMED = 50
_check = partial(asset_check, asset=warehouse, required_resource_keys={"workspace"})


def _ask(context: AssetCheckExecutionContext, sql: str) -> list[tuple[Any, ...]]:
    workspace: Workspace = context.resources.workspace
    return query(workspace.warehouse, sql)[1]


def _listing(names: list[str], rows: list[tuple[Any, ...]]) -> MetadataValue:
    return MetadataValue.md(markdown.table(names, rows[:_NAMED]))


@_check(description="No crash stands failed or outdated. The ones that do are named, with the stage and what happened.")
def no_failed_crashes(context: AssetCheckExecutionContext) -> AssetCheckResult:
    """Check that no crash is in the state failed."""
    rows = _ask(context, "SELECT key, final_state, stage, message FROM failures ORDER BY key")
    return AssetCheckResult(
        passed=not rows,
        metadata={"failed": len(rows), "crashes": _listing(["crash", "stands", "stage", "what happened"], rows)},
    )


@_check(description="Every registered crash is in exactly one final state, and the funnel only narrows.")
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


@_check(description="Every accepted road map passes every gate.")
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


@_check(
    description="How each criterion that decides does over all verdicts. Rejections are data, so this only warns when "
    "a criterion could be evaluated for no crash at all."
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


# --- alerts ----------------------------------------------------------------------------------------------------------
_SQL = "SELECT key, final_state, outdated, stage_reached, reason, detail, outdated_because FROM crashes ORDER BY key"
_BUDGET = f"{BudgetSpent.__module__}.{BudgetSpent.__qualname__}:"


def find_troubled(final_state: str, outdated: str | None) -> bool:
    """Return whether a crash is failed, or has a result that could not be made anew.

    >>> find_troubled("failed", None), find_troubled("verified", None)
    (True, False)
    """
    return final_state == FinalState.FAILED or outdated is not None


def standings_in(warehouse: Path) -> dict[str, tuple[str, bool]]:
    """Return the states of the crashes in a warehouse, and whether they are troubled; empty without one."""
    try:
        return {row[0]: (row[1], find_troubled(row[1], row[2])) for row in query(warehouse, _SQL)[1]}
    except (UserError, DamagedFile):
        return {}


def alerts_since(before: Mapping[str, tuple[str, bool]], storage: Storage, warehouse: Path) -> Iterator[Alert]:
    """Return the alerts of a warehouse, given the states of the crashes before its build."""
    failed, fallen = [], []
    for key, state, outdated, stage, reason, detail, because in query(warehouse, _SQL)[1]:
        stood, was_troubled = before.get(key, (None, False))
        if find_troubled(state, outdated) and not was_troubled:
            failed.append(AlertedCrash(key, str(outdated or stage), "", because if outdated else detail))
        elif stood == FinalState.VERIFIED and state == FinalState.REJECTED:
            fallen.append(AlertedCrash(key, str(stage), str(reason), detail))
    spent = _for_the_budget(storage, [crash.key for crash in failed])
    for kind, what, crashes in (
        (AlertKind.BUDGET_SPENT, "stopped by the budget for language models", [c for c in failed if c.key in spent]),
        (AlertKind.FAILED, "failed", [c for c in failed if c.key not in spent]),
        (AlertKind.NO_LONGER_VERIFIED, "no longer verified", fallen),
    ):
        if crashes:
            yield Alert.of_crashes(kind, storage.root, what, crashes)


def _for_the_budget(storage: Storage, keys: list[str]) -> set[str]:
    """Return the failed crashes that stopped because the budget was spent."""
    found = set()
    for key, records in read_records(storage, keys).items():
        errors = [each.error for record in records.values() for each in (record, record.failed_attempt) if each]
        if any(error.strip().rpartition("\n")[2].startswith(_BUDGET) for error in errors if error):
            found.add(key)
    return found
