"""Codes of each vehicle: its road as the driver saw it, and its movement before the crash."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import code_table

UNITTYPE = code_table("UNITTYPE")
IN_TRANSPORT: Final = 1

SPEEDREL = code_table("SPEEDREL")
DR_DRINK = code_table("DR_DRINK")
VTRAFWAY = code_table("VTRAFWAY")
NON_TRAFFICWAY: Final = 0

VNUM_LAN = code_table("VNUM_LAN")
VALIGN = code_table("VALIGN")
CURVED: Final = frozenset({2, 3, 4})

VPROFILE = code_table("VPROFILE")
VSURCOND = code_table("VSURCOND")
VTRAFCON = code_table("VTRAFCON")
SIGNALS: Final = frozenset({1, 2, 3})
"""``VTRAFCON`` of signals that go from colour to colour."""
FLASHING: Final = 4
CHARGES_OF_CONTROL: Final = frozenset({*range(31, 36), *range(37, 40)})
"""``VIOLATION``: red lights, turns on red, flashing signals, signs and controls in general; not railway crossings."""
FACTOR_OF_CONTROL: Final = 39
"""``DRIVERRF``, until 2019 ``DR_SF1`` to ``DR_SF4``: failure to obey signs, control devices or officers."""
UNKNOWN_FACTORS: Final = frozenset({None, 98, 99})

HIT_RUN = code_table("HIT_RUN")
ROLLOVER = code_table("ROLLOVER")
NO_ROLLOVER: Final = frozenset({0, 8})

TOW_VEH = code_table("TOW_VEH")
TRAILERS_OF_TOW_VEH: Final = {0: 0, 1: 1, 2: 2, 3: 3, 4: 1, 5: 1, 6: 1}
TOWED_VEHICLES: Final = frozenset({5, 6})

J_KNIFE = code_table("J_KNIFE")
P_CRASH1 = code_table("P_CRASH1")
P_CRASH2 = code_table("P_CRASH2")
P_CRASH3 = code_table("P_CRASH3")
PCRASH4 = code_table("PCRASH4")
PCRASH4_OF_LABEL: Final = (
    ("no driver", 0),
    ("longitudinally", 2),
    ("counterclockwise", 4),
    ("clockwise", 3),
    ("rotation direction unknown", 5),
    ("loss-of-control", 7),
    ("stability unknown", 9),
    ("tracking", 1),
)
"""CrashAPI serves the label of ``PCRASH4`` without the code: the first of these words in it names the code."""

PCRASH5 = code_table("PCRASH5")
MANEUVER = code_table("MANEUVER")
ACC_TYPE = code_table("ACC_TYPE")
