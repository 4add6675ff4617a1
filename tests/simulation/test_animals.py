"""Animals against closed forms: size and gait, momentum, Searle's throw, and what happens to who strikes one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.motions import CAR, crossing, log_of
from trace_dag.common.errors import Failure
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.event_parties import Pace, Species
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.body_sizes import SIZES, animal_speed_mps
from trace_dag.simulation.quadrupeds import LANDMARKS
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, overturned_at

MOTORCYCLE = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.MOTORCYCLE, 2.25, 0.85, 1.20, 340.0)
MU = 0.66


def animal(species: Species) -> Body:
    size = SIZES[species]
    return Body(BodyKind.ANIMAL, VehicleClass.OTHER, size.length_m, size.width_m, size.stature_m, size.mass_kg)


def struck(species: Species, by: Body, speed_mps: float) -> SimulationLog:
    vehicle, mover = crossing(by, animal(species), speed_mps, walks_mps=animal_speed_mps(species, Pace.TROTTING))
    return log_of((vehicle, replace(mover, number=2001)))


@pytest.mark.parametrize("species", Species)
def test_animals_walk_trot_and_gallop_where_froude_numbers_say(species: Species) -> None:
    """Alexander and Jayes (1983): from a walk to a trot near 0.5, from a trot to a gallop between 2 and 3."""
    hip_m = 0.8 * SIZES[species].stature_m
    walk, trot, gallop = (animal_speed_mps(species, pace) ** 2 / (GRAVITY_MPS2 * hip_m) for pace in Pace)
    assert walk < 0.5 < trot < 2.0
    assert gallop > 3.0


@pytest.mark.parametrize("species", Species)
def test_an_animal_stands_on_the_road_and_is_as_high_as_said(species: Species) -> None:
    log = struck(species, CAR, 15.0)
    mover = log.vehicle_log(2001)
    first = dict(zip(LANDMARKS, mover.landmarks_m[0].reshape(-1, 3), strict=True))
    body = animal(species)
    feet = [first[f"foot_{leg}"][2] for leg in ("fl", "fr", "hl", "hr")]
    assert feet == pytest.approx([0.03 * body.height_m] * 4, abs=0.005)
    assert first["withers"][2] + body.width_m / 2 == pytest.approx(body.height_m, rel=0.08)  # legs apart as it trots
    assert first["nose"][2] > first["withers"][2]
    assert np.hypot(*(first["nose"] - first["rump"])[:2]) < body.length_m


@pytest.mark.parametrize("species", Species)
def test_the_momentum_lost_by_the_vehicle_is_gained_by_the_animal(species: Species) -> None:
    log = struck(species, CAR, 20.0)
    contact = log.contacts[0]
    lost_ns, gained_ns = CAR.mass_kg * contact.delta_v_1_mps[0], SIZES[species].mass_kg * contact.delta_v_2_mps[0]
    assert -lost_ns == pytest.approx(gained_ns, rel=0.15)


@pytest.mark.parametrize("speed_mps", [15.0, 25.0])
def test_a_deer_leaves_as_fast_as_the_car(speed_mps: float) -> None:
    """Its trunk is as high as the hood's edge, and nothing bounces: both end up at the common velocity."""
    log = struck(Species.DEER, CAR, speed_mps)
    common_mps = speed_mps * CAR.mass_kg / (CAR.mass_kg + SIZES[Species.DEER].mass_kg)
    assert log.contacts[0].delta_v_2_mps[0] == pytest.approx(common_mps, rel=0.1)


@pytest.mark.parametrize("speed_mps", [15.0, 20.0, 30.0])
def test_a_deer_is_thrown_as_far_as_searle_says(speed_mps: float) -> None:
    """SAE 831622: v^2 / (2 mu g) at most, for a body that is not carried; less its share of the momentum."""
    log = struck(Species.DEER, CAR, speed_mps)
    mover, start = log.vehicle_log(2001), log.contacts[0].pose_2
    thrown_m = math.hypot(mover.x_m[-1] - start.x_m, mover.y_m[-1] - start.y_m)
    left_mps = speed_mps * CAR.mass_kg / (CAR.mass_kg + SIZES[Species.DEER].mass_kg)
    most_m = speed_mps**2 / (2 * MU * GRAVITY_MPS2)
    assert left_mps**2 / (2 * MU * GRAVITY_MPS2) / (1 + MU**2) < thrown_m < 1.1 * most_m


def test_a_motorcycle_falls_and_a_car_goes_on() -> None:
    over = struck(Species.DEER, MOTORCYCLE, 22.0)
    assert overturned_at(over.vehicle_log(1)) is not None
    upright = struck(Species.DEER, CAR, 22.0)
    assert overturned_at(upright.vehicle_log(1)) is None


def test_a_body_of_which_no_animal_can_be_made_is_refused() -> None:
    vehicle, mover = crossing(CAR, replace(animal(Species.DEER), mass_kg=5000.0), 15.0)
    with pytest.raises(Failure, match=r"animal 1001: its mass is the animal's, 3\.0 to 1200\.0 kg"):
        log_of((vehicle, mover))
