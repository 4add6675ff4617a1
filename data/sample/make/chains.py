"""Crashes of several contacts: queues, a vehicle struck from both sides, who comes late, and vehicles that stand.

Up to its first contact every vehicle drives as told. Those that touch go on together at their common velocity
(momentum is kept, nothing bounces) without turning, and slow down at 0.45 g until they rest or touch the next one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from make import bodies
from make.crash import Approach, Plan, Unit, swerve
from make.curves import Curve
from make.motion import LEAD_TIME_S, Collision, Driving, Speed, State, clock, collide, on_body, outline, touch_point
from make.plane import FloatArray
from make.report import EventCodes, Report, coded_vehicle, limit_of, reported_place, signing
from make.roads import Road
from make.truth import LocalFrame, rounded_to, vehicle_row

_SLOWING_MPS2 = 0.45 * 9.81
_STEP_S = 0.002
_LONGEST_S = 8.0
_SET_IN_MOTION = 19  # AOI


@dataclass(frozen=True, eq=False)
class ChainCrash:
    """One crash. ``units`` are the vehicles 1, 2, ...; ``contacts`` who meets whom, in order, the striking one first;
    ``standing`` those that were parked (or at work, see ``code``) and not in transport."""

    number: int
    title: str
    units: tuple[Unit, ...]
    contacts: tuple[tuple[int, int], ...]
    ways: tuple[str, str]
    manner: int = 1
    intersection: int = 1
    junction: int = 1
    when: tuple[int, int, int, int] = (6, 14, 15, 20)
    light: int = 1
    relation_to_road: int = 1
    standing: frozenset[int] = frozenset()
    code: int = 12  # SOE of the contacts
    told: int | None = None  # so many of the contacts are reported, if not all
    reason: str | None = None  # why it has to be rejected

    @property
    def kind(self) -> str:
        """The kind of crash it is."""
        return "parked" if self.standing else "multi_vehicle"


@dataclass(frozen=True, eq=False)
class Meeting:
    """One contact: when, where, the states of both, and where on each body it is."""

    t: float
    point: FloatArray
    states: tuple[State, State]
    on_body: tuple[FloatArray, FloatArray]


def crashes(r: dict[str, Road]) -> list[ChainCrash]:
    """All of them. In the plan u is roughly east, v north; the highway runs along u."""
    return [*_queues(r), *_late(r), *_standing(r), *_rejected(r)]


def _queue(lane: Approach, at: Plan, *ahead: tuple[Any, float], **codes: Any) -> list[Unit]:
    """Vehicles that stand in a lane, each so far ahead of the place (to its centre)."""
    return [
        Unit(body, lane, Speed(0), 98 if number else 21, 5, 53, "stopped", lane.curve(), at, ahead_m, **codes)
        for number, (body, ahead_m) in enumerate(ahead)
    ]


def _striking(body: Any, lane: Approach, mph: float, at: Plan, **codes: Any) -> Unit:
    return Unit(body, lane, Speed(mph), 20, 1, 50, "straight", lane.curve(), at, **codes)


def _queues(r: dict[str, Road]) -> list[ChainCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    freeway, at = Approach(r["freeway_east"], 1, 2, (-700, 789)), (-656.0, 787.0)
    return [
        ChainCrash(
            101, "Three in a row: the second is pushed into the third", (
                _striking(bodies.SUV, east, 50, spot),
                *_queue(east, spot, (bodies.SEDAN, 0.0), (bodies.PICKUP, 8.0)),
            ), ((1, 2), (2, 3)), ("NE-411", ""),
        ),
        ChainCrash(
            102, "Five in a row on the freeway, behind a box truck", (
                _striking(bodies.BOX_TRUCK, freeway, 58, at),
                *_queue(
                    freeway, at, (bodies.SEDAN, 0.0), (bodies.COMPACT, 7.2), (bodies.MINIVAN, 14.6),
                    (bodies.HATCHBACK, 21.8),
                ),
            ), ((1, 2), (2, 3), (3, 4), (4, 5)), ("I-780", ""), when=(9, 3, 16, 30),
        ),
    ]  # fmt: skip


def _late(r: dict[str, Road]) -> list[ChainCrash]:
    """Who comes after the first contact finds the others where it put them."""
    east, west = Approach(r["main_west"], 1, 1, (-860, 0)), Approach(r["main_west"], -1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    behind = _striking(bodies.PICKUP, east, 50, spot)
    over = swerve(east.curve(), (-850, -1.8), [(-70, 0.0), (-4, 3.2), (50, 3.5)])
    crossing = Unit(
        bodies.SEDAN, east, Speed(50), 50, 1, 10, "cross_centreline", over, (-850, 0), location=2, before=(68,)
    )  # fmt: skip
    oncoming = Unit(bodies.PICKUP, west, Speed(50), 51, 1, 62, "straight", west.curve(), (-850, 0))
    following = Unit(
        bodies.SUV, west, Speed(50), 98, 1, 50, "straight", west.curve(), (-850, 0), -1.6 * 50 * 0.44704
    )  # fmt: skip
    return [
        ChainCrash(
            103, "A star: into a car that waits, and struck from behind itself", (
                _striking(bodies.SEDAN, east, 45, spot),
                *_queue(east, spot, (bodies.SUV, 0.0)),
                replace(behind, crash_type=98, ahead_m=-1.5 * 50 * 0.44704),
            ), ((1, 2), (3, 1)), ("NE-411", ""), when=(10, 2, 7, 50),
        ),
        ChainCrash(
            104, "Head-on, and the next one runs into the wreck", (crossing, oncoming, following),
            ((1, 2), (3, 2)), ("NE-411", ""), manner=2, light=2, when=(11, 18, 22, 5),
        ),
    ]  # fmt: skip


def _beside(lane: Approach, offset_m: float) -> Curve:
    return lane.curve().offset(offset_m)


def _standing(r: dict[str, Road]) -> list[ChainCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    half_m = east.width_m() / 2

    def drifting(body: Any, mph: float, left_m: float) -> Unit:
        path = swerve(east.curve(), spot, [(-75, 0.0), (-4, left_m), (40, left_m)])
        return Unit(body, east, Speed(mph), 11, 1, 13, "leave_road", path, spot, location=4, before=(63,))

    def parked(body: Any, offset_m: float, ahead_m: float = 0.0) -> Unit:
        return Unit(body, east, Speed(0), 98, 5, 53, "stopped", _beside(east, offset_m), spot, ahead_m)

    on_shoulder = -(half_m + 0.5 + bodies.SEDAN.width_m / 2)
    return [
        ChainCrash(
            105, "A car parked on the shoulder, struck by one that drifts off the lane",
            (drifting(bodies.SUV, 50, on_shoulder + 0.3), parked(bodies.SEDAN, on_shoulder)), ((1, 2),),
            ("NE-411", ""), manner=0, relation_to_road=2, standing=frozenset({2}), code=14, light=2,
            when=(4, 8, 3, 20),
        ),
        ChainCrash(
            106, "A dump truck at work in the lane, struck from behind",
            (replace(_striking(bodies.PICKUP, east, 45, spot), crash_type=11), parked(bodies.DUMP_TRUCK, 0.0)),
            ((1, 2),), ("NE-411", ""), manner=0, standing=frozenset({2}), code=45, when=(5, 23, 10, 15),
        ),
        ChainCrash(
            108, "A parked car is pushed into the one that is parked ahead of it", (
                drifting(bodies.LARGE_SUV, 50, on_shoulder + 0.2), parked(bodies.SEDAN, on_shoulder),
                parked(bodies.PICKUP, on_shoulder, 7.5),
            ), ((1, 2), (2, 3)), ("NE-411", ""), manner=0, relation_to_road=2, standing=frozenset({2, 3}), code=14,
            light=2, when=(8, 13, 1, 5),
        ),
    ]  # fmt: skip


def _rejected(r: dict[str, Road]) -> list[ChainCrash]:
    base = _queues(r)[0]
    return [
        replace(
            base, number=107, title="Nothing tells whom the third vehicle met", told=1, reason="incomplete_sequence",
        ),
    ]  # fmt: skip


# --- what happens ----------------------------------------------------------------------------------------------------
class _Body:
    """A vehicle as it drives, and then as it goes on after its first contact."""

    def __init__(self, driving: Driving) -> None:
        self.driving = driving
        self.body = driving.body
        self.together: set[int] | None = None  # indices of those it goes on with
        self.at = State(0.0, 0.0, 0.0, 0.0)
        self.velocity = np.zeros(2)

    def state(self, t: float) -> State:
        return self.at if self.together is not None else self.driving.state(t)

    def motion(self, t: float) -> FloatArray:
        if self.together is not None:
            return self.velocity
        state = self.driving.state(t)
        return state.speed_mps * np.array([math.cos(state.heading_rad), math.sin(state.heading_rad)])

    def slide(self) -> None:
        if self.together is None:
            return
        speed = float(np.linalg.norm(self.velocity))
        slower = max(speed - _SLOWING_MPS2 * _STEP_S, 0.0)
        if speed > 0:
            x, y = (self.at.x_m, self.at.y_m) + self.velocity * _STEP_S
            self.velocity = self.velocity * (slower / speed)
            self.at = State(float(x), float(y), self.at.heading_rad, slower)


def meetings_of(crash: ChainCrash) -> list[Meeting]:
    """Every contact in order, the first one exactly; ``ValueError`` if they do not come about in this order."""
    all_of_them = [_Body(unit.driving()) for unit in crash.units]
    one, two = (all_of_them[number - 1] for number in crash.contacts[0])
    first = collide(one.driving, two.driving)
    found = [Meeting(first.t, first.point, first.states, first.on_body)]
    _join(all_of_them, crash.contacts[0], first.t)
    t = first.t
    while len(found) < len(crash.contacts):
        t += _STEP_S
        if t > first.t + _LONGEST_S:
            raise ValueError(f"crash {crash.number}: contact {len(found) + 1} does not come about")
        for body in all_of_them:
            body.slide()
        for i, j in _touching(all_of_them, t):
            expected = crash.contacts[len(found)] if len(found) < len(crash.contacts) else ()
            if {i + 1, j + 1} != set(expected):
                raise ValueError(f"crash {crash.number}: vehicles {i + 1} and {j + 1} touch at {t - first.t:.2f} s")
            found.append(_meeting(all_of_them, expected, t))
            _join(all_of_them, expected, t)
    return found


def _touching(all_of_them: list[_Body], t: float) -> list[tuple[int, int]]:
    outlines = [outline(body.state(t), body.body) for body in all_of_them]
    return [
        (i, j)
        for j in range(len(all_of_them))
        for i in range(j)
        if j not in (all_of_them[i].together or ()) and outlines[i].intersects(outlines[j])
    ]


def _join(all_of_them: list[_Body], pair: tuple[int, ...], t: float) -> None:
    members = {number - 1 for number in pair}
    for number in pair:
        members |= all_of_them[number - 1].together or set()
    mass = sum(all_of_them[i].body.mass_kg for i in members)
    common = sum(all_of_them[i].body.mass_kg * all_of_them[i].motion(t) for i in members) / mass
    for i in members:
        body = all_of_them[i]
        body.at, body.velocity, body.together = body.state(t), common, members


def _meeting(all_of_them: list[_Body], pair: tuple[int, ...], t: float) -> Meeting:
    one, two = (all_of_them[number - 1] for number in pair)
    states = one.state(t), two.state(t)
    point = touch_point(states[0], one.body, states[1], two.body)
    return Meeting(t, point, states, (on_body(point, states[0]), on_body(point, states[1])))


# --- what is told of it, and what is true --------------------------------------------------------------------------
def coded(crash: ChainCrash, meetings: list[Meeting]) -> Report:
    """The report."""
    told = meetings[: crash.told or len(meetings)]
    events = []
    hours: dict[int, int] = {}
    for (one, two), meeting in zip(crash.contacts, told, strict=False):
        at = [clock(place, crash.units[n - 1].body) for n, place in zip((one, two), meeting.on_body, strict=True)]
        if one in crash.standing:  # pushed: coded as an event of the vehicle that had struck it
            events.append(EventCodes(crash.code, 1, _SET_IN_MOTION, two, at[1]))
        else:
            events.append(EventCodes(crash.code, one, at[0], two, at[1]))
        hours.setdefault(one, at[0])
        hours.setdefault(two, at[1])
    before = [
        EventCodes(code, number, 55, 5555, 55) for number, unit in enumerate(crash.units, 1) for code in unit.before
    ]
    vehicles = {
        number: coded_vehicle(
            number, unit, hours.get(number, 99), deaths=int(number == 1), surface=1, seed=crash.number
        )
        for number, unit in enumerate(crash.units, 1)
    }
    latitude, longitude = reported_place(meetings[0].point)
    road = crash.units[0].approach.road
    route, system = signing(road)
    return Report(
        number=crash.number, when=crash.when, latitude_deg=latitude, longitude_deg=longitude, ways=crash.ways,
        route=route, functional_system=system, rural=limit_of(road) >= 50, harmful=crash.code, manner=crash.manner,
        intersection=crash.intersection, interchange=0, junction=crash.junction,
        relation_to_road=crash.relation_to_road, light=crash.light, weather=1,
        vehicles=tuple(each for number, each in vehicles.items() if number not in crash.standing),
        events=(*before, *events),
        standing=tuple(each for number, each in vehicles.items() if number in crash.standing),
        at_work=crash.code == 45,
    )  # fmt: skip


def truth_of(crash: ChainCrash, report: Report, meetings: list[Meeting]) -> dict[str, Any]:
    """The row of one crash: as those of two vehicles, each vehicle's impact being its first one; and the contacts."""
    row: dict[str, Any] = {"key": report.key, "title": crash.title, "kind": crash.kind}
    if crash.reason is not None:
        return row | {"expected": {"final_state": "rejected", "reason": crash.reason}, "vehicles": []}
    frame = LocalFrame(report)
    start = meetings[0].t
    vehicles = []
    for number, unit in enumerate(crash.units, 1):
        pair, meeting = next(each for each in zip(crash.contacts, meetings, strict=True) if number in each[0])
        index = pair.index(number)
        collision = Collision(start, meeting.point, meeting.states, meeting.on_body)
        vehicles.append(vehicle_row(number, unit, unit.driving(), collision, index, frame))
    impact = frame.points(meetings[0].point)
    return row | {
        "expected": {"final_state": "verified", "reason": None},
        "latitude_deg": report.latitude_deg,
        "longitude_deg": report.longitude_deg,
        "lead_time_s": LEAD_TIME_S,
        "impact_point": {"x_m": rounded_to(impact[0], 3), "y_m": rounded_to(impact[1], 3)},
        "contacts": [
            {"vehicles": list(pair), "after_s": rounded_to(meeting.t - start, 2)}
            for pair, meeting in zip(crash.contacts, meetings, strict=True)
        ],
        "vehicles": vehicles,
    }
