"""The street and the side to which a vehicle left it, beside what the report says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reconstruction.test_run_off_road_planner import TREE, judged_crash, left_road
from tests.verdict.crashes import STREET
from trace_dag.common.errors import Reason
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.verdict.departed_street import DepartedStreet, find_departed_street, street_likeness
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.rules import Comparison, criteria

ELM, OAK = "Elm Street", "Oak Avenue"


@pytest.mark.parametrize(
    ("left", "reported", "near", "held"),
    [
        (ELM, ("ELM ST", ""), (ELM, OAK), True),
        (OAK, ("ELM ST", ""), (ELM, OAK), False),
        (OAK, ("ELM ST", "OAK AVE"), (ELM, OAK), True),
        (OAK, ("ELM ST", ""), (OAK,), None),  # the reported street is not on the map there
        (OAK, ("", ""), (ELM, OAK), None),
        (OAK, ("SR-12", ""), (ELM, OAK), None),  # a number cannot be held against a name
    ],
)
def test_a_motion_along_a_street_that_is_not_reported_is_none_of_the_report(
    left: str, reported: tuple[str, str], near: tuple[str, ...], held: bool | None
) -> None:
    crash = replace(left_road(TREE), trafficway_1=reported[0], trafficway_2=reported[1])
    _, found, detail = street_likeness(DepartedStreet(frozenset({left}), frozenset(near)), crash)
    assert found is held
    assert (OAK in detail) is (held is False)


def test_a_crash_on_another_street_than_the_reported_one_is_elsewhere() -> None:
    crash = judged_crash(left_road(TREE))
    (road,) = STREET.roads
    for names, reason in (((OAK,), None), ((ELM, OAK), None), ((ELM,), Reason.WRONG_LOCATION)):
        # The reported street is drawn beside it, so that the map has it there.
        other = replace(road, id="2", plan=tuple(replace(each, y_m=30.0) for each in road.plan), names=(OAK,))
        street = RoadNetwork(STREET.frame, (replace(road, names=names), other))
        told = replace(crash.record, trafficway_1="OAK AVE")
        verdict = judge_hypothesis(told, street, crash.hypothesis, crash.log, VerdictSettings())
        assert verdict.reason is reason, verdict.detail


@pytest.mark.parametrize(
    ("zone", "why"), [(1, "the first harmful event was on the roadway"), (4, "the report does not say to which side")]
)
def test_no_side_is_judged_without_a_reported_one(zone: int, why: str) -> None:
    crash = judged_crash(left_road(TREE))
    (car,) = crash.record.vehicles
    told = replace(
        crash.record,
        events=crash.record.events[1:],  # without the departure
        vehicles=(replace(car, crash_type_code=None),),
        road_relation_code=zone,
    )
    beside = Comparison.of(told, sequence_of(told), crash.observed, VerdictSettings())
    (side,) = (criterion for criterion in criteria(beside) if criterion.name == "departure_side")
    assert (side.passed, side.detail) == (None, why)


def test_the_street_is_that_under_the_vehicle_before_it_leaves() -> None:
    named = RoadNetwork(STREET.frame, tuple(replace(road, names=(ELM,)) for road in STREET.roads))
    log = judged_crash(left_road(TREE)).log
    [driven] = log.vehicles
    assert log.first_contact is not None
    assert find_departed_street(named, driven, log.first_contact.time_s).names == {ELM}
    beside = replace(driven, y_m=np.full_like(driven.y_m, 50.0))
    assert find_departed_street(named, beside, log.first_contact.time_s).names == frozenset()
