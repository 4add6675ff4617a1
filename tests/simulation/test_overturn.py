"""Overturning in the simulation: against a kerb at the critical sliding velocity, on soil, on pavement, motorcycles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.roads.networks import FRAME, lanes
from tests.simulation.motions import CAR, participant, straight
from tests.simulation.test_objects import CURB, item
from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import VehicleClass
from trace_dag.roads.map.model import LaneSection, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.overturn import roll_model
from trace_dag.simulation.states import LossOfControl, Trajectory
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, Termination, VehicleLog, overturned_at

MOTORCYCLE = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.MOTORCYCLE, 2.2, 0.8, 1.4, 300.0)
TRACTOR = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.TRACTOR_TRAILER, 20.0, 2.5, 3.9, 30000.0)
# A street along the x axis, 7 m wide; soil beside it.
STREET = RoadNetwork(FRAME, (Road("1", 400.0, (PlanElement(0, -200, 0, 0, 400.0),), (LaneSection(0, lanes(1, 1)),)),))


def sliding(
    speed_mps: float,
    body: Body = CAR,
    *,
    objects: tuple[FixedObject, ...] = (),
    network: RoadNetwork | None = None,
    heading_rad: float = 0.0,
    y_m: float = -6.0,
    digs_in: bool = False,
) -> SimulationLog:
    """A vehicle that slides northward with its left side ahead and is let go half a second after the start, when it
    comes to ``y_m``."""
    path = straight(0.0, y_m - speed_mps * 0.5, math.pi / 2, speed_mps, until_s=0.5)
    turned: Trajectory = replace(path, heading_rad=np.full_like(path.heading_rad, heading_rad), speed_mps=path.x_m * 0)
    losses = (LossOfControl(0.5, digs_in=True),) if digs_in else ()
    skids = replace(participant(1, turned, body), skids_from_s=0.0, losses_of_control=losses)
    simulation = EmbeddedSimulation(SimSettings(), Surface(), 0.75, network)
    return simulation.run((skids,), time_limit_s=20.0, objects=objects)


def roll_deg(vehicle: VehicleLog) -> float:
    return abs(math.degrees(float(vehicle.roll_rad[-1])))


def test_a_car_that_slides_sideways_into_a_curb_overturns_above_the_critical_velocity() -> None:
    """Jones, SAE 750461, with h, t and k of the model: a car's critical sliding velocity is 5 to 7 m/s."""
    model = roll_model(CAR)
    assert model is not None
    assert 5.0 < model.critical_mps < 7.0
    kerb = item(CURB, 0.0, CAR.width_m / 2 + 0.3)
    outcomes = {}
    for share in (0.85, 1.15):
        # Two decimetres before the kerb: pavement takes hardly any of its speed.
        log = sliding(share * model.critical_mps, objects=(kerb,), y_m=0.0)
        outcomes[share] = overturned_at(log.vehicles[0]) is not None
        assert len(log.contacts) == 1
    assert outcomes == {0.85: False, 1.15: True}


def test_wheels_that_dig_in_catch_at_the_kerb_of_a_street() -> None:
    """At the edge of a street, 3.5 m from its middle, from the critical sliding velocity on: pavement takes little of
    the speed over the half metre before it."""
    model = roll_model(CAR)
    assert model is not None
    before_m = 3.5 - CAR.width_m / 2 - 0.5
    for share, digs_in, overturns in ((1.3, True, True), (0.8, True, False), (1.3, False, False)):
        log = sliding(share * model.critical_mps, network=STREET, y_m=before_m, digs_in=digs_in)
        assert (overturned_at(log.vehicles[0]) is not None) is overturns, (share, digs_in)


def test_the_stability_of_a_class_is_its_static_stability_factor() -> None:
    """NHTSA, DOT HS 809 868: track / (2 height)."""
    for vehicle_class, factor in ((VehicleClass.CAR, 1.41), (VehicleClass.SUV, 1.17), (VehicleClass.PICKUP, 1.18)):
        model = roll_model(Body(BodyKind.MOTOR_VEHICLE, vehicle_class, 4.8, 1.9, 1.6, 1800.0))
        assert model is not None
        assert model.half_track_m / model.height_m == pytest.approx(factor)


def test_pavement_does_not_tip_a_car_and_tips_a_loaded_tractor_trailer() -> None:
    """Friction 0.75 lies between the factors of the two."""
    assert overturned_at(sliding(20.0).vehicles[0]) is None
    assert overturned_at(sliding(20.0, TRACTOR).vehicles[0]) is not None


def test_a_car_that_digs_into_soil_rolls_and_slides_to_rest_at_half_a_g() -> None:
    log = sliding(22.0, network=STREET, y_m=10.0)
    vehicle = log.vehicles[0]
    over = overturned_at(vehicle)
    assert over is not None
    assert log.termination is Termination.AT_REST
    speed_mps = math.hypot(vehicle.velocity_x_mps[over], vehicle.velocity_y_mps[over])
    slid_m = float(vehicle.y_m[-1] - vehicle.y_m[over])
    assert speed_mps**2 / (2 * 0.6 * 9.81) < slid_m < speed_mps**2 / (2 * 0.4 * 9.81)
    assert roll_deg(vehicle) % 90 == pytest.approx(0.0, abs=3.0) or roll_deg(vehicle) % 90 > 87.0
    assert roll_deg(vehicle) >= 90 - 3
    # It slid with its left side ahead: it rolls over that side, to the left.
    assert vehicle.roll_rad[-1] < 0


def test_a_motorcycle_out_of_control_falls_on_its_side_and_slides() -> None:
    log = sliding(15.0, MOTORCYCLE, heading_rad=math.pi / 2)
    vehicle = log.vehicles[0]
    assert roll_deg(vehicle) == pytest.approx(90.0, abs=1.0)
    slid_m = float(vehicle.y_m[-1] - vehicle.y_m[0])
    assert 15.0**2 / (2 * 0.6 * 9.81) < slid_m - 7.5 < 15.0**2 / (2 * 0.4 * 9.81)


def test_a_body_stands_on_its_corner_while_it_rolls() -> None:
    vehicle = sliding(22.0, network=STREET, y_m=10.0).vehicles[0]
    half_diagonal_m = math.hypot(CAR.width_m, CAR.height_m) / 2
    assert vehicle.above_road_m[0] == pytest.approx(CAR.height_m / 2)
    assert CAR.width_m / 2 < vehicle.above_road_m.max() <= half_diagonal_m + 1e-6


def circling(speed_mps: float, turned_deg: float) -> VehicleLog:
    """A car beside the street that is let go half a second after the start, with its front wheels turned, on soil."""
    away_rad = math.copysign(math.pi / 2, turned_deg)
    path = straight(0.0, math.copysign(4.0, turned_deg), away_rad, speed_mps, until_s=0.5)
    lost = LossOfControl(0.5, wheels_rad=math.radians(turned_deg), locked_wheels=0.0, digs_in=True)
    crash = replace(participant(1, path, CAR), beyond_edge=True, losses_of_control=(lost,))
    log = EmbeddedSimulation(SimSettings(), Surface(), 0.75, STREET).run((crash,), time_limit_s=20.0)
    return log.vehicles[0]


@pytest.mark.parametrize(("turned_deg", "outside"), [(16.0, 1.0), (-16.0, -1.0)])
def test_a_car_that_circles_on_soil_tips_to_the_outside(turned_deg: float, outside: float) -> None:
    """To the left it tips to its right, which is positive."""
    vehicle = circling(25.0, turned_deg)
    over = overturned_at(vehicle)
    assert over is not None
    assert math.copysign(1.0, float(vehicle.roll_rad[over])) == outside


@pytest.mark.parametrize("speed_mps", [8.0, 15.0])
def test_wheels_that_dig_in_take_energy(speed_mps: float) -> None:
    """The ground pushes a turned wheel across the wheel: it slows down the car that it holds in its curve."""
    vehicle = circling(speed_mps, 16.0)
    speeds_mps = np.hypot(vehicle.velocity_x_mps, vehicle.velocity_y_mps)[vehicle.time_s > 1.0]
    assert len(speeds_mps) > 50
    assert (np.diff(speeds_mps) < 0.001).all()
