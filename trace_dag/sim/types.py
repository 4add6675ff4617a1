"""The back-end contract: participants in, a log out. The same types for every back-end.

Frame: the crash's local frame; times in seconds from the start of the reconstruction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

import numpy as np

from trace_dag.crash.record import VehicleClass
from trace_dag.geometry import FloatArray, Pose
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.sim.driving import Driver
from trace_dag.states.objects import FixedObject
from trace_dag.states.types import Trajectory

if TYPE_CHECKING:
    from trace_dag.settings import SimSettings

PULSE_S = 0.25
"""Time after first touching over which a contact's delta-v is taken: that of event data recorders, 49 CFR 563.7."""

DEEPEST_EVERY_S = 0.1
"""Of each contact, the log has the state at its deepest overlap within each so much of its clock. Rigid bodies overlap
by centimetres for some thirty milliseconds: the log's own steps can miss what made the crash."""


OVERTURNED_RAD = math.radians(60)
"""Who is tilted that far has overturned: the centre of gravity of every class is beyond its wheels by then."""


class Termination(StrEnum):
    """Why a simulation ended."""

    AT_REST = "at_rest"
    TIME_LIMIT = "time_limit"
    NO_CONTACT = "no_contact"
    STARTED_IN_CONTACT = "started_in_contact"
    DIVERGED = "diverged"
    BACKEND_ERROR = "backend_error"


class BodyKind(StrEnum):
    """What a participant is. A conveyance is what a person stands or sits on who is not a cyclist (FARS PER_TYP 8)."""

    MOTOR_VEHICLE = "motor_vehicle"
    PEDESTRIAN = "pedestrian"
    CYCLIST = "cyclist"
    CONVEYANCE = "conveyance"
    ANIMAL = "animal"


@dataclass(frozen=True)
class Body:
    """Dimensions (m) and mass (kg) of a participant's body.

    Of a person, ``height_m`` is the stature, the mass includes what the person rides, and ``vehicle_class`` says
    nothing (``OTHER``): see :func:`trace_dag.sim.anthropometry.person_body`. Of an animal ``length_m`` is that from
    nose to rump and ``height_m`` that of the withers.
    """

    kind: BodyKind
    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float

    @property
    def is_figure(self) -> bool:
        """Whether it is simulated as a jointed figure: a person, on foot or riding, or an animal."""
        return self.kind is not BodyKind.MOTOR_VEHICLE


def party_name(body: Body, number: int) -> str:
    """What messages call a participant: vehicle 1, pedestrian 1001."""
    noun = "vehicle" if body.kind is BodyKind.MOTOR_VEHICLE else str(body.kind)
    return f"{noun} {number}"


@dataclass(frozen=True)
class AfterStriking:
    """What a driver does after striking a person: drives on for ``reaction_s``, then brakes to a stop.

    An infinite reaction is a driver who does not stop for it and drives the plan to its end.
    """

    reaction_s: float
    deceleration_mps2: float


@dataclass(frozen=True, eq=False)
class Participant:
    """A body, where and how fast it starts, and the planned motion that it follows until its first contact.

    A driver goes on after striking a person, as ``after_striking`` says or, where it is None, as the settings do. A
    person moves along the trajectory exactly, from its first point, until touched, and stands where it ends. So does a
    vehicle from ``skids_from_s`` on, which is out of control then and need not head the way it goes.
    """

    number: int  # of the party: FARS VEH_NO, 1000 + PER_NO for a person, 2000 + EVENTNUM for an animal
    body: Body
    initial_pose: Pose
    initial_speed_mps: float
    trajectory: Trajectory
    after_striking: AfterStriking | None = None
    skids_from_s: float = math.inf


@dataclass(frozen=True, eq=False)
class VehicleLog:
    """States per step of one participant, arrays of equal length n; throttle and brake from 0 to 1.

    ``x_m``, ``y_m`` are of the body's centre, of a thrown person's centre of mass. Heading, pitch and roll turn the
    body in this order about its own axes up, left and ahead (ISO 8855: pitch is positive front down); those of a person
    are the pelvis's. ``landmarks_m`` has k points of a person's body, shape (n, 3 k), each east, north and up of
    (x, y, z): see :data:`trace_dag.sim.figures.LANDMARKS`; vehicles have none, shape (n, 0).
    """

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


@dataclass(frozen=True)
class Contact:
    """One contact between two bodies: its first moment, and what it did over its whole duration. Where one of them is
    a person, the vehicle is the first, and the person's body includes what the person rides.

    ``normal`` is a unit vector from body 1 to body 2; poses are of the bodies' centres and, like the velocities of
    their centres of gravity, those just before the contact. ``impulse_ns`` and ``delta_v`` (m/s, of the centres of
    gravity) are what the contact did within :data:`PULSE_S` of its first moment; ``duration_s`` is how long the two
    pressed each other, ``crush_*_m`` how deep each was pressed in at most; persons and rigid objects are not.
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

    def along_m(self, course_rad: float) -> float:
        """How far it is ahead of the frame's origin, seen along a course."""
        return self.x_m * math.cos(course_rad) + self.y_m * math.sin(course_rad)


@dataclass(frozen=True)
class Moment:
    """What a simulation is about: when (s) and where (m) it happened, and whom it concerns."""

    time_s: float
    x_m: float
    y_m: float
    numbers: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SimulationLog:
    """What a back-end returns for one hypothesis. ``objects`` are the fixed ones that stood there."""

    backend: str
    backend_version: str
    step_s: float
    vehicles: tuple[VehicleLog, ...]
    contacts: tuple[Contact, ...]
    bodies: dict[int, Body]
    termination: Termination
    reason: str
    duration_s: float  # simulated time
    wall_s: float = 0.0
    objects: tuple[FixedObject, ...] = ()

    def is_figure(self, number: int) -> bool:
        """Whether the party of that number is simulated as a jointed figure."""
        body = self.bodies.get(number)
        return body is not None and body.is_figure

    def object_of(self, number: int) -> FixedObject | None:
        """The fixed object of that number, if it is one."""
        return next((item for item in self.objects if item.number == number), None)

    @property
    def first_contact(self) -> Contact | None:
        """The first contact between two participants."""
        return min(self.contacts, key=lambda contact: contact.time_s, default=None)


def moment_of(log: SimulationLog) -> Moment | None:
    """The first contact; where nobody touched anything, the first overturn; None if there is neither."""
    contact = log.first_contact
    if contact is not None:
        return Moment(contact.time_s, contact.x_m, contact.y_m, (contact.number_1, contact.number_2))
    over = [(vehicle, k) for vehicle in log.vehicles if (k := overturned_at(vehicle)) is not None]
    moments = [
        Moment(float(each.time_s[k]), float(each.x_m[k]), float(each.y_m[k]), (each.number,)) for each, k in over
    ]
    return min(moments, key=lambda moment: moment.time_s, default=None)


def overturned_at(vehicle: VehicleLog) -> int | None:
    """The step of a log at which a vehicle has overturned; None if it does not, or is a figure that is thrown."""
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

        ``objects`` stand where they are; beside them the ground beyond the carriageway is what it is there.

        ``drivers`` take participants over from their plans, by number; what they raise is passed on. With
        ``after_contact_s`` the simulation ends that long after the first contact, at rest or not.
        """


class Backend(Protocol):
    """A connection to a simulator; lives as long as a batch."""

    name: str

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> Simulation:
        """Make the road map ready. ``xodr`` is the map as stored, ``network`` the same map as read, ``friction`` that
        of tyres on this road."""

    def close(self) -> None:
        """Release everything; safe to call twice."""


class BackendFactory(Protocol):
    """What a package offers as a back-end, usually its class (entry points of the group ``trace_dag.backends``)."""

    one_at_a_time: bool
    """Whether only one process can use it: there is one server."""

    def __call__(self, settings: SimSettings) -> Backend:
        """The back-end by the settings; it connects when the first map is loaded."""

    def require(self, settings: SimSettings) -> None:
        """Raise :class:`trace_dag.errors.UserError` for what is not there, before anything runs."""
