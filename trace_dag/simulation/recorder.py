"""The record of a run: states at the times of the log, and the beginning, course and end of contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.crash.parties import party_of_body
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.outlines import Outline, between, contact_point, first_touch, separation
from trace_dag.simulation.people import Person, PersonTouch
from trace_dag.simulation.towing import whole_kg
from trace_dag.simulation.types import DEEPEST_EVERY_S, PULSE_S, Contact, VehicleLog

_SAME_TIME_S = 1e-6
_STATE = 10  # numbers of a row that everybody has; a vehicle's goes on with height and roll, a person's with height,
# pitch, roll and landmarks
_LONGEST_GAP_S = 0.05  # bodies that touch again sooner are still in the same contact
_LONGEST_PERSON_GAP_S = 1.0  # and a person: legs, hip and head meet a front one after the other


class _Moment(NamedTuple):
    """A state of all participants in which two vehicles overlap."""

    overlap_m: float
    time_s: float
    rows: list[tuple[float, ...]]


class StateRecorder:
    """A collection of one row per participant and logged moment, turned into logs at the end."""

    def __init__(self, movers: Sequence[Vehicle | Person]) -> None:
        self._movers = movers
        self._states: dict[float, list[tuple[float, ...]]] = {}  # by time, a row per participant
        self._deepest: dict[tuple[tuple[int, int], int], _Moment] = {}  # by pair of bodies and tenth of a second
        self._taken: tuple[float, list[tuple[float, ...]]] = (-1.0, [])  # the last state that was kept for its overlap

    def record(self, time_s: float) -> None:
        """Record the present state of all participants, once for each time."""
        self._states.setdefault(time_s, self._now())

    def record_overlap(self, pair: tuple[int, int], overlap_m: float, time_s: float) -> None:
        """Record the present state if these two bodies overlap deeper than before in this tenth of a second."""
        window = pair, math.floor(time_s / DEEPEST_EVERY_S + 1e-9)
        known = self._deepest.get(window)
        if overlap_m > (known.overlap_m if known else 0.0):
            if self._taken[0] != time_s:
                self._taken = time_s, self._now()
            self._deepest[window] = _Moment(overlap_m, *self._taken)

    def _now(self) -> list[tuple[float, ...]]:
        return [mover.log_row() for mover in self._movers]

    def logs(self) -> tuple[VehicleLog, ...]:
        """Return the logs of the bodies' centres; acceleration is the mean since the previous row."""
        states = dict(self._states)
        for moment in self._deepest.values():
            if min((abs(moment.time_s - time_s) for time_s in states), default=math.inf) > _SAME_TIME_S:
                states[moment.time_s] = moment.rows
        time = np.array(sorted(states))
        logs = []
        for k, mover in enumerate(self._movers):
            rows = np.array([states[time_s][k] for time_s in time.tolist()])
            x, y, z, heading, vx, vy, yaw_rate, steer, throttle, brake = rows[:, :_STATE].T
            c, s = np.cos(heading), np.sin(heading)
            ahead = mover.model.cg_ahead_m
            x, y = x - ahead * c, y - ahead * s
            centre_vx, centre_vy = vx + ahead * yaw_rate * s, vy - ahead * yaw_rate * c
            acceleration = np.zeros_like(time)
            if len(time) > 1:
                step = np.diff(time)
                acceleration[1:] = (np.diff(vx) * c[1:] + np.diff(vy) * s[1:]) / step
                acceleration[0] = acceleration[1]
            logs.append(
                VehicleLog(
                    number=mover.number,
                    time_s=time,
                    x_m=x,
                    y_m=y,
                    z_m=z,
                    heading_rad=np.arctan2(s, c),
                    speed_mps=centre_vx * c + centre_vy * s,
                    velocity_x_mps=centre_vx,
                    velocity_y_mps=centre_vy,
                    yaw_rate_rps=yaw_rate,
                    acceleration_mps2=acceleration,
                    steer_rad=steer,
                    throttle=throttle,
                    brake=brake,
                    **self._posture(mover, rows[:, _STATE:]),
                ).on_grid()
            )
        return tuple(logs)

    @staticmethod
    def _posture(mover: Vehicle | Person, rows: FloatArray) -> dict[str, FloatArray]:
        """Return the logged posture of a body; vehicles do not pitch."""
        if isinstance(mover, Person):
            return {
                "above_road_m": rows[:, 0],
                "pitch_rad": rows[:, 1],
                "roll_rad": rows[:, 2],
                "landmarks_m": rows[:, 3:],
            }
        return {
            "above_road_m": rows[:, 0],
            "pitch_rad": np.zeros(len(rows)),
            "roll_rad": rows[:, 1],
            "landmarks_m": rows[:, 2:],
        }


@dataclass
class ContactEpisode:
    """A contact of two bodies that is under way: its first moment, and its impulse and crush so far."""

    one: Vehicle
    two: Vehicle | Person
    start_s: float
    point: tuple[float, float]
    normal: tuple[float, float]
    poses: tuple[Pose, Pose]
    velocities: tuple[tuple[float, float], tuple[float, float]]
    closing_speed_mps: float
    last_s: float
    longest_gap_s: float = _LONGEST_GAP_S
    impulse_x_ns: float = 0.0
    impulse_y_ns: float = 0.0
    crush_m: tuple[float, float] = (0.0, 0.0)
    trailer_poses: tuple[Pose | None, Pose | None] = (None, None)

    @property
    def masses_kg(self) -> tuple[float, float]:
        """Return the masses of both bodies, each with its trailer or pulling vehicle."""
        return whole_kg(self.one), self.two.model.body.mass_kg if isinstance(self.two, Person) else whole_kg(self.two)

    @property
    def over_s(self) -> float:
        """Return the time from which it counts as over unless the bodies touch again."""
        return self.last_s + self.longest_gap_s

    @property
    def pulse_end_s(self) -> float:
        """Return the time until which its impulse is counted."""
        return self.start_s + PULSE_S

    @property
    def ends_s(self) -> float:
        """Return the end of its pulse."""
        return min(self.over_s, self.pulse_end_s)

    @property
    def impulse_ns(self) -> float:
        """Return the impulse of the pulse so far."""
        return math.hypot(self.impulse_x_ns, self.impulse_y_ns)

    def add(self, force_x_n: float, force_y_n: float, time_s: float, step_s: float) -> None:
        """Count the force on the second body over a step that ends at ``time_s``."""
        self.last_s = time_s
        if time_s <= self.pulse_end_s:
            self.impulse_x_ns += force_x_n * step_s
            self.impulse_y_ns += force_y_n * step_s

    def contact(self) -> Contact:
        """Return the contact as logged."""
        m1, m2 = self.masses_kg
        px, py = self.impulse_x_ns, self.impulse_y_ns
        return Contact(
            time_s=self.start_s,
            duration_s=max(self.last_s - self.start_s, 0.0),
            x_m=self.point[0],
            y_m=self.point[1],
            z_m=(self.poses[0].z_m + self.poses[1].z_m) / 2,
            normal_x=self.normal[0],
            normal_y=self.normal[1],
            impulse_ns=self.impulse_ns,
            closing_speed_mps=self.closing_speed_mps,
            number_1=party_of_body(self.one.number),
            number_2=party_of_body(self.two.number),
            pose_1=self.poses[0],
            pose_2=self.poses[1],
            velocity_1_mps=self.velocities[0],
            velocity_2_mps=self.velocities[1],
            delta_v_1_mps=(-px / m1, -py / m1),
            delta_v_2_mps=(px / m2, py / m2),
            crush_1_m=self.crush_m[0],
            crush_2_m=self.crush_m[1],
            trailer_pose_1=self.trailer_poses[0],
            trailer_pose_2=self.trailer_poses[1],
        )


class Pulled(NamedTuple):
    """The vehicle that pulls a touched trailer, at the beginning of the contact, in the states before and after."""

    vehicle: Vehicle
    before: BodyMotion
    after: BodyMotion


def of_combinations(episode: ContactEpisode, pulled: Sequence[Pulled | None], share: float) -> ContactEpisode:
    """Return a contact of trailers as one of their pulling vehicles.

    The poses are those at ``share`` of the step between the states before and after, the velocities those before it.
    """
    poses, velocities = list(episode.poses), list(episode.velocities)
    trailers: list[Pose | None] = [None, None]
    for k, by in enumerate(pulled):
        if by is None:
            continue
        trailers[k] = poses[k]
        before, after = (by.vehicle.outline_at(m.x_m, m.y_m, m.heading_rad) for m in (by.before, by.after))
        poses[k] = _pose(between(before, after, share), by.vehicle.z)
        velocities[k] = (by.before.velocity_x_mps, by.before.velocity_y_mps)
    return replace(
        episode,
        poses=(poses[0], poses[1]),
        velocities=(velocities[0], velocities[1]),
        trailer_poses=(trailers[0], trailers[1]),
    )


class BodyMotion(NamedTuple):
    """A body's centre of gravity at one moment: place (m, local frame), heading (rad), and their rates."""

    x_m: float
    y_m: float
    heading_rad: float
    velocity_x_mps: float
    velocity_y_mps: float
    yaw_rate_rps: float


def begin_contact(
    one: Vehicle,
    two: Vehicle,
    before: tuple[BodyMotion, BodyMotion],
    after: tuple[BodyMotion, BodyMotion],
    before_s: float,
    step_s: float,
) -> ContactEpisode:
    """Return the contact of two bodies that were apart at ``before_s`` and overlap ``step_s`` later.

    It begins with their first touch.

    Velocities are those before it; the closing speed is that of the touching points, along the normal.

    >>> here, there = (BodyMotion(x_m, 0.0, 0.0, 10.0, 0.0, 0.0) for x_m in (0.0, 1.0))  # 10 m/s for 0.1 s
    >>> stands = BodyMotion(4.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    >>> episode = begin_contact(*simulated_pair, (here, stands), (there, stands), 2.0, 0.1)
    >>> 2.0 < episode.start_s < 2.1, episode.normal, episode.closing_speed_mps
    (True, (1.0, 0.0), 10.0)
    """

    def outlines(motions: tuple[BodyMotion, BodyMotion]) -> tuple[Outline, Outline]:
        first, second = (v.outline_at(m.x_m, m.y_m, m.heading_rad) for v, m in zip((one, two), motions, strict=True))
        return first, second

    start, end = outlines(before), outlines(after)
    fraction = first_touch(start, end)
    touch_1, touch_2 = between(start[0], end[0], fraction), between(start[1], end[1], fraction)
    _, nx, ny = separation(touch_1, touch_2)
    px, py = contact_point(touch_1, touch_2)
    (vx_1, vy_1), (vx_2, vy_2) = (
        (m.velocity_x_mps - m.yaw_rate_rps * (py - m.y_m), m.velocity_y_mps + m.yaw_rate_rps * (px - m.x_m))
        for m in before
    )
    return ContactEpisode(
        one=one,
        two=two,
        start_s=before_s + fraction * step_s,
        point=(px, py),
        normal=(nx, ny),
        poses=(_pose(touch_1, one.z), _pose(touch_2, two.z)),
        velocities=(
            (before[0].velocity_x_mps, before[0].velocity_y_mps),
            (before[1].velocity_x_mps, before[1].velocity_y_mps),
        ),
        closing_speed_mps=(vx_1 - vx_2) * nx + (vy_1 - vy_2) * ny,
        last_s=before_s + step_s,
    )


def begin_strike(vehicle: Vehicle, person: Person, touch: PersonTouch, now_s: float, step_s: float) -> ContactEpisode:
    """Return the contact of a vehicle and a person who touch at ``now_s`` but did not a step before.

    It begins with their first touch, which is computed from the present depth.

    >>> from trace_dag.simulation.people import PersonTouch
    >>> car, touch = simulated_pair[0], PersonTouch(0.01, [0.0, 0.0, 1.0], (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    >>> round(begin_strike(car, simulated_person, touch, 2.0, 0.005).start_s, 4)  # 0.01 m ago, at 6 m/s
    1.9984
    """
    px, py, _ = touch.point
    nx, ny = touch.normal[0], touch.normal[1]
    level = math.hypot(nx, ny)
    turning_x, turning_y = -vehicle.yaw_rate * (py - vehicle.y), vehicle.yaw_rate * (px - vehicle.x)
    past_x, past_y = vehicle.vx + turning_x - person.vx, vehicle.vy + turning_y - person.vy
    deepening = past_x * nx + past_y * ny
    ago_s = min(step_s, max(touch.depth_m, 0.0) / deepening) if deepening > 0 else 0.0
    if level > 1e-6:
        nx, ny = nx / level, ny / level
    else:
        nx, ny = math.cos(person.heading), math.sin(person.heading)
    there = vehicle.outline_at(
        vehicle.x - vehicle.vx * ago_s, vehicle.y - vehicle.vy * ago_s, vehicle.heading - vehicle.yaw_rate * ago_s
    )
    place = Pose(
        person.x - person.vx * ago_s, person.y - person.vy * ago_s, math.remainder(person.heading, math.tau), person.z
    )
    return ContactEpisode(
        one=vehicle,
        two=person,
        start_s=now_s - ago_s,
        point=(px - vehicle.vx * ago_s, py - vehicle.vy * ago_s),
        normal=(nx, ny),
        poses=(_pose(there, vehicle.z), place),
        velocities=((vehicle.vx, vehicle.vy), (person.vx, person.vy)),
        closing_speed_mps=past_x * nx + past_y * ny,
        last_s=now_s,
        longest_gap_s=_LONGEST_PERSON_GAP_S,
    )


def _pose(outline: Outline, z_m: float) -> Pose:
    return Pose(outline.x_m, outline.y_m, math.remainder(outline.heading_rad, math.tau), z_m)
