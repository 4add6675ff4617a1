"""The crash record: one crash, its vehicles and its events, typed, in the project's units, unknown as None.

FARS codes are kept beside their interpretation. Names in capitals in the docstrings are FARS elements (FARS Analytical
User's Manual); other registers are read into the same codes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum, StrEnum
from typing import Annotated, Final, TypeAlias

import numpy as np
from pydantic import Field

from trace_dag.common.geometry import Pose
from trace_dag.crash.classes import CollisionType, CrashKind, RoadTopology, VehicleTrajectory, kind_of_codes
from trace_dag.crash.codes.elements import HARM_EV, HIGHEST_AGE, MOTOR_VEHICLE_IN_TRANSPORT
from trace_dag.crash.keys import FARS
from trace_dag.crash.parties import (
    EventKind,
    PartyKind,
    event_kind,
    person_kind,
    person_party,
    thing_party,
    thing_struck,
)
from trace_dag.crash.trailer import Trailer

FIRST_YEAR: Final = 1900
LATEST_YEAR: Final = 2100
LARGEST_ACCURACY_M: Final = 1000.0
"""Limit for the accuracy of reported points, metres: a point farther off names no road."""
# What a record that is read from a file is held to.
Age: TypeAlias = Annotated[int, Field(ge=0, le=HIGHEST_AGE)]
Year: TypeAlias = Annotated[int, Field(ge=FIRST_YEAR, le=LATEST_YEAR)]
Accuracy: TypeAlias = Annotated[float, Field(ge=0, le=LARGEST_ACCURACY_M)]


class PreCrashMovement(IntEnum):
    """``P_CRASH1``, the movement before the critical event; the value is the FARS code."""

    NO_DRIVER = 0
    GOING_STRAIGHT = 1
    DECELERATING = 2
    ACCELERATING = 3
    STARTING = 4
    STOPPED = 5
    PASSING = 6
    PARKED_IN_LANE = 7
    LEAVING_PARKING = 8
    ENTERING_PARKING = 9
    TURNING_RIGHT = 10
    TURNING_LEFT = 11
    U_TURN = 12
    BACKING = 13
    NEGOTIATING_CURVE = 14
    CHANGING_LANES = 15
    MERGING = 16
    AVOIDANCE = 17
    OTHER = 98
    UNKNOWN = 99


STOPPED_MOVEMENTS: Final = frozenset({PreCrashMovement.STOPPED, PreCrashMovement.PARKED_IN_LANE})
"""Movements of a vehicle that stood before the critical event."""


class VehicleClass(StrEnum):
    """Classes of vehicles as bodies to simulate, from ``BODY_TYP`` and GVWR."""

    CAR = "car"
    SUV = "suv"
    PICKUP = "pickup"
    VAN = "van"
    LIGHT_TRUCK = "light_truck"
    TRUCK = "truck"
    TRACTOR_TRAILER = "tractor_trailer"  # the tractor of one
    BUS = "bus"
    MOTORCYCLE = "motorcycle"
    OTHER = "other"
    TRAILER = "trailer"  # of a body behind a vehicle; no vehicle of a report


HEAVY_VEHICLES: Final = frozenset({VehicleClass.TRUCK, VehicleClass.TRACTOR_TRAILER, VehicleClass.BUS})


@dataclass(frozen=True)
class ImpactArea:
    """An area of the body that was struck, as an interval of angles (radians, CCW from the vehicle's front).

    ``code`` is the FARS value (``IMPACT1`` or an event's ``AOI``), ``clock_h`` its clock position (12 front, 3 right).
    Side codes 61-63 and 81-83 are wider intervals than the 12 clock positions.
    """

    code: int
    clock_h: float
    centre_rad: float
    half_width_rad: float


class Octant(StrEnum):
    """A direction of the compass, as many registers report it."""

    NORTH = "north"
    NORTH_EAST = "north_east"
    EAST = "east"
    SOUTH_EAST = "south_east"
    SOUTH = "south"
    SOUTH_WEST = "south_west"
    WEST = "west"
    NORTH_WEST = "north_west"

    @property
    def heading_rad(self) -> float:
        """Return its middle, counter-clockwise from east.

        >>> round(Octant.NORTH_WEST.heading_rad / math.pi, 2)  # 135 degrees
        0.75
        """
        return math.remainder(math.pi / 2 - list(Octant).index(self) * math.pi / 4, math.tau)


class Moment(StrEnum):
    """The moment at which the reported heading of a party that turned holds."""

    BEFORE = "before"
    AFTER = "after"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Heading:
    """The reported direction of travel of a party; ``moment`` matters only for a party that turned."""

    octant: Octant
    moment: Moment = Moment.BEFORE


class Severity(StrEnum):
    """The KABCO scale of injuries (MMUCC), the worst first."""

    KILLED = "K"
    SERIOUS = "A"
    MINOR = "B"
    POSSIBLE = "C"
    NONE = "O"


_SEVERITY_OF_INJ_SEV: Final = {
    4: Severity.KILLED,
    3: Severity.SERIOUS,
    2: Severity.MINOR,
    1: Severity.POSSIBLE,
    0: Severity.NONE,
}


def severity_of(injury_code: int | None) -> Severity | None:
    """Return the letter of an ``INJ_SEV``.

    None for codes without one (injured with unknown severity; died before).

    >>> severity_of(3).value, severity_of(5)
    ('A', None)
    """
    return None if injury_code is None else _SEVERITY_OF_INJ_SEV.get(injury_code)


@dataclass(frozen=True)
class Occupant:
    """A person in a motor vehicle. ``None`` means that the report does not say."""

    number: int  # PER_NO, of the vehicle's occupants
    role_code: int  # PER_TYP: 1 driver, 2 passenger
    injury_code: int | None = None  # INJ_SEV
    age_years: Age | None = None  # AGE
    restraint_code: int | None = None  # REST_USE


@dataclass(frozen=True)
class VehicleRecord:
    """One motor vehicle. ``None`` means the report does not say. ``implied`` names the fields derived from others."""

    number: int  # VEH_NO
    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    body_type_code: int | None = None  # BODY_TYP
    make_model: str = ""
    model_year: Year | None = None
    trailers: int | None = None  # TOW_VEH
    trailer: Trailer | None = None  # what it pulls, as one body; length and mass above are without it
    jackknife_code: int | None = None  # J_KNIFE
    in_transport: bool = True  # UNITTYPE
    travel_speed_mps: float | None = None  # TRAV_SP
    travel_speed_is_lower_bound: bool = False  # TRAV_SP 997: above 151 mph
    speed_limit_mps: float | None = None  # VSPD_LIM
    speeding: bool | None = None  # SPEEDREL
    driver_drinking: bool | None = None  # DR_DRINK
    driver_age_years: Age | None = None  # AGE of who drove
    driver_belted: bool | None = None  # REST_USE
    occupants_killed: int | None = None  # DEATHS
    lanes: int | None = None  # VNUM_LAN
    trafficway_code: int | None = None  # VTRAFWAY: 1 two-way undivided, 2-3, 5 divided, 4 one-way, 6 ramp
    alignment_code: int | None = None  # VALIGN
    profile_code: int | None = None  # VPROFILE
    surface_condition_code: int | None = None  # VSURCOND
    traffic_control_code: int | None = None  # VTRAFCON
    disobeyed_control: bool | None = None  # VIOLATION, DRIVERRF / DR_SF1 to 4
    movement: PreCrashMovement = PreCrashMovement.UNKNOWN  # P_CRASH1
    critical_event_code: int | None = None  # P_CRASH2
    avoidance_code: int | None = None  # P_CRASH3
    stability_code: int | None = None  # PCRASH4
    location_code: int | None = None  # PCRASH5
    crash_type_code: int | None = None  # ACC_TYPE
    impact: ImpactArea | None = None  # IMPACT1, else the first vehicle-to-vehicle event's area
    initial_impact_code: int | None = None  # IMPACT1 as reported
    damaged_areas: tuple[int, ...] = ()  # MDAREAS / DAMAGE
    avoidance_manoeuvres: tuple[int, ...] = ()  # MANEUVER
    rollover_code: int | None = None  # ROLLOVER
    hit_and_run: bool | None = None  # HIT_RUN
    keeps_left: bool = False  # traffic does, where it drove
    heading: Heading | None = None  # of registers other than FARS
    occupants: tuple[Occupant, ...] = ()
    implied: tuple[str, ...] = ()

    @property
    def behind_m(self) -> float:
        """Return the distance that a trailer in line reaches behind the vehicle, m."""
        return 0.0 if self.trailer is None else self.trailer.combination_length_m - self.length_m

    def clock_body(self, pose: Pose) -> tuple[Pose, float, float]:
        """Return the pose, length and width (m) of the body to which clock positions refer.

        ``pose`` is that of the vehicle's centre. With a trailer the body is both in line.
        """
        if self.trailer is None:
            return pose, self.length_m, self.width_m
        x_m, y_m = pose.to_world(np.array([-self.behind_m / 2, 0.0])).tolist()
        return Pose(x_m, y_m, pose.heading_rad, pose.z_m), self.length_m + self.behind_m, self.width_m


@dataclass(frozen=True)
class EventRecord:
    """One event of the crash's sequence (``CEvent``), with its parties and their areas of impact.

    Parties are numbered by :mod:`trace_dag.crash.parties`. ``party_2`` is None for events without a second party, and
    if it is unknown.
    """

    number: int  # EVENTNUM
    code: int  # SOE
    party_1: int | None  # VNUMBER1
    area_1: ImpactArea | None  # AOI1
    party_2: int | None  # VNUMBER2
    area_2: ImpactArea | None  # AOI2
    implied: tuple[str, ...] = ()

    @property
    def kind(self) -> EventKind:
        """Return the kind that the code means."""
        return event_kind(self.code)

    @property
    def is_harmful(self) -> bool:
        """Return whether the event's code is one of ``HARM_EV``."""
        return bool(HARM_EV.meaning(self.code))

    @property
    def is_vehicle_contact(self) -> bool:
        """Return whether two motor vehicles touched and both are named."""
        return self.kind is EventKind.VEHICLE_CONTACT and self._names_two

    @property
    def is_contact(self) -> bool:
        """Return whether two vehicles, or a vehicle and a person, touched and both are named."""
        return self.kind in _CONTACTS and self._names_two

    @property
    def _names_two(self) -> bool:
        parties = {self.party_1, self.party_2}
        return len(parties) == 2 and None not in parties


_CONTACTS = frozenset({EventKind.VEHICLE_CONTACT, EventKind.PERSON_STRUCK})
_NEAR_SIDE_TURNS: Final = frozenset({5, 6, 9, 10})  # PEDSNR, without its letter


@dataclass(frozen=True)
class NonMotorist:
    """A person outside motor vehicles: pedestrian, cyclist, ... ``None`` means that the report does not say.

    Codes are those of :mod:`trace_dag.crash.codes.elements`. Fields coded at or near intersections only (directions,
    manoeuvre of the motorist, leg, scenario) are None elsewhere."""

    number: int  # PER_NO
    person_type_code: int  # PER_TYP, else PBPTYPE
    striking_vehicle: int | None = None  # STR_VEH
    age_years: Age | None = None  # AGE, else PBAGE
    sex_code: int | None = None  # SEX, else PBSEX
    location_code: int | None = None  # LOCATION
    crosswalk_code: int | None = None  # PBCWALK
    sidewalk_code: int | None = None  # PBSWALK
    school_zone_code: int | None = None  # PBSZONE
    intersection_code: int | None = None  # PEDLOC, of a cyclist BIKELOC
    pedestrian_position_code: int | None = None  # PEDPOS
    cyclist_position_code: int | None = None  # BIKEPOS
    pedestrian_direction_code: int | None = None  # PEDDIR
    cyclist_direction_code: int | None = None  # BIKEDIR
    motorist_direction_code: int | None = None  # MOTDIR
    motorist_manoeuvre_code: int | None = None  # MOTMAN
    intersection_leg_code: int | None = None  # PEDLEG
    scenario: str = ""  # PEDSNR, such as 3b
    pedestrian_group_code: int | None = None  # PEDCGP
    cyclist_group_code: int | None = None  # BIKECGP
    pedestrian_type_code: int | None = None  # PEDCTYPE
    cyclist_type_code: int | None = None  # BIKECTYPE
    actions: tuple[int, ...] = ()  # NMACTION / MPR_ACT
    circumstances: tuple[int, ...] = ()  # NMCC / MTM_CRSH
    equipment: tuple[int, ...] = ()  # MSAFEQMT, until 2018
    helmet_code: int | None = None  # NMHELMET, as the next ones since 2019
    pads_code: int | None = None  # NMPROPAD
    other_protection_code: int | None = None  # NMOTHPRO
    reflective_clothing_code: int | None = None  # NMREFCLO
    lights_code: int | None = None  # NMLIGHT
    other_prevention_code: int | None = None  # NMOTHPRE
    injury_code: int | None = None  # INJ_SEV
    heading: Heading | None = None  # of registers other than FARS

    @property
    def party(self) -> int:
        """Return the party number."""
        return person_party(self.number)

    @property
    def kind(self) -> PartyKind:
        """Return the person's kind as a party."""
        return person_kind(self.person_type_code)

    @property
    def at_near_side(self) -> bool | None:
        """Return whether a turning motorist met the person on entering the intersection rather than on leaving it.

        ``PEDSNR`` reports it; None if the report does not.
        """
        return int(self.scenario[:-1]) in _NEAR_SIDE_TURNS if self.scenario else None

    @property
    def place_code(self) -> int | None:
        """Return the first of ``PEDPOS``, ``BIKEPOS`` and ``LOCATION`` that gives a place, or None."""
        of_typing = (self.pedestrian_position_code, self.cyclist_position_code)
        return next((code for code in (*of_typing, self.location_code) if code is not None), None)


@dataclass(frozen=True)
class Quotation:
    """The words of a narrative that a field was read from: of ``crash``, ``vehicle 1``, ``person 2`` or ``event 1``."""

    of: str
    field: str
    words: str


@dataclass(frozen=True)
class CrashRecord:
    """One crash as read. ``key`` is ``<caseYear>-<stateCase>`` for FARS and ``<register>-<id>`` for other registers.

    ``register_lacks`` names the fields that its register never reports, such as ``impact``.
    """

    key: str
    case_year: Year  # of other registers than FARS: the year of the crash
    state_case: int | None
    latitude_deg: float
    longitude_deg: float
    vehicles: tuple[VehicleRecord, ...]
    events: tuple[EventRecord, ...]
    collision_type: CollisionType = CollisionType.OTHERS
    road_topology: RoadTopology = RoadTopology.OTHERS
    vehicle_trajectory: VehicleTrajectory = VehicleTrajectory.OTHERS
    register: str = FARS
    register_lacks: tuple[str, ...] = ()
    position_accuracy_m: Accuracy | None = None  # how far the reported point usually is from the crash
    attribution: str = ""  # whom a report of another register than FARS is to be attributed to, and its licence
    state_code: int | None = None
    state_name: str = ""
    county_name: str = ""
    city_name: str = ""
    year: Year | None = None
    month: int | None = None
    day: int | None = None
    hour: int | None = None
    minute: int | None = None
    trafficway_1: str = ""  # TWAY_ID
    trafficway_2: str = ""  # TWAY_ID2
    route_code: int | None = None  # ROUTE
    function_class_code: int | None = None  # FUNC_SYS
    rural_urban_code: int | None = None  # RUR_URB
    manner_of_collision_code: int | None = None  # MAN_COLL
    first_harmful_event_code: int | None = None  # HARM_EV
    intersection_type_code: int | None = None  # TYP_INT
    junction_relation_code: int | None = None  # RELJCT2
    road_relation_code: int | None = None  # REL_ROAD
    light_code: int | None = None  # LGT_COND
    weather_code: int | None = None  # WEATHER
    fatalities: int | None = None  # FATALS
    injury_code: int | None = None  # INJ_SEV of who was hurt worst, where the report has it of the crash
    vehicles_in_transport: int | None = None  # VE_FORMS, which may be more than the report lists
    people_outside: int | None = None  # PEDS: people who are in no motor vehicle in transport, as stated
    non_motorists: tuple[NonMotorist, ...] = ()
    implied: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    ambiguities: tuple[str, ...] = ()  # what the events and persons leave open, as sentences
    quotations: tuple[Quotation, ...] = ()  # of fields that were read from a narrative
    repaired: bool = False
    summary: str = ""

    @property
    def severity(self) -> Severity | None:
        """Return the worst reported injury of a person or of the crash; None without a report.

        In FARS the crash counts as fatal by itself.

        >>> record.severity.value  # FATALS 1
        'K'
        """
        of_occupants = (each.injury_code for vehicle in self.vehicles for each in vehicle.occupants)
        of_others = (each.injury_code for each in self.non_motorists)
        found = {severity_of(code) for code in (self.injury_code, *of_occupants, *of_others)}
        if self.fatalities or self.register == FARS:
            found.add(Severity.KILLED)
        return next((severity for severity in Severity if severity in found), None)

    @property
    def keeps_left(self) -> bool:
        """Return whether traffic keeps left at the place of the crash."""
        return any(vehicle.keeps_left for vehicle in self.vehicles)

    @property
    def moving_vehicles(self) -> int:
        """Return the number of motor vehicles in transport: as stated (``VE_FORMS``), or else as listed."""
        listed = sum(vehicle.in_transport for vehicle in self.vehicles)
        return listed if self.vehicles_in_transport is None else self.vehicles_in_transport

    @property
    def kind(self) -> CrashKind:
        """Return the kind of the crash."""
        codes = [event.code for event in self.events]
        return kind_of_codes(self.first_harmful_event_code, self.moving_vehicles, codes) or CrashKind.OTHER

    @property
    def parties(self) -> Mapping[int, PartyKind]:
        """Return the kind of every party by number: vehicles, persons, then things struck."""
        vehicles = {
            vehicle.number: PartyKind.MOTOR_VEHICLE if vehicle.in_transport else PartyKind.PARKED_VEHICLE
            for vehicle in self.vehicles
        }
        persons = {person.party: person.kind for person in self.non_motorists}
        things = {thing_party(event.number): kind for event in self.events if (kind := thing_struck(event.code))}
        return vehicles | persons | things

    @property
    def first_contact(self) -> EventRecord | None:
        """Return the first event in which two vehicles, or a vehicle and a person, touched.

        None also if an earlier contact does not name both parties, because the first one is then unknown.
        """
        first = next((event for event in self.events if event.kind in _CONTACTS), None)
        return first if first is not None and first.is_contact else None

    @property
    def colliding_vehicles(self) -> tuple[VehicleRecord, VehicleRecord] | None:
        """Return the two vehicles of the first contact of vehicles, or None (see :func:`first_vehicle_contact`)."""
        return colliding_pair(self.vehicles, self.events)


def first_vehicle_contact(events: Sequence[EventRecord]) -> EventRecord | None:
    """Return the first event in which two named vehicles touch.

    None also if an earlier contact in transport does not name its parties, because the first one is then unknown.

    >>> contact = first_vehicle_contact(record.events)
    >>> contact.party_1, contact.party_2  # VNUMBER1, VNUMBER2
    (2, 1)
    """
    for event in events:
        if event.is_vehicle_contact:
            return event
        if event.code == MOTOR_VEHICLE_IN_TRANSPORT:
            return None
    return None


def colliding_pair(
    vehicles: Sequence[VehicleRecord], events: Sequence[EventRecord]
) -> tuple[VehicleRecord, VehicleRecord] | None:
    """Return the two vehicles of the first contact of vehicles, if both are among ``vehicles``."""
    contact = first_vehicle_contact(events)
    by_number: dict[int | None, VehicleRecord] = {vehicle.number: vehicle for vehicle in vehicles}
    if contact is None or not by_number.keys() >= {contact.party_1, contact.party_2}:
        return None
    return by_number[contact.party_1], by_number[contact.party_2]


class Origin(StrEnum):
    """Origins of a record's field."""

    REPORTED = "reported"
    IMPLIED = "implied"
    MISSING = "missing"


_NOT_REPORTED: Final = (None, "", (), PreCrashMovement.UNKNOWN)
_OF_NO_SOURCE: Final = frozenset(
    {
        *("vehicles", "events", "non_motorists", "implied", "contradictions", "ambiguities", "repaired", "summary"),
        *("key", "register", "register_lacks", "attribution", "quotations"),
    }
)
_FIELD_NAMES: Final = {
    part: tuple(each.name for each in fields(part) if each.name not in _OF_NO_SOURCE)
    for part in (CrashRecord, VehicleRecord, EventRecord, NonMotorist)
}


def origins(part: CrashRecord | VehicleRecord | EventRecord | NonMotorist) -> dict[str, Origin]:
    """Return the origin of each field of a crash or a part of it: reported, implied or missing.

    >>> origins(record.vehicles[0])["travel_speed_mps"].value, origins(tree_record)["trafficway_2"].value
    ('reported', 'missing')
    """
    implied: tuple[str, ...] = getattr(part, "implied", ())
    found = {}
    for name in _FIELD_NAMES[type(part)]:
        missing = getattr(part, name) in _NOT_REPORTED
        found[name] = Origin.IMPLIED if name in implied else Origin.MISSING if missing else Origin.REPORTED
    return found
