"""Whether a crash is of the kind that is modelled so far: two motor vehicles that touched, by an event of the record.

Two vehicles in one crash need not have met: in 2.2 % of the fatal crashes of two vehicles of 2016 they did not, most of
them having struck the same pedestrian. What happened instead is named.
"""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.events import HARM_EV, VEHICLE_CONTACTS
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.crash.summary import event_in_words

_MOST_TOLD: Final = 4
"""Events that a sentence names."""


def another_kind(record: CrashRecord) -> str | None:
    """What happened instead of a contact of two vehicles, as a sentence; None if two met, or may have met."""
    if record.colliding_pair is not None or untold_meeting(record) is not None:
        return None
    numbers = [str(vehicle.number) for vehicle in record.vehicles]
    if len(numbers) > 1:
        never = f"vehicles {', '.join(numbers[:-1])} and {numbers[-1]} never touch in the report"
    else:
        never = "no two vehicles touch in the report"
    return f"{never}: {_what_happened(record)}; only collisions of two vehicles are modelled"


def untold_meeting(record: CrashRecord) -> str | None:
    """Why it cannot be told which two vehicles met first, or whether any did; None if it can."""
    if record.colliding_pair is not None:
        return None
    unnamed = next((event for event in record.events if event.code in VEHICLE_CONTACTS and not event.is_contact), None)
    if unnamed is not None:
        return f"nothing tells which two vehicles met first: {_told(unnamed)}"
    first = record.first_harmful_event_code
    if _harmful(record) or (first is not None and first not in VEHICLE_CONTACTS):
        return None
    return (
        f"nothing tells whether two vehicles met: HARM_EV {'not known' if first is None else first}, and the report "
        f"lists no {'harmful event that is known' if record.events else 'events'}"
    )


def _what_happened(record: CrashRecord) -> str:
    harmful = _harmful(record)
    told = [_told(event) for event in harmful[:_MOST_TOLD]]
    if len(harmful) > _MOST_TOLD:
        told.append(f"and {len(harmful) - _MOST_TOLD} more")
    first = record.first_harmful_event_code
    if first is not None and first not in {event.code for event in harmful}:
        told.append(f"the first harmful event is that a vehicle {HARM_EV.meaning(first)} (HARM_EV {first})")
    return ", ".join(told)


def _harmful(record: CrashRecord) -> list[EventRecord]:
    return [event for event in record.events if HARM_EV.meaning(event.code)]


def _told(event: EventRecord) -> str:
    return f"event {event.number} {event_in_words(event)} (SOE {event.code})"
