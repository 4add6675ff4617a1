"""Which harmful events of a report happen in its simulation.

Read from the criteria of the verdict, which say of each event that was looked for whether it occurred. An event that no
criterion speaks of was not looked for, so that it did not happen.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from trace_dag.crash.codes.events import FIXED_OBJECTS, LIVE_ANIMAL, OVERTURN, PERSON_EVENTS, VEHICLE_CONTACTS
from trace_dag.crash.record import CrashRecord, EventRecord, first_vehicle_contact
from trace_dag.crash.summary import event_named
from trace_dag.verdict.types import Criterion, EventOutcome, Happening

MODELLED: Final = VEHICLE_CONTACTS | PERSON_EVENTS | FIXED_OBJECTS | {LIVE_ANIMAL, OVERTURN}
"""Events (``SOE``) that a simulation can have. Not trains, loose objects, cargo, fire, water, ridden animals, or who
falls from a vehicle."""
_OF_EVENTS: Final = frozenset(
    {"contact", "overturn", "strike", "next_contact", "later_event", "later_object", "later_overturn", "other_event"}
)


def event_outcomes(record: CrashRecord, criteria: Iterable[Criterion]) -> tuple[EventOutcome, ...]:
    """What becomes of each harmful event of the report, in its order.

    An event between the same two parties as the one before it goes on with that one.

    >>> [each.outcome.value for each in event_outcomes(record, verdict.criteria)]  # one event: the two collide
    ['happened']
    """
    first = first_vehicle_contact(record.events)
    looked_for: dict[int, Criterion] = {}
    for criterion in criteria:
        number = criterion.event_number
        if number is None and criterion.name == "contact" and first is not None:
            number = first.number  # a collision of two vehicles is judged as a whole
        if number is not None and criterion.name in _OF_EVENTS:
            looked_for[number] = criterion
    found: list[EventOutcome] = []
    before: EventRecord | None = None
    for event in record.events:
        if not event.is_harmful:
            continue
        goes_on = before is not None and event.is_contact and _parties(event) == _parties(before)
        if goes_on and found[-1].outcome is Happening.HAPPENED:
            found.append(EventOutcome(event.number, event.code, Happening.HAPPENED))
        else:
            found.append(_outcome(event, looked_for.get(event.number)))
        before = event
    return tuple(found)


def _parties(event: EventRecord) -> frozenset[int | None]:
    return frozenset((event.party_1, event.party_2))


def _outcome(event: EventRecord, criterion: Criterion | None) -> EventOutcome:
    if criterion is not None and criterion.passed:
        return EventOutcome(event.number, event.code, Happening.HAPPENED)
    if event.code not in MODELLED:
        return EventOutcome(event.number, event.code, Happening.NOT_MODELLED)
    why = "" if criterion is None or criterion.passed is None else criterion.detail
    why = why.removeprefix(f"{event_named(event.number, event.code)}: ")
    return EventOutcome(event.number, event.code, Happening.MISSED, why or "not simulated")
