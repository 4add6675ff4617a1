"""Several contacts on a street made by hand: which simulations a report accepts, and which reports a simulation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest

from tests.simulation.motions import straight
from tests.verdict.crashes import STREET, area, record, row_of_change, simulated, vehicle
from trace_dag.common.errors import Reason
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.classes import CollisionType
from trace_dag.crash.event_sequence import EventSequence, sequence_of
from trace_dag.crash.record import CrashRecord, EventRecord, PreCrashMovement
from trace_dag.simulation.states import Hypothesis, Trajectory
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.changed_plans import move_parked
from trace_dag.verdict.controls import JudgedCrash, changed_reports, drop_contact, in_place_of, swap_contacts
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.types import Verdict

SETTINGS = VerdictSettings()
LANE_Y_M = -1.75
STOPPED = PreCrashMovement.STOPPED


def standing(x_m: float, y_m: float) -> Trajectory:
    return straight(x_m, y_m, 0.0, 0.0)


def contact(number: int, one: int, clock_1: int, two: int, clock_2: int, code: int = 12) -> EventRecord:
    return EventRecord(number, code, one, area(clock_1), two, area(clock_2))


def queue_report(*events: EventRecord, key: str = "2023-1", vehicles: int = 3) -> CrashRecord:
    """Vehicle 1 runs into 2, which is pushed into 3, unless other events are given."""
    rest = [vehicle(number, 6, movement=STOPPED, speed_mps=0.0) for number in range(2, vehicles + 1)]
    told = events or (contact(1, 1, 12, 2, 6), contact(2, 2, 12, 3, 6))
    report = record(vehicle(1, 12), *rest, key=key, events=told)
    return replace(report, first_harmful_event_code=12, collision_type=CollisionType.FRONT_TO_REAR)


def queue(third_y_m: float = LANE_Y_M) -> tuple[Hypothesis, SimulationLog]:
    """Vehicle 1 comes at 15 m/s along the lane, 2 stands where it touches at the origin, 3 two metres before that."""
    return simulated(
        straight(-45.0 - 2.25, LANE_Y_M, 0.0, 15.0),
        standing(2.25, LANE_Y_M),
        standing(8.75, third_y_m),
    )


def judged(report: CrashRecord, made: tuple[Hypothesis, SimulationLog] | None = None) -> Verdict:
    return judge_hypothesis(report, STREET, *(made or queue()), SETTINGS)


def test_a_queue_that_happens_as_reported_is_accepted_with_each_contact() -> None:
    verdict = judged(queue_report())
    assert verdict.accepted, verdict.detail
    held = {(c.name, c.vehicle_number, c.event_number): c for c in verdict.criteria if c.passed is not None}
    for event, numbers in ((1, (1, 2)), (2, (2, 3))):
        for number in numbers:
            assert held["clock_error", number, event].value == pytest.approx(0.0, abs=0.3)
    assert held["next_contact", 2, 2].passed
    times = {c.event_number: c.value for c in verdict.criteria if c.name == "contact_time"}
    assert times[1] is not None
    assert times[2] is not None
    assert times[1] == pytest.approx(3.0, abs=0.2)  # 45 m at 15 m/s
    assert times[2] > times[1]


@pytest.mark.parametrize(
    ("events", "reason", "says"),
    [
        ([contact(1, 2, 12, 3, 6), contact(2, 1, 12, 2, 6)], Reason.WRONG_PARTY, "between vehicle 1 and vehicle 2"),
        ([contact(1, 1, 12, 2, 6), contact(2, 1, 12, 3, 6)], Reason.WRONG_SEQUENCE, "vehicle 1 and vehicle 3 do not"),
        ([contact(1, 1, 12, 2, 6), contact(2, 2, 12, 3, 12)], Reason.WRONG_IMPACT, "clock error of vehicle 3"),
        ([contact(1, 1, 6, 2, 6), contact(2, 2, 12, 3, 6)], Reason.WRONG_IMPACT, "clock error of vehicle 1"),
    ],
)
def test_another_course_of_events_is_refused(events: list[EventRecord], reason: Reason, says: str) -> None:
    verdict = judged(queue_report(*events))
    assert verdict.reason is reason
    assert says in verdict.detail


def test_a_contact_that_does_not_come_about_is_missed() -> None:
    verdict = judged(queue_report(), queue(third_y_m=1.75))  # the third vehicle stands in the other lane
    assert verdict.reason is Reason.WRONG_SEQUENCE
    assert verdict.detail == "vehicle 2 and vehicle 3 do not touch after what came before it, which event 2 says"


def test_the_order_need_not_be_reported() -> None:
    events = (contact(1, 2, 12, 3, 6), contact(2, 1, 12, 2, 6))
    verdict = judged(replace(queue_report(*events), implied=("order_of_contacts",)))
    assert verdict.accepted, verdict.detail


def test_an_event_that_cannot_be_simulated_judges_nothing() -> None:
    fire = EventRecord(3, 2, 2, None, None, None)
    verdict = judged(queue_report(contact(1, 1, 12, 2, 6), contact(2, 2, 12, 3, 6), fire))
    assert verdict.accepted
    assert not [c for c in verdict.criteria if c.event_number == 3]


# --- parked ----------------------------------------------------------------------------------------------------------
def parked_report(zone: int) -> CrashRecord:
    stands = replace(vehicle(2, 6, speed_mps=0.0), in_transport=False)
    report = record(vehicle(1, 12), stands, events=(contact(1, 1, 12, 2, 6, code=14),))
    return replace(report, first_harmful_event_code=14, vehicles_in_transport=1, road_relation_code=zone)


@pytest.mark.parametrize(
    ("zone", "y_m", "reason"),
    [
        (7, -4.7, None),  # its centre 1.2 m beyond the edge, in the parking lane
        (7, LANE_Y_M, Reason.WRONG_ZONE),
        (1, LANE_Y_M, None),
        (1, -4.9, Reason.WRONG_ZONE),
    ],
)
def test_a_parked_vehicle_stands_in_the_reported_zone(zone: int, y_m: float, reason: Reason | None) -> None:
    made = simulated(straight(-47.25, y_m, 0.0, 15.0), standing(2.25, y_m))
    verdict = judged(parked_report(zone), made)
    assert verdict.reason is reason, verdict.detail


def test_a_parked_vehicle_that_is_moved_aside_is_missed() -> None:
    made = simulated(straight(-47.25, -4.7, 0.0, 15.0), standing(2.25, -4.7))
    parked = JudgedCrash(parked_report(7), STREET, *made)
    changed = move_parked(parked, 2)
    moved = next(state for state in changed.hypothesis.participants if state.vehicle_number == 2)
    assert abs(moved.initial_pose.y_m + 4.7) == pytest.approx(3.0)
    assert (moved.trajectory.y_m == moved.initial_pose.y_m).all()
    row = row_of_change(parked, "moved", changed)
    assert (row.verified, row.reason, row.shift_s) == (False, Reason.NO_COLLISION, None)


# --- controls --------------------------------------------------------------------------------------------------------
def crash(report: CrashRecord) -> JudgedCrash:
    return JudgedCrash(report, STREET, *queue())


def test_one_contact_dropped_and_two_swapped_are_refused() -> None:
    rows = list(changed_reports(crash(queue_report()), [], SETTINGS))
    assert [(row.kind, row.verified) for row in rows] == [("dropped", False), ("dropped", False), ("swapped", False)]


def test_dropped_and_swapped_strikes() -> None:
    def pairs(changed: Iterable[EventSequence]) -> list[list[tuple[int, int]]]:
        return [[event.pair for event in sequence.events] for sequence in changed]

    sequence = sequence_of(queue_report())
    assert pairs(drop_contact(sequence)) == [[(2, 3)], [(1, 2)]]
    assert pairs(swap_contacts(sequence)) == [[(2, 3), (1, 2)]]
    assert pairs(swap_contacts(replace(sequence, order_known=False))) == []
    assert pairs(drop_contact(replace(sequence, events=sequence.events[:1]))) == []
    again = sequence_of(
        queue_report(contact(1, 1, 12, 2, 6), contact(2, 2, 12, 3, 6), contact(3, 1, 12, 2, 6), contact(4, 1, 12, 3, 6))
    )
    assert pairs(drop_contact(again)) == [[(1, 2), (1, 2), (1, 3)], [(1, 2), (2, 3), (1, 2)]]


def test_another_report_is_refused_where_it_states_something_else() -> None:
    alike = queue_report(key="2023-2")
    star = queue_report(contact(1, 1, 12, 2, 6), contact(2, 1, 12, 3, 6), key="2023-3")
    struck_in_front = queue_report(contact(1, 1, 12, 2, 12), contact(2, 2, 12, 3, 6), key="2023-4")
    others = [crash(report) for report in (alike, star, struck_in_front)]
    rows = [row for row in changed_reports(crash(queue_report()), others, SETTINGS) if row.kind == "other_report"]
    assert [(row.other_key, row.reports_differ, row.verified) for row in rows] == [
        ("2023-2", False, True),
        ("2023-3", True, False),
        ("2023-4", True, False),
    ]


def test_vehicles_are_numbered_in_the_order_in_which_they_take_part() -> None:
    theirs = queue_report(contact(1, 3, 12, 1, 6), contact(2, 1, 12, 2, 6))
    found = in_place_of(theirs, queue_report())
    assert found is not None
    assert [(each.party_1, each.party_2) for each in found.events] == [(1, 2), (2, 3)]
    four = queue_report(*(contact(n, n, 12, n + 1, 6) for n in (1, 2, 3)), vehicles=4)
    assert in_place_of(four, queue_report()) is None
