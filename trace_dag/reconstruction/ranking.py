"""Ranking of hypotheses: log-likelihoods, the best of each group, and the certainty of the first."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Final, Protocol, TypeVar

_NAMED: Final = 0.05  # likelihood beside the best of a group that comes before the details of others
_OVERSTATED: Final = 1.5
_UNFORESEEN: Final = 0.06  # how often none of the sides that were found is right: the same study
_DECIMALS: Final = 6
_FARTHEST: Final = 50.0  # log-likelihoods farther apart than this have weights that differ by more than any decimals


class HasScore(Protocol):
    """Something with a log-likelihood."""

    @property
    def score(self) -> float:
        """Return the log-likelihood."""


Found = TypeVar("Found")
Ranked = TypeVar("Ranked", bound=HasScore)


class Scored:
    """A plan whose log-likelihood is the sum of its ``terms``, with the words that distinguish it from the others."""

    terms: dict[str, float]

    @property
    def name(self) -> str:
        """Return the words that distinguish it from the other plans of its crash."""
        raise NotImplementedError

    @property
    def score(self) -> float:
        """Return the log-likelihood, rounded so that the order does not depend on the last bits."""
        return round(math.fsum(self.terms.values()), _DECIMALS)


def drawn(key: str, about: str) -> float:
    """Return a number between 0 and 1, drawn for a crash and a question; repeated calls give the same number.

    >>> drawn("2023-319003", "side") == drawn("2023-319003", "side"), 0.0 <= drawn("2023-319003", "side") < 1.0
    (True, True)
    """
    return int.from_bytes(hashlib.sha256(f"{key} {about}".encode()).digest()[:6], "big") / 2**48


def first_of_groups(ordered: Iterable[Found], group_of: Callable[[Found], Hashable]) -> list[Found]:
    """Return the first of each group, in their order.

    >>> first_of_groups([1, 3, 2, 4], lambda number: number % 2)  # odd, even
    [1, 2]
    """
    first: dict[Hashable, Found] = {}
    for each in ordered:
        first.setdefault(group_of(each), each)
    return list(first.values())


def leaders_first(ordered: Sequence[Ranked], group_of: Callable[[Ranked], Hashable]) -> list[Ranked]:
    """Return the first of each group and then the others, each in their order, best first.

    Members of a group differ only in detail. Groups less than a twentieth as likely as the best are not moved to the
    front.

    >>> from types import SimpleNamespace
    >>> tried = (("west", -1), ("west", -2), ("east", -3), ("north", -9))
    >>> found = [SimpleNamespace(side=side, score=score) for side, score in tried]
    >>> [each.score for each in leaders_first(found, lambda each: each.side)]
    [-1, -3, -2, -9]
    """
    leaders = [
        each for each in first_of_groups(ordered, group_of) if likelihood(each.score, ordered[0].score) >= _NAMED
    ]
    return move_to_front(ordered, leaders)


def move_to_front(ordered: Sequence[Found], leaders: Sequence[Found]) -> list[Found]:
    """Return some of a sequence and then its others, both in their order.

    >>> move_to_front("abcd", "bd")
    ['b', 'd', 'a', 'c']
    """
    leading = {id(each) for each in leaders}
    return [*leaders, *(each for each in ordered if id(each) not in leading)]


def likelihood(score: float, best: float) -> float:
    """Return likelihoods relative to the best, from log-likelihoods.

    The terms are overlapping judgements, whose sum claims too much certainty. So it is divided by ``_OVERSTATED``,
    fitted with ``compare_directions`` on a city's table with the hidden directions.

    >>> round(likelihood(-4.0, -3.0), 2), likelihood(-3.0, -3.0)
    (0.51, 1.0)
    """
    return math.exp(min(max(score - best, -_FARTHEST), _FARTHEST) / _OVERSTATED)


def ambiguity(best: float, scores: Iterable[float]) -> float:
    """Return the posterior share of all but the best, from 0 to 1, from log-likelihoods.

    ``scores`` include the best. A share is kept for hypotheses that were not considered, so that even a single one is
    not certain.

    >>> ambiguity(-3.0, [-3.0]), ambiguity(-3.0, [-3.0, -3.0])
    (0.06, 0.53)
    """
    total = math.fsum(likelihood(score, best) for score in scores)
    return round(1.0 - (1.0 - _UNFORESEEN) / max(total, 1.0), _DECIMALS)
