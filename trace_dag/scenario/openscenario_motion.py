"""The driven motion as OpenSCENARIO wants it: timed poses of an entity's reference point on the road.

The log has the body's centre at every logged step. A player that interpolates between steps would lose the crash
itself: bodies of steel touch for some twenty milliseconds, those that graze each other for a few. So the first
touch of every contact is a vertex of its own, as is the moment :data:`INTO_EACH_OTHER_S` later, when the bodies, by
then hardly slowed, have begun to overlap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.geometry import FloatArray
from trace_dag.sim.surface import Surface
from trace_dag.sim.types import SimulationLog, VehicleLog

INTO_EACH_OTHER_S = 0.001
SAME_TIME_S = 1e-5  # moments closer together than this are one


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses over time, arrays of equal length n, of a point of the body at road level.

    ``heading_rad`` runs on past a full turn, without jumps. ``pitch_rad`` is positive nose down and ``roll_rad``
    right side down, as in ISO 8855.
    """

    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray


def motion(log: SimulationLog, vehicle: VehicleLog, *, ahead_m: float, surface: Surface) -> Motion:
    """The motion of the point ``ahead_m`` ahead of the body's centre; ``surface`` gives the grade it stands on."""
    time, x, y, z, heading = _with_contacts(log, vehicle).T
    heading = np.unwrap(heading)
    grade, bank = _slopes(x, y, z, heading, surface)
    return Motion(
        time_s=time,
        x_m=x + ahead_m * np.cos(heading),
        y_m=y + ahead_m * np.sin(heading),
        z_m=z + ahead_m * grade,
        heading_rad=heading,
        pitch_rad=-np.arctan(grade),
        roll_rad=np.arctan(bank),
    )


def _with_contacts(log: SimulationLog, vehicle: VehicleLog) -> FloatArray:
    """The log's time, x, y, z and heading, shape (n, 5), and those of this vehicle's contacts, in order of time."""
    logged = np.stack([vehicle.time_s, vehicle.x_m, vehicle.y_m, vehicle.z_m, vehicle.heading_rad], axis=-1)
    rows = [logged]
    for contact in log.contacts:
        if vehicle.number not in (contact.number_1, contact.number_2):
            continue
        pose = contact.pose_1 if vehicle.number == contact.number_1 else contact.pose_2
        touch = np.array([contact.time_s, pose.x_m, pose.y_m, pose.z_m, pose.heading_rad])
        known = logged[:, 0]
        if np.abs(known - contact.time_s).min() > SAME_TIME_S:
            rows.append(touch[None])
        before = logged[known < contact.time_s - SAME_TIME_S]
        after_s = contact.time_s + INTO_EACH_OTHER_S
        if len(before) and not np.any((known > contact.time_s + SAME_TIME_S) & (known < after_s + SAME_TIME_S)):
            step = touch - before[-1]
            step[4] = math.remainder(step[4], math.tau)
            rows.append((touch + step * INTO_EACH_OTHER_S / step[0])[None])
    together: FloatArray = np.concatenate(rows)
    together = together[np.argsort(together[:, 0], kind="stable")]
    kept: FloatArray = together[np.concatenate([[True], np.diff(together[:, 0]) > SAME_TIME_S])]
    return kept


def _slopes(
    x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, heading_rad: FloatArray, surface: Surface
) -> tuple[FloatArray, FloatArray]:
    """Rise over run toward the front and toward the left."""
    if surface.flat:
        return np.zeros_like(x_m), np.zeros_like(x_m)
    grounds = [surface.at(*place) for place in zip(x_m.tolist(), y_m.tolist(), z_m.tolist(), strict=True)]
    slope_x, slope_y = np.array([(ground.slope_x, ground.slope_y) for ground in grounds]).T
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    return slope_x * c + slope_y * s, slope_y * c - slope_x * s
