"""Observations of a simulation, event by event, measured once before any comparison with a report.

An event is the contact of a vehicle with another one, a person, an animal or an object, or the overturn of a vehicle,
with its place, parts of the bodies, speeds, effects, and causes. All values are from the log, except for the rest of a
manoeuvre that a contact interrupted, which is from the plan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose, contact_clock_h
from trace_dag.common.units import bearing_to_clock_h, kmh_to_mps
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.parties import is_vehicle
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadsidePlace, RoadZone, roadside_at
from trace_dag.simulation.leaving_road import find_departure
from trace_dag.simulation.matching import Pair, SimulatedEvent, happenings_of
from trace_dag.simulation.plan import tracking_errors
from trace_dag.simulation.states import Hypothesis, ParticipantState
from trace_dag.simulation.types import Contact, SimulationLog, VehicleLog
from trace_dag.verdict.departed_street import NO_STREET, DepartedStreet, find_departed_street
from trace_dag.verdict.directions import direction
from trace_dag.verdict.throws import Throw, throw_of

LEAST_SPEED_MPS: Final = 1.0
"""Relative errors of slower speeds are taken as if of this one."""
LEAST_RECORDED_MPS: Final = kmh_to_mps(8.0)
"""Change of velocity from which on an event data recorder has to record (49 CFR 563.5); less is taken for harmless."""
STANDS_MPS: Final = 0.2
"""A person slower than this stands."""


@dataclass(frozen=True)
class ObservedVehicle:
    """The motion of one vehicle up to a contact, before it is compared with any report.

    Clock positions in hours: ``clock_h`` of the contact point on the body, ``bearing_clock_h`` of the direction to the
    other body's centre (the published procedure's). ``pdof_deg``: principal direction of force, the direction from
    which it came, degrees clockwise from the front. ``arrival_error_m`` is the distance of the body from its planned
    place at the contact; the last two are deviations from the planned path and speed, in 99 % of steps up to the
    contact.
    """

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
    road_id: str | None = None  # of the road that it came along


@dataclass(frozen=True)
class ObservedPerson:
    """A person or an animal that is struck.

    It has the heading (rad) and speed at the strike, the distance from the carriageway (negative within it), the time
    on it before, and the throw with its distance to rest or to the next strike.
    """

    heading_rad: float
    speed_mps: float
    outside_m: float
    exposed_s: float
    thrown_m: float
    throw: Throw

    @property
    def moves(self) -> bool:
        """Return whether the person moves."""
        return self.speed_mps > STANDS_MPS


@dataclass(frozen=True)
class ObservedDeparture:
    """The departure of a vehicle from the road before it struck something there, or overturned.

    ``left_s`` is None if it did not leave the carriageway; ``sides`` are the possible names of its side, such as left
    or ahead. ``along_m`` is the distance from the reported point: along the road for an event beside it, the whole
    distance for one on it.
    """

    place: RoadsidePlace | None
    along_m: float
    left_s: float | None
    sides: tuple[DepartureSide, ...]
    street: DepartedStreet = NO_STREET


@dataclass(frozen=True)
class ObservedOverturn:
    """A vehicle that overturns: speeds at the start and at the overturn (m/s), further slide, and quarter turns."""

    initial_speed_mps: float
    speed_mps: float
    slid_m: float
    quarter_turns: int


@dataclass(frozen=True)
class ObservedEvent:
    """An observed event. ``sides`` are the vehicles of a contact, by number.

    ``vehicles`` has more on those that had touched nothing before, or that strike a person: their motion up to it.
    """

    happening: SimulatedEvent
    xy_m: tuple[float, float]
    sides: Mapping[int, StruckSide] = field(default_factory=dict)
    vehicles: Mapping[int, ObservedVehicle] = field(default_factory=dict)
    outside_m: Mapping[int, float] = field(default_factory=dict)
    person: ObservedPerson | None = None
    departure: ObservedDeparture | None = None
    overturn: ObservedOverturn | None = None
    object_code: int | None = None  # SOE of a fixed object

    @property
    def pair(self) -> Pair:
        """Return numbers of both parties, the lower one first."""
        return self.happening.pair

    @property
    def time_s(self) -> float:
        """Return the time."""
        return self.happening.time_s

    @property
    def contact(self) -> Contact:
        """Return the contact.

        Raises ``TypeError`` for an overturn.
        """
        if self.happening.contact is None:
            raise TypeError(f"vehicle {self.pair[0]} overturns: that is no contact")
        return self.happening.contact


@dataclass(frozen=True, eq=False)
class ObservedCrash:
    """All events of one simulation, in order, for comparison with reports."""

    network: RoadNetwork
    hypothesis: Hypothesis
    log: SimulationLog
    events: tuple[ObservedEvent, ...]

    @property
    def first(self) -> ObservedEvent | None:
        """Return the first contact, else the first overturn, or None."""
        return next((event for event in self.events if event.happening.contact), None) or next(iter(self.events), None)

    def of(self, happening: SimulatedEvent | None) -> ObservedEvent | None:
        """Return the event of a happening."""
        return next((event for event in self.events if event.happening == happening), None)


def observe_crash(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> ObservedCrash:
    """Return the observations of a simulated hypothesis.

    Raises :class:`Failure` if the log is of another hypothesis.

    >>> observed = observe_crash(judged_queue.network, judged_queue.hypothesis, judged_queue.log)
    >>> [event.pair for event in observed.events][:2]  # the first car pushes the second
    [(1, 2), (2, 3)]
    >>> (tree,) = observe_crash(judged_tree.network, judged_tree.hypothesis, judged_tree.log).events
    >>> [side.value for side in tree.departure.sides], tree.object_code
    (['right'], 42)
    """
    reader = _Observer(network, hypothesis, log)
    return ObservedCrash(network, hypothesis, log, tuple(map(reader.event, happenings_of(log))))


class _Observer:
    """Measures events in order, with the parties that have touched something before."""

    def __init__(self, network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> None:
        self._network, self._log = network, log
        self._states = {state.vehicle_number: state for state in hypothesis.participants}
        self._logs = {vehicle.number: vehicle for vehicle in log.vehicles}
        self._met: set[int] = set()
        self._departed: set[int] = set()

    def event(self, happening: SimulatedEvent) -> ObservedEvent:
        """Measure one event."""
        if happening.contact is None:
            return self._overturn(happening)
        contact = happening.contact
        item = self._log.object_of(contact.number_2)
        both = [side for side in sides_of(contact) if is_vehicle(side.number)]
        strikes = self._log.is_figure(contact.number_2)
        free = [side for side in both if strikes or not self._met & set(happening.pair)]
        event = ObservedEvent(
            happening,
            (contact.x_m, contact.y_m),
            sides={side.number: observe_struck_side(side, self._log, contact) for side in both},
            vehicles={side.number: self._vehicle(side, contact) for side in free},
            outside_m={side.number: outside_m(self._network, side.pose.x_m, side.pose.y_m) for side in free},
            person=self._person(contact) if strikes else None,
            departure=None if item is None else self._departure(contact.number_1, happening.time_s, contact),
            object_code=None if item is None else item.code,
        )
        self._met |= set(happening.pair)
        return event

    def _vehicle(self, side: ContactSide, contact: Contact) -> ObservedVehicle:
        state, driven = self._states.get(side.number), self._logs.get(side.number)
        if state is None or driven is None:
            raise Failure(f"the log has vehicle {side.number}, which the hypothesis does not have; simulate again")
        return observe_vehicle(self._network, side, state, driven, self._log, contact)

    def _person(self, contact: Contact) -> ObservedPerson:
        _, side = sides_of(contact)
        driven = self._logs[side.number]
        speed = math.hypot(*side.velocity_mps)
        heading = math.atan2(side.velocity_mps[1], side.velocity_mps[0])
        later = [c.time_s for c in self._log.meetings if c.number_2 == side.number and c.time_s > contact.time_s]
        thrown_m = _thrown_m(driven, side.pose.x_m, side.pose.y_m, min(later, default=None))
        by, body = self._logs[contact.number_1], self._log.bodies[contact.number_1]
        return ObservedPerson(
            heading if speed > STANDS_MPS else side.pose.heading_rad,
            speed,
            outside_m(self._network, side.pose.x_m, side.pose.y_m),
            _exposed_s(self._network, driven, contact.time_s),
            thrown_m,
            throw_of(contact, by, body, driven, thrown_m),
        )

    def _departure(self, number: int, until_s: float, at: Contact | Pose) -> ObservedDeparture:
        driven = self._logs[number]
        place = roadside_at(self._network, at.x_m, at.y_m, z_m=at.z_m)
        along_m = along_road_m(self._network, at.x_m, at.y_m, place)
        if number in self._departed:  # how it left the road is told once
            return ObservedDeparture(place, along_m, None, ())
        self._departed.add(number)
        left_s, sides = find_departure(self._network, driven, self._log.bodies[number], until_s)
        street = find_departed_street(self._network, driven, until_s if left_s is None else left_s)
        return ObservedDeparture(place, along_m, left_s, sides, street)

    def _overturn(self, happening: SimulatedEvent) -> ObservedEvent:
        number = happening.pair[0]
        driven = self._logs[number]
        k = int(np.argmin(np.abs(driven.time_s - happening.time_s)))
        at = driven.pose_at(k)
        speeds = np.hypot(driven.velocity_x_mps, driven.velocity_y_mps)
        overturn = ObservedOverturn(
            initial_speed_mps=float(speeds[0]),
            speed_mps=float(speeds[k]),
            slid_m=math.hypot(float(driven.x_m[-1]) - at.x_m, float(driven.y_m[-1]) - at.y_m),
            quarter_turns=round(abs(float(driven.roll_rad[-1])) / (math.pi / 2)),
        )
        departure = None if self._met else self._departure(number, happening.time_s, at)
        return ObservedEvent(happening, (at.x_m, at.y_m), departure=departure, overturn=overturn)


@dataclass(frozen=True)
class ContactSide:
    """One body of a contact: its pose and the other body's, its velocity before it and its change of velocity."""

    number: int
    pose: Pose
    other: Pose
    velocity_mps: tuple[float, float]
    delta_v_mps: tuple[float, float]


def sides_of(contact: Contact) -> tuple[ContactSide, ContactSide]:
    """Return both bodies of a contact, the first one first.

    >>> [side.number for side in sides_of(log.meetings[0])]
    [1, 2]
    """
    c = contact
    return (
        ContactSide(c.number_1, c.pose_1, c.pose_2, c.velocity_1_mps, c.delta_v_1_mps),
        ContactSide(c.number_2, c.pose_2, c.pose_1, c.velocity_2_mps, c.delta_v_2_mps),
    )


def observe_vehicle(
    network: RoadNetwork,
    side: ContactSide,
    state: ParticipantState,
    driven: VehicleLog,
    log: SimulationLog,
    contact: Contact,
) -> ObservedVehicle:
    """Observe one body of a contact up to it, by its own log.

    >>> contact = log.meetings[0]
    >>> side, _ = sides_of(contact)
    >>> seen = observe_vehicle(network, side, hypothesis.participants[0], log.vehicles[0], log, contact)
    >>> 75.0 < seen.turn_deg < 105.0, round(seen.initial_speed_mps, 2)  # it turns left at 14 mph
    (True, 6.26)
    """
    struck = observe_struck_side(side, log, contact)
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
        tracked_speed_error_p99_rel=float(np.percentile(speed_error / np.maximum(planned, LEAST_SPEED_MPS), 99)),
        road_id=went.road_id,
    )


@dataclass(frozen=True)
class StruckSide:
    """A contact for one of its bodies.

    The fields are those of :class:`ObservedVehicle`.
    """

    number: int
    clock_h: float
    bearing_clock_h: float
    impact_speed_mps: float
    delta_v_mps: float
    pdof_deg: float


def observe_struck_side(side: ContactSide, log: SimulationLog, contact: Contact) -> StruckSide:
    """Return the struck part of a body in a contact, its speed, and its change of velocity.

    >>> side, _ = sides_of(log.meetings[0])
    >>> round(observe_struck_side(side, log, log.meetings[0]).clock_h)  # in its right side
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
    """Return the distance of a point from the carriageway, negative within it."""
    return float(network.drivable_area.beyond_m(np.array([x_m]), np.array([y_m]))[0])


def _exposed_s(network: RoadNetwork, person: VehicleLog, until_s: float) -> float:
    before = person.time_s <= until_s
    inside = network.drivable_area.contains(person.x_m[before], person.y_m[before])
    if not len(inside) or not inside[-1]:
        return 0.0
    outside = np.flatnonzero(~inside)
    entered_s = float(person.time_s[before][outside[-1]]) if len(outside) else float(person.time_s[0])
    return until_s - entered_s


def _thrown_m(person: VehicleLog, x_m: float, y_m: float, until_s: float | None) -> float:
    at = -1 if until_s is None else max(int(np.searchsorted(person.time_s, until_s)) - 1, 0)
    return math.hypot(float(person.x_m[at]) - x_m, float(person.y_m[at]) - y_m)


def along_road_m(network: RoadNetwork, x_m: float, y_m: float, place: RoadsidePlace | None) -> float:
    """Return the distance from the reported point.

    It is along the road for a place beside it, up to its end for a place beyond it, and the whole distance for a place
    on the road.

    >>> along_road_m(network, 5.0, 0.0, roadside_at(network, 5.0, 0.0))  # on the road: the distance itself
    5.0
    """
    if place is None or place.zone is RoadZone.ROADWAY:
        return math.hypot(x_m, y_m)
    beside = network.pose(place.lane.lane, place.lane.s_m)
    return abs(beside.x_m * math.cos(place.along_rad) + beside.y_m * math.sin(place.along_rad))
