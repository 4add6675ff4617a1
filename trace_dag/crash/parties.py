"""Parties of a crash: kinds of parties and of events, and the numbers that identify parties.

Vehicles keep their numbers (``VEH_NO``, 1 to 999), persons outside them have 1000 + ``PER_NO``; objects, animals and
trains, which no table numbers, 2000 + the number of the event (``EVENTNUM``) in which they were struck. Does not belong
here: finding the party of an event (:mod:`trace_dag.crash.event_parties`). A trailer is no party: it belongs to the
vehicle that pulls it. If a body of its own needs a number, in logs and pictures, it is 3000 + ``VEH_NO``.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from trace_dag.crash.codes import elements as codes

HIGHEST_NUMBER: Final = 999
"""Limit for a vehicle, and for a person before :data:`_PERSONS` is added."""
_PERSONS: Final = 1000
_THINGS: Final = 2000
_TRAILERS: Final = 3000
SURROUNDING: Final = 4000
"""Number beyond which bodies are of vehicles around a crash, which no report has."""


class PartyKind(StrEnum):
    """Kinds of parties."""

    MOTOR_VEHICLE = "motor_vehicle"
    PARKED_VEHICLE = "parked_vehicle"
    PEDESTRIAN = "pedestrian"
    CYCLIST = "cyclist"
    CONVEYANCE = "conveyance"
    OTHER_PERSON = "other_person"
    ANIMAL = "animal"
    TRAIN = "train"
    OBJECT = "object"


class EventKind(StrEnum):
    """Kinds of events, by code (``SOE``)."""

    VEHICLE_CONTACT = "vehicle_contact"
    PERSON_STRUCK = "person_struck"
    OBJECT_STRUCK = "object_struck"
    ANIMAL_STRUCK = "animal_struck"
    TRAIN_STRUCK = "train_struck"
    OVERTURN = "overturn"
    DEPARTURE = "departure"
    OTHER_HARM = "other_harm"
    NO_HARM = "no_harm"
    UNKNOWN = "unknown"


_KIND_OF_CODES: Final = (
    (codes.VEHICLE_CONTACTS, EventKind.VEHICLE_CONTACT),
    (codes.PERSON_EVENTS, EventKind.PERSON_STRUCK),
    (codes.FIXED_OBJECTS | codes.LOOSE_OBJECTS, EventKind.OBJECT_STRUCK),
    (codes.ANIMALS, EventKind.ANIMAL_STRUCK),
    (codes.TRAINS, EventKind.TRAIN_STRUCK),
    ({codes.OVERTURN}, EventKind.OVERTURN),
    (codes.DEPARTURES, EventKind.DEPARTURE),
)
_KIND_OF_CODE: Final[Mapping[int, EventKind]] = {code: kind for group, kind in _KIND_OF_CODES for code in group}
_THING_STRUCK: Final[Mapping[EventKind, PartyKind]] = {
    EventKind.OBJECT_STRUCK: PartyKind.OBJECT,
    EventKind.ANIMAL_STRUCK: PartyKind.ANIMAL,
    EventKind.TRAIN_STRUCK: PartyKind.TRAIN,
}
_PERSON_TYPES: Final[Mapping[int, PartyKind]] = {
    5: PartyKind.PEDESTRIAN,
    **dict.fromkeys((6, 7), PartyKind.CYCLIST),
    **dict.fromkeys((8, 11, 12, 13), PartyKind.CONVEYANCE),
}


UNKNOWN_NON_MOTORIST: Final = 19
"""``PER_TYP`` of a person outside motor vehicles of whom nothing says more."""


def event_kind(code: int) -> EventKind:
    """Return the kind of an ``SOE`` code.

    >>> str(event_kind(12)), str(event_kind(1))
    ('vehicle_contact', 'overturn')
    """
    if code in _KIND_OF_CODE:
        return _KIND_OF_CODE[code]
    if codes.HARM_EV.meaning(code):
        return EventKind.OTHER_HARM
    return EventKind.NO_HARM if codes.SOE.meaning(code) else EventKind.UNKNOWN


def person_kind(person_type_code: int) -> PartyKind:
    """Return the kind of a person by ``PER_TYP``; other for a person in a building or on an animal-drawn vehicle.

    >>> str(person_kind(5)), str(person_kind(6))
    ('pedestrian', 'cyclist')
    """
    return _PERSON_TYPES.get(person_type_code, PartyKind.OTHER_PERSON)


def thing_struck(code: int) -> PartyKind | None:
    """Return the kind of thing that an event with this code strikes, or None.

    >>> str(thing_struck(42)), thing_struck(1)  # a tree; an overturn strikes nothing
    ('object', None)
    """
    return _THING_STRUCK.get(event_kind(code))


def person_party(number: int) -> int:
    """Return the party number of the person with that ``PER_NO``.

    >>> person_party(1)
    1001
    """
    return _PERSONS + number


def thing_party(event_number: int) -> int:
    """Return the party number of the object, animal or train struck in an event, by the event's number.

    >>> thing_party(2)
    2002
    """
    return _THINGS + event_number


def trailer_body(vehicle: int) -> int:
    """Return the number of the body that a vehicle pulls.

    >>> trailer_body(2)
    3002
    """
    return _TRAILERS + vehicle


def party_of_body(number: int) -> int:
    """Return the party of a body: for a trailer the vehicle that pulls it, otherwise the body's own number.

    >>> party_of_body(3002), party_of_body(1001)
    (2, 1001)
    """
    return number - _TRAILERS if _TRAILERS < number <= SURROUNDING else number


def is_vehicle(party: int | None) -> bool:
    """Return whether a party number is that of a motor vehicle.

    >>> is_vehicle(2), is_vehicle(1001), is_vehicle(None)
    (True, False, False)
    """
    return party is not None and party <= HIGHEST_NUMBER


def party_label(party: int) -> str:
    """Return a short name for pictures, files and tables.

    ``V2`` is a vehicle, ``P1`` a person, ``O3`` the object of event 3, ``T2`` the trailer of vehicle 2, ``S4`` a
    vehicle around the crash.

    >>> party_label(2), party_label(1001), party_label(2003), party_label(3002), party_label(4004)
    ('V2', 'P1', 'O3', 'T2', 'S4')
    """
    if party > SURROUNDING:
        return f"S{party - SURROUNDING}"
    if party < _PERSONS:
        return f"V{party}"
    if party > _TRAILERS:
        return f"T{party - _TRAILERS}"
    return f"P{party - _PERSONS}" if party < _THINGS else f"O{party - _THINGS}"


def party_in_words(party: int) -> str:
    """Return a party as ``vehicle 2`` or ``person 1``; an object or animal is named by its event.

    >>> party_in_words(1001)
    'person 1'
    """
    if party < _PERSONS:
        return f"vehicle {party}"
    if party > _TRAILERS:
        return f"the trailer of vehicle {party - _TRAILERS}"
    return f"person {party - _PERSONS}" if party < _THINGS else f"what event {party - _THINGS} struck"
