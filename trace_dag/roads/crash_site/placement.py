"""Placement of the crash on the map: road, place along it, crossing.

The reported point is a coded point: some metres beside the road, on the wrong carriageway, or on the bridge above. So
the road is chosen by the report: its name or number, the numbering system, class, lanes, limit, whether it is divided
or a ramp, and the distance of the point. Each of these gives a log-likelihood ratio (how many times likelier such a
report is for this road than for another), and they are added up. The weights are measured by
``lab/placement_weights.py`` on stored maps (127 roads with the reported name against 316 others within 100 m; crashes
in Virginia in 2023 and FARS 2012 to 2016), or set by judgement where marked. Facts of a road are correlated (a wide
road has a high limit), so each weighs half of its value alone.

A road is excluded if it contradicts the report outright: a street of another name while the reported one is elsewhere
on the map, a town street for an interstate, or a mainline for a ramp that the map has. A point beside a road is also
not assigned to it if only the limit fits.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.messages.wording import beside_limit
from trace_dag.common.settings import RoadSettings
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.road_classes import SERVICE_HIGHWAYS, road_class
from trace_dag.roads.crash_site.crossings import Crossing, find_crossings
from trace_dag.roads.crash_site.reported_road import (
    contradiction,
    has_name_of_another,
    is_numbered_as_reported,
    is_on_ramp,
    is_town_street_for_interstate,
    lanes_as_reported,
    pair_of,
    trafficway_of,
    trafficway_on_map,
)
from trace_dag.roads.crash_site.street_names import SAME_STREET, is_same_street, similarity
from trace_dag.roads.crash_site.streets import carriageway_at, joined_by, roads_near
from trace_dag.roads.map.model import LaneMatch, LaneRef, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement

_LOOK_AROUND_M: Final = 100.0  # a road with the reported name is looked for this far, even if no crash is moved so far
_DISTANCES_M: Final = (0.0, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0)
_DISTANCE_WEIGHTS: Final = (3.4, 2.3, 1.6, 0.1, -1.7, -2.2, -2.9)  # so far beside the road's surface: measured
_CROSSING_SCALE_M: Final = 15.0  # judgement: crossings are this wide and are reported by their middle
_NAME_WEIGHTS: Final = (5.5, -1.5)
"""Per unit of likeness, and for no likeness at all. Judgement: names tell which road is which, so there is nothing to
measure them against. They outweigh all else together within a lane or two of the point."""
_OTHER_STREETS_NAME: Final = -2.0  # judgement: it has the name of the street that is crossed
_NAME_ELSEWHERE: Final = -4.0  # judgement: it has not the reported name, which another road of the map bears
_CLASS_WEIGHTS: Final = ((0.9, 0.2), (1.7, 0.1), (2.7, -0.7), (math.inf, -0.9))  # by steps between classes, up to
_TRAFFICWAY_WEIGHTS: Final = {True: 0.1, False: -0.6}
_LANES_WEIGHTS: Final = {True: 0.15, False: -0.65}
_LIMIT_WEIGHTS: Final = {True: 0.2, False: -0.75}
_SYSTEM_WEIGHTS: Final = {True: 0.8, False: -1.0}  # ROUTE, by who numbers the road
_TOWN_STREET_FOR_INTERSTATE: Final = -4.0  # judgement, as for names
_RAMP_WEIGHTS: Final = {True: 1.5, False: -1.5}  # a ramp, reported as one or not: judgement, too few to measure
_MAINLINE_FOR_RAMP: Final = -4.0  # judgement, as for names
_SERVICE_WEIGHTS: Final = {True: -1.0, False: -2.5}  # a service road, at a driveway or not: judgement
_CROSSING_NAME_WEIGHTS: Final = (4.0, -1.0)  # as for roads, for each of the crossing's two names: judgement
_CROSSING_KIND_WEIGHT: Final = 1.0  # judgement: TYP_INT and the map's number of arms agree
_INSIDE_LANE_M: Final = 1.0  # a moved point comes to lie this far inside the lane's border: judgement
_NOT_ITS_STREET: Final = -10.0  # a driveway that was drawn for this crash: more than all other evidence together
_SAME_SPEED_MPS: Final = 1.2  # half a step of posted limits

# FUNC_SYS: interstate, other freeway, principal arterial, minor arterial, major and minor collector, local. Between two
# of OSM's classes where mappers use either; how far between is judgement.
_RANK_OF_FUNCTION: Final = {1: 0.0, 2: 0.7, 3: 2.0, 4: 2.8, 5: 3.7, 6: 4.4, 7: 5.6}
_AT_POINT_M: Final = 5.0  # a road this near to the point needs nothing else that speaks for it
_AT_DRIVEWAY: Final = (4, 8)  # RELJCT2
_AT_INTERSECTION: Final = (2, 3)  # RELJCT2
_NO_INTERSECTION: Final = (RoadTopology.NOT_AN_INTERSECTION, RoadTopology.OTHERS)


def place_crash(network: RoadNetwork, record: CrashRecord, settings: RoadSettings) -> CrashPlacement:
    """Return the crash on the map, in the network's frame.

    A point on the surface of its road stays where it is. A point beside it is moved just inside the nearest lane, by at
    most ``settings.max_move_m``.

    Raises :class:`Rejection` (``crash_off_road``) if no road is that near, if the report contradicts the likeliest road
    outright, or if the point is beside the road and only the limit fits.

    >>> from trace_dag.common.settings import RoadSettings
    >>> placement = place_crash(network, record, RoadSettings())
    >>> placement.moved_m, network.road_by_id[placement.road_id].name
    (0.0, 'Main Street')
    """
    return _Placer(network, record, settings).place()


def is_at_intersection(record: CrashRecord) -> bool:
    """Return whether the crash happened at or because of an intersection (``TYP_INT``, else ``RELJCT2``).

    >>> is_at_intersection(record), is_at_intersection(tree_record)
    (True, False)
    """
    if record.road_topology not in _NO_INTERSECTION:
        return True
    return record.road_topology == RoadTopology.OTHERS and record.junction_relation_code in _AT_INTERSECTION


def is_named(crossing: Crossing, record: CrashRecord) -> bool:
    """Return whether the report names the crossing: both named streets meet there.

    >>> sum(is_named(crossing, record) for crossing in find_crossings(network))
    1
    """
    return _are_same_streets(_name_similarities(crossing, record))


def class_steps(record: CrashRecord, road: Road) -> float | None:
    """Return the number of classes between the reported functional class (``FUNC_SYS``) and the road's mapped class.

    None if one of the two is unknown: a driveway or a track has no functional class.

    >>> road = network.road_by_id[map_report.placement.road_id]
    >>> record.function_class_code, road.highway, round(class_steps(record, road), 1)  # a minor arterial
    (4, 'secondary', 0.2)
    """
    expected = _RANK_OF_FUNCTION.get(record.function_class_code or 0)
    mapped = road_class(road.highway)
    return abs(mapped.rank - expected) if expected is not None and mapped.public else None


@dataclass(frozen=True)
class _Candidate:
    """A road near the point, with the weight of each reported fact for it (log-likelihood ratio)."""

    road: Road
    distance_m: float
    weights: dict[str, float]

    @property
    def score(self) -> float:
        return math.fsum(self.weights.values())

    @property
    def evidence(self) -> tuple[str, ...]:
        return tuple(name for name, weight in self.weights.items() if weight > 0 and name != "distance")

    @property
    def speaks_for_it(self) -> float:
        """Score a road by the report without the point and the limit, which many roads share."""
        return math.fsum(weight for name, weight in self.weights.items() if name not in ("distance", "limit"))


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
                best = _best(at_crossing)
                names = {name for arm in crossing.arms for name in arm.names}
                if not contradiction(self._record, best.road, names | set(best.road.names), self._network):
                    return self._at_crossing(crossing, best)
        best = self._best_within_reach(candidates)
        self._require_no_contradiction(best.road)
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
        weights: dict[str, float] = {"distance": float(np.interp(distance_m, _DISTANCES_M, _DISTANCE_WEIGHTS))}
        named = None if is_on_ramp(record) and not road.is_ramp else similarity(record.trafficway_1, road.names)
        if named is not None:
            per_likeness, unlike = _NAME_WEIGHTS
            weights["name"] = per_likeness * named + unlike
        if (named or 0.0) < SAME_STREET <= (similarity(record.trafficway_2, road.names) or 0.0):
            weights["name of the other street"] = _OTHER_STREETS_NAME
        elif has_name_of_another(record, road.names, self._network):
            weights["name of another road"] = _NAME_ELSEWHERE
        numbered = is_numbered_as_reported(record, road)
        if numbered is not None:
            weights["route"] = _SYSTEM_WEIGHTS[numbered]
        if is_town_street_for_interstate(record, road):
            weights["town street"] = _TOWN_STREET_FOR_INTERSTATE
        if road.is_ramp:
            weights["ramp"] = _RAMP_WEIGHTS[is_on_ramp(record)]
        elif is_on_ramp(record):
            weights["mainline"] = _MAINLINE_FOR_RAMP
        weights["class"] = _NOT_ITS_STREET if road.inferred else self._class_weight(road)
        if distance_m <= self._settings.max_move_m:
            weights |= self._street_weights(road)
        return _Candidate(road, distance_m, weights)

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
        if road.highway in SERVICE_HIGHWAYS:
            return _SERVICE_WEIGHTS[self._record.junction_relation_code in _AT_DRIVEWAY]
        steps = class_steps(self._record, road)
        return 0.0 if steps is None else next(value for limit, value in _CLASS_WEIGHTS if steps < limit)

    def _best_within_reach(self, candidates: list[_Candidate]) -> _Candidate:
        limit_m = self._settings.max_move_m
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
        if best.distance_m > _AT_POINT_M and best.speaks_for_it <= 0.0:
            raise Rejection(
                Reason.CRASH_OFF_ROAD,
                f"The reported point lies {best.distance_m:.1f} m beside {best.road.name or best.road.highway}, and "
                "nothing that the report says of its road, but its limit, speaks for that one.",
                measured=best.distance_m,
                threshold=_AT_POINT_M,
            )
        return best

    def _require_no_contradiction(self, road: Road) -> None:
        """Raise :class:`Rejection` if the report rules out this road."""
        against = contradiction(self._record, road, road.names, self._network)
        if against:
            named = self._named(self._record.trafficway_1, exclude=())
            measured = min((self._near[road_id].distance_m for road_id in named), default=None)
            raise Rejection(Reason.CRASH_OFF_ROAD, against, measured=measured, threshold=self._settings.max_move_m)

    def _named(self, reported: str, *, exclude: Collection[str]) -> tuple[str, ...]:
        """Return roads near the point whose names match a reported street name."""
        if not reported:
            return ()
        return tuple(
            road_id
            for road_id in self._near
            if road_id not in exclude and is_same_street(reported, self._network.road_by_id[road_id].names)
        )

    # --- crossings -------------------------------------------------------------------------------------------
    def _crossing(self) -> Crossing | None:
        """Return the reported crossing, chosen by distance, street names and kind."""
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
            score += math.fsum(per_likeness * value + unlike for value in similarities if value is not None)
            score += _CROSSING_KIND_WEIGHT if crossing.kind == record.road_topology else 0.0
            if score > best_score:
                best, best_score = crossing, score
        return best

    def _distance_to(self, crossing: Crossing) -> float:
        """Return the distance from the point to the surface of a crossing's junctions (metres)."""
        nearest_m = min(map(self._junction_distance, crossing.junction_ids))
        return nearest_m if nearest_m < math.inf else math.dist(crossing.centre_xy_m, (self._x_m, self._y_m))

    def _at_crossing(self, crossing: Crossing, best: _Candidate) -> CrashPlacement:
        names = {name for arm in crossing.arms for name in arm.names}
        surface = [match for near in self._near.values() for match in near.matches]
        surface = [match for match in dict.fromkeys(surface) if self._belongs(match.lane, crossing, names)]
        junction = min(crossing.junction_ids, key=self._junction_distance)
        return self._placement(best, surface, junction, self._cross_roads(crossing, best.road))

    def _belongs(self, lane: LaneRef, crossing: Crossing, names: Collection[str]) -> bool:
        """Return whether a lane belongs to the crossing or to a further part of one of its streets."""
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
        """Return roads of the crossing other than the crash's own street; if ``TWAY_ID2`` names some, only these."""
        own = set(crossing.street_of(road.id))
        others = [arm for arm in crossing.arms if own.isdisjoint(arm.road_ids)]
        if self._record.trafficway_2:
            named = [arm for arm in others if is_same_street(self._record.trafficway_2, arm.names)]
            others = named or others
        return tuple(road_id for arm in others for road_id in arm.road_ids)

    def _driveway(self) -> tuple[str | None, tuple[str, ...]]:
        """Return the junction of the nearest driveway within reach, and its driveways."""
        near = [(self._junction_distance(junction.id), junction.id) for junction in self._network.junctions]
        for distance_m, junction_id in sorted(near):
            if distance_m <= self._settings.max_move_m and (driveways := self._driveways_at(junction_id)):
                return junction_id, driveways
        return None, ()

    def _driveways_at(self, junction_id: str) -> tuple[str, ...]:
        return tuple(
            road.id
            for road in self._network.roads
            if road.highway in SERVICE_HIGHWAYS and road.junction_id is None and junction_id in road.linked_junctions
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
            z_m=self._network.road_geometry(nearest.lane.road_id).height_at(nearest.s_m),
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
    names = {name for arm in crossing.arms for name in arm.names}
    return similarity(record.trafficway_1, names), similarity(record.trafficway_2, names)
