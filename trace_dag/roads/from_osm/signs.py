"""Signals and signs: tagged OSM nodes, each on the right side of its approach at the stop line.

A node on an approach applies to the traffic towards its junction. A node on the junction itself applies to every
approach (signals, all-way stops) or to the minor ones (stop, give way). Speed limit signs stand where a stretch with a
tagged limit begins. Types are those on which CARLA acts (1000001, 205, 206, 274).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from operator import itemgetter
from typing import Final, NamedTuple

from trace_dag.common.units import mps_to_mph
from trace_dag.osm.types import OsmExtract, OsmNode
from trace_dag.roads.from_osm.junction_areas import JunctionArea
from trace_dag.roads.from_osm.movements import JunctionArm, Movement
from trace_dag.roads.from_osm.street_graph import Street, StreetGraph
from trace_dag.roads.from_osm.street_roads import BuiltStreets, StreetRoads, edges_of_carriageway
from trace_dag.roads.from_osm.tags import WayProfile
from trace_dag.roads.map.curves import Point
from trace_dag.roads.map.model import ContactPoint, Road, RoadLink, Signal

_APPROACH_M: Final = 60.0  # a node farther than this from a junction stands by itself (a pedestrian crossing)
_BESIDE_M: Final = 0.8  # distance of a post from the edge of the road
_STOP_LINE_M: Final = 0.5  # distance of a stop line from the end of the road
_LIMIT_SIGN_M: Final = 15.0  # distance of a speed limit sign from where its stretch begins
_LEAST_LIMIT_M: Final = 100.0  # stretches shorter than this get no sign of their own


class _Kind(NamedTuple):
    type: str
    name: str
    dynamic: bool
    z_offset_m: float
    height_m: float
    width_m: float


_KINDS: Final = {
    "traffic_signals": _Kind("1000001", "Signal", True, 4.6, 1.0, 0.35),
    "stop": _Kind("206", "Stop", False, 2.1, 0.75, 0.75),
    "give_way": _Kind("205", "Yield", False, 2.1, 0.8, 0.9),
    "mini_roundabout": _Kind("205", "Yield", False, 2.1, 0.8, 0.9),
    "blinker": _Kind("-1", "Blinker", False, 4.6, 0.35, 0.35),  # no phases, so no controller either
    "level_crossing": _Kind("201", "RailroadCrossing", False, 2.7, 0.9, 0.9),
    "level_crossing_lights": _Kind("-1", "RailroadLights", True, 2.1, 0.5, 0.8),
}
_ONE_PLACE: Final = frozenset({"level_crossing", "level_crossing_lights", "crossing_signals"})
"""Kinds that apply where they stand, both ways, not to a junction nearby."""
_BLINKERS: Final = frozenset({"blinker", "blink_mode", "flashing"})
_LIT: Final = ("crossing:light", "crossing:barrier")
_LIMIT_KIND: Final = _Kind("274", "SpeedLimit", False, 2.1, 0.75, 0.6)


class _Control(NamedTuple):
    """Control of traffic by a tagged node: a key of :data:`_KINDS`, and the node."""

    name: str
    node: OsmNode

    @property
    def kind(self) -> _Kind:
        """Return its looks."""
        return _KINDS["traffic_signals" if self.name == "crossing_signals" else self.name]


def _control_of(tags: Mapping[str, str]) -> str:
    """Return the kind of traffic control in a node's tags, or ""."""
    highway, lights = tags.get("highway", ""), tags.get("traffic_signals", "")
    if tags.get("railway") == "level_crossing":
        lit = any(tags.get(key, "no") != "no" for key in _LIT)
        return "level_crossing_lights" if lit else "level_crossing"
    if highway == "traffic_signals":
        return "stop" if lights == "stop" else "blinker" if lights in _BLINKERS else highway
    if highway == "crossing" and (tags.get("crossing") == "traffic_signals" or tags.get("crossing:signals") == "yes"):
        return "crossing_signals"
    return highway if highway in _KINDS else ""


def _controls(extract: OsmExtract, graph: StreetGraph) -> dict[int, _Control]:
    """Return the nodes that control traffic.

    Lights of a pedestrian crossing count if no other light is near, since lights for people imply lights for the road
    (MUTCD 2009, 4E.03).
    """
    controlling = graph.nodes_by_place(node for node in extract.nodes.values() if _control_of(node.tags))
    found = {node_id: _Control(_control_of(node.tags), node) for node_id, node in controlling.items()}
    places = graph.positions
    lights = [places[i] for i, each in found.items() if each.name == "traffic_signals" and i in places]
    return {
        node_id: each
        for node_id, each in found.items()
        if each.name != "crossing_signals"
        or (node_id in places and all(math.dist(places[node_id], light) > _APPROACH_M for light in lights))
    }


class _Post(NamedTuple):
    """A sign at a place of a road for one direction of traffic."""

    road: Road
    s_m: float
    forward: bool


def place_signs(
    extract: OsmExtract,
    graph: StreetGraph,
    built: BuiltStreets,
    crossings: Sequence[tuple[JunctionArea, list[Movement]]],
) -> dict[str, tuple[Signal, ...]]:
    """Return signals by road id.

    ``crossings`` are the junctions with their permitted movements.

    >>> signs = place_signs(extract, street_graph, street_roads, [])
    >>> sorted({signal.name for signals in signs.values() for signal in signals})
    ['Signal', 'SpeedLimit_25', 'SpeedLimit_30', 'SpeedLimit_35', 'Stop']
    """
    streets, positions = graph.streets, graph.positions
    controls = _controls(extract, graph)
    placed: dict[str, list[Signal]] = defaultdict(list)
    ids = count()
    served: set[tuple[str, bool, str]] = set()  # road, direction and type that have their own node

    def place(post: _Post, kind: _Kind, node_id: int | None, value: float | None = None) -> None:
        placed[post.road.id].append(_signal(str(next(ids)), post, kind, node_id, value))

    inside = {node for area, _ in crossings for node in _nodes_of(area, streets)}
    for made in built.values():
        for post, control in _approach_posts(made, controls, inside):
            key = (post.road.id, post.forward, control.kind.type)
            if key not in served or control.name in _ONE_PLACE:
                served.add(key)
                place(post, control.kind, control.node.id)
                if control.name == "level_crossing_lights":
                    place(post, _KINDS["level_crossing"], control.node.id)
    roads = {road.id: road for made in built.values() for road in made.roads}

    def place_at_arm(arm: JunctionArm, kind: _Kind, node_id: int | None) -> None:
        forward = arm.contact == ContactPoint.END
        key = (arm.road_id, forward, kind.type)
        if key not in served:
            served.add(key)
            road = roads[arm.road_id]
            stop_m = min(_STOP_LINE_M, road.length_m / 2)
            place(_Post(road, road.length_m - stop_m if forward else stop_m, forward), kind, node_id)

    for area, movements in crossings:
        tagged = {i: controls[i] for i in sorted(_nodes_of(area, streets) & controls.keys())}
        for arm, control in _arm_controls(tagged, movements, positions):
            place_at_arm(arm, control.kind, control.node.id)
        for arm in _arms_into_roundabout(movements):
            forward = arm.contact == ContactPoint.END
            if not any((arm.road_id, forward, _KINDS[name].type) in served for name in ("traffic_signals", "stop")):
                place_at_arm(arm, _KINDS["give_way"], None)
    for made in built.values():
        for post, limit_mps in _limit_posts(made.roads):
            place(post, _LIMIT_KIND, None, limit_mps)
    return {road_id: tuple(signals) for road_id, signals in placed.items()}


def _nodes_of(area: JunctionArea, streets: Sequence[Street]) -> set[int]:
    """Return the OSM nodes of a junction, including those of the streets inside it."""
    return {*area.node_ids, *(node for index in area.inner_streets for node in streets[index].node_ids)}


def _approach_posts(
    made: StreetRoads, controls: Mapping[int, _Control], inside: set[int]
) -> Iterator[tuple[_Post, _Control]]:
    """Yield posts of the tagged nodes along a street outside junctions."""
    street, plan = made.street, made.plan
    for k, node_id in enumerate(street.node_ids):
        control = controls.get(node_id)
        if control is None or node_id in inside:
            continue
        s = plan.vertex_s_m[k]
        span = next(span for span in street.spans if span.first <= k <= span.last)
        to_end = plan.length_m - s if street.end_node is not None else None
        to_start = s if street.start_node is not None else None
        for forward in _directions(control, span.profile, to_start, to_end):
            yield _post_at(made, s, forward), control


def _directions(
    control: _Control, profile: WayProfile, to_start: float | None, to_end: float | None
) -> tuple[bool, ...]:
    """Return the directions along the street to which a node applies.

    It is the tagged one, or else the direction towards its junction.
    """
    if profile.oneway:  # where the map ends, nothing is left that a light could control
        return (True,) if to_end is not None or control.name in _ONE_PLACE else ()
    tags = control.node.tags
    tagged = tags.get(f"{tags.get('highway', '')}:direction") or tags.get("direction") or ""
    if tagged in ("forward", "backward"):
        return ((tagged == "forward") != (profile.against_way != profile.turned),)
    if tagged == "both" or control.name in _ONE_PLACE:
        return (True, False)
    ends = ((to_end, True), (to_start, False))
    near = [
        (distance_m, forward) for distance_m, forward in ends if distance_m is not None and distance_m <= _APPROACH_M
    ]
    return (min(near, key=itemgetter(0))[1],) if near else (True, False)


def _post_at(made: StreetRoads, s_m: float, forward: bool) -> _Post:
    """Return a post at ``s_m`` of a street, moved to the stop line if the street is cut off before."""
    road, begin_m = made.road_at(s_m)
    least = min(_STOP_LINE_M, road.length_m / 2)
    return _Post(road, min(max(s_m - begin_m, least), road.length_m - least), forward)


def _arm_controls(
    tagged: Mapping[int, _Control], movements: Sequence[Movement], positions: Mapping[int, Point]
) -> list[tuple[JunctionArm, _Control]]:
    """Return the tagged node for each arm of a junction; of several of one kind the nearest."""
    candidates: dict[tuple[RoadLink, str], tuple[JunctionArm, list[int]]] = {}
    for node_id, control in tagged.items():
        for arm in _controlled_arms(control, movements):
            candidates.setdefault((arm.link, control.name), (arm, []))[1].append(node_id)
    found = []
    for arm, node_ids in candidates.values():
        nearest = min(node_ids, key=lambda i: (i != arm.node, math.dist(positions[i], arm.inbound[:2]), i))
        found.append((arm, tagged[nearest]))
    return found


def _arms_into_roundabout(movements: Sequence[Movement]) -> list[JunctionArm]:
    """Return the arms on which traffic enters a roundabout and gives way (MUTCD 2009, 2B.10)."""
    arms = {movement.origin.link: movement.origin for movement in movements}
    if not any(arm.profile.roundabout for arm in arms.values()):
        return []
    return [arm for arm in arms.values() if not arm.profile.roundabout]


def _controlled_arms(control: _Control, movements: Sequence[Movement]) -> list[JunctionArm]:
    """Return arms of a junction to which a node on the junction itself applies."""
    arms = {movement.origin.link: movement.origin for movement in movements}
    everyone = list(arms.values())
    if control.name not in ("stop", "give_way") or control.node.tags.get("stop") == "all":
        return everyone
    if control.node.tags.get("highway") == "traffic_signals":  # a light that stops all
        return everyone
    ranks = {key: arm.profile.rank for key, arm in arms.items()}
    major = min(ranks.values(), default=0)
    minor = [arm for key, arm in arms.items() if ranks[key] > major]
    if minor:
        return minor
    # All arms of one class: the stem of a T, from which nothing goes straight on, gives way.
    straight = {movement.origin.link for movement in movements if movement.turn == "straight"}
    stems = [arm for key, arm in arms.items() if key not in straight]
    return stems or ([] if control.node.tags.get("stop") == "minor" else everyone)


def _limit_posts(roads: Sequence[Road]) -> Iterator[tuple[_Post, float]]:
    """Yield posts where a stretch with a new limit begins, in either direction."""
    for forward in (True, False):
        ordered = roads if forward else list(reversed(roads))
        before: float | None = None
        for road in ordered:
            limit = _limit(road, forward)
            if limit is not None and limit != before and road.length_m >= _LEAST_LIMIT_M:
                s = _LIMIT_SIGN_M if forward else road.length_m - _LIMIT_SIGN_M
                yield _Post(road, s, forward), limit
                before = limit


def _limit(road: Road, forward: bool) -> float | None:
    """Return the speed limit of one direction of a road (m/s); None if untagged or without traffic."""
    lanes = [lane for lane in road.lane_sections[0].lanes if lane.type.drivable and (lane.id < 0) == forward]
    return next((lane.speed_mps for lane in lanes if lane.speed_mps is not None), None)


def _signal(signal_id: str, post: _Post, kind: _Kind, node_id: int | None, limit_mps: float | None) -> Signal:
    right_m, left_m = edges_of_carriageway(post.road, post.s_m)
    mph = None if limit_mps is None else float(round(mps_to_mph(limit_mps)))
    return Signal(
        id=signal_id,
        s_m=post.s_m,
        t_m=right_m - _BESIDE_M if post.forward else left_m + _BESIDE_M,
        type=kind.type,
        subtype="-1" if mph is None else f"{mph:.0f}",
        name=kind.name if mph is None else f"{kind.name}_{mph:.0f}",
        orientation="+" if post.forward else "-",
        value=mph,
        unit=None if mph is None else "mph",
        dynamic=kind.dynamic,
        z_offset_m=kind.z_offset_m,
        height_m=kind.height_m,
        width_m=kind.width_m,
        osm_node_id=node_id,
    )
