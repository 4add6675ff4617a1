"""Words of messages that depend on a number."""

from __future__ import annotations


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
