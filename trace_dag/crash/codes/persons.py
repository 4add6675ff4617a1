"""Codes of persons outside motor vehicles: their type, place and actions, and the typing of their crash.

The typing (``PBTYPE``, since 2014) is that of the Pedestrian and Bicycle Crash Analysis Tool. Its elements for
pedestrians hold a code for "not a pedestrian" for cyclists, and the other way round. Such codes count as unknown here.
Sources: FARS Analytical User's Manual; FARS/CRSS Pedestrian Bicyclist Crash Typing Manual.
"""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import code_table

SEX = code_table("SEX")
HIGHEST_AGE: Final = 120
"""``AGE``, ``PBAGE``: years."""
AGE_UNKNOWN: Final = frozenset({998, 999})
"""Not reported, and unknown."""

LOCATION = code_table("LOCATION")
NMACTION = code_table("NMACTION")
NMCC = code_table("NMCC")
MSAFEQMT = code_table("MSAFEQMT")


EQUIPMENT: Final = tuple(map(code_table, ("NMHELMET", "NMPROPAD", "NMOTHPRO", "NMREFCLO", "NMLIGHT", "NMOTHPRE")))
"""Safety equipment since 2019: an element for each kind."""

# --- typing of the crash (PBTYPE) ----------------------------------------------------------------------------------

PBCWALK = code_table("PBCWALK")
PBSWALK = code_table("PBSWALK")
PBSZONE = code_table("PBSZONE")
PEDLOC = code_table("PEDLOC")
BIKELOC = code_table("BIKELOC")
PEDPOS = code_table("PEDPOS")
BIKEPOS = code_table("BIKEPOS")
PEDDIR = code_table("PEDDIR")
MOTDIR = code_table("MOTDIR")
BIKEDIR = code_table("BIKEDIR")
MOTMAN = code_table("MOTMAN")
PEDLEG = code_table("PEDLEG")
PEDCGP = code_table("PEDCGP")
BIKECGP = code_table("BIKECGP")
# The types refine the groups above, which are what a summary says; here their codes are checked, and passed on.
PEDCTYPE = code_table("PEDCTYPE")
BIKECTYPE = code_table("BIKECTYPE")

PEDSNR: Final = frozenset(f"{number}{letter}" for number in range(1, 13) for letter in "abcd")
"""``PEDSNR``: 1 to 12 by the motorist's manoeuvre (straight, right, left), side and crosswalk; a left, b right of the
motorist (on the far side of a turn: the motorist's own direction, the opposite one), c unknown, d other."""
PEDSNR_UNKNOWN: Final = frozenset({"7", "8", "99"})
