"""The contacts of a crash in order: which vehicle touched which. For crashes of three or more vehicles or a parked one.

A contact is an event of the record in which two vehicles touch. Further events that follow at once between the same two
belong to it, because the two are still against each other. Nothing is guessed here: :func:`untold_contact` says in
words what the events leave open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.codes.events import VEHICLE_CONTACTS
from trace_dag.crash.kind import CrashKind
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, VehicleRecord

OF_CONTACTS: Final = frozenset({CrashKind.MULTI_VEHICLE, CrashKind.PARKED})
"""Kinds that are reconstructed by every contact of their vehicles."""
ORDER_OF_CONTACTS: Final = "order_of_contacts"


@dataclass(frozen=True)
class VehicleContact:
    """Two vehicles touched, on these areas of each; None where an area is not known.

    ``going_on`` are the numbers of the events that follow at once between the same two.
    """

    event_number: int
    one: VehicleRecord
    area_1: ImpactArea | None
    two: VehicleRecord
    area_2: ImpactArea | None
    going_on: tuple[int, ...] = ()

    @property
    def pair(self) -> tuple[int, int]:
        """The numbers of both vehicles, the lower one first."""
        one, two = sorted((self.one.number, self.two.number))
        return one, two

    @property
    def sides(self) -> tuple[tuple[VehicleRecord, ImpactArea | None], tuple[VehicleRecord, ImpactArea | None]]:
        """Both vehicles with their areas."""
        return (self.one, self.area_1), (self.two, self.area_2)

    def vehicle(self, number: int) -> VehicleRecord:
        """One of the two, as it was struck in this contact. Raises ``KeyError`` for a vehicle that is neither."""
        for vehicle, area in self.sides:
            if vehicle.number == number:
                return replace(vehicle, impact=area)
        raise KeyError(number)


def is_of_contacts(record: CrashRecord) -> bool:
    """Whether the crash is reconstructed by all contacts of its vehicles. A crash of two vehicles in transport is not:
    it is reconstructed by their first contact, whatever came before and after it.

    >>> is_of_contacts(queue_record), is_of_contacts(record)  # three vehicles, two vehicles
    (True, False)
    """
    return record.kind in OF_CONTACTS and not (record.colliding_vehicles and record.moving_vehicles == 2)


def order_is_told(record: CrashRecord) -> bool:
    """Whether the report says in which order the contacts came."""
    return ORDER_OF_CONTACTS not in record.implied


def contacts_of(record: CrashRecord) -> tuple[VehicleContact, ...]:
    """The contacts in the order of their events; empty where :func:`untold_contact` says what is missing.

    >>> [contact.pair for contact in contacts_of(queue_record)]
    [(1, 2), (2, 3)]
    """
    if not is_of_contacts(record) or untold_contact(record) is not None:
        return ()
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    found: list[VehicleContact] = []
    met: set[int] = set()
    for event in record.events:
        if not event.is_vehicle_contact:
            continue
        assert event.party_1 is not None
        assert event.party_2 is not None
        contact = VehicleContact(
            event.number,
            vehicles[event.party_1],
            _area(vehicles, event.party_1, event.area_1, met),
            vehicles[event.party_2],
            _area(vehicles, event.party_2, event.area_2, met),
        )
        if found and found[-1].pair == contact.pair:
            found[-1] = replace(found[-1], going_on=(*found[-1].going_on, event.number))
        else:
            found.append(contact)
        met |= {event.party_1, event.party_2}
    return tuple(found)


def _area(
    vehicles: Mapping[int, VehicleRecord], number: int, area: ImpactArea | None, met: set[int]
) -> ImpactArea | None:
    """The area of an event. Where the event does not say it, a vehicle's first contact is at its initial impact."""
    return vehicles[number].impact if area is None and number not in met else area


def untold_contact(record: CrashRecord) -> str | None:
    """What the report leaves open about which vehicles met, as a sentence.

    None if it leaves nothing open, or if the crash is not reconstructed by its contacts.

    >>> untold_contact(replace(queue_record, vehicles_in_transport=4))
    'the report lists 3 of 4 vehicles in transport'
    """
    if not is_of_contacts(record):
        return None
    if (unlisted := unlisted_vehicles(record)) is not None:
        return unlisted
    unnamed = next((e for e in record.events if e.code in VEHICLE_CONTACTS and not e.is_vehicle_contact), None)
    if unnamed is not None:
        who = "which vehicles met" if unnamed.party_1 is None else f"whom vehicle {unnamed.party_1} met"
        return f"event {unnamed.number} (SOE {unnamed.code}) does not say {who}"
    if not any(event.is_vehicle_contact for event in record.events):
        return "no event says which vehicles met"
    silent = [vehicle.number for vehicle in record.vehicles if not _takes_part(record, vehicle)]
    if silent:
        numbers = " and ".join(map(str, silent))
        return f"nothing tells what part vehicle{'s' if len(silent) > 1 else ''} {numbers} had: no event that is known"
    return None


def unlisted_vehicles(record: CrashRecord) -> str | None:
    """That the report lists fewer vehicles in transport than it counts (``VE_FORMS``), as a sentence; else None.

    >>> unlisted_vehicles(replace(record, vehicles=record.vehicles[:1]))
    'the report lists 1 of 2 vehicles in transport'
    """
    listed = sum(vehicle.in_transport for vehicle in record.vehicles)
    if listed >= record.moving_vehicles:
        return None
    return f"the report lists {listed} of {record.moving_vehicles} vehicles in transport"


def _takes_part(record: CrashRecord, vehicle: VehicleRecord) -> bool:
    """Whether a harmful event that is known is one of this vehicle's."""
    own = [event for event in record.events if vehicle.number in (event.party_1, event.party_2)]
    return any(_is_known_harm(event) for event in own)


def _is_known_harm(event: EventRecord) -> bool:
    return event.is_vehicle_contact or (event.is_harmful and event.kind is not EventKind.VEHICLE_CONTACT)
