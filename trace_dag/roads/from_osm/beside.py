"""Sidewalks and cycle lanes: where OpenStreetMap has them beside a street, as tags of the road or as ways of their own.

They are laid outside the lanes that traffic drives in, once those are finished, so that no road changes its place for
them: cycle lanes next to the traffic, sidewalks outermost, with what lies between carriageway and sidewalk as a lane
without content. Where the carriageway of another road lies, there is neither. None goes through a junction.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.geometry import FloatArray, arc_lengths
from trace_dag.osm.types import OsmExtract
from trace_dag.osm.walkways import is_crossing
from trace_dag.roads.from_osm.beside_tags import NOTHING, SIDEWALK_WIDTH_M, Beside, read_beside
from trace_dag.roads.from_osm.carriageways import on_carriageways
from trace_dag.roads.from_osm.street_graph import Street, StreetGraph
from trace_dag.roads.from_osm.street_roads import StreetRoads
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import PlanView, plan_pose
from trace_dag.roads.map.model import Cubic, Lane, LaneType, Road, RoadMark

_END_M: Final = 1.0  # length over which a sidewalk begins and ends
_LEAST_M: Final = 8.0  # a shorter one is left out
_STEP_M: Final = 4.0  # between places at which a sidewalk is compared with the roads
_SAME_WALK_M: Final = 15.0  # places of one sidewalk are no further apart: it goes on past a driveway
_FARTHEST_M: Final = 16.0  # of a sidewalk's way from the middle of its street
_WIDEST_VERGE_M: Final = 6.0
_PARALLEL: Final = math.cos(math.radians(20))
_NO_MARK: Final = RoadMark("none", "standard", "none")
_EDGE: Final = RoadMark("solid", "white", "none")


class _Strip(NamedTuple):
    """A sidewalk or cycle lane along a street, from ``begin_m`` to ``end_m`` of its plan. ``side`` is +1 on the left,
    -1 on the right; ``verge_m`` the width of what lies between it and the carriageway."""

    type: LaneType
    side: int
    begin_m: float
    end_m: float
    width_m: float
    verge_m: float = 0.0


_Strips = dict[int, list[_Strip]]  # by street


def with_lanes_beside(
    roads: Sequence[Road],
    extract: OsmExtract,
    graph: StreetGraph,
    plans: Sequence[PlanView],
    built: Mapping[int, StreetRoads],
) -> tuple[Road, ...]:
    """``roads``, finished, with the sidewalks and cycle lanes that OpenStreetMap has beside them.

    ``built`` has the roads of each street as they were before heights and links.
    """
    strips = _tagged(extract, graph.streets, plans, built)
    for street, found in _mapped_sidewalks(extract, graph, plans, built, strips).items():
        strips.setdefault(street, []).extend(found)
    if not strips:
        return tuple(roads)
    by_id = {road.id: road for road in roads}
    chains = {
        index: _Chain(plans[index], [by_id[road.id] for road in built[index].roads], built[index].begins_m)
        for index in strips
    }
    changed: dict[str, Road] = {}
    for index, clear in _clear_of_roads(strips, chains, roads).items():
        changed |= {road.id: road for road in chains[index].with_strips(clear)}
    return tuple(changed.get(road.id, road) for road in roads)


# --- what OpenStreetMap has ------------------------------------------------------------------------------------------
def _tagged(
    extract: OsmExtract, streets: Sequence[Street], plans: Sequence[PlanView], built: Mapping[int, StreetRoads]
) -> _Strips:
    """What the tags of roads say."""
    tags_of = {way.id: way.tags for way in extract.ways}
    said: dict[int, Beside] = {}
    strips: _Strips = {}
    for index in built:
        for span in streets[index].spans:
            way_id = span.profile.way_id
            if way_id not in said:
                tags = tags_of.get(way_id, {})
                against = tags.get("oneway") in ("-1", "reverse")
                said[way_id] = read_beside(tags, oneway=span.profile.oneway, against_way=against)
            beside = said[way_id].reversed() if span.profile.against_way else said[way_id]
            if beside == NOTHING:
                continue
            begin_m, end_m = (plans[index].vertex_s_m[k] for k in (span.first, span.last))
            for lane_type, side, width_m in (
                (LaneType.SIDEWALK, 1, beside.sidewalk_left_m),
                (LaneType.SIDEWALK, -1, beside.sidewalk_right_m),
                (LaneType.BIKING, 1, beside.cycle_left_m),
                (LaneType.BIKING, -1, beside.cycle_right_m),
            ):
                if width_m is not None:
                    _append(strips.setdefault(index, []), _Strip(lane_type, side, begin_m, end_m, width_m))
    return strips


def _append(strips: list[_Strip], new: _Strip) -> None:
    """Add a strip, or what it goes on with the strip before it."""
    for number, old in enumerate(strips):
        if new._replace(begin_m=old.begin_m) == old._replace(end_m=new.end_m) and abs(new.begin_m - old.end_m) < 1e-6:
            strips[number] = old._replace(end_m=new.end_m)
            return
    strips.append(new)


def _mapped_sidewalks(
    extract: OsmExtract,
    graph: StreetGraph,
    plans: Sequence[PlanView],
    built: Mapping[int, StreetRoads],
    tagged: _Strips,
) -> _Strips:
    """Sidewalks that are ways of their own, each as part of the street that it runs along."""
    points, directions = _walked(extract, graph)
    if not len(points):
        return {}
    numbers = [index for index in built if len(set(graph.streets[index].points)) > 1]
    lines = np.array([shapely.LineString(graph.streets[index].points) for index in numbers])
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
    for k in use.tolist():
        index = numbers[line[k]]
        street_m = arc_lengths(np.array(graph.streets[index].points))
        s_m = float(np.interp(along_m[k], street_m, plans[index].vertex_s_m))
        places[index, 1 if aside_m[k] > 0 else -1].append((s_m, abs(float(aside_m[k]))))
    strips: _Strips = {}
    for (index, side), found in sorted(places.items()):
        known = [strip for strip in tagged.get(index, ()) if strip.type is LaneType.SIDEWALK and strip.side == side]
        for run in _runs(sorted(found), _SAME_WALK_M):
            begin_m, end_m = run[0][0] - _STEP_M / 2, run[-1][0] + _STEP_M / 2
            verge_m = _verge_m(graph.streets[index], plans[index], run, side)
            if verge_m is not None and not any(k.begin_m < end_m and k.end_m > begin_m for k in known):
                strip = _Strip(LaneType.SIDEWALK, side, begin_m, end_m, SIDEWALK_WIDTH_M, verge_m)
                strips.setdefault(index, []).append(strip)
    return strips


def _walked(extract: OsmExtract, graph: StreetGraph) -> tuple[FloatArray, FloatArray]:
    """Places along all sidewalks that are ways of their own, and the directions there, (n, 2) each."""
    points, directions = [np.empty((0, 2))], [np.empty((0, 2))]
    for way in extract.walkways:
        if is_crossing(way.tags):
            continue
        line = np.array([graph.positions[node] for node in way.node_ids if node in graph.positions])
        if len(line) < 2:
            continue
        along_m = arc_lengths(line)
        if along_m[-1] < _STEP_M:
            continue
        at_m = np.arange(_STEP_M / 2, along_m[-1], _STEP_M)
        first = np.clip(np.searchsorted(along_m, at_m, side="right") - 1, 0, len(line) - 2)
        step = line[first + 1] - line[first]
        step /= np.maximum(np.hypot(*step.T), 1e-9)[:, None]
        points.append(line[first] + (at_m - along_m[first])[:, None] * step)
        directions.append(step)
    return np.concatenate(points), np.concatenate(directions)


def _runs(places: Sequence[tuple[float, float]], longest_gap_m: float) -> Iterator[list[tuple[float, float]]]:
    """Places in order of their first number, parted where that leaps."""
    run: list[tuple[float, float]] = []
    for place in places:
        if run and place[0] - run[-1][0] > longest_gap_m:
            yield run
            run = []
        run.append(place)
    if run:
        yield run


def _verge_m(street: Street, plan: PlanView, run: Sequence[tuple[float, float]], side: int) -> float | None:
    """What is between carriageway and sidewalk, by the middle of a run's places; None for one that runs elsewhere."""
    s_m, aside_m = np.median(np.array(run), axis=0).tolist()
    span = next((span for span in street.spans if plan.vertex_s_m[span.last] >= s_m), street.spans[-1])
    section = span.profile.section
    lanes = section.left if side > 0 else section.forward
    edge_m = side * section.offset_m + sum(lane.width_m for lane in lanes)
    verge_m = aside_m - edge_m - SIDEWALK_WIDTH_M / 2
    return max(verge_m, 0.0) if -SIDEWALK_WIDTH_M < verge_m < _WIDEST_VERGE_M else None


# --- the finished roads of a street ----------------------------------------------------------------------------------
class _Piece(NamedTuple):
    """A lane section of a street: its road and number there, and where it lies along the street."""

    road: Road
    section: int
    begin_m: float
    end_m: float


class _Chain:
    """The roads of one street, one after the other."""

    def __init__(self, plan: PlanView, roads: Sequence[Road], begins_m: Sequence[float]) -> None:
        self.plan = plan
        self.roads = roads
        self.begin_m, self.end_m = begins_m[0], begins_m[-1] + roads[-1].length_m
        self._pieces: list[_Piece] = []
        self._offsets: dict[str, CubicProfile] = {}
        self._edges: dict[tuple[int, int, bool], CubicProfile] = {}  # by piece, side, and whether to drive in
        for road, start_m in zip(roads, begins_m, strict=True):
            self._offsets[road.id] = CubicProfile.of(road.lane_offset, origin_m=start_m)
            ends = [*(section.s_m for section in road.lane_sections[1:]), road.length_m]
            for number, (section, end_m) in enumerate(zip(road.lane_sections, ends, strict=True)):
                self._pieces.append(_Piece(road, number, start_m + section.s_m, start_m + end_m))

    def edge_m(self, s_m: float, side: int, *, drivable: bool) -> float:
        """Distance of the edge of the lanes of one side, or of those to drive in, from the street's plan."""
        number = next((k for k, piece in enumerate(self._pieces) if piece.end_m >= s_m), len(self._pieces) - 1)
        edge = self._edges.get((number, side, drivable))
        if edge is None:
            edge = self._edges[number, side, drivable] = self._edge(self._pieces[number], side, drivable=drivable)
        return edge.at(s_m)

    def _edge(self, piece: _Piece, side: int, *, drivable: bool) -> CubicProfile:
        widths = [
            (1.0, CubicProfile.of(lane.widths, origin_m=piece.begin_m))
            for lane in piece.road.lane_sections[piece.section].lanes
            if lane.id * side > 0 and (lane.type.drivable or lane.type is LaneType.MEDIAN or not drivable)
        ]
        return CubicProfile.weighted_sum([(float(side), self._offsets[piece.road.id]), *widths])

    def with_strips(self, strips: Sequence[_Strip]) -> Iterator[Road]:
        """The roads with the strips as lanes."""
        new = [{side: _Outside.of(piece, strips, side) for side in (1, -1)} for piece in self._pieces]
        sections: dict[str, list[tuple[Lane, ...]]] = defaultdict(list)
        for number, piece in enumerate(self._pieces):
            lanes = [lane for lane in piece.road.lane_sections[piece.section].lanes if lane.id == 0]
            for side in (1, -1):
                before = new[number - 1][side] if number else None
                after = new[number + 1][side] if number + 1 < len(new) else None
                lanes += new[number][side].lanes(before, after)
            sections[piece.road.id].append(tuple(sorted(lanes, key=lambda lane: -lane.id)))
        for road in self.roads:
            made = (replace(s, lanes=lanes) for s, lanes in zip(road.lane_sections, sections[road.id], strict=True))
            yield replace(road, lane_sections=tuple(made))


class _New(NamedTuple):
    """A lane to be added to a section: its type, widths, and width at its two ends."""

    type: LaneType
    widths: tuple[Cubic, ...]
    start_m: float
    end_m: float


class _Outside:
    """One side of a lane section: its own lanes and those that are new, outward."""

    def __init__(self, own: Sequence[Lane], new: Mapping[str, _New], side: int) -> None:
        self._new = new
        inner = 1 + max(
            (k for k, lane in enumerate(own) if lane.type.drivable or lane.type is LaneType.MEDIAN), default=-1
        )
        cycle, walk = [[key for key in keys if key in new] for keys in (("cycle",), ("verge", "walk"))]
        order: list[Lane | str] = [*own[:inner], *cycle, *own[inner:], *walk]
        self._order = [(side * number, each) for number, each in enumerate(order, 1)]
        self._id_of_new = {each: lane_id for lane_id, each in self._order if isinstance(each, str)}
        self._id_of_own = {each.id: lane_id for lane_id, each in self._order if isinstance(each, Lane)}

    @classmethod
    def of(cls, piece: _Piece, strips: Sequence[_Strip], side: int) -> _Outside:
        """One side of a piece of a street with its share of the strips."""
        lanes = piece.road.lane_sections[piece.section].lanes
        own = sorted((lane for lane in lanes if lane.id * side > 0), key=lambda lane: abs(lane.id))
        here = [
            s for s in strips if s.side == side and s.begin_m < piece.end_m - 1e-6 and s.end_m > piece.begin_m + 1e-6
        ]
        walks = [(s, s.width_m) for s in here if s.type is LaneType.SIDEWALK]
        verges = [(s, s.verge_m) for s in here if s.type is LaneType.SIDEWALK and s.verge_m > 0]
        cycles = [(s, s.width_m) for s in here if s.type is LaneType.BIKING]
        new = {}
        kinds = (
            ("cycle", LaneType.BIKING, cycles),
            ("verge", LaneType.NONE, verges),
            ("walk", LaneType.SIDEWALK, walks),
        )
        for key, lane_type, some in kinds:
            if some:
                widths = _widths(some, piece.begin_m, piece.end_m)
                profile = CubicProfile.of(widths)
                ends = profile.at(0.0), profile.at(piece.end_m - piece.begin_m)
                new[key] = _New(lane_type, widths, *ends)
        return cls(own, new, side)

    def lanes(self, before: _Outside | None, after: _Outside | None) -> Iterator[Lane]:
        """The lanes, linked to those of the sections before and after."""
        for lane_id, each in self._order:
            if isinstance(each, Lane):
                yield replace(
                    each,
                    id=lane_id,
                    predecessor=before._id_of_own.get(each.predecessor)
                    if before and each.predecessor
                    else each.predecessor,
                    successor=after._id_of_own.get(each.successor) if after and each.successor else each.successor,
                )
                continue
            new = self._new[each]
            yield Lane(
                lane_id,
                new.type,
                new.widths,
                predecessor=before._id_of_new.get(each)
                if before and before._reaches_end(each) and new.start_m
                else None,
                successor=after._id_of_new.get(each) if after and after._reaches_start(each) and new.end_m else None,
                mark=_EDGE if new.type is LaneType.BIKING else _NO_MARK,
            )

    def _reaches_end(self, key: str) -> bool:
        return key in self._new and self._new[key].end_m > 0

    def _reaches_start(self, key: str) -> bool:
        return key in self._new and self._new[key].start_m > 0


def _widths(strips: Sequence[tuple[_Strip, float]], begin_m: float, end_m: float) -> tuple[Cubic, ...]:
    """Width along a section of a lane that is there where the strips are, as cubics from the section's begin on."""
    cubics: list[Cubic] = []
    for strip, width_m in sorted(strips):
        low_m, high_m = max(strip.begin_m, begin_m), min(strip.end_m, end_m)
        ease_m = min(_END_M, (high_m - low_m) / 2)
        if strip.begin_m > begin_m:
            if not cubics:
                cubics.append(Cubic(0.0, 0.0))
            slope = 3 * width_m / ease_m**2, -2 * width_m / ease_m**3
            cubics.append(Cubic(low_m - begin_m, 0.0, 0.0, *slope))
            cubics.append(Cubic(low_m + ease_m - begin_m, width_m))
        else:
            cubics.append(Cubic(0.0, width_m))
        if strip.end_m < end_m:
            slope = -3 * width_m / ease_m**2, 2 * width_m / ease_m**3
            cubics.append(Cubic(high_m - ease_m - begin_m, width_m, 0.0, *slope))
            cubics.append(Cubic(high_m - begin_m, 0.0))
    # What ends where the next begins is one record.
    return tuple({round(cubic.s_m, 6): cubic for cubic in cubics}.values())


# --- room for them ---------------------------------------------------------------------------------------------------
class _Sample(NamedTuple):
    """A place of a strip: its street, its number among the street's strips, and how far along the street."""

    street: int
    strip: int
    s_m: float


def _clear_of_roads(strips: _Strips, chains: Mapping[int, _Chain], roads: Sequence[Road]) -> _Strips:
    """The strips where no other road's lanes are, none of them shorter than the least."""
    samples: list[_Sample] = []
    edges: list[tuple[float, float]] = []
    for index, of_street in strips.items():
        chain = chains[index]
        for number, strip in enumerate(of_street):
            low_m, high_m = max(strip.begin_m, chain.begin_m), min(strip.end_m, chain.end_m)
            if high_m - low_m < _LEAST_M:
                continue
            for s_m in np.linspace(low_m, high_m, math.ceil((high_m - low_m) / _STEP_M) + 1).tolist():
                x, y, heading = plan_pose(chain.plan, s_m)
                inner_m = chain.edge_m(s_m, strip.side, drivable=strip.type is LaneType.BIKING) + strip.verge_m
                samples.append(_Sample(index, number, s_m))
                for out_m in (inner_m, inner_m + strip.width_m):
                    t_m = strip.side * out_m
                    edges.append((x - t_m * math.sin(heading), y + t_m * math.cos(heading)))
    if not samples:
        return {}
    own = {index: {road.id for road in chain.roads} for index, chain in chains.items()}
    level = {index: chain.roads[0].level for index, chain in chains.items()}
    blocked = [False] * len(samples)
    for edge, road in on_carriageways(np.array(edges), roads):
        sample = samples[edge // 2]
        if road.id not in own[sample.street] and road.level == level[sample.street]:
            blocked[edge // 2] = True
    places: dict[tuple[int, int], list[list[float]]] = defaultdict(list)
    last: tuple[int, int] | None = None
    for sample, is_blocked in zip(samples, blocked, strict=True):
        key = sample.street, sample.strip
        if is_blocked:
            last = None
            continue
        if last != key:
            places[key].append([])
        places[key][-1].append(sample.s_m)
        last = key
    clear: _Strips = {}
    for (index, number), runs in places.items():
        for run in runs:
            if run[-1] - run[0] >= _LEAST_M:
                strip = strips[index][number]
                clear.setdefault(index, []).append(strip._replace(begin_m=run[0], end_m=run[-1]))
    return clear
