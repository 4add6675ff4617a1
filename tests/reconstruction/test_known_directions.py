"""Six fatal crashes of Tempe stand in the city's register, too, which has the direction that each party travelled."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from trace_dag.common.stage import Stage
from trace_dag.common.units import wrap_angle
from trace_dag.flow.artefacts import ESTIMATE
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.sources import TableSource
from trace_dag.flow.stages import FLOW
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.workspace import Workspace
from trace_dag.reconstruction.alternatives import alternatives, bearing_from_rad
from trace_dag.simulation.states import Hypothesis

EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2, math.pi, -math.pi / 2
DIRECTIONS = {
    "2012-40376": {2: WEST},
    "2013-40180": {1: EAST, 1001: SOUTH},
    "2014-40523": {1: EAST, 2: WEST},
    "2015-40171": {1: WEST, 2: EAST},
    "2015-40782": {1: SOUTH, 1001: EAST},
    "2016-40722": {1: EAST},
}
OCTANT_RAD = math.radians(50)  # police name the compass by the street, which may run askew
PROCESS = {"execution": {"executor": "in_process", "pictures": False}}
UNTIL = tuple(Stage)[: tuple(Stage).index(Stage.STATE_ESTIMATE) + 1]


@pytest.fixture(scope="module")
def workspace(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    opened = Workspace.open(str(tmp_path_factory.mktemp("tempe") / "root"), FLOW).with_settings(PROCESS)
    ingest(
        opened.storage,
        "tempe",
        tables=[TableSource.of_plugin("fars-csv", str(shared_data / "fars-csv"))],
        maps=[shared_data / "osm" / "tempe-az.osm.pbf"],
        choice=Choice(cases=frozenset(DIRECTIONS)),
    )
    list(run_stages(opened, opened.registry.keys(), UNTIL, run_id="directions"))
    return opened


def goes(hypothesis: Hypothesis, number: int, direction_rad: float) -> bool:
    state = next(each for each in hypothesis.participants if each.vehicle_number == number)
    bearing = bearing_from_rad(state)
    return bearing is not None and abs(wrap_angle(bearing + math.pi - direction_rad)) <= OCTANT_RAD


@pytest.mark.parametrize("key", DIRECTIONS)
def test_the_right_directions_are_among_the_hypotheses(workspace: Workspace, key: str) -> None:
    (crash,) = crash_files(workspace, [key])
    made = crash.load(ESTIMATE)
    right = [all(goes(each, *told) for told in DIRECTIONS[key].items()) for each in made.hypotheses]
    assert any(right)
    told = alternatives(made)
    assert right[0] or (told is not None and bool(told.sides)), (
        "where the best one is wrong, the estimate says that it does not know"
    )
