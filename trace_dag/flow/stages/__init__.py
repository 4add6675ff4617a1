"""The seven stages: one module each, a thin function between stored artefacts and the domain packages.

Belongs here: the entry points of the domain packages for each artefact, and the main figures of it. The inputs of a
stage are its function's parameters (:mod:`trace_dag.flow.contract`); its code has a number here. Does not belong here:
the work itself.
"""

from __future__ import annotations

from trace_dag.common.stage import Stage
from trace_dag.flow.contract import Flow, StageDefinition

VERSIONS = {
    Stage.RAW_REPORT: 1,
    Stage.CRASH_RECORD: 9,
    Stage.OSM_EXTRACT: 3,
    Stage.ROAD_MAP: 7,
    Stage.STATE_ESTIMATE: 17,
    Stage.SIMULATION_LOG: 5,
    Stage.VERDICT: 15,
}
"""Numbers of the stages' code. Raise one when other results come of the same input: a test compares the
sample's outputs (``tests/sample/test_stage_outputs.py``)."""

_GROUPINGS = {Stage.OSM_EXTRACT: "trace_dag.flow.stages.osm_extract:by_map_files"}
_REQUIREMENTS = {
    Stage.ROAD_MAP: "trace_dag.flow.requirements:road_map",
    Stage.STATE_ESTIMATE: "trace_dag.flow.requirements:state_estimate",
    Stage.SIMULATION_LOG: "trace_dag.flow.requirements:simulation_log",
}

FLOW = Flow(
    tuple(
        StageDefinition(
            stage, f"{__name__}.{stage}:{stage}", VERSIONS[stage], _GROUPINGS.get(stage), _REQUIREMENTS.get(stage)
        )
        for stage in Stage
    ),
    picture="trace_dag.flow.crash_picture:crash_picture",
)
