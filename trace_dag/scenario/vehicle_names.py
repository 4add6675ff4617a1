"""Makes and models as plain names, from the labels of FARS.

A label has notes for coders: model years of the code, codes of other years, and asterisks for footnotes. Records and
tables keep labels as they are; texts for people have names.
"""

from __future__ import annotations

import re
from typing import Final

_NOTE: Final = re.compile(r"\([^()]*\)")
_NEITHER_KNOWN: Final = "Unknown Make"
_FOOTNOTE: Final = re.compile(r"\*+:?")


def vehicle_name(label: str) -> str:
    """Return the name in a label of make and model (``MAK_MODNAME``), without notes and marks of footnotes.

    Empty if the label says that neither is known.

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
