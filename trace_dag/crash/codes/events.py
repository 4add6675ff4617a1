"""Codes of the sequence of events: what happened (``SOE``, ``HARM_EV``), where on the body (``AOI``, ``IMPACT1``)."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import code_table

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
AOI = code_table("AOI")
DAMAGE = code_table("DAMAGE")

NO_SECOND_VEHICLE: Final = frozenset({5555, 9999})
"""``VNUMBER2`` of events that are not harmful, or whose second party is not a motor vehicle."""
