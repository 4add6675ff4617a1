"""A simulated crash in the published benchmark's layout: two cars on waypoints at constant speed, in CARLA's frame.

That layout has one kind of motion and one body, the Tesla Model 3 it was made with. The motion is translated so that
scripts written for the layout reproduce the crash: each vehicle follows its path at its reported speed (its mean speed,
if none is reported) and starts as far from the crash as it gets in the time that both have. Bodies of another size are
replaced such that the same part of the body is hit: sideways the path is moved by the difference in width, and along it
the car goes on until it touches. :func:`trace_dag.sim.published.read_published` reads the result.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

import numpy as np

from trace_dag.crash.parties import party_label
from trace_dag.errors import UserError
from trace_dag.geometry import FloatArray, Pose, arc_lengths, headings
from trace_dag.sim.carla_frame import heading_to_carla, location_to_carla
from trace_dag.sim.published import CAR_LENGTH_M, CAR_WIDTH_M, SPAWN_HEIGHT_M
from trace_dag.sim.types import Contact, SimulationLog
from trace_dag.states.types import Hypothesis, ParticipantState, SpeedSource
from trace_dag.units import mps_to_kmh

WAYPOINT_STEP_M = 5.0

_GOES_ON_M = 20.0  # past the crash, as the published ones do
_SAME_PLACE_M = 1e-3
_STANDS_M = 0.5  # a vehicle that has moved no farther until the crash was standing


@dataclass(frozen=True, eq=False)
class _Way:
    """A vehicle's way: the path of a car's centre, shape (n, 2), the distance along it at which it is hit, speed, body
    heading relative to the way (0, or pi when backing) and height of the road where it starts (m)."""

    path_m: FloatArray
    hit_at_m: float
    speed_mps: float
    turned_rad: float
    z_m: float


def write_published(hypothesis: Hypothesis, log: SimulationLog) -> bytes:
    """``simulation_<stateCase>.json`` of one simulated hypothesis.

    The vehicle with the lower number is ``vehicle1``. Raises :class:`UserError` for a simulation without a contact, and
    for one in which a person or an object was struck: the layout knows two vehicles.

    >>> sorted(json.loads(write_published(hypothesis, log)))
    ['crash_point', 'vehicle1', 'vehicle2']
    """
    contact = log.first_contact
    if contact is None:
        raise UserError("a crash without a contact cannot be told in the published layout")
    item = log.object_of(contact.number_2)
    if item is not None:
        raise UserError(
            f"{party_label(contact.number_1)} struck a {item.name}; the published layout knows two vehicles and "
            "nothing else: use the layout packages"
        )
    if log.is_figure(contact.number_2):
        raise UserError(
            f"{party_label(contact.number_1)} struck {party_label(contact.number_2)}, a person; the published layout "
            "knows two vehicles and nobody else: use the layout packages"
        )
    states = {state.vehicle_number: state for state in hypothesis.participants}
    ways = [_way(states[number], log, contact) for number in sorted((contact.number_1, contact.number_2))]
    lead_s = min((way.hit_at_m / way.speed_mps for way in ways if way.speed_mps > 0), default=0.0)
    vehicles = {f"vehicle{index}": _vehicle(way, lead_s) for index, way in enumerate(ways, start=1)}
    return (json.dumps({**vehicles, "crash_point": {"x": 0.0, "y": 0.0}}, indent=4) + "\n").encode()


def _vehicle(way: _Way, lead_s: float) -> dict[str, object]:
    start_m = way.hit_at_m - way.speed_mps * lead_s
    stations = np.arange(start_m, way.hit_at_m + _GOES_ON_M, WAYPOINT_STEP_M)
    along = arc_lengths(way.path_m)
    points = np.stack([np.interp(stations, along, way.path_m[:, i]) for i in (0, 1)], axis=-1)
    ahead_m = way.path_m[np.searchsorted(along, start_m + _SAME_PLACE_M)] - points[0]
    heading = math.atan2(ahead_m[1], ahead_m[0]) + way.turned_rad
    waypoints = [location_to_carla(x, y) for x, y in points.tolist()]
    return {
        "start_position": {"x": waypoints[0][0], "y": waypoints[0][1], "z": way.z_m + SPAWN_HEIGHT_M},
        "speed_kmh": mps_to_kmh(way.speed_mps),
        "yaw": heading_to_carla(heading),
        "trajectory": waypoints,
    }


def _way(state: ParticipantState, log: SimulationLog, contact: Contact) -> _Way:
    pose = contact.pose_1 if state.vehicle_number == contact.number_1 else contact.pose_2
    ahead_m, left_m = _shift(state, pose, contact)
    logged = log.vehicle_log(state.vehicle_number)
    before = logged.time_s < contact.time_s
    driven = np.stack([logged.x_m[before], logged.y_m[before]], axis=-1)
    to_contact_m = float(arc_lengths(np.concatenate([driven, [[pose.x_m, pose.y_m]]]))[-1])
    if to_contact_m < _STANDS_M:
        x, y = pose.x_m, pose.y_m
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        begin = np.array([x + ahead_m * c - left_m * s, y + ahead_m * s + left_m * c])
        end = begin + (_GOES_ON_M + WAYPOINT_STEP_M) * np.array([c, s])
        return _Way(np.stack([begin, end]), 0.0, 0.0, 0.0, float(logged.z_m[0]))
    backing = bool(logged.speed_mps[before][-1] < 0)
    path = _distinct(np.concatenate([driven, _onward(state, pose, contact)]))
    normal = headings(path) + (math.pi if backing else 0.0) + math.pi / 2
    path = path + left_m * np.stack([np.cos(normal), np.sin(normal)], axis=-1)
    reported = state.speed_source is SpeedSource.REPORTED and abs(state.initial_speed_mps) > _STANDS_M
    return _Way(
        path_m=path,
        hit_at_m=float(arc_lengths(path)[len(_distinct(driven))]) + (-ahead_m if backing else ahead_m),
        speed_mps=abs(state.initial_speed_mps) if reported else to_contact_m / contact.time_s,
        turned_rad=math.pi if backing else 0.0,
        z_m=float(logged.z_m[0]),
    )


def _shift(state: ParticipantState, pose: Pose, contact: Contact) -> tuple[float, float]:
    """How far ahead and to the left of the body's centre the car's centre must be to be touched at the same part."""
    dx, dy = contact.x_m - pose.x_m, contact.y_m - pose.y_m
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    ahead_m, left_m = dx * c + dy * s, dy * c - dx * s
    return ahead_m * (1 - CAR_LENGTH_M / state.length_m), left_m * (1 - CAR_WIDTH_M / state.width_m)


def _onward(state: ParticipantState, pose: Pose, contact: Contact) -> FloatArray:
    """The planned path from the contact on, shape (n, 2), continued straight on."""
    plan = state.trajectory
    at = np.array([np.interp(contact.time_s, plan.time_s, values) for values in (plan.x_m, plan.y_m)])
    here = np.array([pose.x_m, pose.y_m])
    after = plan.time_s > contact.time_s
    planned = np.stack([plan.x_m[after], plan.y_m[after]], axis=-1) - at + here
    way = _distinct(np.concatenate([here[None], planned]))
    course = way[-1] - way[-2] if len(way) > 1 else np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
    enough_m = _GOES_ON_M + WAYPOINT_STEP_M + state.length_m
    return np.concatenate([way, (way[-1] + course / np.hypot(*course) * enough_m)[None]])


def _distinct(path_m: FloatArray) -> FloatArray:
    """The points without repeated ones."""
    kept: FloatArray = path_m[np.concatenate([[True], np.hypot(*np.diff(path_m, axis=0).T) > _SAME_PLACE_M])]
    return kept
