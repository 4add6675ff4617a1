"""Observations made from the true state: others in range and in sight, with a sensor's noise.

Sight is blocked by vehicles only: maps hold no buildings and no plants.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from trace_dag.agents.evaluation.agents import Observation, OwnState, RoadUser
from trace_dag.common.geometry import Pose, rectangle_corners
from trace_dag.crash.parties import party_of_body
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.types import Body

_HEADING_NOISE_RADPM = 0.04  # at half a metre of position noise a heading is known within some degree


@dataclass(frozen=True)
class Sensing:
    """Quality of an agent's sensing.

    ``range_m``: to the nearest part of another body's centre line. ``noise_m``: standard deviation of others' positions
    in x and y, m; their velocities get the same number in m/s, their headings 0.04 rad for each metre. ``occlusion``:
    bodies fully behind vehicles are not seen.
    """

    range_m: float = 150.0
    noise_m: float = 0.0
    occlusion: bool = False


class Sensor:
    """Turns true states into observations. The same seed and the same states give the same observations."""

    def __init__(self, own: int, bodies: Mapping[int, Body], sensing: Sensing, seed: int) -> None:
        self._own = own
        self._bodies = bodies
        self._sensing = sensing
        self._random = np.random.default_rng(seed)

    def observe(self, time_s: float, states: Mapping[int, BodyState]) -> Observation:
        """Return the observation now."""
        own = states[self._own]
        others = [state for number, state in sorted(states.items()) if party_of_body(number) != self._own]
        seen = []
        for state in others:
            # Drawn whether it is seen or not, so that what is hidden does not change what is seen later.
            noise = self._random.standard_normal(5) * self._sensing.noise_m if self._sensing.noise_m else None
            if math.hypot(state.x_m - own.x_m, state.y_m - own.y_m) > self._sensing.range_m:
                continue
            if self._sensing.occlusion and not self._sees(own, state, others):
                continue
            seen.append(self._as_seen(state, noise))
        return Observation(
            time_s,
            OwnState(
                own.x_m,
                own.y_m,
                own.z_m,
                own.heading_rad,
                own.velocity_x_mps,
                own.velocity_y_mps,
                own.speed_mps,
                own.yaw_rate_rps,
            ),
            tuple(seen),
        )

    def _sees(self, own: BodyState, state: BodyState, others: Sequence[BodyState]) -> bool:
        """Return whether a body is in sight: a vehicle hides what is behind it, and past a person one sees."""
        vehicles = (each for each in others if each is not state and not self._bodies[each.number].is_figure)
        return is_in_sight(own, self._outline(state), [self._outline(each) for each in vehicles])

    def _outline(self, state: BodyState) -> Outline:
        body = self._bodies[state.number]
        return Outline(state.x_m, state.y_m, state.heading_rad, body.length_m / 2, body.width_m / 2)

    def _as_seen(self, state: BodyState, noise: np.ndarray[tuple[int], np.dtype[np.float64]] | None) -> RoadUser:
        body = self._bodies[state.number]
        dx, dy, dvx, dvy, turn = (0.0,) * 5 if noise is None else noise.tolist()
        return RoadUser(
            state.number,
            body.kind,
            state.x_m + dx,
            state.y_m + dy,
            math.remainder(state.heading_rad + _HEADING_NOISE_RADPM * turn, math.tau),
            state.velocity_x_mps + dvx,
            state.velocity_y_mps + dvy,
            body.length_m,
            body.width_m,
        )


def is_in_sight(eye: BodyState, target: Outline, bodies: Sequence[Outline]) -> bool:
    """Return whether a corner or the centre of a body is visible from another's centre, past other bodies."""
    pose = Pose(target.x_m, target.y_m, target.heading_rad)
    corners = rectangle_corners(pose, 2 * target.half_length_m, 2 * target.half_width_m).tolist()
    points = [(target.x_m, target.y_m), *((x, y) for x, y in corners)]
    return any(not any(_crosses(eye.x_m, eye.y_m, x, y, body) for body in bodies) for x, y in points)


def _crosses(x0: float, y0: float, x1: float, y1: float, box: Outline) -> bool:
    """Return whether a line of sight crosses a rectangle, by the slab test in the rectangle's axes."""
    c, s = math.cos(box.heading_rad), math.sin(box.heading_rad)
    low, high = 0.0, 1.0
    for ax, ay, half in ((c, s, box.half_length_m), (-s, c, box.half_width_m)):
        start = (x0 - box.x_m) * ax + (y0 - box.y_m) * ay
        along = (x1 - x0) * ax + (y1 - y0) * ay
        if abs(along) < 1e-12:
            if abs(start) > half:
                return False
            continue
        one, two = (-half - start) / along, (half - start) / along
        low, high = max(low, min(one, two)), min(high, max(one, two))
    return low < high
