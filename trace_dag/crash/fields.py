"""Typed values out of the rows of a report; every problem is reported with row, name, value and year."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, TypeAlias

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.codes.table import code_table

Row: TypeAlias = dict[str, str]
"""The values of a row that are not blank, by name in capitals."""

MAX_TEXT: Final = 2_000
"""Characters of one value; the longest in use, names of trafficways, have 30 (FARS manual, C9)."""
MAX_MEMBERS: Final = 2_000
"""Rows of one table; the largest crash of FARS involved about a hundred vehicles, with some events each."""

_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,12}(?:\.0*)?")
_NUMBER: Final = re.compile(r"[0-9]{1,9}(?:\.0*)?")
_DECIMAL: Final = re.compile(r"[+-]?[0-9]{1,6}(?:\.[0-9]{0,20})?")
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_UNKNOWN_WORDS: Final = frozenset(
    {"unknown", "not reported", "reported as unknown", "not applicable", "none", "null", "nan", "n/a", "."}
)
"""Words found where a code belongs, in files of every origin; they all say that nothing is known."""


def malformed(detail: str) -> Rejection:
    """Return the rejection of a report that cannot be read.

    >>> str(malformed("CrashSet is missing").reason)
    'malformed_report'
    """
    return Rejection(Reason.MALFORMED_REPORT, detail)


class Fields:
    """The values of one row, by name; ``where`` names the row in messages.

    Values are text in the source. Every reader takes the names that a value has had over the years and uses the first
    one found. ``tables`` has all tables of the report.
    """

    def __init__(self, row: Row, where: str, year: int = 0, tables: Mapping[str, Sequence[Row]] | None = None) -> None:
        self.where = where
        self.year = year
        self._tables = tables or {}
        for name, text in row.items():
            if len(text) > MAX_TEXT:
                raise malformed(f"{where}: {name} has {len(text)} characters; expected {MAX_TEXT} at most")
        self._text = {
            name: text if text.isalnum() else " ".join(_CONTROL.sub("", text).split()) for name, text in row.items()
        }

    def names(self) -> set[str]:
        """Return the names of all values that are not blank, in capitals."""
        return {name for name, value in self._text.items() if value}

    def text(self, *names: str) -> str:
        """Return the first of the named values that is not blank, or ""."""
        return next((self._text[name] for name in names if self._text.get(name)), "")

    def integer(self, *names: str, low: int | None = None, high: int | None = None) -> int | None:
        """Return a whole number, None if blank or unknown; outside ``low`` to ``high`` the report is malformed."""
        value = self._value(*names)
        if value is None:
            return None
        if not _INTEGER.fullmatch(value):
            raise malformed(f"{self.where}: {names[0]} holds {value!r}; expected a whole number")
        number = int(value.split(".")[0])
        if (low is not None and number < low) or (high is not None and number > high):
            raise malformed(f"{self.where}: {names[0]} holds {number}; expected {low} to {high}")
        return number

    def decimal(self, *names: str) -> float | None:
        """Return a decimal number, None if blank or unknown."""
        value = self._value(*names)
        if value is None:
            return None
        if not _DECIMAL.fullmatch(value):
            raise malformed(f"{self.where}: {names[0]} holds {value!r}; expected a decimal number")
        return float(value)

    def within(self, low: int, high: int, *names: str) -> int | None:
        """Return a whole number, None if blank, unknown or out of range, as codes for "unknown" are."""
        number = self.integer(*names)
        return number if number is not None and low <= number <= high else None

    def code(self, element: str, *names: str) -> int | None:
        """Return a code of an element in this report's year, None if blank or a word for unknown.

        ``names`` are those of the values, if not the element's. Raises :class:`UnknownCodeError` for a code that the
        element does not have.
        """
        number = self.integer(*(names or (element,)))
        return None if number is None else code_table(element).check(number, self.year)

    def known_code(self, element: str, *names: str) -> int | None:
        """Return :meth:`code`, but None for the codes that mean "unknown"."""
        return code_table(element).known(self.code(element, *names))

    def rows(self, table: str, what: str = "") -> Iterator[Fields]:
        """Yield the rows of a table of the report; ``what`` names them in messages."""
        rows = self._tables.get(table, ())
        if len(rows) > MAX_MEMBERS:
            raise malformed(f"{self.where}: {table} has {len(rows)} rows; expected {MAX_MEMBERS} at most")
        where = f"{self.where}: {what}" if what else self.where
        return (Fields(row, where, self.year, self._tables) for row in rows)

    def own_rows(self, table: str, what: str = "") -> Iterator[Fields]:
        """Yield the rows of a table that are about the vehicle of this row (``VEH_NO``)."""
        number = whole_number(self._text, "VEH_NO")
        if number is not None:
            yield from (row for row in self.rows(table, what) if whole_number(row._text, "VEH_NO") == number)

    def _value(self, *names: str) -> str | None:
        value = self.text(*names)
        return None if not value or value.replace("_", " ").lower() in _UNKNOWN_WORDS else value


def known_codes(rows: Iterable[Fields], element: str, *names: str) -> tuple[int, ...]:
    """Return the known codes that rows have of an element, in ascending order, each once.

    >>> known_codes([Fields({"WEATHER": code}, "a report", 2023) for code in ("3", "2", "99", "2")], "WEATHER")
    (2, 3)
    """
    found = {row.known_code(element, *names) for row in rows}
    return tuple(sorted(code for code in found if code is not None))


def whole_number(row: Row, name: str) -> int | None:
    """Return a column's whole number (``7``, or pandas' ``7.0``), or None.

    >>> whole_number({"VEH_NO": "2.0"}, "VEH_NO")
    2
    """
    value = row.get(name, "")
    return int(value.split(".")[0]) if _NUMBER.fullmatch(value) else None
