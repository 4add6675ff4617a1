"""Numbers in messages: counted things, shares."""

from __future__ import annotations


def percent(share: float | None) -> str:
    """Return a share (0 to 1) as a percentage; empty for None.

    >>> percent(0.125), percent(None)
    ('12.5 %', '')
    """
    return "" if share is None else f"{100 * share:.1f} %"


def printable(text: str) -> str:
    r"""Return a text without characters that move a terminal's cursor or tell it what to do; line ends and tabs stay.

    >>> printable("no\x1b[2J plan\n")
    'no\ufffd[2J plan\n'
    """
    return text if text.isprintable() else "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)


def count_of(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, in the singular for one.

    Args: plural: Of the noun; where empty, the noun with an s.

    >>> count_of(1, "crash", "crashes")
    '1 crash'
    >>> count_of(0, "vehicle")
    '0 vehicles'
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def last_line(error: str) -> str:
    """Return the last line of an error, which after a traceback is the message.

    >>> last_line("Traceback (most recent call last):\\n  ...\\nValueError: no road\\n")
    'ValueError: no road'
    """
    return error.strip().splitlines()[-1]


def beside_limit(value: float, limit: float, digits: int = 1) -> str:
    """Return a measured number with enough digits to show its side of a limit.

    >>> beside_limit(2.04, 2.0), beside_limit(1.98, 2.0, 0), beside_limit(6.3, 5.0)
    ('2.04', '2', '6.3')
    >>> beside_limit(5.0, 5.0), beside_limit(7.0004, 7.0)
    ('5.0', '7.0004')
    """
    for more in range(digits, 10):
        shown = f"{value:.{more}f}"
        if (float(shown) > limit) == (value > limit) and (float(shown) < limit) <= (value < limit):
            return shown
    return f"{value:g}"
