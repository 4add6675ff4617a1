"""Codes of each vehicle: its road as the driver saw it, and what it did before the crash."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import table

UNITTYPE = table(
    "UNITTYPE",
    "Unit type",
    {
        1: "in transport",
        2: "not in transport, within the trafficway",
        3: "not in transport, outside the trafficway",
        4: "a working vehicle",
    },
)
IN_TRANSPORT: Final = 1

SPEEDREL = table(
    "SPEEDREL",
    "Speeding",
    {
        0: "not speeding",
        1: "speeding",
        2: "racing",
        3: "exceeding the speed limit",
        4: "too fast for the conditions",
        5: "speeding",
    },
    unknown=(8, 9),
    until={1: 2013},
)

DR_DRINK = table("DR_DRINK", "Drinking driver", {0: "no drinking driver", 1: "a drinking driver"}, unknown=(8, 9))

VTRAFWAY = table(
    "VTRAFWAY",
    "Trafficway",
    {
        0: "a driveway access or other non-trafficway",
        1: "a two-way undivided road",
        2: "a two-way road with an unprotected median",
        3: "a two-way road with a median barrier",
        4: "a one-way road",
        5: "a two-way undivided road with a centre turn lane",
        6: "an entrance or exit ramp",
        7: "a two-way divided road",
    },
    unknown=(8, 9),
    since={7: 2022},
)
NON_TRAFFICWAY: Final = 0

VNUM_LAN = table(
    "VNUM_LAN",
    "Lanes of the roadway (both directions where undivided)",
    {
        0: "a non-trafficway",
        1: "one lane",
        2: "two lanes",
        3: "three lanes",
        4: "four lanes",
        5: "five lanes",
        6: "six lanes",
        7: "seven or more lanes",
    },
    unknown=(8, 9),
)

VALIGN = table(
    "VALIGN",
    "Alignment",
    {0: "a non-trafficway", 1: "straight", 2: "curving right", 3: "curving left", 4: "curving"},
    unknown=(8, 9),
)
CURVED: Final = frozenset({2, 3, 4})

VPROFILE = table(
    "VPROFILE",
    "Profile",
    {
        0: "a non-trafficway",
        1: "level",
        2: "on a grade",
        3: "at a hillcrest",
        4: "in a sag",
        5: "going uphill",
        6: "going downhill",
    },
    unknown=(8, 9),
)

VSURCOND = table(
    "VSURCOND",
    "Surface condition",
    {
        0: "a non-trafficway",
        1: "dry",
        2: "wet",
        3: "snowy",
        4: "icy",
        5: "sandy",
        6: "covered by water",
        7: "oily",
        8: "in another condition",
        10: "slushy",
        11: "muddy, dirty or gravelly",
    },
    unknown=(98, 99),
)

VTRAFCON = table(
    "VTRAFCON",
    "Traffic control",
    {
        0: "no traffic control",
        1: "a traffic signal",
        2: "a traffic signal",
        3: "a traffic signal",
        4: "a flashing traffic signal",
        7: "a lane use signal",
        8: "a highway traffic signal",
        9: "a highway traffic signal",
        20: "a stop sign",
        21: "a yield sign",
        23: "a school zone sign",
        28: "a regulatory sign",
        29: "a regulatory sign",
        40: "a warning sign",
        50: "a person directing traffic",
        65: "a railway crossing device",
        98: "another traffic control",
    },
    unknown=(97, 99),
)

HIT_RUN = table(
    "HIT_RUN",
    "Hit and run",
    {0: "stayed at the scene", 1: "left the scene", **dict.fromkeys(range(2, 6), "left the scene")},
    unknown=(8, 9),
    until=dict.fromkeys(range(2, 6), 2011),
)

ROLLOVER = table(
    "ROLLOVER",
    "Rollover",
    {
        0: "no rollover",
        1: "rolled over, tripped",
        2: "rolled over, untripped",
        3: "rolled over",
        8: "not applicable",
        9: "rolled over",
    },
    since={3: 2022, 8: 2022},
    until={1: 2021, 2: 2022, 9: 2022},
)
NO_ROLLOVER: Final = frozenset({0, 8})

TOW_VEH = table(
    "TOW_VEH",
    "Trailing units",
    {
        0: "no trailer",
        1: "one trailer",
        2: "two trailers",
        3: "three or more trailers",
        4: "trailers",
        5: "a towed vehicle, fixed linkage",
        6: "a towed vehicle, other linkage",
    },
    unknown=(7, 8, 9),
)
TRAILERS_OF_TOW_VEH: Final = {0: 0, 1: 1, 2: 2, 3: 3, 4: 1, 5: 1, 6: 1}
TOWED_VEHICLES: Final = frozenset({5, 6})

J_KNIFE = table(
    "J_KNIFE",
    "Jackknife",
    {0: "not an articulated vehicle", 1: "no", 2: "yes, as the first event", 3: "yes, in a later event"},
    unknown=(8, 9),
)

P_CRASH1 = table(
    "P_CRASH1",
    "Movement before the critical event",
    {
        0: "had no driver",
        1: "was going straight",
        2: "was slowing down",
        3: "was accelerating",
        4: "was starting from a stop",
        5: "was stopped on the roadway",
        6: "was passing another vehicle",
        7: "was disabled or parked in a travel lane",
        8: "was leaving a parking position",
        9: "was entering a parking position",
        10: "was turning right",
        11: "was turning left",
        12: "was making a U-turn",
        13: "was backing up",
        14: "was following a curve",
        15: "was changing lanes",
        16: "was merging",
        17: "was completing an earlier avoidance manoeuvre",
        98: "was making another movement",
    },
    unknown=(99,),
)

P_CRASH2 = table(
    "P_CRASH2",
    "Critical event",
    {
        1: "it lost control through a flat tyre",
        2: "it lost control through a stalled engine",
        3: "it lost control through a disabling failure",
        4: "it lost control through a vehicle problem",
        5: "it lost control on a poor road",
        6: "it lost control through excessive speed",
        8: "it lost control for another reason",
        9: "it lost control",
        10: "it went over the lane line on its left",
        11: "it went over the lane line on its right",
        12: "it went off the left edge of the road",
        13: "it went off the right edge of the road",
        14: "it went off the end of the road",
        15: "it was turning left",
        16: "it was turning right",
        17: "it was passing through the junction",
        18: "it was slowing down",
        19: "its direction of travel is unknown",
        20: "it was backing",
        21: "it was making a U-turn",
        50: "the other vehicle was stopped in its lane",
        51: "the other vehicle was slower in the same lane and direction",
        52: "the other vehicle was slowing down in the same lane and direction",
        53: "the other vehicle was faster in the same lane and direction",
        54: "the other vehicle came the opposite way in its lane",
        55: "the other vehicle was in a crossover",
        56: "the other vehicle was backing in its lane",
        59: "the other vehicle was in its lane",
        60: "the other vehicle came from the adjacent lane over the left lane line",
        61: "the other vehicle came from the adjacent lane over the right lane line",
        62: "the other vehicle came the opposite way over the left lane line",
        63: "the other vehicle came the opposite way over the right lane line",
        64: "the other vehicle came from a parking lane, shoulder, median or roadside",
        65: "the other vehicle turned in from a crossing street, into the same direction",
        66: "the other vehicle came from a crossing street, across its path",
        67: "the other vehicle turned in from a crossing street, into the opposite direction",
        68: "the other vehicle came from a crossing street",
        70: "the other vehicle turned in from a driveway, into the same direction",
        71: "the other vehicle came from a driveway, across its path",
        72: "the other vehicle turned in from a driveway, into the opposite direction",
        73: "the other vehicle came from a driveway",
        74: "the other vehicle came from an entrance to a limited-access highway",
        78: "the other vehicle encroached into its lane",
        80: "a pedestrian was in the road",
        81: "a pedestrian was approaching the road",
        82: "a pedestrian was near",
        83: "a cyclist or other non-motorist was in the road",
        84: "a cyclist or other non-motorist was approaching the road",
        85: "a cyclist or other non-motorist was near",
        87: "an animal was in the road",
        88: "an animal was approaching the road",
        89: "an animal was near",
        90: "an object was in the road",
        91: "an object was approaching the road",
        92: "an object was near",
        98: "another event",
    },
    unknown=(99,),
    since={20: 2016, 21: 2016},
)

P_CRASH3 = table(
    "P_CRASH3",
    "Attempted avoidance",
    {
        0: "had no driver",
        1: "made no avoidance manoeuvre",
        2: "braked without lockup",
        3: "braked with lockup",
        4: "braked",
        5: "released the brakes",
        6: "steered left",
        7: "steered right",
        8: "braked and steered left",
        9: "braked and steered right",
        10: "accelerated",
        11: "accelerated and steered left",
        12: "accelerated and steered right",
        15: "braked and steered",
        16: "braked",
        98: "took another action",
    },
    unknown=(99,),
    since={15: 2016, 16: 2016},
    until={2: 2015, 3: 2015, 4: 2015},
)

PCRASH4 = table(
    "PCRASH4",
    "Stability before the impact",
    {
        0: "had no driver",
        1: "tracking",
        2: "skidding along its path",
        3: "skidding sideways, turning clockwise",
        4: "skidding sideways, turning counter-clockwise",
        5: "skidding sideways",
        7: "out of control in another way",
    },
    unknown=(9,),
)
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

PCRASH5 = table(
    "PCRASH5",
    "Location before the impact",
    {
        0: "had no driver",
        1: "stayed in its lane",
        2: "left its lane but stayed on the roadway",
        3: "stayed on the roadway",
        4: "left the roadway",
        5: "was off the roadway throughout",
        6: "came back onto the roadway",
        7: "entered the roadway",
    },
    unknown=(9,),
)

MANEUVER = table(
    "MANEUVER",
    "What the driver manoeuvred to avoid",
    {
        0: "nothing",
        1: "an object",
        2: "poor road conditions",
        3: "a live animal",
        4: "a motor vehicle",
        5: "a pedestrian, cyclist or other non-motorist",
        92: "a vehicle that was not struck",
        95: "no driver present",
    },
    unknown=(98, 99),
)

_PAIR_MEMBER = {
    "same": "travelling the same way as the other vehicle",
    "opposite": "travelling the opposite way to the other vehicle",
}
ACC_TYPE = table(
    "ACC_TYPE",
    "Crash type of the vehicle",
    {
        0: "no impact",
        **dict.fromkeys(range(1, 6), "a single-vehicle departure to the right"),
        **dict.fromkeys(range(6, 11), "a single-vehicle departure to the left"),
        11: "a forward impact with a parked vehicle",
        12: "a forward impact with a stationary object",
        13: "a forward impact with a pedestrian or animal",
        14: "a departure at the end of the road",
        15: "a forward impact",
        16: "a forward impact",
        20: "a rear-end crash, striking a stopped vehicle",
        **dict.fromkeys((21, 22, 23), "a rear-end crash, struck while stopped"),
        24: "a rear-end crash, striking a slower vehicle",
        **dict.fromkeys((25, 26, 27), "a rear-end crash, struck while going slower"),
        28: "a rear-end crash, striking a slowing vehicle",
        **dict.fromkeys((29, 30, 31), "a rear-end crash, struck while slowing down"),
        **dict.fromkeys((32, 33), "a rear-end crash"),
        **dict.fromkeys(range(34, 44), f"a forward impact, {_PAIR_MEMBER['same']}"),
        44: "a sideswipe or angle crash in the same direction, going straight on the left",
        45: "a sideswipe or angle crash in the same direction, going straight",
        46: "a sideswipe or angle crash in the same direction, changing lanes to the right",
        47: "a sideswipe or angle crash in the same direction, changing lanes to the left",
        **dict.fromkeys((48, 49), "a sideswipe or angle crash in the same direction"),
        50: "a head-on crash, having moved out of its lane",
        51: "a head-on crash, going straight in its lane",
        **dict.fromkeys((52, 53), "a head-on crash"),
        **dict.fromkeys(range(54, 64), f"a forward impact, {_PAIR_MEMBER['opposite']}"),
        64: "a sideswipe or angle crash in opposite directions, having moved out of its lane",
        65: "a sideswipe or angle crash in opposite directions, going straight in its lane",
        **dict.fromkeys((66, 67), "a sideswipe or angle crash in opposite directions"),
        68: "a turn across the path of an oncoming vehicle",
        69: "going straight while an oncoming vehicle turned across its path",
        70: "a right turn across the path of a vehicle going the same way",
        71: "going straight while a vehicle going the same way turned right across its path",
        72: "a left turn across the path of a vehicle going the same way",
        73: "going straight while a vehicle going the same way turned left across its path",
        **dict.fromkeys((74, 75), "a turn across a path"),
        76: "a left turn into the direction of the other vehicle",
        77: "going straight while the other vehicle turned left into its direction",
        78: "a right turn into the direction of the other vehicle",
        79: "going straight while the other vehicle turned right into its direction",
        80: "a right turn against the direction of the other vehicle",
        81: "going straight while the other vehicle turned right against its direction",
        82: "a left turn against the direction of the other vehicle",
        83: "going straight while the other vehicle turned left against its direction",
        **dict.fromkeys((84, 85), "a turn into a path"),
        86: "crossing straight paths, striking from the right",
        87: "crossing straight paths, struck on the right",
        88: "crossing straight paths, striking from the left",
        89: "crossing straight paths, struck on the left",
        **dict.fromkeys((90, 91), "crossing straight paths"),
        92: "backing into another vehicle",
        93: "struck by a backing vehicle",
        98: "another crash type",
    },
    unknown=(99,),
)
