"""Reported facts of a departure from the road beside the simulated one: side, part of the road, object, course.

The facts are those of two vehicles (:mod:`trace_dag.verdict.course_facts`) under names of their own, since the
weight of a fact is fitted to crashes of its kind. Objects are placed by the program, so that these facts tell less
than those of the place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from trace_dag.crash.parties import EventKind
from trace_dag.verdict.course_facts import impact_fact, movement_fact, speed_fact
from trace_dag.verdict.roadside import reported_zone, roadside_error_m
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Agreement, ComparedWith, Fact

_IN_PART_M: Final = 1.0


def departure_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every fact about how a vehicle left the road that the report says something of.

    None where nothing happened.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> from trace_dag.verdict.observation import observe_crash
    >>> observed = observe_crash(judged_tree.network, judged_tree.hypothesis, judged_tree.log)
    >>> facts = departure_facts(Comparison.of(tree_record, sequence_of(tree_record), observed, VerdictSettings()))
    >>> {fact.name: fact.agreement.value for fact in facts}["side of the departure"]
    'agrees'
    """
    event = beside.begins
    seen = None if event is None else beside.seen(event)
    if event is None or seen is None or seen.departure is None:
        return
    record, number, left = beside.record, event.vehicle.number, seen.departure
    side = beside.departure.side
    if side is not None:
        found = " or ".join(left.sides) or "on the road"
        yield _fact("side of the departure", Agreement.of(side in left.sides), side.value, found, number)
    zone = reported_zone(record)
    error_m = roadside_error_m(left.place, zone)
    if zone is not None and error_m is not None:
        found = "nowhere near a road" if left.place is None else left.place.zone.value
        yield _fact("part of the road", Agreement.of(error_m <= _IN_PART_M), zone.value, found, number)
    drove = seen.vehicles.get(number)
    if drove is None:
        return
    vehicle = event.as_struck(number)
    facts = (
        ("impact of the object", impact_fact(vehicle, drove) if event.kind is EventKind.OBJECT_STRUCK else None),
        ("movement before the departure", movement_fact(record, vehicle, drove)),
        ("speed before the departure", speed_fact(vehicle, drove)),
    )
    yield from (replace(found, name=name) for name, found in facts if found is not None)


def _fact(name: str, agreement: Agreement, reported: str, found: str, number: int) -> Fact:
    return Fact(name, ComparedWith.COURSE, agreement, reported, found, vehicle_number=number)
