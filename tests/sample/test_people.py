"""The sample's crashes with people: estimates against the truth they were made of, and reports that must be refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from cases import SETTINGS, Case, cases

from lab.truth.people import PeopleTruth, by_kind, load_people_truth, score_people
from trace_dag.reconstruction.estimate import estimate


@pytest.fixture(scope="module")
def people(sample: Path) -> PeopleTruth:
    return load_people_truth(sample / "people" / "truth.json")


@pytest.fixture(scope="module")
def found(sample: Path) -> list[Case]:
    reports = {path.name: path.read_bytes() for path in (sample / "people" / "reports").glob("*.xml")}
    return cases(reports, sample / "osm")


def test_every_way_a_person_can_go_occurs(people: PeopleTruth) -> None:
    walked = [person for crash in people.crashes for person in crash.people]
    assert len(walked) >= 12
    assert {person.course for person in walked} == {"from_left", "from_right", "along", "towards"}
    assert {crash.kind for crash in people.crashes} == {"pedestrian", "cyclist", "animal"}


def test_side_and_place_are_right_where_reported(people: PeopleTruth, found: list[Case]) -> None:
    made = {case.key: estimate(case.record, case.network, case.report, SETTINGS.states) for case in found}
    rows = score_people(people, made)
    assert all(row.course_correct is not None for row in rows)
    told = [row for row in rows if row.told]
    assert sum(bool(row.course_correct) for row in told) / len(told) >= 0.95
    for summary in by_kind(rows):
        assert summary.estimated == summary.people
        assert summary.worst_impact_point_error_m is not None
        assert summary.worst_impact_point_error_m <= 0.5


def test_a_perfect_estimate_has_no_error_and_none_is_none(people: PeopleTruth) -> None:
    rows = score_people(people, {})
    assert [row.course_correct for row in rows] == [None] * len(rows)
    assert {summary.estimated for summary in by_kind(rows)} == {0}


def test_reports_that_say_too_little_are_refused(
    people: PeopleTruth, refused: Callable[[str, Mapping[str, str]], dict[str, str]]
) -> None:
    expected = {crash.key: crash.expected.reason for crash in people.crashes if crash.expected.reason}
    assert refused("people", {crash.key: crash.kind for crash in people.crashes}) == expected
    assert len(expected) >= 2
