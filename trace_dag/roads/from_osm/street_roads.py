"""The roads of one street: stretches of one name, class and structure, with their lane sections."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeAlias

from trace_dag.roads.from_osm.lanes import EndLane, SectionLanes, Stretch, build_sections
from trace_dag.roads.from_osm.street_graph import Span, Street
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import PlanView, cut_plan, drop_slivers
from trace_dag.roads.map.model import Cubic, LaneType, Road

INFERRED_NAME: Final = "Driveway inferred from the crash report"
_LEAST_STRETCH_M: Final = 10.0  # shorter stretches of a road have the lanes of their neighbour
_LEAST_ROAD_M: Final = 3.0  # if less than this is left of a way after the cuts, it belongs to its neighbour
_LEAST_PAINTED_M: Final = 5.0  # the same if turns are painted on the lanes
_TURN_LANES_M: Final = 25.0  # least length of a stretch at a junction whose lanes differ from those before
_LEAST_TAPER_RATIO: Final = 2.5  # least length of a taper per metre that lanes shift sideways
_TAPER_RATIO: Final = 5.0  # the same where there is room
_NOT_CARRIAGEWAY: Final = frozenset({LaneType.SIDEWALK, LaneType.NONE})


@dataclass
class StreetRoads:
    """A street, its plan, the roads made of it with their first stations along the plan, and the lanes at its ends."""

    street: Street
    plan: PlanView
    roads: list[Road]
    begins_m: list[float]
    start_lanes: tuple[EndLane, ...]
    end_lanes: tuple[EndLane, ...]

    def road_at(self, s_m: float) -> tuple[Road, float]:
        """Return the road at a station of the plan, and the station at which that road begins."""
        number = max((k for k, begin_m in enumerate(self.begins_m) if begin_m <= s_m), default=0)
        return self.roads[number], self.begins_m[number]

    def span_m(self, span: Span) -> tuple[float, float]:
        """Return the stations of the plan at which a span of the street begins and ends."""
        return self.plan.vertex_s_m[span.first], self.plan.vertex_s_m[span.last]


BuiltStreets: TypeAlias = Mapping[int, StreetRoads]
"""The streets that have roads, by their number in the graph; the roads have no heights and links yet."""


def build_street_roads(
    street: Street, plan: PlanView, trims: tuple[float, float], new_id: Callable[[], str], *, returns: bool = False
) -> StreetRoads:
    """Return roads of a street that is cut back by ``trims`` at its two ends.

    A street that ``returns`` to its first junction becomes at least two roads, because a junction names incoming roads
    rather than their ends (OpenDRIVE 1.7, 10.2, ``incomingRoad``).

    >>> (road,) = build_street_roads(street_graph.streets[0], plans[0], (10.0, 5.0), lambda: "7").roads
    >>> road.id, round(plans[0].length_m - road.length_m, 6)  # cut back by 10 m and 5 m
    ('7', 15.0)
    """
    merged = _stretches(street, plan, trims)
    breaks = {i for i, (a, b) in enumerate(pairwise(merged), 1) if a.profile.road_key != b.profile.road_key}
    if returns and not breaks:
        breaks = {_halve_longest(merged)}
    sections = build_sections(merged)
    roads: list[Road] = []
    begins: list[float] = []
    group: list[int] = []
    for i in range(len(sections)):
        group.append(i)
        if i + 1 == len(sections) or i + 1 in breaks:
            way_ids = ways_between(street, plan, merged[group[0]].begin_m, merged[i].end_m)
            roads.append(_road(new_id(), plan, [sections[k] for k in group], way_ids))
            begins.append(merged[group[0]].begin_m)
            group = []
    return StreetRoads(street, plan, roads, begins, sections[0].start, sections[-1].end)


def _halve_longest(stretches: list[Stretch]) -> int:
    """Cut the longest stretch in two; return the index of its second half."""
    index = max(range(len(stretches)), key=lambda i: _length(stretches[i]))
    stretch = stretches[index]
    middle_m = (stretch.begin_m + stretch.end_m) / 2
    stretches[index : index + 1] = [stretch._replace(end_m=middle_m), stretch._replace(begin_m=middle_m)]
    return index + 1


def _stretches(street: Street, plan: PlanView, trims: tuple[float, float]) -> list[Stretch]:
    """Return the street between its cuts, by profile.

    Stretches too short for a change of lanes are dropped or lengthened.
    """
    begin, end = trims[0], plan.length_m - trims[1]
    stretches: list[Stretch] = []
    for span in street.spans:
        first, last = max(plan.vertex_s_m[span.first], begin), min(plan.vertex_s_m[span.last], end)
        if last > first:
            stretches.append(Stretch(span.profile, first, last))
    stretches = _merge_equal(stretches)
    while (absorbed := _absorbed(stretches)) is not None:
        stretches = _merge_equal(absorbed)
    if len(stretches) > 1:
        _grow(stretches, 0, 1)
        _grow(stretches, -1, -2)
    return stretches


def _length(stretch: Stretch) -> float:
    return stretch.end_m - stretch.begin_m


def _change_m(a: Stretch, b: Stretch) -> float:
    """Return roughly how far lanes shift sideways from one stretch to the next (metres)."""
    one, other = a.profile.section, b.profile.section
    widths = [
        abs(math.fsum(lane.width_m for lane in x) - math.fsum(lane.width_m for lane in y))
        for x, y in ((one.forward, other.forward), (one.left, other.left))
    ]
    return max(*widths, abs(one.offset_m - other.offset_m))


def _lane_total(stretch: Stretch) -> int:
    return len(stretch.profile.section.forward) + len(stretch.profile.section.left)


def _is_painted(stretch: Stretch) -> bool:
    section = stretch.profile.section
    return any(lane.turns for lane in (*section.forward, *section.backward))


def _absorbed(stretches: list[Stretch]) -> list[Stretch] | None:
    """Return the stretches with the shortest one that lacks room merged into the more similar neighbour.

    The room is that for its own lanes; None if all have room. Turn lanes at the end of a street are kept unless hardly
    anything is left of them. Places where a bridge, a tunnel or a name begins or ends are kept too.
    """
    short = []
    for index, stretch in enumerate(stretches):
        neighbours = [n for n in (index - 1, index + 1) if 0 <= n < len(stretches)]
        takers = [n for n in neighbours if stretches[n].profile.road_key == stretch.profile.road_key]
        painted = _is_painted(stretch)
        if _length(stretch) < _LEAST_ROAD_M:
            takers = neighbours
        if not takers or (painted and len(neighbours) == 1 and _length(stretch) > _LEAST_PAINTED_M):
            continue
        tapers = math.fsum(
            _LEAST_TAPER_RATIO * _change_m(stretch, stretches[n])
            for n in neighbours
            if _lane_total(stretches[n]) <= _lane_total(stretch)
        )
        if _length(stretch) < max(tapers, _LEAST_PAINTED_M if painted else _LEAST_STRETCH_M):
            taker = min(takers, key=lambda n: (_change_m(stretch, stretches[n]), -_length(stretches[n])))
            short.append((_length(stretch), index, taker))
    if not short:
        return None
    _, index, taker = min(short)
    low, high = min(index, taker), max(index, taker)
    grown = Stretch(stretches[taker].profile, stretches[low].begin_m, stretches[high].end_m)
    return [*stretches[:low], grown, *stretches[high + 1 :]]


def _grow(stretches: list[Stretch], index: int, neighbour: int) -> None:
    """Lengthen turn lanes that are mapped for the last few metres only.

    They and their taper reach back into the road before.
    """
    stretch, other = stretches[index], stretches[neighbour]
    if other.profile.road_key != stretch.profile.road_key or _lane_total(other) > _lane_total(stretch):
        return
    wanted = max(_TURN_LANES_M, _TAPER_RATIO * _change_m(stretch, other))
    missing = min(wanted - _length(stretch), _length(other) / 2)
    if missing <= 0:
        return
    if index == 0:
        stretches[index] = stretch._replace(end_m=stretch.end_m + missing)
        stretches[neighbour] = other._replace(begin_m=other.begin_m + missing)
    else:
        stretches[index] = stretch._replace(begin_m=stretch.begin_m - missing)
        stretches[neighbour] = other._replace(end_m=other.end_m - missing)


def _merge_equal(stretches: list[Stretch]) -> list[Stretch]:
    """Merge neighbouring stretches of one road that have the same lanes."""
    merged: list[Stretch] = []
    for stretch in stretches:
        profile = stretch.profile
        if (
            merged
            and merged[-1].profile.section == profile.section
            and merged[-1].profile.road_key == profile.road_key
            and merged[-1].profile.speed_forward_mps == profile.speed_forward_mps
            and merged[-1].profile.speed_backward_mps == profile.speed_backward_mps
        ):
            merged[-1] = merged[-1]._replace(end_m=stretch.end_m)
        else:
            merged.append(stretch)
    return merged


def ways_between(street: Street, plan: PlanView, begin_m: float, end_m: float) -> tuple[int, ...]:
    """Return the OSM ways along a stretch of a street, in order."""
    ways = {
        span.profile.way_id: None
        for span in street.spans
        if plan.vertex_s_m[span.first] < end_m and plan.vertex_s_m[span.last] > begin_m
    }
    return tuple(ways)


def _road(road_id: str, plan: PlanView, sections: list[SectionLanes], way_ids: tuple[int, ...]) -> Road:
    begin, end = sections[0].stretch.begin_m, sections[-1].stretch.end_m
    line = drop_slivers(cut_plan(plan, begin, end))
    profile = sections[0].stretch.profile
    offsets: list[Cubic] = []
    for section in sections:
        shift = section.stretch.begin_m - begin
        for cubic in section.offset:
            if not (offsets and _is_constant(offsets[-1]) and _is_constant(cubic) and offsets[-1].a == cubic.a):
                offsets.append(replace(cubic, s_m=cubic.s_m + shift))
    if all(_is_constant(c) and c.a == 0.0 for c in offsets):
        offsets = []
    return Road(
        id=road_id,
        length_m=line.length_m,
        plan=line.elements,
        lane_sections=tuple(section.section(section.stretch.begin_m - begin) for section in sections),
        lane_offset=tuple(offsets),
        name=INFERRED_NAME if profile.inferred else profile.name,
        highway=profile.highway,
        names=profile.names,
        osm_way_ids=() if profile.inferred else way_ids,
        speed_mps=profile.speed_forward_mps,
        layer=profile.layer,
        bridge=profile.bridge,
        tunnel=profile.tunnel,
        lanes_from_tags=all(section.stretch.profile.lanes_from_tags for section in sections),
        inferred=profile.inferred,
        reversible=profile.reversible,
    )


def edges_of_carriageway(road: Road, s_m: float) -> tuple[float, float]:
    """Return the right and left edge of the carriageway at a station, metres left of the reference line."""
    section = road.lane_sections[road.section_at(s_m)]
    middle_m = CubicProfile.of(road.lane_offset).at(s_m)
    reach = {1: 0.0, -1: 0.0}
    for lane in section.lanes:
        if lane.id and lane.type not in _NOT_CARRIAGEWAY:
            reach[1 if lane.id > 0 else -1] += CubicProfile.of(lane.widths, origin_m=section.s_m).at(s_m)
    return middle_m - reach[-1], middle_m + reach[1]


def _is_constant(cubic: Cubic) -> bool:
    return cubic.b == cubic.c == cubic.d == 0.0
