"""Codes of the crash as a whole: place, time, light, weather, junction."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import code_table

MAN_COLL = code_table("MAN_COLL")
TYP_INT = code_table("TYP_INT")
RELJCT2 = code_table("RELJCT2")
AWAY_FROM_JUNCTION: Final = 1
NON_JUNCTION: Final = frozenset({1, 4, 8, 16, 17, 18})
"""``RELJCT2`` values at which the roadway itself has no intersection."""
IN_INTERSECTION: Final = 2
INTERSECTION_RELATED: Final = 3  # on an approach or an exit
AT_INTERSECTION: Final = frozenset({IN_INTERSECTION, INTERSECTION_RELATED})

REL_ROAD = code_table("REL_ROAD")
LGT_COND = code_table("LGT_COND")
WEATHER = code_table("WEATHER")
ROUTE = code_table("ROUTE")
RUR_URB = code_table("RUR_URB")
FUNC_SYS = code_table("FUNC_SYS")
ROAD_FNC = code_table("ROAD_FNC")
FUNC_SYS_OF_ROAD_FNC: Final = {
    1: 1, 2: 3, 3: 4, 4: 5, 5: 6, 6: 7, 11: 1, 12: 2, 13: 3, 14: 4, 15: 5, 16: 7,
}  # fmt: skip
"""``FUNC_SYS`` of the older ``ROAD_FNC``; an urban collector (15) is a major collector since 2015."""

STATES: Final = code_table("STATE").meanings
"""``STATE`` codes (GSA geographic locator codes)."""

PER_TYP = code_table("PER_TYP")
INJ_SEV = code_table("INJ_SEV")
VEHICLE_OCCUPANTS: Final = frozenset({1, 2, 3, 9})
"""``PER_TYP`` of persons in motor vehicles; every other person is a non-motorist."""
