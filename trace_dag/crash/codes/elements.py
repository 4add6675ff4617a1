"""FARS elements by name, with the codes used in rules: of the crash, persons, vehicles and the sequence of events."""

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
FUNC_SYS_OF_ROAD_FNC: Final = {
    1: 1, 2: 3, 3: 4, 4: 5, 5: 6, 6: 7, 11: 1, 12: 2, 13: 3, 14: 4, 15: 5, 16: 7,
}  # fmt: skip
"""``FUNC_SYS`` of the older ``ROAD_FNC``; an urban collector (15) is a major collector since 2015."""

STATES: Final = code_table("STATE").meanings
"""``STATE`` codes (GSA geographic locator codes)."""


# --- persons ---------------------------------------------------------------------------------------------------------
PER_TYP = code_table("PER_TYP")
VEHICLE_OCCUPANTS: Final = frozenset({1, 2, 3, 9})
"""``PER_TYP`` of persons in motor vehicles; every other person is a non-motorist."""

HIGHEST_AGE: Final = 120
"""``AGE``, ``PBAGE``: years."""
AGE_UNKNOWN: Final = frozenset({998, 999})
"""Not reported, and unknown."""

LOCATION = code_table("LOCATION")
NMACTION = code_table("NMACTION")

# --- typing of the crash (PBTYPE) ------------------------------------------------------------------------------------
PBCWALK = code_table("PBCWALK")
PEDPOS = code_table("PEDPOS")
BIKEPOS = code_table("BIKEPOS")
PEDDIR = code_table("PEDDIR")
MOTDIR = code_table("MOTDIR")

PEDSNR: Final = frozenset(f"{number}{letter}" for number in range(1, 13) for letter in "abcd")
"""``PEDSNR``: 1 to 12 by the motorist's manoeuvre (straight, right, left), side and crosswalk; a left, b right of the
motorist (on the far side of a turn: the motorist's own direction, the opposite one), c unknown, d other."""
PEDSNR_UNKNOWN: Final = frozenset({"7", "8", "99"})


# --- vehicles --------------------------------------------------------------------------------------------------------
IN_TRANSPORT: Final = 1

SPEEDREL = code_table("SPEEDREL")
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
ACC_TYPE = code_table("ACC_TYPE")


# --- events: what happened (SOE, HARM_EV), where on the body (AOI, IMPACT1) ------------------------------------------
OVERTURN: Final = 1
PEDESTRIAN: Final = 8
CYCLIST: Final = 9
MOTOR_VEHICLE_IN_TRANSPORT: Final = 12
PARKED_MOTOR_VEHICLE: Final = 14
PERSON_ON_CONVEYANCE: Final = 15
WORKING_MOTOR_VEHICLE: Final = 45
SET_IN_MOTION_BY_VEHICLE: Final = 54
VEHICLE_OUTSIDE_TRAFFICWAY: Final = 55
VEHICLE_CONTACTS: Final = frozenset(
    {MOTOR_VEHICLE_IN_TRANSPORT, PARKED_MOTOR_VEHICLE, WORKING_MOTOR_VEHICLE, VEHICLE_OUTSIDE_TRAFFICWAY}
)
"""Events in which two motor vehicles touch."""
VEHICLE_EVENTS: Final = VEHICLE_CONTACTS | {SET_IN_MOTION_BY_VEHICLE}
"""Events in which another motor vehicle takes part: by touching, or by what it set in motion."""
STRUCK_STANDING: Final = frozenset({PARKED_MOTOR_VEHICLE, WORKING_MOTOR_VEHICLE})
"""Contacts of a vehicle in transport with one that is not; such a vehicle has no other events (all 1,410 of 2016)."""
PERSON_EVENTS: Final = frozenset({PEDESTRIAN, CYCLIST, PERSON_ON_CONVEYANCE})
"""Events in which a vehicle strikes a person."""
LIVE_ANIMAL: Final = 11
RIDDEN_ANIMAL: Final = 49
"""One that is ridden, or the conveyance it draws."""
ANIMALS: Final = frozenset({LIVE_ANIMAL, RIDDEN_ANIMAL})
TRAINS: Final = frozenset({10, 74})
FIXED_OBJECTS: Final = frozenset(
    {17, 19, 20, 21, 23, 24, 25, 26, *range(30, 36), *range(38, 45), 46, 48, 50, 52, 53, 57, 58, 59, 93}
)
LYING_OBJECTS: Final = frozenset({18, 91})
"""Objects that were not fixed, and of which nothing says that they moved."""
LOOSE_OBJECTS: Final = LYING_OBJECTS | {16, 73}
"""Objects that were thrown, fell, or lay on the road."""

RAN_OFF_RIGHT: Final = 63
RAN_OFF_LEFT: Final = 64
CROSSED_MEDIAN: Final = 65
AIRBORNE: Final = 67
CROSSED_CENTRELINE: Final = 68
CAME_BACK: Final = 69
RAN_OFF_AT_END: Final = 71
RAN_OFF: Final = 79
DEPARTURES: Final = frozenset(
    {RAN_OFF_RIGHT, RAN_OFF_LEFT, CROSSED_MEDIAN, CROSSED_CENTRELINE, CAME_BACK, RAN_OFF_AT_END, RAN_OFF}
)
"""Events in which a vehicle left its side of the road, its roadway, or came back onto it."""
HARM_EV = code_table("HARM_EV")
UNKNOWN_EVENT: Final = 99
SOE = code_table("SOE")

SET_IN_MOTION: Final = frozenset({18, 19, 20})
"""Not the vehicle itself touched: what it had set in motion did."""
NOT_HARMFUL: Final = 55
IMPACT1 = code_table("IMPACT1")

NO_SECOND_VEHICLE: Final = frozenset({5555, 9999})
"""``VNUMBER2`` of events that are not harmful, or whose second party is not a motor vehicle."""
