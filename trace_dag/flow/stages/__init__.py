"""The seven stages: one module each, a thin function between stored artefacts and the domain packages.

Belongs here: which entry point of a domain package makes which artefact from which others, and the few figures of it
that a person looks at first. What a stage is made from is its function's signature, and its code is what its module
imports: both are read from here, nothing is listed by hand (:mod:`trace_dag.flow.contract`). So modules import at their
top what decides a result, and for type checkers alone what does not. Does not belong here: how any of it is done.
"""

from __future__ import annotations

from trace_dag.flow.contract import Flow, StageDefinition
from trace_dag.stage import Stage

_GROUPINGS = {Stage.OSM_EXTRACT: "trace_dag.flow.map_groups:by_map_files"}
_REQUIREMENTS = {
    Stage.ROAD_MAP: "trace_dag.flow.requirements:road_map",
    Stage.STATE_ESTIMATE: "trace_dag.flow.requirements:state_estimate",
    Stage.SIMULATION_LOG: "trace_dag.flow.requirements:simulation_log",
}

FLOW = Flow(
    tuple(
        StageDefinition(
            stage,
            f"{__name__}.{stage}:{stage}",
            _GROUPINGS.get(stage),
            _REQUIREMENTS.get(stage),
        )
        for stage in Stage
    ),
    picture="trace_dag.flow.crash_picture:crash_picture",
)
