"""The physics of contact against closed forms and conservation laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.simulation.motions import CAR, TRUCK, log_of, meeting, participant, straight
from trace_dag.common.settings import SimSettings
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import Body, Contact, SimulationLog, Termination


def closed_form_delta_v(m1: float, m2: float, v1: float, v2: float, e: float) -> tuple[float, float]:
    """Central impact of two masses with restitution e."""
    impulse = (1 + e) * m1 * m2 / (m1 + m2) * (v1 - v2)
    return -impulse / m1, impulse / m2


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize(
    ("body_2", "speed_1", "speed_2"),
    [(CAR, 20.0, -15.0), (TRUCK, 25.0, -22.0), (CAR, 20.0, 0.0), (CAR, 30.0, 18.0), (TRUCK, 12.0, 4.0)],
    ids=["head-on", "head-on with a truck", "into a standing car", "rear-end", "rear-end of a truck"],
)
def test_central_impacts_match_the_closed_form(
    restitution: float, body_2: Body, speed_1: float, speed_2: float
) -> None:
    start_2 = 40.0 if speed_2 < speed_1 else 0.0
    heading_2 = math.pi if speed_2 < 0 else 0.0
    log = log_of(
        (
            participant(1, straight(-20.0, 0.0, 0.0, speed_1)),
            participant(2, straight(start_2, 0.0, heading_2, abs(speed_2)), body_2),
        ),
        SimSettings(restitution=restitution),
    )
    contact = log.contacts[0]
    expected_1, expected_2 = closed_form_delta_v(CAR.mass_kg, body_2.mass_kg, speed_1, speed_2, restitution)
    assert contact.closing_speed_mps == pytest.approx(speed_1 - speed_2, rel=1e-3)
    assert contact.delta_v_1_mps[0] == pytest.approx(expected_1, rel=0.03)
    assert contact.delta_v_2_mps[0] == pytest.approx(expected_2, rel=0.03)
    assert abs(contact.delta_v_1_mps[1]) < 0.01 * abs(expected_1)


CG_AHEAD_M = 0.5 * 4.7 - 0.19 * 4.7 - 0.42 * 0.58 * 4.7  # front axle less its distance to the centre of gravity


def spin_and_velocity(log: SimulationLog, index: int, when: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Position, velocity and yaw rate of a centre of gravity (cars: known offset) at a logged step."""
    vehicle = log.vehicles[index]
    heading = float(vehicle.heading_rad[when])
    ahead = CG_AHEAD_M
    forward, left = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    rate = float(vehicle.yaw_rate_rps[when])
    position = np.array([vehicle.x_m[when], vehicle.y_m[when]]) + ahead * forward
    velocity = np.array([vehicle.velocity_x_mps[when], vehicle.velocity_y_mps[when]]) + ahead * rate * left
    return position, velocity, rate


INERTIA = (1.03 * CAR.mass_kg / 0.45359237 - 1206) * 1.3558179  # Garrott, SAE 930897: slug ft2 by lb
ON_ICE = {"friction": 1e-9, "step_s": 0.005, "log_step_s": 0.005, "time_limit_s": 4.0}
"""Without tyre forces nothing but the contact acts on the two bodies."""


def totals(log: SimulationLog, when: int) -> tuple[np.ndarray, float, float]:
    """Linear momentum, angular momentum about the origin, and kinetic energy of the two cars."""
    momentum, angular, energy = np.zeros(2), 0.0, 0.0
    for index in (0, 1):
        position, velocity, rate = spin_and_velocity(log, index, when)
        momentum += CAR.mass_kg * velocity
        angular += INERTIA * rate + CAR.mass_kg * (position[0] * velocity[1] - position[1] * velocity[0])
        energy += 0.5 * CAR.mass_kg * float(velocity @ velocity) + 0.5 * INERTIA * rate * rate
    return momentum, angular, energy


oblique = st.tuples(
    st.floats(0.2, 2 * math.pi - 0.2),
    st.floats(5.0, 35.0),
    st.floats(5.0, 35.0),
    st.floats(-1.5, 1.5),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from([0.0, 0.3, 0.6]),
)


@given(oblique)
@settings(max_examples=60)
def test_oblique_impacts_conserve_momentum_and_never_gain_energy(
    case: tuple[float, float, float, float, float, float],
) -> None:
    angle, speed_1, speed_2, offset, restitution, friction = case
    log = log_of(
        meeting(angle, speed_1, speed_2, offset),
        SimSettings(restitution=restitution, contact_friction=friction, **ON_ICE),
    )
    contact = log.first_contact
    assume(contact is not None)
    times = log.vehicles[0].time_s
    before = int(np.searchsorted(times, contact.time_s)) - 1
    after = min(int(np.searchsorted(times, contact.time_s + contact.duration_s)) + 1, len(times) - 1)
    momentum_0, angular_0, energy_0 = totals(log, before)
    momentum_1, angular_1, energy_1 = totals(log, after)
    scale = CAR.mass_kg * (speed_1 + speed_2)
    assert np.linalg.norm(momentum_1 - momentum_0) < 1e-6 * scale
    assert abs(angular_1 - angular_0) < 1e-6 * scale * 2.5  # a car's reach
    assert energy_1 <= energy_0 * (1 + 1e-4)


@given(oblique)
@settings(max_examples=25)
def test_a_contact_records_the_motion_of_the_bodies(case: tuple[float, float, float, float, float, float]) -> None:
    angle, speed_1, speed_2, offset, restitution, friction = case
    log = log_of(
        meeting(angle, speed_1, speed_2, offset),
        SimSettings(restitution=restitution, contact_friction=friction, **ON_ICE),
    )
    contact = log.first_contact
    assume(contact is not None and len(log.contacts) == 1 and contact.duration_s <= 0.2)
    times = log.vehicles[0].time_s
    after = min(int(np.searchsorted(times, contact.time_s + contact.duration_s)) + 1, len(times) - 1)
    before = int(np.searchsorted(times, contact.time_s)) - 1
    for index, delta_v in ((0, contact.delta_v_1_mps), (1, contact.delta_v_2_mps)):
        change = spin_and_velocity(log, index, after)[1] - spin_and_velocity(log, index, before)[1]
        assert change == pytest.approx(delta_v, abs=0.02)
    normal = np.array([contact.normal_x, contact.normal_y])
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert normal @ np.array(contact.delta_v_2_mps) >= -1e-6  # bodies are pushed apart, never pulled


@pytest.mark.parametrize("friction", [0.2, 0.5])
@pytest.mark.parametrize(("speed_mps", "tolerance"), [(3.0, 0.02), (10.0, 0.06), (30.0, 0.35)])
def test_bodies_that_slide_past_each_other_are_pushed_apart_as_the_closed_form_says(
    friction: float, speed_mps: float, tolerance: float
) -> None:
    """A sideswipe: sliding does not stop, so that Coulomb's law fixes the tangential impulse and, with the restitution,
    the normal one (planar impact of rigid bodies with friction: Brach, Mechanical Impact Dynamics).

    The closed form is of an instant. A contact takes some 0.2 s whatever the speed, so that cars that slide past each
    other at 1.5 m/s move on by 0.3 m while they press, at 15 m/s by more than 3 m: lever arms and normal are then no
    longer those of the first touch. The two agree as the distance shrinks."""
    restitution = 0.1
    settings = SimSettings(restitution=restitution, contact_friction=friction, **ON_ICE)
    contact = log_of(meeting(-0.25, speed_mps, speed_mps / 2, 1.7), settings).contacts[0]
    normal = np.array([contact.normal_x, contact.normal_y])
    tangent = np.array([-normal[1], normal[0]])
    point = np.array([contact.x_m, contact.y_m])
    yielding, coupling = 0.0, 0.0  # velocity along the normal for an impulse along the normal, and along the tangent
    for pose in (contact.pose_1, contact.pose_2):
        arm = point - (pose.xy_m + CG_AHEAD_M * pose.forward)
        along_n, along_t = arm[0] * normal[1] - arm[1] * normal[0], arm[0] * tangent[1] - arm[1] * tangent[0]
        yielding += 1 / CAR.mass_kg + along_n**2 / INERTIA
        coupling += along_n * along_t / INERTIA
    past = np.array(contact.velocity_2_mps) - np.array(contact.velocity_1_mps)
    sense = -math.copysign(friction, float(past @ tangent))
    expected = (1 + restitution) * -float(past @ normal) / (yielding + sense * coupling)
    impulse = CAR.mass_kg * np.array(contact.delta_v_2_mps)
    assert impulse @ tangent == pytest.approx(sense * (impulse @ normal), rel=min(tolerance, 0.1))
    assert impulse @ normal == pytest.approx(expected, rel=tolerance)


CASES = {
    "head-on, offset": meeting(math.pi, 22.0, 18.0, 0.9),
    "right angle": meeting(math.pi / 2, 15.0, 20.0, 0.4),
    "oblique": meeting(2.4, 20.0, 25.0, -0.6),
    "rear-end at an angle": meeting(0.25, 28.0, 14.0, 0.2),
}


@pytest.mark.parametrize("case", CASES)
def test_halving_the_step_changes_little(case: str) -> None:
    coarse = log_of(CASES[case], SimSettings(step_s=0.005)).contacts[0]
    fine = log_of(CASES[case], SimSettings(step_s=0.0025)).contacts[0]
    assert math.hypot(coarse.x_m - fine.x_m, coarse.y_m - fine.y_m) < 0.05
    for one, two in ((coarse.delta_v_1_mps, fine.delta_v_1_mps), (coarse.delta_v_2_mps, fine.delta_v_2_mps)):
        assert math.hypot(one[0] - two[0], one[1] - two[1]) < 0.03 * math.hypot(*two)


@pytest.mark.parametrize("delta_v_kmh", [30.0, 50.0, 70.0])
def test_cars_crush_each_other_as_deep_and_as_long_as_in_tests(delta_v_kmh: float) -> None:
    """Head-on into its like each car is in a barrier test: at 56 km/h 0.5 to 0.65 m of dynamic crush (NHTSA's frontal
    tests at 35 mph), which grows with the speed; pulses last 70 to 150 ms."""
    speed = delta_v_kmh / 3.6
    pair = participant(1, straight(-20.0, 0.0, 0.0, speed)), participant(2, straight(20.0, 0.0, math.pi, speed))
    contact = log_of(pair).contacts[0]
    assert 0.07 < contact.duration_s < 0.15
    assert contact.crush_1_m == pytest.approx(contact.crush_2_m)
    assert 0.5 * delta_v_kmh / 56 < contact.crush_1_m < 0.65 * delta_v_kmh / 56


def test_the_side_is_pressed_in_deeper_than_the_front_that_strikes_it() -> None:
    contact = log_of(meeting(math.pi / 2, 15.0, 0.0)).contacts[0]
    assert contact.crush_2_m > 1.2 * contact.crush_1_m


def test_less_comes_back_the_faster_they_meet() -> None:
    """0.2 to 0.4 at 2 m/s, about 0.1 at medium and high speeds (SAE 931842); 0.126 and 0.089 in staged tests that close
    with 23.4 and 24.1 m/s along their normal (SAE 2006-01-0908)."""
    found = []
    for speed in (1.0, 8.0, 11.9, 16.0):
        pair = participant(1, straight(-4.0, 0.0, 0.0, speed)), participant(2, straight(4.0, 0.0, math.pi, speed))
        found.append(-log_of(pair, SimSettings(**ON_ICE)).contacts[0].delta_v_1_mps[0] / speed - 1)
    assert 0.2 < found[0] < 0.45
    assert 0.02 < found[3] < found[2] < found[1] < 0.2
    assert 0.089 < found[2] < 0.126


def test_the_first_touch_is_where_geometry_puts_it() -> None:
    """Head-on without offset: fronts meet where the closed form says, between steps, at the faces' middle."""
    log = log_of((participant(1, straight(-30.0, 0.0, 0.0, 17.3)), participant(2, straight(31.7, 0.0, math.pi, 11.9))))
    contact: Contact = log.contacts[0]
    meet_s = (61.7 - CAR.length_m) / (17.3 + 11.9)
    assert contact.time_s == pytest.approx(meet_s, abs=1e-4)
    assert contact.x_m == pytest.approx(-30.0 + 17.3 * meet_s + CAR.length_m / 2, abs=0.005)
    assert contact.y_m == pytest.approx(0.0, abs=1e-6)
    assert (contact.normal_x, contact.normal_y) == pytest.approx((1.0, 0.0))


def test_three_vehicles_collide_one_after_the_other() -> None:
    log = log_of(
        (
            participant(1, straight(-60.0, 0.0, 0.0, 25.0)),
            participant(2, straight(0.0, 0.0, 0.0, 0.0)),
            participant(3, straight(7.0, 0.0, 0.0, 0.0)),
        )
    )
    pairs = [(contact.number_1, contact.number_2) for contact in log.contacts]
    assert pairs[:2] == [(1, 2), (2, 3)]
    assert log.termination is Termination.AT_REST
    pushed = log.contacts[1]
    assert pushed.delta_v_2_mps[0] > 5.0
    assert log.contacts[0].delta_v_1_mps[0] < -5.0


def test_a_run_that_ended_by_its_contacts_goes_on_as_if_it_had_not() -> None:
    pushed = tuple(
        participant(number, straight(x_m, 0.0, 0.0, v)) for number, x_m, v in ((1, -20.0, 20.0), (2, 0.0, 0.0))
    )
    queue = (*pushed, participant(3, straight(7.0, 0.0, 0.0, 0.0)))
    whole = log_of(queue)
    assert [(each.number_1, each.number_2) for each in whole.contacts[:2]] == [(1, 2), (2, 3)]
    run = EmbeddedSimulation(SimSettings(), Surface(), 0.75).begin(queue, time_limit_s=20.0)
    begun = run.log(as_long_as=lambda contacts: len(contacts) < 2)
    assert len(begun.contacts) == 2
    assert whole.contacts[1].time_s <= begun.duration_s <= whole.contacts[1].time_s + 2 * SimSettings().log_step_s
    after = run.log()
    assert after.contacts == whole.contacts
    assert np.array_equal(after.vehicle_log(3).x_m, whole.vehicle_log(3).x_m)
