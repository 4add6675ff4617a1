"""One vehicle strikes one person or animal: every way the vehicle can have come, with every course of the person.

The vehicle's pose at the strike follows from the area that struck the person, the way that the vehicle came, and the
reported place. The person is then at that spot of the vehicle, and both motions are followed backward from there.
Frame: the local frame; stations along the vehicle's path."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, body_bearing_rad
from trace_dag.common.paths import Path, shifted, straight
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.event_parties import StruckAnimal
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import NonMotorist
from trace_dag.crash.zones import Zone, reported_zones
from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.assemble import Drive
from trace_dag.reconstruction.motion.contact import ContactPoint
from trace_dag.reconstruction.motion.manoeuvres import Option, drift
from trace_dag.reconstruction.motion.solver import TURN_SLIDE_SIGMA_M
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import TravelSpeed
from trace_dag.reconstruction.motion.walking import (
    COMPASS_DEG,
    CROSSING,
    RELATIVE_DEG,
    Course,
    CourseReading,
    Gait,
    gait_of,
    readings,
    usual_speed_mps,
)
from trace_dag.reconstruction.planners.impact_point import (
    Crosswalks,
    contact_point_of,
    crosswalks_of,
    is_far_side,
    place_impact,
)
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.ranking import Scored
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.simulation.body_sizes import SIZES, PersonSize, person_size
from trace_dag.simulation.states import Manoeuvre

_COMPASS_RAD: Final = math.radians(45)  # a coded direction is a quarter of the compass
_BEYOND_EDGE_M: Final = {Zone.BESIDE: 0.6, Zone.WALKED: 2.0, Zone.OUTSIDE: 4.0}
"""Distances of a person beyond the carriageway's edge: the middle of a narrow shoulder, of a sidewalk
behind its curb, beside both."""
_OUTWARD: Final = (Zone.BESIDE, Zone.WALKED, Zone.OUTSIDE)
DRIFT_G: Final = 0.08  # of a driver who drifts off the lane
_DASH_BEYOND_M: Final = 0.8  # who crosses starts this far beyond the edge
_AS_THEY_ARE: Final = frozenset({PartyKind.CYCLIST, PartyKind.CONVEYANCE, PartyKind.ANIMAL})
MANOEUVRES: Final = {
    Course.FROM_LEFT: Manoeuvre.CROSS_FROM_LEFT,
    Course.FROM_RIGHT: Manoeuvre.CROSS_FROM_RIGHT,
    Course.ALONG: Manoeuvre.GO_ALONG,
    Course.TOWARDS: Manoeuvre.COME_TOWARDS,
    Course.STANDING: Manoeuvre.STAND,
}


@dataclass(frozen=True, eq=False)
class Walk:
    """The person's part: path, station and pose at the strike, speed, and distance walked before it."""

    person: NonMotorist
    kind: PartyKind
    size: PersonSize
    reading: CourseReading
    gait: Gait
    path: Path
    station_m: float
    pose: Pose
    speed_mps: float
    set_off_m: float = math.inf

    @property
    def manoeuvre(self) -> Manoeuvre:
        """Return the course as a manoeuvre."""
        return MANOEUVRES[self.reading.course]

    def along_m(self, until_s: FloatArray) -> FloatArray:
        """Return stations at times before the strike (negative after it)."""
        return np.asarray(self.station_m - np.minimum(self.speed_mps * until_s, self.set_off_m))


@dataclass(frozen=True, eq=False)
class ImpactPlan(Scored):
    """One possible course of a strike. ``terms`` are log-likelihoods."""

    strike: CrashEvent
    drive: Drive
    walk: Walk
    contact_xy_m: tuple[float, float]
    terms: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Return a name that is unique among the plans of the crash."""
        person = self.strike.person
        who = person.species if isinstance(person, StruckAnimal) else f"person {person.number}"
        return (
            f"vehicle {self.strike.vehicle.number}: {self.drive.option.name}; {who}: "
            f"{self.walk.manoeuvre}, {self.walk.gait}"
        )

    @property
    def group(self) -> tuple[int, str, str]:
        """Return the group; plans of one group differ only in detail."""
        option = self.drive.option
        return option.approach.side, option.manoeuvre.value, self.walk.reading.course.value


def person_kind_of(person: NonMotorist) -> PartyKind:
    """Return the kind of the person's figure: on foot, unless the report names a mount."""
    return person.kind if person.kind in _AS_THEY_ARE else PartyKind.PEDESTRIAN


def impact_plans(scene: Scene, strike: CrashEvent) -> list[ImpactPlan]:
    """Return all possible plans of the strike, likeliest first.

    >>> plans = impact_plans(pedestrian_scene, strike_plan.strike)
    >>> plans[0].walk.manoeuvre.value, plans[0].score == max(plan.score for plan in plans)
    ('cross_from_left', True)
    """
    who = party(scene.record, strike.vehicle)
    courses = readings(strike.person, who.turn, strike.area, keeps_left=who.vehicle.keeps_left)
    crosswalks = crosswalks_of(scene, strike.person)
    found = []
    for option, speed, terms in approaches_of(scene, who):
        for reading in courses:
            plan = _plan(scene, strike, who, option, speed, terms, reading, crosswalks)
            if plan is not None:
                found.append(plan)
    return sorted(found, key=lambda plan: (-plan.score, plan.name))


def _plan(
    scene: Scene,
    strike: CrashEvent,
    who: Party,
    option: Option,
    speed: TravelSpeed,
    terms: dict[str, float],
    reading: CourseReading,
    crosswalks: Crosswalks | None,
) -> ImpactPlan | None:
    person = strike.person
    gait = Gait.STANDING if reading.course is Course.STANDING else gait_of(person)
    speed_mps = usual_speed_mps(person, gait)
    profile = speed_profile(who, speed.speed_mps)
    point = contact_point_of(strike, option, profile.impact_mps, reading.course, speed_mps)
    if point is None:
        return None
    option, path = _onto_person(scene, strike, option, point)
    path, station_m, slid_m = place_impact(scene, path, option, point, is_far_side(person, option), crosswalks)
    drive = Drive(who, option, path, station_m, speed, profile)
    walk = _walk(scene, drive, point, reading, gait, speed_mps, person)
    contact = drive.pose.to_world(np.array([point.ahead_m, point.left_m]))
    contact_xy_m = (float(contact[0]), float(contact[1]))
    terms = terms | {"course of the person": reading.log_prior} | _contact_terms(scene, strike, drive, contact_xy_m)
    if person.heading is not None and reading.course is not Course.STANDING:
        walked = evidence.heading_log_likelihood(person.heading, walk.pose.heading_rad)
        terms["reported direction of the person"] = walked
    if crosswalks is not None:
        terms["crosswalk"] = float(crosswalks.log_likelihood(np.array(contact[0]), np.array(contact[1])))
    if slid_m:
        terms[f"place of the turn (vehicle {who.vehicle.number})"] = -0.5 * (slid_m / TURN_SLIDE_SIGMA_M) ** 2
    return ImpactPlan(strike, drive, walk, contact_xy_m, terms)


# --- the way of the vehicle ------------------------------------------------------------------------------------------
def _onto_person(scene: Scene, strike: CrashEvent, option: Option, point: ContactPoint) -> tuple[Option, Path]:
    """Return the vehicle's path: along its lanes, or off the carriageway if the person was not on it."""
    zones = reported_zones(scene.record, strike.person)
    if not zones and strike.side in (DepartureSide.LEFT, DepartureSide.RIGHT):
        zones = frozenset({Zone.BESIDE})
    zone = next((each for each in _OUTWARD if each in zones), None)
    if zone is None or Zone.CARRIAGEWAY in zones or option.turn is not None or option.backing:
        return option, option.path()
    side = 1.0 if strike.side is DepartureSide.LEFT else -1.0
    here = option.approach.path.pose(option.station_m)
    person_m = side * (scene.network.drivable_area.edge_beside_m(here, side) + _BEYOND_EDGE_M[zone])
    off_m = person_m - point.left_m
    if off_m * side <= 0:
        return option, option.path()
    moved = replace(option, manoeuvre=Manoeuvre.LEAVE_ROAD, shift=drift(off_m, option.speed_mps, DRIFT_G))
    return moved, moved.path()


# --- the way of the person -------------------------------------------------------------------------------------------
def _walk(
    scene: Scene,
    drive: Drive,
    point: ContactPoint,
    reading: CourseReading,
    gait: Gait,
    speed_mps: float,
    person: NonMotorist,
) -> Walk:
    kind = person_kind_of(person)
    size = size_of(person, kind)
    heading = _heading(drive, reading.course, person)
    angle = heading - drive.pose.heading_rad
    half = np.array([size.length_m, size.width_m]) / 2
    reach = np.abs([[math.cos(angle), math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ half
    centre = np.array([point.ahead_m, point.left_m]) + np.array(point.normal) * reach
    x, y = drive.pose.to_world(centre)
    pose = Pose(float(x), float(y), math.remainder(heading, math.tau), drive.pose.z_m)
    path, station = _line(drive, pose, reading.course)
    set_off = math.inf
    if reading.course in CROSSING:  # from the edge of the road on: who waits there does not walk out of a lane
        back = Pose(pose.x_m, pose.y_m, pose.heading_rad + math.pi / 2)
        from_m = scene.network.drivable_area.edge_beside_m(back, 1.0)
        set_off = from_m + _DASH_BEYOND_M if from_m else math.inf
    return Walk(person, kind, size, reading, gait, path, station, path.pose(station), speed_mps, set_off)


def size_of(person: NonMotorist, kind: PartyKind) -> PersonSize:
    """Return dimensions and mass: of a person by age and sex, of an animal by its species."""
    if isinstance(person, StruckAnimal):
        return SIZES[person.species]
    return person_size(kind, person.age_years, female={1: False, 2: True}.get(person.sex_code or 0))


def _heading(drive: Drive, course: Course, person: NonMotorist) -> float:
    """Return the heading of the person at the strike.

    A crossing is at a right angle to the road. If the vehicle turns, that is the road it came from or the road it
    enters, whichever the person crossed.
    """
    backing = math.pi if drive.option.backing else 0.0
    if course is Course.STANDING:
        return drive.pose.heading_rad + math.pi / 2
    if drive.option.turn is None:
        return drive.pose.heading_rad + backing + math.radians(RELATIVE_DEG[course])
    approach = drive.option.approach
    road = approach.path.pose(max(drive.option.turn_start_m - 1.0, 0.0)).heading_rad
    if is_far_side(person, drive.option):
        road += drive.option.turn.angle_rad
    return road + math.radians(RELATIVE_DEG[course])


def _line(drive: Drive, pose: Pose, course: Course) -> tuple[Path, float]:
    """Return the path of the person, straight across or along the road, and the station of the strike on it."""
    back_m = 60.0
    if course in (Course.ALONG, Course.TOWARDS) and drive.option.turn is None and not drive.option.backing:
        base = drive.option.approach.path
        station, offset = base.project(pose.x_m, pose.y_m, near_s_m=drive.option.station_m)
        line = shifted(base, None, anchor_s_m=station, constant_m=offset)
        if course is Course.TOWARDS:
            line = line.reversed()
        return line, line.project(pose.x_m, pose.y_m)[0]
    return straight(pose, back_m=back_m, ahead_m=back_m), back_m


# --- evidence ----------------------------------------------------------------------------------------------
def _contact_terms(
    scene: Scene, strike: CrashEvent, drive: Drive, contact_xy_m: tuple[float, float]
) -> dict[str, float]:
    x, y = contact_xy_m[0] - scene.place_xy_m[0], contact_xy_m[1] - scene.place_xy_m[1]
    along, across = drive.option.approach.path.pose(drive.station_m).forward @ np.array([x, y]), 0.0
    if drive.option.manoeuvre is not Manoeuvre.LEAVE_ROAD:
        across = math.sqrt(max(x * x + y * y - float(along) ** 2, 0.0))
    terms = {
        "place of the impact": float(
            evidence.place_log_likelihood(scene.record, np.array(math.hypot(float(along), across)))
        )
    }
    vehicle = replace(strike.vehicle, impact=strike.area)
    bearing = body_bearing_rad(*vehicle.clock_body(drive.pose), np.array(contact_xy_m))
    if strike.area is not None:
        area = float(evidence.impact_area_log_likelihood(vehicle, np.array([bearing]))[0])
        terms[f"impact area (vehicle {vehicle.number})"] = area
    motorist = COMPASS_DEG.get(strike.person.motorist_direction_code or 0)
    if motorist is not None:
        went = drive.option.approach.heading_rad + (math.pi if drive.option.backing else 0.0)
        apart = abs(math.remainder(went - math.radians(motorist), math.tau))
        terms["compass direction of the motorist"] = -0.5 * (max(apart - _COMPASS_RAD, 0.0) / (_COMPASS_RAD / 2)) ** 2
    return terms
