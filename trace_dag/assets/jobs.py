"""Jobs: the whole flow, the flow from a stage on, and what is made of all crashes together."""

from dagster import AssetSelection, define_asset_job, in_process_executor

from trace_dag.assets.checks import CHECKS
from trace_dag.assets.summaries import benchmark, warehouse
from trace_dag.stage import Stage

ALL_STAGES = "all_stages"
SUMMARY = "summary"


def from_stage(stage: Stage) -> AssetSelection:
    """A stage and all after it."""
    return AssetSelection.assets(*(each.value for each in stage.and_later()))


STAGE_JOBS = (
    define_asset_job(
        ALL_STAGES,
        from_stage(Stage.RAW_REPORT),
        description="The whole flow, from the report to the verdict.",
        executor_def=in_process_executor,
    ),
    *(
        define_asset_job(
            f"from_{stage}",
            from_stage(stage),
            description=f"The flow from {stage} on.",
            executor_def=in_process_executor,
        )
        for stage in Stage
        if stage not in (Stage.RAW_REPORT, Stage.VERDICT)
    ),
    define_asset_job(
        "judge_only",
        from_stage(Stage.VERDICT),
        description="Judge the stored simulations again, after a change of thresholds.",
        executor_def=in_process_executor,
    ),
)

SUMMARY_JOB = define_asset_job(
    SUMMARY,
    AssetSelection.assets(warehouse, benchmark) | AssetSelection.checks(*CHECKS),
    description="What is made of all crashes together: the warehouse, its checks, the benchmark.",
    executor_def=in_process_executor,
)
