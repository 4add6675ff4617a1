"""Operational design domain of a crash: the terms of ISO 34503 and the tags of OpenLABEL for a report's values.

Terms are those of ISO 34503:2023, clauses 9 (scenery) and 10 (environmental conditions); tags are classes of OpenLABEL
1.0.0's ontology of scenario tags. Both follow BSI PAS 1883:2020. Some terms have no class there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from trace_dag.common.data_files import read_csv


class OddTerm(NamedTuple):
    """A term, and the tags that say the same."""

    term: str
    tags: tuple[str, ...] = ()


def _read_terms() -> dict[str, dict[int | str, OddTerm]]:
    """Return the terms in ``odd.csv`` by element and code."""
    terms: dict[str, dict[int | str, OddTerm]] = {}
    for row in read_csv("trace_dag.crash.codes", "odd.csv"):
        code = int(row["code"]) if row["code"].isdecimal() else row["code"]
        terms.setdefault(row["element"], {})[code] = OddTerm(row["term"], tuple(row["tags"].split()))
    return terms


ODD: Final[Mapping[str, Mapping[int | str, OddTerm]]] = _read_terms()
"""Terms by element and code; of ``TYP_INT`` by the coverage class, which is also implied by other elements."""


def odd_terms(said: Iterable[tuple[str, int | str | None]]) -> Iterator[OddTerm]:
    """Yield the terms of elements with their codes.

    >>> [each.term for each in odd_terms([("LGT_COND", 2), ("WEATHER", 1), ("VSURCOND", None)])]
    ['illumination: night']
    """
    for element, code in said:
        if code is not None and (term := ODD[element].get(code)):
            yield term
