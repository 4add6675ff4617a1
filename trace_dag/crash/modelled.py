"""Whether the events of a record are of a kind that can be judged; if not, what happened instead.

Two vehicles in one crash need not have met: in 2.2 % of the fatal crashes of two vehicles of 2016 they did not; most of
those struck the same pedestrian. Where two vehicles met, something of another kind may have come first: such a crash is
judged for the collision of the two.
"""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.events import HARM_EV, VEHICLE_CONTACTS
from trace_dag.crash.contacts import is_of_contacts, unlisted_vehicles, untold_contact
from trace_dag.crash.departures import OF_DEPARTURES
from trace_dag.crash.kind import COLLISIONS, JUDGED_KINDS, OF_STRIKES, CrashKind
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.crash.strikes import strikes_ridden_animal
from trace_dag.crash.summary import event_in_words

_MOST_TOLD: Final = 4
"""Events that a sentence names."""
_JUDGED_IN_WORDS: Final = {
    CrashKind.TWO_VEHICLES: "collisions of two vehicles",
    CrashKind.MULTI_VEHICLE: "collisions of three or more vehicles",
    CrashKind.PEDESTRIAN: "crashes with pedestrians",
    CrashKind.CYCLIST: "crashes with cyclists",
    CrashKind.PARKED: "crashes with parked vehicles",
    CrashKind.FIXED_OBJECT: "crashes with fixed objects",
    CrashKind.OVERTURN: "overturns",
    CrashKind.ANIMAL: "crashes with animals",
}


def another_kind(record: CrashRecord) -> str | None:
    """Why the crash cannot be judged: its kind and what happened, as a sentence. None if it can be judged, or if the
    report does not tell.
    """
    kind = record.kind
    met = record.colliding_vehicles is not None
    if untold_meeting(record) is not None or (met and record.moving_vehicles == 2):
        return None
    if is_of_contacts(record):
        if met and not _struck_persons(record):
            return None
    elif (
        kind in JUDGED_KINDS
        and not (kind in COLLISIONS and not met)
        and not (kind in OF_STRIKES and _several_met(record))
        and not (kind is CrashKind.ANIMAL and (strikes_ridden_animal(record) or _struck_persons(record)))
        and not (kind in OF_DEPARTURES and record.moving_vehicles > 1)
    ):
        return None
    numbers = [str(vehicle.number) for vehicle in record.vehicles]
    if len(numbers) > 1 and not met:
        said = f"vehicles {', '.join(numbers[:-1])} and {numbers[-1]} never touch in the report"
    elif is_of_contacts(record) and _struck_persons(record):
        said = "vehicles that met also struck persons"
    elif kind is CrashKind.ANIMAL and not _several_met(record):
        ridden = strikes_ridden_animal(record)
        said = "the animal was ridden or drew a conveyance" if ridden else "an animal and persons were struck"
    elif met and record.moving_vehicles > 2:
        said = f"{record.moving_vehicles} vehicles in transport"
    else:
        said = "no two vehicles in transport touch in the report"
    if kind in JUDGED_KINDS:
        why = f"such {_JUDGED_IN_WORDS[kind]} are not modelled"
    else:
        *most, last = _JUDGED_IN_WORDS.values()
        why = f"modelled are {', '.join(most)} and {last}, and no other crashes so far"
    return f"{said}: {_what_happened(record)}; {why}"


def untold_meeting(record: CrashRecord) -> str | None:
    """Why the report does not tell which two vehicles met first, or whether any did. None if it tells, or if the crash
    is of a kind in which no vehicles meet.
    """
    if is_of_contacts(record):
        return untold_contact(record)
    if record.colliding_vehicles is not None or record.kind not in COLLISIONS:
        return None
    if (unlisted := unlisted_vehicles(record)) is not None:
        return unlisted
    unnamed = next(
        (event for event in record.events if event.code in VEHICLE_CONTACTS and not event.is_vehicle_contact), None
    )
    if unnamed is not None:
        return f"nothing tells which two vehicles met first: {_told(unnamed)}"
    if any(event.is_harmful for event in record.events):
        return None
    first = record.first_harmful_event_code
    return (
        f"nothing tells whether two vehicles met: HARM_EV {'not known' if first is None else first}, and the report "
        f"lists no {'harmful event that is known' if record.events else 'events'}"
    )


def _struck_persons(record: CrashRecord) -> bool:
    return any(event.kind is EventKind.PERSON_STRUCK for event in record.events)


def _several_met(record: CrashRecord) -> bool:
    """Whether vehicles in transport touched each other as well as a person: then there is more to reconstruct than the
    strikes. A parked vehicle that was struck is shown as a later event."""
    moving = {vehicle.number for vehicle in record.vehicles if vehicle.in_transport}
    return any(event.is_vehicle_contact and {event.party_1, event.party_2} <= moving for event in record.events)


def _what_happened(record: CrashRecord) -> str:
    harmful = [event for event in record.events if event.is_harmful]
    told = [_told(event) for event in harmful[:_MOST_TOLD]]
    if len(harmful) > _MOST_TOLD:
        told.append(f"and {len(harmful) - _MOST_TOLD} more")
    first = record.first_harmful_event_code
    if first is not None and first not in {event.code for event in harmful}:
        told.append(f"the first harmful event is that a vehicle {HARM_EV.meaning(first)} (HARM_EV {first})")
    return ", ".join(told) or "no harmful event is known"


def _told(event: EventRecord) -> str:
    return f"event {event.number} {event_in_words(event)} (SOE {event.code})"
