"""The back-end contract: participants in, a log out. The same types for every back-end.

Frame: the crash's local frame; times in seconds from the start of the reconstruction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Protocol

import numpy as np
from pydantic import Field

from trace_dag.common.geometry import FloatArray, Pose, Poses
from trace_dag.crash.parties import party_in_words, party_of_body, trailer_body
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.driving import Driver
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import LossOfControl, Trajectory

if TYPE_CHECKING:
    from trace_dag.common.settings import SimSettings

PULSE_S = 0.25
"""Time after first touching over which a contact's delta-v is taken: that of event data recorders, 49 CFR 563.7."""

DEEPEST_EVERY_S = 0.1
"""Interval of a log's clock in each of which it has the state at a contact's deepest overlap. Rigid bodies overlap
by centimetres for some thirty milliseconds: the log's own steps can miss what made the crash."""

STATE_GRID = 2**20
"""Logged states are whole numbers of so many parts of a unit (m, rad, m/s, ...): of a micrometre."""
_NOT_ON_GRID = ("number", "time_s")

OVERTURNED_RAD = math.radians(60)
"""Tilt from which a vehicle has overturned: the centre of gravity of every class is beyond its wheels by then."""


class Termination(StrEnum):
    """Reasons for the end of a simulation."""

    AT_REST = "at_rest"
    TIME_LIMIT = "time_limit"
    NO_CONTACT = "no_contact"
    STARTED_IN_CONTACT = "started_in_contact"
    DIVERGED = "diverged"
    BACKEND_ERROR = "backend_error"


class BodyKind(StrEnum):
    """Kinds of participants. A conveyance carries a person who is not a cyclist (FARS PER_TYP 8)."""

    MOTOR_VEHICLE = "motor_vehicle"
    PEDESTRIAN = "pedestrian"
    CYCLIST = "cyclist"
    CONVEYANCE = "conveyance"
    ANIMAL = "animal"


@dataclass(frozen=True)
class Body:
    """Dimensions (m) and mass (kg) of a participant's body.

    For a person, ``height_m`` is the stature, the mass includes what the person rides, and ``vehicle_class`` is
    ``OTHER``: see :func:`trace_dag.simulation.body_sizes.person_body`. For an animal ``length_m`` is that from
    nose to rump and ``height_m`` that of the withers."""

    kind: BodyKind
    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float

    @property
    def is_figure(self) -> bool:
        """Return whether the body is simulated as a jointed figure: a person, on foot or riding, or an animal."""
        return self.kind is not BodyKind.MOTOR_VEHICLE

    @property
    def is_trailer(self) -> bool:
        """Return whether the body is a trailer."""
        return self.vehicle_class is VehicleClass.TRAILER


def party_name(body: Body, number: int) -> str:
    """Return the name of a participant for messages: vehicle 1, pedestrian 1001, the trailer of vehicle 1.

    >>> party_name(Body(BodyKind.PEDESTRIAN, VehicleClass.OTHER, 0.3, 0.5, 1.75, 80.0), 1001)
    'pedestrian 1001'
    """
    if body.kind is BodyKind.MOTOR_VEHICLE:
        return party_in_words(number)
    return f"{body.kind} {number}"


@dataclass(frozen=True)
class AfterStriking:
    """A driver's behaviour after striking a person: on for ``reaction_s``, then braking to a stop.

    An infinite reaction means a driver who does not stop and drives the plan to its end.
    """

    reaction_s: float
    deceleration_mps2: float


@dataclass(frozen=True, eq=False)
class Participant:
    """A body with its initial pose and speed, and the planned motion that it follows until its first contact.

    A driver goes on after striking a person by ``after_striking``, or by the settings if that is None. A person moves
    exactly along the trajectory from its first point until touched, and stands at its end. A vehicle does so from
    ``skids_from_s`` on; it is out of control then, and its heading may differ from its direction. A ``trailer`` has
    ``trailer_heading_rad`` at the start. With ``beyond_edge`` the ground beyond the carriageway's edge is simulated,
    and vehicles can roll over; a vehicle that ``breaks_rail`` is not held at the edge of a bridge. From the first of
    its ``losses_of_control`` on it has no driver. After its first contact ``locked_wheels`` carry that share of its
    weight, from 0 to 1; None uses the settings.
    """

    number: int  # of the party: FARS VEH_NO, 1000 + PER_NO for a person, 2000 + EVENTNUM for an animal
    body: Body
    initial_pose: Pose
    initial_speed_mps: float
    trajectory: Trajectory
    after_striking: AfterStriking | None = None
    skids_from_s: float = math.inf
    trailer: Trailer | None = None
    trailer_heading_rad: float = 0.0
    beyond_edge: bool = False
    breaks_rail: bool = False
    losses_of_control: tuple[LossOfControl, ...] = ()
    locked_wheels: float | None = None


@dataclass(frozen=True, eq=False)
class VehicleLog:
    """States per step of one participant, arrays of equal length n; throttle and brake from 0 to 1.

    ``x_m``, ``y_m`` are of the body's centre, of a thrown person's centre of mass. Heading, pitch and roll turn the
    body in this order about its own axes up, left and ahead (ISO 8855: pitch is positive front down); those of a person
    are the pelvis's. ``landmarks_m`` has k points of a person's body, shape (n, 3 k), each east, north and up of
    (x, y, z): see :data:`trace_dag.simulation.figures.LANDMARKS`; vehicles have none, shape (n, 0).

    Back-ends log states :meth:`on_grid`."""

    number: int
    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray
    speed_mps: FloatArray  # along the body's axis, negative backward
    velocity_x_mps: FloatArray
    velocity_y_mps: FloatArray
    yaw_rate_rps: FloatArray
    acceleration_mps2: FloatArray  # along the body's axis
    steer_rad: FloatArray
    throttle: FloatArray
    brake: FloatArray
    above_road_m: FloatArray  # height of the body's centre above z
    pitch_rad: FloatArray
    roll_rad: FloatArray
    landmarks_m: FloatArray

    def pose_at(self, step: int) -> Pose:
        """Return the pose of the body's centre at a step."""
        x, y, heading, z = (float(values[step]) for values in (self.x_m, self.y_m, self.heading_rad, self.z_m))
        return Pose(x, y, heading, z)

    def on_grid(self) -> VehicleLog:
        """Return a copy with all values but the times rounded to :data:`STATE_GRID`.

        A file of them takes less than half the space; digits beyond the grid are arithmetic noise.
        """
        states = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in _NOT_ON_GRID}
        return replace(self, **{name: np.rint(values * STATE_GRID) / STATE_GRID for name, values in states.items()})


@dataclass(frozen=True)
class Contact:
    """One contact between two bodies: its first moment, and its effects over its whole duration.

    If one of them is a person, the vehicle is the first, and the person's body includes the mount.

    ``normal`` is a unit vector from body 1 to body 2; poses are of the bodies' centres and, like the velocities of
    their centres of gravity, those just before the contact. ``impulse_ns`` and ``delta_v`` (m/s, of the centres of
    gravity) are the effects within :data:`PULSE_S` of its first moment; ``duration_s`` is the time of pressing,
    ``crush_*_m`` the largest crush of each, 0 for persons and rigid objects.

    Numbers, poses and velocities of a combination vehicle are those of the pulling vehicle, whichever part was touched;
    ``delta_v`` is of both parts together. ``trailer_pose_*`` is the pose of a touched trailer.
    """

    time_s: float
    duration_s: float
    x_m: float
    y_m: float
    z_m: float
    normal_x: float
    normal_y: float
    impulse_ns: float
    closing_speed_mps: float
    number_1: int
    number_2: int
    pose_1: Pose
    pose_2: Pose
    velocity_1_mps: tuple[float, float]
    velocity_2_mps: tuple[float, float]
    delta_v_1_mps: tuple[float, float]
    delta_v_2_mps: tuple[float, float]
    crush_1_m: float = 0.0
    crush_2_m: float = 0.0
    trailer_pose_1: Annotated[Pose | None, Field(exclude_if=lambda pose: pose is None)] = None
    trailer_pose_2: Annotated[Pose | None, Field(exclude_if=lambda pose: pose is None)] = None

    @property
    def poses(self) -> dict[int, Pose]:
        """Return poses by the numbers of bodies: of both parties, and of a touched trailer."""
        behind = ((self.number_1, self.trailer_pose_1), (self.number_2, self.trailer_pose_2))
        found = {self.number_1: self.pose_1, self.number_2: self.pose_2}
        return found | {trailer_body(number): pose for number, pose in behind if pose is not None}

    @property
    def touched(self) -> tuple[int, int]:
        """Return the numbers of the two touching bodies; a trailer has its own number."""
        one = self.number_1 if self.trailer_pose_1 is None else trailer_body(self.number_1)
        two = self.number_2 if self.trailer_pose_2 is None else trailer_body(self.number_2)
        return one, two

    def along_m(self, course_rad: float) -> float:
        """Return the distance of the contact ahead of the frame's origin along a course."""
        return self.x_m * math.cos(course_rad) + self.y_m * math.sin(course_rad)


@dataclass(frozen=True)
class Moment:
    """The crash in a simulation: time (s) and place (m), and the parties concerned."""

    time_s: float
    x_m: float
    y_m: float
    numbers: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SimulationLog:
    """The log of a back-end for one hypothesis.

    ``objects`` are the fixed objects.

    A trailer is a body of its own among ``vehicles`` (after all participants) and ``bodies``, numbered
    :func:`trace_dag.crash.parties.trailer_body`; contacts with it are contacts of the pulling vehicle.
    """

    backend: str
    backend_version: str
    step_s: float
    vehicles: tuple[VehicleLog, ...] = field(repr=False)
    contacts: tuple[Contact, ...] = field(repr=False)
    bodies: dict[int, Body] = field(repr=False)
    termination: Termination
    reason: str
    duration_s: float  # simulated time
    wall_s: float = 0.0
    objects: tuple[FixedObject, ...] = ()
    trailers: Mapping[int, Trailer] = field(default_factory=dict)  # by the number of the vehicle that pulls

    @property
    def parties(self) -> tuple[VehicleLog, ...]:
        """Return the logs of the participants, without trailers."""
        return tuple(each for each in self.vehicles if party_of_body(each.number) == each.number)

    def vehicle_log(self, number: int) -> VehicleLog:
        """Return the log of a body."""
        return next(each for each in self.vehicles if each.number == number)

    def trailer_log(self, number: int) -> VehicleLog | None:
        """Return the log of a vehicle's trailer, or None."""
        return next((each for each in self.vehicles if each.number == trailer_body(number)), None)

    def pose_at_contact(self, contact: Contact, number: int) -> Pose | None:
        """Return the pose of a body when its party first touched another in a contact.

        None if the party has no part in it.
        """
        if party_of_body(number) not in (contact.number_1, contact.number_2):
            return None
        if number in contact.poses:
            return contact.poses[number]
        body = self.vehicle_log(number)
        values = (body.x_m, body.y_m, np.unwrap(body.heading_rad), body.z_m)
        x, y, heading, z = (float(np.interp(contact.time_s, body.time_s, each)) for each in values)
        return Pose(x, y, heading, z)

    def articulation_rad(self, number: int) -> FloatArray | None:
        """Return the angle between a vehicle and its trailer per step, shape (n,); None without one.

        It is positive if the vehicle is turned to the left of the trailer.
        """
        trailer = self.trailer_log(number)
        if trailer is None:
            return None
        puller = self.vehicle_log(number)
        return np.asarray((puller.heading_rad - trailer.heading_rad + math.pi) % math.tau - math.pi)

    def clock_body(self, contact: Contact, number: int) -> tuple[Pose, float, float]:
        """Return the body to which clock positions of a contact refer: pose of its middle, length and width (m).

        For a combination vehicle it is the whole combination, in line with the touched part.
        """
        first = number == contact.number_1
        pose, behind = (contact.pose_1, contact.trailer_pose_1) if first else (contact.pose_2, contact.trailer_pose_2)
        body, trailer = self.bodies[number], self.trailers.get(number)
        if trailer is None:
            return pose, body.length_m, body.width_m
        if behind is not None:
            return (
                _middle(trailer.middle_by_trailer(_poses(behind)), behind),
                trailer.combination_length_m,
                trailer.width_m,
            )
        middle = _middle(trailer.middle_by_puller(_poses(pose), body.length_m), pose)
        return middle, trailer.combination_length_m, body.width_m

    def is_figure(self, number: int) -> bool:
        """Return whether the party of that number is simulated as a jointed figure."""
        body = self.bodies.get(number)
        return body is not None and body.is_figure

    def object_of(self, number: int) -> FixedObject | None:
        """Return the fixed object of that number, if it is one."""
        return next((item for item in self.objects if item.number == number), None)

    @property
    def meetings(self) -> tuple[Contact, ...]:
        """Return the contacts between two participants, in order."""
        met = (contact for contact in self.contacts if self.object_of(contact.number_2) is None)
        return tuple(sorted(met, key=lambda contact: contact.time_s))

    @property
    def first_of_each(self) -> tuple[Contact, ...]:
        """Return the first contact of each pair of parties, or of a party and a fixed object, in order."""
        first: dict[tuple[int, int], Contact] = {}
        for each in sorted(self.contacts, key=lambda contact: contact.time_s):
            first.setdefault((each.number_1, each.number_2), each)
        return tuple(first.values())

    @property
    def first_contact(self) -> Contact | None:
        """Return the first contact between two participants, or else with a fixed object, or None."""
        return min(self.meetings or self.contacts, key=lambda contact: contact.time_s, default=None)


def _poses(pose: Pose) -> Poses:
    return np.array(pose.x_m), np.array(pose.y_m), np.array(pose.heading_rad)


def _middle(poses: Poses, part: Pose) -> Pose:
    return Pose(float(poses[0]), float(poses[1]), part.heading_rad, part.z_m)


def moment_of(log: SimulationLog) -> Moment | None:
    """Return the first contact, or without one the first overturn, or None.

    >>> moment_of(log).numbers
    (1, 2)
    """
    contact = log.first_contact
    if contact is not None:
        return Moment(contact.time_s, contact.x_m, contact.y_m, (contact.number_1, contact.number_2))
    over = [(vehicle, k) for vehicle in log.vehicles if (k := overturned_at(vehicle)) is not None]
    moments = [
        Moment(float(each.time_s[k]), float(each.x_m[k]), float(each.y_m[k]), (each.number,)) for each, k in over
    ]
    return min(moments, key=lambda moment: moment.time_s, default=None)


def overturned_at(vehicle: VehicleLog) -> int | None:
    """Return the step of a log at which a vehicle has overturned.

    None if it does not, or for a thrown figure.
    """
    if vehicle.landmarks_m.shape[1]:
        return None
    over = np.flatnonzero(np.abs(vehicle.roll_rad) >= OVERTURNED_RAD)
    return int(over[0]) if len(over) else None


class Simulation(Protocol):
    """One run in a connected back-end."""

    def run(
        self,
        participants: tuple[Participant, ...],
        *,
        time_limit_s: float,
        drivers: Mapping[int, Driver] | None = None,
        after_contact_s: float | None = None,
        objects: tuple[FixedObject, ...] = (),
    ) -> SimulationLog:
        """Simulate until rest or ``time_limit_s``; ends with a termination and a reason, never hangs.

        ``objects`` are fixed; beside them the real ground beyond the carriageway is simulated.

        ``drivers`` take participants over from their plans, by number; their exceptions are passed on. With
        ``after_contact_s`` the simulation ends that long after the first contact, at rest or not.
        """


class Backend(Protocol):
    """A connection to a simulator; lives as long as a batch."""

    name: str

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> Simulation:
        """Prepare the road map.

        ``xodr`` is the stored map, ``network`` the same map as read, ``friction`` that of tyres on this road.
        """

    def close(self) -> None:
        """Release everything; it is safe to call this twice."""


class BackendFactory(Protocol):
    """A package's back-end, usually its class (entry points of the group ``trace_dag.backends``)."""

    one_at_a_time: bool
    """True where only one process can use it: there is one server."""

    def __call__(self, settings: SimSettings) -> Backend:
        """Return the back-end by the settings; it connects when the first map is loaded."""

    def require(self, settings: SimSettings) -> None:
        """Raise :class:`trace_dag.common.errors.UserError` for missing requirements, before anything runs."""
