"""A vehicle strikes one that is parked or at work: where the standing one is, and how the other comes to it.

A vehicle that stands beside the road is on the right of its direction of travel (on a one-way road on either side). The
coded zone (``REL_ROAD``) says whether it is at the kerb within the carriageway, on the shoulder or in the parking lane,
or beyond. Its exact place across the road is not coded. The moving vehicle drifts out of its lane towards it.

A vehicle, or a person on foot, that stood on a vehicle's way after its first event is put where the vehicle comes
along, so that both are touched on the reported areas. Nothing says where it stood but the sequence of events. Frame:
the local frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import Path
from trace_dag.common.settings import StateSettings
from trace_dag.crash.codes.elements import RAN_OFF_LEFT, RAN_OFF_RIGHT
from trace_dag.crash.crash_types import Side
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import NonMotorist, VehicleRecord
from trace_dag.crash.zones import Zone, zones_of_first_event
from trace_dag.reconstruction.assemble import (
    Drive,
    after_impact_s,
    drive_along,
    planned_hypothesis,
    stand_still,
)
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.evidence import impact_area_log_likelihood, place_log_likelihood
from trace_dag.reconstruction.motion.contact import Contacts, Mover, contact_points_of, first_contacts
from trace_dag.reconstruction.motion.manoeuvres import Option, drift, keep_lane
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.planners.impact_plans import DRIFT_G
from trace_dag.reconstruction.planners.pedestrian import person_met
from trace_dag.reconstruction.planners.way_after import Way, ways_on
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.ranking import Scored, leaders_first
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.simulation.states import (
    EstimateCheck,
    Hypothesis,
    Manoeuvre,
    ParticipantState,
    PlannedEvent,
    SpeedSource,
)

_FROM_KERB_M: Final = 0.3
_BEYOND_EDGE_M: Final = {Zone.BESIDE: 0.3, Zone.WALKED: 0.6, Zone.OUTSIDE: 3.0}
"""Distances beyond the carriageway's edge of the side towards it."""
_SWERVE_G: Final = 0.2
_OVERLAPS: Final = (0.0, 0.45, -0.45, 0.8, -0.8)
"""Offsets of the two from each other, as shares of half their widths together."""
_OTHER_SIDE: Final = -3.0  # log-likelihood of leaving to the side that the report does not say
_ACROSS: Final = -1.5  # of leaving across oncoming traffic, if no side is reported
_IN_THE_LANE: Final = -1.0  # of standing in the middle of a lane, not at its edge
_ABRUPT: Final = -0.5
_ACROSS_SAYS: Final = 0.25
_LEAST_DRIFT_M: Final = 0.3
_LONGEST_AFTER_S: Final = 8.0
_SLIDES: Final = 3
_DECIMALS: Final = 6
_ROUNDED: Final = 1e-5  # more than rounding takes from a score
_SHARES: Final = (0.25, 0.5, 0.1, 0.75)  # of the way, at which a later one is tried
_LEAST_M: Final = 2.0  # from where the vehicle was


@dataclass(frozen=True, eq=False)
class Stand:
    """One place to stand along an approach, in a zone; ``terms`` are its log-likelihoods."""

    option: Option
    zone: Zone
    terms: dict[str, float] = field(default_factory=dict)


STANDS: Final = TravelSpeed(0.0, SpeedSource.INFERRED_MANOEUVRE)


def stands(scene: Scene, vehicle: VehicleRecord) -> Iterator[Stand]:
    """Yield the possible places of a parked or working vehicle, by the zone of the first harmful event.

    >>> zones = {stand.zone.value for stand in stands(scene, record.vehicles[0])}
    >>> zones  # the first harmful event was on the roadway
    {'carriageway'}
    """
    zones = zones_of_first_event(scene.record) or frozenset({Zone.CARRIAGEWAY})
    for approach in scene.on_road(scene.through):
        if approach.wrong_way:
            continue
        kerb = approach.kerb_sign
        for side in (kerb, -kerb) if approach.one_way else (kerb,):
            edge = scene.network.drivable_area.edge_beside_m(approach.path.pose(approach.station_m), side)
            for zone in sorted(zones):
                if zone is Zone.CARRIAGEWAY:
                    at_edge = edge - vehicle.width_m / 2 - _FROM_KERB_M
                    if at_edge > _LEAST_DRIFT_M:
                        yield _stand(approach, zone, vehicle, side * at_edge)
                    if side == kerb:
                        yield _stand(approach, zone, vehicle, 0.0, {"in the middle of a lane": _IN_THE_LANE})
                else:
                    yield _stand(approach, zone, vehicle, side * (edge + _BEYOND_EDGE_M[zone] + vehicle.width_m / 2))


def _stand(
    approach: Approach, zone: Zone, vehicle: VehicleRecord, offset_m: float, terms: dict[str, float] | None = None
) -> Stand:
    return Stand(keep_lane(approach, vehicle, 0.0, offset_m=round(offset_m, 3)), zone, terms or {})


@dataclass(frozen=True, eq=False)
class _Plan(Scored):
    """The contact of one path with one standing place."""

    drive: Drive
    stand: Stand
    parked: Drive
    bearings_rad: tuple[float, float]
    contact_xy_m: tuple[float, float]
    terms: dict[str, float]

    @property
    def group(self) -> tuple[str, str, float]:
        """Return the group; plans of one group differ only in detail."""
        stand = self.parked.option
        return self.drive.option.approach.name, stand.approach.name, stand.constant_m

    @property
    def name(self) -> str:
        """Return the ways of both vehicles."""
        both = self.drive, self.parked
        return "; ".join(f"vehicle {each.party.vehicle.number}: {each.option.name}" for each in both)


def parked_contacts(search: Search, settings: StateSettings) -> tuple[Hypothesis, ...]:
    """Return the ranked hypotheses of a moving vehicle that strikes a standing one first, at most so many.

    Raises :class:`Rejection` (``no_feasible_state``) where no way past the crash leads the one to the other.

    >>> from dataclasses import replace
    >>> from trace_dag.crash.event_sequence import EventSequence
    >>> from trace_dag.crash.parties import EventKind
    >>> from trace_dag.reconstruction.course import default_simulation
    >>> car = tree_record.vehicles[0]
    >>> contact = CrashEvent(1, 14, EventKind.VEHICLE_CONTACT, car, None, replace(car, number=2, in_transport=False))
    >>> simulation = default_simulation(tree_scene.network, tree_record)
    >>> search = Search(tree_scene, EventSequence((contact,)), simulation, 5.0)
    >>> best = parked_contacts(search, StateSettings(lead_time_s=5.0, max_hypotheses=1))[0]
    >>> [(state.vehicle_number, state.initial_speed_mps) for state in best.participants]  # 50 mph, and parked
    [(1, 22.352), (2, 0.0)]
    """
    scene, contact, most = search.scene, search.sequence.first, settings.max_hypotheses
    driven_one, standing = sorted(contact.vehicles, key=lambda vehicle: not vehicle.in_transport)
    who = party(scene.record, driven_one)
    tries = [
        _Try(number, speed, profile, terms, stand, moved)
        for number, (option, speed, terms, stand) in enumerate(
            (*way, stand) for way in approaches_of(scene, who) for stand in stands(scene, standing)
        )
        if (profile := speed_profile(who, speed.speed_mps)).impact_mps >= 1.0
        for share in _OVERLAPS
        for moved in _towards(scene, who, option, stand, standing, share)
    ]
    tries.sort(key=lambda each: -each.most)  # stable: of equal ones the first
    best: dict[int, _Plan] = {}
    leading: dict[tuple[str, str, float], float] = {}  # the best score of each group
    for each in tries:
        if len(leading) >= most and each.most < sorted(leading.values())[-most] - _ROUNDED:
            break  # what is known of these before the contact is looked at makes them too unlikely already
        plan = _plan(scene, who, each, standing)
        if plan is None:
            continue
        before = best.get(each.pair)
        if before is None or plan.score > before.score:
            best[each.pair] = plan
        leading[plan.group] = max(plan.score, leading.get(plan.group, -math.inf))
    if not best:
        one, two = contact.pair
        detail = scene.no_way_that(f"lets vehicles {one} and {two} meet first, as event {contact.number} says")
        raise Rejection(Reason.NO_FEASIBLE_STATE, detail, measured=0.0)
    found = sorted(best.values(), key=lambda plan: (-plan.score, plan.drive.option.name, plan.parked.option.name))
    chosen = leaders_first(found, lambda plan: plan.group)[:most]
    return tuple(_hypothesis(scene, contact, plan, settings.lead_time_s) for plan in chosen)


# --- one plan --------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class _Try:
    """A path, one of a ``pair`` with a standing place, ``moved`` aside towards it."""

    pair: int
    speed: TravelSpeed
    profile: SpeedProfile
    terms: dict[str, float]
    stand: Stand
    moved: Option

    @property
    def known(self) -> dict[str, float]:
        """Return the log-likelihood before the contact, which can only lower it."""
        return self.terms | self.moved.costs | self.stand.terms

    @cached_property
    def most(self) -> float:
        """Return the upper bound of its score."""
        return math.fsum(self.known.values())


def _towards(
    scene: Scene, who: Party, option: Option, stand: Stand, parked: VehicleRecord, share: float
) -> Iterator[Option]:
    """Yield the path, moved aside until it meets the standing vehicle with that share of overlap."""
    if option.turn is not None or option.shift is not None or option.backing:
        if share == 0.0:
            yield option
        return
    at = stand.option.path().pose(_nearest_m(stand.option.path(), scene))
    _, aside = option.approach.path.project(at.x_m, at.y_m)
    off_m = aside + share * (who.vehicle.width_m + parked.width_m) / 2
    if abs(off_m) <= _LEAST_DRIFT_M:
        yield option
        return
    for lateral_g, cost in ((DRIFT_G, 0.0), (_SWERVE_G, _ABRUPT)):
        shift = drift(off_m, option.speed_mps, lateral_g)
        costs = option.costs | ({"abruptness": cost} if cost else {}) | _departure(who, option.approach, off_m)
        yield replace(option, manoeuvre=Manoeuvre.LEAVE_ROAD, shift=shift, costs=costs)


def _nearest_m(path: Path, scene: Scene) -> float:
    return path.project(*scene.place_xy_m)[0]


def _departure(who: Party, approach: Approach, off_m: float) -> dict[str, float]:
    """Score the reported side on which the vehicle left its lane."""
    side = who.crash_type.departure
    if RAN_OFF_RIGHT in who.events or RAN_OFF_LEFT in who.events:
        side = Side.RIGHT if RAN_OFF_RIGHT in who.events else Side.LEFT
    if side is None:
        return {"across the road": _ACROSS} if off_m * approach.kerb_sign < 0 and not approach.one_way else {}
    if (side is Side.LEFT) == (off_m > 0):
        return {}
    return {"other side than reported": _OTHER_SIDE}


def _plan(scene: Scene, who: Party, tried: _Try, parked: VehicleRecord) -> _Plan | None:
    option, stand, profile = tried.moved, tried.stand, tried.profile
    parked_path = stand.option.path()
    parked_m = _nearest_m(parked_path, scene)
    contacts: Contacts | None = None
    path, station = option.path(), 0.0
    for _ in range(_SLIDES):  # put the standing vehicle where the contact is at the reported place
        at = parked_path.pose(parked_m)
        slide = option.approach.path.project(at.x_m, at.y_m)[0] - option.station_m
        path = option.path(slide)
        station = path.project(at.x_m, at.y_m)[0]
        mover = Mover.of(who.vehicle, path, station, profile.impact_mps, backing=option.backing)
        still = Mover.of(parked, parked_path, parked_m, 0.0, backing=False)
        contacts = first_contacts(mover, still, timings=1)
        if len(contacts) == 0:
            return None
        missing = np.array(scene.place_xy_m) - (contacts.x_m[0], contacts.y_m[0])
        parked_m += float(missing @ at.forward)
    assert contacts is not None
    bearing, parked_bearing = float(contacts.bearing_1_rad[0]), float(contacts.bearing_2_rad[0])
    more = {
        f"impact area (vehicle {who.vehicle.number})": _area(who.vehicle, bearing),
        f"impact area (vehicle {parked.number})": _area(parked, parked_bearing),
        "place of the impact": _place(scene, option, stand, contacts),
    }
    at_m = station + profile.impact_mps * float(contacts.time_1_s[0])
    parked_m -= float(missing @ at.forward)
    return _Plan(
        Drive(who, option, path, at_m, tried.speed, profile),
        stand,
        Drive(party(scene.record, parked), stand.option, parked_path, parked_m, STANDS, SpeedProfile(0.0, 0.0)),
        (bearing, parked_bearing),
        (float(contacts.x_m[0]), float(contacts.y_m[0])),
        tried.known | more,
    )


def _area(vehicle: VehicleRecord, bearing_rad: float) -> float:
    return float(impact_area_log_likelihood(vehicle, np.array([bearing_rad]))[0])


def _place(scene: Scene, option: Option, stand: Stand, contacts: Contacts) -> float:
    """Score the contact's distance from the reported place.

    For a crash beside the road the reported point is on the road, so it hardly limits the position across the road: at
    most it gives the side of the road.
    """
    missing: FloatArray = np.array([contacts.x_m[0], contacts.y_m[0]]) - np.array(scene.place_xy_m)
    ahead = option.approach.path.pose(option.station_m).forward
    along, across = float(missing @ ahead), float(ahead[0] * missing[1] - ahead[1] * missing[0])
    beside = stand.zone is not Zone.CARRIAGEWAY
    return float(
        place_log_likelihood(scene.record, np.array(math.hypot(along, across * (_ACROSS_SAYS if beside else 1.0))))
    )


# --- hypotheses ------------------------------------------------------------------------------------------------------
def _hypothesis(scene: Scene, contact: CrashEvent, plan: _Plan, lead_s: float) -> Hypothesis:
    after_s = after_impact_s(plan.drive.profile, _LONGEST_AFTER_S)
    states = (
        drive_along(scene.network, drive, lead_time_s=lead_s, after_s=after_s, bearing_rad=bearing_rad)
        for drive, bearing_rad in zip((plan.drive, plan.parked), plan.bearings_rad, strict=True)
    )
    x_m, y_m = (round(value, _DECIMALS) for value in plan.contact_xy_m)
    stand, number = plan.parked.option, plan.parked.party.vehicle.number
    detail = f"vehicle {number} stands {stand.constant_m:+.1f} m left of {stand.approach.name}"
    return planned_hypothesis(
        plan,
        states,
        lead_s,
        (x_m, y_m),
        checks=(EstimateCheck("stands in the reported zone", True, detail),),
        planned=(PlannedEvent(contact.number, contact.vehicle.number, contact.party, lead_s, (x_m, y_m)),),
    )


# --- later -----------------------------------------------------------------------------------------------------------
def standing_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield places for the standing party on the vehicle's possible paths."""
    (number,) = (each for each in event.pair if each in course.numbers)
    since_s = course.last_event_s(number)
    if since_s is None:
        yield f"vehicle {number} meets nobody before it"
        return
    ways = ways_on(search, course, number, event.side)
    for on_its_way, assumed in ways:
        way = Way.of(search.scene.network, on_its_way.log, number, since_s)
        for state in _stood(search, way, event):
            yield Plan((*on_its_way.states, state), on_its_way.objects, detail=f"strikes it{assumed}")


def _stood(search: Search, way: Way, event: CrashEvent) -> Iterator[ParticipantState]:
    """Return the parties that stood, at some steps of the vehicle's way."""
    moved_m = np.cumsum([0.0, *(math.dist(a.xy_m, b.xy_m) for a, b in zip(way.poses, way.poses[1:], strict=False))])
    if moved_m[-1] < _LEAST_M:
        return
    own = event.as_struck(way.driven.number) if way.driven.number != event.party else None
    area = event.area if own is not None else event.partner_area
    areas = [each for _, each in way.striking(area, -math.inf)]
    for share in _SHARES:
        k = int(np.searchsorted(moved_m, max(share * moved_m[-1], _LEAST_M)))
        point = way.point(min(k, len(way.poses) - 1), areas[min(k, len(way.poses) - 1)])
        if point is None:
            continue
        k = min(k, len(way.poses) - 1)
        at = way.poses[k]
        touched = at.to_world(np.array([point.ahead_m, point.left_m]))
        outward_rad = at.heading_rad + math.atan2(point.normal[1], point.normal[0])
        if isinstance(event.partner, NonMotorist):
            along = replace(at, heading_rad=way.runs_rad(k))
            at_s = float(way.driven.time_s[way.steps[k]])
            yield person_met(search.scene, event.partner, touched, outward_rad, along, at_s)
            continue
        other = event.partner if own is not None else event.vehicle
        assert isinstance(other, VehicleRecord)
        yield stand_still(search.scene.network, other, _parked_pose(way, k, event.as_struck(other.number), touched))


def _parked_pose(way: Way, k: int, parked: VehicleRecord, touched: np.ndarray) -> Pose:
    """Return the pose of a vehicle that stands along the road and is touched at a place.

    It is touched on its area of impact, or at its rear if that is unknown.
    """
    at, runs_rad = way.poses[k], way.runs_rad(k)
    heading = runs_rad if math.cos(runs_rad - at.heading_rad) >= 0 else runs_rad + math.pi
    half_length, half_width = parked.length_m / 2, parked.width_m / 2
    point = contact_points_of(parked.impact, half_length, half_width)[0]
    ahead, left = (point.ahead_m, point.left_m) if parked.impact is not None else (-half_length, 0.0)
    c, s = math.cos(heading), math.sin(heading)
    x, y = touched[0] - ahead * c + left * s, touched[1] - ahead * s - left * c
    return Pose(round(float(x), 6), round(float(y), 6), round(math.remainder(heading, math.tau), 6), at.z_m)
