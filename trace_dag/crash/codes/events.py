"""Codes of the sequence of events: what happened (``SOE``, ``HARM_EV``), where on the body (``AOI``, ``IMPACT1``)."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import table

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
LOOSE_OBJECTS: Final = frozenset({16, 18, 73, 91})
"""Objects that were thrown, fell, or lay on the road."""

RAN_OFF_RIGHT: Final = 63
RAN_OFF_LEFT: Final = 64
CROSSED_MEDIAN: Final = 65
RAN_OFF_AT_END: Final = 71
RAN_OFF: Final = 79
DEPARTURES: Final = frozenset({RAN_OFF_RIGHT, RAN_OFF_LEFT, CROSSED_MEDIAN, 68, 69, RAN_OFF_AT_END, RAN_OFF})
"""Events in which a vehicle left its side of the road, its roadway, or came back onto it."""

_HARMFUL = {
    1: "overturned",
    2: "caught fire or exploded",
    3: "went into water",
    4: "gas inhalation",
    5: "someone fell or jumped from the vehicle",
    6: "someone was hurt inside the vehicle without a collision",
    7: "another non-collision event",
    8: "struck a pedestrian",
    9: "struck a cyclist",
    10: "struck a railway vehicle",
    11: "struck a live animal",
    12: "collided with a motor vehicle in transport",
    14: "struck a parked motor vehicle",
    15: "struck a person on a personal conveyance",
    16: "was hit by a thrown or falling object",
    17: "struck a boulder",
    18: "struck an object that was not fixed",
    19: "struck a building",
    20: "struck a crash cushion",
    21: "struck a bridge pier",
    23: "struck a bridge rail",
    24: "struck a guardrail",
    25: "struck a concrete barrier",
    26: "struck a traffic barrier",
    30: "struck a utility pole or light support",
    31: "struck a post or pole",
    32: "struck a culvert",
    33: "struck a curb",
    34: "struck a ditch",
    35: "struck an embankment",
    38: "struck a fence",
    39: "struck a wall",
    40: "struck a fire hydrant",
    41: "struck shrubbery",
    42: "struck a tree",
    43: "struck a fixed object",
    44: "struck a pavement irregularity",
    45: "struck a working motor vehicle",
    46: "struck a traffic signal support",
    48: "struck a snow bank",
    49: "struck a ridden animal or an animal-drawn conveyance",
    50: "struck an overhead bridge structure",
    51: "jackknifed with harm to itself",
    52: "struck the end of a guardrail",
    53: "struck a mailbox",
    54: "was involved with cargo, persons or objects set in motion by another motor vehicle in transport",
    55: "collided with a motor vehicle moving outside the trafficway",
    57: "struck a cable barrier",
    58: "struck the ground",
    59: "struck a traffic sign support",
    72: "lost or shifted its cargo with harm to itself",
    73: "struck an object that had fallen from a motor vehicle in transport",
    74: "struck a road vehicle on rails",
    91: "struck an unknown object that was not fixed",
    93: "struck an unknown fixed object",
}
_NON_HARMFUL = {
    60: "lost or shifted its cargo",
    61: "had an equipment failure",
    62: "separated from its trailing unit",
    63: "ran off the road to the right",
    64: "ran off the road to the left",
    65: "crossed the median",
    66: "ran away downhill",
    67: "went airborne",
    68: "crossed the centreline",
    69: "came back onto the road",
    70: "swayed or jackknifed without harm",
    71: "left the road at its end",
    79: "ran off the road",
}
_SINCE = {74: 2016, 91: 2017, 93: 2017, 98: 2019}

HARM_EV = table("HARM_EV", "First harmful event", _HARMFUL, unknown=(98, 99), since=_SINCE)
UNKNOWN_EVENT: Final = 99
SOE = table("SOE", "Event of the sequence", _HARMFUL | _NON_HARMFUL, unknown=(98, 99), since=_SINCE)

_AREAS = {
    0: "no collision",
    **{hour: f"{hour} o'clock" for hour in range(1, 13)},
    3: "3 o'clock (right)",
    6: "6 o'clock (rear)",
    9: "9 o'clock (left)",
    12: "12 o'clock (front)",
    13: "the top",
    14: "the undercarriage",
    18: "cargo or vehicle parts set in motion",
    19: "objects or persons set in motion",
    20: "something set in motion",
    61: "the left side",
    62: "the front part of the left side",
    63: "the rear part of the left side",
    81: "the right side",
    82: "the front part of the right side",
    83: "the rear part of the right side",
}
SET_IN_MOTION: Final = frozenset({18, 19, 20})
"""Not the vehicle itself touched: what it had set in motion did."""
NOT_HARMFUL: Final = 55
IMPACT1 = table("IMPACT1", "Area of initial impact", _AREAS, unknown=(55, 77, 98, 99), since={20: 2017})
AOI = table(
    "AOI",
    "Area of impact of an event",
    {**_AREAS, NOT_HARMFUL: "not harmful", 77: "not a motor vehicle"},
    unknown=(98, 99),
    since={20: 2017},
)
DAMAGE = table(
    "DAMAGE",
    "Damaged area",
    {**{hour: f"{hour} o'clock" for hour in range(1, 13)}, 13: "the top", 14: "the undercarriage", 15: "no damage"},
    unknown=(99,),
)

NO_SECOND_VEHICLE: Final = frozenset({5555, 9999})
"""``VNUMBER2`` of events that are not harmful, or whose second party is not a motor vehicle."""
