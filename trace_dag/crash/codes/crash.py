"""Codes of the crash as a whole: place, time, light, weather, junction."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.table import table

MAN_COLL = table(
    "MAN_COLL",
    "Manner of collision of the first harmful event",
    {
        0: "not a collision with a motor vehicle in transport",
        1: "front to rear",
        2: "front to front",
        6: "angle",
        7: "sideswipe in the same direction",
        8: "sideswipe in opposite directions",
        9: "rear to side",
        10: "rear to rear",
        11: "another manner",
    },
    unknown=(98, 99),
)

TYP_INT = table(
    "TYP_INT",
    "Type of intersection",
    {
        1: "not an intersection",
        2: "a four-way intersection",
        3: "a T-intersection",
        4: "a Y-intersection",
        5: "a traffic circle",
        6: "a roundabout",
        7: "an intersection of five or more legs",
        10: "an L-intersection",
        11: "an intersection of another type",
    },
    unknown=(98, 99),
    since={11: 2020},
)

RELJCT2 = table(
    "RELJCT2",
    "Relation to a junction",
    {
        1: "away from any junction",
        2: "in an intersection",
        3: "near an intersection and related to it",
        4: "in a driveway access",
        5: "related to an entrance or exit ramp",
        6: "at a railway grade crossing",
        7: "related to a crossover",
        8: "related to a driveway access",
        16: "at a shared-use path crossing",
        17: "in an acceleration or deceleration lane",
        18: "on the through roadway of an interchange",
        19: "elsewhere in an interchange area",
        20: "on an entrance or exit ramp",
    },
    unknown=(98, 99),
)
AWAY_FROM_JUNCTION: Final = 1
NON_JUNCTION: Final = frozenset({1, 4, 8, 16, 17, 18})
"""``RELJCT2`` values at which the roadway itself has no intersection."""
AT_INTERSECTION: Final = frozenset({2, 3})

REL_ROAD = table(
    "REL_ROAD",
    "Relation to the trafficway",
    {
        1: "on the roadway",
        2: "on the shoulder",
        3: "on the median",
        4: "on the roadside",
        5: "outside the trafficway",
        6: "off the roadway",
        7: "in a parking lane",
        8: "in a gore",
        10: "on a separator",
        11: "in a centre turn lane",
        12: "on a traffic island",
    },
    unknown=(98, 99),
    since={12: 2018},
)

LGT_COND = table(
    "LGT_COND",
    "Light",
    {
        1: "in daylight",
        2: "in the dark on an unlit road",
        3: "in the dark on a lit road",
        4: "at dawn",
        5: "at dusk",
        6: "in the dark",
        7: "in another light",
    },
    unknown=(8, 9),
)

WEATHER = table(
    "WEATHER",
    "Weather",
    {
        0: "no additional condition",
        1: "clear weather",
        2: "rain",
        3: "sleet or hail",
        4: "snow",
        5: "fog or smoke",
        6: "severe crosswinds",
        7: "blowing sand or dirt",
        8: "other weather",
        10: "cloudy weather",
        11: "blowing snow",
        12: "freezing rain",
    },
    unknown=(98, 99),
    until={0: 2019},
)

ROUTE = table(
    "ROUTE",
    "Route signing",
    {
        0: "an unsigned road",
        1: "an Interstate",
        2: "a U.S. highway",
        3: "a state highway",
        4: "a county road",
        5: "a township street",
        6: "a municipal street",
        7: "a frontage road",
        8: "another road",
        10: "a parkway or forest route",
        11: "a business route",
        12: "a secondary route",
        13: "a Bureau of Indian Affairs road",
        95: "another road",
        96: "a trafficway outside the state inventory",
    },
    unknown=(9, 99),
    since={0: 2023, 10: 2023, 11: 2023, 12: 2023, 13: 2023, 95: 2023, 96: 2023, 99: 2023},
    until={7: 2022, 8: 2022, 9: 2022},
)

RUR_URB = table("RUR_URB", "Land use", {1: "rural", 2: "urban", 6: "not in the state inventory"}, unknown=(8, 9))

FUNC_SYS = table(
    "FUNC_SYS",
    "Functional class of the road",
    {
        1: "interstate",
        2: "other freeway or expressway",
        3: "other principal arterial",
        4: "minor arterial",
        5: "major collector",
        6: "minor collector",
        7: "local road",
        96: "not in the state inventory",
    },
    unknown=(98, 99),
)

ROAD_FNC = table(
    "ROAD_FNC",
    "Roadway function class (before 2015): land use and functional class in one code",
    {
        1: "rural interstate",
        2: "rural principal arterial",
        3: "rural minor arterial",
        4: "rural major collector",
        5: "rural minor collector",
        6: "rural local road",
        9: "rural, class unknown",
        11: "urban interstate",
        12: "urban freeway or expressway",
        13: "urban principal arterial",
        14: "urban minor arterial",
        15: "urban collector",
        16: "urban local road",
        19: "urban, class unknown",
    },
    unknown=(99,),
)
FUNC_SYS_OF_ROAD_FNC: Final = {
    1: 1, 2: 3, 3: 4, 4: 5, 5: 6, 6: 7, 11: 1, 12: 2, 13: 3, 14: 4, 15: 5, 16: 7,
}  # fmt: skip
"""``FUNC_SYS`` of the older ``ROAD_FNC``; an urban collector (15) is a major collector since 2015."""

STATES: Final = {
    1: "Alabama", 2: "Alaska", 4: "Arizona", 5: "Arkansas", 6: "California", 8: "Colorado", 9: "Connecticut",
    10: "Delaware", 11: "District of Columbia", 12: "Florida", 13: "Georgia", 15: "Hawaii", 16: "Idaho",
    17: "Illinois", 18: "Indiana", 19: "Iowa", 20: "Kansas", 21: "Kentucky", 22: "Louisiana", 23: "Maine",
    24: "Maryland", 25: "Massachusetts", 26: "Michigan", 27: "Minnesota", 28: "Mississippi", 29: "Missouri",
    30: "Montana", 31: "Nebraska", 32: "Nevada", 33: "New Hampshire", 34: "New Jersey", 35: "New Mexico",
    36: "New York", 37: "North Carolina", 38: "North Dakota", 39: "Ohio", 40: "Oklahoma", 41: "Oregon",
    42: "Pennsylvania", 43: "Puerto Rico", 44: "Rhode Island", 45: "South Carolina", 46: "South Dakota",
    47: "Tennessee", 48: "Texas", 49: "Utah", 50: "Vermont", 51: "Virginia", 52: "Virgin Islands",
    53: "Washington", 54: "West Virginia", 55: "Wisconsin", 56: "Wyoming",
}  # fmt: skip
"""``STATE`` codes (GSA geographic locator codes)."""

PER_TYP = table(
    "PER_TYP",
    "Person type",
    {
        1: "driver of a motor vehicle in transport",
        2: "passenger of a motor vehicle in transport",
        3: "occupant of a motor vehicle not in transport",
        4: "occupant of another transport device",
        5: "pedestrian",
        6: "cyclist",
        7: "other cyclist",
        8: "person on a personal conveyance",
        9: "occupant of a motor vehicle in transport",
        10: "person in or on a building",
        11: "person on a motorised personal conveyance",
        12: "person on a non-motorised personal conveyance",
        13: "person on a personal conveyance",
        19: "non-motorist",
    },
    unknown=(88, 99),
)
VEHICLE_OCCUPANTS: Final = frozenset({1, 2, 3, 9})
"""``PER_TYP`` of persons in motor vehicles; every other person is a non-motorist."""
