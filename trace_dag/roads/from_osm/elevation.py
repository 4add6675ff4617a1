"""Heights of the roads: from layers, bridges and tunnels, and from ``ele`` and ``incline`` where they are tagged.

OpenStreetMap shows which road passes over which, but seldom heights. So the ground is level (or follows the tags). A
road that passes over another is raised by one storey at the crossing, a tunnel is lowered by one. From there each road
returns to the ground with a usual grade: among all heights that satisfy the crossings and the grade, each place gets
the one nearest to the ground (a McShane extension on the graph of roads). Roads share their height and slope where they
are linked; a junction is level. Along a road the heights are a monotone cubic spline, so that value and slope are
continuous and nothing overshoots.

Sources: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), 7.2.2 and 8.2.9: grades of 5 to 8 % by
class and terrain, vertical clearance 16 ft (4.9 m); the structure itself takes about a metre.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray, hermite
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.height_graph import HeightGraph, HeightProfile, NodeId, ground_heights, has_height_tags
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.model import ContactPoint, Cubic, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.separations import Separation, find_separations

STOREY_M: Final = 6.0
"""Height between the surfaces of two roads of which one passes over the other: clearance and structure."""

# A cubic between level ends is half again as steep in its middle as its chord: 5.3 % here stay below 8 % there.
_STEEPEST_CHORD: Final = 0.053
_TIGHT_STOREY_M: Final = 4.7  # where roads are tied too closely for more


class _Attempt(NamedTuple):
    """Grade of chords, height of a storey, and whether the level part at a crossing shrinks to its middle."""

    grade: float
    storey_m: float = STOREY_M
    tight: bool = False


_ATTEMPTS: Final = (  # from what a road builder would like to what he can do
    _Attempt(0.03),
    _Attempt(0.04),
    _Attempt(_STEEPEST_CHORD),
    _Attempt(_STEEPEST_CHORD, tight=True),
    _Attempt(_STEEPEST_CHORD, _TIGHT_STOREY_M, tight=True),
)
_ROUNDS: Final = 20
_REACHED_M: Final = 0.01
_NODE_SPACING_M: Final = 15.0
_LEAST_SPACING_M: Final = 4.0
_SAME_M: Final = 1e-5  # two pieces of a height profile that differ by less are one
_CROSSING_MARGIN_M: Final = 8.0  # the height of a crossing holds this far beyond its point, across the other's lanes


def elevate(network: RoadNetwork, extract: OsmExtract) -> RoadNetwork:
    """Return the network with heights; unchanged if no road needs a height."""
    separated = find_separations(network, between_levels=True)
    sloped = has_height_tags(extract)
    if not separated and not sloped:
        return network
    marks: dict[str, list[tuple[float, float]]] = defaultdict(list)  # road: station, half length of the level part
    for crossing in separated:
        for road, other, s_m in zip(crossing.roads, crossing.roads[::-1], crossing.s_m, strict=True):
            half_m = (_half_width_m(other) + _CROSSING_MARGIN_M) / max(math.sin(crossing.angle_rad), 0.3)
            marks[road.id].append((s_m, half_m))
    graph = HeightGraph(network, {road.id: _stations(road, marks[road.id]) for road in network.roads})
    ground = ground_heights(network, graph, extract, _STEEPEST_CHORD) if sloped else np.zeros(len(graph))
    for attempt in _ATTEMPTS:
        pairs = [_pair(graph, crossing, marks, attempt.tight) for crossing in separated]
        heights, reached = _separate(graph, pairs, ground, attempt)
        if reached:
            break
    slopes = _slopes(graph, heights)
    roads = {
        profile.road.id: replace(profile.road, elevation=_spline(profile, heights, slopes[profile.road.id]))
        for profile in graph.profiles.values()
    }
    levels = {
        (road_id, contact): (float(heights[profile.nodes[index]]), slopes[road_id][index])
        for road_id, profile in graph.profiles.items()
        for contact, index in ((ContactPoint.START, 0), (ContactPoint.END, -1))
    }
    for road in network.roads:
        if road.junction_id is not None:
            roads[road.id] = replace(road, elevation=_between_links(road, levels))
    return replace(network, roads=tuple(roads[road.id] for road in network.roads))


def _half_width_m(road: Road) -> float:
    """Return the extent of the carriageway from the reference line to its wider side, at most."""
    sides = [0.0]
    for section in road.lane_sections:
        for sign in (1, -1):
            sides.append(math.fsum(lane.widths[0].a for lane in section.lanes if lane.id * sign > 0 and lane.widths))
    return max(sides)


def _stations(road: Road, marks: Sequence[tuple[float, float]]) -> list[float]:
    """Return the stations of a road's height nodes: evenly spaced, and denser at its crossings."""
    pieces = max(1, math.ceil(road.length_m / _NODE_SPACING_M))
    even = [road.length_m * i / pieces for i in range(pieces + 1)]
    wanted = sorted({s for centre, half in marks for s in (centre - half, centre, centre + half)})
    stations = [s for s in wanted if _LEAST_SPACING_M < s < road.length_m - _LEAST_SPACING_M]
    stations = [s for i, s in enumerate(stations) if i == 0 or s - stations[i - 1] >= _LEAST_SPACING_M]
    stations += [s for s in even[1:-1] if all(abs(s - t) >= _NODE_SPACING_M / 2 for t in stations)]
    return [0.0, *sorted(stations), road.length_m]


def _nodes_near(
    graph: HeightGraph, road: Road, s_m: float, marks: Sequence[tuple[float, float]], tight: bool
) -> list[NodeId]:
    """Return nodes within the level part at a crossing, or just the nearest; for a connecting road, its junction."""
    if road.junction_id is not None:
        node = graph.junction_node(road.junction_id)
        return [] if node is None else [node]
    profile = graph.profiles[road.id]
    half_m = 0.0 if tight else next(half for centre, half in marks if centre == s_m)
    within = [n for n, s in zip(profile.nodes, profile.s_m, strict=True) if abs(s - s_m) <= half_m + 1e-6]
    return within or [min(zip(profile.nodes, profile.s_m, strict=True), key=lambda pair: abs(pair[1] - s_m))[0]]


class _Pair(NamedTuple):
    """Nodes of two roads, of which the first passes over the second, and the one that leaves the ground."""

    upper: list[NodeId]
    lower: list[NodeId]
    upper_rises: bool


def _pair(
    graph: HeightGraph, crossing: Separation, marks: Mapping[str, Sequence[tuple[float, float]]], tight: bool
) -> _Pair:
    (upper, upper_s), (lower, lower_s) = sorted(
        zip(crossing.roads, crossing.s_m, strict=True), key=lambda place: -place[0].level
    )
    return _Pair(
        _nodes_near(graph, upper, upper_s, marks[upper.id], tight),
        _nodes_near(graph, lower, lower_s, marks[lower.id], tight),
        upper.level > 0,
    )


def _separate(
    graph: HeightGraph, pairs: Sequence[_Pair], ground: FloatArray, attempt: _Attempt
) -> tuple[FloatArray, bool]:
    """Return heights within the attempt's grade, nearest to the ground, with a storey between every pair.

    If a pair lacks height, its upper road is raised (or its lower one lowered) by the difference; the effect on other
    pairs shows in the next round. The flag is true if all pairs have a storey.
    """
    least: dict[NodeId, float] = {}
    most: dict[NodeId, float] = {}
    heights, reached = ground, False
    for _ in range(_ROUNDS):
        floor = -graph.extended({node: -height for node, height in least.items()}, attempt.grade)
        ceiling = graph.extended(most, attempt.grade)
        heights = np.minimum(np.maximum(ground, floor), ceiling)
        reached = True
        for pair in pairs:
            if not pair.upper or not pair.lower:
                continue
            upper_m = float(heights[pair.upper].min())
            lower_m = float(heights[pair.lower].max())
            missing_m = lower_m + attempt.storey_m - upper_m
            if missing_m <= _REACHED_M:
                continue
            reached = False
            for node in pair.upper if pair.upper_rises else pair.lower:
                if pair.upper_rises:
                    least[node] = max(least.get(node, -math.inf), upper_m + missing_m)
                else:
                    most[node] = min(most.get(node, math.inf), lower_m - missing_m)
        if reached:
            break
    return heights, reached


def _slopes(graph: HeightGraph, heights: FloatArray) -> dict[str, list[float]]:
    """Return the slope at each height node along each road.

    They are Fritsch and Carlson's harmonic means, which do not overshoot.
    """
    secants = {
        road_id: np.diff(heights[profile.nodes]) / np.diff(profile.s_m) for road_id, profile in graph.profiles.items()
    }
    slopes: dict[str, list[float]] = {}
    for road_id, profile in graph.profiles.items():
        own = secants[road_id]
        inner = [_harmonic(a, b) for a, b in pairwise(own)]
        ends = [
            _end_slope(graph, secants, profile.nodes[0 if start else -1], road_id, start) for start in (True, False)
        ]
        slopes[road_id] = [ends[0], *inner, ends[1]]
    return slopes


def _end_slope(
    graph: HeightGraph, secants: Mapping[str, FloatArray], node: NodeId, road_id: str, at_start: bool
) -> float:
    """Return the slope at a road's end, along the road.

    It is level at junctions, and shared with the one road that continues it.
    """
    own = float(secants[road_id][0 if at_start else -1])
    if node in graph.junction_nodes:
        return 0.0
    others = [end for end in graph.shared_ends[node] if end != (road_id, at_start)]
    if len(others) != 1:
        return own if not others else 0.0
    other_id, other_at_start = others[0]
    beyond = float(secants[other_id][0 if other_at_start else -1])
    if other_at_start == at_start:  # the two run against each other
        beyond = -beyond
    return _harmonic(own, beyond)


def _harmonic(a: float, b: float) -> float:
    return 2 * a * b / (a + b) if a * b > 0 else 0.0


def _spline(profile: HeightProfile, heights: FloatArray, slopes: Sequence[float]) -> tuple[Cubic, ...]:
    z = heights[profile.nodes]
    pieces = [
        Cubic(s_a, *hermite(s_b - s_a, float(z[i]), float(z[i + 1]), slopes[i], slopes[i + 1]))
        for i, (s_a, s_b) in enumerate(pairwise(profile.s_m))
    ]
    kept: list[Cubic] = []
    for piece, end_s in zip(pieces, profile.s_m[1:], strict=True):
        if not kept or not _continues(kept[-1], piece, end_s - piece.s_m):
            kept.append(piece)
    return tuple(kept)


def _continues(before: Cubic, piece: Cubic, length_m: float) -> bool:
    """Return whether a piece continues the cubic of the previous one for a length."""
    continued = CubicProfile.of([before]).coefficients_at(piece.s_m)
    own = (piece.a, piece.b, piece.c, piece.d)
    return (
        math.fsum(abs(x - y) * length_m**power for power, (x, y) in enumerate(zip(continued, own, strict=True)))
        < _SAME_M
    )


def _between_links(road: Road, levels: Mapping[tuple[str, ContactPoint], tuple[float, float]]) -> tuple[Cubic, ...]:
    """Return a connecting road's height: a cubic between the heights and slopes at the ends of its two roads."""
    ends = []
    for contact, _, link in road.ends:
        z_m, slope = (0.0, 0.0)
        if link is not None and link.contact_point is not None:
            z_m, slope = levels.get((link.element_id, link.contact_point), (0.0, 0.0))
        runs_against = link is not None and link.contact_point is contact
        ends.append((z_m, -slope if runs_against else slope))
    (z_a, slope_a), (z_b, slope_b) = ends
    return (Cubic(0.0, *hermite(road.length_m, z_a, z_b, slope_a, slope_b)),)
