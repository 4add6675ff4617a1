"""Reported events matched with simulated ones, by one rule of order for estimates and verdicts.

Events are contacts, each with the numbers of both bodies, and overturns. Contacts with vehicles, people and animals are
required in the reported order. Later strikes of objects and overturns are optional, so that a missing one does not
affect those that follow. Such an event may also come after a later one of other parties, since the order of the two was
not observed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Final, TypeAlias

from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.parties import is_vehicle
from trace_dag.simulation.types import Contact, SimulationLog, overturned_at

Pair: TypeAlias = tuple[int, int]
_STANDS_MPS: Final = 0.5


@dataclass(frozen=True)
class SimulatedEvent:
    """A simulated event: its time (s), its parties (lower number first), and its contact.

    A vehicle that overturns has its own number twice and no contact.
    """

    time_s: float
    pair: Pair
    contact: Contact | None = None


@dataclass(frozen=True)
class Expected:
    """The parties of a reported event, and whether later events wait for it."""

    pair: Pair
    required: bool = True


@dataclass(frozen=True)
class Matching:
    """``matched``: the simulated event for each expected event, None if it does not happen in its turn.

    ``strange``: contacts of pairs that are unexpected, at all or at that time, in order.
    """

    matched: tuple[SimulatedEvent | None, ...]
    strange: tuple[SimulatedEvent, ...]

    @property
    def happened(self) -> int:
        """Return the number of expected events that happen in their turn."""
        return sum(each is not None for each in self.matched)


def pair_of(contact: Contact) -> Pair:
    """Return the numbers of both bodies, the lower one first.

    >>> pair_of(log.first_contact)
    (1, 2)
    """
    one, two = sorted((contact.number_1, contact.number_2))
    return one, two


def expect_events(events: Iterable[CrashEvent]) -> list[Expected]:
    """Return the expectations of reported events; contacts and the first event are required.

    >>> expect_events(tree_sequence.events)  # a tree that event 2 has
    [Expected(pair=(1, 2002), required=True)]
    """
    return [Expected(event.pair, place == 0 or event.is_contact) for place, event in enumerate(events)]


def happenings(contacts: Iterable[Contact]) -> list[SimulatedEvent]:
    """Return contacts as simulated events, in order of time.

    Contacts of a thrown person with a standing vehicle are left out, because reports do not mention them.

    >>> [each.pair for each in happenings(log.contacts)]
    [(1, 2)]
    """
    found: list[SimulatedEvent] = []
    touched: set[int] = set()
    for contact in sorted(contacts, key=lambda each: each.time_s):
        thrown = contact.number_2 in touched and not is_vehicle(contact.number_2)
        if not (thrown and math.hypot(*contact.velocity_1_mps) <= _STANDS_MPS):
            found.append(SimulatedEvent(contact.time_s, pair_of(contact), contact))
        touched.add(contact.number_2)
    return found


def happenings_of(log: SimulationLog) -> list[SimulatedEvent]:
    """Return all events of a simulation: contacts and overturns."""
    overturns = []
    for vehicle in log.parties:
        step = overturned_at(vehicle)
        if step is not None:
            overturns.append(SimulatedEvent(float(vehicle.time_s[step]), (vehicle.number, vehicle.number)))
    return sorted([*happenings(log.contacts), *overturns], key=lambda each: each.time_s)


def match(seen: Sequence[SimulatedEvent], expected: Sequence[Expected], *, order_known: bool = True) -> Matching:
    """Match the simulated events with the expected ones.

    A pair that has met may touch again at any time, as bodies come to rest against each other. If the order of the
    events is not known, the best match counts.

    >>> matching = match(happenings(log.contacts[:1]), [Expected((1, 2))])
    >>> matching.matched[0].pair, matching.strange
    ((1, 2), ())
    """
    if order_known:
        return _walked(seen, expected)
    return max(_in_any_order(seen, expected), key=lambda each: (each.happened, -len(each.strange)))


def _in_any_order(seen: Sequence[SimulatedEvent], expected: Sequence[Expected]) -> Iterable[Matching]:
    """Yield the matchings for every order of the required events; the optional ones count at any time."""
    required = [place for place, each in enumerate(expected) if each.required]
    free = {each.pair: place for place, each in enumerate(expected) if not each.required}
    waiting = [each for each in seen if each.pair not in free]
    for places in permutations(required):
        walked = _walked(waiting, [expected[place] for place in places])
        matched: list[SimulatedEvent | None] = [None] * len(expected)
        for place, each in zip(places, walked.matched, strict=True):
            matched[place] = each
        for pair, place in free.items():
            matched[place] = next((each for each in seen if each.pair == pair), None)
        yield Matching(tuple(matched), walked.strange)


def _walked(seen: Sequence[SimulatedEvent], expected: Sequence[Expected]) -> Matching:
    matched: list[SimulatedEvent | None] = [None] * len(expected)
    strange: list[SimulatedEvent] = []
    turn = 0  # the next expected event
    for each in seen:
        place = _place_of(each.pair, expected, turn)
        if place is None:
            place = _passed_over(each.pair, expected, matched, turn)
        if place is not None:
            matched[place] = each
            turn = max(turn, place + 1)
        elif each.contact is not None and each.pair not in [passed.pair for passed in expected[:turn]]:
            strange.append(each)
    return Matching(tuple(matched), tuple(strange))


def _passed_over(
    pair: Pair, expected: Sequence[Expected], matched: Sequence[SimulatedEvent | None], turn: int
) -> int | None:
    """Return the event of these parties that was passed over for one of other parties, or None."""
    for place in reversed(range(turn)):
        if matched[place] is not None and set(expected[place].pair) & set(pair):
            return None
        if expected[place].pair == pair:
            return None if expected[place].required else place
    return None


def _place_of(pair: Pair, expected: Sequence[Expected], turn: int) -> int | None:
    """Return the index of the expected event with these parties, or None.

    The search goes from the current event up to the next required one.
    """
    for place in range(turn, len(expected)):
        if expected[place].pair == pair:
            return place
        if expected[place].required:
            return None
    return None
