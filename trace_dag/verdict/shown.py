"""Measures that a verdict shows beside its criteria; they judge nothing.

``J_KNIFE`` says whether a combination jackknifed, in the first or a later event; the angle at which one counts as such
is nowhere defined, so that the largest angle between both is shown with the report's word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from trace_dag.common.units import wrap_angle
from trace_dag.crash.codes.vehicle import J_KNIFE
from trace_dag.crash.event_sequence import OFF_THE_ROAD
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.metrics import speed_error_rel
from trace_dag.verdict.observation import ObservedEvent, ObservedVehicle, StruckSide
from trace_dag.verdict.rules import Beside, Comparison, at_most
from trace_dag.verdict.types import Criterion


def select_measures(beside: Comparison) -> Iterator[Criterion]:
    """Return the measures shown for every reported event that happens, in order.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> shown = list(select_measures(Comparison.of(record, sequence_of(record), observed_crash, VerdictSettings())))
    >>> [(each.vehicle_number, each.value) for each in shown if each.name == "reported_clock"]
    [(2, 1.0), (1, 3.0)]
    """
    for event in beside.sequence.events:
        seen = beside.seen(event)
        if seen is None:
            continue
        each = Beside(event, seen, event is beside.begins, beside)
        if event.kind in OFF_THE_ROAD:
            yield from _beside_the_road(each)
        else:
            yield from _of_contact(each)
        for vehicle in event.vehicles:
            if vehicle.number in seen.sides:
                yield from _of_vehicle(each, vehicle.number)
        if seen.person is not None:
            yield from _of_person(each)


def shown(name: str, value: float | None, unit: str, number: int | None = None, event: int | None = None) -> Criterion:
    """Return a measure that is shown without a judgement."""
    return Criterion(name, value, None, unit, None, None, "", number, event)


def _of_contact(each: Beside) -> Iterator[Criterion]:
    contact, number = each.seen.contact, each.event.number
    yield shown("contact_time", contact.time_s, "s", None, number)
    yield shown("closing_speed", contact.closing_speed_mps, "mps", None, number)
    if each.first and each.event.kind is EventKind.VEHICLE_CONTACT:
        apart_rad = wrap_angle(contact.pose_1.heading_rad - contact.pose_2.heading_rad)
        yield shown("approach_angle", abs(math.degrees(apart_rad)), "deg", None, number)


def _of_vehicle(each: Beside, number: int) -> Iterator[Criterion]:
    event, side = each.event.number, each.seen.sides[number]
    vehicle, went = each.event.as_struck(number), each.seen.vehicles.get(number)
    struck: StruckSide | ObservedVehicle = side if went is None else went
    yield shown("clock", struck.clock_h, "h", number, event)
    yield shown("reported_clock", vehicle.impact.clock_h if vehicle.impact else None, "h", number, event)
    yield shown("bearing_clock", struck.bearing_clock_h, "h", number, event)
    yield shown("impact_speed", struck.impact_speed_mps, "mps", number, event)
    yield shown("delta_v", struck.delta_v_mps, "mps", number, event)
    yield shown("pdof", struck.pdof_deg, "deg", number, event)
    if went is None:
        return
    limit = each.of.limits.max_speed_error_rel
    error = speed_error_rel(went.impact_speed_mps, vehicle)
    yield at_most("impact_speed_error", error, limit, "rel", None, number, event)
    yield shown("turn", went.turn_deg, "deg", number, event)
    yield shown("initial_speed", went.initial_speed_mps, "mps", number, event)
    yield shown("arrival_error", went.arrival_error_m, "m", number, event)
    yield shown("path_error_p99", went.path_error_p99_m, "m", number, event)
    yield shown("tracked_speed_error_p99", went.tracked_speed_error_p99_rel, "rel", number, event)


def _of_person(each: Beside) -> Iterator[Criterion]:
    person, party, event = each.seen.person, each.event.party, each.event.number
    assert person is not None
    yield replace(shown("throw_distance", person.thrown_m, "m", party, event), detail=person.throw.value)
    yield shown("person_speed", person.speed_mps, "mps", party, event)
    yield shown("time_on_carriageway", person.exposed_s, "s", party, event)
    yield shown("outside_carriageway", person.outside_m, "m", party, event)


def _beside_the_road(each: Beside) -> Iterator[Criterion]:
    event, number, seen = each.event, each.event.vehicle.number, each.seen
    if event.kind is EventKind.OBJECT_STRUCK:
        yield shown("closing_speed", seen.contact.closing_speed_mps, "mps", None, event.number)
    if each.first and seen.departure is not None:
        left, place = seen.departure, seen.departure.place
        if event.kind is EventKind.OBJECT_STRUCK:
            yield shown("outside_carriageway", place.beyond_m if place else None, "m", number, event.number)
            yield shown("angle_to_road", _angle_to_road_deg(seen), "deg", number, event.number)
            yield shown("departure_time", left.left_s, "s", number, event.number)
    if seen.overturn is not None:
        over = seen.overturn
        yield shown("overturn_time", seen.time_s, "s", number, event.number)
        yield shown("overturn_speed", over.speed_mps, "mps", number, event.number)
        yield shown("slide_distance", over.slid_m, "m", number, event.number)
        yield shown("quarter_turns", float(over.quarter_turns), "", number, event.number)


def _angle_to_road_deg(seen: ObservedEvent) -> float | None:
    """Return the angle between the vehicle's course before the contact and the road, 0 to 90.

    None without a road near it.
    """
    place = seen.departure.place if seen.departure is not None else None
    if place is None:
        return None
    vx, vy = seen.contact.velocity_1_mps
    return math.degrees(abs(math.remainder(math.atan2(vy, vx) - place.along_rad, math.pi)))


def articulation_shown(record: CrashRecord, log: SimulationLog) -> Iterator[Criterion]:
    """Return the largest hitch angle of each vehicle with a trailer in the simulation, degrees.

    >>> list(articulation_shown(record, log))  # neither vehicle draws a trailer
    []
    """
    reported = {vehicle.number: vehicle.jackknife_code for vehicle in record.vehicles}
    for number in sorted(log.trailers):
        angle = log.articulation_rad(number)
        if angle is None:
            continue
        word = J_KNIFE.meaning(reported.get(number)) or "not reported"
        largest_deg = math.degrees(float(np.abs(angle).max()))
        yield Criterion("articulation", largest_deg, None, "deg", None, None, f"jackknife reported: {word}", number)
