"""Makes and models as a person would say them, of the labels of FARS.

A label tells coders more than a name: which model years a code holds for, which code has the others, and in asterisks
that a footnote follows. Records and tables keep labels as they are; what is shown to people has names.
"""

from __future__ import annotations

import re
from typing import Final

_NOTE: Final = re.compile(r"\([^()]*\)")
_NEITHER_KNOWN: Final = "Unknown Make"
_FOOTNOTE: Final = re.compile(r"\*+:?")


def vehicle_name(label: str) -> str:
    """Return the name in a label of make and model (``MAK_MODNAME``).

    Without notes in parentheses and marks of footnotes.

    Empty where the label says that neither is known.

    >>> vehicle_name("Mercury Marquis/Monterey (car version; for van version 2004 on see code 444) /Grand Marquis")
    'Mercury Marquis/Monterey/Grand Marquis'
    >>> vehicle_name("Subaru Outback (2003 on)(see 034 for prior to 2003)")
    'Subaru Outback'
    >>> vehicle_name("Unknown Make Unknown (as to automobile, motored cycle, light truck or truck)")
    ''
    """
    if label.startswith(_NEITHER_KNOWN):
        return ""
    name = _FOOTNOTE.sub(" ", _NOTE.sub(" ", label))
    return re.sub(r"\s*/\s*", "/", " ".join(name.split()))
