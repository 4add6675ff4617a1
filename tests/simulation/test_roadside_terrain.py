"""The ground beyond the edge: side slopes, ditches, embankments. Expectations are from mechanics and the sources."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.roads.networks import FRAME, lanes
from tests.simulation.motions import CAR, participant, straight
from tests.simulation.test_objects import item
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2, mph_to_mps
from trace_dag.crash.record import VehicleClass
from trace_dag.roads.map.model import LaneSection, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.roadside_terrain import LEVEL, Bank, RoadsideTerrain, onto_slope
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import SimulationLog, overturned_at

DITCH, EMBANKMENT = 34, 35


def highway(limit_mph: float, kind: str = "secondary") -> RoadNetwork:
    """A road along the x axis, 7 m wide."""
    plan = (PlanElement(0, -200, 0, 0, 400.0),)
    limit_mps = mph_to_mps(limit_mph)
    road = Road("1", 400.0, plan, (LaneSection(0, lanes(1, 1)),), highway=kind, speed_mps=limit_mps)
    return RoadNetwork(FRAME, (road,))


def ground(network: RoadNetwork) -> RoadsideTerrain:
    return RoadsideTerrain(network, (), Pose(0.0, 0.0, 0.0))


def test_beside_a_road_of_high_speed_the_ground_falls_by_one_in_six() -> None:
    """AASHTO, Roadside Design Guide, section 3.2.1: 1V:6H; the edge is at y = 3.5."""
    beyond = ground(highway(55))
    bank = beyond.at(10.0, 5.5)
    assert bank.height_m == pytest.approx(-2.0 / 6)
    assert (bank.slope_x, bank.slope_y) == pytest.approx((0.0, -1 / 6), abs=1e-9)
    assert beyond.at(10.0, -5.5).slope_y == pytest.approx(1 / 6)
    assert beyond.at(10.0, 20.0) == Bank(-0.5, 0.0, 0.0)
    assert beyond.at(10.0, 1.0) == LEVEL


def test_beside_a_street_of_low_speed_the_ground_is_level() -> None:
    """AASHTO calls 45 mph and less low speeds: kerbs."""
    assert ground(highway(45)).at(10.0, 5.5) == LEVEL
    assert ground(highway(45, "motorway")).at(10.0, 5.5).slope_y == pytest.approx(-1 / 6)


def test_a_ditch_falls_to_its_near_face_and_rises_from_there() -> None:
    ditch = item(DITCH, 0.0, 10.0)
    beyond = RoadsideTerrain(None, (ditch,), ditch.pose)
    bottom = 10.0 - ditch.width_m / 2
    assert beyond.at(0.0, bottom - 0.9).slope_y == pytest.approx(-1 / 3)
    assert beyond.at(0.0, bottom + 0.9).slope_y == pytest.approx(1 / 3)
    assert beyond.at(0.0, bottom - 1e-6).height_m == pytest.approx(-ditch.height_m, abs=1e-5)
    assert beyond.at(0.0, bottom + 2.0) == beyond.at(0.0, bottom - 2.0) == LEVEL
    assert beyond.at(ditch.length_m, bottom) == LEVEL  # beyond its end
    turned = replace(ditch, pose=replace(ditch.pose, heading_rad=math.pi))  # its far side is south of it then
    other = RoadsideTerrain(None, (turned,), ditch.pose)
    assert other.at(0.0, 10.0 + ditch.width_m / 2).height_m == pytest.approx(-ditch.height_m)


def test_an_embankment_rises_and_goes_on_level() -> None:
    bank = item(EMBANKMENT, 0.0, 10.0)
    beyond = RoadsideTerrain(None, (bank,), bank.pose)
    assert beyond.at(0.0, 10.0).slope_y == pytest.approx(1 / 2)
    assert beyond.at(0.0, 30.0) == Bank(1.5, 0.0, 0.0)
    assert beyond.at(0.0, 8.0) == LEVEL


def test_wheels_that_roll_onto_a_flat_slope_lose_what_points_into_it() -> None:
    """Squarely from the level onto 1V:6H (9.5 degrees, which a car clears): v sin(a) is lost, along its normal."""
    push = onto_slope(VehicleClass.CAR, 0.0, (20.0, 0.0), LEVEL, Bank(0.0, 1 / 6, 0.0))
    assert push is not None
    a = math.atan(1 / 6)
    into = 20.0 * math.sin(a)
    assert push == pytest.approx((-into * math.sin(a), 0.0, into * math.cos(a)))


def test_an_overhang_that_does_not_clear_the_slope_digs_in() -> None:
    """1V:2H (26.6 degrees): as much again is lost along the slope."""
    push = onto_slope(VehicleClass.CAR, 0.0, (20.0, 0.0), LEVEL, Bank(0.0, 1 / 2, 0.0))
    assert push is not None
    a = math.atan(1 / 2)
    into = 20.0 * math.sin(a)
    assert push.x_mps == pytest.approx(-into * math.sin(a) - into * math.cos(a))


def test_ground_that_falls_away_gives_no_push() -> None:
    assert onto_slope(VehicleClass.CAR, 0.0, (20.0, 0.0), LEVEL, Bank(0.0, -1 / 6, 0.0)) is None
    assert onto_slope(VehicleClass.CAR, 0.0, (0.0, 20.0), LEVEL, Bank(0.0, -1 / 6, 0.0)) is None


def slides_off(network: RoadNetwork, speed_mps: float) -> SimulationLog:
    """A car that slides northward on locked wheels, front first, and is let go just beyond the edge at y = 3.5."""
    path = straight(0.0, 3.6 - speed_mps * 0.1, math.pi / 2, speed_mps, until_s=0.1)
    skids = replace(participant(1, path), skids_from_s=0.0)
    settings = SimSettings(locked_wheels=1.0)
    simulation = EmbeddedSimulation(settings, Surface(), settings.friction, network)
    return simulation.run((skids,), time_limit_s=20.0)


def test_a_car_slides_farther_down_a_slope_than_on_the_level() -> None:
    """On the level v^2 / (2 mu g); down 1V:6H the weight takes a sixth of g off what friction gives."""
    mu, v = SimSettings().roadside_friction, 4.0
    level, falling = slides_off(highway(45), v).vehicles[0], slides_off(highway(55), v).vehicles[0]
    level_m, fallen_m = (float(each.y_m[-1]) - 3.6 for each in (level, falling))
    assert level_m == pytest.approx(v**2 / (2 * mu * GRAVITY_MPS2), rel=0.05)
    cos_2 = 36 / 37
    slower = GRAVITY_MPS2 * (mu * math.sqrt(cos_2) - cos_2 / 6)
    assert fallen_m == pytest.approx(v**2 / (2 * slower), rel=0.05)
    assert falling.z_m[-1] == pytest.approx(-(fallen_m + 0.1) / 6, abs=0.06)  # the centre of gravity is farther ahead
    assert np.all(level.z_m == 0.0)


def into(code: int, speed_mps: float, angle_deg: float) -> SimulationLog:
    """A car driven straight into a ditch or embankment that runs along y = 6."""
    heading = math.radians(angle_deg)
    c, s = math.cos(heading), math.sin(heading)
    drives = participant(1, straight(-speed_mps * c, -speed_mps * s, heading, speed_mps, until_s=4.0))
    struck = item(code, 0.0, 6.0)
    return EmbeddedSimulation(SimSettings(), Surface(), 0.75, None).run((drives,), time_limit_s=20.0, objects=(struck,))


def test_a_car_that_runs_squarely_into_an_embankment_is_stopped_by_it() -> None:
    """15 m/s onto 1V:2H: v (cos a - sin a) = 6.7 m/s along the slope are left, too little for its 1.5 m."""
    log = into(EMBANKMENT, 15.0, 90.0)
    (contact,) = log.contacts
    a = math.atan(0.5)
    lost_mps = 15.0 * (1 - (math.cos(a) - math.sin(a)) * math.cos(a))
    assert -contact.delta_v_1_mps[1] == pytest.approx(lost_mps, rel=0.01)
    assert float(log.vehicles[0].z_m.max()) < 1.5


def test_a_car_that_grazes_a_ditch_keeps_most_of_its_speed_and_one_squarely_into_it_does_not() -> None:
    grazing, square = into(DITCH, 20.0, 12.0), into(DITCH, 20.0, 90.0)
    for log in (grazing, square):
        assert len(log.contacts) == 1
    assert math.hypot(*grazing.contacts[0].delta_v_1_mps) < 0.2 * 20.0
    # From 1V:3H down to 1V:3H up is a turn by 36.9 degrees: v (1 - cos + sin) along the slope are lost.
    turn = 2 * math.atan(1 / 3)
    along = 20.0 / math.cos(math.atan(1 / 3)) * (math.cos(turn) - math.sin(turn))
    assert math.hypot(*square.contacts[0].delta_v_1_mps) == pytest.approx(20.0 - along * math.cos(turn / 2), rel=0.1)


def test_the_corner_that_comes_to_a_ditch_first_is_the_one_that_is_pushed() -> None:
    """A car that slides along a ditch at 10 degrees, turned away from it by 20: its right rear is nearest."""
    course, speed_mps = math.radians(10), 12.0
    path = straight(-speed_mps * math.cos(course), 2.9 - speed_mps * math.sin(course), course, speed_mps, until_s=4.0)
    turned = replace(path, heading_rad=path.heading_rad - math.radians(20))
    skids = replace(participant(1, turned, CAR), skids_from_s=0.0)
    simulation = EmbeddedSimulation(SimSettings(), Surface(), 0.75, None)
    log = simulation.run((skids,), time_limit_s=20.0, objects=(item(DITCH, 0.0, 6.0),))
    # Of what it goes across, down one slope, the part into the other is lost, toward that one's normal.
    slope = math.atan(1 / 3)
    lost_mps = speed_mps * math.sin(course) / math.cos(slope) * math.sin(2 * slope) * math.sin(slope)
    assert log.contacts[0].delta_v_1_mps[1] == pytest.approx(-lost_mps, rel=0.05)


def test_a_car_that_slides_sideways_into_a_ditch_overturns_at_speed_and_not_at_a_walk() -> None:
    def sliding(speed_mps: float) -> SimulationLog:
        path = straight(0.0, 3.0 - speed_mps * 0.5, math.pi / 2, speed_mps, until_s=0.5)
        turned = replace(path, heading_rad=np.zeros_like(path.heading_rad), speed_mps=path.x_m * 0)
        skids = replace(participant(1, turned, CAR), skids_from_s=0.0)
        simulation = EmbeddedSimulation(SimSettings(), Surface(), 0.75, None)
        return simulation.run((skids,), time_limit_s=20.0, objects=(item(DITCH, 0.0, 6.0),))

    fast = sliding(14.0)
    assert overturned_at(fast.vehicles[0]) is not None
    assert math.hypot(*fast.contacts[0].delta_v_1_mps) > 0.2 * 14.0  # of what was left of it on the grass
    assert overturned_at(sliding(4.0).vehicles[0]) is None
