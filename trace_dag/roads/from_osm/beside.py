"""Sidewalks, cycle lanes and usual shoulders beside the roads of a street.

They are laid outside the finished lanes of the traffic, so that no road moves for them: cycle lanes next to the
traffic, then shoulders, sidewalks outermost. The verge between carriageway and sidewalk is a lane of type "none". They
are left out on another road's carriageway; a shoulder leaves room for that road's shoulder, too. Shoulders end at
junctions; the others go through them on roads of their own (:mod:`trace_dag.roads.from_osm.corners`).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.carriageways import Carriageways
from trace_dag.roads.from_osm.lanes import LEGAL_EDGE, NOT_CROSSED
from trace_dag.roads.from_osm.street_graph import StreetGraph
from trace_dag.roads.from_osm.street_roads import BuiltStreets, StreetRoads
from trace_dag.roads.from_osm.strips import STEP_M, Strip, Strips, shoulders_along, strips_along
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import along_arcs
from trace_dag.roads.map.model import Cubic, Lane, LaneType, Road

_END_M: Final = 1.0  # length over which a sidewalk begins and ends
_LEAST_M: Final = 8.0  # a shorter one is left out
_SHOULDER_STEP_M: Final = 2 * STEP_M
_FOLDS: Final = 0.9  # distance of an edge from the line over its radius
_FOLD_MARGIN_M: Final = _SHOULDER_STEP_M  # places are looked at no closer than that
_HAIR_M: Final = 0.1
"""Width of such a lane along those parts of its lane section where it is not: readers that make a polygon of each lane
(Scenic 3) refuse one without any."""
_TO_JUNCTION_M: Final = 8.0  # a strip that ends this near to a junction goes on to it


def add_lanes_beside(
    roads: Sequence[Road], extract: OsmExtract, graph: StreetGraph, built: BuiltStreets, carriageways: Carriageways
) -> tuple[Road, ...]:
    """Return ``roads``, finished, with sidewalks, cycle lanes and usual shoulders beside them.

    ``carriageways`` are those of ``roads``.
    """
    strips = strips_along(extract, graph, built)
    for index, found in shoulders_along(extract, built, strips).items():
        strips.setdefault(index, []).extend(found)
    if not strips:
        return tuple(roads)
    by_id = {road.id: road for road in roads}
    chains = {index: _Chain(built[index], by_id) for index in strips}
    changed: dict[str, Road] = {}
    for index, clear in _clear_of_roads(strips, chains, carriageways).items():
        changed |= {road.id: road for road in chains[index].with_strips(clear)}
    return tuple(changed.get(road.id, road) for road in roads)


# --- the finished roads of a street ----------------------------------------------------------------------------------
class _Piece(NamedTuple):
    """A lane section of a street: its road and number there, and where it lies along the street."""

    road: Road
    section: int
    begin_m: float
    end_m: float


class _Chain:
    """The roads of one street, one after the other."""

    def __init__(self, made: StreetRoads, finished: Mapping[str, Road]) -> None:
        self.roads = [finished[road.id] for road in made.roads]
        self.begin_m, self.end_m = made.begins_m[0], made.begins_m[-1] + self.roads[-1].length_m
        self.level = self.roads[0].level
        self._pieces: list[_Piece] = []
        self._offsets: dict[str, CubicProfile] = {}
        self._edges: dict[tuple[int, int, bool], CubicProfile] = {}  # by piece, side, and whether to drive in
        for road, start_m in zip(self.roads, made.begins_m, strict=True):
            self._offsets[road.id] = CubicProfile.of(road.lane_offset, origin_m=start_m)
            ends = [*(section.s_m for section in road.lane_sections[1:]), road.length_m]
            for number, (section, end_m) in enumerate(zip(road.lane_sections, ends, strict=True)):
                self._pieces.append(_Piece(road, number, start_m + section.s_m, start_m + end_m))

        self._piece_ends_m = np.array([piece.end_m for piece in self._pieces])
        self._elements = np.array([(e.s_m, e.x_m, e.y_m, e.heading_rad, e.curvature_1pm) for e in made.plan.elements]).T

    def edges_m(self, s_m: FloatArray, side: int, *, drivable: bool) -> FloatArray:
        """Return the distance of the edge of one side's lanes, or of its drivable lanes, from the street's plan."""
        numbers = np.minimum(np.searchsorted(self._piece_ends_m, s_m), len(self._pieces) - 1)
        found = np.empty(len(s_m))
        for number in np.unique(numbers).tolist():
            edge = self._edges.get((number, side, drivable))
            if edge is None:
                edge = self._edges[number, side, drivable] = self._edge(self._pieces[number], side, drivable=drivable)
            found[numbers == number] = edge.sample(s_m[numbers == number])
        return found

    def places(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y and heading of the street's plan at stations."""
        begins_m, x, y, heading, curvature = self._elements
        k = np.maximum(np.searchsorted(begins_m, s_m, side="right") - 1, 0)
        return along_arcs(x[k], y[k], heading[k], s_m - begins_m[k], curvature[k])

    def reach_m(self, strip: Strip) -> tuple[float, float]:
        """Return the ends of a strip within the roads, extended to a junction just beyond."""
        begins, ends = (link is not None for link in (self.roads[0].predecessor, self.roads[-1].successor))
        low_m, high_m = max(strip.begin_m, self.begin_m), min(strip.end_m, self.end_m)
        if begins and low_m - self.begin_m <= _TO_JUNCTION_M:
            low_m = self.begin_m
        if ends and self.end_m - high_m <= _TO_JUNCTION_M:
            high_m = self.end_m
        return low_m, high_m

    def folds(self, s_m: FloatArray, strip: Strip, others: Sequence[Strip]) -> NDArray[np.bool_]:
        """Return a mask of the places where a strip is inside a bend too tight for its outer edge.

        It is assumed that all ``others`` may lie further in.
        """
        out_m = self.edges_m(s_m, strip.side, drivable=strip.type is LaneType.BIKING) + strip.verge_m + strip.width_m
        if strip.type is LaneType.SIDEWALK:
            out_m += max((o.width_m for o in others if o.side == strip.side and o.type is not strip.type), default=0.0)
        begins_m, _, _, _, curvature = self._elements
        ends_m = np.append(begins_m[1:], np.inf)
        blocked = np.zeros(len(s_m), bool)
        for k in np.flatnonzero(strip.side * curvature * out_m.max() > _FOLDS):
            blocked |= (s_m > begins_m[k] - _FOLD_MARGIN_M) & (s_m < ends_m[k] + _FOLD_MARGIN_M)
        return blocked

    def road_ids(self) -> frozenset[str]:
        """Return the street's own roads."""
        return frozenset(road.id for road in self.roads)

    def _edge(self, piece: _Piece, side: int, *, drivable: bool) -> CubicProfile:
        widths = [
            (1.0, CubicProfile.of(lane.widths, origin_m=piece.begin_m))
            for lane in piece.road.lane_sections[piece.section].lanes
            if lane.id * side > 0 and (lane.type.drivable or lane.type is LaneType.MEDIAN or not drivable)
        ]
        return CubicProfile.weighted_sum([(float(side), self._offsets[piece.road.id]), *widths])

    def with_strips(self, strips: Sequence[Strip]) -> Iterator[Road]:
        """Yield the roads with the strips as lanes."""
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
    """One side of a lane section: its own lanes and the new ones, outward."""

    def __init__(self, own: Sequence[Lane], new: Mapping[str, _New], side: int) -> None:
        self._new = new
        inner = 1 + max(
            (k for k, lane in enumerate(own) if lane.type.drivable or lane.type is LaneType.MEDIAN), default=-1
        )
        cycle, outer = [[key for key in keys if key in new] for keys in (("cycle",), ("shoulder", "verge", "walk"))]
        order: list[Lane | str] = [*own[:inner], *cycle, *own[inner:], *outer]
        self._order = [(side * number, each) for number, each in enumerate(order, 1)]
        added = [(lane_id, each) for lane_id, each in self._order if isinstance(each, str)]
        self._new_at_start = {each: lane_id for lane_id, each in added if new[each].start_m > _HAIR_M}
        self._new_at_end = {each: lane_id for lane_id, each in added if new[each].end_m > _HAIR_M}
        self._id_of_own = {each.id: lane_id for lane_id, each in self._order if isinstance(each, Lane)}

    @classmethod
    def of(cls, piece: _Piece, strips: Sequence[Strip], side: int) -> _Outside:
        """Return one side of a part of a street with its parts of the strips."""
        lanes = piece.road.lane_sections[piece.section].lanes
        own = sorted((lane for lane in lanes if lane.id * side > 0), key=lambda lane: abs(lane.id))
        here = [
            s for s in strips if s.side == side and s.begin_m < piece.end_m - 1e-6 and s.end_m > piece.begin_m + 1e-6
        ]
        walks = [(s, s.width_m) for s in here if s.type is LaneType.SIDEWALK]
        # The verge ends after the sidewalk has closed: if they ended together, the sidewalk would be drawn towards the
        # street.
        verges = [
            (s._replace(begin_m=s.begin_m - _END_M, end_m=s.end_m + _END_M), s.verge_m)
            for s in here
            if s.type is LaneType.SIDEWALK and s.verge_m > 0
        ]
        cycles = [(s, s.width_m) for s in here if s.type is LaneType.BIKING]
        shoulders = [(s, s.width_m) for s in here if s.type is LaneType.SHOULDER]
        new = {}
        kinds = (
            ("cycle", LaneType.BIKING, cycles),
            ("shoulder", LaneType.SHOULDER, shoulders),
            ("verge", LaneType.NONE, verges),
            ("walk", LaneType.SIDEWALK, walks),
        )
        for key, lane_type, some in kinds:
            if some:
                least_m = 0.0 if lane_type is LaneType.NONE else _HAIR_M
                widths = _widths(some, piece.begin_m, piece.end_m, least_m)
                profile = CubicProfile.of(widths)
                ends = profile.at(0.0), profile.at(piece.end_m - piece.begin_m)
                new[key] = _New(lane_type, widths, *ends)
        return cls(own, new, side)

    def lanes(self, before: _Outside | None, after: _Outside | None) -> Iterator[Lane]:
        """Yield the lanes, linked to those of the previous and next section."""
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
                predecessor=before._new_at_end.get(each) if before and each in self._new_at_start else None,
                successor=after._new_at_start.get(each) if after and each in self._new_at_end else None,
                mark=LEGAL_EDGE if new.type is LaneType.BIKING else NOT_CROSSED,
            )


def _widths(strips: Sequence[tuple[Strip, float]], begin_m: float, end_m: float, least_m: float) -> tuple[Cubic, ...]:
    """Return the width of a lane along a section, as cubics: its own along the strips, else ``least_m``."""
    cubics: list[Cubic] = []
    for strip, width_m in sorted(strips):
        low_m, high_m = max(strip.begin_m, begin_m), min(strip.end_m, end_m)
        ease_m = min(_END_M, (high_m - low_m) / 2)
        if strip.begin_m > begin_m:
            if not cubics:
                cubics.append(Cubic(0.0, least_m))
            cubics.append(Cubic.between(low_m - begin_m, least_m, width_m, ease_m))
            cubics.append(Cubic(low_m + ease_m - begin_m, width_m))
        else:
            cubics.append(Cubic(0.0, width_m))
        if strip.end_m < end_m:
            cubics.append(Cubic.between(high_m - ease_m - begin_m, width_m, least_m, ease_m))
            cubics.append(Cubic(high_m - begin_m, least_m))
    # Cubics that end where the next begins are one record.
    return tuple({round(cubic.s_m, 6): cubic for cubic in cubics}.values())


# --- room for them ---------------------------------------------------------------------------------------------------
class _Samples(NamedTuple):
    """Places of a strip: its street, its number among the street's strips, and the stations along the street."""

    street: int
    strip: int
    s_m: FloatArray


def _clear_of_roads(strips: Strips, chains: Mapping[int, _Chain], carriageways: Carriageways) -> Strips:
    """Return the parts of strips clear of other roads' lanes, without those below the least length."""
    samples: list[_Samples] = []
    edges: list[FloatArray] = []
    for index, of_street in strips.items():
        chain = chains[index]
        for number, strip in enumerate(of_street):
            low_m, high_m = chain.reach_m(strip)
            if high_m - low_m < _LEAST_M:
                continue
            step_m = _SHOULDER_STEP_M if strip.type is LaneType.SHOULDER else STEP_M
            s_m = np.linspace(low_m, high_m, math.ceil((high_m - low_m) / step_m) + 1)
            x, y, heading = chain.places(s_m)
            inner_m = chain.edges_m(s_m, strip.side, drivable=strip.type is LaneType.BIKING) + strip.verge_m
            if strip.type is LaneType.SHOULDER:
                inner_m = inner_m + strip.width_m  # as much again is kept free for another road's
            samples.append(_Samples(index, number, s_m))
            for out_m in (inner_m, inner_m + strip.width_m):
                t_m = strip.side * out_m
                edges.append(np.stack([x - t_m * np.sin(heading), y + t_m * np.cos(heading)], axis=1))
    if not samples:
        return {}
    begins = np.cumsum([0, *(len(each) for each in edges)])
    strip_of = np.repeat(np.arange(len(edges)) // 2, np.diff(begins))
    blocked = [chains[index].folds(s_m, strips[index][number], strips[index]) for index, number, s_m in samples]
    own = {index: chain.road_ids() for index, chain in chains.items()}
    for edge, road in carriageways.at(np.concatenate(edges)):
        number = strip_of[edge]
        index = samples[number].street
        if road.id not in own[index] and not _leaves(road, own[index]) and road.level == chains[index].level:
            half = len(samples[number].s_m)
            blocked[number][(edge - begins[2 * number]) % half] = True
    clear: Strips = {}
    for (index, number, s_m), is_blocked in zip(samples, blocked, strict=True):
        for run in _free_runs(is_blocked):
            begin_m, end_m = s_m[run[0]].item(), s_m[run[-1]].item()
            if end_m - begin_m >= _LEAST_M:
                strip = strips[index][number]
                clear.setdefault(index, []).append(strip._replace(begin_m=begin_m, end_m=end_m))
    return clear


def _leaves(road: Road, street: Collection[str]) -> bool:
    """Return whether a road of a junction ends at the sidewalks of a street's roads."""
    return road.junction_id is not None and any(road_id in street for road_id in road.linked_roads)


def _free_runs(blocked: NDArray[np.bool_]) -> list[NDArray[np.int_]]:
    """Return runs of places that are not blocked, by their numbers."""
    free = np.flatnonzero(~blocked)
    return [run for run in np.split(free, np.flatnonzero(np.diff(free) > 1) + 1) if len(run)]
