"""Negative controls of crashes of several contacts: another crash's report, one contact dropped, two swapped.

As of two vehicles (:mod:`trace_dag.verdict.controls`), judged by the same rules as the true pairing. A report that
lacks one contact must not accept the simulation in which it happens, nor one that tells two of them in the other order.
A parked vehicle is moved aside, so that the other one passes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from trace_dag.crash.contacts import VehicleContact, contacts_of, order_is_told
from trace_dag.crash.record import CrashRecord
from trace_dag.settings import VerdictSettings
from trace_dag.verdict.contacts import contact_criteria, observe_contacts
from trace_dag.verdict.controls import ControlRow, JudgedCrash, Shift, row_of
from trace_dag.verdict.judge import ObservedCrash, judge_observed
from trace_dag.verdict.metrics import clock_error_h

Contacts = tuple[VehicleContact, ...]
_ASIDE_M: Final = 3.0


def contact_controls(
    crash: JudgedCrash, others: Iterable[JudgedCrash], settings: VerdictSettings
) -> Iterator[ControlRow]:
    """One simulation against every other report of its kind with as many contacts, and against its own report with
    each contact dropped and each two that follow each other swapped.

    >>> rows = list(contact_controls(judged_queue, [judged_queue], VerdictSettings()))
    >>> [(row.kind, row.accepted) for row in rows]
    [('dropped', False), ('dropped', False), ('swapped', False)]
    """
    observed = observe_contacts(crash.network, crash.hypothesis, crash.log)

    def row(kind: str, report: CrashRecord, contacts: Contacts) -> ControlRow:
        held_to = ObservedCrash(lambda told: contact_criteria(observed, told, crash.log, settings, contacts))
        return row_of(kind, crash.record.key, judge_observed(report, held_to, settings))

    ours = contacts_of(crash.record)
    for other in others:
        theirs = in_place_of(other.record, crash.record)
        if other.record.key != crash.record.key and theirs is not None:
            judged = row("other_report", _with_vehicles(other.record, theirs), theirs)
            differ = _contacts_differ(ours, theirs, settings)
            yield replace(judged, other_key=other.record.key, reports_differ=differ)
    for changed in dropped(ours):
        yield row("dropped", crash.record, changed)
    for changed in swapped(ours) if order_is_told(crash.record) else ():
        yield row("swapped", crash.record, changed)


def parked_moved(crash: JudgedCrash) -> Shift | None:
    """The hypothesis with the parked vehicle of the first contact 3 m farther from where the other one came; None where
    none was parked.
    """
    first = contacts_of(crash.record)[0]
    parked = next((vehicle.number for vehicle, _ in first.sides if not vehicle.in_transport), None)
    if parked is None:
        return None
    states = {state.vehicle_number: state for state in crash.hypothesis.participants}
    (driven,) = (states[number] for number in first.pair if number != parked)
    stands = states[parked]
    heading = stands.initial_pose.heading_rad
    normal = np.array([-math.sin(heading), math.cos(heading)])
    away_m = math.copysign(_ASIDE_M, float(normal @ (stands.initial_pose.xy_m - driven.initial_pose.xy_m)))
    dx, dy = (away_m * normal).tolist()
    t = stands.trajectory
    moved = replace(
        stands,
        initial_pose=replace(stands.initial_pose, x_m=stands.initial_pose.x_m + dx, y_m=stands.initial_pose.y_m + dy),
        impact_pose=replace(stands.impact_pose, x_m=stands.impact_pose.x_m + dx, y_m=stands.impact_pose.y_m + dy),
        trajectory=replace(t, x_m=t.x_m + dx, y_m=t.y_m + dy),
    )
    participants = tuple(moved if state is stands else state for state in crash.hypothesis.participants)
    return Shift(replace(crash.hypothesis, participants=participants), parked, 0.0)


def in_place_of(other: CrashRecord, own: CrashRecord) -> Contacts | None:
    """The other report's contacts, its vehicles numbered as the own one's in the order in which they take part; None
    where it is of another kind or as many contacts and vehicles do not correspond.

    >>> [contact.pair for contact in in_place_of(queue_record, queue_record)], in_place_of(record, queue_record)
    ([(1, 2), (2, 3)], None)
    """
    theirs, ours = contacts_of(other), contacts_of(own)
    if other.kind is not own.kind or not theirs or len(theirs) != len(ours):
        return None
    old, new = _taking_part(theirs), _taking_part(ours)
    if len(old) != len(new):
        return None
    numbers = dict(zip(old, new, strict=True))
    return tuple(
        replace(
            contact,
            one=replace(contact.one, number=numbers[contact.one.number]),
            two=replace(contact.two, number=numbers[contact.two.number]),
        )
        for contact in theirs
    )


def _taking_part(contacts: Sequence[VehicleContact]) -> list[int]:
    """Numbers of the vehicles in the order in which they take part."""
    return list(dict.fromkeys(vehicle.number for contact in contacts for vehicle, _ in contact.sides))


def _with_vehicles(record: CrashRecord, contacts: Contacts) -> CrashRecord:
    """The report with the vehicles of these contacts."""
    vehicles = {vehicle.number: vehicle for contact in contacts for vehicle, _ in contact.sides}
    return replace(record, vehicles=tuple(vehicles[number] for number in sorted(vehicles)))


def dropped(contacts: Contacts) -> Iterator[Contacts]:
    """The contacts without one of them, for each whose pair does not meet at another time.

    >>> [[contact.pair for contact in left] for left in dropped(contacts_of(queue_record))]
    [[(2, 3)], [(1, 2)]]
    """
    for left_out in contacts if len(contacts) > 1 else ():
        rest = tuple(contact for contact in contacts if contact is not left_out)
        if left_out.pair not in [contact.pair for contact in rest]:
            yield rest


def swapped(contacts: Contacts) -> Iterator[Contacts]:
    """The contacts with two that follow each other in the other order, for each two.

    >>> [[contact.pair for contact in left] for left in swapped(contacts_of(queue_record))]
    [[(2, 3), (1, 2)]]
    """
    for first in range(len(contacts) - 1):
        yield (*contacts[:first], contacts[first + 1], contacts[first], *contacts[first + 2 :])


def _contacts_differ(ours: Contacts, theirs: Contacts, settings: VerdictSettings) -> bool:
    """Whether two reports, numbered alike, contradict each other in who met whom or in an area of impact by more than
    the threshold: else no simulation of the one can be told from one of the other by them."""
    for mine, other in zip(ours, theirs, strict=True):
        if mine.pair != other.pair:
            return True
        for vehicle, area in mine.sides:
            apart_h = clock_error_h(area.clock_h, other.vehicle(vehicle.number).impact) if area else None
            if apart_h is not None and apart_h > settings.max_clock_error_h:
                return True
    return False
