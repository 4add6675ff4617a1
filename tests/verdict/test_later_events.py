"""What comes after a first event: looked for by the search, simulated, shown by the verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reconstruction.test_pedestrian_impact_hypothesis import with_animal
from tests.reconstruction.test_run_off_road_planner import PLACE
from tests.simulation.motions import CAR, log_of, participant, straight
from tests.verdict.crashes import LANE_WIDTH_M, STREET, area, record, simulated, vehicle
from trace_dag.common.settings import SimSettings, StateSettings, VerdictSettings
from trace_dag.crash.parties import thing_party
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.reconstruction import course
from trace_dag.reconstruction.first_event import FirstEvent
from trace_dag.reconstruction.search import estimate_by_record
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.objects import PlacedBy
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import LossOfControl, StateEstimate
from trace_dag.simulation.types import SimulationLog
from trace_dag.simulation.vehicles import vehicle_model
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Criterion, Doubt, EventResult, Verdict

TREE, CURB, OVERTURN = 42, 33, 1
RIGHT, LEFT = 63, 64


def rear_ended(*later: EventRecord, speeds_mps: tuple[float, float] = (30.0, 20.0)) -> CrashRecord:
    """Car 1 runs into the rear of car 2 on the street; then the events."""
    one, two = vehicle(1, 12, 20, speed_mps=speeds_mps[0]), vehicle(2, 6, 21, speed_mps=speeds_mps[1])
    first = EventRecord(1, 12, 1, area(12), 2, area(6))
    return record(one, two, events=(first, *later))


def event(number: int, code: int, party: int, clock_h: int | None = None) -> EventRecord:
    second = thing_party(number) if code < 60 and code != OVERTURN else None
    return EventRecord(number, code, party, area(clock_h) if clock_h else None, second, None)


def followed(crash: CrashRecord, *things: MappedThing) -> tuple[StateEstimate, SimulationLog, Verdict]:
    """Both go east in the right lane at their reported speeds; they touch near the origin."""
    meets_s = 3.0
    fast_mps, slow_mps = (each.travel_speed_mps or 0.0 for each in crash.vehicles)
    fast = straight(-CAR.length_m - fast_mps * meets_s, -1.75, 0.0, fast_mps, until_s=6.0)
    slow = straight(-slow_mps * meets_s, -1.75, 0.0, slow_mps, until_s=6.0)
    hypothesis, _ = simulated(fast, slow, impact_time_s=meets_s)
    report = replace(PLACE, things=things)
    made = estimate_by_record(
        crash, STREET, report, StateSettings(lead_time_s=meets_s), lambda *_: FirstEvent((hypothesis,), 0.0)
    )
    logs = simulate(EmbeddedBackend(SimSettings()), STREET, b"", made, SimSettings(), record=crash)
    return made, logs[0], judge(crash, STREET, report, made, logs, VerdictSettings())


def shown(verdict: Verdict, name: str) -> Criterion:
    (found,) = [each for each in verdict.criteria if each.name == name]
    assert found.reason is None  # what comes off the road after a contact rejects nothing
    return found


# --- placed, simulated and shown ---------------------------------------------------------------------------------
@pytest.mark.parametrize(("to", "sign"), [(RIGHT, -1.0), (LEFT, 1.0)])
def test_an_object_stands_on_the_reported_side_and_is_struck_after_the_contact(to: int, sign: float) -> None:
    made, log, verdict = followed(rear_ended(event(2, to, 2), event(3, TREE, 2, 12)))
    assert verdict.accepted, verdict.detail
    (tree,) = made.best.objects
    assert (tree.code, tree.event_number, tree.placed_by) == (TREE, 3, PlacedBy.PROGRAM)
    # The carriageway is 7 m wide about the x axis, the vehicles go along it.
    assert tree.pose.y_m * sign > LANE_WIDTH_M
    (struck,) = [each for each in log.contacts if each.number_2 == tree.number]
    assert struck.number_1 == 2
    assert log.first_contact is log.meetings[0]
    assert struck.time_s > log.meetings[0].time_s
    later = shown(verdict, "later_object")
    assert (later.vehicle_number, later.event_number, later.passed) == (2, 3, True)
    assert Doubt.DEPARTURE_MISSED not in {each.doubt for each in verdict.reservations}
    (check,) = made.best.later_events
    assert (check.name, check.passed) == ("object of event 3", True)
    assert "its front wheels turned by 1°" in check.detail
    assert [each.outcome for each in verdict.events if each.code < 60] == [EventResult.HAPPENED] * 2


def test_later_events_leave_the_contact_as_it_is() -> None:
    _, log, _ = followed(rear_ended(event(2, RIGHT, 2), event(3, TREE, 2, 12)))
    _, alone, _ = followed(rear_ended())
    with_tree, without = log.meetings[0], alone.meetings[0]
    assert (with_tree.time_s, with_tree.delta_v_1_mps) == (without.time_s, without.delta_v_1_mps)


def test_a_tree_of_the_map_on_the_way_is_used() -> None:
    crash = rear_ended(event(2, RIGHT, 2), event(3, TREE, 2, 12))
    made, _, _ = followed(crash)
    (ours,) = made.best.objects
    here = MappedThing("node/7", "natural=tree", ((ours.pose.x_m, ours.pose.y_m),))
    made, _, verdict = followed(crash, here)
    assert [(each.placed_by, each.osm_id) for each in made.best.objects] == [(PlacedBy.OPENSTREETMAP, "node/7")]
    assert shown(verdict, "later_object").passed


def test_a_search_that_has_simulated_enough_tries_no_other_course(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "_MOST", 1)  # that of the contact itself
    made, _, _ = followed(rear_ended(event(2, RIGHT, 2), event(3, TREE, 2, 12)))
    assert made.best.objects == ()
    (check,) = made.best.later_events
    assert not check.passed


def test_an_event_that_cannot_be_met_is_shown_with_what_was_measured() -> None:
    standing = rear_ended(event(2, 71, 2), event(3, TREE, 2, 12))  # the road does not end: nothing leads it off
    made, log, verdict = followed(standing)
    assert verdict.accepted, verdict.detail
    assert made.best.objects == log.objects == ()
    later = shown(verdict, "later_object")
    assert not later.passed
    edge_m = LANE_WIDTH_M / 2 - CAR.width_m / 2  # it stays in the middle of its lane
    missed = verdict.events[-1]
    assert (missed.event_number, missed.outcome) == (3, EventResult.MISSED)
    assert missed.why == f"vehicle 2 stays on the carriageway: it comes to {edge_m:.1f} m from its edge"


def test_an_overturn_that_does_not_happen_is_missed() -> None:
    """At 2.5 m/s, which both have after the contact, a car has 3.1 J/kg; to tip it over its wheels, 1.5 m apart, takes
    3.7 J/kg where its centre of gravity is 0.55 m high."""
    _, _, verdict = followed(rear_ended(event(2, OVERTURN, 2), speeds_mps=(4.0, 1.0)))
    assert verdict.accepted, verdict.detail
    later = shown(verdict, "later_overturn")
    assert not later.passed
    assert verdict.events[-1].outcome is EventResult.MISSED
    assert "vehicle 2 stays on its wheels" in verdict.events[-1].why


def test_a_vehicle_leaves_the_road_after_an_animal_and_strikes_the_reported_object() -> None:
    animal = with_animal()
    crash = replace(animal, events=(*animal.events, event(2, RIGHT, 1), event(3, TREE, 1, 12)))
    made = estimate_by_record(crash, STREET, PLACE, StateSettings())
    logs = simulate(EmbeddedBackend(SimSettings()), STREET, b"", made, SimSettings(), record=crash)
    verdict = judge(crash, STREET, PLACE, made, logs, VerdictSettings())
    assert verdict.accepted, verdict.detail
    assert [contact.number_2 for contact in sorted(logs[0].contacts, key=lambda each: each.time_s)] == [2001, 2003]
    assert shown(verdict, "later_object").passed
    assert verdict.reservations == ()
    assert made.best.objects[0].pose.y_m < -LANE_WIDTH_M  # to the right of who goes east


# --- turned wheels ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("turned_rad", [0.05, -0.05])
def test_front_wheels_that_are_turned_lead_along_a_circle(turned_rad: float) -> None:
    """A slow vehicle that rolls on turned wheels goes along a circle of wheelbase over the tangent of their angle,
    until it touches the other again, whose driver brakes."""
    rolling = participant(1, straight(0.0, 0.0, 0.0, 5.0, until_s=1.0))
    pushed = participant(2, straight(CAR.length_m + 0.2, 0.0, 0.0, 4.5, until_s=1.0))
    one = replace(rolling, losses_of_control=(LossOfControl(1.0, wheels_rad=turned_rad),))
    log = log_of((one, pushed), SimSettings(locked_wheels=0.0, time_limit_s=3.0))
    again_s = log.meetings[1].time_s
    driven = log.vehicles[0]
    late = (driven.time_s > 1.1) & (driven.time_s < again_s)
    assert again_s > 1.5
    radius_m = np.abs(driven.speed_mps[late] / driven.yaw_rate_rps[late]).mean()
    wheelbase_m = vehicle_model(CAR).wheelbase_m
    assert radius_m == pytest.approx(wheelbase_m / math.tan(abs(turned_rad)), rel=0.1)
    assert np.sign(driven.yaw_rate_rps[late][-1]) == np.sign(turned_rad)
    assert driven.yaw_rate_rps[driven.time_s < 0.9] == pytest.approx(0.0, abs=1e-6)
