"""Tables of FARS codes: the codes that an element may hold in a year, and their plain meanings.

``codes.csv`` has them all: a row for each code of an element (``variable``), with a phrase of ours, its first and last
case year if it was added or dropped (``since``, ``until``), and whether it means "not reported" or "unknown".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache

from trace_dag.common.data_files import read_csv

FIRST_YEAR = 2010
"""The first case year the tables speak of; FARS was restructured with it."""

LAST_YEAR = 2023
"""The last case year the tables were checked against. Later years are read with the codes of this one."""


class UnknownCodeError(ValueError):
    """A code that its element's table does not have in that year."""

    def __init__(self, element: str, value: str, year: int, expected: str) -> None:
        super().__init__(f"{element} holds {value!r}, which is not a code of case year {year}; expected {expected}")
        self.element = element
        self.value = value
        self.year = year


@dataclass(frozen=True)
class CodeTable:
    """The codes of one FARS element.

    ``meanings`` are phrases of ours, not FARS's labels (which change from year to year). ``unknown`` lists the codes
    that say "not reported" or "unknown". ``years`` holds first and last case year of codes that come or go.
    """

    element: str
    meanings: Mapping[int, str]
    unknown: frozenset[int] = frozenset()
    years: Mapping[int, tuple[int, int]] = field(default_factory=dict)

    def holds(self, code: int, year: int) -> bool:
        """Return whether ``code`` is one of the element's in case year ``year``."""
        if code not in self.meanings:
            return False
        first, last = self.years.get(code, (FIRST_YEAR, LAST_YEAR))
        return first <= min(max(year, FIRST_YEAR), LAST_YEAR) <= last

    def check(self, code: int, year: int) -> int:
        """Return ``code``; raise :class:`UnknownCodeError` if the element has no such code in that year."""
        if not self.holds(code, year):
            expected = ranges(known for known in self.meanings if self.holds(known, year))
            raise UnknownCodeError(self.element, str(code), year, expected)
        return code

    def known(self, code: int | None) -> int | None:
        """Return ``code``, or None if it means "unknown"."""
        return None if code is None or code in self.unknown else code

    def meaning(self, code: int | None) -> str:
        """Return the code in plain words; "" for None and for codes that say "unknown"."""
        return "" if code is None or code in self.unknown else self.meanings.get(code, "")


@cache
def code_table(element: str) -> CodeTable:
    """Return the table of an element, from ``codes.csv``.

    >>> weather = code_table("WEATHER")  # FARS has no code 0 any more from 2020 on
    >>> weather.holds(0, 2019), weather.holds(0, 2020), weather.meaning(2), weather.meaning(99)
    (True, False, 'rain', '')
    """
    rows = _rows()[element]
    return CodeTable(
        element,
        {int(row["code"]): row["meaning"] or ("unknown" if row["unknown"] else "") for row in rows},
        frozenset(int(row["code"]) for row in rows if row["unknown"]),
        {
            int(row["code"]): (int(row["since"] or FIRST_YEAR), int(row["until"] or LAST_YEAR))
            for row in rows
            if row["since"] or row["until"]
        },
    )


def has_codes(element: str) -> bool:
    """Return whether an element has a table; counts and uninterpreted elements have none.

    >>> has_codes("WEATHER"), has_codes("DEATHS")
    (True, False)
    """
    return element in _rows()


@cache
def _rows() -> dict[str, list[dict[str, str]]]:
    rows: dict[str, list[dict[str, str]]] = {}
    for row in read_csv("trace_dag.crash.codes", "codes.csv"):
        rows.setdefault(row["variable"], []).append(row)
    return rows


def ranges(codes: Iterable[int]) -> str:
    """Return codes as "0-3, 5, 98-99".

    >>> ranges([98, 0, 1, 2, 3, 5, 99])
    '0-3, 5, 98-99'
    """
    parts: list[list[int]] = []
    for code in sorted(codes):
        if parts and parts[-1][-1] == code - 1:
            parts[-1].append(code)
        else:
            parts.append([code])
    return ", ".join(str(part[0]) if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts)
