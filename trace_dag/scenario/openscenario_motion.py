"""The driven motion for OpenSCENARIO: timed poses of an entity's reference point on the road.

The log has the body's centre at every logged step and at the deepest overlap of two bodies. A player that interpolates
between steps also needs the beginning of the contact, so the first touch of every contact is a vertex. Steps within a
millimetre of the line between others are no vertices: at constant speed straight ahead two are enough.

Vertices are chosen so that players that leave some of them out show the same crash. Players merge vertices that lie
close together: esmini, with default options, drops vertices within 0.1 m of the last one kept (``--traj_filter``, its
``PolyLineShape::FinalizeVertices``). After an impact bodies are slow, and the moment of their overlap would be dropped.
So vertices are placed such that the filter keeps the important moments. Before each of them is a vertex a little more
than the filter's radius away, which the filter also keeps; all vertices between the two lie within that radius. A
vertex added for this lies on the motion and changes nothing for a player that keeps all vertices. Logged steps less
than the radius before it are removed: vehicles still drive there, and a straight line to the next vertex is off by
millimetres only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.scenario.polylines import simplify_in_time
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import DEEPEST_EVERY_S, Contact, SimulationLog, VehicleLog

INTO_EACH_OTHER_S = 0.001
"""Time after the touch at which bodies are hardly slowed, for logs without a state in which they overlap."""

PLAYER_STEP_S = 0.02
"""The longest step with which players are to see every contact: bodies overlap a little longer."""

_NEEDLESS_M, _NEEDLESS_RAD = 0.001, 0.001
"""Steps that are no farther from the straight way between others, over time, are no vertices."""

_TURN_RAD = 0.01
"""Between two vertices a body turns by so much at most: players are known that turn it only near vertices."""

_CLEAR_M = 0.02
"""Bodies that overlap by as much are seen to, whatever a player rounds; those that crush each other soon do."""

SAME_TIME_S = 1e-5  # moments closer together than this are one
FILTER_RADIUS_M = 0.1
_ROUNDED_M = 3e-5  # positions are written to a hundredth of a millimetre
_BEYOND_M = FILTER_RADIUS_M + _ROUNDED_M
_SAME_TIME_S = 1e-5
_WITHIN_M = FILTER_RADIUS_M - _ROUNDED_M


@dataclass(frozen=True, eq=False)
class TimedPoses:
    """Poses over time, arrays of equal length n, of a point of the body at road level.

    ``heading_rad`` is continuous beyond a full turn. ``pitch_rad`` is positive nose down and ``roll_rad`` right side
    down, as in ISO 8855.
    """

    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """A vehicle's motion, from which the poses of any point of its body follow.

    It has rows of time, x, y and z of the centre, heading, grade and bank, shape (n, 7), and for each contact the
    moments (s) that players must keep.
    """

    log: SimulationLog
    vehicle: VehicleLog
    rows: FloatArray
    seen_s: Sequence[tuple[float, ...]]

    @classmethod
    def of(cls, log: SimulationLog, vehicle: VehicleLog, surface: Surface) -> PlayedMotion:
        """Return the motion in a log; ``surface`` gives the grade under it."""
        centres, seen_s = _with_contacts(log, vehicle)
        time, x, y, z, heading = centres.T
        heading = np.unwrap(heading)
        grade, bank = _slopes(x, y, z, heading, surface)
        if log.bodies[vehicle.number].is_figure:
            # Upright on the road: a tumbling pelvis has no heading, and a player would turn the whole body by it.
            heading = _until_struck(log, vehicle.number, time, heading)
            grade, bank = np.zeros_like(x), np.zeros_like(x)
        return cls(log, vehicle, np.column_stack([time, x, y, z, heading, grade, bank]), seen_s)

    def of_point(self, ahead_m: float) -> TimedPoses:
        """Return the motion of the point ``ahead_m`` ahead of the body's centre."""
        time, x, y, z, heading, grade, bank = self.rows.T
        vertices = np.column_stack(
            [
                time,
                x + ahead_m * np.cos(heading),
                y + ahead_m * np.sin(heading),
                z + ahead_m * grade,
                heading,
                -np.arctan(grade),
                np.arctan(bank),
            ]
        )
        vehicle, body = self.vehicle, self.log.bodies[self.vehicle.number]
        if np.abs(vehicle.roll_rad).max(initial=0.0) > 0 and not body.is_figure:
            vertices = _rolled(vertices, vehicle, body.height_m)
        return TimedPoses(*select_vertices(_thinned(vertices, self.log, vehicle.number, self.seen_s), self.seen_s).T)


def _thinned(vertices: FloatArray, log: SimulationLog, number: int, seen_s: Sequence[tuple[float, ...]]) -> FloatArray:
    """Return the needed vertices, including those at a vehicle's touches and at the moments for players."""
    time_s = vertices[:, 0]
    touches_s = [contact.time_s for contact in log.contacts if number in contact.poses]
    moments_s = np.array([*touches_s, *(moment_s for group in seen_s for moment_s in group)])
    asked = np.flatnonzero((np.abs(time_s[:, None] - moments_s) < 2 * SAME_TIME_S).any(axis=1))
    turned_rad = np.abs(np.diff(vertices[:, 4:], axis=0, prepend=vertices[:1, 4:])).sum(axis=1).cumsum()
    turns = np.flatnonzero(np.diff(turned_rad // _TURN_RAD, prepend=0.0))
    values = np.column_stack([vertices[:, 1:4], vertices[:, 4:] * (_NEEDLESS_M / _NEEDLESS_RAD)])
    kept = simplify_in_time(time_s, values, _NEEDLESS_M, also=np.concatenate([asked, turns]))
    needed: FloatArray = vertices[kept]
    return needed


def _rolled(vertices: FloatArray, vehicle: VehicleLog, height_m: float) -> FloatArray:
    """Return the vertices of a vehicle that overturns.

    Its reference point is at the bottom of the body, which rotates about its middle at the logged height above the
    road.
    """
    roll, above = (
        np.interp(vertices[:, 0], vehicle.time_s, values) for values in (vehicle.roll_rad, vehicle.above_road_m)
    )
    left_m, up_m = np.sin(roll) * height_m / 2, above - np.cos(roll) * height_m / 2
    rolled: FloatArray = vertices.copy()
    rolled[:, 1] -= left_m * np.sin(vertices[:, 4])
    rolled[:, 2] += left_m * np.cos(vertices[:, 4])
    rolled[:, 3] += up_m
    rolled[:, 6] += roll
    return rolled


def _until_struck(log: SimulationLog, number: int, time_s: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Return a person's heading, constant from the first strike on."""
    struck_s = min((c.time_s for c in log.contacts if number in (c.number_1, c.number_2)), default=math.inf)
    before = np.flatnonzero(time_s <= struck_s + SAME_TIME_S)
    kept: FloatArray = heading_rad[np.minimum(np.arange(len(time_s)), before[-1] if len(before) else 0)]
    return kept


def _with_contacts(log: SimulationLog, vehicle: VehicleLog) -> tuple[FloatArray, list[tuple[float, ...]]]:
    """Return the log's time, x, y, z and heading, shape (n, 5), with first touches, and the moments to keep.

    For each contact these are the moments at which players should show the overlap, or else the touch.
    """
    logged = np.stack([vehicle.time_s, vehicle.x_m, vehicle.y_m, vehicle.z_m, vehicle.heading_rad], axis=-1)
    known = logged[:, 0]
    rows: list[FloatArray] = [logged]
    seen_s: list[tuple[float, ...]] = []
    for contact in log.contacts:
        pose = contact.poses.get(vehicle.number)
        if pose is None:
            continue
        touch = np.array([contact.time_s, pose.x_m, pose.y_m, pose.z_m, pose.heading_rad])
        if np.abs(known - contact.time_s).min() > SAME_TIME_S:
            rows.append(touch[None])
        seen = _seen_s(log, contact) if log.object_of(contact.number_2) is None else []
        before = logged[known < contact.time_s - SAME_TIME_S]
        if not seen and len(before):
            seen = [contact.time_s + INTO_EACH_OTHER_S]
            step = touch - before[-1]
            step[4] = math.remainder(step[4], math.tau)
            rows.append((touch + step * INTO_EACH_OTHER_S / step[0])[None])
        if seen:
            seen_s.append((*seen, contact.time_s))
    together: FloatArray = np.concatenate(rows)
    together = together[np.argsort(together[:, 0], kind="stable")]
    kept: FloatArray = together[np.concatenate([[True], np.diff(together[:, 0]) > SAME_TIME_S])]
    return kept, seen_s


def _seen_s(log: SimulationLog, contact: Contact) -> list[float]:
    """Return the logged moments soon after a first touch at which players can show a clear overlap.

    They are the first moment on a step of the players, and the first of all; empty without an overlap.
    """
    one, two = (vehicle for vehicle in log.vehicles if vehicle.number in contact.touched)
    soon = (one.time_s > contact.time_s + SAME_TIME_S) & (one.time_s < contact.time_s + DEEPEST_EVERY_S)
    overlaps = {
        float(one.time_s[k]): -separation(_outline(log, one, k), _outline(log, two, k))[0]
        for k in np.flatnonzero(soon).tolist()
    }
    clear_m = min(_CLEAR_M, max(overlaps.values(), default=0.0) / 2)
    overlapping = [time_s for time_s in sorted(overlaps) if overlaps[time_s] > clear_m > 0]
    on_a_step = [time_s for time_s in overlapping if abs(math.remainder(time_s, PLAYER_STEP_S)) < SAME_TIME_S]
    return list(dict.fromkeys([*on_a_step[:1], *overlapping[:1]]))


def _outline(log: SimulationLog, vehicle: VehicleLog, k: int) -> Outline:
    body = log.bodies[vehicle.number]
    x, y, heading = (float(values[k]) for values in (vehicle.x_m, vehicle.y_m, vehicle.heading_rad))
    return Outline(x, y, heading, body.length_m / 2, body.width_m / 2)


def _slopes(
    x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, heading_rad: FloatArray, surface: Surface
) -> tuple[FloatArray, FloatArray]:
    """Return the rise over run toward the front and toward the left."""
    if surface.flat:
        return np.zeros_like(x_m), np.zeros_like(x_m)
    grounds = [surface.at(*place) for place in zip(x_m.tolist(), y_m.tolist(), z_m.tolist(), strict=True)]
    slope_x, slope_y = np.array([(ground.slope_x, ground.slope_y) for ground in grounds]).T
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    return slope_x * c + slope_y * s, slope_y * c - slope_x * s


# --- vertices --------------------------------------------------------------------------------------------------------
def select_vertices(rows: FloatArray, moments_s: Sequence[tuple[float, ...]]) -> FloatArray:
    """Return the vertices, rows of time, x, y and more, with moments that survive a filter, the earliest first.

    In each group of moments the first possible one is taken. A moment is impossible if the vehicle returns to an
    earlier position within the filter's radius, or has not moved that far since the start or the earlier moment.

    >>> rows = np.column_stack([np.arange(3.0), 10.0 * np.arange(3.0), np.zeros(3)])  # 10 m a second
    >>> select_vertices(rows, [(1.0,)])[:, 0].round(3).tolist()  # one more just outside a radius of 0.1 m
    [0.0, 1.0, 1.01, 2.0]
    """
    kept_s: list[float] = []
    for group in sorted(moments_s):
        for moment_s in group:
            k = int(np.argmin(np.abs(rows[:, 0] - moment_s)))
            changed = _with_kept(rows, k, max(kept_s, default=-1.0))
            if changed is not None:
                rows = changed
                kept_s.append(moment_s)
                break
    distinct: FloatArray = rows[np.diff(rows[:, 0], prepend=-1.0) > _SAME_TIME_S]
    return distinct


def _with_kept(rows: FloatArray, kept: int, after_s: float) -> FloatArray | None:
    """Return the vertices with one of them kept by filters; none up to ``after_s`` is removed for it."""
    away = np.flatnonzero(_distances(rows[:kept], rows[kept]) >= _BEYOND_M)
    if not len(away):
        return None
    last = int(away[-1])
    before, between, after = rows[: last + 1], rows[last + 1 : kept], rows[kept:]
    if (_distances(between, before[-1]) > _WITHIN_M).any():
        added = _at_distance(rows[last], rows[last + 1], rows[kept])
        if (_distances(between, added) > _WITHIN_M).any():
            return None
        before = np.concatenate([before, added[None]])
    near = len(before) - 1
    while near > 1 and before[near - 1, 0] > after_s and _distances(before[near - 1][None], before[-1])[0] < _BEYOND_M:
        near -= 1
    return np.concatenate([before[:near], before[-1:], between, _left_soon(after)])


def _left_soon(rows: FloatArray) -> FloatArray:
    """Insert a vertex where the path leaves the filter's radius, which keeps that stretch short."""
    away = np.flatnonzero(_distances(rows, rows[0]) >= _BEYOND_M)
    if not len(away):
        return rows
    out = int(away[0])
    return np.insert(rows, out, _at_distance(rows[out], rows[out - 1], rows[0]), axis=0)


def _distances(rows: FloatArray, place: FloatArray) -> FloatArray:
    away: FloatArray = np.hypot(rows[:, 1] - place[1], rows[:, 2] - place[2])
    return away


def _at_distance(start: FloatArray, end: FloatArray, place: FloatArray) -> FloatArray:
    """Return the last point beyond a filter's radius from ``place`` on the line from ``start`` to ``end``."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        if _distances((start + middle * (end - start))[None], place)[0] >= _BEYOND_M:
            low = middle
        else:
            high = middle
    point: FloatArray = start + low * (end - start)
    return point
