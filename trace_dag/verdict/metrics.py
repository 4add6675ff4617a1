"""Measuring a simulation against its report. Nothing here passes or fails: :mod:`rules` judges.

Everything is taken from the log; of the plan only what a vehicle hit in the middle of its manoeuvre did not get to do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.crash.aftermath import aftermath_of
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord, ImpactArea, PreCrashMovement, VehicleRecord, first_vehicle_contact
from trace_dag.geometry import Pose, contact_clock_h
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.sim.plan import tracking_errors
from trace_dag.sim.types import Contact, SimulationLog, VehicleLog
from trace_dag.states.types import Hypothesis, ParticipantState
from trace_dag.units import bearing_to_clock_h, clock_difference_h, kmh_to_mps, wrap_angle
from trace_dag.verdict.directions import (
    direction,
    relation_error_deg,
    reported_relations_deg,
    reported_turns_deg,
    turn_error_deg,
)

_SKEWED = frozenset({RoadTopology.Y, RoadTopology.ROUNDABOUT, RoadTopology.FIVE_POINT_OR_MORE})
_LEAST_SPEED_MPS = 1.0  # relative errors of slower reported speeds are taken as if of this one
LEAST_RECORDED_MPS: Final = kmh_to_mps(8.0)
"""Change of velocity from which on an event data recorder has to record (49 CFR 563.5); less is taken for harmless."""


@dataclass(frozen=True)
class VehicleMeasures:
    """One vehicle of the first contact. ``None`` where the report gives nothing to compare with.

    Clock positions in hours: ``clock_h`` of the contact point on the body, ``bearing_clock_h`` of the direction to
    the other body's centre (the published procedure's). Relative speed errors are signed, simulated minus reported
    over reported. ``pdof_deg``: principal direction of force, where it came from, degrees clockwise from the front.
    """

    number: int
    clock_h: float
    bearing_clock_h: float
    reported_clock_h: float | None
    clock_error_h: float | None
    bearing_clock_error_h: float | None
    turn_deg: float
    turn_error_deg: float | None
    initial_speed_mps: float
    impact_speed_mps: float
    reported_speed_mps: float | None
    initial_speed_error_rel: float | None
    impact_speed_error_rel: float | None
    delta_v_mps: float
    pdof_deg: float
    arrival_error_m: float  # body at the contact from where the estimate has it
    path_error_p99_m: float  # from the planned path, in 99 % of steps up to the contact
    tracked_speed_error_p99_rel: float  # from the planned speed, likewise


@dataclass(frozen=True)
class LaterEvent:
    """An event after the first collision of the two; ``occurred`` is None where a simulation cannot tell."""

    number: int
    code: int
    occurred: bool | None


@dataclass(frozen=True)
class CrashMeasures:
    """The first contact of a simulation beside the report. Distances in metres, in the local frame."""

    contact_x_m: float
    contact_y_m: float
    contact_distance_m: float  # to the reported location
    right_pair: bool  # the first contact is between the two vehicles that collided first
    closing_speed_mps: float
    approach_angle_deg: float  # between the two headings at the contact, 0 to 180
    relation_error_deg: float | None
    vehicles: tuple[VehicleMeasures, VehicleMeasures]
    later_events: tuple[LaterEvent, ...]


@dataclass(frozen=True)
class ObservedVehicle:
    """What one body of the first contact did, before it is set beside any report. As in :class:`VehicleMeasures`."""

    number: int
    clock_h: float
    bearing_clock_h: float
    approach_rad: float
    turn_deg: float
    offered_turns_deg: frozenset[float]
    initial_speed_mps: float
    impact_speed_mps: float
    delta_v_mps: float
    pdof_deg: float
    arrival_error_m: float
    path_error_p99_m: float
    tracked_speed_error_p99_rel: float


@dataclass(frozen=True)
class FirstContact:
    """A simulation's first contact: what happened, before it is set beside any report."""

    contact: Contact
    later_contacts: tuple[Contact, ...]
    vehicles: tuple[ObservedVehicle, ObservedVehicle]


def observe(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> FirstContact | None:
    """The first contact of two participants in a simulated hypothesis; None if there was none."""
    return observe_contact(network, hypothesis, log, log.meetings[0]) if log.meetings else None


def observe_contact(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog, contact: Contact) -> FirstContact:
    """A contact up to which neither body had been in another, with what led to it.

    >>> [seen.number for seen in observe_contact(network, hypothesis, log, log.meetings[0]).vehicles]
    [1, 2]
    """
    states = {state.vehicle_number: state for state in hypothesis.participants}
    logs = {vehicle.number: vehicle for vehicle in log.vehicles}
    one, two = (
        observed_vehicle(network, side, states[side.number], logs[side.number], log, contact)
        for side in sides_of(contact)
    )
    later = tuple(other for other in log.meetings if other is not contact)
    return FirstContact(contact, later, (one, two))


def compare(observation: FirstContact, record: CrashRecord) -> CrashMeasures:
    """Set a contact beside a report, whose location is the origin of the local frame.

    >>> measures = compare(first_contact, record)
    >>> measures.right_pair, [vehicle.clock_error_h for vehicle in measures.vehicles]  # struck where the report says
    (True, [0.0, 0.0])
    """
    contact, (one, two) = observation.contact, observation.vehicles
    reported = {vehicle.number: vehicle for vehicle in record.vehicles}
    pair = record.colliding_vehicles
    first, second = reported.get(one.number), reported.get(two.number)
    relation = abs(math.degrees(wrap_angle(one.approach_rad - two.approach_rad)))
    return CrashMeasures(
        contact_x_m=contact.x_m,
        contact_y_m=contact.y_m,
        contact_distance_m=math.hypot(contact.x_m, contact.y_m),
        right_pair=pair is not None and {pair[0].number, pair[1].number} == {one.number, two.number},
        closing_speed_mps=contact.closing_speed_mps,
        approach_angle_deg=abs(math.degrees(wrap_angle(contact.pose_1.heading_rad - contact.pose_2.heading_rad))),
        relation_error_deg=_relation_error_deg(relation, first, second, record) if first and second else None,
        vehicles=(compared_vehicle(one, first, record), compared_vehicle(two, second, record)),
        later_events=_later_events(record, observation.later_contacts),
    )


def compared_vehicle(seen: ObservedVehicle, reported: VehicleRecord | None, record: CrashRecord) -> VehicleMeasures:
    """Compare what one vehicle did with what the report says of it.

    >>> measures = compared_vehicle(first_contact.vehicles[1], record.vehicles[1], record)
    >>> round(measures.reported_speed_mps, 2), round(measures.initial_speed_mps, 2)  # 30 mph
    (13.41, 13.41)
    """
    area = reported.impact if reported else None
    return VehicleMeasures(
        number=seen.number,
        clock_h=seen.clock_h,
        bearing_clock_h=seen.bearing_clock_h,
        reported_clock_h=area.clock_h if area else None,
        clock_error_h=clock_error_h(seen.clock_h, area),
        bearing_clock_error_h=clock_error_h(seen.bearing_clock_h, area),
        turn_deg=seen.turn_deg,
        turn_error_deg=_turn_error_deg(seen, reported, record.road_topology) if reported else None,
        initial_speed_mps=seen.initial_speed_mps,
        impact_speed_mps=seen.impact_speed_mps,
        reported_speed_mps=reported.travel_speed_mps if reported else None,
        initial_speed_error_rel=speed_error_rel(seen.initial_speed_mps, reported),
        impact_speed_error_rel=speed_error_rel(seen.impact_speed_mps, reported),
        delta_v_mps=seen.delta_v_mps,
        pdof_deg=seen.pdof_deg,
        arrival_error_m=seen.arrival_error_m,
        path_error_p99_m=seen.path_error_p99_m,
        tracked_speed_error_p99_rel=seen.tracked_speed_error_p99_rel,
    )


def _relation_error_deg(
    measured_deg: float, first: VehicleRecord, second: VehicleRecord, record: CrashRecord
) -> float | None:
    """How far the angle between the approaches is from what the crash types say.

    Crossing or joining streets mean a right angle, but not where legs meet at other angles by the report's own words.
    Within the corner of an L those who meet head-on or follow each other may have any angle between them.
    """
    if record.road_topology is RoadTopology.L:
        return None
    allowed = reported_relations_deg(first, second)
    if record.road_topology in _SKEWED:
        allowed -= {90.0}
    return relation_error_deg(measured_deg, allowed)


def _turn_error_deg(seen: ObservedVehicle, reported: VehicleRecord, topology: RoadTopology) -> float | None:
    """How far a vehicle's turn is from what the report says, where its words mean what they say elsewhere.

    Who backs goes backward, whichever way. Round a roundabout only entering and leaving are turns. At an L a report
    calls a turn what on the map is the road's own bend.
    """
    allowed = reported_turns_deg(reported)
    if reported.movement is PreCrashMovement.BACKING:
        return 0.0 if seen.impact_speed_mps < 0 else 180.0
    if topology is RoadTopology.ROUNDABOUT and reported.movement is PreCrashMovement.NEGOTIATING_CURVE:
        return None
    if topology is RoadTopology.L:
        allowed |= {0.0}
    return turn_error_deg(seen.turn_deg, allowed, seen.offered_turns_deg)


@dataclass(frozen=True)
class ContactSide:
    """One body of a contact: its pose and the other body's, its velocity before it and its change of velocity."""

    number: int
    pose: Pose
    other: Pose
    velocity_mps: tuple[float, float]
    delta_v_mps: tuple[float, float]


def sides_of(contact: Contact) -> tuple[ContactSide, ContactSide]:
    """Both bodies of a contact, the first one first.

    >>> [side.number for side in sides_of(log.meetings[0])]
    [1, 2]
    """
    c = contact
    return (
        ContactSide(c.number_1, c.pose_1, c.pose_2, c.velocity_1_mps, c.delta_v_1_mps),
        ContactSide(c.number_2, c.pose_2, c.pose_1, c.velocity_2_mps, c.delta_v_2_mps),
    )


def observed_vehicle(
    network: RoadNetwork,
    side: ContactSide,
    state: ParticipantState,
    driven: VehicleLog,
    log: SimulationLog,
    contact: Contact,
) -> ObservedVehicle:
    """What one body of a contact did up to it, by its own log of the simulation's.

    >>> contact = log.meetings[0]
    >>> side, _ = sides_of(contact)
    >>> seen = observed_vehicle(network, side, hypothesis.participants[0], log.vehicles[0], log, contact)
    >>> 75.0 < seen.turn_deg < 105.0, round(seen.initial_speed_mps, 2)  # it turns left at 14 mph
    (True, 6.26)
    """
    struck = struck_side(side, log, contact)
    distance, speed_error = tracking_errors(state.trajectory, driven, contact.time_s)
    planned = np.abs(np.interp(driven.time_s[: len(speed_error)], state.trajectory.time_s, state.trajectory.speed_mps))
    went = direction(network, driven, side.pose, contact.time_s, state.trajectory)
    return ObservedVehicle(
        number=side.number,
        clock_h=struck.clock_h,
        bearing_clock_h=struck.bearing_clock_h,
        approach_rad=went.approach_rad,
        turn_deg=went.turn_deg,
        offered_turns_deg=went.offered_turns_deg,
        initial_speed_mps=float(driven.speed_mps[0]),
        impact_speed_mps=struck.impact_speed_mps,
        delta_v_mps=struck.delta_v_mps,
        pdof_deg=struck.pdof_deg,
        arrival_error_m=math.hypot(side.pose.x_m - state.impact_pose.x_m, side.pose.y_m - state.impact_pose.y_m),
        path_error_p99_m=float(np.percentile(distance, 99)),
        tracked_speed_error_p99_rel=float(np.percentile(speed_error / np.maximum(planned, _LEAST_SPEED_MPS), 99)),
    )


@dataclass(frozen=True)
class StruckSide:
    """What a contact was to one of its bodies, whatever led to it. As in :class:`VehicleMeasures`."""

    number: int
    clock_h: float
    bearing_clock_h: float
    impact_speed_mps: float
    delta_v_mps: float
    pdof_deg: float


def struck_side(side: ContactSide, log: SimulationLog, contact: Contact) -> StruckSide:
    """Where a body was struck in a contact, how fast it was, and what that did to it.

    >>> side, _ = sides_of(log.meetings[0])
    >>> round(struck_side(side, log, log.meetings[0]).clock_h)  # in its right side
    3
    """
    ahead, left = side.pose.to_body(side.other.xy_m)
    forward = side.pose.forward
    dv_ahead, dv_left = Pose(0, 0, side.pose.heading_rad).to_body(np.array(side.delta_v_mps))
    return StruckSide(
        number=side.number,
        clock_h=contact_clock_h(*log.clock_body(contact, side.number), np.array([contact.x_m, contact.y_m])),
        bearing_clock_h=bearing_to_clock_h(math.atan2(left, ahead)),
        impact_speed_mps=float(side.velocity_mps[0] * forward[0] + side.velocity_mps[1] * forward[1]),
        delta_v_mps=math.hypot(*side.delta_v_mps),
        pdof_deg=math.degrees(math.atan2(dv_left, -dv_ahead)) % 360.0,
    )


def outside_m(network: RoadNetwork, x_m: float, y_m: float) -> float:
    """How far a point is outside the carriageway, negative within it."""
    return float(network.drivable_area.beyond_m(np.array([x_m]), np.array([y_m]))[0])


def clock_error_h(clock_h: float, area: ImpactArea | None) -> float | None:
    """Hours of the clock between a place on the body and the area reported; 0 inside it, None if none is.

    A clock position is an area too, half an hour either side of its hour, so that "within two clock positions" lets
    five of the twelve pass, as counting positions does.

    >>> three = record.vehicles[0].impact  # 2:30 to 3:30
    >>> clock_error_h(3.4, three), round(clock_error_h(5.0, three), 6)
    (0.0, 1.5)
    """
    if area is None:
        return None
    return max(0.0, clock_difference_h(clock_h, area.clock_h) - area.half_width_rad * 6 / math.pi)


def speed_error_rel(simulated_mps: float, reported: VehicleRecord | None) -> float | None:
    """Signed difference of a speed from the reported one, relative to that; None where none is reported.

    >>> round(speed_error_rel(33 * 0.44704, record.vehicles[1]), 6)  # 33 mph, reported are 30
    0.1
    """
    if reported is None or reported.travel_speed_mps is None:
        return None
    error = (abs(simulated_mps) - reported.travel_speed_mps) / max(reported.travel_speed_mps, _LEAST_SPEED_MPS)
    return min(error, 0.0) if reported.travel_speed_is_lower_bound else error


def _later_events(record: CrashRecord, later_contacts: tuple[Contact, ...]) -> tuple[LaterEvent, ...]:
    """Events after the first collision of two vehicles but for those of :mod:`trace_dag.verdict.aftermath`. Another
    collision of vehicles is looked for among the contacts."""
    first = first_vehicle_contact(record.events)
    if first is None:
        return ()
    contacts = list(later_contacts)
    afterwards = aftermath_of(record)
    elsewhere = {each.event_number for each in afterwards} | {each.departure for each in afterwards}
    later = []
    for event in record.events:
        if event.number <= first.number or event.number in elsewhere:
            continue
        occurred = None
        if event.is_vehicle_contact:
            pair = {event.party_1, event.party_2}
            found = next((c for c in contacts if {c.number_1, c.number_2} == pair), None)
            occurred = found is not None
            if found is not None:
                contacts.remove(found)
        later.append(LaterEvent(event.number, event.code, occurred))
    return tuple(later)
