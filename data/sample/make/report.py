"""A crash of the sample as the officer and the coder put it down: codes, areas of impact, people, and a place.

:func:`coded` turns the true motion into a :class:`Report`; :mod:`make.crashapi` writes it. What a report says is
changed with ``dataclasses.replace``, which is how the reports that must be rejected are made.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from make.crash import Crash, Unit
from make.motion import Body, Collision, clock
from make.plane import TOWN, FloatArray
from make.roads import Road

STATE = 31
CASE_BASE = STATE * 10_000 + 9_000  # far beyond the numbers of real cases of a year
_FATAL_ORDER = ("motorcycle", "car", "van", "suv", "pickup", "truck", "bus", "tractor_trailer")


@dataclass(frozen=True)
class EventCodes:
    """One event of the sequence: ``AOI1 SOE VNUMBER1`` and ``VNUMBER2 AOI2`` (5555 and 55 where nothing was hit)."""

    code: int
    vehicle_1: int
    area_1: int
    vehicle_2: int
    area_2: int


@dataclass(frozen=True)
class VehicleCodes:
    """What is coded of one vehicle. FARS elements in order of the fields' names."""

    number: int
    body: Body
    travel_speed: int
    speed_limit: int
    lanes: int
    trafficway: int
    alignment: int
    control: int
    surface: int
    movement: int
    event: int
    avoidance: int
    stability: int
    location: int
    crash_type: int
    impact: int
    deaths: int
    occupants: int
    driver_age: int
    driver_sex: int
    charge: int = 0


@dataclass(frozen=True)
class PersonCodes:
    """What is coded of a person outside the vehicles: FARS elements in order of the fields' names, and the typing."""

    kind: int
    struck_by: int
    age: int
    sex: int
    location: int
    action: int
    typing: tuple[tuple[str, object], ...]


@dataclass(frozen=True)
class Report:
    """What is coded of a crash."""

    number: int
    when: tuple[int, int, int, int]
    latitude_deg: float
    longitude_deg: float
    ways: tuple[str, str]
    route: int
    functional_system: int
    rural: bool
    harmful: int
    manner: int
    intersection: int
    interchange: int
    junction: int
    relation_to_road: int
    light: int
    weather: int
    vehicles: tuple[VehicleCodes, ...]
    events: tuple[EventCodes, ...]
    people: tuple[PersonCodes, ...] = ()
    standing: tuple[VehicleCodes, ...] = ()  # parked vehicles, or those at work
    at_work: bool = False
    bare_ampersand: bool = False  # served as not well-formed, as some real answers are

    @property
    def case(self) -> int:
        """``ST_CASE``."""
        return CASE_BASE + self.number

    @property
    def key(self) -> str:
        """Partition key."""
        return f"2023-{self.case}"


def coded(crash: Crash, collision: Collision) -> Report:
    """The report of a crash that happened as ``collision`` says."""
    hours = [clock(place, unit.body) for place, unit in zip(collision.on_body, crash.units, strict=True)]
    dead = min((0, 1), key=lambda i: _FATAL_ORDER.index(crash.units[i].body.kind))
    latitude, longitude = reported_place(collision.point)
    vehicles = tuple(
        coded_vehicle(i + 1, unit, hours[i], deaths=int(i == dead), surface=crash.surface, seed=crash.number)
        for i, unit in enumerate(crash.units)
    )
    # A vehicle that hit something else first has that as its initial contact.
    if crash.other_harmful_first is not None:
        first = crash.other_harmful_first[0] - 1
        vehicles = tuple(replace(v, impact=1) if i == first else v for i, v in enumerate(vehicles))
    road = crash.units[0].approach.road if crash.units[0].approach.road.trafficway else crash.units[1].approach.road
    route, system = signing(road)
    return Report(
        number=crash.number, when=crash.when, latitude_deg=latitude, longitude_deg=longitude, ways=crash.ways,
        route=route, functional_system=system, rural=limit_of(road) >= 50,
        harmful=crash.other_harmful_first[1] if crash.other_harmful_first else 12, manner=crash.manner,
        intersection=crash.intersection, interchange=crash.interchange, junction=crash.junction,
        relation_to_road=crash.relation_to_road, light=crash.light, weather=crash.weather,
        vehicles=vehicles, events=tuple(_events(crash, hours)),
    )  # fmt: skip


def reported_place(point: FloatArray) -> tuple[float, float]:
    """A point of the town plane as reports give it: degrees that come from hundredths of a second (30 cm)."""
    degrees = np.round(TOWN.to_degrees(point) * 360_000) / 360_000
    return round(float(degrees[0]), 8), round(float(degrees[1]), 8)


def coded_vehicle(number: int, unit: Unit, hour: int, *, deaths: int, surface: int, seed: int) -> VehicleCodes:
    """What is coded of one vehicle that was struck at an hour of the clock."""
    road = unit.approach.road
    section = road.section(road.at(*unit.approach.at))
    off_road = road.trafficway == 0
    lanes = len(section.forward) + len(section.backward) + (1 if section.centre else 0)
    return VehicleCodes(
        number=number, body=unit.body, travel_speed=unit.travel_speed,
        speed_limit=0 if off_road else limit_of(road, unit), lanes=0 if off_road else lanes,
        trafficway=road.trafficway, alignment=0 if off_road else unit.alignment, control=unit.control, surface=surface,
        charge=unit.charge, movement=unit.movement, event=unit.event, avoidance=unit.avoidance,
        stability=2 if unit.avoidance == 16 else 1, location=unit.location, crash_type=unit.crash_type, impact=hour,
        deaths=deaths, occupants=1, driver_age=19 + (seed * 17 + number * 23) % 61, driver_sex=1 + (seed + number) % 2,
    )  # fmt: skip


def limit_of(road: Road, unit: Unit | None = None) -> int:
    """Speed limit (mph)."""
    station = road.at(*unit.approach.at) if unit else road.curve.length / 2
    return int(road.section(station).tags.get("maxspeed", "25 mph").split()[0])


def signing(road: Road) -> tuple[int, int]:
    """``ROUTE`` and ``FUNC_SYS``."""
    highway = road.common["highway"]
    ref = road.common.get("ref", "")
    route = 1 if ref.startswith("I ") else 2 if ref.startswith("US ") else 3 if ref.startswith("NE ") else 6
    systems = {"motorway": 1, "motorway_link": 1, "primary": 3, "secondary": 4, "tertiary": 5, "unclassified": 6}
    return route, systems.get(highway, 7)


def _events(crash: Crash, hours: list[int]) -> list[EventCodes]:
    events = [
        # What a driver hit on the roadside is struck with the right front corner.
        EventCodes(-code, i + 1, 1, 9999, 77) if code < 0 else EventCodes(code, i + 1, 55, 5555, 55)
        for i, unit in enumerate(crash.units)
        for code in unit.before
    ]
    first = min((0, 1), key=lambda i: min(hours[i] % 12, 12 - hours[i] % 12))  # the one that struck with its front
    events.append(EventCodes(12, first + 1, hours[first], 2 - first, hours[1 - first]))
    for number, code, area in crash.afterwards:
        events.append(
            EventCodes(code, number, area, 5555, 55) if area == 55 else EventCodes(code, number, area, 9999, 77)
        )
    return events
