"""Which vehicle struck which person or animal, in order: what crashes with those outside vehicles are made from.

A strike is an event of the record with a person; where the first harmful event was with a live animal, one with an
animal, and all such events are taken to be with the same one. Tables before 2016 often say less. A report without
events and persons still tells by its first harmful event that its only vehicle struck somebody; a report with events
but without persons tells that somebody of that kind was struck. Such a person has number 1, and nothing else is known
about them. Nothing is guessed about several vehicles or persons: :func:`untold_strike` says in words what is left open.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.animals import StruckAnimal
from trace_dag.crash.codes import events as codes
from trace_dag.crash.contacts import unlisted_vehicles
from trace_dag.crash.kind import OF_STRIKES, CrashKind
from trace_dag.crash.parties import UNKNOWN_NON_MOTORIST, EventKind, thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, NonMotorist, VehicleRecord
from trace_dag.crash.struck import ORDER_OF_STRIKES

_PERSON_TYPE: Final = {codes.PEDESTRIAN: 5, codes.CYCLIST: 6, codes.PERSON_ON_CONVEYANCE: 8}
"""``PER_TYP`` of who was struck in an event with that code."""
_STRUCK: Final = frozenset({codes.LIVE_ANIMAL, *_PERSON_TYPE})


@dataclass(frozen=True)
class Strike:
    """A vehicle struck a person or an animal. ``event_number`` is that of the record's event, 1 where there is none.

    ``going_on`` are the numbers of the events that follow at once between the same two: the vehicle ran over whom it
    had struck. ``area`` is where the vehicle was struck, None if that is not known.
    """

    event_number: int
    vehicle: VehicleRecord
    person: NonMotorist
    area: ImpactArea | None
    going_on: tuple[int, ...] = ()

    @property
    def pair(self) -> tuple[int, int]:
        """Party numbers of the vehicle and of whom it struck."""
        return self.vehicle.number, self.person.party


def is_of_strikes(record: CrashRecord) -> bool:
    """Whether the crash is reconstructed by its strikes: of a kind with people or a live animal, and no two vehicles in
    transport collided in it alone (such a crash is one of two vehicles, whatever came first).

    >>> is_of_strikes(pedestrian_record), is_of_strikes(record)
    (True, False)
    """
    alone = record.colliding_vehicles and record.moving_vehicles == 2
    return record.kind in OF_STRIKES and not alone and not strikes_ridden_animal(record)


def strikes_ridden_animal(record: CrashRecord) -> bool:
    """Whether the crash is one with a ridden animal, or with a conveyance that an animal drew."""
    if record.kind is not CrashKind.ANIMAL:
        return False
    first = record.first_harmful_event_code
    struck = [event.code for event in record.events if event.kind is EventKind.ANIMAL_STRUCK]
    return next(code for code in (first, *struck) if code in codes.ANIMALS) == codes.RIDDEN_ANIMAL


def strikes_of(record: CrashRecord) -> tuple[Strike, ...]:
    """The strikes in the order of their events; empty where :func:`untold_strike` says what is missing.

    >>> [(strike.vehicle.number, strike.person.number) for strike in strikes_of(pedestrian_record)]
    [(1, 1)]
    """
    if untold_strike(record) is not None:
        return ()
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    found: list[Strike] = []
    for event in _strike_events(record):
        assert event.party_1 is not None
        vehicle, person = vehicles[event.party_1], _struck(record, event)
        assert person is not None
        area = event.area_1
        if area is None and not any(each.vehicle.number == vehicle.number for each in found):
            area = vehicle.impact
        if found and found[-1].pair == (vehicle.number, person.party):
            found[-1] = replace(found[-1], going_on=(*found[-1].going_on, event.number))
        else:
            found.append(Strike(event.number, vehicle, person, area))
    return tuple(found)


def order_is_told(record: CrashRecord) -> bool:
    """Whether the report says in which order its strikes happened."""
    return ORDER_OF_STRIKES not in record.implied


def untold_strike(record: CrashRecord) -> str | None:
    """What the report leaves open about who struck whom, as a sentence.

    None if it leaves nothing open, or if the crash is not reconstructed by its strikes.

    >>> silent = replace(pedestrian_record.events[0], party_2=None)
    >>> untold_strike(replace(pedestrian_record, events=(silent,)))
    'event 1 does not name the person that was struck'
    """
    if not is_of_strikes(record):
        return None
    events = _strike_events(record)
    if not events:
        if (unlisted := unlisted_vehicles(record)) is not None:
            return unlisted
        moving = record.moving_vehicles
        which = "that the vehicle" if moving == 1 else f"which of {moving} vehicles"
        return f"nothing tells {which} in transport struck {_whom(record)}: the report lists no such event"
    listed = {vehicle.number for vehicle in record.vehicles}
    for event in events:
        if event.party_1 not in listed:
            return f"event {event.number} does not say which vehicle struck {_whom(record)}"
        if _struck(record, event) is None:
            persons = len(record.non_motorists)
            which = f"say which of {persons} persons was struck" if persons > 1 else "name the person that was struck"
            return f"event {event.number} does not {which}"
    return None


def _strike_events(record: CrashRecord) -> tuple[EventRecord, ...]:
    """The events in which a person was struck, or the animal; what the first harmful event implies where the report
    lists none."""
    animal = record.kind is CrashKind.ANIMAL
    wanted = {codes.LIVE_ANIMAL} if animal else codes.PERSON_EVENTS
    events = tuple(event for event in record.events if event.code in wanted)
    moving = [vehicle for vehicle in record.vehicles if vehicle.in_transport]
    code = record.first_harmful_event_code
    if events or code not in _STRUCK or len(moving) != 1 or record.moving_vehicles != 1:
        return events
    (vehicle,) = moving
    return (EventRecord(1, code, vehicle.number, vehicle.impact, None, None, ("code", "party_1", "area_1")),)


def _struck(record: CrashRecord, event: EventRecord) -> NonMotorist | None:
    """Whom an event was with: the one named, or one not listed; None if that cannot be told."""
    if event.code == codes.LIVE_ANIMAL:
        first = _strike_events(record)[0]
        return StruckAnimal(first.number if first.party_2 is None else first.party_2 - thing_party(0))
    named = next((person for person in record.non_motorists if person.party == event.party_2), None)
    if named is None and record.non_motorists:
        named = _only(record, event)
    if named is not None and named.person_type_code == UNKNOWN_NON_MOTORIST:
        return replace(named, person_type_code=_PERSON_TYPE[event.code])
    if named is not None or record.non_motorists:
        return named
    codes_struck = list(dict.fromkeys(each.code for each in _strike_events(record)))
    return NonMotorist(1 + codes_struck.index(event.code), _PERSON_TYPE[event.code])


def _only(record: CrashRecord, event: EventRecord) -> NonMotorist | None:
    """The only person of the kind that was struck, or of a kind that is not told, of a report without events."""
    struck = {_PERSON_TYPE[event.code], UNKNOWN_NON_MOTORIST}
    possible = [person for person in record.non_motorists if person.person_type_code in struck]
    return possible[0] if len(possible) == 1 and not record.events else None


def _whom(record: CrashRecord) -> str:
    return "the animal" if record.kind is CrashKind.ANIMAL else "the person"
