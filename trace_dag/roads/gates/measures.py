"""Measurements of a road map against itself, and its axes: numbers, no judgement.

The network is the one read back from the file. Measurements against OpenStreetMap are in
:mod:`trace_dag.roads.gates.against_osm`, thresholds and outcomes in :mod:`trace_dag.roads.gates.gates`.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np
import shapely

from trace_dag.common.units import wrap_angle
from trace_dag.roads.map.lane_geometry import lane_ends, sample_at, sample_lanes
from trace_dag.roads.map.lane_index import polygon
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.reference_line import Stations, sample_reference_lines, stations_between
from trace_dag.roads.map.separations import Separation

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import Road
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.map.reference_line import ReferenceLine

_TURN_STEP_M: Final = 0.25
_BESIDE_STEP_M: Final = 5.0
_COARSE_M: Final = 0.5  # more than a lane and its surface as a polygon are apart
_THERE_M: Final = 0.3  # a lane narrower than this is only beginning or ending
SAMPLE_M: Final = 1.0
"""Points of a curved axis are at most so far apart."""


class LinkGap(NamedTuple):
    """Steps between one lane and the next, as a driver would meet them."""

    position_m: float
    height_m: float
    heading_rad: float
    source: LaneRef
    target: LaneRef


def link_gaps(network: RoadNetwork) -> list[LinkGap]:
    """Return gaps at every link between drivable lanes, sections and junctions included."""
    refs = network.drivable_lanes()
    if not refs:
        return []
    lanes = [network.geometry(ref) for ref in refs]
    poses = sample_at(lanes, lane_ends(lanes)).reshape(-1, 2, 4)
    against = np.array([lane.direction < 0 for lane in lanes])
    poses[against] = poses[against, ::-1]
    ends = dict(zip(refs, poses.tolist(), strict=True))
    gaps = []
    for ref in refs:
        _, leave = ends[ref]
        for target in network.successors(ref):
            enter, _ = ends[target]
            gaps.append(
                LinkGap(
                    math.hypot(enter[0] - leave[0], enter[1] - leave[1]),
                    abs(enter[2] - leave[2]),
                    abs(wrap_angle(enter[3] - leave[3])),
                    ref,
                    target,
                )
            )
    return gaps


class LanesBeside(NamedTuple):
    """Sidewalks and cycle lanes.

    Their total length, the share of places along their middle where vehicles drive at the same level, and the road with
    most such places.
    """

    length_m: float
    share_on_roadway: float
    worst_road_id: str | None


def lanes_beside(network: RoadNetwork) -> LanesBeside:
    """Return measures of the sidewalks and cycle lanes of a map, at every five metres.

    Cycle lanes in junctions are left out, because traffic that turns right drives across them.

    >>> lanes_beside(network).share_on_roadway
    0.0
    """
    lanes, stations = [], []
    for ref in network.lanes():
        lane_type, in_junction = network.lane(ref).type, network.road_by_id[ref.road_id].junction_id is not None
        if lane_type is not LaneType.SIDEWALK and (lane_type is not LaneType.BIKING or in_junction):
            continue
        geometry = network.geometry(ref)
        there_m = geometry.road.line.stations(_BESIDE_STEP_M, geometry.begin_m, geometry.end_m)
        there_m = there_m[geometry.width.sample(there_m) >= _THERE_M]
        if len(there_m):
            lanes.append(ref)
            stations.append(there_m)
    if not lanes:
        return LanesBeside(0.0, 0.0, None)
    counts = np.array([len(each) for each in stations])
    owner = np.repeat(np.arange(len(lanes)), counts)
    at = Stations(np.concatenate(stations), owner, np.cumsum(counts) - counts)
    places = sample_at([network.geometry(ref) for ref in lanes], at)[:, :3]
    wrong: Counter[str] = Counter()
    for index in _near_drivable(network, places).tolist():
        x_m, y_m, z_m = places[index].tolist()
        matches = network.nearest_lanes(x_m, y_m, 0.0, z_m=z_m)
        wrong[lanes[owner[index]].road_id] += any(match.outside_m <= 0.0 for match in matches)
    worst = wrong.most_common(1)
    length_m = _BESIDE_STEP_M * float((counts - 1).sum())
    return LanesBeside(length_m, wrong.total() / len(places), worst[0][0] if worst else None)


def _near_drivable(network: RoadNetwork, places: FloatArray) -> NDArray[np.intp]:
    """Return the numbers of places, (n, 3), that may lie on a lane for vehicles; only these need an exact test."""
    lanes = [network.geometry(ref) for ref in network.drivable_lanes()]
    sample_lanes(lanes)
    surfaces = shapely.STRtree([polygon(lane) for lane in lanes])
    pairs = surfaces.query(shapely.points(places[:, :2]), predicate="dwithin", distance=_COARSE_M)
    return np.unique(pairs[0])


def one_sided_links(network: RoadNetwork) -> dict[LaneRef, str]:
    """Return lanes whose next lane does not name them back, inside and between roads, with a description.

    >>> one_sided_links(network)
    {}
    """
    found = {}
    for ref in network.drivable_lanes():
        road = network.road_by_id[ref.road_id]
        geometry = network.geometry(ref)
        forward = geometry.direction > 0
        last = ref.section == (len(road.lane_sections) - 1 if forward else 0)
        link = road.successor if forward else road.predecessor
        if last and (road.junction_id is not None or link is None or link.element_type != "road"):
            continue  # an arm names the junction, and the junction's connections name its lanes
        for target in network.successors(ref):
            lane = network.lane(target)
            back = lane.predecessor if network.direction(target) > 0 else lane.successor
            if back is None:
                found[ref] = f"{_named(ref)} leads into {_named(target)}, which names no lane back"
    return found


def find_stranded_lanes(network: RoadNetwork) -> list[str]:
    """Return full-width lanes that end at a junction or another road without a movement into it.

    Bidirectional and closed lanes (narrower than 1 m) may end anywhere.

    >>> find_stranded_lanes(network)
    []
    """
    found = []
    for ref in network.drivable_lanes():
        geometry = network.geometry(ref)
        road = network.road_by_id[ref.road_id]
        forward = geometry.direction > 0
        if geometry.lane.type.value == "bidirectional" or network.successors(ref):
            continue
        end_m = geometry.end_m if forward else geometry.begin_m
        inside = 0 <= ref.section + geometry.direction < len(road.lane_sections)
        link = road.successor if forward else road.predecessor
        if (inside or link is not None) and geometry.width.at(end_m) > 1.0:
            found.append(f"{_named(ref)} leads nowhere at s={end_m:.0f}")
    return found


def _named(ref: LaneRef) -> str:
    return f"lane {ref.lane_id} of road {ref.road_id}, section {ref.section}"


Extreme: TypeAlias = tuple[float, str | None]
"""The worst value of a map's roads, and its road; None if no road has one."""


def tightest_turns(network: RoadNetwork) -> tuple[Extreme, Extreme]:
    """Return the least radius (m) of the lanes through junctions, and that of U-turns (``u_turn``).

    It is infinite if all are straight.

    >>> turns, u_turns = tightest_turns(network)
    >>> turns[0] < 10, u_turns  # corners of the crossing; no U-turn
    (True, (inf, None))
    """
    refs = [ref for road in network.roads if road.junction_id is not None for ref in network.drivable_lanes_of(road)]
    tightest: dict[bool, Extreme] = dict.fromkeys((False, True), (math.inf, None))
    if refs:
        lanes = [network.geometry(ref) for ref in refs]
        spans_m = np.array([(lane.begin_m, lane.end_m) for lane in lanes])
        stations = stations_between(spans_m[:, 0], spans_m[:, 1], _TURN_STEP_M)
        steps = np.diff(sample_at(lanes, stations), axis=0)
        turned = np.abs(steps[:, 3])
        radii_m = np.hypot(steps[:, 0], steps[:, 1]) / np.maximum(turned, 1e-9)
        # A step from the end of a lane to the beginning of the next is none; the last lane is followed by nothing.
        radii_m[stations.first[1:] - 1], turned[stations.first[1:] - 1] = math.inf, 0.0
        least_m = np.minimum.reduceat(radii_m, stations.first)
        least_m[np.maximum.reduceat(turned, stations.first) == 0.0] = math.inf
        for ref, radius_m in zip(refs, least_m.tolist(), strict=True):
            u_turn = network.road_by_id[ref.road_id].turn == "u_turn"
            if radius_m < tightest[u_turn][0]:
                tightest[u_turn] = radius_m, ref.road_id
    return min(tightest.values()), tightest[True]


def shortest_element(network: RoadNetwork) -> Extreme:
    """Return the length (m) of the shortest piece of a reference line, and the road it is in."""
    return min(
        ((element.length_m, road.id) for road in network.roads for element in road.plan), default=(math.inf, None)
    )


def steepest_grades(network: RoadNetwork) -> tuple[Extreme, Extreme]:
    """Return the largest absolute grade (rise over run) of main roads, and that of ramps and driveways.

    Ramps and driveways are ``*_link``, ``service`` and their movements.

    >>> steepest_grades(network)  # the town's plan is flat here
    ((0.0, None), (0.0, None))
    """
    minor = {road.id for road in network.roads if road.is_ramp or road.highway == "service"}
    for road in network.roads:
        if road.junction_id is not None and not minor.isdisjoint(road.linked_roads):
            minor.add(road.id)
    steepest: dict[bool, Extreme] = dict.fromkeys((False, True), (0.0, None))
    for road in network.roads:
        geometry = network.road_geometry(road.id)
        if geometry.elevation.constant is not None:
            continue
        grade = float(np.abs(geometry.elevation.sample_slope(geometry.line.stations(1.0))).max())
        if grade > steepest[road.id in minor][0]:
            steepest[road.id in minor] = grade, road.id
    return steepest[False], steepest[True]


def clearance_m(network: RoadNetwork, crossing: Separation) -> float:
    """Return the height between the surfaces of two roads that cross without meeting."""
    one, other = (
        network.road_geometry(road.id).height_at(s_m) for road, s_m in zip(crossing.roads, crossing.s_m, strict=True)
    )
    return abs(one - other)


# --- axes of roads ---------------------------------------------------------------------------------------------------
def distances_to_axes(
    network: RoadNetwork, roads: Sequence[Sequence[Road]], points: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the distance (m) of each of the points, (n, 2), to the nearest axis of its roads.

    The axes are the reference line and, on one-way roads, the middle of the lanes too.

    >>> road = network.road_by_id[map_report.placement.road_id]
    >>> beginning = np.array([[road.plan[0].x_m, road.plan[0].y_m]])
    >>> [distances.round(6).tolist() for distances in distances_to_axes(network, [[road]], [beginning])]
    [[0.0]]
    """
    if not points:
        return []
    axes = _axes(network, {road.id: road for some in roads for road in some}.values())
    lines = [[line for road in some for line in axes[road.id]] for some in roads]
    places, line = _flat([line for some in lines for line in some])
    owner_of_line = np.repeat(np.arange(len(lines)), [len(some) for some in lines])
    each = np.asarray(shapely.linestrings(places, indices=line))
    together = np.asarray(shapely.multilinestrings(each, indices=owner_of_line))
    every, owner = _flat(points)
    distances = shapely.distance(together[owner], shapely.points(every))
    return np.split(distances, np.cumsum([len(some) for some in points])[:-1])


def _axes(network: RoadNetwork, roads: Iterable[Road]) -> dict[str, list[FloatArray]]:
    """Return the axes of some roads as points, by road id."""
    wanted = list(roads)
    lines = [network.road_geometry(road.id).line for road in wanted]
    one_way = [road.one_way for road in wanted]
    s_m, owner = _flat([_stations(line, everywhere) for line, everywhere in zip(lines, one_way, strict=True)])
    stations = Stations(s_m, owner, np.flatnonzero(np.diff(owner, prepend=-1)))
    sampled = sample_reference_lines(lines, stations)
    found = {}
    for road, has_middle, where in zip(wanted, one_way, stations.slices, strict=True):
        points = sampled[where]
        found[road.id] = [points[:, :2]]
        if has_middle:
            t = _middle_of_lanes(network, road, s_m[where])
            x, y = points[:, 0] - t * np.sin(points[:, 2]), points[:, 1] + t * np.cos(points[:, 2])
            found[road.id].append(np.column_stack([x, y]))
    return found


def _stations(line: ReferenceLine, everywhere: bool) -> FloatArray:
    """Return the stations where a line's pieces begin, and one per metre in curves, or ``everywhere``."""
    starts = line.table[0]
    stations = line.stations(SAMPLE_M)
    if not everywhere and not line.has_cubics:
        piece = np.maximum(np.searchsorted(starts, stations, side="right") - 1, 0)
        stations = stations[(line.table[4][piece] != 0.0) | (stations == line.length_m)]
    return np.union1d(stations, starts)


def _middle_of_lanes(network: RoadNetwork, road: Road, stations_m: FloatArray) -> FloatArray:
    """Return ``t`` of the middle of the drivable lanes."""
    middle = np.zeros(len(stations_m))
    for index, section in enumerate(road.lane_sections):
        here = stations_m >= section.s_m
        borders = []
        for lane in section.lanes:
            if lane.id and lane.type.drivable:
                geometry = network.geometry(LaneRef(road.id, index, lane.id))
                centre, half = geometry.centre.sample(stations_m[here]), geometry.width.sample(stations_m[here]) / 2
                borders += [centre - half, centre + half]
        if borders:
            middle[here] = (np.max(borders, axis=0) + np.min(borders, axis=0)) / 2
    return middle


def _flat(parts: Sequence[FloatArray]) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the concatenated arrays, and for each row the index of its array."""
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
