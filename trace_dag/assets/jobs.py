"""Jobs: the stages, and the summaries of all crashes.

The stages have no job of their own. A backfill of a *job* counts whole runs and not crashes, and Dagster cannot execute
one again from failure where a run covers a range of partitions; a backfill of *assets* does both.
"""

from dagster import AssetSelection, define_asset_job, in_process_executor

from trace_dag.assets.checks import CHECKS
from trace_dag.assets.summaries import SUMMARY, benchmark, warehouse
from trace_dag.common.stage import Stage

STAGES = AssetSelection.assets(*(stage.value for stage in Stage))

SUMMARY_JOB = define_asset_job(
    SUMMARY,
    AssetSelection.assets(warehouse, benchmark) | AssetSelection.checks(*CHECKS),
    description="What is made of all crashes together: the warehouse, its checks, the benchmark.",
    executor_def=in_process_executor,
)
