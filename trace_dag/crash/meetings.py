"""Meetings of vehicles for reports with each vehicle's own sequence alone (``VSOE``).

That sequence never names the other party.

A contact is in the sequences of both its vehicles, so every contact in one sequence has its counterpart in another.
Each sequence is in order of time. Often only one pairing fits: always with two vehicles; with three vehicles and two
contacts the vehicle with two rows is in the middle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Final, TypeAlias

from trace_dag.crash.codes.elements import STRUCK_STANDING, VEHICLE_EVENTS
from trace_dag.crash.derive import agrees_with_manner, in_one_configuration
from trace_dag.crash.record import EventRecord, ImpactArea, VehicleRecord

MOST_CONTACTS: Final = 10
"""Contacts in all sequences together above which no pairing is looked for: those of ten can be paired in 945 ways."""

_END: Final = 0.7
"""Cosine of an area's bearing from which on it is one of the front or the rear: 11, 12, 1 and 5, 6, 7 o'clock."""

_Contact: TypeAlias = tuple[int, int]
"""A vehicle's number, and which of its contacts, from 0."""
_Meeting: TypeAlias = tuple[_Contact, _Contact]
_Pairing: TypeAlias = frozenset[_Meeting]


@dataclass(frozen=True)
class VehicleEvent:
    """One event as a single vehicle saw it (``VSOE``): without the other party."""

    vehicle: int
    code: int
    area: ImpactArea | None
    mended: bool = False  # the code was blank and follows from other fields


def merge_sequences(
    by_vehicle: Mapping[int, Sequence[VehicleEvent]],
    vehicles: Sequence[VehicleRecord],
    *,
    contact_first: bool,
    man_coll: int | None,
) -> tuple[tuple[EventRecord, ...], bool]:
    """Return the crash's sequence joined from the vehicles' own, and whether the order of contacts was chosen.

    ``contact_first``: two vehicles met in the first harmful event, in the manner ``man_coll``.

    If several pairings are possible, those remain whose first contact agrees with ``MAN_COLL`` and the crash types. If
    they differ only in the order of contacts, vehicles with lower numbers met first (true in 92.5 % of the 1,712
    crashes of three vehicles and two contacts of 2016). If they differ in the parties, and one pairing has only
    contacts of a front with a rear, it is a queue in which each vehicle ran into its neighbour by number (true in 65 of
    66 such crashes of 2016). Otherwise the second party stays None.

    >>> own = {1: [VehicleEvent(1, 12, None)], 2: [VehicleEvent(2, 12, None)]}  # each met another vehicle in transport
    >>> (event,), chosen = merge_sequences(own, record.vehicles, contact_first=True, man_coll=6)
    >>> event.party_1, event.party_2, chosen
    (1, 2, False)
    """
    standing = frozenset(vehicle.number for vehicle in vehicles if not vehicle.in_transport)
    contacts = {
        number: [event for event in events if event.code in VEHICLE_EVENTS] for number, events in by_vehicle.items()
    }
    pairings = _pairings(contacts, standing)
    if contact_first and len(pairings) > 1:
        pairings = _fitting(pairings, contacts, {vehicle.number: vehicle for vehicle in vehicles}, man_coll)
    pairing, chosen = _certain(pairings, contacts, standing)
    partner = {one: other for pair in pairing for one, other in (pair, pair[::-1])}
    others = {vehicle.number for vehicle in vehicles}

    events: list[EventRecord] = []
    rows = {number: list(by_vehicle[number]) for number in sorted(by_vehicle)}
    met = dict.fromkeys(rows, 0)  # contacts that are in ``events`` by now

    def add(event: VehicleEvent, second: int | None, area: ImpactArea | None) -> None:
        implied = (*(("code",) if event.mended else ()), *(("party_2",) if second is not None else ()))
        events.append(EventRecord(len(events) + 1, event.code, event.vehicle, event.area, second, area, implied))

    while any(rows.values()):
        for number, pending in rows.items():
            while pending and (pending[0].code not in VEHICLE_EVENTS or (number, met[number]) not in partner):
                event = pending.pop(0)
                met[number] += event.code in VEHICLE_EVENTS
                add(event, _only_other(event, others, standing), None)
        heads = {(number, met[number]) for number, pending in rows.items() if pending}
        meeting = next((one[0], partner[one][0]) for one in sorted(heads) if partner[one] in heads) if heads else ()
        if meeting:
            striking, struck = sorted(meeting, key=lambda number: number in standing)
            event, other = rows[striking].pop(0), rows[struck].pop(0)
            met[striking], met[struck] = met[striking] + 1, met[struck] + 1
            add(event, struck, other.area)
    return tuple(events), chosen


def _only_other(event: VehicleEvent, numbers: Iterable[int], standing: frozenset[int]) -> int | None:
    """Return the only vehicle that an unpaired contact can be with, or None."""
    if event.code not in VEHICLE_EVENTS:
        return None
    possible = [number for number in numbers if _may_meet(event, number, event.code, standing)]
    return possible[0] if len(possible) == 1 else None


def _may_meet(event: VehicleEvent, other: int, other_code: int, standing: frozenset[int]) -> bool:
    if event.vehicle == other or event.code != other_code:
        return False
    stood = (event.vehicle in standing) + (other in standing)
    return stood == (1 if event.code in STRUCK_STANDING else 0)


def _fitting(
    possible: set[_Pairing],
    contacts: Mapping[int, Sequence[VehicleEvent]],
    vehicles: Mapping[int, VehicleRecord],
    man_coll: int | None,
) -> set[_Pairing]:
    """Return the pairings whose first contact agrees best with the report; all if none agrees."""
    score = {pairing: _first_fits(pairing, contacts, vehicles, man_coll) for pairing in possible}
    best = max(score.values())
    return {pairing for pairing in possible if best <= 0 or score[pairing] == best}


def _certain(
    possible: set[_Pairing], contacts: Mapping[int, Sequence[VehicleEvent]], standing: frozenset[int]
) -> tuple[_Pairing, bool]:
    """Return the meetings that are certain, and whether their order is not."""
    if not possible:
        return _in_turn(contacts, standing), False
    if len({tuple(sorted((one[0], other[0]) for one, other in pairing)) for pairing in possible}) == 1:
        return min(possible, key=sorted), len(possible) > 1
    queue = _queue(possible, contacts)
    return (queue or frozenset.intersection(*possible)), False


def _queue(possible: set[_Pairing], contacts: Mapping[int, Sequence[VehicleEvent]]) -> _Pairing | None:
    """Return the pairing of a queue, or None if there is none or a tie.

    Every contact is of a front with a rear, and each vehicle ran into its neighbour by number.
    """

    def apart(pairing: _Pairing) -> float:
        return math.fsum(abs(one[0] - other[0]) for one, other in pairing)

    def end(vehicle: int, index: int) -> int:
        """Return 1 at the front, -1 at the rear, 0 elsewhere."""
        area = contacts[vehicle][index].area
        along = math.cos(area.centre_rad) if area is not None else 0.0
        return 1 if along > _END else -1 if along < -_END else 0

    rear_ends = [pairing for pairing in possible if all({end(*one), end(*other)} == {1, -1} for one, other in pairing)]
    nearest = sorted(rear_ends, key=apart)
    alone = len(nearest) == 1 or (len(nearest) > 1 and apart(nearest[0]) < apart(nearest[1]))
    return nearest[0] if alone else None


def _pairings(contacts: Mapping[int, Sequence[VehicleEvent]], standing: frozenset[int]) -> set[_Pairing]:
    """Return every way to pair all contacts; empty if one has no counterpart, or if there are too many contacts."""
    numbers = sorted(contacts)
    if sum(map(len, contacts.values())) > MOST_CONTACTS:
        return set()

    @cache
    def from_here(met: tuple[int, ...]) -> frozenset[_Pairing]:
        pending = [index for index, number in enumerate(numbers) if met[index] < len(contacts[number])]
        if not pending:
            return frozenset({frozenset()})
        found: set[_Pairing] = set()
        for i, j in combinations(pending, 2):
            one, other = (contacts[numbers[index]][met[index]] for index in (i, j))
            if _may_meet(one, other.vehicle, other.code, standing):
                after = tuple(count + (index in (i, j)) for index, count in enumerate(met))
                meeting = ((numbers[i], met[i]), (numbers[j], met[j]))
                found.update(rest | {meeting} for rest in from_here(after))
        return frozenset(found)

    return set(from_here((0,) * len(numbers)))


def _in_turn(contacts: Mapping[int, Sequence[VehicleEvent]], standing: frozenset[int]) -> _Pairing:
    """Pair the contacts of two vehicles in order, even if one has more of them."""
    numbers = sorted(number for number in contacts if contacts[number])
    if len(numbers) != 2:
        return frozenset()
    one, other = numbers
    return frozenset(
        ((one, index), (other, index))
        for index, (first, second) in enumerate(zip(contacts[one], contacts[other], strict=False))
        if _may_meet(first, second.vehicle, second.code, standing)
    )


def _first_fits(
    pairing: _Pairing,
    contacts: Mapping[int, Sequence[VehicleEvent]],
    vehicles: Mapping[int, VehicleRecord],
    man_coll: int | None,
) -> int:
    """Score a pairing's first contact by the crash types (2) and by the manner of collision (1 or -1)."""

    def fits(one: int, other: int) -> int:
        types = in_one_configuration(vehicles[one].crash_type_code, vehicles[other].crash_type_code)
        areas = contacts[one][0].area, contacts[other][0].area
        manner = agrees_with_manner(man_coll, *areas)
        return 2 * types + (0 if manner is None else 1 if manner else -1)

    return max(fits(one, other) for (one, i), (other, j) in pairing if i == j == 0)
