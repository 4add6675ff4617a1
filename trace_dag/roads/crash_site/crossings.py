"""Crossings as a road user sees them: their arms and their kind of intersection.

A junction of the map is where lanes connect. A crossing is an intersection as a police officer sees it: several
junctions at a divided road, none at a merging ramp or a driveway. Kinds are the words of
:class:`trace_dag.crash.classes.RoadTopology`, after the element ``TYP_INT`` of FARS ("Type of Intersection").
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.common.units import wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.osm.road_classes import SERVICE_HIGHWAYS
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.crash_site.street_names import SAME_STREET, best_similarity
from trace_dag.roads.map.model import ContactPoint, Junction, Road
from trace_dag.roads.map.network import RoadNetwork

_MEDIAN_M: Final = 45.0  # junctions this near to each other, one on each carriageway, are one crossing
_OFFSET_M: Final = 30.0  # so are two halves of one street that meet another this far apart
_ARM_SEEN_AT_M: Final = 25.0  # distance along an arm at which its place and direction are taken
_PARALLEL_RAD: Final = math.radians(32)  # carriageways of one divided arm are parallel to within this,
_SIDE_BY_SIDE_RAD: Final = math.radians(135)  # and lie within this angle of each other, seen from the centre
_SLIP_ROAD_M: Final = 120.0  # roads no longer than this that lead to one place are one arm: turning lanes, triangles
_MERGE_RAD: Final = math.radians(60)  # one-way roads that meet at a smaller angle merge, they do not cross
_STRAIGHT_ON_RAD: Final = math.radians(35)
_T_STEM_RAD: Final = math.radians(50)  # a third arm at least this angle from the through road makes a T, else a Y


@dataclass(frozen=True)
class Arm:
    """One arm of a crossing: its roads (two if divided), its outward heading, radians, and its names.

    ``bearing_rad`` is its direction from the centre of the crossing.
    """

    road_ids: tuple[str, ...]
    heading_rad: float
    bearing_rad: float
    names: frozenset[str]
    enters: bool
    leaves: bool
    ramp: bool = False


@dataclass(frozen=True)
class Crossing:
    """Junctions that form one crossing, its arms counter-clockwise from east, and its kind (None: no intersection)."""

    junction_ids: tuple[str, ...]
    centre_xy_m: tuple[float, float]
    arms: tuple[Arm, ...]
    kind: RoadTopology | None

    @property
    def road_ids(self) -> frozenset[str]:
        """Return roads of all arms."""
        return frozenset(road_id for arm in self.arms for road_id in arm.road_ids)

    def street_of(self, road_id: str) -> tuple[str, ...]:
        """Return the roads of the arms that are the same street as ``road_id``, itself included, on both sides."""
        own = next((arm for arm in self.arms if road_id in arm.road_ids), None)
        if own is None:
            return (road_id,)
        arms = [arm for arm in self.arms if arm is own or _is_same_street(own, arm)]
        return tuple(road for arm in arms for road in arm.road_ids)


def _is_same_street(a: Arm, b: Arm) -> bool:
    """Return whether two arms are one street: of the same name, or straight on if one has no name."""
    if a.names and b.names:
        return _may_be_one_street(a, b)
    return math.pi - abs(wrap_angle(a.heading_rad - b.heading_rad)) < _STRAIGHT_ON_RAD


def find_crossings(network: RoadNetwork) -> tuple[Crossing, ...]:
    """Return all crossings of a network.

    Kinds set by :func:`add_kinds` are used.

    >>> junction_id = map_report.placement.junction_id
    >>> at_crash = next(each for each in find_crossings(network) if junction_id in each.junction_ids)
    >>> at_crash.kind.value, sorted({name for arm in at_crash.arms for name in arm.names})
    ('four_way', ['Elder Street', 'Main Street', 'NE 411'])
    """
    return tuple(_with_stored_kind(network, crossing) for crossing in _find(network, frozenset()))


def add_kinds(network: RoadNetwork, extract: OsmExtract) -> RoadNetwork:
    """Return the network with each junction's ``kind`` set to that of its crossing, intersection or not.

    The extract adds facts that the network lacks: the ways that are roundabouts or private.

    >>> sorted({junction.kind for junction in add_kinds(network, extract).junctions})
    ['four_way', 'not_an_intersection', 't']
    """
    on_roundabout = {
        node_id
        for way in extract.ways
        if way.tags.get("junction") in ("roundabout", "circular")
        for node_id in way.node_ids
    }
    private = {way.id for way in extract.ways if way.tags.get("access") in ("private", "no")}
    roundabouts = tuple(
        replace(junction, kind="" if on_roundabout.isdisjoint(junction.osm_node_ids) else RoadTopology.ROUNDABOUT.value)
        for junction in network.junctions
    )
    network = replace(network, junctions=roundabouts)
    private_roads = frozenset(
        road.id
        for road in network.roads
        if road.junction_id is None and road.osm_way_ids and private.issuperset(road.osm_way_ids)
    )
    kinds = {
        junction_id: (crossing.kind or RoadTopology.NOT_AN_INTERSECTION).value
        for crossing in _find(network, private_roads)
        for junction_id in crossing.junction_ids
    }
    junctions = tuple(replace(junction, kind=kinds.get(junction.id, "")) for junction in network.junctions)
    return replace(network, junctions=junctions)


def _with_stored_kind(network: RoadNetwork, crossing: Crossing) -> Crossing:
    stored = [kind for junction_id in crossing.junction_ids if (kind := network.junction_by_id[junction_id].kind)]
    if not stored:
        return crossing
    kinds = [kind for kind in stored if kind != RoadTopology.NOT_AN_INTERSECTION.value]
    return replace(crossing, kind=RoadTopology(kinds[0]) if kinds else None)


def _find(network: RoadNetwork, private_roads: Collection[str]) -> tuple[Crossing, ...]:
    ends = _ends_at_junctions(network)
    return tuple(_crossing(network, group, ends, private_roads) for group in _groups(network, ends))


_End = tuple[Road, ContactPoint]


def _ends_at_junctions(network: RoadNetwork) -> dict[str, list[_End]]:
    """Return the ends of roads at each junction, connecting roads left out."""
    ends: dict[str, list[_End]] = defaultdict(list)
    for road in network.roads:
        for contact, _, junction_id in road.ends_at_junctions:
            ends[junction_id].append((road, contact))
    return ends


def _groups(network: RoadNetwork, ends: dict[str, list[_End]]) -> Iterable[tuple[Junction, ...]]:
    """Return groups of junctions that form one crossing, in the order of the network."""
    leader = {junction.id: junction.id for junction in network.junctions}

    def find(junction_id: str) -> str:
        while leader[junction_id] != junction_id:
            junction_id = leader[junction_id]
        return junction_id

    at_road: dict[str, list[str]] = defaultdict(list)
    for junction_id, junction_ends in ends.items():
        for road, _ in junction_ends:
            if junction_id in leader and road.highway not in SERVICE_HIGHWAYS:
                at_road[road.id].append(junction_id)
    for road_id, junction_ids in at_road.items():
        road = network.road_by_id[road_id]
        if len(junction_ids) == 2 and _is_inside_crossing(
            road, [network.junction_by_id[i] for i in junction_ids], ends
        ):
            leader[find(junction_ids[1])] = find(junction_ids[0])
    groups: dict[str, list[Junction]] = defaultdict(list)
    for junction in network.junctions:
        if junction.connections:  # maps from other programs have junctions that lead nowhere
            groups[find(junction.id)].append(junction)
    return [tuple(group) for group in groups.values()]


def _is_inside_crossing(road: Road, junctions: list[Junction], ends: dict[str, list[_End]]) -> bool:
    """Return whether a road between two junctions is part of one crossing.

    It crosses a median, goes round a roundabout, or connects the two halves of a street that crosses with an offset.
    """
    if all(junction.kind == RoadTopology.ROUNDABOUT.value for junction in junctions):
        return road.one_way
    if road.length_m < _MEDIAN_M and all(_on_divided_road(ends[junction.id], road) for junction in junctions):
        return True
    if road.length_m > _OFFSET_M:
        return False
    crossing_names = [
        {name for other, _ in ends[junction.id] for name in other.names if not set(other.names) & set(road.names)}
        for junction in junctions
    ]
    return bool(crossing_names[0] & crossing_names[1])


def _on_divided_road(ends: list[_End], median_road: Road) -> bool:
    """Return whether a carriageway passes this junction beside the road over the median.

    That takes one one-way road in and one out.
    """
    others = [(road, contact) for road, contact in ends if road.id != median_road.id and road.one_way]
    return len({contact for _, contact in others}) == 2


def _crossing(
    network: RoadNetwork, group: tuple[Junction, ...], ends: dict[str, list[_End]], private_roads: Collection[str]
) -> Crossing:
    members = {junction.id for junction in group}
    centres = [_centre(network, junction) for junction in group]
    centre = (math.fsum(x for x, _ in centres) / len(centres), math.fsum(y for _, y in centres) / len(centres))
    all_ends = [end for junction in group for end in ends[junction.id]]
    outer = [
        (road, contact)
        for road, contact in all_ends
        if road.highway not in SERVICE_HIGHWAYS and road.id not in private_roads and not _joins(road, members)
    ]
    arms = _arms(network, outer, centre, members)
    roundabout = any(junction.kind == RoadTopology.ROUNDABOUT.value for junction in group)
    kind = RoadTopology.ROUNDABOUT if roundabout else _kind(arms)
    return Crossing(tuple(junction.id for junction in group), centre, arms, kind)


def _centre(network: RoadNetwork, junction: Junction) -> tuple[float, float]:
    if junction.centre_xy_m is not None:
        return junction.centre_xy_m
    roads = [network.road_by_id[connection.connecting_road] for connection in junction.connections]
    middles = [network.road_geometry(road.id).line.at(road.length_m / 2) for road in roads]
    return math.fsum(m[0] for m in middles) / len(middles), math.fsum(m[1] for m in middles) / len(middles)


def _joins(road: Road, members: Collection[str]) -> bool:
    """Return whether both ends of a road are at junctions of ``members``."""
    return len(road.linked_junctions) == 2 and all(each in members for each in road.linked_junctions)


def _arms(
    network: RoadNetwork, ends: Iterable[_End], centre: tuple[float, float], members: Collection[str]
) -> tuple[Arm, ...]:
    arms = [_arm(network, road, contact, centre) for road, contact in ends]
    arms = _merged(arms, lambda a, b: _lead_to_one_place(network, a, b, members))
    arms = _merged(arms, _are_carriageways)
    arms.sort(key=lambda arm: arm.bearing_rad)
    return tuple(_neighbours_merged(arms, _are_ramps_of_one_side))


def _neighbours_merged(arms: list[Arm], together: Callable[[Arm, Arm], bool]) -> list[Arm]:
    """Return ``arms``, sorted around the crossing, with neighbours joined that belong together."""
    merged: list[Arm] = []
    for arm in arms:
        if merged and together(merged[-1], arm):
            merged[-1] = _joined(merged[-1], arm)
        else:
            merged.append(arm)
    if len(merged) > 1 and together(merged[-1], merged[0]):
        merged[0] = _joined(merged.pop(), merged[0])
    return merged


def _are_ramps_of_one_side(a: Arm, b: Arm) -> bool:
    """Return whether two arms are the ramps to and from one motorway, on the same side of the crossing road."""
    return a.ramp and b.ramp and a.enters == b.leaves and a.enters != a.leaves


def _merged(arms: list[Arm], together: Callable[[Arm, Arm], bool]) -> list[Arm]:
    merged: list[Arm] = []
    for arm in arms:
        index = next((i for i, other in enumerate(merged) if together(other, arm)), None)
        if index is None:
            merged.append(arm)
        else:
            merged[index] = _joined(merged[index], arm)
    return merged


def _arm(network: RoadNetwork, road: Road, contact: ContactPoint, centre: tuple[float, float]) -> Arm:
    along_m = min(_ARM_SEEN_AT_M, road.length_m)
    s_m = along_m if contact == ContactPoint.START else road.length_m - along_m
    x_m, y_m, heading_rad, _ = network.road_geometry(road.id).line.at(s_m)
    oneway = road.one_way
    return Arm(
        (road.id,),
        wrap_angle(heading_rad if contact == ContactPoint.START else heading_rad + math.pi),
        math.atan2(y_m - centre[1], x_m - centre[0]),
        frozenset(road.names),
        enters=not oneway or contact == ContactPoint.END,
        leaves=not oneway or contact == ContactPoint.START,
        ramp=oneway and road.is_ramp,
    )


def _lead_to_one_place(network: RoadNetwork, a: Arm, b: Arm, members: Collection[str]) -> bool:
    """Return whether two arms, one of them one-way, meet again at their far ends, around a traffic island."""
    roads = [network.road_by_id[road_id] for road_id in (*a.road_ids, *b.road_ids)]
    if any(road.length_m > _SLIP_ROAD_M for road in roads) or not any(road.one_way for road in roads):
        return False
    far = [set(road.linked_junctions).difference(members) for road in roads]
    return bool(set.intersection(*far))


def _are_carriageways(a: Arm, b: Arm) -> bool:
    """Return whether two arms are the carriageways of one divided arm: one in, one out, parallel, side by side."""
    one_way = a.enters != a.leaves and b.enters != b.leaves
    opposed = a.enters == b.leaves
    if not one_way or not opposed or not _may_be_one_street(a, b):
        return False
    return (
        abs(wrap_angle(a.heading_rad - b.heading_rad)) < _PARALLEL_RAD
        and abs(wrap_angle(a.bearing_rad - b.bearing_rad)) < _SIDE_BY_SIDE_RAD
    )


def _may_be_one_street(a: Arm, b: Arm) -> bool:
    if not a.names or not b.names or a.names & b.names:
        return True
    alike = best_similarity(a.names, b.names)
    return alike is None or alike >= SAME_STREET


def _joined(a: Arm, b: Arm) -> Arm:
    return Arm(
        (*a.road_ids, *b.road_ids),
        _between(a.heading_rad, b.heading_rad),
        _between(a.bearing_rad, b.bearing_rad),
        a.names | b.names,
        a.enters or b.enters,
        a.leaves or b.leaves,
        a.ramp and b.ramp,
    )


def _between(a_rad: float, b_rad: float) -> float:
    return wrap_angle(a_rad + wrap_angle(b_rad - a_rad) / 2)


def _kind(arms: tuple[Arm, ...]) -> RoadTopology | None:
    if len(arms) < 3 or _merges_or_divides(arms):
        return None
    if len(arms) == 3:
        return RoadTopology.T if _is_t([arm.heading_rad for arm in arms]) else RoadTopology.Y
    return RoadTopology.FOUR_WAY if len(arms) == 4 else RoadTopology.FIVE_POINT_OR_MORE


def _merges_or_divides(arms: tuple[Arm, ...]) -> bool:
    """Return whether traffic only merges or divides here, as at a ramp of a motorway, without crossing paths."""
    entering = [arm for arm in arms if arm.enters]
    leaving = [arm for arm in arms if arm.leaves]
    if len(entering) + len(leaving) > len(arms) or min(len(entering), len(leaving)) > 1:
        return False
    return all(math.pi - abs(wrap_angle(a.heading_rad - b.heading_rad)) < _MERGE_RAD for a in entering for b in leaving)


def _is_t(headings_rad: list[float]) -> bool:
    """Return whether two of three arms are straight and the third comes from the side."""
    for stem in range(3):
        a, b = (headings_rad[i] for i in range(3) if i != stem)
        bent = math.pi - abs(wrap_angle(a - b))
        aside = min(abs(wrap_angle(headings_rad[stem] - a)), abs(wrap_angle(headings_rad[stem] - b)))
        if bent < _STRAIGHT_ON_RAD and aside > _T_STEM_RAD:
            return True
    return False
