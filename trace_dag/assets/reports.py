"""Assets of the reports."""

from trace_dag.assets.specs import stage_spec
from trace_dag.common.stage import Stage
from trace_dag.crash.tables import CRASH_RECORD

REPORTS = (
    stage_spec(
        Stage.RAW_REPORT,
        group="reports",
        kinds={"xml", "json"},
        description="The crash report as its source serves it: NHTSA's CrashAPI XML, untouched, or a table's rows.",
    ),
    stage_spec(
        Stage.CRASH_RECORD,
        group="reports",
        kinds={"parquet", "python"},
        deps=[Stage.RAW_REPORT],
        columns=CRASH_RECORD,
        description="The report as typed data: the crash, its vehicles and its events in SI units, unknown as null, "
        "classified along the three dimensions of coverage. Rejected if it does not say enough.",
    ),
)
