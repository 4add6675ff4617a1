"""What really happened, as it is stored beside the reports: ``truth.json``.

Every crash is given in its own local frame: transverse Mercator, origin at the *reported* point, x east, y north,
metres; headings in radians counter-clockwise from east; poses of the bodies' centres, five seconds before the impact
and at it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from make.crash import Crash, Unit
from make.motion import LEAD_TIME_S, Body, Collision, Driving, State, clock, trailer_of
from make.plane import TOWN, FloatArray, Projection
from make.report import Report

# How far the path is traced back beyond the initial pose, for vehicles whose speed one has to guess.
TRACE_BACK_M = 80.0


class LocalFrame:
    """From the town plane into a crash's frame."""

    def __init__(self, report: Report) -> None:
        self._projection = Projection(report.latitude_deg, report.longitude_deg)

    def points(self, xy: FloatArray) -> FloatArray:
        """Points of the town plane, shape (..., 2)."""
        degrees = TOWN.to_degrees(xy)
        return self._projection.to_plane(degrees[..., 0], degrees[..., 1])

    def pose(self, state: State) -> dict[str, float]:
        """A pose: the frames differ by a shift and a minute turn."""
        ahead = np.array([math.cos(state.heading_rad), math.sin(state.heading_rad)])
        here, there = self.points(np.stack([np.array(state[:2]), state[:2] + ahead]))
        return {
            "x_m": rounded_to(here[0], 3), "y_m": rounded_to(here[1], 3),
            "heading_rad": rounded_to(math.atan2(there[1] - here[1], there[0] - here[0]), 5),
        }  # fmt: skip


HARMLESS = frozenset({319037, 319039, 319046, 319047})
"""Cases whose two vehicles graze each other or back together: lane changes, a merge, backing. A change of velocity
below 16 km/h does not explain the death that every report of the sample has; the fall of a clipped rider does."""


def truth_of(crash: Crash, report: Report, collision: Collision) -> dict[str, Any]:
    """The row of one crash."""
    frame = LocalFrame(report)
    impact = frame.points(collision.point)
    return {
        "key": report.key,
        "title": crash.title,
        "expected": {"final_state": "first_event_only" if report.case in HARMLESS else "verified", "reason": None},
        "latitude_deg": report.latitude_deg,
        "longitude_deg": report.longitude_deg,
        "lead_time_s": LEAD_TIME_S,
        "layer": crash.layer,
        "impact_point": {"x_m": rounded_to(impact[0], 3), "y_m": rounded_to(impact[1], 3)},
        "vehicles": [
            vehicle_row(i + 1, unit, unit.driving(), collision, i, frame) for i, unit in enumerate(crash.units)
        ],
    }


def vehicle_row(
    number: int, unit: Unit, driving: Driving, collision: Collision, index: int, frame: LocalFrame
) -> dict[str, Any]:
    """The row of one vehicle."""
    start = driving.state(collision.t - LEAD_TIME_S)
    impact = collision.states[index]
    body = unit.body
    return {
        "vehicle_number": number,
        "body": {
            "class": body.kind, "length_m": body.length_m, "width_m": body.width_m, "height_m": body.height_m,
            "mass_kg": body.mass_kg,
        },
        **_pulled(body, start, impact, frame),
        "manoeuvre": unit.manoeuvre,
        "speed_reported": unit.travel_speed < 998,
        "initial_pose": frame.pose(start),
        "initial_speed_mps": rounded_to(start.speed_mps, 4),
        "impact_pose": frame.pose(impact),
        "impact_speed_mps": rounded_to(impact.speed_mps, 4),
        "impact_clock_h": clock(collision.on_body[index], body),
        "approach": _approach(unit, start, driving.path.heading(driving.station(collision.t - LEAD_TIME_S))),
        "path": _path(driving, collision.t, frame),
    }  # fmt: skip


def _pulled(body: Body, start: State, impact: State, frame: LocalFrame) -> dict[str, Any]:
    """A trailer: its outline, and the poses of its centre."""
    if body.pulled is None:
        return {}
    poses = [frame.pose(State(*trailer_of(state, body, body.pulled), 0.0)) for state in (start, impact)]
    size = {"length_m": body.pulled.length_m, "width_m": body.pulled.width_m}
    return {"trailer": {**size, "initial_pose": poses[0], "impact_pose": poses[1]}}


def _approach(unit: Unit, start: State, course_rad: float) -> dict[str, Any]:
    """The lane it came in. ``lane_from_left`` counts from 1 as its driver sees the lanes of its direction; 0 is a
    shared centre lane. ``room_m`` is how far the carriageway reaches to the left and right of the path where the motion
    begins, looking along the path."""
    approach = unit.approach
    section = approach.road.section(approach.station)
    left, right = approach.road.room_beside(np.array(start[:2]), course_rad, section)
    return {
        "street": approach.road.name(),
        "names": sorted({v for k, v in approach.road.common.items() if k in ("name", "ref", "alt_name")}),
        "highway": approach.road.common["highway"],
        "lane_from_left": approach.lane,
        "lanes": len(section.forward if approach.direction > 0 else section.backward),
        "wrong_way": approach.wrong_way,
        "lane_width_m": rounded_to(approach.width_m(), 2),
        "room_m": [rounded_to(left, 2), rounded_to(right, 2)],
    }


def _path(driving: Driving, t_impact: float, frame: LocalFrame) -> list[list[float]]:
    """Where the centre went, every two metres, from well before the initial pose to the impact."""
    first, last = driving.station(t_impact - LEAD_TIME_S) - TRACE_BACK_M, driving.station(t_impact)
    if not driving.backing:
        first = max(first, min(0.0, driving.station(t_impact - LEAD_TIME_S)))
    stations = np.linspace(first, last, max(2, math.ceil((last - first) / 2.0) + 1))
    points = frame.points(np.array([driving.path.point(s) for s in stations]))
    return [[rounded_to(x, 2), rounded_to(y, 2)] for x, y in points]


def rounded_to(value: float, digits: int) -> float:
    """A number as it is stored."""
    return round(float(value), digits) + 0.0  # no negative zero
