"""Strikes of people: planned by the analytic estimator, simulated and judged, on a street made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.roads.networks import FRAME, lanes
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import StateSettings
from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Turn
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import PartyKind, person_party, thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, NonMotorist, PreCrashMovement
from trace_dag.reconstruction.analytic_hypotheses import build_scene
from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.motion.walking import Course, readings, reported_directions
from trace_dag.reconstruction.planners.impact_plans import impact_plans
from trace_dag.reconstruction.planners.pedestrian import first_states, person_met
from trace_dag.roads.map.model import Crosswalk, LaneSection, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement, MapReport
from trace_dag.simulation.states import Manoeuvre, StateEstimate

PLACE = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "nearest road"), ())


def walker(**fields: object) -> NonMotorist:
    """A man of 40 who is struck in a travel lane, away from an intersection."""
    person = NonMotorist(1, 5, 1, 40, 1, location_code=13, pedestrian_position_code=3)
    return replace(person, **fields)  # type: ignore[arg-type]


def rider(**fields: object) -> NonMotorist:
    person = NonMotorist(1, 6, 1, 40, 1, location_code=13, cyclist_position_code=1)
    return replace(person, **fields)  # type: ignore[arg-type]


def struck(
    person: NonMotorist, *, clock_h: int = 12, speed_mps: float = 15.0, code: int = 8, vehicles: int = 1
) -> CrashRecord:
    """Cars that go straight, their drivers doing nothing (P_CRASH3 1), strike a person one after the other, the first
    one in the reported area."""
    cars = tuple(
        replace(vehicle(number, clock_h, 13, speed_mps=speed_mps), avoidance_code=1)
        for number in range(1, vehicles + 1)
    )
    events = tuple(
        EventRecord(car.number, code, car.number, car.impact, person_party(person.number), None) for car in cars
    )
    made = record(cars[0], cars[0], events=events)
    return replace(
        made,
        vehicles=cars,
        first_harmful_event_code=code,
        vehicles_in_transport=vehicles,
        non_motorists=(person,),
        road_relation_code=1,
    )


def estimated(crash: CrashRecord) -> StateEstimate:
    return estimate(crash, STREET, PLACE, StateSettings())


def relative_deg(found: StateEstimate) -> float:
    """Heading of the person less that of the vehicle, at the strike, in the best hypothesis."""
    car, person = found.best.participants
    return math.degrees(wrap_angle(person.impact_pose.heading_rad - car.impact_pose.heading_rad))


# --- which way the person went ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("person", "turn", "courses"),
    [
        # PEDSNR: a from the motorist's left, b from the right; of turns at the far side a goes the motorist's way.
        (walker(scenario="1a", pedestrian_group_code=750), None, {Course.FROM_LEFT}),
        (walker(scenario="4b", pedestrian_group_code=750), None, {Course.FROM_RIGHT}),
        (walker(scenario="11a", pedestrian_group_code=790), Turn.LEFT, {Course.FROM_LEFT}),
        (walker(scenario="11b", pedestrian_group_code=790), Turn.LEFT, {Course.FROM_RIGHT}),
        (walker(scenario="7a", pedestrian_group_code=790), Turn.RIGHT, {Course.FROM_RIGHT}),
        (walker(scenario="5a", pedestrian_group_code=790), Turn.RIGHT, {Course.FROM_LEFT}),
        # Motorist southbound, pedestrian eastbound: towards the motorist's left, so from the right.
        (
            walker(pedestrian_direction_code=2, motorist_direction_code=3, pedestrian_type_code=760),
            None,
            {Course.FROM_RIGHT},
        ),
        (walker(pedestrian_type_code=410), None, {Course.ALONG}),
        (walker(pedestrian_type_code=440), None, {Course.TOWARDS}),
        (walker(pedestrian_type_code=610), None, {Course.STANDING}),
        (walker(pedestrian_type_code=760), None, {Course.FROM_LEFT, Course.FROM_RIGHT}),
        (walker(actions=(3,)), None, {Course.FROM_LEFT, Course.FROM_RIGHT}),
        (walker(), None, set()),
        (rider(cyclist_type_code=231), None, {Course.ALONG}),
        (rider(cyclist_type_code=250), None, {Course.TOWARDS}),
        (rider(cyclist_direction_code=2), None, {Course.TOWARDS}),
        # Oncoming cyclist, motorist turns left: it comes from the right of where the motorist then goes.
        (rider(cyclist_type_code=212), Turn.LEFT, {Course.FROM_RIGHT}),
        (rider(cyclist_type_code=213), Turn.RIGHT, {Course.FROM_RIGHT}),
    ],
)
def test_courses_are_those_of_the_typing_manual(person: NonMotorist, turn: Turn | None, courses: set[Course]) -> None:
    assert reported_directions(person, turn) == courses


def test_open_shares_are_distributed() -> None:
    """Without any typing every course stays, and the shares add up to one; the sides by 524 to 463 of the typing."""
    shares = {reading.course: math.exp(reading.log_prior) for reading in readings(walker(), None, None)}
    assert set(shares) == set(Course)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares[Course.FROM_LEFT] / shares[Course.FROM_RIGHT] == pytest.approx(0.53 / 0.47)
    assert not any(reading.told for reading in readings(walker(), None, None))


# --- estimates -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("person", "code", "expected_deg"),
    [
        (walker(scenario="1a", pedestrian_type_code=760), 8, -90.0),
        (walker(scenario="1b", pedestrian_type_code=760), 8, 90.0),
        (walker(pedestrian_type_code=410), 8, 0.0),
        (walker(pedestrian_type_code=440), 8, 180.0),
        (rider(cyclist_type_code=231), 9, 0.0),
        (rider(cyclist_type_code=250), 9, 180.0),
    ],
)
def test_the_person_comes_from_where_the_report_states(person: NonMotorist, code: int, expected_deg: float) -> None:
    found = estimated(struck(person, code=code))
    assert abs(math.remainder(relative_deg(found) - expected_deg, 360.0)) < 1.0
    assert math.hypot(*found.best.impact_point_xy_m) < 5.0
    (planned,) = found.best.planned
    assert (planned.event_number, planned.party_1, planned.party_2) == (1, 1, 1001)
    assert planned.time_s == StateSettings().lead_time_s


def test_speeds_are_those_of_the_sources() -> None:
    """Carson 2024: 4.3 ft/s in crosswalks; Gates et al. 2006: 3.81 ft/s from 65 on; Attalla and Kodsi 2013: 20 % faster
    away from crosswalks; Twisk et al.: cyclists 17.8 km/h."""
    crossing = {"pedestrian_type_code": 760}
    for person, code, speed_mps in (
        (walker(pedestrian_position_code=2, **crossing), 8, 4.3 * 0.3048),
        (walker(age_years=70, pedestrian_position_code=2, **crossing), 8, 3.81 * 0.3048),
        (walker(**crossing), 8, 1.2 * 4.3 * 0.3048),
        (rider(cyclist_type_code=231), 9, 17.8 / 3.6),
    ):
        state = next(each for each in estimated(struck(person, code=code)).best.participants if each.is_figure)
        assert state.impact_speed_mps == pytest.approx(speed_mps)


def test_a_person_dashing_out_stands_beside_the_road_before() -> None:
    state = estimated(struck(walker(scenario="1b", pedestrian_type_code=741))).best.participants[1]
    assert state.initial_speed_mps == 0.0
    assert abs(state.initial_pose.y_m) > 3.5  # the carriageway is 7 m wide
    assert state.impact_speed_mps > 3.0


def test_both_sides_are_hypotheses_where_the_report_leaves_it_open() -> None:
    found = estimated(struck(walker(pedestrian_type_code=760)))
    manoeuvres = {state.manoeuvre for hypothesis in found.hypotheses for state in hypothesis.participants[1:]}
    assert {Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT} <= manoeuvres


@pytest.mark.parametrize(("location", "expected_m"), [(10, 4.5), (11, 0.0)])  # in a marked crosswalk, outside one
def test_a_person_in_a_crosswalk_is_struck_in_that_of_the_map(location: int, expected_m: float) -> None:
    """Lines 3 m wide, from 4 m to 7 m east of the reported point, along which the strike may be a stride aside."""
    outline = ((-1.5, -4.0), (1.5, -4.0), (1.5, 4.0), (-1.5, 4.0))
    (road,) = STREET.roads
    street = RoadNetwork(STREET.frame, (replace(road, crosswalks=(Crosswalk("1", 305.5, outline),)),))
    person = walker(location_code=location, pedestrian_position_code=None)
    made = estimate(struck(person), street, PLACE, StateSettings())
    assert made.best.impact_point_xy_m[0] == pytest.approx(expected_m, abs=1.2)


def test_the_vehicle_leaves_the_carriageway_for_whom_it_struck_on_the_shoulder() -> None:
    found = estimated(struck(walker(pedestrian_position_code=4, location_code=20, pedestrian_type_code=410)))
    car, person = found.best.participants
    assert car.manoeuvre is Manoeuvre.LEAVE_ROAD
    assert abs(person.impact_pose.y_m) > 3.5


@pytest.mark.parametrize(("action", "speed_mps", "heading_deg"), [(5, 4.94, 0.0), (6, 4.94, 180.0), (2, 0.0, 90.0)])
def test_a_rider_met_beside_the_road_rides_as_reported(action: int, speed_mps: float, heading_deg: float) -> None:
    """A car met it with its front at the origin, after 6 s. ``NMACTION``: with traffic, against it, none."""
    person = rider(actions=(action,))
    scene = build_scene(struck(person, code=9), STREET, PLACE, lead_time_s=5.0)
    state = person_met(scene, person, np.zeros(2), 0.0, Pose(0.0, 0.0, 0.0), 6.0)
    path, at = state.trajectory, state.impact_pose
    assert state.impact_speed_mps == pytest.approx(speed_mps, abs=0.01)
    assert abs(math.degrees(math.remainder(at.heading_rad, math.pi))) == pytest.approx(
        abs(heading_deg) % 180.0, abs=0.01
    )
    assert at.x_m == pytest.approx((state.width_m if action == 2 else state.length_m) / 2, abs=0.01)
    began_m = float(np.interp(1.0, path.time_s, path.x_m)) - at.x_m  # 5 s before
    assert began_m == pytest.approx(-5.0 * speed_mps * math.cos(math.radians(heading_deg)), abs=0.1)


@pytest.mark.parametrize("left_hand", [False, True])
def test_the_driver_stops_at_the_kerb_of_the_side_that_traffic_keeps_to(left_hand: bool) -> None:
    network = RoadNetwork(FRAME, tuple(replace(road, left_hand=left_hand) for road in STREET.roads))
    scene = build_scene(struck(walker(), vehicles=2), network, PLACE, lead_time_s=5.0)
    plan = impact_plans(scene, sequence_of(scene.record).first)[0]
    driver, _ = first_states(scene, plan, [], 5.0, pulls_over=True)
    path = driver.trajectory
    _, moved_m = plan.drive.path.project(float(path.x_m[-1]), float(path.y_m[-1]))
    assert moved_m == pytest.approx(3.2 if left_hand else -3.2, abs=0.3)


def test_a_language_model_is_not_asked_and_the_estimate_has_a_note() -> None:
    made = estimate(struck(walker()), STREET, PLACE, StateSettings(estimator="llm"))
    assert (made.run.estimator, made.run.fallback_from, made.run.attempts) == ("analytic", "llm", 0)
    assert "two vehicles only" in made.run.fallback_reason


# --- animals -------------------------------------------------------------------------------------------------------
def with_animal(*, clock_h: int = 12, speed_mps: float = 20.0) -> CrashRecord:
    """A car that goes straight strikes a live animal on the roadway; nothing more is told."""
    car = vehicle(1, clock_h, 13, speed_mps=speed_mps)
    made = record(car, car, events=(EventRecord(1, 11, 1, car.impact, thing_party(1), None),))
    return replace(made, vehicles=(car,), first_harmful_event_code=11, vehicles_in_transport=1, road_relation_code=1)


def test_an_animal_comes_from_either_side_with_equal_share() -> None:
    found = estimated(with_animal())
    scores: dict[Manoeuvre, float] = {}
    for hypothesis in found.hypotheses:
        (mover,) = (state for state in hypothesis.participants if state.kind is PartyKind.ANIMAL)
        assert mover.vehicle_number == 2001
        scores.setdefault(mover.manoeuvre, hypothesis.score)
    assert set(scores) == {Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT}
    assert len(set(scores.values())) == 1
    assert found.ambiguity >= 0.5


@pytest.mark.parametrize(("animal", "mass_kg"), [("deer", 68.0), ("elk", 250.0), ("cattle", 610.0)])
def test_the_species_of_an_animal_is_a_setting(animal: str, mass_kg: float) -> None:
    settings = StateSettings.model_validate({"animal": animal, "animal_pace": "walking"})
    found = estimate(with_animal(), STREET, PLACE, settings).best
    (mover,) = (state for state in found.participants if state.kind is PartyKind.ANIMAL)
    assert mover.mass_kg == mass_kg
    hip_m = 0.8 * mover.height_m
    assert mover.impact_speed_mps**2 / (9.81 * hip_m) < 0.5  # a walk, by its Froude number


@pytest.mark.parametrize(("clock_h", "left_m"), [(12, 0.0), (1, -0.5), (11, 0.5)])
def test_an_animal_is_struck_in_the_reported_area(clock_h: int, left_m: float) -> None:
    best = estimated(with_animal(clock_h=clock_h)).best
    car = next(state for state in best.participants if state.vehicle_number == 1)
    ahead, left = car.impact_pose.to_body(np.array(best.impact_point_xy_m))
    assert ahead == pytest.approx(car.length_m / 2, abs=0.05)
    assert math.copysign(1.0, left) == math.copysign(1.0, left_m) or left_m == 0.0
    assert abs(left) >= abs(left_m) - 0.1


def test_a_vehicle_backing_into_a_person_backs_along_a_street() -> None:
    backing = replace(struck(walker(), clock_h=6), vehicles=(vehicle(1, 6, 13, movement=PreCrashMovement.BACKING),))
    found = estimate(backing, STREET, PLACE, StateSettings())
    for hypothesis in found.hypotheses:
        car = hypothesis.participants[0]
        assert car.manoeuvre is Manoeuvre.BACKING
        assert car.impact_speed_mps < 0.0


# --- over many crashes -----------------------------------------------------------------------------------------------
def test_people_come_from_each_side_as_often_as_it_is_likely_and_never_out_of_a_lane() -> None:
    """53 % of pedestrians whose PEDSNR says the side come from the left; of 80 draws half lie within 11 % of that."""
    crossing = struck(walker(pedestrian_group_code=750))
    found = [estimated(replace(crossing, key=f"2015-{number}")).best.participants[1] for number in range(80)]
    from_left = sum(each.manoeuvre is Manoeuvre.CROSS_FROM_LEFT for each in found) / len(found)
    assert from_left == pytest.approx(0.53, abs=0.17)
    assert not any(STREET.drivable_area.has(each.initial_pose.x_m, each.initial_pose.y_m) for each in found)


def test_a_reconstruction_begins_before_who_crosses_a_wide_road_steps_onto_it() -> None:
    """Eight lanes of 3.5 m: from the far side to the reported lane it is more than five seconds' walk."""
    wide = RoadNetwork(FRAME, (Road("1", 400.0, (PlanElement(0, -200, 0, 0, 400.0),), (LaneSection(0, lanes(4, 4)),)),))
    person = walker(pedestrian_group_code=750, scenario="1a")
    found = estimate(struck(person), wide, PLACE, StateSettings()).best
    start = found.participants[1].initial_pose
    assert 5.0 < found.impact_time_s <= 12.0
    assert not wide.drivable_area.has(start.x_m, start.y_m)
