"""Typed values out of the elements of a report; every problem is reported with element, value and year."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from lxml import etree

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.codes.table import CodeTable

MAX_TEXT: Final = 2_000
"""Characters of one value; the longest in use, names of trafficways, have 30 (FARS manual, C9)."""
MAX_MEMBERS: Final = 2_000
"""Entries of one list; the largest crash of FARS involved about a hundred vehicles, with some events each."""

_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,12}(?:\.0*)?")
_DECIMAL: Final = re.compile(r"[+-]?[0-9]{1,6}(?:\.[0-9]{0,20})?")
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
    """The scalar children of one element, by name in any case; ``where`` names the element in messages.

    Values are text in the source. Every reader takes the names an element has had over the years, first found first.
    """

    def __init__(self, element: etree._Element, where: str, year: int = 0) -> None:
        self.where = where
        self.year = year
        self._text: dict[str, str] = {}
        self._lists: list[tuple[str, etree._Element]] = []
        for child in element:
            if isinstance(child.tag, str) and len(child) > 0:
                self._lists.append((local_name(child).upper(), child))
            elif isinstance(child.tag, str):
                text = child.text or ""
                if len(text) > MAX_TEXT:
                    raise malformed(
                        f"{where}: {local_name(child)} has {len(text)} characters; expected {MAX_TEXT} at most"
                    )
                self._text.setdefault(local_name(child).upper(), " ".join(text.split()))

    def names(self) -> set[str]:
        """Return the names of all values that are not blank, in capitals."""
        return {name for name, value in self._text.items() if value}

    def text(self, *names: str) -> str:
        """Return the first of the named values that is not blank, else ""."""
        return next((self._text[name] for name in names if self._text.get(name)), "")

    def integer(self, *names: str, low: int | None = None, high: int | None = None) -> int | None:
        """Return a whole number, None if blank or said to be unknown; outside ``low`` to ``high`` it is malformed."""
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
        """Return a decimal number, None if blank or said to be unknown."""
        value = self._value(*names)
        if value is None:
            return None
        if not _DECIMAL.fullmatch(value):
            raise malformed(f"{self.where}: {names[0]} holds {value!r}; expected a decimal number")
        return float(value)

    def code(self, table: CodeTable, *names: str) -> int | None:
        """Return a code of ``table`` in this report's year, None if blank or a word for unknown.

        Raises :class:`UnknownCodeError` for one the table does not hold.
        """
        number = self.integer(*(names or (table.element,)))
        return None if number is None else table.check(number, self.year)

    def known_code(self, table: CodeTable, *names: str) -> int | None:
        """Return :meth:`code`, with None also for the codes that mean "unknown"."""
        return table.known(self.code(table, *names))

    def members(self, *lists: str) -> Iterator[etree._Element]:
        """Yield the elements of a list below this one (``Vehicles``, ``Vsoes``), whatever their own name."""
        wanted = {name.upper() for name in lists}
        for name, child in self._lists:
            if name in wanted:
                if len(child) > MAX_MEMBERS:
                    raise malformed(
                        f"{self.where}: {local_name(child)} has {len(child)} entries; expected {MAX_MEMBERS} at most"
                    )
                yield from (member for member in child if isinstance(member.tag, str))

    def _value(self, *names: str) -> str | None:
        value = self.text(*names)
        return None if not value or value.replace("_", " ").lower() in _UNKNOWN_WORDS else value


def local_name(element: etree._Element) -> str:
    """Return the element's name without its namespace, which lxml writes before it in braces.

    >>> local_name(etree.fromstring('<Count xmlns="http://example.org">1</Count>'))
    'Count'
    """
    return element.tag.rpartition("}")[2]
