"""Sidewalks, cycle lanes and shoulders along streets: tags of the road, or ways of their own.

OpenStreetMap has shoulders on hardly any road (5 of 198 maps have one). AASHTO places kerbs beside slow roads and
shoulders beside the others (:func:`trace_dag.osm.road_classes.is_high_speed`). So a road of 50 mph and more gets the
shoulders of its class: on the right of each direction, and on one-way carriageways also on the left. There are none
where OpenStreetMap excludes them or has something else there: a mapped shoulder or parking lane, a sidewalk, a cycle
lane. There are also none on bridges and in tunnels, whose width is unknown, and beside unpaved roads.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.geometry import FloatArray, arc_lengths
from trace_dag.osm.road_classes import is_crossing, is_high_speed, usual_shoulder_m
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.street_graph import StreetGraph
from trace_dag.roads.from_osm.street_roads import BuiltStreets, StreetRoads
from trace_dag.roads.from_osm.tag_values import NOTHING, SIDEWALK_WIDTH_M, Beside, read_beside
from trace_dag.roads.from_osm.tags import WayProfile
from trace_dag.roads.map.model import LaneType

STEP_M: Final = 4.0  # distance between places at which a sidewalk is compared with the roads
_SAME_WALK_M: Final = 15.0  # a longer gap ends a sidewalk; a driveway does not
_FARTHEST_M: Final = 16.0  # farthest that a sidewalk's way lies from the middle of its street
_WIDEST_VERGE_M: Final = 6.0
_PARALLEL: Final = math.cos(math.radians(20))
_SAID: Final = ("shoulder", "sidewalk", "cycleway")  # "shoulder=no" and "sidewalk=both" say that there is none
_SAYS_NOTHING: Final = frozenset({"no", "none", "separate", "shoulder"})  # of a sidewalk or a cycle lane
_UNPAVED: Final = frozenset(
    {"unpaved", "gravel", "fine_gravel", "compacted", "dirt", "earth", "ground", "grass", "mud", "sand"}
)


class Strip(NamedTuple):
    """A sidewalk, cycle lane or shoulder along a street, from ``begin_m`` to ``end_m`` of its plan.

    ``side`` is +1 on the left, -1 on the right; ``verge_m`` the distance between it and the carriageway.
    """

    type: LaneType
    side: int
    begin_m: float
    end_m: float
    width_m: float
    verge_m: float = 0.0


Strips = dict[int, list[Strip]]  # by street


def strips_along(extract: OsmExtract, graph: StreetGraph, built: BuiltStreets) -> Strips:
    """Return every sidewalk and cycle lane along the streets.

    >>> strips = strips_along(extract, street_graph, street_roads)
    >>> {strip.type.value for found in strips.values() for strip in found}
    {'sidewalk'}
    """
    strips = _tagged(extract, built)
    for street, found in _mapped_sidewalks(extract, graph, built, strips).items():
        strips.setdefault(street, []).extend(found)
    return strips


def _tagged(extract: OsmExtract, built: BuiltStreets) -> Strips:
    """Return the strips in the tags of roads."""
    tags_of = {way.id: way.tags for way in extract.ways}
    said: dict[int, Beside] = {}
    strips: Strips = {}
    for index, made in built.items():
        for span in made.street.spans:
            way_id = span.profile.way_id
            if way_id not in said:
                said[way_id] = read_beside(tags_of.get(way_id, {}), oneway=span.profile.oneway)
            beside = said[way_id].reversed() if span.profile.against_way else said[way_id]
            if beside == NOTHING:
                continue
            begin_m, end_m = made.span_m(span)
            for lane_type, side, width_m in (
                (LaneType.SIDEWALK, 1, beside.sidewalk_left_m),
                (LaneType.SIDEWALK, -1, beside.sidewalk_right_m),
                (LaneType.BIKING, 1, beside.cycle_left_m),
                (LaneType.BIKING, -1, beside.cycle_right_m),
            ):
                if width_m is not None:
                    append_strip(strips.setdefault(index, []), Strip(lane_type, side, begin_m, end_m, width_m))
    return strips


def append_strip(strips: list[Strip], new: Strip) -> None:
    """Add a strip, joined to the strip before it if it continues that one.

    >>> strips = [Strip(LaneType.SIDEWALK, 1, 0.0, 50.0, 1.5)]
    >>> append_strip(strips, Strip(LaneType.SIDEWALK, 1, 50.0, 80.0, 1.5))
    >>> len(strips), strips[0].end_m
    (1, 80.0)
    """
    for number, old in enumerate(strips):
        if new._replace(begin_m=old.begin_m) == old._replace(end_m=new.end_m) and abs(new.begin_m - old.end_m) < 1e-6:
            strips[number] = old._replace(end_m=new.end_m)
            return
    strips.append(new)


def _mapped_sidewalks(extract: OsmExtract, graph: StreetGraph, built: BuiltStreets, tagged: Strips) -> Strips:
    """Return sidewalks that are separate ways, each as part of the street beside it."""
    points, directions = _walked(extract, graph)
    numbers = [index for index, made in built.items() if len(set(made.street.points)) > 1]
    if not len(points) or not numbers:
        return {}
    shapes = [np.array(built[index].street.points) for index in numbers]
    lines = np.asarray(
        shapely.linestrings(np.concatenate(shapes), indices=np.repeat(np.arange(len(shapes)), [len(s) for s in shapes]))
    )
    at = np.asarray(shapely.points(points))
    point, line = shapely.STRtree(lines).query(at, predicate="dwithin", distance=_FARTHEST_M)
    along_m = shapely.line_locate_point(lines[line], at[point])
    here, before, after = (
        shapely.get_coordinates(shapely.line_interpolate_point(lines[line], np.maximum(along_m + ahead, 0.0)))
        for ahead in (0.0, -0.5, 0.5)
    )
    ahead = after - before
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    out = points[point] - here
    parallel = np.abs((directions[point] * ahead).sum(axis=1)) >= _PARALLEL
    abreast = np.abs((out * ahead).sum(axis=1)) < 0.5  # not beyond the street's end
    aside_m = ahead[:, 0] * out[:, 1] - ahead[:, 1] * out[:, 0]
    use = np.flatnonzero(parallel & abreast)
    use = use[np.lexsort((np.abs(aside_m[use]), point[use]))]
    use = use[np.unique(point[use], return_index=True)[1]]  # of several streets the nearest
    places: dict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)
    use = use[np.argsort(line[use], kind="stable")]
    for here_k in filter(len, np.split(use, np.flatnonzero(np.diff(line[use])) + 1)):
        number = line[here_k[0]]
        index = numbers[number]
        stations_m = np.interp(along_m[here_k], arc_lengths(shapes[number]), built[index].plan.vertex_s_m)
        for s_m, t_m in zip(stations_m.tolist(), aside_m[here_k].tolist(), strict=True):
            places[index, 1 if t_m > 0 else -1].append((s_m, abs(t_m)))
    strips: Strips = {}
    for (index, side), found in sorted(places.items()):
        known = [strip for strip in tagged.get(index, ()) if strip.type is LaneType.SIDEWALK and strip.side == side]
        in_order = np.array(sorted(found))
        for run in np.split(in_order, np.flatnonzero(np.diff(in_order[:, 0]) > _SAME_WALK_M) + 1):
            begin_m, end_m = float(run[0, 0]) - STEP_M / 2, float(run[-1, 0]) + STEP_M / 2
            verge_m = _verge_m(built[index], run, side)
            if verge_m is not None and not any(k.begin_m < end_m and k.end_m > begin_m for k in known):
                strip = Strip(LaneType.SIDEWALK, side, begin_m, end_m, SIDEWALK_WIDTH_M, verge_m)
                strips.setdefault(index, []).append(strip)
    return strips


def _walked(extract: OsmExtract, graph: StreetGraph) -> tuple[FloatArray, FloatArray]:
    """Return places along all sidewalks that are separate ways, and the directions there, (n, 2) each."""
    ways = [
        [graph.positions[node] for node in way.node_ids if node in graph.positions]
        for way in extract.walkways
        if not is_crossing(way.tags)
    ]
    ways = [line for line in ways if len(line) > 1]
    if not ways:
        return np.empty((0, 2)), np.empty((0, 2))
    nodes = np.array([point for line in ways for point in line])
    last = np.cumsum([len(line) for line in ways]) - 1
    first = np.concatenate([[0], last[:-1] + 1])
    along_m = arc_lengths(nodes)  # also from one way to the next; only differences within one way are used
    lengths_m = along_m[last] - along_m[first]
    counts = np.maximum(np.ceil((lengths_m - STEP_M / 2) / STEP_M), 0).astype(int)
    counts[lengths_m < STEP_M] = 0
    rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    at_m = np.repeat(along_m[first], counts) + (rank + 0.5) * STEP_M
    before = np.searchsorted(along_m, at_m, side="right") - 1
    before = np.clip(before, np.repeat(first, counts), np.repeat(last - 1, counts))
    step = nodes[before + 1] - nodes[before]
    step /= np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    return nodes[before] + (at_m - along_m[before])[:, None] * step, step


def _verge_m(made: StreetRoads, run: FloatArray, side: int) -> float | None:
    """Return the verge between carriageway and sidewalk (metres), from the medians of a run's places.

    None if the run is not along the street.
    """
    s_m, aside_m = np.median(run, axis=0).tolist()
    spans = made.street.spans
    section = next((span for span in spans if made.span_m(span)[1] >= s_m), spans[-1]).profile.section
    lanes = section.left if side > 0 else section.forward
    edge_m = side * section.offset_m + math.fsum(lane.width_m for lane in lanes)
    verge_m = aside_m - edge_m - SIDEWALK_WIDTH_M / 2
    return max(verge_m, 0.0) if -SIDEWALK_WIDTH_M < verge_m < _WIDEST_VERGE_M else None


# --- shoulders -------------------------------------------------------------------------------------------------------
def shoulders_along(extract: OsmExtract, built: BuiltStreets, others: Strips) -> Strips:
    """Return the shoulders along the streets, where none of the ``others`` lies.

    >>> shoulders_along(extract, street_roads, {})  # the streets of a town have none
    {}
    """
    tags_of = {way.id: way.tags for way in extract.ways}
    shoulders: Strips = {}
    for index, made in built.items():
        for span in made.street.spans:
            profile = span.profile
            if not _has_shoulders(profile):
                continue
            tags = tags_of.get(profile.way_id, {})
            if tags.get("surface") in _UNPAVED or _says_otherwise(tags):
                continue
            begin_m, end_m = made.span_m(span)
            for side in (-1, 1):
                if _is_taken(profile, side):
                    continue
                width_m = usual_shoulder_m(profile.highway, left=profile.oneway and side > 0)
                taken = [(s.begin_m, s.end_m) for s in others.get(index, ()) if s.side == side]
                for low_m, high_m in _between(begin_m, end_m, taken):
                    shoulder = Strip(LaneType.SHOULDER, side, low_m, high_m, width_m)
                    append_strip(shoulders.setdefault(index, []), shoulder)
    return shoulders


def _has_shoulders(profile: WayProfile) -> bool:
    limits = [each for each in (profile.speed_forward_mps, profile.speed_backward_mps) if each is not None]
    plain = not (profile.bridge or profile.tunnel or profile.roundabout or profile.inferred)
    return plain and is_high_speed(profile.highway, max(limits, default=None))


def _says_otherwise(tags: Mapping[str, str]) -> bool:
    """Return whether the tags of a road describe the ground beside it."""
    for key, value in tags.items():
        subject = key.partition(":")[0]
        if subject == "shoulder" or (subject in _SAID and value not in _SAYS_NOTHING):
            return True
    return False


def _is_taken(profile: WayProfile, side: int) -> bool:
    """Return whether the road has lanes other than drivable ones and medians on a side."""
    lanes = profile.section.left if side > 0 else profile.section.forward
    return any(not (lane.type.drivable or lane.type is LaneType.MEDIAN) for lane in lanes)


def _between(begin_m: float, end_m: float, taken: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the free parts of a stretch.

    >>> _between(0.0, 100.0, [(20.0, 30.0), (90.0, 120.0)])
    [(0.0, 20.0), (30.0, 90.0)]
    """
    cuts = [
        (begin_m, begin_m),
        *sorted((max(a, begin_m), min(b, end_m)) for a, b in taken if b > begin_m and a < end_m),
    ]
    return [(a, b) for (_, a), (b, _) in pairwise([*cuts, (end_m, end_m)]) if b > a]
