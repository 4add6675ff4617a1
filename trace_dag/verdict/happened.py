"""Outcomes of the reported harmful events in the simulation."""

from __future__ import annotations

from trace_dag.crash.event_sequence import MODELLED, CrashEvent
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import EventRecord
from trace_dag.verdict.metrics import clock_error_positions
from trace_dag.verdict.observation import ObservedEvent
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import EventOutcome, EventResult


def event_outcomes(beside: Comparison) -> tuple[EventOutcome, ...]:
    """Return the outcome of each harmful event of the report, in its order.

    An event between the same two parties as the one before it goes on with that one. If the report lists no events, it
    is the one that its first harmful event implies. A later object that is struck at another part of the body than
    reported is not the reported event.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> beside = Comparison.of(record, sequence_of(record), observed_crash, VerdictSettings())
    >>> [each.outcome.value for each in event_outcomes(beside)]  # one event: the two collide
    ['happened']
    """
    planned = {event.number: event for event in beside.sequence.events}
    why_not = {check.name: check.detail for check in beside.observed.hypothesis.later_events if not check.passed}
    listed = [(event.number, event.code) for event in beside.record.events if event.is_harmful]
    listed = [each for each in listed if beside.sequence.has(each[0]) or each[0] < beside.sequence.first.number]
    found = []
    for number, code in listed or [(event.number, event.code) for event in beside.sequence.events]:
        event = planned.get(number) or beside.sequence.goes_on_with(number)
        seen = None if event is None else beside.seen(event)
        elsewhere = _struck_elsewhere(event, seen, beside) if event is not None and seen is not None else ""
        if elsewhere:
            found.append(EventOutcome(number, code, EventResult.MISSED, elsewhere))
        elif seen is not None:
            time_s = round(seen.time_s, 4) if number in planned else None
            found.append(EventOutcome(number, code, EventResult.HAPPENED, time_s=time_s))
        elif code not in MODELLED:
            found.append(EventOutcome(number, code, EventResult.NOT_MODELLED))
        else:
            why = beside.sequence.unclear.get(number) or (why_not.get(event.name) if event else None)
            found.append(EventOutcome(number, code, EventResult.MISSED, why or _why(event, number, beside)))
    return tuple(found)


def _struck_elsewhere(event: CrashEvent, seen: ObservedEvent, beside: Comparison) -> str:
    """Return the sentence that a later object is struck at another part of the body than reported; else ""."""
    side = seen.sides.get(event.vehicle.number)
    if event.kind is not EventKind.OBJECT_STRUCK or event is beside.begins or side is None or event.area is None:
        return ""
    error = clock_error_positions(beside.rules.clock_h(side), event.area)
    if error is None or error <= beside.limits.max_clock_error_positions:
        return ""
    return f"the object is struck at {side.clock_h:.1f} o'clock, reported is {event.area.clock_h:g}"


def _why(event: CrashEvent | None, number: int, beside: Comparison) -> str:
    if event is None:
        first: EventRecord | None = next((e for e in beside.record.events if e.number == number), None)
        return "it comes before the first harmful event" if first is not None else "not simulated"
    if event.kind is EventKind.OVERTURN:
        return f"vehicle {event.vehicle.number} stays on its wheels"
    return "the object is not struck" if event.kind is EventKind.OBJECT_STRUCK else "the two do not touch in their turn"
