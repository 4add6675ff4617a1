"""Codes of persons outside motor vehicles: who they were, where, what they did, and the typing of their crash.

The typing (``PBTYPE``, since 2014) is the Pedestrian and Bicycle Crash Analysis Tool's; it serves what a coder derived
for a pedestrian or a cyclist, and a code that says "not one" for the other. Such codes count as unknown here: they say
nothing of the person. Sources: FARS Analytical User's Manual; FARS/CRSS Pedestrian Bicyclist Crash Typing Manual.
"""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import CodeTable, table

SEX = table("SEX", "Sex", {1: "male", 2: "female"}, unknown=(3, 8, 9))
HIGHEST_AGE: Final = 120
"""``AGE``, ``PBAGE``: years."""
AGE_UNKNOWN: Final = frozenset({998, 999})
"""Not reported, and unknown."""

LOCATION = table(
    "LOCATION",
    "Where the person was",
    {
        1: "in a marked crosswalk at an intersection",
        2: "at an intersection in a crosswalk that is not marked, or not known to be",
        3: "at an intersection outside a crosswalk",
        9: "at an intersection",
        10: "in a marked crosswalk away from an intersection",
        11: "on the roadway away from an intersection, outside a crosswalk",
        13: "on the roadway away from an intersection",
        14: "in a parking lane",
        16: "in a bicycle lane",
        20: "on the shoulder or roadside",
        21: "on a sidewalk",
        22: "on the median or a crossing island",
        23: "in a driveway access",
        24: "on a shared-use path",
        25: "off the trafficway",
        28: "elsewhere",
    },
    unknown=(0, 98, 99),
)
NMACTION = table(
    "NMACTION",
    "What the person was doing before the crash (MPR_ACT until 2019)",
    {
        1: "going to or from school",
        2: "waiting to cross the roadway",
        3: "crossing the roadway",
        4: "jogging or running",
        5: "moving along the roadway with traffic",
        6: "moving along the roadway against traffic",
        7: "moving on the sidewalk",
        8: "in the roadway, working, playing or the like",
        9: "beside the roadway",
        10: "working in the trafficway at an incident",
        11: "entering or leaving a stopped vehicle",
        12: "at a disabled vehicle",
        14: "doing something else",
        15: "doing nothing",
        16: "moving along the roadway",
    },
    unknown=(98, 99),
)
NMCC = table(
    "NMCC",
    "What the person contributed to the crash (MTM_CRSH until 2019)",
    {
        0: "nothing noted",
        1: "darted out from behind something",
        2: "failed to yield",
        3: "disobeyed a sign, signal or officer",
        4: "was in the roadway improperly",
        5: "was entering or leaving a stopped vehicle",
        6: "was inattentive",
        7: "turned or merged improperly",
        8: "passed improperly",
        9: "went the wrong way",
        10: "rode on the wrong side",
        11: "dashed out in plain view",
        12: "crossed improperly",
        13: "had no lights on",
        14: "lacked required equipment",
        15: "changed lanes erratically",
        16: "failed to keep its lane",
        17: "entered or left the trafficway improperly",
        18: "moved erratically or recklessly",
        19: "was not visible",
        20: "passed with too little distance",
        21: "contributed in another way",
    },
    unknown=(98, 99),
)
MSAFEQMT = table(
    "MSAFEQMT",
    "Safety equipment of the person, a row each (until 2018)",
    {
        1: "none",
        2: "a helmet",
        3: "reflective clothing",
        4: "protective pads",
        5: "lights",
        6: "other equipment",
        7: "other equipment",
    },
    unknown=(-1, 8, 9, 98, 99),
)


def _used(element: str, title: str) -> CodeTable:
    return table(element, title, {0: "not used", 1: "used", 2: "not used", 7: "not applicable"}, unknown=(8, 9))


EQUIPMENT: Final = tuple(
    _used(element, title)
    for element, title in (
        ("NMHELMET", "Helmet"),
        ("NMPROPAD", "Protective pads"),
        ("NMOTHPRO", "Other protective equipment"),
        ("NMREFCLO", "Reflective clothing"),
        ("NMLIGHT", "Lights"),
        ("NMOTHPRE", "Other preventive equipment"),
    )
)
"""Safety equipment since 2019: an element for each kind."""

# --- typing of the crash (PBTYPE) ----------------------------------------------------------------------------------

_NOTED = {0: "none noted", 1: "yes"}
PBCWALK = table("PBCWALK", "Marked crosswalk present", _NOTED, unknown=(9,))
PBSWALK = table("PBSWALK", "Sidewalk present", _NOTED, unknown=(9,))
PBSZONE = table("PBSZONE", "In a school zone", _NOTED, unknown=(9,))
_LOCATIONS = {1: "at an intersection", 2: "related to an intersection", 3: "not at an intersection"}
PEDLOC = table("PEDLOC", "Pedestrian at an intersection", {**_LOCATIONS, 4: "off the trafficway"}, unknown=(7, 9))
BIKELOC = table("BIKELOC", "Cyclist at an intersection", {**_LOCATIONS, 4: "off the trafficway"}, unknown=(7, 9))
PEDPOS = table(
    "PEDPOS",
    "Position of the pedestrian when struck",
    {
        1: "in an intersection",
        2: "in a crosswalk",
        3: "in a travel lane",
        4: "on a paved shoulder, in a bicycle or parking lane",
        5: "on a sidewalk, shared-use path or driveway access",
        6: "on unpaved right-of-way",
        7: "in a driveway off the trafficway",
        8: "in a parking lot or elsewhere off the trafficway",
    },
    unknown=(9, 77),
)
BIKEPOS = table(
    "BIKEPOS",
    "Position of the cyclist when struck",
    {
        1: "in a travel lane",
        2: "in a bicycle or parking lane or on a paved shoulder",
        3: "on a sidewalk, crosswalk or driveway access",
        4: "in a driveway or alley",
        5: "off the trafficway",
        6: "off the trafficway",
        8: "elsewhere",
    },
    unknown=(7, 9, 77),
)
_HEADINGS = {1: "northbound", 2: "eastbound", 3: "southbound", 4: "westbound"}
PEDDIR = table("PEDDIR", "Direction of the pedestrian", _HEADINGS, unknown=(7, 8, 9))
MOTDIR = table("MOTDIR", "Direction of the motorist", _HEADINGS, unknown=(7, 8, 9))
BIKEDIR = table("BIKEDIR", "Direction of the cyclist", {1: "with traffic", 2: "facing traffic"}, unknown=(3, 7, 8, 9))
MOTMAN = table(
    "MOTMAN",
    "Manoeuvre of the motorist",
    {1: "turning left", 2: "turning right", 3: "going straight"},
    unknown=(7, 8, 9),
)
PEDLEG = table("PEDLEG", "Leg of the intersection", {1: "near side", 2: "far side"}, unknown=(7, 8, 9))
PEDCGP = table(
    "PEDCGP",
    "Group of pedestrian crashes",
    {
        100: "unusual circumstances",
        200: "a backing vehicle",
        310: "working or playing in the roadway",
        340: "at a bus stop",
        350: "unique to a place between intersections",
        400: "walking or running along the road",
        460: "at a driveway access",
        500: "waiting to cross",
        600: "in the roadway, circumstances unknown",
        720: "a multiple threat, or trapped",
        740: "a dash or dart-out",
        750: "crossing, vehicle not turning",
        790: "crossing, vehicle turning",
        800: "off the trafficway",
        910: "crossing an expressway",
        990: "other, or too little known",
    },
    unknown=(0,),
)
BIKECGP = table(
    "BIKECGP",
    "Group of cyclist crashes",
    {
        110: "loss of control or turning error",
        140: "motorist failed to yield at a sign",
        145: "cyclist failed to yield at a sign",
        150: "motorist failed to yield at a signal",
        158: "cyclist failed to yield at a signal",
        190: "crossing paths otherwise",
        210: "motorist turned or merged left",
        215: "motorist turned or merged right",
        219: "parking or bus related",
        220: "cyclist turned or merged left",
        225: "cyclist turned or merged right",
        230: "motorist overtook the cyclist",
        240: "cyclist overtook a vehicle",
        258: "wrong way or wrong side",
        290: "parallel paths otherwise",
        310: "cyclist failed to yield between intersections",
        320: "motorist failed to yield between intersections",
        600: "a backing vehicle",
        850: "other or unusual circumstances",
        910: "off the trafficway",
        990: "other, or too little known",
    },
    unknown=(0,),
)
_PEDESTRIAN_TYPES = (
    110, 120, 130, 140, 150, 160, 190, 211, 212, 213, 214, 219, 220, 230, 240, 250, 311, 312, 313, 320, 330, 341, 342,
    360, 410, 420, 430, 440, 459, 461, 465, 469, 510, 520, 590, 610, 620, 680, 690, 710, 730, 741, 742, 760, 770, 781,
    782, 791, 792, 794, 795, 799, 830, 890, 900, 910, 990,
)  # fmt: skip
_CYCLIST_TYPES = (
    111, 112, 113, 114, 115, 116, 121, 122, 123, 124, 129, 131, 132, 133, 134, 139, 141, 142, 143, 144, 147, 148, 151,
    152, 153, 154, 155, 156, 157, 158, 159, 160, 180, 211, 212, 213, 214, 215, 216, 217, 218, 219, 221, 222, 223, 224,
    225, 231, 232, 235, 239, 241, 242, 243, 244, 249, 250, 255, 259, 280, 311, 312, 313, 318, 319, 321, 322, 323, 328,
    329, 357, 380, 400, 510, 520, 600, 610, 700, 800, 900, 910, 970, 980, 990,
)  # fmt: skip
# The types refine the groups above, which are what a summary says; here their codes are checked, and passed on.
PEDCTYPE = table("PEDCTYPE", "Type of pedestrian crash", dict.fromkeys(_PEDESTRIAN_TYPES, ""), unknown=(0,))
BIKECTYPE = table("BIKECTYPE", "Type of cyclist crash", dict.fromkeys(_CYCLIST_TYPES, ""), unknown=(0,))

PEDSNR: Final = frozenset(f"{number}{letter}" for number in range(1, 13) for letter in "abcd")
"""``PEDSNR``: 1 to 12 by the motorist's manoeuvre (straight, right, left), side and crosswalk; a left, b right of the
motorist (on the far side of a turn: the motorist's own direction, the opposite one), c unknown, d other."""
PEDSNR_UNKNOWN: Final = frozenset({"7", "8", "99"})
