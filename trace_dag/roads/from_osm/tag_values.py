"""Values of OSM tags: speeds, lengths, whole numbers, lists with one entry per lane.

Real tags have all kinds of values (``maxspeed=signals``, ``lanes=many``, ``layer=ground``, ``width=20 ft``). An
unreadable value gives None, like a missing one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final, NamedTuple

from trace_dag.common.units import METRES_PER_FOOT, kmh_to_mps, mph_to_mps

MOST_LANES: Final = 12
"""Limit for one direction; a larger number is a typing error."""
_SPEED: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(mph|km/h|kmh|kph)?\s*$", re.IGNORECASE)
_METRES: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(m|ft)?\s*$", re.IGNORECASE)
_FEET_INCHES: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*'\s*(?:(\d+(?:\.\d+)?)\s*\")?\s*$")
_LEADING_INTEGER: Final = re.compile(r"^\s*(-?\d+)\b")
SIDEWALK_WIDTH_M: Final = 1.5  # 5 ft (FHWA, Designing Sidewalks and Trails for Access, 1999, 4.3.1)
CYCLE_LANE_WIDTH_M: Final = 1.5  # 5 ft (AASHTO, Guide for the Development of Bicycle Facilities, 2012, 4.6.4)
_WIDTHS_M: Final = (0.9, 4.5)  # a tagged width outside this range is a typing error


def parse_speed_mps(value: str | None) -> float | None:
    """Return ``35 mph`` or ``60`` (km/h) in m/s.

    None for text that is no plausible limit (signals, none, walk, 0).

    >>> round(parse_speed_mps('25 mph'), 3), parse_speed_mps('36'), parse_speed_mps('signals')
    (11.176, 10.0, None)
    """
    match = _SPEED.match(value) if value else None
    if match is None:
        return None
    number = float(match[1])
    speed_mps = mph_to_mps(number) if (match[2] or "").lower() == "mph" else kmh_to_mps(number)
    return speed_mps if 1.0 <= speed_mps <= 45.0 else None


def parse_length_m(value: str | None) -> float | None:
    """Return ``3.5``, ``3.5 m``, ``12 ft`` or ``12'6"`` in metres; None if unreadable.

    >>> parse_length_m('3.5 m'), round(parse_length_m('10 ft'), 3), parse_length_m('wide')
    (3.5, 3.048, None)
    """
    if not value:
        return None
    if match := _METRES.match(value):
        number = float(match[1])
        return number * METRES_PER_FOOT if (match[2] or "").lower() == "ft" else number
    if match := _FEET_INCHES.match(value):
        return (float(match[1]) + float(match[2] or 0) / 12) * METRES_PER_FOOT
    return None


def parse_turns(entry: str) -> tuple[str, ...]:
    """Return the turns painted on one lane; "none" or an empty part beside an arrow means straight on.

    >>> parse_turns("through;right"), parse_turns("none"), parse_turns("none;slight_right")
    (('through', 'right'), (), ('through', 'slight_right'))
    """
    turns = [turn.strip() for turn in entry.split(";")]
    if all(turn in ("", "none") for turn in turns):
        return ()
    return tuple(dict.fromkeys("through" if turn in ("", "none") else turn for turn in turns))


def parse_entries(value: str | None) -> tuple[str, ...]:
    """Return the entries of a ``...:lanes`` tag, one for each lane from left to right.

    Empty if there are too many for lanes.

    >>> parse_entries("left|through;right|")
    ('left', 'through;right', '')
    """
    entries = tuple(entry.strip() for entry in value.split("|")) if value else ()
    return entries if len(entries) <= MOST_LANES else ()


def parse_integer(value: str | None, least: int, most: int) -> int | None:
    """Return the whole number that a value begins with, within limits.

    >>> parse_integer("2 lanes", 1, 12), parse_integer("-3", 1, 12), parse_integer("ground", -5, 5)
    (2, None, None)
    """
    match = _LEADING_INTEGER.match(value) if value else None
    return int(match[1]) if match is not None and least <= int(match[1]) <= most else None


# --- what is beside a road -------------------------------------------------------------------------------------------
class Beside(NamedTuple):
    """Widths (m) of the sidewalks and cycle lanes by a way's tags, seen along the way; None means none."""

    sidewalk_left_m: float | None = None
    sidewalk_right_m: float | None = None
    cycle_left_m: float | None = None
    cycle_right_m: float | None = None

    def reversed(self) -> Beside:
        """Return the tags as seen against the way."""
        return Beside(self.sidewalk_right_m, self.sidewalk_left_m, self.cycle_right_m, self.cycle_left_m)


NOTHING: Final = Beside()


def read_beside(tags: Mapping[str, str], *, oneway: bool) -> Beside:
    """Read ``sidewalk`` and ``cycleway`` tags of a road, seen along the OSM way.

    On a one-way road, a cycle lane without a side is on the right of the traffic; one against the traffic
    (``oneway:bicycle=no`` with ``lanes:backward``) is on the left. Sidewalks tagged ``separate`` are ways of their own.

    >>> read_beside({"sidewalk": "right", "sidewalk:width": "2 m"}, oneway=False)
    Beside(sidewalk_left_m=None, sidewalk_right_m=2.0, cycle_left_m=None, cycle_right_m=None)
    """
    if not any(key.startswith(("sidewalk", "cycleway", "oneway:bicycle")) for key in tags):
        return NOTHING
    walk, cycle = tags.get("sidewalk", ""), tags.get("cycleway", "")
    lanes = cycle in ("lane", "track")

    def width(key: str, side: str, usual_m: float) -> float:
        tagged = parse_length_m(
            tags.get(f"{key}:{side}:width") or tags.get(f"{key}:both:width") or tags.get(f"{key}:width")
        )
        return min(max(tagged or usual_m, _WIDTHS_M[0]), _WIDTHS_M[1])

    def sidewalk(side: str) -> float | None:
        own = (
            tags.get(f"sidewalk:{side}")
            or tags.get("sidewalk:both")
            or ("yes" if walk in ("both", "yes", side) else "no")
        )
        return width("sidewalk", side, SIDEWALK_WIDTH_M) if own == "yes" else None

    def cycle_lane(side: str) -> float | None:
        own = tags.get(f"cycleway:{side}") or tags.get("cycleway:both")
        if own is None and oneway:
            against = tags.get("oneway:bicycle") == "no" and "lanes:backward" in tags
            opposite = side == "left" and (against or cycle in ("opposite_lane", "opposite_track"))
            own = "lane" if opposite or (lanes and side == "right") else "no"
        elif own is None:
            own = cycle
        return width("cycleway", side, CYCLE_LANE_WIDTH_M) if own in ("lane", "track") else None

    return Beside(sidewalk("left"), sidewalk("right"), cycle_lane("left"), cycle_lane("right"))
