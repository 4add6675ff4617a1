"""The courses of a few draws, from before the impact to rest, stored to 5 cm, ten times a second.

Up to shortly before the contact a course is the plan's path at the draw's speeds; from there it is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Poses
from trace_dag.crash.parties import trailer_body
from trace_dag.reconstruction.samples.crash import SampledCrash
from trace_dag.simulation.types import SimulationLog

STEP_S: Final = 0.1
PLACE_M: Final = 0.05
TURN_RAD: Final = 0.02
_BEFORE_S: Final = 3.0


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
