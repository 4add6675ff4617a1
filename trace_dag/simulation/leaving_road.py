"""Departures of logged vehicles from the carriageway: time and side.

Used by estimates and verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import Body, SimulationLog, VehicleLog

_REACH_M: Final = 100.0
_AT_ONCE: Final = 16  # steps of a log that are looked at together
_ASIDE, _AHEAD = math.sin(math.radians(30)), math.sin(math.radians(60))
"""A vehicle that crosses the edge at a flatter angle leaves the road to a side, at a steeper one ahead; in between it
can be called either."""


def find_departure(
    network: RoadNetwork, driven: VehicleLog, body: Body, until_s: float, *, came_rad: float | None = None
) -> tuple[float | None, tuple[DepartureSide, ...]]:
    """Return when, and to which side, a corner of the vehicle last left the carriageway before a time.

    The side is seen along its course, and along ``came_rad`` as well.

    >>> turning = log.vehicles[0]
    >>> find_departure(network, turning, log.bodies[1], 1.0)  # drives in its lane then
    (None, ())
    """
    now = [float(np.interp(until_s, driven.time_s, values)) for values in (driven.x_m, driven.y_m, driven.z_m)]
    area = network.carriageway_near(now[0], now[1], _REACH_M, z_m=now[2])
    left: tuple[float, FloatArray, float] | None = None
    back = _back_from(driven, until_s)
    while steps := list(islice(back, _AT_ONCE)):
        corners = np.stack([rectangle_corners(pose, body.length_m, body.width_m) for _, pose, _ in steps])
        outside = ~area.contains(corners[..., 0], corners[..., 1])
        on_road = np.flatnonzero(~outside.any(axis=1))
        gone = int(on_road[0]) if len(on_road) else len(steps)
        if gone:
            time_s, _, course = steps[gone - 1]
            left = time_s, corners[gone - 1][outside[gone - 1]][0], course
        if gone < len(steps):
            break
    if left is None:
        return None, ()
    time_s, corner, course = left
    edge_x, edge_y = area.nearest(float(corner[0]), float(corner[1]))
    out_rad = math.atan2(float(corner[1]) - edge_y, float(corner[0]) - edge_x)
    seen = [course] if came_rad is None else [course, came_rad]
    return time_s, tuple(dict.fromkeys(side for along in seen for side in _sides(out_rad - along)))


def find_departure_after_contact(
    network: RoadNetwork, log: SimulationLog, number: int, until_s: float
) -> tuple[DepartureSide, ...]:
    """Return the sides on which a vehicle left the carriageway after a contact and before a time; empty if it did not.

    They are seen along its course, and along its direction at its first contact, because a report can mean either.

    >>> find_departure_after_contact(network, log, 1, log.first_contact.time_s)  # strikes the other on the crossing
    ()
    """
    driven = log.vehicle_log(number)
    first = next((each for each in log.meetings if number in (each.number_1, each.number_2)), None)
    pose = None if first is None else log.pose_at_contact(first, number)
    came_rad = None if pose is None else pose.heading_rad
    return find_departure(network, driven, log.bodies[number], until_s, came_rad=came_rad)[1]


def _sides(out_rad: float) -> tuple[DepartureSide, ...]:
    """Return the sides for a vehicle that leaves at an angle to its direction."""
    ahead = math.cos(out_rad)
    aside = DepartureSide.LEFT if math.sin(out_rad) > 0 else DepartureSide.RIGHT
    if ahead < _ASIDE:
        return (aside,)
    return (DepartureSide.AHEAD,) if ahead > _AHEAD else (aside, DepartureSide.AHEAD)


def _back_from(driven: VehicleLog, until_s: float) -> Iterator[tuple[float, Pose, float]]:
    """Yield the time, pose and course of a vehicle at a time, and at earlier steps of its log, the latest first."""
    times = driven.time_s[driven.time_s < until_s]
    columns = (driven.x_m, driven.y_m, np.unwrap(driven.heading_rad), driven.velocity_x_mps, driven.velocity_y_mps)
    then = [float(np.interp(until_s, driven.time_s, values)) for values in columns]
    before = (values[: len(times)][::-1].tolist() for values in columns)
    for time_s, x, y, heading, vx, vy in ((until_s, *then), *zip(times[::-1].tolist(), *before, strict=True)):
        yield time_s, Pose(x, y, heading), math.atan2(vy, vx)
