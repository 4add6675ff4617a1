"""What supports a verdict: facts weighed and summed, essential differences, and the grade they amount to."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.simulation.motions import CAR, straight
from tests.verdict.crashes import FRAME, estimate, record, simulated, two_way, vehicle
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import Comparison, CrashPlacement, MapReport
from trace_dag.verdict.judge import judge
from trace_dag.verdict.support import LEAST_FACTS, LEAST_SUPPORT, Weight, assess_support, fitted_weights, grade_of
from trace_dag.verdict.types import Agreement, ComparedWith, Fact, Grade, Verdict, verdict_from_json, verdict_to_json

HALF = CAR.length_m / 2
HEAD_ON = (
    straight(-HALF - 60.0, -1.75, 0.0, 20.0, until_s=8.0),
    straight(HALF + 45.0, -1.5, math.pi, 15.0, until_s=8.0),
)
STREET = RoadNetwork(
    FRAME, (replace(two_way("1", -300.0, 0.0, 0.0, 600.0), names=("Main Street", "US 29"), highway="primary"),)
)
AS_REPORTED = replace(
    record(vehicle(1, 12, 50), vehicle(2, 12, 51)),
    trafficway_1="US-29",
    function_class_code=3,
    route_code=2,
    manner_of_collision_code=2,
    first_harmful_event_code=12,
    intersection_type_code=1,
    junction_relation_code=1,
)


def graded(reported: CrashRecord, *comparisons: Comparison) -> Verdict:
    hypothesis, log = simulated(*HEAD_ON)
    report = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "by hand"), (), comparisons)
    return judge(reported, STREET, report, estimate(hypothesis), [log], VerdictSettings())


def fact(
    name: str, agreement: Agreement = Agreement.AGREES, *, essential: bool = False, number: int | None = None
) -> Fact:
    return Fact(name, ComparedWith.MAP, agreement, "one", "other", essential, number)


def test_a_weight_is_the_log_of_how_much_likelier_a_fact_is_in_a_true_report() -> None:
    # (8 + 0.5) / (10 + 1.5) against (2 + 0.5) / (10 + 1.5)
    assert Weight("limit", Agreement.AGREES, 8, 10, 2, 10).log_likelihood_ratio == pytest.approx(math.log(8.5 / 2.5))


def test_weights_add_up_and_what_both_vehicles_report_counts_once() -> None:
    weights = {("limit", Agreement.AGREES): 1.5, ("lanes", Agreement.DIFFERS): -1.0, ("impact", Agreement.AGREES): 2.0}
    facts = (fact("limit"), fact("lanes", Agreement.DIFFERS), fact("impact", number=1), fact("impact", number=2))
    found = assess_support(facts, weights)
    assert found.total == pytest.approx(1.5 - 1.0 + 2.0)
    assert found.independent_facts == 2


def test_enough_facts_and_support_and_nothing_against_is_corroborated() -> None:
    names = [f"fact {index}" for index in range(LEAST_FACTS)]
    strong = {(name, Agreement.AGREES): LEAST_SUPPORT / LEAST_FACTS + 0.01 for name in names}
    weak = {(name, Agreement.AGREES): LEAST_SUPPORT / LEAST_FACTS - 0.01 for name in names}
    facts = [fact(name) for name in names]
    assert grade_of(assess_support(facts, strong)) is Grade.CORROBORATED
    assert grade_of(assess_support(facts, weak)) is Grade.CONSISTENT
    assert grade_of(assess_support(facts[1:], dict.fromkeys(strong, 9.0))) is Grade.CONSISTENT
    against = [*facts, fact("street", Agreement.DIFFERS, essential=True)]
    assert grade_of(assess_support(against, dict.fromkeys(strong, 9.0))) is Grade.CONSISTENT
    near = [*facts, fact("street", Agreement.NEAR, essential=True)]
    assert grade_of(assess_support(near, strong)) is Grade.CORROBORATED


def test_a_report_as_it_was_is_refuted_by_nothing() -> None:
    verdict = graded(AS_REPORTED)
    assert verdict.accepted
    assert verdict.support is not None
    assert [fact.name for fact in verdict.support.facts if fact.refutes] == []
    agreements = {fact.name: fact.agreement for fact in verdict.support.facts}
    for name in ("first street", "road class", "first harmful event", "crash type", "manner of collision", "impact"):
        assert agreements[name] is Agreement.AGREES, name


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"trafficway_1": "ELM ST"}, "first street"),
        ({"trafficway_1": "US-301"}, "first street"),
        ({"trafficway_1": "I-29"}, "I-29"),
        ({"function_class_code": 1, "route_code": 1}, "FUNC_SYS"),
        ({"first_harmful_event_code": 42}, "first harmful event"),
        ({"intersection_type_code": 2, "junction_relation_code": 2}, "TWAY_ID2 names no second street"),
        ({"trafficway_2": "OAK ST"}, "TWAY_ID2"),
        ({"vehicles": (vehicle(1, 12, 1), vehicle(2, 12, 6))}, "single vehicle"),
        ({"vehicles": (vehicle(1, 12, 50), vehicle(2, 12, 89))}, "classes"),
    ],
)
def test_an_essential_difference_forbids_corroboration(change: dict[str, object], says: str) -> None:
    verdict = graded(replace(AS_REPORTED, **change))  # type: ignore[arg-type]
    assert verdict.accepted
    assert verdict.support is not None
    assert verdict.grade is Grade.CONSISTENT
    assert says in verdict.support.detail


def test_another_kind_of_intersection_on_the_map_forbids_it_a_kindred_one_does_not() -> None:
    four, other = RoadTopology.FOUR_WAY.value, RoadTopology.ROUNDABOUT.value
    differs = graded(AS_REPORTED, Comparison("intersection type", other, four, "differs"))
    assert differs.support is not None
    assert "intersection" in differs.support.detail
    kindred = graded(AS_REPORTED, Comparison("intersection type", RoadTopology.T.value, four, "differs"))
    assert kindred.support is not None
    assert not any(fact.refutes for fact in kindred.support.facts)


def test_values_of_the_report_alone_are_no_facts() -> None:
    verdict = graded(AS_REPORTED, Comparison("lanes", "2", None, "not comparable", filled_from_report=True))
    assert verdict.support is not None
    assert "lanes" not in {fact.name for fact in verdict.support.facts}


def test_a_report_with_little_in_it_is_consistent_at_most() -> None:
    verdict = graded(record(vehicle(1, None, 50), vehicle(2, None, 51)))
    assert verdict.grade is not Grade.CORROBORATED


def test_a_route_number_is_not_missed_on_a_map_that_numbers_no_routes() -> None:
    names = {"Main Street"}
    unnumbered = RoadNetwork(FRAME, (replace(STREET.roads[0], names=tuple(names)),))
    hypothesis, log = simulated(*HEAD_ON)
    report = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "by hand"), ())
    verdict = judge(AS_REPORTED, unnumbered, report, estimate(hypothesis), [log], VerdictSettings())
    assert verdict.support is not None
    assert "first street" not in {fact.name for fact in verdict.support.facts}


@pytest.mark.parametrize(("second", "agreement"), [("US-33 RAMP", Agreement.NEAR), ("US-33", Agreement.DIFFERS)])
def test_a_reported_ramp_is_on_neither_of_the_streets_it_joins(second: str, agreement: Agreement) -> None:
    """On a ramp without a name that meets US 33, of a map with SR 104 elsewhere."""
    street = STREET.roads[0]
    away = two_way("3", -300.0, 90.0, 0.0, 600.0)
    roads = (
        replace(street, highway="motorway_link", names=()),
        replace(two_way("2", -300.0, 40.0, 0.0, 600.0), names=("US 33",)),
        replace(away, names=("SR 104",)),
    )
    hypothesis, log = simulated(*HEAD_ON)
    placement = CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "by hand", cross_road_ids=("2",))
    of = replace(AS_REPORTED, trafficway_1="SR-104", trafficway_2=second)
    network = RoadNetwork(FRAME, roads)
    verdict = judge(of, network, MapReport("by hand", placement, ()), estimate(hypothesis), [log], VerdictSettings())
    assert verdict.support is not None
    assert {fact.name: fact.agreement for fact in verdict.support.facts}["first street"] is agreement


def test_the_fitted_table_speaks_for_what_agrees() -> None:
    weights = fitted_weights()
    for name in ("first street", "second street", "limit", "lanes", "intersection"):
        assert weights[name, Agreement.AGREES] > 0 > weights[name, Agreement.DIFFERS], name


def test_a_graded_verdict_is_read_back_as_it_was_written() -> None:
    verdict = graded(AS_REPORTED)
    assert verdict_from_json(verdict_to_json(verdict)) == verdict
