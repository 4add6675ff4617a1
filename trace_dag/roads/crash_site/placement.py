"""Where the crash is on the map: which road, where on it, and at which crossing.

The reported point is a coded point: some metres beside the road, on the wrong carriageway, or on the bridge above. So
the road is chosen by what the report says about it: its name or number, class, lanes, limit, whether it is divided, and
how far the point lies from it. Each of these gives a log-likelihood ratio (how many times likelier such a report is for
this road than for another), and they are added up. The weights were set by judgement. Beside them stands what
``benchmarks/placement_weights.py`` measured afterwards on the 80 stored maps of two cohorts (62 crashes in Virginia in
2023, 210 of FARS 2012 to 2016): 52 roads that bear the reported name against 120 others within 100 m. Stored maps
mostly agree with their report, so differences are rarer among them than in reality. By these figures limit and
trafficway would weigh more; no weight was changed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Final

from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Reason, Rejection
from trace_dag.messages.wording import beside_limit
from trace_dag.osm.drivable import SERVICE_HIGHWAYS
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.crash_site.carriageways import carriageway_at
from trace_dag.roads.crash_site.crossings import Crossing, find_crossings
from trace_dag.roads.crash_site.near_streets import joined_by, roads_near
from trace_dag.roads.crash_site.reported_road import (
    Trafficway,
    lanes_as_reported,
    pair_of,
    trafficway_of,
    trafficway_on_map,
)
from trace_dag.roads.crash_site.street_names import SAME_STREET, parse_street, similarity
from trace_dag.roads.map.model import LaneMatch, LaneRef, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement
from trace_dag.settings import RoadSettings

_LOOK_AROUND_M: Final = 100.0  # a road with the reported name is looked for this far, even if no crash is moved so far
_OTHER_STREET: Final = 0.4  # names less alike than this are two streets: judgement
_DISTANCE_SCALE_M: Final = 6.0
"""Of ``-log1p((distance / scale)**2)``: 6 m beside the road costs 0.7, 12 m 1.6, 50 m 4.3. Measured, against a point on
the surface (where 16 of 52 lie): 3 to 6 m 1.2, up to 12 m 2.5, up to 25 m 4.7, up to 50 m 5.9."""
_CROSSING_SCALE_M: Final = 15.0  # judgement: crossings are this wide and are reported by their middle
_NAME_WEIGHTS: Final = (5.5, -1.5)
"""Per unit of likeness, and for no likeness at all. Judgement: names tell which road is which, so there is nothing to
measure them against. They outweigh all else together within a lane or two of the point."""
_OTHER_STREETS_NAME: Final = -2.0  # judgement: it has the name of the street that is crossed
_CLASS_WEIGHTS: Final = ((0.9, 0.7), (1.7, 0.0), (2.7, -0.7), (math.inf, -1.5))
"""By steps between classes, up to. Measured: 0.7, -0.3, -0.4, -1.1."""
_TRAFFICWAY_WEIGHTS: Final = {
    True: 0.6,
    False: -0.4,
}  # measured: 0.3, -2.5 (it never differed on the 24 roads that say it)
_LANES_WEIGHTS: Final = {True: 0.7, False: -0.5}  # measured: 0.2, -0.6
_LIMIT_WEIGHTS: Final = {True: 0.5, False: -0.3}  # measured: 0.4, -1.5
_RAMP_WEIGHTS: Final = {True: 1.5, False: -1.5}  # a ramp, reported as one or not: judgement, too few to measure
_SERVICE_WEIGHTS: Final = {True: -1.0, False: -2.5}  # a service road, at a driveway or not: judgement
_CROSSING_NAME_WEIGHTS: Final = (4.0, -1.0)  # as for roads, for each of the crossing's two names: judgement
_CROSSING_KIND_WEIGHT: Final = 1.0  # judgement: TYP_INT and the map's number of arms agree
_INSIDE_LANE_M: Final = 1.0  # a moved point comes to lie this far inside the lane's border: judgement
_NOT_ITS_STREET: Final = -10.0  # a driveway that was drawn for this crash: more than all other evidence together
_SAME_SPEED_MPS: Final = 1.2  # half a step of posted limits

# FUNC_SYS: interstate, other freeway, principal arterial, minor arterial, major and minor collector, local. Between two
# of OSM's classes where mappers use either; how far between is judgement.
_RANK_OF_FUNCTION: Final = {1: 0.0, 2: 0.7, 3: 2.0, 4: 2.8, 5: 3.7, 6: 4.4, 7: 5.6}
_AT_DRIVEWAY: Final = (4, 8)  # RELJCT2
_AT_INTERSECTION: Final = (2, 3)  # RELJCT2
_ON_RAMP: Final = (20,)  # RELJCT2
_NO_INTERSECTION: Final = (RoadTopology.NOT_AN_INTERSECTION, RoadTopology.OTHERS)


def place_crash(network: RoadNetwork, record: CrashRecord, settings: RoadSettings) -> CrashPlacement:
    """The crash on the map, in the network's frame.

    A point on the surface of its road stays where it is. A point beside it is moved just inside the nearest lane, by at
    most ``settings.max_move_m``.

    Raises :class:`Rejection` (``crash_off_road``) if no road is that near, or if the road that the report names is
    farther away and the nearer ones have other names.

    >>> from trace_dag.settings import RoadSettings
    >>> placement = place_crash(network, record, RoadSettings())
    >>> placement.moved_m, network.road_by_id[placement.road_id].name
    (0.0, 'Main Street')
    """
    return _Placer(network, record, settings).place()


def is_at_intersection(record: CrashRecord) -> bool:
    """Whether the crash happened at or because of an intersection (``TYP_INT``, else ``RELJCT2``).

    >>> is_at_intersection(record), is_at_intersection(tree_record)
    (True, False)
    """
    if record.road_topology not in _NO_INTERSECTION:
        return True
    return record.road_topology == RoadTopology.OTHERS and record.junction_relation_code in _AT_INTERSECTION


def is_named(crossing: Crossing, record: CrashRecord) -> bool:
    """Whether a crossing is the one that the report names: both named streets meet there.

    >>> sum(is_named(crossing, record) for crossing in find_crossings(network))
    1
    """
    return _are_same_streets(_name_similarities(crossing, record))


def class_steps(record: CrashRecord, road: Road) -> float | None:
    """How many classes the reported functional class (``FUNC_SYS``) and a road's class on the map are apart.

    None if one of the two is not known: a driveway or a track has no functional class.

    >>> road = network.road_by_id[map_report.placement.road_id]
    >>> record.function_class_code, road.highway, round(class_steps(record, road), 1)  # a minor arterial
    (4, 'secondary', 0.2)
    """
    expected = _RANK_OF_FUNCTION.get(record.function_class_code or 0)
    mapped = road_class(road.highway)
    return abs(mapped.rank - expected) if expected is not None and mapped.public else None


@dataclass(frozen=True)
class _Candidate:
    road: Road
    distance_m: float
    score: float
    evidence: tuple[str, ...]
    name_similarity: float | None


class _Placer:
    def __init__(self, network: RoadNetwork, record: CrashRecord, settings: RoadSettings) -> None:
        self._network = network
        self._record = record
        self._settings = settings
        x_m, y_m = network.frame.to_local(record.latitude_deg, record.longitude_deg).tolist()
        self._x_m, self._y_m = float(x_m), float(y_m)
        self._crossings = find_crossings(network)
        self._near = roads_near(network, self._x_m, self._y_m, _LOOK_AROUND_M)

    def place(self) -> CrashPlacement:
        candidates = [self._judge(road_id, near.distance_m) for road_id, near in self._near.items()]
        if is_at_intersection(self._record):
            crossing = self._crossing()
            at_crossing = [c for c in candidates if crossing is not None and c.road.id in crossing.road_ids]
            if crossing is not None and any(c.distance_m <= self._settings.max_move_m for c in at_crossing):
                return self._at_crossing(crossing, _best(at_crossing))
        best = self._best_within_reach(candidates)
        matches = self._near[best.road.id].matches
        cross = self._named(self._record.trafficway_2, exclude=(best.road.id,))
        junction_id = None
        if self._record.junction_relation_code in _AT_DRIVEWAY:
            junction_id, driveways = self._driveway()
            cross = cross or driveways
        return self._placement(best, matches, junction_id, cross)

    # --- streets ---------------------------------------------------------------------------------------------
    def _judge(self, road_id: str, distance_m: float) -> _Candidate:
        road, record = self._network.road_by_id[road_id], self._record
        weights: dict[str, float] = {"distance": -math.log1p((distance_m / _DISTANCE_SCALE_M) ** 2)}
        named = similarity(record.trafficway_1, road.names)
        if named is not None:
            per_likeness, unlike = _NAME_WEIGHTS
            weights["name"] = per_likeness * named + unlike
        if named is None or named < SAME_STREET:
            crossing_name = similarity(record.trafficway_2, road.names)
            if crossing_name is not None and crossing_name >= SAME_STREET:
                weights["name of the other street"] = _OTHER_STREETS_NAME
        weights["class"] = _NOT_ITS_STREET if road.inferred else self._class_weight(road)
        if distance_m <= self._settings.max_move_m:
            weights |= self._street_weights(road)
        evidence = tuple(name for name, weight in weights.items() if weight > 0)
        return _Candidate(road, distance_m, sum(weights.values()), evidence, named)

    def _street_weights(self, road: Road) -> dict[str, float]:
        weights: dict[str, float] = {}
        street = carriageway_at(self._network, road.id, self._x_m, self._y_m)
        vehicles = pair_of(self._record)
        ways = [way for vehicle in vehicles if (way := trafficway_of(vehicle)) is not None]
        if ways:
            weights["trafficway"] = _TRAFFICWAY_WEIGHTS[trafficway_on_map(street) in ways]
        if road.lanes_from_tags and any(vehicle.lanes for vehicle in vehicles):
            fits = any(v.lanes in lanes_as_reported(street, trafficway_of(v)) for v in vehicles if v.lanes)
            weights["lanes"] = _LANES_WEIGHTS[fits]
        limits = [vehicle.speed_limit_mps for vehicle in vehicles if vehicle.speed_limit_mps]
        if limits and road.speed_mps is not None:
            posted = road.speed_mps
            weights["limit"] = _LIMIT_WEIGHTS[any(abs(limit - posted) < _SAME_SPEED_MPS for limit in limits)]
        return weights

    def _class_weight(self, road: Road) -> float:
        record = self._record
        weight = 0.0
        if road.highway in SERVICE_HIGHWAYS:
            return _SERVICE_WEIGHTS[record.junction_relation_code in _AT_DRIVEWAY]
        steps = class_steps(record, road)
        if steps is not None:
            weight += next(value for limit, value in _CLASS_WEIGHTS if steps < limit)
        on_ramp = (
            record.junction_relation_code in _ON_RAMP
            or parse_street(record.trafficway_1).ramp
            or any(trafficway_of(vehicle) == Trafficway.RAMP for vehicle in pair_of(record))
        )
        if road.highway.endswith("_link"):
            weight += _RAMP_WEIGHTS[on_ramp]
        return weight

    def _best_within_reach(self, candidates: list[_Candidate]) -> _Candidate:
        limit_m, reported = self._settings.max_move_m, self._record.trafficway_1
        within = [candidate for candidate in candidates if candidate.distance_m <= limit_m]
        if not within:
            nearest = min(candidates, key=lambda candidate: candidate.distance_m, default=None)
            far = f"no road is {_LOOK_AROUND_M:.0f} m"
            if nearest:
                far = f"the nearest road is {beside_limit(nearest.distance_m, limit_m)} m"
            raise Rejection(
                Reason.CRASH_OFF_ROAD,
                f"The reported point lies off the road: {far} away, more than {limit_m:g} m.",
                measured=nearest.distance_m if nearest else None,
                threshold=limit_m,
            )
        best = _best(within)
        named = [c for c in candidates if c.name_similarity is not None and c.name_similarity >= SAME_STREET]
        contradicted = best.name_similarity is not None and best.name_similarity < _OTHER_STREET
        if named and contradicted and not is_at_intersection(self._record):
            nearest_named = min(named, key=lambda candidate: candidate.distance_m)
            raise Rejection(
                Reason.CRASH_OFF_ROAD,
                f"The report names {reported}, which is {beside_limit(nearest_named.distance_m, limit_m)} m from the "
                f"reported point, more than {limit_m:g} m; the road there is {best.road.name or best.road.highway}.",
                measured=nearest_named.distance_m,
                threshold=limit_m,
            )
        return best

    def _named(self, reported: str, *, exclude: Collection[str]) -> tuple[str, ...]:
        """Roads near the point whose names fit a street name of the report."""
        if not reported:
            return ()
        return tuple(
            road_id
            for road_id in self._near
            if road_id not in exclude
            and (similarity(reported, self._network.road_by_id[road_id].names) or 0.0) >= SAME_STREET
        )

    # --- crossings -------------------------------------------------------------------------------------------
    def _crossing(self) -> Crossing | None:
        """The crossing that the report means, chosen by distance, names of streets, and kind."""
        record, best, best_score = self._record, None, -math.inf
        for crossing in self._crossings:
            if crossing.kind is None:
                continue
            distance_m = self._distance_to(crossing)
            similarities = _name_similarities(crossing, record)
            if distance_m > (_LOOK_AROUND_M if _are_same_streets(similarities) else self._settings.max_move_m):
                continue
            score = -math.log1p((distance_m / _CROSSING_SCALE_M) ** 2)
            per_likeness, unlike = _CROSSING_NAME_WEIGHTS
            score += sum(per_likeness * value + unlike for value in similarities if value is not None)
            score += _CROSSING_KIND_WEIGHT if crossing.kind == record.road_topology else 0.0
            if score > best_score:
                best, best_score = crossing, score
        return best

    def _distance_to(self, crossing: Crossing) -> float:
        """Distance from the point to the surface of a crossing's junctions (metres)."""
        inside = [
            match.outside_m
            for near in self._near.values()
            for match in near.matches
            if self._network.road_by_id[match.lane.road_id].junction_id in crossing.junction_ids
        ]
        if inside:
            return min(inside)
        return math.hypot(crossing.centre_xy_m[0] - self._x_m, crossing.centre_xy_m[1] - self._y_m)

    def _at_crossing(self, crossing: Crossing, best: _Candidate) -> CrashPlacement:
        names = {name for arm in crossing.arms for name in arm.names}
        surface = [match for near in self._near.values() for match in near.matches]
        surface = [match for match in dict.fromkeys(surface) if self._belongs(match.lane, crossing, names)]
        junction = min(crossing.junction_ids, key=lambda junction_id: self._junction_distance(junction_id))
        return self._placement(best, surface, junction, self._cross_roads(crossing, best.road))

    def _belongs(self, lane: LaneRef, crossing: Crossing, names: Collection[str]) -> bool:
        """Whether a lane belongs to the crossing or to one of its streets farther on (past the next driveway, for
        example)."""
        road = self._network.road_by_id[lane.road_id]
        if road.id in crossing.road_ids or road.junction_id in crossing.junction_ids:
            return True
        ends = (road,) if road.junction_id is None else joined_by(self._network, road)
        return all(not set(names).isdisjoint(end.names) for end in ends)

    def _junction_distance(self, junction_id: str) -> float:
        inside = [
            match.outside_m
            for near in self._near.values()
            for match in near.matches
            if self._network.road_by_id[match.lane.road_id].junction_id == junction_id
        ]
        return min(inside, default=math.inf)

    def _cross_roads(self, crossing: Crossing, road: Road) -> tuple[str, ...]:
        """Roads of the crossing other than the crash's own street; those that ``TWAY_ID2`` names, if it does."""
        own = set(crossing.street_of(road.id))
        others = [arm for arm in crossing.arms if own.isdisjoint(arm.road_ids)]
        if self._record.trafficway_2:
            named = [
                arm
                for arm in others
                if (similarity(self._record.trafficway_2, sorted(arm.names)) or 0.0) >= SAME_STREET
            ]
            others = named or others
        return tuple(road_id for arm in others for road_id in arm.road_ids)

    def _driveway(self) -> tuple[str | None, tuple[str, ...]]:
        """The junction of the nearest driveway within reach, and the driveways there."""
        best: tuple[float, str] | None = None
        for junction in self._network.junctions:
            distance_m = self._junction_distance(junction.id)
            if distance_m <= self._settings.max_move_m and self._driveways_at(junction.id):
                best = min(best or (distance_m, junction.id), (distance_m, junction.id))
        return (best[1], self._driveways_at(best[1])) if best else (None, ())

    def _driveways_at(self, junction_id: str) -> tuple[str, ...]:
        return tuple(
            road.id
            for road in self._network.roads
            if road.highway in SERVICE_HIGHWAYS
            and road.junction_id is None
            and any(
                link is not None and link.element_type == "junction" and link.element_id == junction_id
                for link in (road.predecessor, road.successor)
            )
        )

    # --- the point -------------------------------------------------------------------------------------------
    def _placement(
        self, best: _Candidate, matches: Iterable[LaneMatch], junction_id: str | None, cross: tuple[str, ...]
    ) -> CrashPlacement:
        nearest = min(matches, key=lambda match: (match.outside_m, abs(match.offset_m)))
        x_m, y_m = self._x_m, self._y_m
        if nearest.outside_m > 0:
            half_m = self._network.width_m(nearest.lane, nearest.s_m) / 2
            most_m = max(half_m - _INSIDE_LANE_M, 0.0)
            pose = self._network.pose(nearest.lane, nearest.s_m, min(max(nearest.offset_m, -most_m), most_m))
            x_m, y_m = pose.x_m, pose.y_m
        moved_m = math.hypot(x_m - self._x_m, y_m - self._y_m)
        distance = f"{best.distance_m:.1f} m from the point" if best.distance_m > 0 else "under the point"
        return CrashPlacement(
            x_m=x_m,
            y_m=y_m,
            z_m=self._network.surface_height_m(nearest.lane, nearest.s_m),
            road_id=best.road.id,
            moved_m=moved_m,
            matched_by=", ".join((*best.evidence, distance)),
            lane=self._network.project(nearest.lane, x_m, y_m),
            junction_id=junction_id,
            cross_road_ids=cross,
        )


def _best(candidates: list[_Candidate]) -> _Candidate:
    return max(candidates, key=lambda candidate: (candidate.score, -candidate.distance_m))


def _are_same_streets(similarities: Iterable[float | None]) -> bool:
    return all(value is not None and value >= SAME_STREET for value in similarities)


def _name_similarities(crossing: Crossing, record: CrashRecord) -> tuple[float | None, float | None]:
    first, second = (
        max(
            (value for arm in crossing.arms if (value := similarity(name, sorted(arm.names))) is not None), default=None
        )
        for name in (record.trafficway_1, record.trafficway_2)
    )
    return first, second
