"""Doubts about accepted crashes, and which events of a report happen."""

from __future__ import annotations

import math
from dataclasses import replace

import example_objects
import numpy as np
import pytest

from trace_dag.common.units import kmh_to_mps
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import EventRecord, VehicleClass
from trace_dag.reconstruction.alternatives import alternatives
from trace_dag.simulation.states import EstimateCheck, Hypothesis, StateEstimate
from trace_dag.verdict.judge import event_outcomes, judge
from trace_dag.verdict.observation import ObservedCrash, observe_crash
from trace_dag.verdict.reservations import place_doubts, simulation_doubts
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.support import assess_support, facts_of
from trace_dag.verdict.types import (
    Agreement,
    ComparedWith,
    Doubt,
    EventOutcome,
    EventResult,
    Fact,
    Grade,
    Label,
    Support,
)

RECORD = example_objects.record_of("record")  # a car turns left across a motorcycle
MADE = example_objects.made_of("record")
LOG = MADE.logs[0]


def observed(log=LOG, hypothesis=MADE.state_estimate.hypotheses[0]) -> ObservedCrash:
    return observe_crash(MADE.network, hypothesis, log)


def outcomes(record, seen: ObservedCrash) -> tuple[EventOutcome, ...]:
    return event_outcomes(Comparison.of(record, sequence_of(record), seen, example_objects.SETTINGS.verdict))


def doubts(record=RECORD, *, report=MADE.map_report, log=LOG, hypothesis=None, events=()) -> dict[Doubt, str]:
    seen = observed(log) if hypothesis is None else observed(log, hypothesis)
    beside = Comparison.of(record, sequence_of(record), seen, example_objects.SETTINGS.verdict)
    support = assess_support(facts_of(record, MADE.network, report, beside))
    found = (*simulation_doubts(beside, events), *place_doubts(record, MADE.network, report, support))
    return {each.doubt: each.detail for each in found}


def test_a_sound_crash_has_no_doubts():
    assert doubts() == {}


def test_a_street_with_another_name_than_the_reported_one_which_is_elsewhere_is_doubted():
    here = {MADE.map_report.placement.road_id, *MADE.map_report.placement.cross_road_ids}
    elsewhere = next(
        road.name
        for road in MADE.network.roads
        if road.name and road.id not in here and road.name not in {"Main Street", "Elder Street"}
    )
    other = replace(RECORD, trafficway_1=elsewhere.upper(), trafficway_2="")
    assert elsewhere.upper() in doubts(other)[Doubt.OTHER_STREET]
    nowhere = replace(RECORD, trafficway_1="NO SUCH LN", trafficway_2="")
    assert Doubt.OTHER_STREET not in doubts(nowhere)


@pytest.mark.parametrize(
    ("names", "doubted"),
    [
        (["lanes", "road class"], True),
        (["limit", "alignment"], True),
        (["lanes", "lanes"], False),  # of both vehicles
        (["lanes", "land use", "control"], False),
    ],
)
def test_a_road_of_which_two_features_differ_is_taken_for_another_one(names: list[str], doubted: bool):
    facts = tuple(Fact(name, ComparedWith.MAP, Agreement.DIFFERS, "2", "3") for name in names)
    found = place_doubts(RECORD, MADE.network, MADE.map_report, Support(facts, 5.0, 6))
    assert [each.doubt for each in found] == ([Doubt.OTHER_STREET] if doubted else [])
    assert all(f"{name} 3 for 2" in each.detail for each in found for name in names)


@pytest.mark.parametrize(("kmh", "harmless"), [(15.9, True), (16.1, False)])
def test_an_impact_below_ten_miles_an_hour_cannot_have_killed(kmh: float, harmless: bool):
    """By Joksch (1993) the risk of death is (delta-v / 71 mph)^4: 4 in 10,000 at 16 km/h, which are 9.9 mph."""
    gentle = tuple(
        replace(each, delta_v_1_mps=(kmh_to_mps(kmh), 0.0), delta_v_2_mps=(0.0, 0.1)) for each in LOG.contacts
    )
    found = doubts(log=replace(LOG, contacts=gentle), hypothesis=cars())
    assert (Doubt.HARMLESS in found) is harmless
    if harmless:
        assert "10 mph" in found[Doubt.HARMLESS]


def test_a_rider_who_is_struck_falls_at_the_speed_ridden():
    """30 mph are reported of the motorcycle: touched ever so lightly, its rider comes to the ground at that speed."""
    touched = tuple(replace(each, delta_v_1_mps=(0.1, 0.0), delta_v_2_mps=(0.0, 0.1)) for each in LOG.contacts)
    assert Doubt.HARMLESS not in doubts(log=replace(LOG, contacts=touched))
    assert Doubt.HARMLESS in doubts(log=replace(LOG, contacts=touched), hypothesis=cars())
    slow = tuple(replace(each, velocity_2_mps=(1.0, 0.0)) for each in touched)
    assert Doubt.HARMLESS in doubts(log=replace(LOG, contacts=slow))


@pytest.mark.parametrize(
    ("closing_kmh", "reported_kmh", "harmless"), [(15.9, 60.0, True), (16.1, 60.0, False), (5.0, 8.0, False)]
)
def test_a_person_touched_slowly_is_not_killed_unless_that_is_reported(
    closing_kmh: float, reported_kmh: float, harmless: bool
):
    made, report = example_objects.made_of("pedestrian_record"), example_objects.record_of("pedestrian_record")
    log = made.logs[0]
    slowed = tuple(replace(each, closing_speed_mps=kmh_to_mps(closing_kmh)) for each in log.contacts)
    seen = observe_crash(made.network, made.state_estimate.hypotheses[0], replace(log, contacts=slowed))
    vehicles = tuple(replace(each, travel_speed_mps=kmh_to_mps(reported_kmh)) for each in report.vehicles)
    record = replace(report, vehicles=vehicles)
    beside = Comparison.of(record, sequence_of(record), seen, example_objects.SETTINGS.verdict)
    assert (Doubt.HARMLESS in {each.doubt for each in simulation_doubts(beside, ())}) is harmless


def cars() -> Hypothesis:
    best = MADE.state_estimate.hypotheses[0]
    return replace(best, participants=tuple(replace(s, vehicle_class=VehicleClass.CAR) for s in best.participants))


def test_an_event_that_does_not_happen_is_doubted_one_that_cannot_be_simulated_is_not():
    rolled, burnt = EventRecord(2, 1, 1, None, None, None), EventRecord(3, 2, 1, None, None, None)
    record = replace(RECORD, events=(*RECORD.events, rolled, burnt))
    planned = EstimateCheck("overturn of event 2", False, "it tilts by 4 degrees at most")
    best = replace(MADE.state_estimate.hypotheses[0], later_events=(planned,))
    events = outcomes(record, observed(hypothesis=best))
    assert [(each.event_number, each.code, each.outcome, each.why) for each in events] == [
        (1, 12, EventResult.HAPPENED, ""),
        (2, 1, EventResult.MISSED, "it tilts by 4 degrees at most"),
        (3, 2, EventResult.NOT_MODELLED, ""),
    ]
    found = doubts(record, events=events)
    assert list(found) == [Doubt.EVENT_MISSED]
    assert found[Doubt.EVENT_MISSED].startswith("vehicle 1 overturned: does not happen")


def test_events_at_once_between_the_same_two_are_one_that_goes_on():
    first = RECORD.events[0]
    again = replace(RECORD, events=(first, replace(first, number=2)))
    assert [each.outcome for each in outcomes(again, observed())] == [EventResult.HAPPENED, EventResult.HAPPENED]


def test_a_report_without_events_has_the_one_that_its_first_harmful_event_implies():
    made = example_objects.made_of("tree_record")
    seen = observe_crash(made.network, made.state_estimate.hypotheses[0], made.logs[0])
    record = example_objects.record_of("tree_record")
    (tree,) = (event for event in record.events if event.is_harmful)
    silent = replace(record, events=(), first_harmful_event_code=tree.code)
    assert [(each.event_number, each.code) for each in outcomes(silent, seen)] == [(1, tree.code)]


def test_contacts_before_the_first_harmful_event_are_missed():
    tree = EventRecord(1, 42, 1, None, 2001, None)
    record = replace(RECORD, first_harmful_event_code=12, events=(tree, replace(RECORD.events[0], number=2)))
    before, first = outcomes(record, observed())
    assert (before.outcome, before.why) == (EventResult.MISSED, "it comes before the first harmful event")
    assert first.outcome is EventResult.HAPPENED


def test_the_sides_that_a_report_leaves_open_are_an_attribute_and_no_bar_to_corroboration():
    """Two hypotheses with equal scores, the second turned by half a circle: 50 % each, nothing between them."""
    best = MADE.state_estimate.hypotheses[0]

    def turned(state):
        path = state.trajectory
        return replace(state, trajectory=replace(path, x_m=-path.x_m, y_m=-path.y_m))

    mirrored = replace(best, participants=tuple(map(turned, best.participants)))
    estimate = StateEstimate(RECORD.key, (best, mirrored), MADE.state_estimate.run, ambiguity=0.52)
    found = alternatives(estimate)
    assert found is not None
    assert [(each.party, each.side, each.share) for each in found.sides[:2]] == [(1, "west", 0.48), (1, "east", 0.48)]
    x, y = (float(values[0]) for values in (best.participants[0].trajectory.x_m, best.participants[0].trajectory.y_m))
    assert math.hypot(x, y) > 5.0
    assert "vehicle 1 from the west (48 %) or from the east (48 %)" in found.clause
    verdict = judge(RECORD, MADE.network, MADE.map_report, estimate, [LOG, LOG], example_objects.SETTINGS.verdict)
    assert (verdict.label, verdict.grade) == (Label.VERIFIED, Grade.CORROBORATED)
    assert (verdict.alternatives, verdict.direction_open) == (found.clause, found.sides)
    sure = judge(
        RECORD, MADE.network, MADE.map_report, replace(estimate, ambiguity=0.25), [LOG, LOG],
        example_objects.SETTINGS.verdict,
    )  # fmt: skip
    assert (sure.alternatives, sure.direction_open) == ("", ())


def test_distances_from_the_reported_point_are_stated_for_every_kind_of_crash():
    for name in ("queue_record", "pedestrian_record", "tree_record"):
        made = example_objects.made_of(name)
        record = example_objects.record_of(name)
        verdict = judge(
            record, made.network, made.map_report, made.state_estimate, made.logs, example_objects.SETTINGS.verdict
        )
        contact = made.logs[verdict.hypothesis].first_contact
        assert contact is not None
        distance = verdict.criterion("reported_distance")
        assert distance is not None
        assert distance.value == pytest.approx(float(np.hypot(contact.x_m, contact.y_m)))
