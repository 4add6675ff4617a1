"""Log-likelihoods of the record's evidence, term by term.

Every function returns named terms, natural logarithms, 0 at best agreement. They are set by judgement, not fitted: each
is a Gaussian or a fixed penalty whose width reflects the usual differences between reports and maps. Hypotheses are
ranked by the sum; the terms are stored with each hypothesis as its evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mps_to_mph, wrap_angle
from trace_dag.crash.classes import CollisionType
from trace_dag.crash.crash_types import Relation, Turn, departs_at_end
from trace_dag.crash.record import CrashRecord, Heading, Moment, PreCrashMovement, VehicleRecord
from trace_dag.osm.road_classes import road_class
from trace_dag.reconstruction.motion.speeds import STOP_CONTROLS, class_speed_mps
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.roads.crash_site.street_names import is_same_street
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement
from trace_dag.simulation.states import Manoeuvre

if TYPE_CHECKING:
    from trace_dag.reconstruction.motion.manoeuvres import Option
    from trace_dag.reconstruction.scene.scene import Scene

CLOCK_SIGMA_RAD = math.radians(25)  # a clock position is 30 degrees wide; first contact and coded damage differ
_HALF_CLOCK_POSITION_RAD = math.radians(15)
PLACE_SIGMA_M = 2.5
LIMIT_SIGMA_MPH = 10.0
TRAVEL_SIGMA_MPH = 20.0
CURVE_RAD = math.radians(6)
TURN_LANE_WAY = 5  # VTRAFWAY: two-way, not divided, with a continuous left-turn lane
DRIVEWAY_WAY = 0  # VTRAFWAY: not on a trafficway; a driveway access
DRIVEWAY_MPH = 15.0
_INTERSECTION_RELATED = 3  # RELJCT2
_WITHIN_CROSSING_M = 10.0
_AWAY_FROM_CROSSING = {Relation.SAME_LANE: math.log(0.09 / 0.91), Relation.SAME_DIRECTION: math.log(0.22 / 0.78)}
_ON_OTHER_STREET = math.log(0.05 / 0.95)
FASTER_MPS = 5.0
_UNTAGGED_WIDTH = 1.5  # how much more the limits of a class of roads vary than that of one road

Terms = dict[str, float]


def street_terms(network: RoadNetwork, placement: CrashPlacement, record: CrashRecord, approach: Approach) -> Terms:
    """Score an approach by the streets that the record names.

    >>> street_terms(network, map_report.placement, record, next(s for s in scene.approaches if s.name == "7:2>6:2"))
    {}
    """
    if approach.road is None or approach.road.inferred:
        return {}
    if is_main(network, placement, approach.road):
        return {}
    if is_cross(network, placement, record, approach.road):
        return {} if record.trafficway_2 or placement.junction_id else {"street not named": -1.0}
    meets = placement.junction_id is not None and placement.junction_id in _ends(approach.road)
    return {"street not named": -0.5 if meets else -1.5}


def _ends(road: Road) -> set[str]:
    """Return the junctions at a road's ends."""
    links = (road.predecessor, road.successor)
    return {link.element_id for link in links if link is not None and link.element_type == "junction"}


def is_main(network: RoadNetwork, placement: CrashPlacement, road: Road) -> bool:
    """Return whether a road is the first trafficway of the record, by the placement of the crash."""
    return _same_street(network, placement.road_id, road)


def is_cross(network: RoadNetwork, placement: CrashPlacement, record: CrashRecord, road: Road) -> bool:
    """Return whether a road is the other street at the crossing.

    It is compared by the placement, or by the name in the record.
    """
    if any(_same_street(network, road_id, road) for road_id in placement.cross_road_ids):
        return True
    return bool(record.trafficway_2) and is_same_street(record.trafficway_2, road.names)


def _same_street(network: RoadNetwork, road_id: str, road: Road) -> bool:
    if road.id == road_id:
        return True
    other = network.road_by_id.get(road_id)
    return other is not None and bool(set(other.names) & set(road.names))


def crossing_ahead_terms(scene: Scene, relation: Relation, approach: Approach) -> Terms:
    """Score that two vehicles in one direction, in a crash related to an intersection, are on their way to it.

    The code is ``RELJCT2`` 3.

    In 3,089 rear ends and 587 sideswipes of a city whose table has directions and distances from the crossing, this is
    true in 91 and 78 % (88 % of leaders that slowed down, 92 % of those that stood).

    >>> crossing_ahead_terms(scene, Relation.SAME_LANE, scene.through[0])  # this crash was in the intersection
    {}
    """
    junction = scene.network.junction_by_id.get(scene.placement.junction_id or "")
    away = _AWAY_FROM_CROSSING.get(relation)
    if scene.record.junction_relation_code != _INTERSECTION_RELATED or away is None:
        return {}
    if junction is None or junction.centre_xy_m is None:
        return {}
    crossing_m, _ = approach.path.project(*junction.centre_xy_m)
    return {"away from the crossing": away} if approach.station_m > crossing_m + _WITHIN_CROSSING_M else {}


def first_street_terms(scene: Scene, keep_on: Sequence[Approach], *, cross: bool = False) -> Terms:
    """Score that a vehicle travelled on the first of two recorded streets.

    A vehicle that goes straight did so; if two vehicles ``cross``, one of them did.

    ``keep_on`` has the approaches of vehicles that neither turn nor back. In a city's table with directions this is
    true in 99 % of 5,300 rear ends, for 94 % of 2,700 vehicles that met a turning one, and for 87 % of 220 drivers who
    struck a person.

    >>> first_street_terms(scene, scene.through[:1])  # along the street named first
    {}
    """
    if not keep_on or not scene.record.trafficway_2 or any(each.share_of_ring for each in keep_on):
        return {}  # around a roundabout traffic of all its streets goes
    along = [each.road is not None and is_main(scene.network, scene.placement, each.road) for each in keep_on]
    fits = any(along) if cross else all(along)
    return {} if fits else {"not on the street named first": _ON_OTHER_STREET}


def road_terms(vehicle: VehicleRecord, approach: Approach) -> Terms:
    """Score the approach's limit, lanes, division and alignment against the vehicle's form."""
    terms: Terms = {}
    road = approach.road
    if road is not None and road.inferred:
        if vehicle.trafficway_code != DRIVEWAY_WAY:
            terms["not on the map"] = -2.0 if vehicle.trafficway_code is None else -3.0
    elif road is not None:
        if vehicle.speed_limit_mps:
            usual_mps, sigma_mph = _usual_speed(road, LIMIT_SIGMA_MPH)
            apart = mps_to_mph(vehicle.speed_limit_mps - usual_mps) / sigma_mph
            terms["speed limit"] = -min(0.5 * apart**2, 1.0)
        divided = vehicle.trafficway_code in (2, 3, 4, 6, 7)
        if vehicle.trafficway_code in (1, 2, 3, 4, 5, 6, 7) and divided != approach.one_way:
            terms["division of the road"] = -0.5
        if vehicle.trafficway_code == TURN_LANE_WAY and not approach.centre_lane_beside:
            terms["no centre turn lane"] = -0.5
        if vehicle.lanes:
            counted = approach.lanes_along if divided or approach.one_way else approach.lanes_total
            terms["lanes"] = -0.3 * min(abs(counted - vehicle.lanes), 3) * (1.0 if road.lanes_from_tags else 0.5)
        if vehicle.trafficway_code == 0:
            terms["driveway reported"] = 0.0 if road.highway == "service" else -1.0
    curve = {1: 0, 2: -1, 3: 1}.get(vehicle.alignment_code or 0)  # VALIGN: straight, curve right, curve left
    if curve is not None:
        seen = 0 if abs(approach.curve_rad) < CURVE_RAD else int(math.copysign(1, approach.curve_rad))
        terms["alignment"] = -0.75 * abs(curve - seen)
    if approach.wrong_way:
        # A driver who goes the wrong way takes the carriageway for a two-way road and keeps to its own side of it:
        # beside the median.
        terms["wrong way"] = -2.0 - 0.4 * approach.lane_from_centre
    terms["around the roundabout"] = -1.5 * approach.share_of_ring  # of the way around: most leave a roundabout early
    if approach.extended and not (road is not None and road.inferred) and not departs_at_end(vehicle):
        terms["straight on where the road ends"] = -1.0
    return {name: value for name, value in terms.items() if value}


def heading_terms(vehicle: VehicleRecord, option: Option) -> Terms:
    """Score the vehicle's direction against its reported direction of travel, if there is one.

    >>> heading_terms(record.vehicles[0], None)  # FARS gives none
    {}
    """
    if vehicle.heading is None or option.backing:  # who backs is reported as it faces or as it goes
        return {}
    approach, turned_rad = option.approach, None
    if option.turn is not None:
        turned_rad = option.turn.angle_rad
    elif option.manoeuvre in _TURNS:
        turned_rad = approach.curve_rad
    return {"reported direction": heading_log_likelihood(vehicle.heading, approach.heading_rad, turned_rad)}


def heading_log_likelihood(heading: Heading, heading_rad: float, turned_rad: float | None = None) -> float:
    """Return the log-likelihood of a reported direction of travel for a party that turns by ``turned_rad``.

    >>> from trace_dag.crash.record import Octant
    >>> north = Heading(Octant.NORTH)
    >>> [round(heading_log_likelihood(north, math.radians(degrees)), 1) for degrees in (90, -90)]
    [0.0, -6.3]
    """
    shares = _TURNED_SHARES[heading.moment] if turned_rad is not None else _TURNED_SHARES[Moment.BEFORE]
    likelihood = math.fsum(
        share * math.exp(-0.5 * (wrap_angle(heading.octant.heading_rad - way_rad) / HEADING_SIGMA_RAD) ** 2)
        for turned_share, share in shares.items()
        for way_rad in [heading_rad + turned_share * (turned_rad or 0.0)]
    )
    return math.log((1 - WRONG_HEADING) * likelihood + WRONG_HEADING / _OTHER_OCTANTS) - math.log(
        (1 - WRONG_HEADING) * max(shares.values()) + WRONG_HEADING / _OTHER_OCTANTS
    )


WRONG_HEADING = 1 - math.sqrt(0.975)
"""Share of reported directions that are wrong: 97.5 % of pairs in a rear end are reported to go the same way."""
HEADING_SIGMA_RAD = math.radians(22.5)  # half an octant; police name the compass by the street, which may run askew
_OTHER_OCTANTS = 7
_TURNED_SHARES = {
    Moment.BEFORE: {0.0: 1.0},
    Moment.AFTER: {1.0: 1.0},
    Moment.UNKNOWN: {0.0: 0.55, 0.5: 0.22, 1.0: 0.23},
}
"""By the moment, how far through its turn a vehicle was headed as reported, and how often; of the unknown one fitted to
3,629 left turns before a vehicle that went straight on, in a city's register that does not say it."""
_TURNS = frozenset({Manoeuvre.TURN_LEFT, Manoeuvre.TURN_RIGHT, Manoeuvre.U_TURN})


def lane_terms(vehicle: VehicleRecord, approach: Approach, turn: Turn | None) -> Terms:
    """Score the lane by the manoeuvres that are made from it.

    >>> rider = record.vehicles[1]
    >>> {str(lane_terms(rider, approach, None)) for approach in scene.through}  # whoever goes straight on uses any lane
    {'{}'}
    """
    terms: Terms = {}
    from_kerb = approach.lanes_along - 1 - approach.lane_from_centre
    across = turn in (approach.turn_across, Turn.U_TURN)
    if approach.centre_lane:
        terms["turn from this lane"] = 0.0 if across else -3.0
    elif across:
        beside_centre = 0.5 if approach.centre_lane_beside else 0.0
        terms["turn from this lane"] = -1.0 * approach.lane_from_centre - beside_centre
    elif turn is not None:
        terms["turn from this lane"] = -1.0 * from_kerb
    elif vehicle.movement is PreCrashMovement.MERGING:
        terms["merging from this lane"] = -1.0 * from_kerb
    arrows = {arrow for value in approach.lane_turns for arrow in value.split(";") if arrow in _ARROWS}
    if arrows:
        wanted = {Turn.LEFT: "left", Turn.RIGHT: "right", Turn.U_TURN: "reverse", None: "through"}[turn]
        if not any(wanted in arrow for arrow in arrows):
            terms["arrow of the lane"] = -1.5
    return {name: value for name, value in terms.items() if value}


_ARROWS = frozenset(
    {"left", "slight_left", "sharp_left", "through", "right", "slight_right", "sharp_right", "reverse"}
)  # OSM turn:lanes values that say where a lane leads; "none", "merge_to_left" and the like do not


def speed_terms(vehicle: VehicleRecord, approach: Approach, turn: Turn | None) -> Terms:
    """Score the reported speed of through traffic against the road's limit.

    >>> speed_terms(record.vehicles[0], scene.approaches[0], Turn.LEFT)  # who turns slows down: nothing to compare
    {}
    """
    road = approach.road
    if vehicle.travel_speed_mps is None or road is None or turn is not None:
        return {}
    if (
        vehicle.movement is not PreCrashMovement.GOING_STRAIGHT
        and vehicle.movement is not PreCrashMovement.NEGOTIATING_CURVE
    ):
        return {}
    usual_mps, sigma_mph = _usual_speed(road, TRAVEL_SIGMA_MPH)
    apart = mps_to_mph(vehicle.travel_speed_mps - usual_mps) / sigma_mph
    return {"speed for this road": -min(0.5 * apart**2, 1.5)}


def _usual_speed(road: Road, sigma_mph: float) -> tuple[float, float]:
    """Return the usual speed and its spread, from the road's limit.

    If the map has no limit, it is from the road's class, with more spread.
    """
    if road.speed_mps:
        return road.speed_mps, sigma_mph
    return class_speed_mps(road), _UNTAGGED_WIDTH * sigma_mph


def driveway_speed_terms(approach: Approach, speed_mps: float) -> Terms:
    """Score speeds out of a driveway, reported or inferred, which are lower than along a road.

    >>> driveway_speed_terms(scene.through[0], 20.0)  # a road of the map
    {}
    """
    if approach.road is None or not approach.road.inferred:
        return {}
    faster_mph = max(mps_to_mph(speed_mps) - DRIVEWAY_MPH, 0.0)
    return {"fast for a driveway": -min(0.5 * (faster_mph / LIMIT_SIGMA_MPH) ** 2, 3.0)} if faster_mph else {}


@dataclass(frozen=True)
class CrossingVehicle:
    """One of two vehicles whose paths cross: its report, approach and speed."""

    vehicle: VehicleRecord
    approach: Approach
    speed_mps: float


def crossing_terms(one: CrossingVehicle, two: CrossingVehicle) -> Terms:
    """Score two vehicles that cross straight; the one on the lesser road should stop or slow down.

    >>> one = CrossingVehicle(record.vehicles[1], scene.through[0], 13.4)
    >>> crossing_terms(one, one)  # neither road is the lesser one
    {}
    """
    greater, lesser = sorted((one, two), key=lambda each: _rank(each.approach.road))
    if _rank(greater.approach.road) == _rank(lesser.approach.road):
        return {}
    terms: Terms = {}
    if lesser.speed_mps > greater.speed_mps + FASTER_MPS:
        terms["faster on the lesser road"] = -1.0
    stops_greater, stops_lesser = (each.vehicle.traffic_control_code in STOP_CONTROLS for each in (greater, lesser))
    if stops_greater and not stops_lesser:
        terms["stop sign on the greater road alone"] = -1.0
    return terms


def _rank(road: Road | None) -> int:
    """Return the rank of a road's class, 0 for the most important; a vehicle without a road came from a driveway."""
    return road_class(road.highway if road is not None else "service").rank


def impact_area_log_likelihood(vehicle: VehicleRecord, bearing_rad: FloatArray) -> FloatArray:
    """Return the log-likelihood of contact bearings, shape (n,), given the reported area; 0 without an area."""
    if vehicle.impact is None:
        return np.zeros_like(bearing_rad)
    apart = np.abs(np.remainder(bearing_rad - vehicle.impact.centre_rad + math.pi, math.tau) - math.pi)
    # A wide area (a whole side) is coded by its middle: a wider spread, but the middle is still the likeliest.
    sigma = CLOCK_SIGMA_RAD + max(vehicle.impact.half_width_rad - _HALF_CLOCK_POSITION_RAD, 0.0) / 2
    return np.asarray(-0.5 * (apart / sigma) ** 2)


def manner_log_likelihood(record: CrashRecord, bearing_1_rad: FloatArray, bearing_2_rad: FloatArray) -> FloatArray:
    """Return the log-likelihood of the struck faces, bearings of shape (n,), given ``MAN_COLL``.

    It matters if the areas of impact are not reported. The manner is that of the first harmful event.

    >>> ahead, behind = np.zeros(1), np.full(1, math.pi)
    >>> manner_log_likelihood(queue_record, ahead, behind).tolist()  # MAN_COLL 1: front to rear
    [0.0]
    """
    wanted = _FACES.get(record.collision_type)
    if wanted is None:
        return np.zeros_like(bearing_1_rad)
    along_1, along_2 = np.cos(bearing_1_rad), np.cos(bearing_2_rad)
    first, second = wanted
    fits = (_on_face(along_1, first) & _on_face(along_2, second)) | (
        _on_face(along_1, second) & _on_face(along_2, first)
    )
    return np.asarray(np.where(fits, 0.0, _OTHER_MANNER))


_OTHER_MANNER = -1.0
_FACES = {
    CollisionType.FRONT_TO_REAR: ("front", "rear"),
    CollisionType.FRONT_TO_FRONT: ("front", "front"),
    CollisionType.REAR_TO_REAR: ("rear", "rear"),
    CollisionType.REAR_TO_SIDE: ("rear", "side"),
    CollisionType.ANGLE: ("any", "side"),
}


def _on_face(along: FloatArray, face: str) -> NDArray[np.bool_]:
    if face == "any":
        return np.ones_like(along, dtype=bool)
    if face == "front":
        return along > _FACE_COSINE
    if face == "rear":
        return along < -_FACE_COSINE
    return np.abs(along) < 1 - _FACE_COSINE / 2


_FACE_COSINE = math.cos(math.radians(55))  # corners belong to both faces


def place_log_likelihood(record: CrashRecord, distance_m: FloatArray) -> FloatArray:
    """Return the log-likelihood of a contact at a distance (metres) from the reported place.

    A register states the usual error of its points; FARS' points are taken as exact to 2.5 m.

    >>> place_log_likelihood(record, np.array([PLACE_SIGMA_M])).tolist()
    [-0.5]
    """
    sigma_m = max(PLACE_SIGMA_M, record.position_accuracy_m or 0.0)
    return np.asarray(-0.5 * (distance_m / sigma_m) ** 2)
