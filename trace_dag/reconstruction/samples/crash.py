"""Simulation input from a draw, and the courses of a few draws for display.

Each party is on the path of its plan, at the draw's speed, mass and offset.

Belongs here: the motion of the parties until they touch. Does not belong here: the simulation
(:mod:`trace_dag.reconstruction.samples.simulated`).

Courses go from before the impact to rest, stored to 5 cm, ten times a second. Up to shortly before the contact a course
is the plan's path at the draw's speeds; from there it is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, Poses, arc_lengths
from trace_dag.crash.parties import trailer_body
from trace_dag.reconstruction.motion.contact import Shape, shape_gaps_m, shapes
from trace_dag.reconstruction.motion.speeds import BRAKING_MPS2, STARTING_MPS2
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.run import participant
from trace_dag.simulation.states import Hypothesis, ParticipantState, PartyDraw, Sample, Trajectory
from trace_dag.simulation.types import Participant, SimulationLog

LONGEST_BACK_S: Final = 3.0
_APART_M: Final = 0.3
_BACK_S: Final = np.arange(0.1, LONGEST_BACK_S + 0.01, 0.1)
_STEP_S: Final = 0.05
STEP_S: Final = 0.1
PLACE_M: Final = 0.05
TURN_RAD: Final = 0.02
_BEFORE_S: Final = 3.0


@dataclass(frozen=True, eq=False)
class SampledCrash:
    """The parties of a draw, simulated from ``back_s`` before the planned impact."""

    lines: Sequence[PlannedLine]
    objects: tuple[FixedObject, ...]
    back_s: float

    @classmethod
    def of(cls, hypothesis: Hypothesis, sample: Sample) -> SampledCrash | None:
        """Return the draw from shortly before its parties would touch.

        None if they overlap at all earlier times tried.
        """
        meets_s = hypothesis.planned[0].time_s if hypothesis.planned else hypothesis.impact_time_s
        drawn = zip(hypothesis.participants, sample.parties, strict=True)
        lines = [PlannedLine(state, draw, meets_s) for state, draw in drawn]
        apart = np.ones(len(_BACK_S), dtype=bool)
        # What is struck after a first contact of others is not planned; a draw ends before it.
        planned = {event.party_2 for event in hypothesis.planned}
        objects = tuple(item for item in hypothesis.objects if item.number in planned)
        bodies = [line.shapes(-_BACK_S) for line in lines] + [_standing(item) for item in objects]
        for (i, one), (_, two) in combinations(enumerate(bodies), 2):
            if i < len(lines):
                apart &= shape_gaps_m(one, two) >= _APART_M
        back = np.flatnonzero(apart)
        return cls(lines, objects, float(_BACK_S[back[0]])) if len(back) else None

    def participants(self, after_s: float, *, before_s: float = 0.0) -> tuple[Participant, ...]:
        """Return the parties for the simulation, with plans until ``after_s`` after the planned impact.

        They begin ``back_s`` before it, or ``before_s`` if that is earlier.
        """
        return tuple(line.participant(max(before_s, self.back_s), after_s, self.back_s) for line in self.lines)


def _standing(item: FixedObject) -> tuple[Shape, ...]:
    pose, same = item.pose, np.ones(len(_BACK_S))
    poses = (pose.x_m * same, pose.y_m * same, pose.heading_rad * same)
    return shapes(poses, (item.length_m, item.width_m), None, None)


class PlannedLine:
    """The path of a party's plan, driven at a draw's speed.

    Times are relative to the planned impact. Beyond its ends the path continues straight.
    """

    def __init__(self, state: ParticipantState, draw: PartyDraw, meets_s: float) -> None:
        plan = state.trajectory
        self.number = draw.number
        self._state, self._draw, self._meets_s = state, draw, meets_s
        self._xy_m = np.stack([plan.x_m, plan.y_m], axis=-1)
        self._heading_rad = np.unwrap(plan.heading_rad)
        self._trailing_rad = state.trailer_heading_rad
        self._station_m = arc_lengths(self._xy_m)
        self._from_m = float(np.interp(meets_s, plan.time_s, self._station_m)) + draw.ahead_m
        self._backward = state.impact_speed_mps < 0
        self._mps = draw.impact_mps

    def _at(self, ahead_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return x, y, z and heading at distances along the path from the planned impact."""
        station, on_path = self._station_m, self._from_m + ahead_m
        heading = np.interp(on_path, station, self._heading_rad)
        course = heading + math.pi if self._backward else heading
        beyond = on_path - np.clip(on_path, 0.0, station[-1])
        x = np.interp(on_path, station, self._xy_m[:, 0]) + beyond * np.cos(course)
        y = np.interp(on_path, station, self._xy_m[:, 1]) + beyond * np.sin(course)
        z = np.interp(on_path, station, self._state.trajectory.z_m)
        left_m = self._draw.left_m
        return x - left_m * np.sin(heading), y + left_m * np.cos(heading), z, heading

    def shapes(self, seconds: FloatArray) -> tuple[Shape, ...]:
        """Return the party's bodies at times from the planned impact, at the impact speed."""
        return self._shapes(self._mps * seconds)

    def _shapes(self, ahead_m: FloatArray) -> tuple[Shape, ...]:
        x, y, _, heading = self._at(ahead_m)
        state = self._state
        return shapes((x, y, heading), (state.length_m, state.width_m), state.trailer, self._trailing(ahead_m))

    def _trailing(self, ahead_m: FloatArray) -> FloatArray | None:
        """Return the heading of the trailer, as planned at this distance."""
        if self._trailing_rad is None:
            return None
        return np.asarray(np.interp(self._from_m + ahead_m, self._station_m, self._trailing_rad))

    def approach(self, seconds: FloatArray, back_s: float) -> tuple[Poses, ...]:
        """Return middles and headings of its bodies at times from the planned impact."""
        return tuple(each.poses for each in self._shapes(self._driven(seconds, back_s)[0]))

    def _driven(self, seconds: FloatArray, back_s: float) -> tuple[FloatArray, FloatArray]:
        """Return distance along the path from the planned impact (m) and speed (m/s), at times from the impact.

        Until ``back_s`` before the impact, the speed changes from the draw's travel speed to its impact speed, as hard
        as drivers brake or accelerate.
        """
        travel, impact = self._draw.travel_mps, self._mps
        rate = math.copysign(BRAKING_MPS2 if travel > impact else STARTING_MPS2, travel - impact)
        before_s = np.maximum(-seconds - back_s, 0.0)
        changing_s = np.minimum(before_s, (travel - impact) / rate)
        back_m = impact * changing_s + rate / 2 * changing_s**2 + travel * (before_s - changing_s)
        return impact * np.maximum(seconds, -back_s) - back_m, impact + rate * changing_s

    def participant(self, begins_s: float, after_s: float, back_s: float) -> Participant:
        """Return the party for the simulation, from ``begins_s`` before the planned impact."""
        time_s = np.arange(0.0, begins_s + after_s, _STEP_S)
        ahead_m, speed = self._driven(time_s - begins_s, back_s)
        x, y, z, heading = self._at(ahead_m)
        speed = -speed if self._backward else speed
        planned = participant(self._state)
        trailing = self._trailing(ahead_m[:1])
        return replace(
            planned,
            body=replace(planned.body, mass_kg=self._draw.mass_kg),
            initial_pose=Pose(float(x[0]), float(y[0]), math.remainder(float(heading[0]), math.tau), float(z[0])),
            initial_speed_mps=float(speed[0]),
            trajectory=Trajectory(time_s, x, y, z, heading, speed),
            skids_from_s=max(planned.skids_from_s - self._meets_s + begins_s, 0.0),
            trailer_heading_rad=0.0 if trailing is None else float(trailing[0]),
            beyond_edge=False,
            losses_of_control=(),
        )


# --- likely courses --------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class SampledBody:
    """The course of a body in a draw, a step each :data:`STEP_S`.

    The middle is in units of :data:`PLACE_M`, east and north, the heading in units of :data:`TURN_RAD`.

    Each list has the first value, then the differences between steps.
    """

    number: int
    x: tuple[int, ...]
    y: tuple[int, ...]
    heading: tuple[int, ...]

    @classmethod
    def at(cls, number: int, x_m: FloatArray, y_m: FloatArray, heading_rad: FloatArray) -> SampledBody:
        """Return a body with these positions, arrays of equal length (m, rad); the headings are continuous."""
        columns = ((x_m, PLACE_M), (y_m, PLACE_M), (heading_rad, TURN_RAD))
        return cls(number, *(tuple(_differences(values, unit)) for values, unit in columns))

    @property
    def poses(self) -> FloatArray:
        """Return x, y (m) and heading (rad) of each step, shape (n, 3).

        >>> SampledBody.at(1, np.array([0.0, 1.0, 2.2]), np.zeros(3), np.zeros(3)).poses[:, 0].tolist()
        [0.0, 1.0, 2.2]
        """
        columns = ((self.x, PLACE_M), (self.y, PLACE_M), (self.heading, TURN_RAD))
        return np.stack([np.round(np.cumsum(values) * unit, 4) for values, unit in columns], axis=-1)


@dataclass(frozen=True)
class SampledCourse:
    """The course of a draw, with its index among the estimate's draws.

    ``begins_s`` is the time of its first step from the contact (s).
    """

    sample: int
    begins_s: float
    bodies: tuple[SampledBody, ...]


def course_of(sample: int, drawn: SampledCrash, log: SimulationLog) -> SampledCourse | None:
    """Return the course of a draw that was simulated to its end; None without a contact.

    >>> from trace_dag.reconstruction.samples.crash import SampledCrash
    >>> from trace_dag.reconstruction.samples.draws import draw_samples
    >>> drawn = SampledCrash.of(hypothesis, draw_samples(record, [hypothesis], 1)[0])
    >>> course = course_of(0, drawn, log)
    >>> course.begins_s, [body.number for body in course.bodies]
    (-3.0, [1, 2])
    """
    contact = log.first_contact
    if contact is None:
        return None
    ends_s = float(log.vehicles[0].time_s[-1]) - contact.time_s
    steps_s = np.arange(-round(_BEFORE_S / STEP_S), int(ends_s / STEP_S + 1e-9) + 1) * STEP_S
    clock_s = steps_s + contact.time_s  # of the log
    early = clock_s < 0
    before: dict[int, Poses] = {}
    for line in drawn.lines:
        approach = line.approach(np.asarray(clock_s[early] - drawn.back_s, float), drawn.back_s)
        before |= dict(zip((line.number, trailer_body(line.number)), approach, strict=False))
    bodies = []
    for vehicle in log.vehicles:
        columns = (vehicle.x_m, vehicle.y_m, np.unwrap(vehicle.heading_rad))
        after = [np.interp(clock_s[~early], vehicle.time_s, values) for values in columns]
        x, y, heading = (np.concatenate(each) for each in zip(before[vehicle.number], after, strict=True))
        bodies.append(SampledBody.at(vehicle.number, x, y, np.unwrap(heading)))
    return SampledCourse(sample, round(float(steps_s[0]), 3), tuple(bodies))


def _differences(values: FloatArray, unit: float) -> list[int]:
    whole = np.round(values / unit).astype(int)
    return [int(each) for each in np.diff(whole, prepend=0)]
