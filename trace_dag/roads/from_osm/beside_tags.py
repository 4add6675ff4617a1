"""Sidewalks and cycle lanes beside an OpenStreetMap road by its ``sidewalk`` and ``cycleway`` tags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from trace_dag.roads.from_osm.tag_values import parse_length_m

SIDEWALK_WIDTH_M: Final = 1.5  # 5 ft (FHWA, Designing Sidewalks and Trails for Access, 1999, 4.3.1)
CYCLE_LANE_WIDTH_M: Final = 1.5  # 5 ft (AASHTO, Guide for the Development of Bicycle Facilities, 2012, 4.6.4)
_WIDTHS_M: Final = (0.9, 4.5)  # a tagged width outside this range is a typing error


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
