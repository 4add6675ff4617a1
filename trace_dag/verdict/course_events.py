"""Comparison of the reported events that are not harmful with the simulated course.

FARS lists what a vehicle did between harmful events: it ran off the road, came back, crossed the centreline or the
median, left the ground. A reported event that the course lacks is a doubt, as is an overturn or a departure that the
report lacks. A criterion of :mod:`trace_dag.verdict.rules` judges the departure before the first event.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.geometry import rectangle_corners
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.elements import NO_ROLLOVER, P_CRASH2
from trace_dag.crash.crash_types import SIDE_OF_EVENT, DepartureSide
from trace_dag.crash.parties import is_vehicle
from trace_dag.crash.record import EventRecord, VehicleClass
from trace_dag.crash.summary import event_in_words
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone
from trace_dag.simulation.leaving_road import find_departure
from trace_dag.simulation.types import Body, SimulationLog, VehicleLog, overturned_at
from trace_dag.verdict.metrics import SIDES_IN_WORDS, reported_zone
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Doubt, Reservation

_STEP_S: Final = 0.1
_REACH_M: Final = 150.0
_OPPOSED: Final = -math.cos(math.radians(50))
"""Cosine of the angle between a vehicle's course and a lane from which on the lane is one of oncoming traffic."""
_BETWEEN_ROADS: Final = frozenset({RoadZone.MEDIAN, RoadZone.GORE})
_DEPARTURES: Final = frozenset({*SIDE_OF_EVENT, codes.RAN_OFF})
_OPPOSITE: Final = {DepartureSide.LEFT: DepartureSide.RIGHT, DepartureSide.RIGHT: DepartureSide.LEFT}
_OTHER_VEHICLE: Final = range(50, 79)  # P_CRASH2: another vehicle is in the lane of this one, or comes into it
_ON_ROADWAY: Final = frozenset({1, 2, 3})  # PCRASH5
_CROSSED: Final = {
    codes.CROSSED_CENTRELINE: ("centreline", Doubt.CENTRELINE_NOT_CROSSED),
    codes.CROSSED_MEDIAN: ("median", Doubt.MEDIAN_NOT_CROSSED),
}


@dataclass(frozen=True)
class Excursion:
    """One stay of a vehicle beyond the carriageway: time of leaving (s), sides, and time of return (None: none)."""

    left_s: float
    back_s: float | None
    sides: tuple[DepartureSide, ...]


def course_doubts(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each reported event of the course that does not happen, and each unreported one.

    >>> list(course_doubts(comparison))
    []
    """
    simulated = {each.number for each in beside.observed.log.parties}
    for vehicle in beside.record.vehicles:
        events = [each for each in beside.record.events if each.party_1 == vehicle.number and not each.is_harmful]
        if events and vehicle.number in simulated:
            yield from _missed_events(beside, vehicle.number, events)
        elif events:
            yield _doubt(Doubt.DEPARTURE_MISSED, events[0], f"vehicle {vehicle.number} is not simulated")
    yield from _other_zone(beside)
    yield from _overturns(beside)
    yield from _unreported_departure(beside)
    yield from _missing_vehicles(beside)


def _missed_events(beside: Comparison, number: int, events: list[EventRecord]) -> Iterator[Reservation]:
    """Yield a doubt for each of a vehicle's events that its course lacks."""
    driven, body = beside.observed.log.vehicle_log(number), beside.observed.log.bodies[number]
    network = beside.observed.network
    for event in events:
        if event.code == codes.AIRBORNE:
            yield _doubt(Doubt.NOT_AIRBORNE, event, "no vehicle leaves the ground in this simulation")
        elif event.code in _CROSSED:
            what, doubt = _CROSSED[event.code]
            if not _crosses(network, driven, body, *_window(beside, event), median=doubt is Doubt.MEDIAN_NOT_CROSSED):
                yield _doubt(doubt, event, f"vehicle {number} does not cross the {what}")
    moves = [event for event in events if event.code in _DEPARTURES or event.code == codes.CAME_BACK]
    if moves:
        excursions = list(_excursions(network, beside.observed.log, number))
        yield from _missed_departures(beside, moves, excursions)
        yield from _other_side(beside, moves, excursions)


def _missed_departures(
    beside: Comparison, moves: list[EventRecord], excursions: list[Excursion]
) -> Iterator[Reservation]:
    """Yield a doubt for each reported departure and return missing in the vehicle's ``excursions``, in order."""
    first = beside.seen(beside.sequence.first)
    judged = first is not None and first.departure is not None  # by the criterion on the first event's departure
    current: Excursion | None = None
    remaining = iter(excursions)
    for event in moves:
        vehicle = f"vehicle {event.party_1}"
        begin_s, end_s = _window(beside, event)
        if event.code == codes.CAME_BACK:
            if current is None or current.back_s is None or current.back_s > end_s:
                yield _doubt(Doubt.RETURN_MISSED, event, f"{vehicle} does not come back onto the road then")
            continue
        current = next((each for each in remaining if each.left_s >= begin_s - _STEP_S), None)
        if judged and event.number == beside.sequence.first.departure:
            continue
        side = SIDE_OF_EVENT.get(event.code)
        if current is None or current.left_s > end_s:
            yield _doubt(Doubt.DEPARTURE_MISSED, event, f"{vehicle} does not leave the road then")
        elif side is not None and side not in current.sides:
            went = " or ".join(SIDES_IN_WORDS[each] for each in current.sides)
            yield _doubt(Doubt.DEPARTURE_MISSED, event, f"{vehicle} leaves the road {went}")


def _other_side(beside: Comparison, moves: list[EventRecord], excursions: list[Excursion]) -> Iterator[Reservation]:
    """Yield a doubt if the vehicle of the first event later leaves the road on the other side than ever reported."""
    first, number = beside.observed.first, moves[0].party_1
    if first is None or first.pair[0] != number or first.departure is None or first.departure.left_s is None:
        return
    reported = {event.code for event in moves} & _DEPARTURES
    side = SIDE_OF_EVENT.get(reported.pop()) if len(reported) == 1 else None
    if side not in _OPPOSITE:
        return
    other = _OPPOSITE[side]
    if any(each.left_s > first.time_s and other in each.sides and side not in each.sides for each in excursions):
        detail = f"vehicle {number} comes back and leaves the road {SIDES_IN_WORDS[other]}, which no event reports"
        yield Reservation(Doubt.UNREPORTED_DEPARTURE, detail)


def _window(beside: Comparison, event: EventRecord) -> tuple[float, float]:
    """Return the times (s) between which a reported event belongs: those of its vehicle's harmful events around it."""
    before_s, after_s = -math.inf, math.inf
    for each in beside.sequence.events:
        seen = beside.seen(each) if event.party_1 in each.pair else None
        if seen is not None and each.number < event.number:
            before_s = max(before_s, seen.time_s)
        elif seen is not None:
            after_s = min(after_s, seen.time_s)
    return before_s, after_s


def _steps(driven: VehicleLog, begin_s: float, end_s: float) -> Iterator[int]:
    """Yield the steps of a log in a span of time, ten a second."""
    next_s = -math.inf
    for k in np.flatnonzero((driven.time_s >= begin_s) & (driven.time_s <= end_s)).tolist():
        if driven.time_s[k] >= next_s:
            next_s = float(driven.time_s[k]) + _STEP_S
            yield k


def _crosses(
    network: RoadNetwork, driven: VehicleLog, body: Body, begin_s: float, end_s: float, *, median: bool
) -> bool:
    """Return whether a corner of the body is on a lane of oncoming traffic.

    Beyond a ``median`` only lanes outside junctions count, because a turning vehicle drives over oncoming lanes there
    without crossing a median. A vehicle that only enters the median ran off the road.
    """
    for k in _steps(driven, begin_s, end_s):
        pose = driven.pose_at(k)
        course_rad = math.atan2(float(driven.velocity_y_mps[k]), float(driven.velocity_x_mps[k]))
        for x_m, y_m in rectangle_corners(pose, body.length_m, body.width_m).tolist():
            for lane in network.nearest_lanes(x_m, y_m, 0.0, z_m=pose.z_m):
                if median and network.road_by_id[lane.lane.road_id].junction_id is not None:
                    continue
                if math.cos(network.pose(lane.lane, lane.s_m).heading_rad - course_rad) <= _OPPOSED:
                    return True
    return False


def _excursions(network: RoadNetwork, log: SimulationLog, number: int) -> Iterator[Excursion]:
    """Yield the stays of a vehicle beyond the carriageway, in order.

    After its first contact a side is seen along its course, or along its direction before, because a report can mean
    either.
    """
    driven, body = log.vehicle_log(number), log.bodies[number]
    met = next((each for each in log.meetings if number in (each.number_1, each.number_2)), None)
    came, came_s = (None, 0.0) if met is None else (log.pose_at_contact(met, number), met.time_s)
    steps = list(_steps(driven, -math.inf, math.inf))
    middle = driven.pose_at(steps[len(steps) // 2])
    area = network.carriageway_near(middle.x_m, middle.y_m, _REACH_M, z_m=middle.z_m)
    corners = np.stack([rectangle_corners(driven.pose_at(k), body.length_m, body.width_m) for k in steps])
    outside = (~area.contains(corners[..., 0], corners[..., 1])).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], outside, [False]]).astype(int)))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        time_s = float(driven.time_s[steps[begin]])
        came_rad = came.heading_rad if came is not None and time_s > came_s else None
        left_s, sides = find_departure(network, driven, body, time_s, came_rad=came_rad)
        back_s = float(driven.time_s[steps[end]]) if end < len(steps) else None
        yield Excursion(time_s if left_s is None else left_s, back_s, sides)


def _other_zone(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt if the first event is in another part of the road than reported (``REL_ROAD``)."""
    event, zone = beside.begins, reported_zone(beside.record)
    seen = None if event is None else beside.seen(event)
    place = None if seen is None or seen.departure is None else seen.departure.place
    if zone is None or place is None or place.zone is zone or not {zone, place.zone} & _BETWEEN_ROADS:
        return
    if {zone, place.zone} & {RoadZone.SHOULDER, RoadZone.ROADWAY}:  # beside a median too; a criterion judges the edge
        return
    yield Reservation(Doubt.OTHER_ZONE, f"the first event is in the {place.zone}, reported is the {zone}")


def _overturns(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle with four or more wheels whose overturn differs from its report (``ROLLOVER``).

    Reported overturn events are judged as events.
    """
    with_event = {each.party_1 for each in beside.record.events if each.code == codes.OVERTURN}
    overturned = {each.number for each in beside.observed.log.parties if overturned_at(each) is not None}
    for vehicle in beside.record.vehicles:
        number, reported = vehicle.number, vehicle.rollover_code not in (None, *NO_ROLLOVER)
        judged = number in with_event or vehicle.vehicle_class is VehicleClass.MOTORCYCLE
        if judged or reported is (number in overturned):
            continue
        if reported:
            yield Reservation(Doubt.EVENT_MISSED, f"vehicle {number} rolled over (ROLLOVER), and stays on its wheels")
        else:
            yield Reservation(Doubt.UNREPORTED_OVERTURN, f"vehicle {number} overturns, which no event reports")


def _unreported_departure(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt if a vehicle leaves the carriageway before the first event, and is reported to have stayed on it.

    The report has no departure, and ``PCRASH5`` places the vehicle on the roadway before the impact.
    """
    first = beside.observed.first
    if first is None or first.departure is None or first.departure.left_s is None:
        return
    number = first.pair[0]
    stayed = any(each.number == number and each.location_code in _ON_ROADWAY for each in beside.record.vehicles)
    if stayed and not any(each.party_1 == number and each.code in _DEPARTURES for each in beside.record.events):
        yield Reservation(Doubt.UNREPORTED_DEPARTURE, f"vehicle {number} leaves the road, which no event reports")


def _missing_vehicles(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle that another one made critical (``P_CRASH2``), if no other one is simulated."""
    simulated = {each.number for each in beside.observed.log.parties if is_vehicle(each.number)}
    for vehicle in beside.record.vehicles:
        if simulated == {vehicle.number} and vehicle.critical_event_code in _OTHER_VEHICLE:
            detail = f"vehicle {vehicle.number}: {P_CRASH2.meaning(vehicle.critical_event_code)}; it is not simulated"
            yield Reservation(Doubt.OTHER_VEHICLE_MISSING, detail)


def _doubt(doubt: Doubt, event: EventRecord, found: str) -> Reservation:
    return Reservation(doubt, f"event {event.number}, {event_in_words(event)}: {found}")
