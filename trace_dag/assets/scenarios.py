"""Assets of estimates and simulations."""

from trace_dag.assets.specs import stage_spec
from trace_dag.common.stage import Stage
from trace_dag.simulation.log_io import SIMULATION_STEPS

SCENARIOS = (
    stage_spec(
        Stage.STATE_ESTIMATE,
        group="scenarios",
        kinds={"json", "python"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP],
        description="Impact and initial states of the vehicles, for one hypothesis or several, best first. "
        "Reported speeds are kept.",
    ),
    stage_spec(
        Stage.SIMULATION_LOG,
        group="scenarios",
        kinds={"parquet", "mujoco"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP, Stage.STATE_ESTIMATE],
        columns=SIMULATION_STEPS,
        description="What happens when the estimate is simulated: states per step, contacts, and why it ended.",
    ),
)
