"""Traffic on the left: the map of the mirrored place, mirrored back.

The converter works for traffic on the right. If traffic keeps left, the place is mirrored: its geometry, and every tag
that has a side. The result is mirrored back, so that lanes, turns, signals and signs are on the other side (OpenDRIVE
1.7, 9.1, ``rule="LHT"``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from trace_dag.common.geometry import LocalFrame
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmNode
from trace_dag.roads.from_osm.tag_values import MOST_LANES, parse_integer
from trace_dag.roads.map.curves import Point
from trace_dag.roads.map.model import Cubic, Junction, Lane, LaneSection, PlanElement, Road, RoadMark
from trace_dag.roads.map.network import RoadNetwork

_SIDED: Final = frozenset(
    {"sidewalk", "cycleway", "footway", "shoulder", "parking", "busway", "verge", "kerb", "turn", "change"}
)
_SIDE: Final = re.compile("left|right")
_OTHER: Final = {"left": "right", "right": "left", "increase": "decrease", "decrease": "increase"}
_PLACEMENT: Final = re.compile(r"(left|middle|right)_of:(\d+)")


def mirror_extract(extract: OsmExtract, frame: LocalFrame) -> OsmExtract:
    """Return the extract in a mirror along the meridian of the frame's origin.

    >>> there = mirror_extract(extract, network.frame)
    >>> mirror_extract(there, network.frame).ways == extract.ways
    True
    """
    axis_deg, box = 2 * frame.longitude_deg, extract.box

    def mirrored(node: OsmNode) -> OsmNode:
        return node._replace(longitude_deg=axis_deg - node.longitude_deg)

    return replace(
        extract,
        box=BoundingBox(box.south_deg, axis_deg - box.east_deg, box.north_deg, axis_deg - box.west_deg),
        nodes={node_id: mirrored(node) for node_id, node in extract.nodes.items()},
        ways=tuple(way._replace(tags=mirror_tags(way.tags)) for way in extract.ways),
    )


def mirror_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Return tags of a way with left and right exchanged.

    >>> mirror_tags({"turn:lanes": "left|through|", "parking:left": "lane", "name": "Left Fork"})
    {'turn:lanes': '|through|right', 'parking:right': 'lane', 'name': 'Left Fork'}
    """
    turned: dict[str, str] = {}
    for key, value in tags.items():
        first = key.partition(":")[0]
        if first == "placement":
            lanes = parse_integer(tags.get(key.replace("placement", "lanes")), 1, MOST_LANES)
            match = _PLACEMENT.fullmatch(value)
            if lanes is not None and match is not None:
                turned[key] = f"{_OTHER.get(match[1], match[1])}_of:{lanes + 1 - int(match[2])}"
            continue
        if first in _SIDED:
            value = _swapped(value)
        if ":lanes" in key:
            value = "|".join(value.split("|")[::-1])
        turned[_swapped(key) if first in _SIDED else key] = value
    return turned


def mirror_network(network: RoadNetwork) -> RoadNetwork:
    """Return the network of a mirrored place, mirrored back, with traffic on the left.

    >>> first = mirror_network(network).roads[0]
    >>> first.left_hand, first.plan[0].x_m == -network.roads[0].plan[0].x_m
    (True, True)
    """
    return replace(
        network,
        roads=tuple(map(_road, network.roads)),
        junctions=tuple(map(_junction, network.junctions)),
    )


def _road(road: Road) -> Road:
    return replace(
        road,
        plan=tuple(map(_element, road.plan)),
        lane_sections=tuple(LaneSection(each.s_m, tuple(map(_lane, each.lanes[::-1]))) for each in road.lane_sections),
        lane_offset=tuple(Cubic(each.s_m, -each.a, -each.b, -each.c, -each.d) for each in road.lane_offset),
        signals=tuple(replace(signal, t_m=-signal.t_m) for signal in road.signals),
        crosswalks=tuple(replace(each, outline_m=_outline(each.outline_m)) for each in road.crosswalks),
        objects=tuple(replace(each, outline_m=_outline(each.outline_m)) for each in road.objects),
        turn=None if road.turn is None else _swapped(road.turn),
        left_hand=True,
    )


def _outline(corners_m: tuple[Point, ...]) -> tuple[Point, ...]:
    return tuple((ahead, -left) for ahead, left in corners_m[::-1])


def _element(piece: PlanElement) -> PlanElement:
    poly = piece.poly
    if poly is not None:
        a_u, b_u, c_u, d_u, a_v, b_v, c_v, d_v = poly
        poly = a_u, b_u, c_u, d_u, -a_v, -b_v, -c_v, -d_v
    return replace(
        piece,
        x_m=-piece.x_m,
        heading_rad=math.pi - piece.heading_rad,
        curvature_1pm=-piece.curvature_1pm if piece.curvature_1pm else 0.0,
        poly=poly,
    )


def _lane(lane: Lane) -> Lane:
    return replace(
        lane,
        id=-lane.id,
        predecessor=None if lane.predecessor is None else -lane.predecessor,
        successor=None if lane.successor is None else -lane.successor,
        mark=_mark(lane.mark, lane.id),
        legal_mark=_mark(lane.legal_mark, lane.id),
        turns=tuple(map(_swapped, lane.turns)),
    )


def _mark(mark: RoadMark | None, lane_id: int) -> RoadMark | None:
    """Return a mark with its parts from the inner to the outer lane; those of the centre from left to right."""
    if mark is None:
        return None
    kind = " ".join(mark.type.split(" ")[::-1]) if lane_id == 0 else mark.type
    return RoadMark(kind, mark.colour, _OTHER.get(mark.lane_change, mark.lane_change))


def _junction(junction: Junction) -> Junction:
    centre = junction.centre_xy_m
    return replace(
        junction,
        connections=tuple(
            replace(each, lane_links=tuple((-origin, -target) for origin, target in each.lane_links))
            for each in junction.connections
        ),
        centre_xy_m=None if centre is None else (-centre[0], centre[1]),
    )


def _swapped(text: str) -> str:
    return _SIDE.sub(lambda side: _OTHER[side[0]], text)
