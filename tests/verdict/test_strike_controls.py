"""Negative controls of crashes with people: what verdicts must refuse, on a street made by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.reconstruction.test_pedestrian_impact_hypothesis import estimated, rider, struck, walker
from tests.simulation.motions import log_of
from tests.verdict.crashes import STREET, record, row_of_change, vehicle
from tests.verdict.test_strikes import FROM_RIGHT, crossing
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import CrashRecord
from trace_dag.simulation.run import participants
from trace_dag.simulation.states import Manoeuvre
from trace_dag.verdict.changed_plans import late_person, mirror_person
from trace_dag.verdict.controls import ControlRow, JudgedCrash, changed_reports, in_place_of, reports_differ

SETTINGS = VerdictSettings()


def judged() -> JudgedCrash:
    crash, hypothesis, log = crossing()
    return JudgedCrash(crash, STREET, hypothesis, log)


def other(person_fields: dict[str, object], key: str = "2023-2") -> JudgedCrash:
    crash = struck(replace(FROM_RIGHT, **person_fields))  # type: ignore[arg-type]
    _, hypothesis, log = crossing()
    return JudgedCrash(replace(crash, key=key), STREET, hypothesis, log)


@pytest.mark.parametrize(
    ("fields", "differ"),
    [
        ({"scenario": "1a"}, True),
        ({"pedestrian_type_code": 440, "scenario": ""}, True),
        ({"pedestrian_position_code": 4, "location_code": 20}, True),
        ({"age_years": 70}, False),
    ],
)
def test_another_persons_report_is_refused_where_it_states_something_else(
    fields: dict[str, object], differ: bool
) -> None:
    (row,) = changed_reports(judged(), [other(fields)], SETTINGS)
    assert (row.kind, row.other_key, row.reports_differ) == ("other_report", "2023-2", differ)
    assert row.verified is not differ


def test_reports_of_another_kind_or_length_are_not_set_beside_it() -> None:
    cyclist = struck(rider(), code=9)
    _, hypothesis, log = crossing()
    others = [JudgedCrash(replace(cyclist, key="2023-3"), STREET, hypothesis, log)]
    assert list(changed_reports(judged(), others, SETTINGS)) == []
    assert in_place_of(struck(FROM_RIGHT, vehicles=2), struck(FROM_RIGHT)) is None
    assert in_place_of(record(vehicle(1, 12), vehicle(2, 12)), struck(FROM_RIGHT)) is None


def test_parties_get_the_numbers_of_the_own_report() -> None:
    theirs = struck(walker(number=3))
    found = in_place_of(theirs, struck(FROM_RIGHT))
    assert found is not None
    (event,) = found.events
    assert (event.party_1, event.party_2) == (1, 1001)
    assert not reports_differ(found, struck(FROM_RIGHT), SETTINGS)


@pytest.mark.parametrize("listed", [True, False])
def test_a_report_that_lists_no_person_can_be_set_beside_another(listed: bool) -> None:
    theirs = struck(walker())
    events = tuple(replace(event, party_2=None) for event in theirs.events) if listed else ()
    found = in_place_of(replace(theirs, non_motorists=(), events=events), struck(FROM_RIGHT))
    assert found is not None
    assert [event.pair for event in sequence_of(found).events] == [(1, 1001)]


def planned(crash: CrashRecord) -> JudgedCrash:
    hypothesis = estimated(crash).best
    return JudgedCrash(crash, STREET, hypothesis, log_of(participants(hypothesis)))


def late(crash: JudgedCrash) -> ControlRow:
    return row_of_change(crash, "shifted", late_person(crash))


def test_a_person_two_seconds_late_is_not_struck_there() -> None:
    row = late(judged())
    assert (row.verified, row.shift_s) == (False, 2.0)


def test_a_person_along_the_road_comes_so_late_that_the_place_differs() -> None:
    row = late(planned(struck(walker(pedestrian_type_code=440))))
    assert row.verified is False
    assert row.shift_s is not None
    assert row.shift_s * 1.57 > 10.0


def test_a_standing_party_cannot_be_late() -> None:
    assert late_person(planned(struck(walker(pedestrian_type_code=610)))) is None


def test_no_delay_makes_a_cyclist_miss_a_standing_car() -> None:
    assert late_person(planned(struck(rider(cyclist_type_code=243), code=9, clock_h=6, speed_mps=0.0))) is None


def test_a_person_from_the_other_side_is_refused() -> None:
    crash = judged()
    other_side = mirror_person(crash)
    assert other_side is not None
    person, was = other_side.hypothesis.participants[1], crash.hypothesis.participants[1]
    assert was.manoeuvre is Manoeuvre.CROSS_FROM_RIGHT
    street_y = was.impact_pose.y_m  # the street runs east: mirrored is north for south
    assert person.initial_pose.y_m - street_y == pytest.approx(street_y - was.initial_pose.y_m, abs=1e-3)
    assert person.initial_pose.x_m == pytest.approx(was.initial_pose.x_m, abs=1e-3)
    assert row_of_change(crash, "mirrored", other_side).verified is False


def test_a_side_that_is_not_coded_has_no_mirror() -> None:
    assert mirror_person(planned(struck(walker(pedestrian_type_code=760)))) is None
