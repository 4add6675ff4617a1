"""Beginnings of measured crashes: bodies placed so that their damaged areas meet, and run back until they are apart.

Two vehicles are placed so that the middles of their direct damage, as deep as half of the largest crush, would
coincide if neither were slowed down; from there each goes back along its heading at its speed at impact.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from lab.validation.recorded import Damage, RecordedVehicle
from trace_dag.common.geometry import Pose, rectangle_corners
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import Body, Participant

OUTWARD: Final = {"F": (1.0, 0.0), "B": (-1.0, 0.0), "L": (0.0, 1.0), "R": (0.0, -1.0)}
"""Direction of each side of a vehicle, ahead and to the left."""
_APART_M: Final = 0.3
_BACK_S: Final = 0.002
_FARTHEST_S: Final = 5.0
_PLAN_S: Final = 10.0
_USUAL_CRUSH_M: Final = 0.4  # where none was measured
_ZONES: Final = {  # middle of a CDC's horizontal location, of half a front's width to the left, of half a side forward
    "F": {"L": 2 / 3, "R": -2 / 3, "Y": 1 / 3, "Z": -1 / 3},
    "L": {"F": 2 / 3, "B": -2 / 3, "Y": 1 / 3, "Z": -1 / 3},
}


def struck_side(damage: Damage | None, area: str) -> str | None:
    """Return the side that was struck (F, B, L, R): of the damage, else of the event; None if that is not a side."""
    side = damage.side if damage is not None and damage.side in "FBLR" else area
    return side if side in ("F", "B", "L", "R") else None


def damaged_m(vehicle: RecordedVehicle, body: Body, damage: Damage | None, side: str) -> tuple[float, float]:
    """Return the middle of the direct damage to a side, half as deep as the crush, ahead and to the left of the body's
    middle.
    """
    crush_m = damage.crush_m if damage is not None and damage.crush_m is not None else _USUAL_CRUSH_M
    on_end = side in "FB"
    half_m = (body.width_m if on_end else body.length_m) / 2
    if damage is not None and damage.offset_m is not None:
        offset_m = damage.offset_m + (0.0 if on_end else vehicle.axles_middle_m)
    else:
        offset_m = half_m * _ZONES["F" if on_end else "L"].get(damage.zone if damage is not None else "D", 0.0)
    offset_m = max(-half_m, min(half_m, offset_m))
    depth_m = min(crush_m, 0.8) / 2
    if on_end:
        end = 1.0 if side == "F" else -1.0
        return end * (body.length_m / 2 - depth_m), offset_m
    flank = 1.0 if side == "L" else -1.0
    return offset_m, flank * (body.width_m / 2 - depth_m)


def meeting(
    bodies: tuple[Body, Body],
    headings_rad: tuple[float, float],
    speeds_mps: tuple[float, float],
    damaged: tuple[tuple[float, float], tuple[float, float]],
    locked_wheels: tuple[float | None, float | None] = (None, None),
) -> tuple[Participant, Participant] | None:
    """Return both vehicles shortly before they touch; None if they never would."""
    velocities = [
        (speed * math.cos(heading), speed * math.sin(heading))
        for speed, heading in zip(speeds_mps, headings_rad, strict=True)
    ]
    centres = [
        (-(ahead * math.cos(h) - left * math.sin(h)), -(ahead * math.sin(h) + left * math.cos(h)))
        for (ahead, left), h in zip(damaged, headings_rad, strict=True)
    ]
    for k in range(round(_FARTHEST_S / _BACK_S)):
        ago_s = k * _BACK_S
        outlines = [
            Outline(x - vx * ago_s, y - vy * ago_s, heading, body.length_m / 2, body.width_m / 2)
            for (x, y), (vx, vy), heading, body in zip(centres, velocities, headings_rad, bodies, strict=True)
        ]
        if separation(*outlines)[0] >= _APART_M:
            one, two = (
                straight_on(number, body, Pose(outline.x_m, outline.y_m, heading), speed, locked_wheels=locked)
                for number, body, outline, heading, speed, locked in zip(
                    (1, 2), bodies, outlines, headings_rad, speeds_mps, locked_wheels, strict=True
                )
            )
            return one, two
    return None


def straight_on(
    number: int,
    body: Body,
    pose: Pose,
    speed_mps: float,
    course_rad: float | None = None,
    locked_wheels: float | None = None,
) -> Participant:
    """Return a vehicle that goes on at its speed, along its heading or sliding along another course."""
    slides = course_rad is not None
    course = pose.heading_rad if course_rad is None else course_rad
    time_s = np.linspace(0.0, _PLAN_S, 101)
    travelled = speed_mps * time_s
    trajectory = Trajectory(
        time_s,
        pose.x_m + travelled * math.cos(course),
        pose.y_m + travelled * math.sin(course),
        np.zeros_like(time_s),
        np.full_like(time_s, pose.heading_rad),
        np.full_like(time_s, speed_mps),
    )
    skids_from_s = 0.0 if slides else math.inf
    return Participant(
        number, body, pose, speed_mps, trajectory, skids_from_s=skids_from_s, locked_wheels=locked_wheels
    )


def before_object(
    body: Body,
    damaged: tuple[float, float],
    course_rad: float,
    speed_mps: float,
    half_object_m: float,
    locked_wheels: float | None = None,
) -> Participant:
    """Return a vehicle heading east shortly before it strikes an object at the origin with its damaged area.

    It slides where its course is not its heading.
    """
    ahead, left = damaged
    slides = abs(course_rad) > 1e-9
    reach_m = float(np.linalg.norm(rectangle_corners(Pose(0.0, 0.0, 0.0), body.length_m, body.width_m), axis=1).max())
    back_m = reach_m + half_object_m + _APART_M
    pose = Pose(-ahead - back_m * math.cos(course_rad), -left - back_m * math.sin(course_rad), 0.0)
    return straight_on(1, body, pose, speed_mps, course_rad if slides else None, locked_wheels)
