"""Driving the wrong way, from the report to the judgement: on one-way carriageways someone really drives against it."""

from __future__ import annotations

import math

import pytest
from cases import SETTINGS, sample_case

from trace_dag.common.geometry import FloatArray
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import Manoeuvre
from trace_dag.simulation.types import VehicleLog
from trace_dag.verdict.judge import judge

EVERY = 20  # logged steps between two looks at the lane


def off_lanes_deg(network: RoadNetwork, vehicle: VehicleLog, until_s: float) -> list[float]:
    """Angles (degrees) of a vehicle's motion to the traffic of its lanes up to a time, outside junctions."""
    motion = zip(*(column[vehicle.time_s < until_s][::EVERY] for column in _columns(vehicle)), strict=True)
    return [
        abs(
            math.degrees(math.remainder(network.pose(match.lane, match.s_m).heading_rad - math.atan2(vy, vx), math.tau))
        )
        for x, y, vx, vy in motion
        for match in network.nearest_lanes(x, y, 0.1)
        if network.road_by_id[match.lane.road_id].junction_id is None
    ]


def _columns(vehicle: VehicleLog) -> tuple[FloatArray, ...]:
    return vehicle.x_m, vehicle.y_m, vehicle.velocity_x_mps, vehicle.velocity_y_mps


@pytest.mark.parametrize("key", ["2023-319024", "2023-319025"], ids=["divided parkway", "one-way street"])
def test_a_wrong_way_driver_drives_against_the_lane_and_is_accepted(key: str) -> None:
    case = sample_case(key)
    found = estimate(case.record, case.network, case.report, SETTINGS.states)
    logs = simulate(EmbeddedBackend(SETTINGS.sim), case.network, case.xodr, found, SETTINGS.sim, record=case.record)
    verdict = judge(case.record, case.network, case.report, found, logs, SETTINGS.verdict)
    assert verdict.accepted
    states, log = found.hypotheses[verdict.hypothesis].participants, logs[verdict.hypothesis]
    assert log.first_contact is not None
    wrong, right = (state.manoeuvre is Manoeuvre.WRONG_WAY for state in states)
    assert (wrong, right) == (True, False)
    against, along = (off_lanes_deg(case.network, each, log.first_contact.time_s) for each in log.vehicles)
    assert min(len(against), len(along)) >= 10
    assert min(against) > 170
    assert max(along) < 10


def test_two_way_streets_have_no_wrong_way() -> None:
    """The same report on a street for both directions is a crossed centre line, not a drive the wrong way."""
    case = sample_case("2023-319022")
    found = estimate(case.record, case.network, case.report, SETTINGS.states)
    assert found.hypotheses
    assert all(state.manoeuvre is not Manoeuvre.WRONG_WAY for each in found.hypotheses for state in each.participants)
