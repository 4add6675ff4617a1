"""Numbers in messages: counted things, shares."""

from __future__ import annotations


def percent(share: float | None) -> str:
    """A share of 1 as a percentage; empty where there is none.

    >>> percent(0.125), percent(None)
    ('12.5 %', '')
    """
    return "" if share is None else f"{100 * share:.1f} %"


def counted(number: int, noun: str, plural: str = "") -> str:
    """How many of something, the noun in the singular where it is one.

    Args:
        plural: Of the noun; where empty, the noun with an s.

    >>> counted(1, "crash", "crashes")
    '1 crash'
    >>> counted(0, "vehicle")
    '0 vehicles'
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
