"""Driveways that the report mentions and OpenStreetMap does not have: drawn as roads of the map and marked as inferred.

A vehicle must have used a driveway if it is reported to have come out of one, from the side, or to have turned off the
street between intersections. If no road of the map passes the crash on that side, a way is added to a copy of the
extract. It is drawn at right angles to the street, through the crash's place, and on both sides if the report has no
side. Its tag ``trace_dag:inferred`` has the reason. On a divided street it crosses the median if the reported course
does.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray, arc_lengths
from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Relation, Side, Turn, crash_type_of, critical_event, opposite_side, turn_of
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.osm.road_classes import is_drivable, road_class
from trace_dag.osm.types import OsmExtract, OsmNode, OsmWay, count_arms
from trace_dag.roads.crash_site.placement import is_at_intersection
from trace_dag.roads.crash_site.reported_road import pair_of
from trace_dag.roads.from_osm.tags import INFERRED_TAG, goes_one_way
from trace_dag.roads.map.model import ContactPoint, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement

DRIVEWAY_RELATIONS: Final = frozenset({4, 8})  # RELJCT2: in a driveway access, or related to one
_DRIVEWAY_TRAFFICWAY: Final = 0  # VTRAFWAY: a driveway access or other non-trafficway
_WIDTH_M: Final = 6.1
"""20 ft: the most that York County's code (VA, 20.5-98) lets a residential driveway be wide (9 to 20 ft), the least
that Kent's (OH, 1167.05) asks of any other; room for a lane of 3 m each way."""
_LENGTH_M: Final = 50.0  # from the middle of the street: 40 m or more beside it
_LONGEST_M: Final = 100.0
_DRIVEN_S: Final = 5.5  # a vehicle that was fast needs room for the seconds before the crash
_LEAST_LENGTH_M: Final = 15.0
_PASSES_M: Final = 16.0  # a vehicle can have come from a side road whose line passes this near to the crash
_FARTHEST_END_M: Final = 60.0
_SIDEWAYS_RAD: Final = (math.radians(35), math.radians(145))
_SAME_JUNCTION_M: Final = 15.0
_SAME_PLACE_M: Final = 1.0
_OPPOSING_COSINE: Final = math.cos(math.radians(150))
_MEDIAN_CROSSING_M: Final = 45.0  # a carriageway farther away is another street
_BEFORE_RIGHT_TURN_M: Final = 3.0  # the cut corner: a vehicle that turns right joins the street this much farther on
_TAGS: Final = {"highway": "service", "service": "driveway", "width": f"{_WIDTH_M:g}"}


@dataclass(frozen=True)
class Access:
    """The reported access to the street. ``side``: as seen in the direction of the street's traffic.

    None means either side. ``turn``: the turn of the vehicle that came out of it. ``across``: the course leads over the
    whole street.
    """

    why: str
    side: Side | None = None
    turn: Turn | None = None
    across: bool = False
    length_m: float = _LENGTH_M


def _reported_access(record: CrashRecord) -> Access | None:
    """Return the access to the street in the report, whether or not the map has it."""
    pair = pair_of(record)
    if len(pair) != 2:
        return None
    both = (pair, pair[::-1])
    for vehicle, other in both:
        from_driveway = critical_event(other.critical_event_code)
        if vehicle.trafficway_code == _DRIVEWAY_TRAFFICWAY or (
            from_driveway.driveway and from_driveway.crossing_is_other
        ):
            return _coming_out(vehicle, other, f"vehicle {vehicle.number} is reported to have come from a driveway")
    at_driveway = record.junction_relation_code in DRIVEWAY_RELATIONS
    if any(_backs(vehicle) for vehicle in pair):
        return Access("the crash is reported at a driveway") if at_driveway else None
    if is_at_intersection(record) and not at_driveway:
        return None  # they came out of the streets that meet there
    if _is_crossing(pair):
        # The vehicle that turned came from the side; if both went straight, either can have.
        for vehicle, other in both:
            if turn_of(vehicle) is not None:
                return _coming_out(vehicle, other, f"vehicle {vehicle.number} is reported to have come from the side")
        fastest_m = max(_driven_m(vehicle) for vehicle in pair)
        return Access("one vehicle is reported to have come from the side", across=True, length_m=fastest_m)
    for vehicle, _ in both:
        turn = turn_of(vehicle)
        if turn in (Turn.LEFT, Turn.RIGHT):
            why = f"vehicle {vehicle.number} is reported to have turned {turn} between intersections"
            # A vehicle that turns left crosses the other carriageway, and the crash is on that one.
            return Access(why, side=Side.RIGHT, across=turn is Turn.LEFT)
    return None


def add_driveways(
    network: RoadNetwork, extract: OsmExtract, record: CrashRecord, placement: CrashPlacement
) -> OsmExtract:
    """Return the extract with the reported driveways.

    It is unchanged if the map has a road there or no room.
    """
    access = _reported_access(record)
    road = network.road_by_id[placement.road_id]
    if access is None or not road_class(road.highway).driveways or road.bridge or road.tunnel:
        return extract
    if is_at_intersection(record) and _at_its_crossing(network, placement):
        return extract
    canvas = _Canvas(network, extract)
    street = canvas.street_at(road, placement)
    if street is None:
        return extract
    passing = _sides_passed(network, street)
    if street.one_way:
        wanted = [side for side in Side if access.side in (side, None) and side not in passing]
    else:
        wanted = [] if passing else list(Side)  # the direction of the street's vehicle is not known
    for side in wanted:
        canvas.draw(street, side, access)
    return canvas.extract()


# --- what the report says ------------------------------------------------------------------------------------------
def _backs(vehicle: VehicleRecord) -> bool:
    return crash_type_of(vehicle).backing or vehicle.movement is PreCrashMovement.BACKING


def _is_crossing(pair: Sequence[VehicleRecord]) -> bool:
    said = [relation for vehicle in pair if (relation := crash_type_of(vehicle).relation) is not None]
    if not said:
        said = [
            relation
            for vehicle in pair
            if (relation := critical_event(vehicle.critical_event_code).relation) is not None
        ]
    return bool(said) and set(said) == {Relation.CROSSING}


def _coming_out(vehicle: VehicleRecord, other: VehicleRecord, why: str) -> Access:
    turn = None if _backs(vehicle) else turn_of(vehicle)
    side = None
    if crash_type_of(other).relation is Relation.CROSSING and crash_type_of(other).other_from is not None:
        side = crash_type_of(other).other_from
    elif (
        crash_type_of(vehicle).relation is Relation.CROSSING and (seen := crash_type_of(vehicle).other_from) is not None
    ):
        side = opposite_side(seen)
    across = turn is not Turn.RIGHT and not _backs(vehicle)
    return Access(why, side, turn, across, _driven_m(vehicle))


def _driven_m(vehicle: VehicleRecord) -> float:
    return min(max(_LENGTH_M, _DRIVEN_S * (vehicle.travel_speed_mps or 0.0)), _LONGEST_M)


# --- what the map has ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Street:
    """The way under the crash: station (metres), point, and direction.

    A one-way street has its traffic's direction.
    """

    way: OsmWay
    s_m: float
    xy_m: FloatArray
    direction: FloatArray
    one_way: bool

    def outward(self, side: Side) -> FloatArray:
        """Return the unit vector from the street to a side of it."""
        x, y = self.direction
        return np.array([-y, x]) if side is Side.LEFT else np.array([y, -x])


def _at_its_crossing(network: RoadNetwork, placement: CrashPlacement) -> bool:
    """Return whether the crash is at the crossing of its placement, regardless of the angles of its arms."""
    if placement.junction_id is None or not placement.cross_road_ids:
        return False
    near = network.nearest_lanes(placement.x_m, placement.y_m, _PASSES_M)
    return any(network.road_by_id[match.lane.road_id].junction_id == placement.junction_id for match in near)


def _sides_passed(network: RoadNetwork, street: _Street) -> set[Side]:
    """Return the sides of the street from which a road of the map leads past the crash."""
    sides: set[Side] = set()
    heading = math.atan2(street.direction[1], street.direction[0])
    for end, away in _road_ends(network):
        if not _SIDEWAYS_RAD[0] <= abs(wrap_angle(away - heading)) <= _SIDEWAYS_RAD[1]:
            continue
        back = street.xy_m - end
        line = np.array([math.cos(away), math.sin(away)])
        if abs(line[0] * back[1] - line[1] * back[0]) <= _PASSES_M and -_FARTHEST_END_M <= line @ back <= _PASSES_M:
            sides.add(Side.LEFT if wrap_angle(away - heading) > 0 else Side.RIGHT)
    return sides


def _road_ends(network: RoadNetwork) -> Iterator[tuple[FloatArray, float]]:
    """Yield the ends of roads at junctions, with the heading away from there along the road."""
    for road in network.roads:
        for contact, s_m, _ in road.ends_at_junctions:
            line = network.road_geometry(road.id).line
            x, y, heading = (float(value) for value in line.sample(np.array([s_m]))[0][:3])
            yield np.array([x, y]), heading if contact is ContactPoint.START else heading + math.pi


# --- drawing -------------------------------------------------------------------------------------------------------
class _Hit(NamedTuple):
    """The intersection of a straight line with a way: distances along the line and along the way."""

    distance_m: float
    way: OsmWay
    s_m: float
    opposes: bool  # a one-way road with traffic against the street's


class _Canvas:
    """A copy of the extract to draw driveways in, in the network's frame."""

    def __init__(self, network: RoadNetwork, extract: OsmExtract) -> None:
        self._frame = network.frame
        self._extract = extract
        self._ways = [way for way in extract.ways if is_drivable(way.tags, service_roads=True) and _whole(way, extract)]
        self._arms = count_arms(self._ways)
        places = extract.local_xy_m(extract.nodes, network.frame)
        self._xy: dict[int, FloatArray] = dict(zip(extract.nodes, places, strict=True))
        self._new_nodes: list[OsmNode] = []
        self._inserted: dict[int, list[tuple[float, int]]] = defaultdict(list)
        self._drawn: list[OsmWay] = []

    def street_at(self, road: Road, placement: CrashPlacement) -> _Street | None:
        """Return the way of a road nearest to the crash; None for a road without ways."""
        here = np.array([placement.x_m, placement.y_m])
        found: list[tuple[float, int, _Street]] = []
        for way in self._ways:
            if way.id in road.osm_way_ids:
                line = self._line(way)
                s_m = _station(line, here)
                xy_m, direction = _on(line, s_m)
                street = _Street(way, s_m, xy_m, direction, road.one_way)
                found.append((float(np.hypot(*(xy_m - here))), way.id, street))
        return min(found, key=lambda each: each[:2])[2] if found else None

    def draw(self, street: _Street, side: Side, access: Access) -> None:
        """Draw a driveway on one side of a street, if other roads leave room."""
        outward = street.outward(side)
        along_m = 0.0
        if access.turn is Turn.RIGHT:
            along_m = -_BEFORE_RIGHT_TURN_M if side is Side.RIGHT else _BEFORE_RIGHT_TURN_M
        target_m = street.xy_m + along_m * street.direction
        root_m = self._junction_near(street, _station(self._line(street.way), target_m))
        start = _on(self._line(street.way), root_m)[0]
        between: list[_Hit] = []  # the other carriageway, if the driveway leads across it
        end_m, joined = access.length_m, None
        for hit in self._hits(street, start, outward, access.length_m + _LEAST_LENGTH_M):
            if hit.opposes and street.one_way and hit.distance_m <= _MEDIAN_CROSSING_M and not between:
                between.append(hit)
                continue
            end_m, joined = hit.distance_m, hit
            break
        if end_m - (between[0].distance_m if between else 0.0) < _LEAST_LENGTH_M:
            return
        nodes = [self._node_at(joined.way, joined.s_m) if joined else self._add(start + end_m * outward)]
        nodes += [self._node_at(hit.way, hit.s_m) for hit in between]
        nodes.append(self._node_at(street.way, root_m))
        if access.across and street.one_way and side is Side.RIGHT:
            ahead = self._hits(street, start, -outward, _MEDIAN_CROSSING_M)
            if ahead and ahead[0].opposes:
                nodes.append(self._node_at(ahead[0].way, ahead[0].s_m))
        way_id = min(0, *(way.id for way in (*self._extract.ways, *self._drawn))) - 1
        self._drawn.append(OsmWay(way_id, tuple(nodes), {**_TAGS, INFERRED_TAG: access.why}))

    def extract(self) -> OsmExtract:
        """Return the extract with the driveways, or the same object if there are none."""
        if not self._drawn:
            return self._extract
        nodes = {**self._extract.nodes, **{node.id: node for node in self._new_nodes}}
        ways = tuple(self._with_inserted(way) for way in self._extract.ways)
        return replace(self._extract, nodes=nodes, ways=(*ways, *self._drawn))

    def _line(self, way: OsmWay) -> FloatArray:
        return np.array([self._xy[node_id] for node_id in way.node_ids])

    def _junction_near(self, street: _Street, s_m: float) -> float:
        """Return the station of a junction of which the driveway would be an arm, if one is that near; else ``s_m``."""
        stations = arc_lengths(self._line(street.way))
        near = [
            (abs(float(station) - s_m), float(station))
            for node_id, station in zip(street.way.node_ids, stations, strict=True)
            if self._arms[node_id] > 2
        ]
        apart_m, station = min(near, default=(math.inf, s_m))
        return station if apart_m <= _SAME_JUNCTION_M else s_m

    def _hits(self, street: _Street, start: FloatArray, towards: FloatArray, reach_m: float) -> list[_Hit]:
        """Return the other ways on the street's level that a straight line meets, nearest first."""
        hits = []
        for way in self._ways:
            if any(way.tags.get(key, "no") != "no" for key in ("bridge", "tunnel")):
                continue
            line = self._line(way)
            stations = arc_lengths(line)
            for i, (a, b) in enumerate(pairwise(line)):
                along = b - a
                across = float(towards[0] * along[1] - towards[1] * along[0])
                if abs(across) < 1e-9:
                    continue
                share = float((a - start)[1] * towards[0] - (a - start)[0] * towards[1]) / -across
                distance_m = float((a - start)[0] * along[1] - (a - start)[1] * along[0]) / across
                if 0.0 <= share <= 1.0 and _SAME_PLACE_M < distance_m <= reach_m:
                    heading, one_way = along / np.hypot(*along), goes_one_way(way.tags)
                    opposes = one_way and float(heading @ street.direction) < _OPPOSING_COSINE
                    s_m = float(stations[i] + share * (stations[i + 1] - stations[i]))
                    hits.append(_Hit(distance_m, way, s_m, opposes))
        return sorted(hits, key=lambda hit: (hit.distance_m, hit.way.id))

    def _node_at(self, way: OsmWay, s_m: float) -> int:
        """Return the way's node at a station, new if there is none."""
        line = self._line(way)
        at = [*zip(arc_lengths(line).tolist(), way.node_ids, strict=True), *self._inserted[way.id]]
        apart_m, node_id = min((abs(station - s_m), node_id) for station, node_id in at)
        if apart_m <= _SAME_PLACE_M:
            return node_id
        node_id = self._add(_on(line, s_m)[0])
        self._inserted[way.id].append((s_m, node_id))
        return node_id

    def _add(self, xy_m: FloatArray) -> int:
        latitude_deg, longitude_deg = (float(value) for value in self._frame.to_geographic(xy_m))
        node_id = min(0, *self._extract.nodes, *(node.id for node in self._new_nodes)) - 1
        self._new_nodes.append(OsmNode(node_id, latitude_deg, longitude_deg))
        return node_id

    def _with_inserted(self, way: OsmWay) -> OsmWay:
        if not self._inserted[way.id]:
            return way
        stations = arc_lengths(self._line(way)).tolist()
        nodes = sorted([*zip(stations, way.node_ids, strict=True), *self._inserted[way.id]], key=lambda each: each[0])
        return way._replace(node_ids=tuple(node_id for _, node_id in nodes))


def _whole(way: OsmWay, extract: OsmExtract) -> bool:
    return len(way.node_ids) > 1 and all(node_id in extract.nodes for node_id in way.node_ids)


def _station(line: FloatArray, point: FloatArray) -> float:
    """Return the station along a polyline (metres) of its place nearest to a point."""
    stations = arc_lengths(line)
    best = (math.inf, 0.0)
    for i, (a, b) in enumerate(pairwise(line)):
        along = b - a
        length_m = float(np.hypot(*along))
        if length_m == 0.0:
            continue
        share = min(max(float((point - a) @ along) / length_m**2, 0.0), 1.0)
        apart_m = float(np.hypot(*(a + share * along - point)))
        best = min(best, (apart_m, float(stations[i]) + share * length_m))
    return best[1]


def _on(line: FloatArray, s_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the point at a station of a polyline, and the unit vector along it."""
    stations = arc_lengths(line)
    i = min(max(int(np.searchsorted(stations, s_m, side="right")) - 1, 0), len(line) - 2)
    along = line[i + 1] - line[i]
    length_m = max(float(np.hypot(*along)), 1e-9)
    return line[i] + (s_m - float(stations[i])) / length_m * along, along / length_m
