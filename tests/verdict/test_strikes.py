"""Verdicts of crashes with people: estimated, simulated and judged on a street made by hand; and wrong reports."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from tests.reconstruction.test_pedestrian_impact_hypothesis import PLACE, estimated, rider, struck, walker, with_animal
from tests.simulation.motions import log_of
from tests.verdict.crashes import STREET, area, vehicle
from trace_dag.common.errors import Reason
from trace_dag.common.settings import StateSettings, VerdictSettings
from trace_dag.crash.event_parties import ORDER_OF_IMPACTS
from trace_dag.crash.record import CrashRecord, EventRecord, NonMotorist, PreCrashMovement
from trace_dag.crash.zones import Zone
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.map.model import Crosswalk
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.run import participants
from trace_dag.simulation.states import Hypothesis
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.judge import judge, judge_hypothesis, judge_observed
from trace_dag.verdict.metrics import compass_error_deg, zone_error_m
from trace_dag.verdict.observation import observe_crash
from trace_dag.verdict.types import Agreement, Grade, Verdict, verdict_from_json, verdict_to_json

FROM_RIGHT = walker(scenario="1b", pedestrian_group_code=750, pedestrian_type_code=760)


@cache
def crossing() -> tuple[CrashRecord, Hypothesis, SimulationLog]:
    """A pedestrian who crosses from the right, struck by the front of a car at 15 m/s."""
    crash = struck(FROM_RIGHT)
    hypothesis = estimated(crash).best
    return crash, hypothesis, log_of(participants(hypothesis))


def judged_by(crash: CrashRecord) -> Verdict:
    _, hypothesis, log = crossing()
    return judge_hypothesis(crash, STREET, hypothesis, log, VerdictSettings())


def with_person(**fields: object) -> CrashRecord:
    person: NonMotorist = replace(FROM_RIGHT, **fields)  # type: ignore[arg-type]
    return replace(struck(FROM_RIGHT), non_motorists=(person,))


def test_a_strike_as_reported_is_accepted_and_graded_consistent() -> None:
    crash, hypothesis, log = crossing()
    verdict = judge(crash, STREET, PLACE, replace(estimated(crash), hypotheses=(hypothesis,)), [log], VerdictSettings())
    assert verdict.accepted
    assert verdict.grade is Grade.CONSISTENT  # a street without a name, a limit or a class has little to agree with
    of_event = {criterion.name for criterion in verdict.criteria if criterion.event_number == 1}
    assert {"contact", "contact_distance", "clock_error", "zone_error", "course_error", "throw_distance"} <= of_event
    assert verdict_from_json(verdict_to_json(verdict)) == verdict


def test_measures_are_those_of_the_motion() -> None:
    """15 m/s is kept to the strike; from the edge of a carriageway 7 m wide to a lane's middle are 1.75 m, walked at
    1.57 m/s. Thrown farther than the least of Searle's bounds at a friction of 0.66 (12.1 m), since the driver brakes
    a reaction time later, and nearer than where a car comes to a stop that brakes at 0.6 g after 1.1 s (35.6 m)."""
    verdict = judged_by(struck(FROM_RIGHT))
    values = {(each.name, each.vehicle_number): each.value for each in verdict.criteria}
    assert values["impact_speed", 1] == pytest.approx(15.0, abs=0.1)
    exposed = values["time_on_carriageway", 1001]
    assert exposed is not None
    assert exposed == pytest.approx(1.75 / 1.573, abs=0.35)  # within half a body of the middle
    thrown = values["throw_distance", 1001]
    assert thrown is not None
    assert 12.1 < thrown < 35.6


def facts_by(crash: CrashRecord, network: RoadNetwork = STREET) -> dict[str, Agreement]:
    """What facts of another report come to, set beside the motion of :func:`crossing`."""
    _, hypothesis, log = crossing()
    made = replace(estimated(struck(FROM_RIGHT)), hypotheses=(hypothesis,))
    verdict = judge(crash, network, PLACE, made, [log], VerdictSettings())
    assert verdict.support is not None
    return {fact.name: fact.agreement for fact in verdict.support.facts}


def test_reported_strikes_are_weighed_as_facts() -> None:
    agrees = dict.fromkeys(
        (
            "striking vehicle",
            "impact of the strike",
            "movement before the strike",
            "speed before the strike",
            "course of the person",
            "zone of the person",
        ),
        Agreement.AGREES,
    )
    assert facts_by(struck(FROM_RIGHT)).items() >= agrees.items()
    assert facts_by(with_person(pedestrian_direction_code=1))["compass direction"] is Agreement.AGREES  # north
    assert facts_by(with_person(motorist_direction_code=4))["compass direction"] is Agreement.DIFFERS  # west, not east
    assert facts_by(with_person(scenario="1a"))["course of the person"] is Agreement.DIFFERS
    assert facts_by(with_person(pedestrian_position_code=5))["zone of the person"] is Agreement.DIFFERS


def test_a_reported_crosswalk_is_looked_for_where_the_map_has_any() -> None:
    (road,) = STREET.roads
    outline = ((-1.5, -4.0), (1.5, -4.0), (1.5, 4.0), (-1.5, 4.0))
    for at_m, agreement in ((305.0, Agreement.AGREES), (400.0, Agreement.DIFFERS)):  # the place is at 300 m
        street = RoadNetwork(STREET.frame, (replace(road, crosswalks=(Crosswalk("1", at_m, outline),)),))
        assert facts_by(with_person(crosswalk_code=1), street)["crosswalk"] is agreement
    assert "crosswalk" not in facts_by(with_person(crosswalk_code=1))


@pytest.mark.parametrize(
    ("crash", "reason"),
    [
        (with_person(scenario="1a"), Reason.WRONG_DIRECTION),  # from the left
        (with_person(pedestrian_type_code=410, scenario=""), Reason.WRONG_DIRECTION),  # along the road
        (with_person(pedestrian_position_code=5, location_code=21), Reason.WRONG_ZONE),  # on a sidewalk
        (replace(struck(FROM_RIGHT), vehicles=(vehicle(1, 6, 13, speed_mps=15.0),)), None),
    ],
)
def test_another_report_is_refused_for_what_it_states(crash: CrashRecord, reason: Reason | None) -> None:
    verdict = judged_by(crash)
    if reason is None:  # the event's area counts, not the vehicle's
        assert verdict.accepted
    else:
        assert (verdict.accepted, verdict.reason) == (False, reason)


def test_the_area_is_that_of_the_event() -> None:
    crash = struck(FROM_RIGHT)
    (event,) = crash.events
    assert judged_by(replace(crash, events=(replace(event, area_1=area(6)),))).reason is Reason.WRONG_IMPACT


def test_a_turn_that_was_not_made_is_refused() -> None:
    crash = struck(FROM_RIGHT)
    car = vehicle(1, 12, 13, PreCrashMovement.TURNING_LEFT, 15.0)
    assert judged_by(replace(crash, vehicles=(car,))).reason is Reason.WRONG_DIRECTION


def test_a_second_strike_that_does_not_happen_is_refused() -> None:
    crash = struck(FROM_RIGHT, vehicles=2)
    verdict = judged_by(crash)
    assert verdict.reason is Reason.WRONG_SEQUENCE
    assert "vehicle 2 and person 1 do not touch" in verdict.detail


def test_another_vehicle_than_reported_is_refused() -> None:
    crash = struck(FROM_RIGHT)
    other = vehicle(2, 12, 13, speed_mps=15.0)
    events = (EventRecord(1, 8, 2, area(12), 1001, None),)
    verdict = judged_by(replace(crash, vehicles=(*crash.vehicles, other), events=events))
    assert verdict.reason is Reason.WRONG_PARTY


def test_vehicles_that_collide_afterwards_though_no_event_states_so_are_refused() -> None:
    """11 km/h to one of them is a crash an event data recorder records; 4 km/h is a bump that no report need tell."""
    crash, hypothesis, log = crossing()
    crash = replace(crash, vehicles=(*crash.vehicles, vehicle(2, 6, 13, speed_mps=15.0)))
    (strike,) = log.contacts

    def judged_after(delta_v_mps: float, **fields: object) -> Verdict:
        collision = replace(
            strike, time_s=strike.time_s + 2.0, number_2=2, delta_v_1_mps=(delta_v_mps, 0.0), delta_v_2_mps=(0.0, 0.0)
        )
        bodies = {**log.bodies, 2: log.bodies[1]}
        two = replace(log, contacts=(strike, collision), bodies=bodies)
        return judge_hypothesis(replace(crash, **fields), STREET, hypothesis, two, VerdictSettings())  # type: ignore[arg-type]

    hard = judged_after(3.0)
    assert hard.reason is Reason.WRONG_SEQUENCE
    assert "vehicle 1 and vehicle 2 touch at" in hard.detail
    assert judged_after(1.1).accepted
    said = EventRecord(2, 12, 1, area(12), 2, area(8))
    verdict = judged_after(3.0, events=(*crash.events, said))
    assert verdict.accepted, verdict.detail


def test_an_overtaken_cyclist_is_judged() -> None:
    crash = struck(rider(cyclist_type_code=231, cyclist_group_code=230), code=9)
    hypothesis = estimated(crash).best
    verdict = judge_hypothesis(crash, STREET, hypothesis, log_of(participants(hypothesis)), VerdictSettings())
    assert verdict.accepted
    assert judged_by(crash).reason is Reason.WRONG_DIRECTION  # of one that crosses


def test_two_vehicles_strike_one_person_in_order() -> None:
    crash = struck(FROM_RIGHT, vehicles=2)
    made = estimate(crash, STREET, PLACE, StateSettings(max_hypotheses=1))
    assert [(event.event_number, event.party_1) for event in made.best.planned] == [(1, 1), (2, 2)]
    logs = [log_of(participants(hypothesis)) for hypothesis in made.hypotheses]
    verdict = judge(crash, STREET, PLACE, made, logs, VerdictSettings())
    assert verdict.accepted
    times = {each.event_number: each.value for each in verdict.criteria if each.name == "contact_time"}
    assert times[1] is not None
    assert times[2] is not None
    assert times[1] < times[2]


@pytest.mark.parametrize(
    ("outside_m", "zones", "error_m"),
    [
        (-2.0, {Zone.CARRIAGEWAY}, 0.0),
        (1.5, {Zone.CARRIAGEWAY}, 1.5),
        (0.6, {Zone.BESIDE}, 0.0),
        (-1.5, {Zone.BESIDE}, 1.0),  # the edge is drawn no better than half a metre
        (-0.5, {Zone.WALKED}, 0.5),
        (1.5, {Zone.CARRIAGEWAY, Zone.WALKED}, 0.0),
        (1.5, set(), None),
    ],
)
def test_zones_are_strips_along_the_edge(outside_m: float, zones: set[Zone], error_m: float | None) -> None:
    assert zone_error_m(outside_m, frozenset(zones)) == error_m


def test_a_coded_direction_is_a_quarter_of_the_compass() -> None:
    assert compass_error_deg(0.0, 2) == 0.0  # due east, coded east
    assert compass_error_deg(0.7, 2) == 0.0  # 40 degrees off
    assert compass_error_deg(0.0, 1) == pytest.approx(45.0)
    assert compass_error_deg(0.0, None) is None


def test_without_an_order_the_first_strike_that_happens_is_held_to_the_place() -> None:
    crash = replace(struck(FROM_RIGHT, vehicles=2), implied=(ORDER_OF_IMPACTS,))
    first, last = crash.events
    turned = replace(crash, events=(replace(first, party_1=2), replace(last, party_1=1)))
    made = estimate(crash, STREET, PLACE, StateSettings(max_hypotheses=1))
    logs = [log_of(participants(hypothesis)) for hypothesis in made.hypotheses]
    for each in (crash, turned):
        verdict = judge(each, STREET, PLACE, made, logs, VerdictSettings())
        assert verdict.accepted, verdict.detail
        (placed,) = (criterion for criterion in verdict.criteria if criterion.name == "contact_distance")
        opening = logs[verdict.hypothesis].contacts[0].number_1
        assert placed.event_number == next(event.number for event in each.events if event.party_1 == opening)


def test_without_an_order_every_strike_has_to_happen() -> None:
    crash = replace(struck(FROM_RIGHT, vehicles=2), implied=(ORDER_OF_IMPACTS,))
    _, hypothesis, log = crossing()  # only vehicle 1 strikes
    first, last = crash.events
    for events in (crash.events, (replace(first, party_1=2), replace(last, party_1=1))):
        verdict = judge_hypothesis(replace(crash, events=events), STREET, hypothesis, log, VerdictSettings())
        assert verdict.reason is Reason.WRONG_SEQUENCE


# --- animals -------------------------------------------------------------------------------------------------------
@cache
def animal_crash() -> tuple[CrashRecord, Hypothesis, SimulationLog]:
    crash = with_animal()
    hypothesis = estimated(crash).best
    return crash, hypothesis, log_of(participants(hypothesis))


def test_an_animal_struck_as_reported_is_accepted_and_no_more_than_consistent() -> None:
    crash, hypothesis, log = animal_crash()
    made = replace(estimated(crash), hypotheses=(hypothesis,))
    verdict = judge(crash, STREET, PLACE, made, [log], VerdictSettings())
    assert verdict.accepted, verdict.detail
    assert verdict.grade is Grade.CONSISTENT
    names = {criterion.name for criterion in verdict.criteria}
    assert not {"course_error", "compass_error"} & names  # no report tells which way an animal went


@pytest.mark.parametrize(
    ("clock_h", "reason"), [(12, None), (11, None), (5, Reason.WRONG_IMPACT), (8, Reason.WRONG_IMPACT)]
)
def test_an_animal_has_to_be_struck_in_the_reported_area(clock_h: int, reason: Reason | None) -> None:
    _, hypothesis, log = animal_crash()
    told = with_animal(clock_h=clock_h)
    assert judge_hypothesis(told, STREET, hypothesis, log, VerdictSettings()).reason is reason


def test_an_animal_beside_the_road_is_not_one_on_it() -> None:
    crash, hypothesis, log = animal_crash()
    told = replace(crash, road_relation_code=4)  # on the roadside
    assert judge_hypothesis(told, STREET, hypothesis, log, VerdictSettings()).reason is Reason.WRONG_ZONE


def test_events_after_an_animal_are_shown_and_judge_nothing() -> None:
    crash, hypothesis, log = animal_crash()
    told = replace(
        crash, events=(*crash.events, EventRecord(2, 1, 1, None, None, None), EventRecord(3, 42, 1, None, 2003, None))
    )
    verdict = judge_hypothesis(told, STREET, hypothesis, log, VerdictSettings())
    assert verdict.accepted
    (over,) = (each for each in verdict.criteria if each.name == "later_overturn")
    (tree,) = (each for each in verdict.criteria if each.name == "later_object")
    assert [(each.event_number, each.value, each.passed, each.reason) for each in (over, tree)] == [
        (2, 0.0, False, None),
        (3, 0.0, False, None),
    ]


def test_a_place_off_the_named_road_is_reported_with_the_rejection() -> None:
    crash, hypothesis, log = animal_crash()
    x, y = log.contacts[0].x_m, log.contacts[0].y_m
    far = replace(log, contacts=(replace(log.contacts[0], x_m=x + 20.0), *log.contacts[1:]))
    placed = replace(PLACE, placement=replace(PLACE.placement, x_m=x + 20.0, y_m=y, moved_m=20.0))
    verdict = judge_observed(crash, observe_crash(STREET, hypothesis, far), VerdictSettings(), report=placed)
    assert verdict.reason is Reason.WRONG_LOCATION
    assert (
        "the reported point is 20.0 m from its place on the road that was taken for the crash's (by " in verdict.detail
    )
