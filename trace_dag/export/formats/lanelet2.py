"""Lanelet2 maps: the road as Autoware and planners read it, an OSM XML file of lanelets and regulatory elements.

Every drivable lane is a lanelet. Readers recognise successive lanelets by shared end nodes, and adjacent ones by a
shared border. A reader takes two lanelets to be either adjacent *or* both successors of a third, so the lanes into
which one lane splits share no border. Limits, lights, stop and yield signs are regulatory elements, and so are the
rules at junctions: an all-way stop, or a right of way. Nodes are in WGS84, with ``local_x`` and ``local_y`` in the
map's local frame and ``ele``, the height in it.

Format: Poggenhans et al., Lanelet2: A high-definition map framework for the future of automated driving, ITSC 2018, and
the tagging pages of its documentation; stop signs, heights and turns are tagged by Autoware's extension of it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, count
from typing import Final

import numpy as np
from lxml import etree

from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mps_to_kmh, mps_to_mph
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.formats.lane_rules import LaneRules, Post, mark_of, place_of, turn_of
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.flow.contract import CrashFiles
from trace_dag.roads.map.lane_shapes import LaneShape
from trace_dag.roads.map.model import LaneRef, LaneType, SignalType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.version import __version__

_MARKS: Final = {"solid": "solid", "broken": "dashed"}
_NO_WIDTH_M: Final = 1e-6  # of a lane that begins or ends without width, so that it does not move shared nodes


class Lanelet2(Exporter):
    """``<key>.osm`` of each crash: its road map."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        return {f"{crash.key}.osm": lanelets(crash.load(ROAD_MAP))}


def lanelets(network: RoadNetwork) -> bytes:
    """Return a road map as OSM XML of Lanelet2.

    >>> etree.fromstring(lanelets(network)).find("relation/tag[@k='type']").get("v")
    'lanelet'
    """
    return _Map(network).xml()


class _Map:
    """The file's nodes, ways and relations; their ids go from 1 on, those of lanelets first."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network, self._rules = network, LaneRules(network)
        self._ids = {shape.ref: number for number, shape in enumerate(self._rules.shapes, 1)}
        self._next_id = count(len(self._ids) + 1)
        self._points: dict[int, FloatArray] = {}
        self._ways: list[etree._Element] = []
        self._elements: list[etree._Element] = []
        self._elements_of: dict[LaneRef, list[int]] = defaultdict(list)

    def xml(self) -> bytes:
        """Return the file."""
        borders = self._borders()
        self._add_rules()
        relations = [self._lanelet(shape, *borders[2 * i : 2 * i + 2]) for i, shape in enumerate(self._rules.shapes)]
        root = etree.Element("osm", version="0.6", generator=f"trace-dag {__version__}")
        root.set("attribution", self._network.attribution)
        points = np.array(list(self._points.values())).reshape(-1, 3)
        degrees = self._network.frame.to_geographic(points[:, :2])
        for number, (latitude, longitude), (x, y, z) in zip(self._points, degrees, points, strict=True):
            at = {"lat": f"{latitude:.9f}", "lon": f"{longitude:.9f}"}
            node = etree.SubElement(root, "node", at, id=str(number), version="1")
            _tag(node, local_x=f"{x:.4f}", local_y=f"{y:.4f}", ele=f"{z:.4f}")
        root.extend([*self._ways, *relations, *self._elements])
        return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)

    def _borders(self) -> list[int]:
        """Add the ways on both sides of each lane; return their ids, left and right, lane by lane.

        The corners of successive lanes are one node, at their mean position.
        """
        shapes = self._rules.shapes
        index = {shape.ref: i for i, shape in enumerate(shapes)}
        follows, beside = [], []  # pairs of corners: two of each border, where it begins and ends
        for i, shape in enumerate(shapes):
            for after in filter(index.__contains__, shape.successors):
                follows += [(4 * i + 2 * side + 1, 4 * index[after] + 2 * side) for side in (0, 1)]
            for side, other, same_way in ((0, shape.left, shape.left_same_way), (1, shape.right, shape.right_same_way)):
                if other in index:
                    one, two = 2 * i + side, 2 * index[other] + (1 - side if same_way else side)
                    beside += [((2 * one, 2 * two + (not same_way)), (2 * one + 1, 2 * two + same_way))]
        nodes = _classes(4 * len(shapes), [*follows, *chain(*beside)])
        split = [node for at in np.reshape(nodes, (-1, 2, 2)) for node, across in at.T if node == across]
        beside = [pairs for pairs in beside if not np.isin(np.take(nodes, pairs), split).any()]  # else without width
        nodes = _classes(4 * len(shapes), [*follows, *chain(*beside)])
        sides = _classes(2 * len(shapes), [(one // 2, two // 2) for (one, two), _ in beside])
        borders = [border for shape in shapes for border in (shape.left_m, shape.right_m)]
        places = np.array([border[end] for border in borders for end in (0, -1)]).reshape(-1, 2, 2, 3)
        widths = np.hypot(*(places[:, 0] - places[:, 1])[..., :2].T).T[:, None].repeat(2, axis=1).ravel() + _NO_WIDTH_M
        sums = np.stack([np.bincount(nodes, widths * values) for values in places.reshape(-1, 3).T], axis=1)
        ids = [self._add_node(point) for point in sums / np.bincount(nodes, widths)[:, None]]
        made: dict[int, int] = {}
        for side, number in enumerate(sides):
            if number not in made:
                inner = [self._add_node(point) for point in borders[side][1:-1]]
                way = [ids[nodes[2 * side]], *inner, ids[nodes[2 * side + 1]]]
                made[number] = self._add_way(way, **self._line(shapes[side // 2], left=side % 2 == 0))
        return [made[number] for number in sides]

    def _line(self, shape: LaneShape, *, left: bool) -> dict[str, str]:
        """Return the tags of a border: the line that the law requires, or the road's edge; virtual within junctions."""
        own = mark_of(self._network, shape.ref, left=left)
        beside, same_way = (shape.left, shape.left_same_way) if left else (shape.right, shape.right_same_way)
        if own is None or shape.junction_id is not None:
            return {"type": "virtual" if beside or shape.junction_id is not None else "road_border"}
        other = mark_of(self._network, beside, left=left != same_way) if beside else None
        kinds = [_MARKS[own[0]], _MARKS[(other or own)[0]]]
        names = kinds[::-1] if left else kinds
        return {"type": "line_thin", "subtype": names[0] if names[0] == names[1] else "_".join(names), "color": own[1]}

    def _add_rules(self) -> None:
        for limit in self._rules.limits:
            speed = f"{mps_to_mph(limit.speed_mps):.4g} mph"
            self._add_element(limit.lanes, [], subtype="speed_limit", sign_type=speed)
        for light in self._rules.lights:
            tags = {"type": "traffic_light", "subtype": "red_yellow_green"}
            members = [("refers", "way", self._add_sign(light, tags)), ("ref_line", "way", self._add_stop_line(light))]
            self._add_element(light.lanes, members, subtype="traffic_light")
        ends = {ref for shape in self._rules.shapes if shape.junction_id is not None for ref in shape.predecessors}
        signs: dict[LaneRef, tuple[Post, int]] = {}
        for post in self._rules.signs:
            stops = post.signal.type == SignalType.STOP
            way = self._add_sign(post, {"type": "traffic_sign", "subtype": "stop_sign" if stops else "usR1-2"})
            members = [("refers", "way", way), *([("ref_line", "way", self._add_stop_line(post))] if stops else [])]
            self._add_element(post.lanes, members, subtype="traffic_sign")
            signs |= {ref: (post, way) for ref in post.lanes if ref in ends}
        lit = {ref for light in self._rules.lights for ref in light.lanes}
        entries: dict[str, dict[LaneRef, None]] = defaultdict(dict)
        for shape in self._rules.shapes:
            if shape.junction_id is not None:
                entries[shape.junction_id] |= {ref: None for ref in shape.predecessors if ref in self._ids}
        for refs in entries.values():
            waiting = {ref: signs[ref] for ref in refs if ref in signs}
            first = [ref for ref in refs if ref not in waiting and ref not in lit]
            members = [("yield", "relation", self._ids[ref]) for ref in waiting]
            if waiting and first:
                members += [("right_of_way", "relation", self._ids[ref]) for ref in first]
                self._add_element([*waiting, *first], members, subtype="right_of_way")
            elif waiting.keys() == refs.keys() and all(
                post.signal.type == SignalType.STOP for post, _ in waiting.values()
            ):
                members += [("refers", "way", way) for way in dict.fromkeys(way for _, way in waiting.values())]
                self._add_element(waiting, members, subtype="all_way_stop")

    def _lanelet(self, shape: LaneShape, left: int, right: int) -> etree._Element:
        lane, number = self._network.lane(shape.ref), self._ids[shape.ref]
        members = [("left", "way", left), ("right", "way", right)]
        members += [("regulatory_element", "relation", element) for element in self._elements_of[shape.ref]]
        tags = {"subtype": "bus_lane" if lane.bus else "road", "location": "urban"}
        tags["one_way"] = "no" if shape.type is LaneType.BIDIRECTIONAL else "yes"
        if shape.speed_mps is not None:
            tags["speed_limit"] = f"{mps_to_kmh(shape.speed_mps):.4g}"
        if shape.junction_id is not None:
            tags["turn_direction"] = turn_of(shape).lower()
        return _relation(number, members, type="lanelet", lane=":".join(map(str, shape.ref)), **tags)

    def _add_element(self, lanes: Iterable[LaneRef], members: list[tuple[str, str, int]], **tags: str) -> None:
        number = next(self._next_id)
        self._elements.append(_relation(number, members, type="regulatory_element", **tags))
        for ref in lanes:
            self._elements_of[ref].append(number)

    def _add_sign(self, post: Post, tags: Mapping[str, str]) -> int:
        """Add the lower edge of a sign or light, from left to right as approaching traffic sees it."""
        ref, signal = post.lanes[0], post.signal
        middle, (left, right) = place_of(self._network, ref.road_id, signal), self._rules.stop_line(ref, signal.s_m)
        half = (right - left) / np.hypot(*(right - left)[:2]) * max(signal.width_m, 0.1) / 2
        nodes = [self._add_node(middle - half), self._add_node(middle + half)]
        return self._add_way(nodes, **tags, height=f"{signal.height_m:.2f}")

    def _add_stop_line(self, post: Post) -> int:
        """Add a line across all lanes to which a light or sign applies."""
        ends = np.array([self._rules.stop_line(ref, post.signal.s_m) for ref in post.lanes]).reshape(-1, 3)
        along = (ends - ends[0]) @ (ends[1] - ends[0])
        nodes = [self._add_node(ends[along.argmin()]), self._add_node(ends[along.argmax()])]
        return self._add_way(nodes, type="stop_line")

    def _add_node(self, point: FloatArray) -> int:
        number = next(self._next_id)
        self._points[number] = point
        return number

    def _add_way(self, nodes: Iterable[int], **tags: str) -> int:
        number = next(self._next_id)
        way = etree.Element("way", id=str(number), version="1")
        for node in nodes:
            etree.SubElement(way, "nd", ref=str(node))
        self._ways.append(_tag(way, **tags))
        return number


def _classes(size: int, pairs: Sequence[tuple[int, int]]) -> list[int]:
    """Return, for each of ``size`` elements, the number of the class into which the pairs join it."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows, columns = np.array(pairs, int).reshape(-1, 2).T
    _, classes = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), (size, size)), directed=False)
    return [int(number) for number in classes]


def _relation(number: int, members: Iterable[tuple[str, str, int]], **tags: str) -> etree._Element:
    relation = etree.Element("relation", id=str(number), version="1")
    for role, kind, ref in members:
        etree.SubElement(relation, "member", type=kind, ref=str(ref), role=role)
    return _tag(relation, **tags)


def _tag(element: etree._Element, **tags: str) -> etree._Element:
    for key, value in tags.items():
        etree.SubElement(element, "tag", k=key, v=value)
    return element
