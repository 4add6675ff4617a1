"""The Dagster code location: ``dagster dev -m trace_dag.definitions`` or ``trace-dag ui``."""

from typing import Any

from dagster import Definitions, in_process_executor

from trace_dag.assets.after_runs import AFTER_RUNS
from trace_dag.assets.batch import crashes
from trace_dag.assets.checks import CHECKS
from trace_dag.assets.jobs import STAGE_JOBS, SUMMARY_JOB
from trace_dag.assets.schedules import SCHEDULES
from trace_dag.assets.sensors import SENSORS
from trace_dag.assets.summaries import benchmark, warehouse
from trace_dag.resources.home import HomeResource


def build_definitions(home: Any = None) -> Definitions:
    """The definitions, on a :class:`trace_dag.pipeline.home.Home` or by default on the one the environment names."""
    return Definitions(
        assets=[crashes, warehouse, benchmark],
        asset_checks=CHECKS,
        jobs=[*STAGE_JOBS, SUMMARY_JOB],
        sensors=[*SENSORS, *AFTER_RUNS],
        schedules=SCHEDULES,
        resources={"home": home if home is not None else HomeResource()},
        # The step is parallel within; a process per step would only add to it.
        executor=in_process_executor,
    )


defs = build_definitions()
