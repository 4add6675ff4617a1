"""What a crash of the sample consists of: two vehicles' driving, and the codes an officer and a coder give it.

The impact areas are not here: they follow from the contact the motion leads to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from make.curves import Curve, turning
from make.motion import Body, Driving, Speed
from make.plane import FloatArray, plane_point
from make.roads import Road

Plan = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Approach:
    """The lane a vehicle begins in: a road, +1 along or -1 against it, the lane counted from its driver's left."""

    road: Road
    direction: int
    lane: int
    at: Plan
    wrong_way: bool = False  # driven against the traffic of this lane

    @property
    def station(self) -> float:
        """Station of the road near which the lane is meant."""
        return self.road.at(*self.at)

    def curve(self) -> Curve:
        """Centre of the lane in the direction of travel, along the whole road, as it lies at ``at``."""
        left, _ = self.road.section(self.station).lane(self.direction, self.lane)
        curve = self.road.curve.offset(left)
        return curve if (self.direction > 0) != self.wrong_way else curve.reversed()

    def width_m(self) -> float:
        """Width of the lane."""
        return self.road.section(self.station).lane(self.direction, self.lane)[1]

    def turn(self, onto: Approach, radius_m: float, near: Plan) -> Curve:
        """The path from this lane into another one."""
        return turning(self.curve(), onto.curve(), radius_m, plane_point(*near))


@dataclass(frozen=True, eq=False)
class Unit:
    """One vehicle: its true motion and its codes (FARS elements in capitals)."""

    body: Body
    approach: Approach
    speed: Speed
    crash_type: int  # ACC_TYPE
    movement: int  # P_CRASH1
    event: int  # P_CRASH2
    manoeuvre: str
    path: Curve
    anchor: Plan
    ahead_m: float = 0.0  # how far beyond its anchor the vehicle is at time zero
    avoidance: int = 99  # P_CRASH3
    location: int = 1  # PCRASH5
    control: int = 0  # VTRAFCON
    charge: int = 0  # VIOLATION
    speed_reported: bool = True  # TRAV_SP is the true speed before the vehicle reacts, else 998
    travel_speed_code: int | None = None  # TRAV_SP where it is neither
    before: tuple[int, ...] = ()  # SOE of its events before the collision: 68 crossed the centre line, 63 ran off, ...
    backing: bool = False
    alignment: int = 1  # VALIGN

    def driving(self) -> Driving:
        """The motion."""
        anchor_s = self.path.station(plane_point(*self.anchor)) + self.ahead_m
        return Driving(self.body, self.path, anchor_s, self.speed, self.backing)

    @property
    def travel_speed(self) -> int:
        """``TRAV_SP``."""
        if self.travel_speed_code is not None:
            return self.travel_speed_code
        return round(self.speed.mph) if self.speed_reported else 998


@dataclass(frozen=True, eq=False)
class Crash:
    """One crash of the sample, with truth."""

    number: int
    title: str
    units: tuple[Unit, Unit]
    manner: int  # MAN_COLL
    intersection: int  # TYP_INT
    junction: int  # RELJCT2
    ways: tuple[str, str]  # TWAY_ID, TWAY_ID2
    interchange: int = 0  # RELJCT1
    when: tuple[int, int, int, int] = (6, 14, 15, 20)  # month, day, hour, minute of 2023
    light: int = 1
    weather: int = 1
    surface: int = 1
    layer: int = 0  # of the road it happened on: 1 on a bridge, -1 in a tunnel
    other_harmful_first: tuple[int, int] | None = None  # (vehicle, SOE), first harmful, not a collision
    relation_to_road: int = 1  # REL_ROAD
    afterwards: tuple[tuple[int, int, int], ...] = ()  # (vehicle, SOE, AOI) after the collision


def swerve(base: Curve, near: Plan, knots: list[tuple[float, float]]) -> Curve:
    """``base`` with a lateral drift: knots are (metres past the place nearest to ``near``, metres left)."""
    s = base.station(plane_point(*near))
    return base.drifting([(s + d, left) for d, left in knots])


def meeting(one: Curve, two: Curve, near: Plan) -> Plan:
    """Where two paths cross, as a point of the plan: the crossing nearest to ``near``."""
    crossing = shapely.LineString(one.xy).intersection(shapely.LineString(two.xy))
    if crossing.is_empty:
        raise ValueError(f"the paths do not cross near {near}")
    points = np.array([g.centroid.coords[0] for g in getattr(crossing, "geoms", [crossing])])
    best: FloatArray = points[np.linalg.norm(points - plane_point(*near), axis=1).argmin()]
    return to_plan(best)


def to_plan(xy: FloatArray) -> Plan:
    """A point of the town plane on the plan."""
    axes = np.stack([plane_point(1, 0), plane_point(0, 1)])
    u, v = axes @ xy
    return float(u), float(v)
