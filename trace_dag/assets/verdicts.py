"""Assets of the verdicts."""

from trace_dag.assets.specs import stage_spec
from trace_dag.common.stage import Stage

VERDICTS = (
    stage_spec(
        Stage.VERDICT,
        group="verdicts",
        kinds={"json", "python"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP, Stage.STATE_ESTIMATE, Stage.SIMULATION_LOG],
        description="Whether the simulated crash is the reported one: every criterion with its value, threshold and "
        "whether it holds, and the crash's picture.",
    ),
)
