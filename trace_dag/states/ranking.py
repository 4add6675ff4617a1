"""How estimators order what they tried: log-likelihoods, the best of each group, and how sure the first is."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Final, TypeVar

Found = TypeVar("Found")

_DECIMALS: Final = 6
_FARTHEST: Final = 50.0  # log-likelihoods farther apart than this have weights that differ by more than any decimals


class Scored:
    """Something whose log-likelihood is the sum of its ``terms``."""

    terms: dict[str, float]

    @property
    def score(self) -> float:
        """Log-likelihood, rounded so that an order by it does not depend on the last bits."""
        return round(sum(self.terms.values()), _DECIMALS)


def first_of_groups(ordered: Iterable[Found], group_of: Callable[[Found], Hashable]) -> list[Found]:
    """The first of each group, in their order.

    >>> first_of_groups([1, 3, 2, 4], lambda number: number % 2)  # odd, even
    [1, 2]
    """
    first: dict[Hashable, Found] = {}
    for each in ordered:
        first.setdefault(group_of(each), each)
    return list(first.values())


def leaders_first(ordered: Sequence[Found], group_of: Callable[[Found], Hashable]) -> list[Found]:
    """The first of each group and then the others, both in their order: members of a group differ in detail only.

    >>> leaders_first([1, 3, 2, 4], lambda number: number % 2)  # odd, even
    [1, 2, 3, 4]
    """
    leaders = first_of_groups(ordered, group_of)
    leading = {id(each) for each in leaders}
    return [*leaders, *(each for each in ordered if id(each) not in leading)]


def ambiguity(best: float, scores: Iterable[float]) -> float:
    """Posterior share of all but the best, from 0 to 1, by log-likelihoods; the best's own is among the scores.

    >>> ambiguity(-3.0, [-3.0]), ambiguity(-3.0, [-3.0, -3.0])
    (0.0, 0.5)
    """
    total = sum(math.exp(min(max(score - best, -_FARTHEST), _FARTHEST)) for score in scores)
    return round(1.0 - 1.0 / max(total, 1.0), _DECIMALS)
