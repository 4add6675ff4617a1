"""Crashes of one vehicle that leaves the road: into a tree, a pole, a barrier, a ditch, over a kerb, and overturns.

The vehicle follows its path at its own speed; the object stands where the foremost part of its body is at the impact.
As in real reports, the reported point lies on the road: on the lane it came in, beside the impact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from make import bodies
from make.crash import Approach, Plan, Unit, swerve
from make.motion import LEAD_TIME_S, Collision, Speed, clock
from make.plane import FloatArray, plane_point
from make.report import EventCodes, Report, coded_vehicle, limit_of, reported_place, signing
from make.roads import Road
from make.truth import LocalFrame, rounded_to, vehicle_row

_RIGHT, _LEFT, _END = 63, 64, 71
_TREE, _POLE, _CURB, _GUARDRAIL, _BARRIER, _DITCH, _WALL, _OVERTURN = 42, 30, 33, 24, 25, 34, 39, 1
_SHOULDER, _MEDIAN, _ROADSIDE, _ROADWAY = 2, 3, 4, 1


@dataclass(frozen=True, eq=False)
class RoadsideCrash:
    """One crash. ``codes`` are its harmful events in order; ``corner``: the front corner on the side of the departure
    is struck, else the middle of the front; ``lane_curve`` is the lane it left, which the reported point lies on."""

    number: int
    title: str
    unit: Unit
    codes: tuple[int, ...]
    ways: tuple[str, str]
    corner: bool = False
    relation_to_road: int = _ROADSIDE
    intersection: int = 1
    junction: int = 1
    when: tuple[int, int, int, int] = (9, 12, 23, 40)
    light: int = 2
    on_lane: Plan | None = None  # the reported point, if it is not beside the impact
    reason: str | None = None  # why it has to be rejected

    @property
    def kind(self) -> str:
        """The kind of crash it is."""
        return "overturn" if self.codes[0] == _OVERTURN else "fixed_object"


def crashes(r: dict[str, Road]) -> list[RoadsideCrash]:
    """All of them. In the plan u is roughly east, v north; the highway runs along u."""
    return [*_objects(r), *_ends(r), *_overturns(r), *_rejected(r)]


def _leaving(
    lane: Approach, body: Any, mph: float, at: Plan, off_m: float, over_m: float, crash_type: int, **codes: Any
) -> Unit:
    """A vehicle that has drifted ``off_m`` to the left of its lane (right: negative) at a place, over a distance."""
    path = swerve(lane.curve(), at, [(-over_m, 0.0), (0.0, off_m), (30.0, off_m * (1 + 60.0 / over_m))])
    left = off_m > 0
    codes = {"location": 4, "before": (_LEFT if left else _RIGHT,)} | codes
    return Unit(body, lane, Speed(mph), crash_type, 1, 12 if left else 13, "leave_road", path, at, **codes)


def _objects(r: dict[str, Road]) -> list[RoadsideCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    freeway, at = Approach(r["freeway_east"], 1, 1, (-700, 789)), (-700.0, 791.0)
    outer, beside = Approach(r["freeway_east"], 1, 2, (-700, 789)), (-700.0, 787.0)
    half_m = east.width_m() / 2
    return [
        RoadsideCrash(
            111, "Drifts off to the right, into a tree",
            _leaving(east, bodies.SEDAN, 50, spot, -(half_m + 4.0), 60, 1), (_TREE,), ("NE-411", ""),
        ),
        RoadsideCrash(
            112, "Drifts across the other lane and off to the left, into a utility pole",
            _leaving(east, bodies.PICKUP, 50, spot, 3 * half_m + 2.5, 80, 6), (_POLE,), ("NE-411", ""),
        ),
        RoadsideCrash(
            113, "Off the freeway to the left, into the concrete barrier of the median",
            _leaving(freeway, bodies.SUV, 65, at, 3.0, 60, 6), (_BARRIER,), ("I-780", ""), corner=True,
            relation_to_road=_MEDIAN,
        ),
        RoadsideCrash(
            114, "Off the freeway to the right, along a guardrail",
            _leaving(outer, bodies.SEDAN, 65, beside, -2.9, 70, 1), (_GUARDRAIL,), ("I-780", ""), corner=True,
        ),
        RoadsideCrash(
            115, "Avoids an animal, and ends in the ditch on the right",
            _leaving(east, bodies.HATCHBACK, 45, spot, -(half_m + 2.6), 40, 3, avoidance=7), (_DITCH,),
            ("NE-411", ""), corner=True,
        ),
        RoadsideCrash(
            116, "Over the kerb, into a pole behind it",
            _leaving(east, bodies.COMPACT, 40, spot, -(half_m - 0.8), 45, 1), (_CURB, _POLE), ("NE-411", ""),
            corner=True,
        ),
    ]  # fmt: skip


def _ends(r: dict[str, Road]) -> list[RoadsideCrash]:
    """Straight on where the street ends: ``ahead_m`` is how far the vehicle's middle gets beyond that."""

    def straight_on(lane: Approach, body: Any, mph: float, end: Plan, ahead_m: float) -> Unit:
        return Unit(
            body, lane, Speed(mph), 14, 1, 14, "leave_road", lane.curve(), end, ahead_m, location=4, before=(_END,)
        )  # fmt: skip

    prospect, mill = Approach(r["prospect"], 1, 1, (540, 260)), Approach(r["south_mill"], 1, 1, (-405, 130))
    beyond_gable_m = 3.3 + 3.5  # to its far edge, and on to the tree
    return [
        RoadsideCrash(
            121, "Straight on at a T, across Gable Street and into a tree",
            straight_on(prospect, bodies.SEDAN, 40, (560, 258.3), beyond_gable_m - bodies.SEDAN.length_m / 2),
            (_TREE,), ("PROSPECT AVE", "GABLE ST"), intersection=3, junction=2,
        ),
        RoadsideCrash(
            122, "Off the end of a dead-end street and into a wall",
            straight_on(mill, bodies.PICKUP, 30, (-406.65, 110), 5.0 - bodies.PICKUP.length_m / 2), (_WALL,),
            ("S MILL LN", ""), when=(3, 4, 1, 30),
        ),
    ]  # fmt: skip


def _overturns(r: dict[str, Road]) -> list[RoadsideCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    half_m = east.width_m() / 2
    falls = Unit(
        bodies.MOTORCYCLE, east, Speed(55), 98, 1, 6, "straight", east.curve(), spot, location=1
    )  # fmt: skip
    return [
        RoadsideCrash(
            117, "Off to the right out of control, and over on the soil",
            _leaving(east, bodies.SUV, 65, spot, -(half_m + 3.0), 55, 2), (_OVERTURN,), ("NE-411", ""),
        ),
        RoadsideCrash(
            118, "A motorcycle falls on the roadway", falls, (_OVERTURN,), ("NE-411", ""), relation_to_road=_ROADWAY,
        ),
    ]  # fmt: skip


def _rejected(r: dict[str, Road]) -> list[RoadsideCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    off_m = -(east.width_m() / 2 + 4.0)
    untold = _leaving(east, bodies.SEDAN, 50, spot, off_m, 60, 98, before=())
    untold = Unit(**{**untold.__dict__, "event": 8})
    slow = _leaving(east, bodies.SEDAN, 20, spot, off_m, 60, 2)
    return [
        RoadsideCrash(
            119, "Into a tree, and nothing tells on which side of the road", untold, (_TREE,), ("NE-411", ""),
            reason="incomplete_trajectory",
        ),
        RoadsideCrash(
            120, "A sedan at 20 mph that is said to have overturned", slow, (_OVERTURN,), ("NE-411", ""),
            reason="no_overturn",
        ),
    ]  # fmt: skip


# --- what happens ----------------------------------------------------------------------------------------------------
def impact_of(crash: RoadsideCrash) -> Collision:
    """The impact: the foremost part of the body, when the vehicle is at its place."""
    driving, body = crash.unit.driving(), crash.unit.body
    state = driving.state(0.0)
    aside = 1.0 if _LEFT in crash.unit.before else -1.0
    at = np.array([body.length_m / 2, aside * body.width_m / 2 if crash.corner else 0.0])
    c, s = math.cos(state.heading_rad), math.sin(state.heading_rad)
    point = np.array([state.x_m + at[0] * c - at[1] * s, state.y_m + at[0] * s + at[1] * c])
    return Collision(0.0, point, (state, state), (at, at))


def _on_road(crash: RoadsideCrash, point: FloatArray) -> FloatArray:
    """The place on the lane beside a point: where such crashes are reported."""
    if crash.on_lane is not None:
        return plane_point(*crash.on_lane)
    lane = crash.unit.approach.curve()
    return np.asarray(lane.point(lane.station(point)))


# --- what is told of it, and what is true --------------------------------------------------------------------------
def coded(crash: RoadsideCrash, impact: Collision) -> Report:
    """The report."""
    overturns = crash.kind == "overturn"
    hour = 0 if overturns else clock(impact.on_body[0], crash.unit.body)
    latitude, longitude = reported_place(_on_road(crash, impact.point))
    events = [EventCodes(code, 1, 55, 5555, 55) for code in crash.unit.before]
    for place, code in enumerate(crash.codes):
        area = 0 if code == _OVERTURN else hour if place == 0 else 12
        events.append(EventCodes(code, 1, area, 9999, 77))
    road = crash.unit.approach.road
    route, system = signing(road)
    return Report(
        number=crash.number, when=crash.when, latitude_deg=latitude, longitude_deg=longitude, ways=crash.ways,
        route=route, functional_system=system, rural=limit_of(road) >= 50, harmful=crash.codes[0], manner=0,
        intersection=crash.intersection, interchange=0, junction=crash.junction,
        relation_to_road=crash.relation_to_road, light=crash.light, weather=1,
        vehicles=(coded_vehicle(1, crash.unit, hour, deaths=1, surface=1, seed=crash.number),),
        events=tuple(events),
    )  # fmt: skip


def truth_of(crash: RoadsideCrash, report: Report, impact: Collision) -> dict[str, Any]:
    """The row of one crash."""
    row: dict[str, Any] = {"key": report.key, "title": crash.title, "kind": crash.kind}
    if crash.reason is not None:
        return row | {"expected": {"final_state": "rejected", "reason": crash.reason}, "vehicles": []}
    frame = LocalFrame(report)
    at = frame.points(impact.point)
    side = {_LEFT: "left", _RIGHT: "right", _END: "ahead"}
    return row | {
        "expected": {"final_state": "verified", "reason": None},
        "latitude_deg": report.latitude_deg,
        "longitude_deg": report.longitude_deg,
        "lead_time_s": LEAD_TIME_S,
        "impact_point": {"x_m": rounded_to(at[0], 3), "y_m": rounded_to(at[1], 3)},
        "side": next((side[code] for code in crash.unit.before if code in side), None),
        "vehicles": [vehicle_row(1, crash.unit, crash.unit.driving(), impact, 0, frame)],
    }
