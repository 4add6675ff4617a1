"""Values of OpenDRIVE elements: attributes as texts and numbers, and ``<userData>``, with errors that name the place.

Belongs here: reading single values. Does not belong here: the meaning of elements (:mod:`trace_dag.roads.map.reader`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lxml import etree

from trace_dag.common.errors import UserError

Notes = dict[str, list[str]]
"""Values of ``<userData>`` by code."""


@dataclass(frozen=True)
class ValueReader:
    """Reads values of elements; ``name`` is the file's name for messages."""

    name: str

    def fail(self, element: etree._Element, problem: str) -> UserError:
        """Return the error to raise for an element.

        It names the file, the line, and the element's road or junction.
        """
        owner = next((e for e in (element, *element.iterancestors()) if e.get("id") is not None), element)
        place = f"<{owner.tag} id={owner.get('id')!r}>, line {element.sourceline}"
        return UserError(f"{self.name}: {problem} ({place}); mend the file or convert the map again")

    def text(self, element: etree._Element, key: str) -> str:
        """Return a required attribute.

        Raises :class:`UserError` if it is missing.
        """
        value = element.get(key)
        if value is None:
            raise self.fail(element, f"<{element.tag}> without {key!r}")
        return value

    def number(self, element: etree._Element, key: str, default: float | None = None) -> float:
        """Return an attribute as a finite number; ``default``, if given, replaces a missing one.

        Raises :class:`UserError`.
        """
        value = element.get(key)
        if value is None:
            if default is not None:
                return default
            value = self.text(element, key)
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self.fail(element, f"<{element.tag} {key}={value!r}>: expected a finite number")
        return number

    def integer(self, element: etree._Element, key: str) -> int:
        """Return an attribute as an integer.

        Raises :class:`UserError`.
        """
        value = self.text(element, key)
        try:
            return int(value)
        except ValueError:
            raise self.fail(element, f"<{element.tag} {key}={value!r}>: expected an integer") from None

    def note_integers(self, element: etree._Element, notes: Notes, code: str) -> tuple[int, ...]:
        """Return the integers of a note; empty if it is absent.

        Raises :class:`UserError`.
        """
        text = first_note(notes, code)
        try:
            return tuple(int(part) for part in text.split())
        except ValueError:
            raise self.fail(element, f"userData {code} {text!r}: expected integers") from None


def notes_of(element: etree._Element) -> Notes:
    """Return values of an element's ``<userData>`` by code, in order.

    >>> notes_of(etree.fromstring('<road><userData code="osmWays" value="12 13"/></road>'))
    {'osmWays': ['12 13']}
    """
    notes: Notes = {}
    for child in element.iterchildren("userData"):
        notes.setdefault(child.get("code", ""), []).append(child.get("value", ""))
    return notes


def first_note(notes: Notes, code: str) -> str:
    """Return the first value of a code, or "".

    >>> first_note({"osmWays": ["12 13"]}, "osmWays")
    '12 13'
    """
    return notes[code][0] if code in notes else ""
