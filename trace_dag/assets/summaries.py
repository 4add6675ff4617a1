"""Assets of all crashes together, the warehouse and the benchmark, unpartitioned."""

from typing import Any

from dagster import AssetExecutionContext, Failure, MaterializeResult, MetadataValue, TableColumn, TableSchema, asset

from trace_dag.assets.specs import OWNERS, as_markdown
from trace_dag.common.messages import markdown
from trace_dag.common.messages.wording import count_of
from trace_dag.common.network.alerts import alerts_go_out, send
from trace_dag.common.stage import Stage
from trace_dag.export.build import INDEX, PAGES_LATER, build_benchmark
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse, table_documentation
from trace_dag.warehouse.changes import alerts_since, standings_in
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
    return f"{error[0]}: {error[1].strip().splitlines()[-1]}"
