"""Contacts of a simulation compared with the pairs that should touch, in order; used by estimates and verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

from trace_dag.sim.types import Contact


@dataclass(frozen=True)
class ContactOrder:
    """``matched``: for each expected pair its contact, None if it does not happen in its turn. ``strange``: contacts of
    pairs that are not expected at all or not yet, in order."""

    matched: tuple[Contact | None, ...]
    strange: tuple[Contact, ...]

    @property
    def happened(self) -> int:
        """Number of expected contacts that happened in their turn."""
        return sum(contact is not None for contact in self.matched)


def pair_of(contact: Contact) -> tuple[int, int]:
    """The numbers of both bodies, the lower one first.

    >>> pair_of(log.first_contact)
    (1, 2)
    """
    one, two = sorted((contact.number_1, contact.number_2))
    return one, two


def in_order(contacts: Sequence[Contact], expected: Sequence[tuple[int, int]], *, told: bool = True) -> ContactOrder:
    """The contacts beside the expected pairs, lower numbers first.

    A pair that has met may touch again at any time: bodies come to lie against each other. ``told`` is False where the
    order of the pairs is not known: then the one that fits best counts.

    >>> order = in_order(log.contacts[:1], [(1, 2)])
    >>> order.matched[0].number_2, order.strange
    (2, ())
    """
    if told:
        return _walked(contacts, expected)
    found = []
    for places in permutations(range(len(expected))):
        walked = _walked(contacts, [expected[place] for place in places])
        matched = dict(zip(places, walked.matched, strict=True))
        found.append(ContactOrder(tuple(matched[place] for place in range(len(expected))), walked.strange))
    return max(found, key=lambda order: (order.happened, -len(order.strange)))


def comes_in_order(contacts: Sequence[Contact], expected: Sequence[tuple[int, int]], *, told: bool = True) -> bool:
    """Whether nothing is strange about the contacts so far: more may follow until all expected pairs have met.

    >>> comes_in_order(log.contacts[:1], [(1, 2), (2, 3)]), comes_in_order(log.contacts[:1], [(2, 3), (1, 2)])
    (True, False)
    """
    orders = [expected] if told else permutations(expected)
    return any(not _walked(contacts, order).strange for order in orders)


def _walked(contacts: Sequence[Contact], expected: Sequence[tuple[int, int]]) -> ContactOrder:
    matched: list[Contact | None] = []
    strange: list[Contact] = []
    for contact in sorted(contacts, key=lambda each: each.time_s):
        pair = pair_of(contact)
        if len(matched) < len(expected) and pair == expected[len(matched)]:
            matched.append(contact)
        elif pair not in expected[: len(matched)]:
            strange.append(contact)
    return ContactOrder((*matched, *[None] * (len(expected) - len(matched))), tuple(strange))
