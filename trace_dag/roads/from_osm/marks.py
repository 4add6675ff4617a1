"""Lane markings of roads in terms of OpenDRIVE: shape, colour and permitted lane changes.

They follow the US Manual on Uniform Traffic Control Devices (MUTCD), chapter 3B. A ``LEGAL`` mark is the one required
by law where the map for reconstruction has another, since drivers in crashes cross centre lines and edges.
"""

from __future__ import annotations

from typing import Final

from trace_dag.roads.map.model import RoadMark

BROKEN: Final = RoadMark("broken", "white", "both")
EDGE: Final = RoadMark("solid", "white", "both")
LEGAL_EDGE: Final = RoadMark("solid", "white", "none")
YELLOW_BROKEN: Final = RoadMark("broken", "yellow", "both")
LEGAL_CENTRE_TURN: Final = RoadMark("solid broken", "yellow", "both")
YELLOW_DOUBLE: Final = RoadMark("solid solid", "yellow", "none")
YELLOW_EDGE: Final = RoadMark("solid", "yellow", "none")
UNMARKED: Final = RoadMark("none", "standard", "both")
NOT_CROSSED: Final = RoadMark("none", "standard", "none")
"""Nothing is painted, and nobody changes lanes: beside sidewalks."""


def lane_line(*, outward: bool, inward: bool, left: bool) -> RoadMark:
    """Return the line between two lanes of one direction that may be crossed ``outward``, ``inward``, or not at all.

    OpenDRIVE orders its parts from the inner to the outer lane. It names the directions of crossing by the ids of the
    lanes, which grow outward on the ``left`` of the road.

    >>> lane_line(outward=True, inward=False, left=True)
    RoadMark(type='broken solid', colour='white', lane_change='increase')
    """
    if not outward and not inward:
        return LEGAL_EDGE
    kind = "broken solid" if outward else "solid broken"
    return RoadMark(kind, "white", "increase" if outward == left else "decrease")
