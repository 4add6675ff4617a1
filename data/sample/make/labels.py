"""Labels beside codes (``<FIELD>NAME``), as the coding manual of 2023 words them, for the codes the sample uses."""

from __future__ import annotations

_SOE = {
    1: "Rollover/Overturn", 8: "Pedestrian", 9: "Pedalcyclist", 11: "Live Animal",
    12: "Motor Vehicle In-Transport", 14: "Parked Motor Vehicle", 45: "Working Motor Vehicle",
    24: "Guardrail Face", 25: "Concrete Traffic Barrier", 30: "Utility Pole/Light Support", 33: "Curb", 34: "Ditch",
    35: "Embankment", 39: "Wall", 42: "Tree (Standing Only)",
    49: "Ridden Animal or Animal-Drawn Conveyance", 53: "Mail Box",
    63: "Ran Off Roadway - Right", 64: "Ran Off Roadway - Left", 68: "Cross Centerline", 69: "Re-entering Roadway",
    71: "End Departure",
}  # fmt: skip
_TURN = "Changing Trafficway, Vehicle Turning"
_ACROSS, _INTO = f"{_TURN}-Turn Across Path-Initial", f"{_TURN}-Turn Into Path-Turn Into"
_SAME, _OPPOSITE = "Same Trafficway, Same Direction", "Same Trafficway, Opposite Direction"
_SPEEDS = {0: "Stopped Motor Vehicle In-Transport", 998: "Not Reported", 999: "Reported as Unknown"}
_CLOCKS = {
    0: "Non-Collision", **{h: f"{h} Clock Point" for h in range(1, 13)}, 55: "Non-Harmful Event",
    19: "Other Objects or Person Set-In-Motion", 77: "Not a Motor Vehicle", 99: "Reported as Unknown",
}  # fmt: skip

LABELS: dict[str, dict[int, str]] = {
    "MAN_COLL": {
        0: "The First Harmful Event was Not a Collision with a Motor Vehicle in Transport", 1: "Front-to-Rear",
        2: "Front-to-Front", 6: "Angle", 7: "Sideswipe - Same Direction", 8: "Sideswipe - Opposite Direction",
        9: "Rear-to-Side", 10: "Rear-to-Rear", 11: "Other", 98: "Not Reported", 99: "Reported as Unknown",
    },
    "TYP_INT": {
        1: "Not an Intersection", 2: "Four-Way Intersection", 3: "T-Intersection", 4: "Y-Intersection",
        5: "Traffic Circle", 6: "Roundabout", 7: "Five Point, or More", 10: "L-Intersection",
        11: "Other Intersection Type", 98: "Not Reported", 99: "Reported as Unknown",
    },
    "RELJCT1": {0: "No", 1: "Yes"},
    "RELJCT2": {
        1: "Non-Junction", 2: "Intersection", 3: "Intersection-Related", 4: "Driveway Access",
        8: "Driveway Access Related", 17: "Acceleration/Deceleration Lane", 18: "Through Roadway",
        20: "Entrance/Exit Ramp", 98: "Not Reported", 99: "Reported as Unknown",
    },
    "REL_ROAD": {1: "On Roadway", 2: "On Shoulder", 3: "On Median", 4: "On Roadside", 99: "Reported as Unknown"},
    "LGT_COND": {1: "Daylight", 2: "Dark - Not Lighted", 3: "Dark - Lighted", 4: "Dawn", 5: "Dusk"},
    "WEATHER": {1: "Clear", 2: "Rain", 4: "Snow", 10: "Cloudy"},
    "ROUTE": {1: "Interstate", 2: "U.S. Highway", 3: "State Highway", 4: "County", 6: "Municipal"},
    "FUNC_SYS": {
        1: "Interstate", 3: "Other Principal Arterial", 4: "Minor Arterial", 5: "Major Collector", 6: "Minor Collector",
        7: "Local",
    },
    "RUR_URB": {1: "Rural", 2: "Urban"},
    "SOE": _SOE,
    "HARM_EV": _SOE,
    "AOI": _CLOCKS,
    "IMPACT1": _CLOCKS,
    "BODY_TYP": {
        4: "4-door sedan, hardtop", 5: "5-door/4-door hatchback", 6: "Station Wagon (excluding van and truck based)",
        14: 'Compact Utility (Utility Vehicle Categories "Small" and "Midsize")',
        15: 'Large utility (ANSI D16.1 Utility Vehicle Categories and "Full Size" and "Large")',
        20: "Minivan (Chrysler Town and Country, Caravan, Grand Caravan, Voyager, Voyager, Honda-Odyssey, ...)",
        34: "Light Pickup", 50: "School Bus", 52: "Transit Bus (City Bus)",
        62: "Single-unit straight truck or Cab-Chassis (GVWR range 19,501 to 26,000 lbs.)",
        63: "Single-unit straight truck or Cab-Chassis (GVWR greater than 26,000 lbs.)",
        66: "Truck-tractor (Cab only, or with any number of trailing unit; any weight)",
        80: "Two Wheel Motorcycle (excluding motor scooters)",
    },
    "SPEEDREL": {0: "No", 3: "Yes, Exceeded Speed Limit"},
    "VTRAFWAY": {
        0: "Non-Trafficway or Driveway Access", 1: "Two-Way, Not Divided", 2: "Two-Way, Divided, Unprotected Median",
        3: "Two-Way, Divided, Positive  Median Barrier", 4: "One-Way Trafficway",
        5: "Two-Way, Not Divided With a Continuous Left-Turn Lane", 6: "Entrance/Exit Ramp",
    },
    "VNUM_LAN": {
        0: "Non-Trafficway or Driveway Access", 1: "One lane", 2: "Two lanes", 3: "Three lanes", 4: "Four lanes",
        5: "Five lanes",
    },
    "VALIGN": {0: "Non-Trafficway or Driveway Access", 1: "Straight", 2: "Curve Right", 3: "Curve Left"},
    "VSURCOND": {1: "Dry", 2: "Wet", 3: "Snow", 4: "Ice/Frost"},
    "VTRAFCON": {
        0: "No Controls", 3: "Traffic control signal(on colors) not known whether or not Pedestrian Signal",
        20: "Stop Sign", 21: "Yield Sign",
    },
    "VIOLATION": {0: "None", 31: "Fail to stop for red signal"},
    "VTCONT_F": {0: "No Controls", 3: "Device Functioning Properly"},
    "P_CRASH1": {
        1: "Going Straight", 2: "Decelerating in Road", 4: "Starting in Road", 5: "Stopped in Roadway",
        6: "Passing or Overtaking Another Vehicle", 10: "Turning Right", 11: "Turning Left", 12: "Making a U-turn",
        13: "Backing Up (other than for Parking Position)", 14: "Negotiating a Curve", 15: "Changing Lanes",
        16: "Merging", 99: "Unknown",
    },
    "P_CRASH2": {
        80: "Pedestrian in Road", 83: "Pedalcyclist or Other Non-Motorist in Road", 87: "Animal in Road",
        10: "Over the lane line on left side of travel lane", 11: "Over the lane line on right side of travel lane",
        6: "Traveling too fast for conditions", 8: "Other cause of control loss",
        12: "Off the edge of the road on the left side", 13: "Off the edge of the road on the right side",
        14: "End departure",
        15: "Turning Left", 16: "Turning Right",
        17: "Crossing Over (Passing Through) Junction", 18: "This vehicle decelerating", 20: "Backing",
        21: "Making a U-Turn", 50: "Other vehicle stopped", 51: "Traveling in same direction with lower steady speed",
        52: "Traveling in same direction while decelerating", 53: "Traveling in same direction with higher speed",
        54: "Traveling in opposite direction", 56: "Backing",
        60: "From adjacent lane (same direction) over left lane line",
        61: "From adjacent lane (same direction) over right lane line",
        62: "From opposite direction  over left lane line",
        65: "From crossing street, turning into same direction", 66: "From crossing street, across path",
        67: "From crossing street, turning into opposite direction", 71: "From driveway, across path",
        72: "From driveway, turning into opposite direction", 73: "From driveway, intended path not known",
        99: "Unknown",
    },
    "P_CRASH3": {1: "No Avoidance Maneuver", 7: "Steering Right", 16: "Braking", 99: "Unknown/Not Reported"},
    "PCRASH4": {
        1: "Tracking", 2: "Skidding longitudinally  rotation less than 30 degrees", 9: "Precrash stability unknown",
    },
    "PCRASH5": {
        1: "Stayed in original travel lane", 2: "Stayed on roadway, but left original travel lane",
        4: "Departed roadway", 6: "Returned to roadway", 7: "Entered roadway", 9: "Unknown",
    },
    "ACC_TYPE": {
        11: "Single Driver-Configuration C-Forward Impact, Parked Vehicle",
        13: "Single Driver-Configuration C-Forward Impact, Pedestrian/Animal",
        14: "C14-Single Driver-Forward Impact-End Departure",
        1: "A1-Single Driver-Right Roadside Departure-Drive Off Road",
        2: "A2-Single Driver-Right Roadside Departure-Control/Traction Loss",
        3: "A3-Single Driver-Right Roadside Departure-Avoid Collision with Vehicle, Pedestrian, Animal",
        6: "B6-Single Driver-Left Roadside Departure-Drive Off Road",
        20: f"D20-{_SAME}-Rear End-Stopped", 21: f"D21-{_SAME}-Rear End-Stopped, Straight",
        24: f"D24-{_SAME}-Rear End-Slower", 25: f"D25-{_SAME}-Rear End-Slower, Going Straight",
        28: f"D28-{_SAME}-Rear End-Decelerating (Slowing)",
        29: f"D29-{_SAME}-Rear End-Decelerating (Slowing), Going Straight",
        45: f"F45-{_SAME}-Angle, Sideswipe-Straight Ahead on Left/Right",
        46: f"F46-{_SAME}-Angle, Sideswipe-Changing Lanes to the Right",
        47: f"F47-{_SAME}-Angle, Sideswipe-Changing Lanes to the Left",
        50: f"G50-{_OPPOSITE}-Head-On-Lateral Move (Left/Right)",
        51: f"G51-{_OPPOSITE}-Head-On-Lateral Move (Going Straight)",
        64: f"I64-{_OPPOSITE}-Angle, Sideswipe-Lateral Move (Left/Right)",
        65: f"I65-{_OPPOSITE}-Angle, Sideswipe-Lateral Move (Going Straight)",
        68: f"J68-{_ACROSS} Opposite Directions (Left/Right)",
        69: f"J69-{_ACROSS} Opposite Directions (Going Straight)",
        70: f"J70-{_ACROSS} Same Directions (Turning Right)", 71: f"J71-{_ACROSS} Same Directions (Going Straight)",
        72: f"J72-{_ACROSS} Same Directions (Turning Left)", 73: f"J73-{_ACROSS} Same Directions (Going Straight)",
        76: f"K76-{_INTO} Same Direction (Turning Left)", 77: f"K77-{_INTO} Same Direction (Going Straight)",
        78: f"K78-{_INTO} Same Direction (Turning Right)", 79: f"K79-{_INTO} Same Direction (Going Straight)",
        82: f"K82-{_INTO} Opposite Directions (Turning Left)", 83: f"K83-{_INTO} Opposite Directions (Going Straight)",
        86: "L86-Intersecting Paths-Straight Paths-Striking from the Right",
        87: "L87-Intersecting Paths-Straight Paths-Struck on the Right",
        88: "L88-Intersecting Paths-Straight Paths-Striking from the Left",
        89: "L89-Intersecting Paths-Straight Paths-Struck on the left",
        92: "M92-Backing-Backing Veh.", 93: "M93-Backing-Other Vehicle", 98: "M98-Other Crash Type", 99: "M99-Unknown",
    },
    "ACC_CONFIG": {
        103: "Single Driver-Forward Impact",
        101: "Single Driver-Right Roadside Departure", 102: "Single Driver-Left Roadside Departure",
        201: f"{_SAME}-Rear End, Trailing Vehicle", 202: f"{_SAME}-Rear End, Lead Vehicle",
        207: f"{_SAME}-Sideswipe, Angle, Vehicle on Left", 208: f"{_SAME}-Sideswipe, Angle, Vehicle on Right",
        301: f"{_OPPOSITE}-Lateral Move [Left/Right], Head-On, Sideswipe, or Angle",
        302: f"{_OPPOSITE}-Lateral Move [Going Straight], Head-On, Sideswipe, or Angle",
        401: f"{_TURN}-Turn Across Path, Initial Opposite Directions [Left/Right]",
        402: f"{_TURN}-Turn Across Path, Initial Opposite Directions [Going Straight]",
        403: f"{_TURN}-Turn Across Path, Initial Same Directions [Turning Right]",
        404: f"{_TURN}-Turn Across Path, Initial Same Directions [Going Straight, Other Vehicle Turning Right]",
        405: f"{_TURN}-Turn Across Path, Initial Same Directions [Turning Left]",
        406: f"{_TURN}-Turn Across Path, Initial Same Directions [Going Straight, Other Vehicle Turning Left]",
        408: f"{_TURN}-Turn Into Path, Turn into Same Direction [Turning Left]",
        409: f"{_TURN}-Turn Into Path, Turn into Same Direction [Going Straight, Other Vehicle Turning Left]",
        410: f"{_TURN}-Turn Into Path, Turn into Same Direction [Turning Right]",
        411: f"{_TURN}-Turn Into Path, Turn into Same Direction [Going Straight, Other Vehicle Turning Right]",
        414: f"{_TURN}-Turn Into Path, Turn into Opposite Directions [Turning Left]",
        415: f"{_TURN}-Turn Into Path, Turn into Opposite Directions [Going Straight, Other Vehicle Turning Left]",
        501: "Intersecting Paths-Straight Paths, Striking from the Right",
        502: "Intersecting Paths-Straight Paths, Struck on the Right",
        503: "Intersecting Paths-Straight Paths, Striking from the Left",
        504: "Intersecting Paths-Straight Paths, Struck on the Left",
        992: "Backing Vehicle", 993: "Other Vehicle", 998: "Other Crash Type", 999: "Unknown Crash Type",
    },
    "MANEUVER": {0: "Driver Did Not Maneuver to Avoid", 4: "Contact Motor Vehicle (In this crash)", 98: "Not Reported"},
    "DAMAGE": {h: f"{h} Clock Value" for h in range(1, 13)},
}  # fmt: skip

CONFIGURATION_OF_TYPE = {
    1: 101, 2: 101, 3: 101, 6: 102, 11: 103, 13: 103, 14: 103,
    20: 202, 21: 201, 24: 202, 25: 201, 28: 202, 29: 201, 45: 208, 46: 207, 47: 208, 50: 301, 51: 302, 64: 301, 65: 302,
    68: 401, 69: 402, 70: 403, 71: 404, 72: 405, 73: 406, 76: 408, 77: 409, 78: 410, 79: 411, 82: 414, 83: 415,
    86: 501, 87: 502, 88: 503, 89: 504, 92: 992, 93: 993, 98: 998, 99: 999,
}  # fmt: skip
"""``ACC_CONFIG`` for each ``ACC_TYPE``."""

MONTHS = (
    "January", "February", "March", "April", "May", "June", "July", "August", "September", "October", "November",
    "December",
)  # fmt: skip
WEEKDAYS = ("Sunday", "Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday")


def label(element: str, code: int) -> str:
    """The label of a code."""
    return LABELS[element][code]


def travel_speed_label(code: int) -> str:
    """The label of ``TRAV_SP``."""
    return _SPEEDS.get(code) or f"{code:03d} MPH"


def hour_label(hour: int) -> str:
    """The label of ``HOUR``, such as ``4:00pm-4:59pm``."""
    twelve, half = hour % 12 or 12, "am" if hour < 12 else "pm"
    return f"{twelve}:00{half}-{twelve}:59{half}"
