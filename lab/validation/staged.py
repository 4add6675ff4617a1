"""Staged collisions: two of NHTSA's oblique offset tests of cars into sport utility vehicles.

Source: Rose, Fenton and Beauchamp, "Effects of Restitution in the Application of Crush Analysis", SAE 2006-01-0908:
speeds, headings, masses, yaw inertias, place of the impact, and delta-v and change of yaw rate of both by the paper's
planar impact fit to the tests. Angles are counter-clockwise; an angle of impact is seen from the vehicle's centre of
gravity, from its front.

The changes of velocity and yaw rate are as printed, with one sign: the paper prints 31 degrees a second for the car of
test 4363, but its own inputs (place, normal, restitution, ratio of impulses) come to -31 and 183 by planar impact, and
to 110 and 151 where it prints 108 and 148. It is small because the impulse passes within 6 cm of the centre of gravity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from lab.validation.placing import meeting
from lab.validation.plastic import plastic_delta_v
from lab.validation.rows import simulate
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import KG_PER_LB, METRES_PER_FOOT, mph_to_mps, mps_to_kmh
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import Body, BodyKind, SimulationLog
from trace_dag.simulation.vehicles import vehicle_model


@dataclass(frozen=True)
class StagedVehicle:
    """A vehicle of a test: its body, heading, speed, the impact's place from its centre of gravity, the outcome."""

    name: str
    body: Body
    heading_deg: float
    speed_mph: float
    to_impact_ft: float
    impact_deg: float
    delta_v_mph: float
    yaw_change_dps: float


@dataclass(frozen=True)
class StagedTest:
    """A test by its number in NHTSA's vehicle crash test database."""

    number: int
    vehicles: tuple[StagedVehicle, StagedVehicle]


def _body(vehicle_class: VehicleClass, length_m: float, width_m: float, height_m: float, weight_lb: float) -> Body:
    return Body(BodyKind.MOTOR_VEHICLE, vehicle_class, length_m, width_m, height_m, weight_lb * KG_PER_LB)


_ACCORD: Final = _body(VehicleClass.CAR, 4.76, 1.78, 1.40, 3451.1)
_BLAZER: Final = _body(VehicleClass.SUV, 4.60, 1.72, 1.63, 4695.4)
_TRAILBLAZER: Final = _body(VehicleClass.SUV, 4.87, 1.90, 1.81, 5192.5)

TESTS: Final = (
    StagedTest(
        4363,
        (
            StagedVehicle("1997 Honda Accord", _ACCORD, 180.0, 35.1, 2.6, 23.8, 39.5, -31.0),
            StagedVehicle("1997 Chevrolet Blazer", _BLAZER, 32.0, 35.0, 5.7, 10.6, 29.1, 182.0),
        ),
    ),
    StagedTest(
        4364,
        (
            StagedVehicle("1997 Honda Accord", _ACCORD, 180.0, 35.0, 2.3, 45.7, 40.1, 108.0),
            StagedVehicle("2002 Chevrolet Trailblazer", _TRAILBLAZER, 30.0, 34.9, 7.1, 11.2, 26.6, 148.0),
        ),
    ),
)


@dataclass(frozen=True)
class StagedResult:
    """A vehicle of a test beside the simulator and the plastic peer; km/h, degrees a second (counter-clockwise)."""

    test: int
    vehicle: str
    measured_delta_v_kmh: float
    simulated_delta_v_kmh: float
    plastic_delta_v_kmh: float
    measured_yaw_dps: float
    simulated_yaw_dps: float


def staged_results(settings: SimSettings) -> list[StagedResult]:
    """Return both vehicles of each test."""
    return [result for test in TESTS for result in _result(test, settings)]


def _result(test: StagedTest, settings: SimSettings) -> list[StagedResult]:
    one, two = test.vehicles
    headings = math.radians(one.heading_deg), math.radians(two.heading_deg)
    speeds = mph_to_mps(one.speed_mph), mph_to_mps(two.speed_mph)
    placed = meeting((one.body, two.body), headings, speeds, (_impact_m(one), _impact_m(two)))
    assert placed is not None  # they are driven at each other
    log = simulate(placed, settings)
    contact = log.first_contact
    assert contact is not None
    velocities = [(v * math.cos(h), v * math.sin(h)) for v, h in zip(speeds, headings, strict=True)]
    plastic = plastic_delta_v((one.body.mass_kg, two.body.mass_kg), velocities[0], velocities[1])
    delta_vs = (contact.delta_v_1_mps, contact.delta_v_2_mps)
    return [
        StagedResult(
            test=test.number,
            vehicle=vehicle.name,
            measured_delta_v_kmh=mps_to_kmh(mph_to_mps(vehicle.delta_v_mph)),
            simulated_delta_v_kmh=mps_to_kmh(math.hypot(*delta_vs[k])),
            plastic_delta_v_kmh=mps_to_kmh(math.hypot(*plastic[k])),
            measured_yaw_dps=vehicle.yaw_change_dps,
            simulated_yaw_dps=math.degrees(_when_apart(log, k)),
        )
        for k, vehicle in enumerate(test.vehicles)
    ]


def _impact_m(vehicle: StagedVehicle) -> tuple[float, float]:
    """Return the place of the impact, ahead and to the left of the body's middle."""
    away_m, angle = vehicle.to_impact_ft * METRES_PER_FOOT, math.radians(vehicle.impact_deg)
    return vehicle_model(vehicle.body).cg_ahead_m + away_m * math.cos(angle), away_m * math.sin(angle)


def _when_apart(log: SimulationLog, index: int) -> float:
    """Return the yaw rate of a vehicle that did not turn before, once the two are apart (rad/s)."""
    contact, vehicle = log.first_contact, log.vehicles[index]
    assert contact is not None
    k = int(np.searchsorted(vehicle.time_s, contact.time_s + contact.duration_s))
    return float(vehicle.yaw_rate_rps[min(k, len(vehicle.time_s) - 1)])
