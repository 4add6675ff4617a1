"""Parties of strikes on people: the first strike's vehicle and people, and vehicles that come later.

The first strike is planned by :mod:`trace_dag.reconstruction.planners.pedestrian_impact.planner`. A simulator finds
where the people are thrown, see :mod:`trace_dag.reconstruction.planners.pedestrian`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import LateralShift, Path, shifted, straight
from trace_dag.common.units import GRAVITY_MPS2, bearing_to_clock_h
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import NonMotorist, VehicleClass
from trace_dag.reconstruction.assemble import (
    AFTER_IMPACT_M,
    AFTER_IMPACT_S,
    drive_along,
    lane_under,
    pose_of,
    round_trajectory,
)
from trace_dag.reconstruction.motion.contact import Shape, shape_gaps_m, shapes
from trace_dag.reconstruction.motion.manoeuvres import Option, steepest_slope
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.motion.walking_directions import Course, CourseReading
from trace_dag.reconstruction.motion.walking_speeds import Gait
from trace_dag.reconstruction.planners.pedestrian_impact.planner import (
    ImpactPlan,
    Walk,
    approaches_of,
    person_kind_of,
    size_of,
)
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.simulation.states import (
    EstimateCheck,
    Hypothesis,
    ParticipantState,
    PlannedEvent,
    SpeedSource,
)

_OFF_LANE_M: Final = 2.2  # farthest off its lane's centre that a vehicle strikes a person who lies there
_OFF_SIGMA_M: Final = 1.0
_OTHER_WAY: Final = -1.5  # log-likelihood that the next vehicle comes from another direction than the one before
_PULL_OVER_M: Final = 3.2
_PULL_OVER_G: Final = 0.35  # hard: it is at the side when the vehicle stops, after a reaction and with 0.6 g
_HIGH: Final = frozenset({VehicleClass.TRUCK, VehicleClass.TRACTOR_TRAILER, VehicleClass.BUS})
"""Vehicles that go over who lies between their wheels without touching: they strike with the wheels of one side."""
_TYRE_M: Final = 0.15  # from a vehicle's side to the middle of its tyres
_HIT_AND_RUN_AFTER_S: Final = 12.0
_COMPANION_M: Final = 0.8  # how far apart people walk who are struck together
ROOM_M: Final = 0.2
"""Least gap up to the first strike between a later vehicle and who is there: nearer it would be in the way."""


@dataclass(frozen=True, eq=False)
class LaterImpact:
    """A strike after the first one: the vehicle's way over a person who lies there, and the time."""

    strike: CrashEvent
    who: Party
    option: Option
    path: Path
    station_m: float
    speed: TravelSpeed
    profile: SpeedProfile
    time_s: float
    lies_at: FloatArray
    score: float
    name: str


# --- hypotheses ------------------------------------------------------------------------------------------------------
def _companions(plan: ImpactPlan, together: Sequence[CrashEvent]) -> list[Walk]:
    """Return others struck by the same vehicle: beside the first person, as far apart as people walk."""
    found = []
    others = {strike.person.party: strike for strike in together if strike.person.party != plan.strike.person.party}
    for place, strike in enumerate(others.values(), 1):
        walk = plan.walk
        ahead = walk.pose.to_world(np.array([-_COMPANION_M * place, 0.0]))
        pose = Pose(float(ahead[0]), float(ahead[1]), walk.pose.heading_rad, walk.pose.z_m)
        found.append(replace(walk, person=strike.person, station_m=walk.station_m - _COMPANION_M * place, pose=pose))
    return found


def first_states(
    scene: Scene, plan: ImpactPlan, together: Sequence[CrashEvent], lead_s: float, *, pulls_over: bool
) -> list[ParticipantState]:
    """Return the parties of the first strike, ``lead_s`` after the beginning: the vehicle and the people it strikes.

    Its driver may pull over afterwards; a driver who left, by the report, drives on.

    >>> vehicle, person = first_states(pedestrian_scene, strike_plan, [], 5.0, pulls_over=False)
    >>> vehicle.vehicle_number, person.vehicle_number, person.kind.value  # people have the numbers from 1001
    (1, 1001, 'pedestrian')
    """
    drive = plan.drive
    path = _pulling_over(plan) if pulls_over and not drive.party.vehicle.hit_and_run else drive.path
    driver = _driven(scene, drive.party, drive.option, path, drive.station_m, drive.speed, drive.profile, lead_s, plan)
    return [driver, *(_walked(scene, walk, lead_s) for walk in (plan.walk, *_companions(plan, together)))]


def later_state(scene: Scene, later: LaterImpact) -> ParticipantState:
    """Return the vehicle of a later strike."""
    way = later.option, later.path, later.station_m, later.speed, later.profile
    return _driven(scene, later.who, *way, later.time_s, None)


def impact_hypothesis(
    plan: ImpactPlan, states: Sequence[ParticipantState], together: Sequence[CrashEvent], lead_s: float
) -> Hypothesis:
    """Return the hypothesis made of the first strike's plan, and other strikes by the same vehicle with it.

    >>> states = first_states(pedestrian_scene, strike_plan, [], 5.0, pulls_over=False)
    >>> made = impact_hypothesis(strike_plan, states, [], 5.0)
    >>> made.impact_time_s, made.name == strike_plan.name
    (5.0, True)
    """
    first = _rounded_xy(plan.contact_xy_m)
    vehicle, person = (next(s for s in states if s.vehicle_number == number) for number in plan.strike.pair)
    before_m = least_gap_m(vehicle, person, lead_s - 0.05)
    return Hypothesis(
        name=plan.name,
        score=round(math.fsum(plan.terms.values()), 6),
        evidence={name: round(value, 6) for name, value in sorted(plan.terms.items())},
        participants=tuple(sorted(states, key=lambda state: state.vehicle_number)),
        impact_time_s=lead_s,
        impact_point_xy_m=first,
        checks=(EstimateCheck("no earlier contact", before_m > 0, f"least gap before the strike {before_m:.3f} m"),),
        planned=tuple(PlannedEvent(each.number, *each.pair, lead_s, first) for each in (plan.strike, *together)),
    )


def _rounded_xy(xy_m: Sequence[float] | FloatArray) -> tuple[float, float]:
    return round(float(xy_m[0]), 6), round(float(xy_m[1]), 6)


def _driven(
    scene: Scene,
    who: Party,
    option: Option,
    path: Path,
    station_m: float,
    speed: TravelSpeed,
    profile: SpeedProfile,
    lead_s: float,
    plan: ImpactPlan | None,
) -> ParticipantState:
    vehicle = who.vehicle
    drives_on = bool(vehicle.hit_and_run)
    after_s = _HIT_AND_RUN_AFTER_S if drives_on else max(AFTER_IMPACT_S, AFTER_IMPACT_M / max(profile.impact_mps, 2.5))
    state = drive_along(
        scene.network, vehicle, option, path, station_m, speed, profile, lead_time_s=lead_s, after_s=after_s
    )
    clock_h = None
    if plan is not None:
        middle, length_m, width_m = vehicle.clock_body(state.impact_pose)
        ahead, left = _in_axes(middle, plan.contact_xy_m)
        clock_h = round(bearing_to_clock_h(math.atan2(left / width_m, ahead / length_m)), 3)
    return replace(state, impact_clock_h=clock_h, drives_on=drives_on)


def _in_axes(pose: Pose, xy_m: tuple[float, float]) -> tuple[float, float]:
    """Return a point in the axes of a pose: metres ahead and to the left."""
    ahead, left = pose.to_body(np.array(xy_m))
    return float(ahead), float(left)


def _walked(scene: Scene, walk: Walk, lead_s: float) -> ParticipantState:
    time, _, _ = SpeedProfile(walk.speed_mps, walk.speed_mps).sample(lead_s, AFTER_IMPACT_S)
    until = lead_s - time
    stations = walk.along_m(until)
    x, y, z, heading = walk.path.at(stations)
    moving = walk.speed_mps * until < walk.set_off_m
    speeds = np.where(moving, walk.speed_mps, 0.0)
    trajectory = round_trajectory(time, x, y, z, heading, speeds)
    at = int(np.argmin(np.abs(trajectory.time_s - lead_s)))
    start, strike = pose_of(trajectory, 0), pose_of(trajectory, at)
    return ParticipantState(
        vehicle_number=walk.person.party,
        vehicle_class=VehicleClass.OTHER,
        length_m=round(walk.size.length_m, 6),
        width_m=round(walk.size.width_m, 6),
        height_m=round(walk.size.stature_m, 6),
        mass_kg=round(walk.size.mass_kg, 6),
        manoeuvre=walk.manoeuvre,
        initial_pose=start,
        initial_speed_mps=float(trajectory.speed_mps[0]),
        impact_pose=strike,
        impact_speed_mps=float(trajectory.speed_mps[at]),
        speed_source=SpeedSource.INFERRED_GAIT,
        trajectory=trajectory,
        initial_lane=lane_under(scene.network, start),
        impact_lane=lane_under(scene.network, strike),
        kind=walk.kind,
    )


def standing_person(
    scene: Scene, person: NonMotorist, touched_xy_m: FloatArray, outward_rad: float, z_m: float
) -> ParticipantState:
    """Return a standing person or animal that a vehicle touches at a place with a given outward normal."""
    kind = person_kind_of(person)
    size = size_of(person, kind)
    heading = math.remainder(outward_rad + math.pi / 2, math.tau)  # faces across the way of who comes
    x, y = touched_xy_m + size.width_m / 2 * np.array([math.cos(outward_rad), math.sin(outward_rad)])
    pose = Pose(float(x), float(y), heading, z_m)
    reading = CourseReading(Course.STANDING, 0.0, told=False)
    path = straight(pose, back_m=1.0, ahead_m=1.0)
    return _walked(scene, Walk(person, kind, size, reading, Gait.STANDING, path, 1.0, pose, 0.0), AFTER_IMPACT_S)


def _pulling_over(plan: ImpactPlan) -> Path:
    """Return the path of a driver who stops at the side after the strike."""
    drive = plan.drive
    speed_mps = max(drive.profile.impact_mps, 7.0)
    lateral = _PULL_OVER_G * GRAVITY_MPS2
    slope = steepest_slope(_PULL_OVER_M, speed_mps, lateral)
    ramp_m = min(max(1.5 * slope * speed_mps**2 / lateral, 4.0), _PULL_OVER_M / slope)
    shift = LateralShift(-_PULL_OVER_M, 0.0, slope, ramp_m)
    return shifted(drive.path, shift, anchor_s_m=drive.station_m + 2.0)


# --- strikes after the first -----------------------------------------------------------------------------------------
def next_way(
    scene: Scene, strike: CrashEvent, lies_at: FloatArray, course_rad: float, at_s: float
) -> LaterImpact | None:
    """Return the likeliest way of the next vehicle over the person who lies there.

    >>> way = next_way(pedestrian_scene, strike_plan.strike, np.array(strike_plan.contact_xy_m), 0.0, 9.0)
    >>> way.time_s, way.name.startswith("vehicle 1")
    (9.0, True)
    >>> next_way(pedestrian_scene, strike_plan.strike, np.array([500.0, 500.0]), 0.0, 9.0) is None  # no road is there
    True
    """
    who = party(scene.record, strike.vehicle)
    best: LaterImpact | None = None
    for option, speed, terms in approaches_of(scene, who):
        profile = speed_profile(who, speed.speed_mps)
        if profile.impact_mps < 1.0:
            continue
        path = option.path()
        station, off = path.project(float(lies_at[0]), float(lies_at[1]))
        if strike.vehicle.vehicle_class in _HIGH:
            off -= math.copysign(strike.vehicle.width_m / 2 - _TYRE_M, off)
        if abs(off) > _OFF_LANE_M:
            continue
        heading = path.pose(station).heading_rad
        other_way = abs(math.remainder(heading - course_rad, math.tau)) > math.radians(60)
        score = math.fsum(terms.values()) - 0.5 * (off / _OFF_SIGMA_M) ** 2 + (_OTHER_WAY if other_way else 0.0)
        if best is None or round(score, 6) > round(best.score, 6):
            over = shifted(path, None, anchor_s_m=station, constant_m=off)
            station = over.project(float(lies_at[0]), float(lies_at[1]))[0] - who.vehicle.length_m / 2
            name = f"vehicle {who.vehicle.number}: {option.name}"
            best = LaterImpact(strike, who, option, over, station, speed, profile, at_s, lies_at, score, name)
    return best


def least_gap_m(one: ParticipantState, two: ParticipantState, until_s: float) -> float:
    """Return the least gap between two planned motions from the beginning to a time."""
    time = np.arange(0.0, max(until_s, 0.02), 0.02)

    def at(state: ParticipantState) -> tuple[Shape, ...]:
        t, trailing = state.trajectory, state.trailer_heading_rad
        x, y, heading = (np.interp(time, t.time_s, values) for values in (t.x_m, t.y_m, np.unwrap(t.heading_rad)))
        behind = None if trailing is None else np.interp(time, t.time_s, trailing)
        return shapes((x, y, heading), (state.length_m, state.width_m), state.trailer, behind)

    return float(shape_gaps_m(at(one), at(two)).min())
