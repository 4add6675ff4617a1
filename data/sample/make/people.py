"""Crashes with people and animals: walking, running, riding, each with one vehicle or two, and how they are reported.

A person is a body on a path like a vehicle's, so that the same first touch is looked for. What is told of the person
is told as the typing manual of FARS has it; the area of impact follows from where on the vehicle the touch is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from make import bodies
from make.crash import Approach, Plan, Unit
from make.curves import Curve, rounded
from make.motion import LEAD_TIME_S, Body, Collision, Driving, Speed, clock, collide
from make.plane import plane_point, plane_points
from make.report import EventCodes, PersonCodes, Report, coded_vehicle, limit_of, reported_place, signing
from make.roads import Road
from make.truth import LocalFrame, rounded_to, vehicle_row

MPH = 0.44704
_NONE = (0, "")
ADULT = Body("pedestrian", 0.57, 0.49, 1.69, 82, 5, _NONE, _NONE)
CHILD = Body("pedestrian", 0.41, 0.35, 1.22, 23, 5, _NONE, _NONE)
DEER = Body("animal", 1.60, 0.42, 0.92, 68, 0, _NONE, _NONE)
BICYCLE = Body("cyclist", 1.75, 0.60, 1.69, 97, 6, _NONE, _NONE)
WALK_MPS, WALK_OLD_MPS, CROSSWALK_MPS, RUN_MPS, RIDE_MPS = 1.57, 1.39, 1.31, 3.5, 4.94
DEER_MPS = 2.8
"""As people and deer move on average: what nobody measures at a crash, and an estimate cannot know better."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person, or an animal, of which nothing is coded: the true motion, and the codes (FARS elements in capitals)."""

    body: Body
    path: Curve
    anchor: Plan
    mps: float
    course: str  # seen from the vehicle: from_left, from_right, along, towards, standing
    location: int  # LOCATION
    position: int  # PEDPOS, of a cyclist BIKEPOS
    type: int  # PEDCTYPE or BIKECTYPE
    group: int  # PEDCGP or BIKECGP
    action: int = 3  # NMACTION
    age: int = 41
    sex: int = 1
    scenario: str = "8"  # PEDSNR
    direction: int = 8  # PEDDIR, of a cyclist BIKEDIR
    motorist: int = 8  # MOTDIR
    leg: int = 8  # PEDLEG

    @property
    def kind(self) -> str:
        """The kind of crash with one."""
        return self.body.kind

    @property
    def party(self) -> int:
        """The number as a party."""
        return 2001 if self.kind == "animal" else 1001

    @property
    def rides(self) -> bool:
        """Whether it is a cyclist."""
        return self.body.kind == "cyclist"

    def driving(self) -> Driving:
        """The motion."""
        return Driving(self.body, self.path, self.path.station(plane_point(*self.anchor)), Speed(self.mps / MPH))


@dataclass(frozen=True, eq=False)
class PersonCrash:
    """One crash with a person; ``second`` strikes the same person after ``unit``."""

    number: int
    title: str
    unit: Unit
    person: Person
    ways: tuple[str, str]
    intersection: int = 1
    junction: int = 1
    light: int = 1
    when: tuple[int, int, int, int] = (6, 14, 15, 20)
    relation_to_road: int = 1
    second: Unit | None = None
    told: bool = True  # the report tells which way the person went
    reason: str | None = None  # why it has to be rejected
    weather: int = 1
    striking: int = 1  # VNUMBER1 of the first event
    overturns: bool = False  # the vehicle, afterwards


def across(near: Plan, toward: Plan) -> Curve:
    """A straight path through a point of the plan in a direction (du, dv), 60 m both ways."""
    length = math.hypot(*toward)
    du, dv = toward[0] / length * 60, toward[1] / length * 60
    return rounded(plane_points([(near[0] - du, near[1] - dv), (near[0] + du, near[1] + dv)]))


def crashes(r: dict[str, Road]) -> list[PersonCrash]:
    """All of them. In the plan u is roughly east, v north; the highway runs along u."""
    return [*_crossing(r), *_along(r), *_turning(r), *_cyclists(r), *_animals(r), *_rejected(r)]


def _straight(body: Body, lane: Approach, mph: float, at: Plan, **codes: Any) -> Unit:
    return Unit(body, lane, Speed(mph), 13, 1, codes.pop("event", 80), "straight", lane.curve(), at, **codes)


def _crossing(r: dict[str, Road]) -> list[PersonCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    west = Approach(r["main_west"], -1, 1, (-860, 0))
    dogwood = Approach(r["dogwood"], -1, 1, (130, -100))
    north = {"toward": (0.0, 1.0)}
    south = {"toward": (0.0, -1.0)}
    open_road = {"location": 11, "position": 3, "type": 760, "group": 750}
    spot, other = (-860.0, -1.8), (-900.0, 1.8)
    out = [
        PersonCrash(
            81, "Crossing the highway from the right, side not told",
            _straight(bodies.SEDAN, east, 45, spot),
            Person(ADULT, across(spot, **north), spot, WALK_MPS, "from_right", **open_road),
            ("NE-411", ""), told=False,
        ),
        PersonCrash(
            82, "Crossing the highway from the left, coming home at night",
            _straight(bodies.PICKUP, west, 50, other),
            Person(ADULT, across(other, **north), other, WALK_MPS, "from_left", **open_road, direction=1, motorist=4),
            ("NE-411", ""), light=2, when=(11, 4, 22, 10),
        ),
        PersonCrash(
            83, "Crossing the highway from the right by the compass",
            _straight(bodies.SUV, east, 50, spot),
            Person(ADULT, across(spot, **north), spot, WALK_MPS, "from_right", **open_road, direction=1, motorist=2),
            ("NE-411", ""),
        ),
        PersonCrash(
            84, "Dashing out from the left in plain view",
            _straight(bodies.COMPACT, east, 40, spot),
            Person(ADULT, across(spot, **south), spot, RUN_MPS, "from_left", 11, 3, 741, 740, direction=3, motorist=2),
            ("NE-411", ""),
        ),
        PersonCrash(
            85, "A child runs across the residential street from the right",
            _straight(bodies.MINIVAN, dogwood, 24, (128.2, -95)),
            Person(
                CHILD, across((128.2, -95.0), (1.0, 0.0)), (128.2, -95), RUN_MPS, "from_right", 11, 3, 741, 740,
                age=7, direction=2, motorist=3,
            ),
            ("DOGWOOD ST", ""), when=(7, 3, 16, 12),
        ),
        PersonCrash(
            86, "An old woman crosses at night",
            _straight(bodies.LARGE_SUV, west, 45, other),
            Person(
                ADULT, across(other, **south), other, WALK_OLD_MPS, "from_right", **open_road, age=78, sex=2,
                direction=3, motorist=4,
            ),
            ("NE-411", ""), light=2, when=(12, 2, 18, 40),
        ),
        PersonCrash(
            87, "Two cars one after the other strike the same man",
            _straight(bodies.SEDAN, east, 40, spot),
            Person(ADULT, across(spot, **north), spot, WALK_MPS, "from_right", **open_road, direction=1, motorist=2),
            ("NE-411", ""), light=2, when=(1, 20, 21, 5),
            second=_straight(bodies.SUV, east, 42, spot),
        ),
    ]  # fmt: skip
    return out


def _along(r: dict[str, Road]) -> list[PersonCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    return [
        PersonCrash(
            88, "Walking along the highway with traffic, struck from behind",
            _straight(bodies.PICKUP, east, 50, spot),
            Person(ADULT, east.curve(), spot, WALK_MPS, "along", 13, 3, 410, 400, action=5),
            ("NE-411", ""), light=2, when=(10, 8, 23, 30),
        ),
        PersonCrash(
            89, "Walking along the highway towards traffic",
            _straight(bodies.SEDAN, east, 50, spot),
            Person(ADULT, east.curve().reversed(), spot, WALK_MPS, "towards", 13, 3, 440, 400, action=6),
            ("NE-411", ""), light=2, when=(9, 8, 5, 2),
        ),
    ]  # fmt: skip


def _turning(r: dict[str, Road]) -> list[PersonCrash]:
    sumner = Approach(r["sumner"], 1, 1, (100, -130))
    path = sumner.turn(Approach(r["dogwood"], 1, 1, (130, -110)), 10.0, (130, -130))
    at = (131.6, -118.0)
    straight = Approach(r["dogwood"], 1, 1, (130, -160))
    zebra = (131.6, -122.0)
    return [
        PersonCrash(
            90, "Left turn into a pedestrian in the crosswalk, coming the other way",
            Unit(bodies.SEDAN, sumner, Speed(12), 13, 11, 80, "turn_left", path, at, control=20),
            Person(
                ADULT, across(at, (-1.0, 0.0)), at, CROSSWALK_MPS, "from_right", 1, 2, 781, 790, scenario="11b",
                leg=2, direction=4, motorist=2,
            ),
            ("SUMNER AVE", "DOGWOOD ST"), 2, 2,
        ),
        PersonCrash(
            91, "In the crosswalk of a crossing, from the motorist's right",
            _straight(bodies.COMPACT, straight, 28, zebra, control=0),
            Person(
                ADULT, across(zebra, (-1.0, 0.0)), zebra, CROSSWALK_MPS, "from_right", 1, 2, 770, 750, scenario="3b",
                leg=2, direction=4, motorist=1,
            ),
            ("DOGWOOD ST", "SUMNER AVE"), 2, 2,
        ),
    ]  # fmt: skip


def _cyclists(r: dict[str, Road]) -> list[PersonCrash]:
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    spot = (-860.0, -1.8)
    return [
        PersonCrash(
            92, "Cyclist overtaken and not seen",
            _straight(bodies.SUV, east, 52, spot),
            Person(BICYCLE, east.curve(), spot, RIDE_MPS, "along", 13, 1, 231, 230, action=5, direction=1),
            ("NE-411", ""), light=5, when=(9, 21, 19, 44),
        ),
        PersonCrash(
            93, "Cyclist rides out across the highway",
            _straight(bodies.BOX_TRUCK, east, 45, spot),
            Person(BICYCLE, across(spot, (0.0, 1.0)), spot, RIDE_MPS, "from_right", 11, 1, 318, 310),
            ("NE-411", ""), told=False,
        ),
        PersonCrash(
            94, "Cyclist faces traffic",
            _straight(bodies.SEDAN, east, 45, spot),
            Person(BICYCLE, east.curve().reversed(), spot, RIDE_MPS, "towards", 13, 1, 250, 258, action=6, direction=2),
            ("NE-411", ""),
        ),
    ]  # fmt: skip


def _animals(r: dict[str, Road]) -> list[PersonCrash]:
    """A report tells nothing of an animal: neither its side nor what it was."""
    east = Approach(r["main_west"], 1, 1, (-860, 0))
    west = Approach(r["main_west"], -1, 1, (-860, 0))
    spot, other = (-860.0, -1.8), (-900.0, 1.8)
    silent = {"location": 0, "position": 0, "type": 0, "group": 0}
    return [
        PersonCrash(
            95, "A deer crosses the highway from the right at dusk",
            _straight(bodies.SEDAN, east, 50, spot, event=87),
            Person(DEER, across(spot, (0.0, 1.0)), spot, DEER_MPS, "from_right", **silent),
            ("NE-411", ""), light=5, when=(11, 12, 17, 40), told=False,
        ),
        PersonCrash(
            96, "A motorcycle strikes a deer that comes from the left, and falls",
            _straight(bodies.MOTORCYCLE, west, 52, other, event=87),
            Person(DEER, across(other, (0.0, 1.0)), other, DEER_MPS, "from_left", **silent),
            ("NE-411", ""), light=2, when=(10, 22, 21, 15), told=False, overturns=True,
        ),
    ]  # fmt: skip


def _rejected(r: dict[str, Road]) -> list[PersonCrash]:
    """Made from a crash that happened, with what the report says of it changed."""
    base = next(crash for crash in _crossing(r) if crash.number == 83)
    unseen = replace(base.person, location=99, position=9, type=0, group=0, action=99, direction=9, motorist=9)
    return [
        replace(
            base, number=97, title="Nothing tells where the pedestrian was", person=unseen, relation_to_road=99,
            reason="incomplete_trajectory",
        ),
        replace(
            base, number=98, title="Struck by a vehicle that the report does not list", striking=7,
            reason="incomplete_sequence",
        ),
    ]  # fmt: skip


# --- what is told of them, and what is true ------------------------------------------------------------------------
def collision_of(crash: PersonCrash) -> Collision:
    """The first touch of vehicle and person."""
    return collide(crash.unit.driving(), crash.person.driving())


def coded(crash: PersonCrash, collision: Collision) -> Report:
    """The report."""
    hour = clock(collision.on_body[0], crash.unit.body)
    units = [crash.unit, *([crash.second] if crash.second else [])]
    latitude, longitude = reported_place(collision.point)
    road = crash.unit.approach.road
    route, system = signing(road)
    person = crash.person
    harmful = {"animal": 11, "cyclist": 9}.get(person.kind, 8)
    surface = 1
    return Report(
        number=crash.number, when=crash.when, latitude_deg=latitude, longitude_deg=longitude, ways=crash.ways,
        route=route, functional_system=system, rural=limit_of(road) >= 50, harmful=harmful, manner=0,
        intersection=crash.intersection, interchange=0, junction=crash.junction,
        relation_to_road=crash.relation_to_road, light=crash.light, weather=crash.weather,
        vehicles=tuple(
            coded_vehicle(i, unit, hour if i == 1 else 12, deaths=0, surface=surface, seed=crash.number)
            for i, unit in enumerate(units, 1)
        ),
        events=tuple(
            EventCodes(harmful, crash.striking if i == 1 else i, hour if i == 1 else 12, 9999, 77)
            for i in range(1, len(units) + 1)
        ) + ((EventCodes(1, 1, 0, 5555, 55),) if crash.overturns else ()),
        people=() if person.kind == "animal" else (_coded_person(person, crash),),
    )  # fmt: skip


def _coded_person(person: Person, crash: PersonCrash) -> PersonCodes:
    rides = person.rides
    at = 1 if crash.intersection > 1 else 3
    typing = {
        "PBCWALK": int(person.position == 2 and not rides), "PBSWALK": 0, "PBSZONE": 0,
        "PEDCTYPE": 0 if rides else person.type, "BIKECTYPE": person.type if rides else 0,
        "PEDLOC": 7 if rides else at, "BIKELOC": at if rides else 7,
        "PEDPOS": 77 if rides else person.position, "BIKEPOS": person.position if rides else 77,
        "PEDDIR": 7 if rides else person.direction, "BIKEDIR": person.direction if rides else 7,
        "MOTDIR": 7 if rides else person.motorist,
        "MOTMAN": 7 if rides else {"turn_left": 1, "turn_right": 2}.get(crash.unit.manoeuvre, 3),
        "PEDLEG": 7 if rides else person.leg, "PEDSNR": 7 if rides else person.scenario,
        "PEDCGP": 0 if rides else person.group, "BIKECGP": person.group if rides else 0,
    }  # fmt: skip
    return PersonCodes(
        6 if rides else 5, 1, person.age, person.sex, person.location, person.action, tuple(typing.items())
    )


def truth_of(crash: PersonCrash, report: Report, collision: Collision) -> dict[str, Any]:
    """The row of one crash: as those of two vehicles, with the person beside the vehicle that struck first."""
    row: dict[str, Any] = {"key": report.key, "title": crash.title, "kind": crash.person.kind}
    if crash.reason is not None:
        return row | {"expected": {"final_state": "rejected", "reason": crash.reason}, "vehicles": []}
    frame = LocalFrame(report)
    impact = frame.points(collision.point)
    walking = crash.person.driving()
    start, end = walking.state(collision.t - LEAD_TIME_S), collision.states[1]
    return row | {
        "expected": {"final_state": "verified", "reason": None},
        "latitude_deg": report.latitude_deg,
        "longitude_deg": report.longitude_deg,
        "lead_time_s": LEAD_TIME_S,
        "impact_point": {"x_m": rounded_to(impact[0], 3), "y_m": rounded_to(impact[1], 3)},
        "vehicles": [vehicle_row(1, crash.unit, crash.unit.driving(), collision, 0, frame)],
        "people": [{
            "number": crash.person.party, "course": crash.person.course, "told": crash.told,
            "speed_mps": crash.person.mps,
            "initial_pose": frame.pose(start), "impact_pose": frame.pose(end),
        }],
    }  # fmt: skip
