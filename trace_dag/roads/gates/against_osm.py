"""Measurements of a road map against the OSM extract it was made from: numbers, no judgement.

The network is the one read back from the file. Measurements of the map alone are in
:mod:`trace_dag.roads.gates.measures`, thresholds and outcomes in :mod:`trace_dag.roads.gates.gates`.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.geometry import arc_lengths
from trace_dag.common.messages.wording import count_of
from trace_dag.osm.road_classes import is_drivable
from trace_dag.osm.types import count_arms
from trace_dag.roads.from_osm.street_graph import STUB_M
from trace_dag.roads.from_osm.tags import INFERRED_TAG, read_profile
from trace_dag.roads.gates.measures import SAMPLE_M, distances_to_axes
from trace_dag.roads.map.lane_geometry import sample_lanes
from trace_dag.roads.map.people import crosswalks

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray
    from trace_dag.osm.types import OsmExtract, OsmWay
    from trace_dag.roads.map.model import Road
    from trace_dag.roads.map.network import RoadNetwork

_JUNCTION_MARGIN_M: Final = 2.0
_LONGEST_INNER_WAY_M: Final = 60.0
_LEAST_MISSING_M: Final = 1.0  # at its border a box may leave a few centimetres of a way
_LEAST_ANCHOR_SEGMENT_M: Final = 6.0
_ANCHOR_SPACING_M: Final = 60.0
_LEAST_END_ROAD_M: Final = 30.0


@dataclass(frozen=True)
class WayDeviation:
    """The deviation of the roads from their OSM centre lines, outside junctions, weighted by length."""

    mean_m: float
    worst_m: float
    share_within_1m: float
    length_m: float
    worst_way_id: int | None
    worst_public_m: float
    """Worst deviation of ways that are not service roads."""
    worst_public_way_id: int | None
    missing_way_ids: tuple[int, ...]
    """Ways of more than a metre outside junctions of which no road was made."""
    missing_public_way_ids: tuple[int, ...]


class _Anchor(NamedTuple):
    """A place in OSM and on the map."""

    degrees: tuple[float, float]  # latitude, longitude
    place: tuple[float, float]  # x, y in metres


class MapComparison:
    """One network beside the extract it was made from."""

    def __init__(self, network: RoadNetwork, extract: OsmExtract) -> None:
        self.network = network
        self.extract = extract

    @cached_property
    def ways(self) -> list[OsmWay]:
        """Return the ways vehicles drive on."""
        return [way for way in self.extract.ways if is_drivable(way.tags, service_roads=True)]

    @cached_property
    def _node_xy(self) -> dict[int, tuple[float, float]]:
        nodes = self.extract.nodes
        places = self.extract.local_xy_m(nodes, self.network.frame).tolist()
        return {node_id: (x, y) for node_id, (x, y) in zip(nodes, places, strict=True)}

    def way_line(self, way: OsmWay) -> FloatArray:
        """Return a way's nodes in the local frame, shape (n, 2), repeated points left out."""
        points = np.array([self._node_xy[node_id] for node_id in way.node_ids])
        keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-6])
        return np.asarray(points[keep])

    @cached_property
    def roads_of_way(self) -> dict[int, list[Road]]:
        """Return roads between junctions by the ways they were made of."""
        found: dict[int, list[Road]] = defaultdict(list)
        for road in self.network.roads:
            if road.junction_id is None:
                for way_id in road.osm_way_ids:
                    found[way_id].append(road)
        return found

    @cached_property
    def _fold_of_node(self) -> dict[int, str]:
        """Return junctions where a way folds back, by their nodes.

        No streets meet there, but the way turns more sharply than one road can. The way is still there at such a place,
        unlike at a crossing, where movements replace the centre lines.
        """
        arms = count_arms(self.ways)
        return {
            node_id: junction.id
            for junction in self.network.junctions
            if all(arms[node_id] == 2 for node_id in junction.osm_node_ids)
            for node_id in junction.osm_node_ids
        }

    @cached_property
    def junction_areas(self) -> shapely.Geometry:
        """Return hulls of the crossings, in which movements replace the arms' centre lines.

        A hull holds the surfaces of the movements, the OSM nodes of the junction and the ways between them.
        """
        points: dict[str, list[FloatArray]] = defaultdict(list)
        folds = set(self._fold_of_node.values())
        lanes = [
            (road.junction_id, self.network.geometry(ref))
            for road in self.network.roads
            if road.junction_id is not None and road.junction_id not in folds
            for ref in self.network.drivable_lanes_of(road)
        ]
        sample_lanes(geometry for _, geometry in lanes)
        for junction_id, geometry in lanes:
            points[junction_id] += [line[:, :2] for line in geometry.borders()]
        for junction_id, inner in self._inner_ways().items():
            points[junction_id].append(inner)
        hulls = np.array([], dtype=object)
        if points:
            together = [np.concatenate(lines) for lines in points.values()]
            owner = np.repeat(np.arange(len(together)), [len(each) for each in together])
            hulls = np.asarray(shapely.convex_hull(shapely.multipoints(np.concatenate(together), indices=owner)))
        areas = shapely.union_all(shapely.buffer(hulls, _JUNCTION_MARGIN_M))
        shapely.prepare(areas)
        return areas

    def _inner_ways(self) -> dict[str, FloatArray]:
        """Return nodes of each crossing, and of the short pieces of way between its nodes."""
        neighbours: dict[int, list[int]] = defaultdict(list)
        for way in self.ways:
            for a, b in pairwise(way.node_ids):
                neighbours[a].append(b)
                neighbours[b].append(a)
        found = {}
        for junction in self.network.junctions:
            nodes = {i for i in junction.osm_node_ids if i in neighbours and i not in self._fold_of_node}
            inner = {i for start in nodes for i in self._paths_between(start, nodes, neighbours)}
            if nodes:
                found[junction.id] = np.array([self._node_xy[i] for i in sorted(nodes | inner)])
        return found

    def _paths_between(self, start: int, nodes: set[int], neighbours: dict[int, list[int]]) -> Iterator[int]:
        """Yield nodes on short unbranched paths from ``start`` to another of ``nodes``."""
        for first in neighbours[start]:
            path, length_m = [start, first], math.dist(self._node_xy[start], self._node_xy[first])
            while path[-1] not in nodes and len(neighbours[path[-1]]) == 2 and length_m < _LONGEST_INNER_WAY_M:
                a, b = neighbours[path[-1]]
                path.append(b if a == path[-2] else a)
                length_m += math.dist(self._node_xy[path[-2]], self._node_xy[path[-1]])
            if path[-1] in nodes and length_m < _LONGEST_INNER_WAY_M:
                yield from path

    def way_deviation(self) -> WayDeviation:
        """Return the distance of every way, metre by metre, to the axes of its own roads, outside junctions.

        The axis is the reference line or, on one-way roads, the middle of the lanes, whichever is nearer: converters
        differ in which of the two they lay along the way.
        """
        missing: list[OsmWay] = []
        known: list[tuple[OsmWay, FloatArray]] = []  # ways with the points that are outside junctions
        for way, line, points, is_outside in self._points_of_ways():
            outside = points[is_outside]
            if not self.roads_of_way.get(way.id):
                if arc_lengths(line)[-1] * len(outside) / len(points) > _LEAST_MISSING_M:
                    missing.append(way)
            elif len(outside):
                known.append((way, outside))
        roads = [[*self.roads_of_way[way.id], *self._roads_through_folds(way)] for way, _ in known]
        distances = distances_to_axes(self.network, roads, [outside for _, outside in known])
        worst: dict[bool, tuple[float, int | None]] = {False: (0.0, None), True: (0.0, None)}
        for (way, _), distance in zip(known, distances, strict=True):
            service = way.tags.get("highway") == "service"
            worst[service] = max(worst[service], (round(float(distance.max()), 6), way.id), key=lambda found: found[0])
        every = np.concatenate(distances) if distances else np.zeros(0)
        return WayDeviation(
            mean_m=float(every.mean()) if len(every) else 0.0,
            worst_m=max(distance for distance, _ in worst.values()),
            share_within_1m=float(np.mean(every <= 1.0)) if len(every) else 1.0,
            length_m=len(every) * SAMPLE_M,
            worst_way_id=max(worst.values(), key=lambda found: found[0])[1],
            worst_public_m=worst[False][0],
            worst_public_way_id=worst[False][1],
            missing_way_ids=tuple(way.id for way in missing),
            missing_public_way_ids=tuple(way.id for way in missing if way.tags.get("highway") != "service"),
        )

    def ways_without_road(self) -> dict[int, str]:
        """Return, by way id, the reason why a way has neither a road nor a movement along it."""
        made = {way_id for road in self.network.roads for way_id in road.osm_way_ids}
        junction_of = {node_id: each.id for each in self.network.junctions for node_id in each.osm_node_ids}
        found = {}
        for way in self.ways:
            if way.id in made or INFERRED_TAG in way.tags:
                continue
            line, segments = self.way_line(way), _segments(way)
            length_m = float(arc_lengths(line)[-1]) if len(line) > 1 else 0.0
            others = [other.id for other in self.ways if other.id != way.id and segments <= _segments(other)]
            within = {junction_of[node_id] for node_id in way.node_ids if node_id in junction_of}
            if others:
                found[way.id] = f"lies on way {others[0]}"
            elif length_m <= STUB_M:
                found[way.id] = f"is {length_m:.1f} m long, less than can be driven along"
            elif within and shapely.covers(self.junction_areas, shapely.linestrings(line)):
                found[way.id] = f"lies within junction {min(within)}, through which no movement leads along it"
            else:
                found[way.id] = "no road could be made of it"
        return found

    def _points_of_ways(self) -> Iterator[tuple[OsmWay, FloatArray, FloatArray, NDArray[np.bool_]]]:
        """Yield each way with its line, the points along it, and a mask of the points outside junctions."""
        # A way that was drawn has no original.
        lines = [(way, self.way_line(way)) for way in self.ways if INFERRED_TAG not in way.tags]
        found = [(way, line, _resampled(line)) for way, line in lines if len(line) > 1]
        if not found:
            return
        places = np.concatenate([points for _, _, points in found])
        outside = ~shapely.contains_xy(self.junction_areas, places[:, 0], places[:, 1])
        ends = np.cumsum([len(points) for _, _, points in found])
        for (way, line, points), is_outside in zip(found, np.split(outside, ends[:-1]), strict=True):
            yield way, line, points, is_outside

    def _roads_through_folds(self, way: OsmWay) -> list[Road]:
        """Return the connecting roads of the folds that a way passes or ends at."""
        folds = {self._fold_of_node[node_id] for node_id in way.node_ids if node_id in self._fold_of_node}
        return [road for road in self.network.roads if road.junction_id in folds] if folds else []

    def crosswalk_distances(self) -> list[tuple[float, int]]:
        """Return, for each crosswalk, the distance of its OSM node from its outline (0 inside, m) and the node's id."""
        return [
            (place.distance_m(*self._node_xy[node_id]), node_id)
            for place in crosswalks(self.network)
            if (node_id := place.crosswalk.osm_node_id) in self._node_xy
        ]

    def lanes_against_tags(self) -> tuple[int, dict[str, str]]:
        """Return the number of roads with a tagged lane count, and the differences by road id.

        A road made of one way is compared in the middle, where no lane opens or closes for a junction.
        """
        by_id = {way.id: way for way in self.ways}
        profile_of = cache(lambda way_id: read_profile(by_id[way_id]))  # a way between two crossings is several roads
        compared, differing = 0, {}
        for road in self.network.roads:
            if road.junction_id is not None or len(road.osm_way_ids) != 1 or road.osm_way_ids[0] not in by_id:
                continue
            profile = profile_of(road.osm_way_ids[0])
            if not profile.lanes_from_tags:
                continue
            compared += 1
            tagged = sum(lane.type.drivable for lane in (*profile.section.left, *profile.section.forward))
            section = road.lane_sections[road.section_at(road.length_m / 2)]
            count = sum(lane.type.drivable for lane in section.lanes if lane.id != 0)
            if count != tagged:
                lanes = count_of(count, "lane")
                differing[road.id] = f"road {road.id} has {lanes}, way {road.osm_way_ids[0]} is tagged {tagged}"
        return compared, differing

    def geodesic_anchors(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return well-spread places of OSM and their positions on the map.

        They are (n, 2) latitude and longitude, and (n, 2) x and y.

        The first are the nodes at which a way ends alone. On the map they are the open ends of roads, so they show
        every error of scale and position. If these are few, places inside straight segments are added. On the map they
        are the nearest points of the way's own road, so they only show errors across the road.
        """
        ends = self._end_anchors()
        chosen = [ends[i] for i in _spread([place for _, place in ends], count)]
        if len(chosen) < count:
            inside = self._segment_anchors()
            known = [place for _, place in chosen]
            chosen += [inside[i] for i in _spread([place for _, place in inside], count - len(chosen), known)]
        if not chosen:
            return np.zeros((0, 2)), np.zeros((0, 2))
        return np.array([degrees for degrees, _ in chosen]), np.array([place for _, place in chosen])

    def _end_anchors(self) -> list[_Anchor]:
        """Return nodes at which one way ends and no other passes, and the nearest open road end.

        Short ways and short last segments are left out, because ways that a box cuts off are lengthened and smoothed.
        """
        uses = Counter(node_id for way in self.ways for node_id in dict.fromkeys(way.node_ids))
        found: list[_Anchor] = []
        for way in self.ways:
            line = self.way_line(way)
            if len(line) < 2 or arc_lengths(line)[-1] < _LEAST_END_ROAD_M:
                continue
            open_ends = [(end, road) for road in self.roads_of_way.get(way.id, ()) for end in self._open_ends(road)]
            for node_id, inward in ((way.node_ids[0], line[1]), (way.node_ids[-1], line[-2])):
                here = self._node_xy[node_id]
                if uses[node_id] > 1 or not open_ends or math.dist(here, inward) < _LEAST_ANCHOR_SEGMENT_M:
                    continue
                if shapely.contains_xy(self.junction_areas, *here):
                    continue
                place, road = min(open_ends, key=lambda end: math.dist(end[0], here))
                if road.length_m > _LEAST_END_ROAD_M and math.dist(place, here) < _ANCHOR_SPACING_M:
                    node = self.extract.nodes[node_id]
                    found.append(_Anchor((node.latitude_deg, node.longitude_deg), place))
        return found

    def _open_ends(self, road: Road) -> Iterator[tuple[float, float]]:
        line = self.network.road_geometry(road.id).line
        for _, s_m, link in road.ends:
            if link is None:
                x, y, _, _ = line.at(s_m)
                yield x, y

    def _segment_anchors(self) -> list[_Anchor]:
        """Return places every 60 m inside the ways' segments, outside junctions."""
        found: list[_Anchor] = []
        for way in self.ways:
            roads = self.roads_of_way.get(way.id)
            if not roads:
                continue
            for a, b in pairwise(way.node_ids):
                here, there = np.array(self._node_xy[a]), np.array(self._node_xy[b])
                length_m = math.dist(here, there)
                if length_m < _LEAST_ANCHOR_SEGMENT_M:
                    continue
                first, last = self.extract.nodes[a], self.extract.nodes[b]
                pieces = math.ceil(length_m / _ANCHOR_SPACING_M)
                for share in (np.arange(pieces) + 0.5) / pieces:
                    place = here + share * (there - here)
                    if not shapely.contains_xy(self.junction_areas, *place):
                        latitude = first.latitude_deg + share * (last.latitude_deg - first.latitude_deg)
                        longitude = first.longitude_deg + share * (last.longitude_deg - first.longitude_deg)
                        found.append(_Anchor((latitude, longitude), self._place_on(roads, place)))
        return found

    def _place_on(self, roads: Sequence[Road], xy_m: FloatArray) -> tuple[float, float]:
        feet = []
        for road in roads:
            line = self.network.road_geometry(road.id).line
            x, y, _, _ = line.at(line.project(float(xy_m[0]), float(xy_m[1])).s_m)
            feet.append((x, y))
        return min(feet, key=lambda foot: math.dist(foot, xy_m))


def _segments(way: OsmWay) -> set[frozenset[int]]:
    return {frozenset(pair) for pair in pairwise(way.node_ids)}


def _resampled(line: FloatArray) -> FloatArray:
    along = arc_lengths(line)
    at = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / SAMPLE_M) + 1))
    return np.column_stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])])


def _spread(places: Sequence[tuple[float, float]], count: int, known: Sequence[tuple[float, float]] = ()) -> list[int]:
    """Return indices of places far from each other and from the known ones, by farthest-point sampling."""
    if not places or count < 1:
        return []
    points = np.array(places)
    start = np.array(known) if known else points.mean(axis=0)[None]
    distance = np.min(np.hypot(points[:, None, 0] - start[:, 0], points[:, None, 1] - start[:, 1]), axis=1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(points)) and (distance.max() > 1.0 or not (chosen or known)):
        latest = int(np.argmax(distance))
        chosen.append(latest)
        to_latest = np.hypot(*(points - points[latest]).T)
        distance = to_latest if len(chosen) == 1 and not known else np.minimum(distance, to_latest)
    return chosen
