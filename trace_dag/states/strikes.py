"""The analytic estimator of crashes in which vehicles strike people: hypotheses from one strike or several in order.

The first strike is planned by :mod:`trace_dag.states.striking`. Who is struck again lies where the first strike threw
it: ahead of the first vehicle by the middle of Searle's bounds (SAE 831622), or at the vehicle's side if that struck.
How far exactly does not matter, since the next vehicle comes along that line; how far aside does, so that it is planned
to pass at several distances from the first one's line. A driver whom another one follows is taken to pull over, one who
left by the report to drive on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.crash.strikes import Strike, order_is_told, strikes_of, untold_strike
from trace_dag.errors import Reason, Rejection
from trace_dag.geometry import FloatArray, Pose, gaps_m
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import SimSettings, StateSettings
from trace_dag.states.analytic import build_scene
from trace_dag.states.assemble import AFTER_IMPACT_M, AFTER_IMPACT_S, driven, lane_under, pose_of, rounded
from trace_dag.states.encounters import Party, party
from trace_dag.states.manoeuvres import Option, steepest_slope
from trace_dag.states.paths import LateralShift, Path, shifted
from trace_dag.states.scene import Scene
from trace_dag.states.speeds import SpeedProfile, TravelSpeed, speed_profile
from trace_dag.states.striking import StrikePlan, Walk, best_of_groups, strike_plans, ways_of
from trace_dag.states.types import (
    EstimateCheck,
    EstimatorRun,
    Hypothesis,
    ParticipantState,
    PlannedEvent,
    SpeedSource,
    StateEstimate,
)
from trace_dag.units import GRAVITY_MPS2, bearing_to_clock_h

NAME = "analytic"
VERSION = "2"

_PERSON_FRICTION: Final = SimSettings().person_friction  # estimates do not depend on how they are simulated
_LONGEST_CHAIN_S: Final = 12.0  # from the first strike to the last
_SETTLES_S: Final = 1.0  # after a thrown person has come to rest by the formula
_KEPT_ASIDE: Final = 1.5  # a person's own speed aside by the vehicle's: the throw slows down ahead, hardly aside
_ASIDE_M: Final = 1.6  # so far to either side of where it should lie the person may lie: most of a car's width
_OFF_LANE_M: Final = 2.2  # a vehicle does not pass farther off its lane's centre to strike who lies there
_OFF_SIGMA_M: Final = 1.0
_OTHER_WAY: Final = -1.5  # log-likelihood of the next vehicle coming from another direction than the one before
_PULL_OVER_M: Final = 3.2
_PULL_OVER_G: Final = 0.35  # hard: at the side by the time the vehicle stops, after a reaction and with 0.6 g
_HIGH: Final = frozenset({VehicleClass.TRUCK, VehicleClass.TRACTOR_TRAILER, VehicleClass.BUS})
"""Vehicles that go over who lies between their wheels without touching: they strike with the wheels of one side."""
_TYRE_M: Final = 0.15  # from a vehicle's side to the middle of its tyres
_HIT_AND_RUN_AFTER_S: Final = 12.0
_LATER_S: Final = (0.0, 2.0, 4.0, 6.0, 8.0)  # a slower vehicle comes so much later, else it would be in the way
_COMPANION_M: Final = 0.8  # people struck together walk so far apart
_ROOM_M: Final = 0.2


@dataclass(frozen=True, eq=False)
class _Later:
    """A strike after the first one: the vehicle's way over who lies there, and when."""

    strike: Strike
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


def estimate_strikes(
    record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings
) -> StateEstimate:
    """The ranked hypotheses of a crash with people, best first.

    Raises :class:`Rejection` (``no_feasible_state``) where no way of the vehicle leads it to the person as reported.
    """
    strikes = strikes_of(record)
    if not strikes:
        raise Rejection(Reason.NO_FEASIBLE_STATE, untold_strike(record) or "no strike of a person in the record")
    chained = any(each.vehicle is not strikes[0].vehicle for each in strikes)
    lead_s = settings.lead_time_s
    scene = build_scene(record, network, report, lead_time_s=lead_s + (_LONGEST_CHAIN_S if chained else 0.0))
    orders = [strikes] if order_is_told(record) or not chained else [strikes, tuple(reversed(strikes))]
    found: list[tuple[float, Hypothesis]] = []
    examined = 0
    for order in orders:
        plans = best_of_groups(strike_plans(scene, order[0]))
        examined += len(plans)
        kept = 0
        for plan in plans:
            built = list(_hypotheses(scene, plan, order[1:], lead_s))
            found += [(hypothesis.score, hypothesis) for hypothesis in built]
            kept += bool(built)
            if kept == settings.max_hypotheses:
                break
    if not found:
        raise Rejection(Reason.NO_FEASIBLE_STATE, _why_not(scene, examined), measured=examined)
    hypotheses = [hypothesis for _, hypothesis in sorted(found, key=lambda each: (-each[0], each[1].name))]
    total = sum(math.exp(max(each.score - hypotheses[0].score, -50.0)) for each in hypotheses)
    return StateEstimate(
        record.key, tuple(hypotheses), EstimatorRun(NAME, VERSION), round(1.0 - 1.0 / max(total, 1.0), 6)
    )


def _why_not(scene: Scene, examined: int) -> str:
    if not scene.streams:
        return "no lane of the map passes the crash"
    return (
        f"{len(scene.streams)} ways past the crash and {examined} plans examined, in none of which the vehicle strikes "
        "the person as reported"
    )


# --- hypotheses ------------------------------------------------------------------------------------------------------
def _hypotheses(scene: Scene, plan: StrikePlan, rest: Sequence[Strike], lead_s: float) -> Iterator[Hypothesis]:
    """The hypotheses of one plan of the first strike: one, or one for each way a later vehicle passes over who lies
    there."""
    together = [strike for strike in rest if strike.vehicle is plan.strike.vehicle]
    later = [strike for strike in rest if strike.vehicle is not plan.strike.vehicle]
    people = [plan.walk, *_companions(plan, together)]
    thrown = _thrown(plan, lead_s)
    for left_m in thrown.aside_m if later else (0.0,):
        for later_s in _LATER_S if later else (0.0,):
            chain = _chain(scene, plan, later, lead_s, thrown, left_m, later_s)
            if chain is None:
                break
            hypothesis = _hypothesis(scene, plan, people, together, chain, lead_s)
            if all(check.passed for check in hypothesis.checks if check.name in _ESSENTIAL):
                yield hypothesis
                break


_ESSENTIAL: Final = frozenset({"no earlier contact", "nobody in the way"})


def _companions(plan: StrikePlan, together: Sequence[Strike]) -> list[Walk]:
    """Others struck by the same vehicle: beside the first one, as far apart as people walk."""
    found = []
    others = {strike.person.party: strike for strike in together if strike.person.party != plan.strike.person.party}
    for place, strike in enumerate(others.values(), 1):
        walk = plan.walk
        ahead = walk.pose.to_world(np.array([-_COMPANION_M * place, 0.0]))
        pose = Pose(float(ahead[0]), float(ahead[1]), walk.pose.heading_rad, walk.pose.z_m)
        found.append(replace(walk, person=strike.person, station_m=walk.station_m - _COMPANION_M * place, pose=pose))
    return found


def _hypothesis(
    scene: Scene,
    plan: StrikePlan,
    people: Sequence[Walk],
    together: Sequence[Strike],
    chain: Sequence[_Later],
    lead_s: float,
) -> Hypothesis:
    drive = plan.drive
    path = _pulling_over(plan) if chain and not drive.party.vehicle.hit_and_run else drive.path
    states = [
        _driven(scene, drive.party, drive.option, path, drive.station_m, drive.speed, drive.profile, lead_s, plan)
    ]
    states += [_walked(scene, walk, lead_s) for walk in people]
    states += [
        _driven(scene, each.who, each.option, each.path, each.station_m, each.speed, each.profile, each.time_s, None)
        for each in chain
    ]
    participants = tuple(sorted(states, key=lambda state: state.vehicle_number))
    first = _rounded_xy(plan.contact_xy_m)
    planned = [PlannedEvent(plan.strike.event_number, *plan.strike.pair, lead_s, first)]
    planned += [PlannedEvent(strike.event_number, *strike.pair, lead_s, first) for strike in together]
    planned += [
        PlannedEvent(each.strike.event_number, *each.strike.pair, round(each.time_s, 6), _rounded_xy(each.lies_at))
        for each in chain
    ]
    terms = dict(plan.terms)
    for each in chain:
        terms[f"way of the next vehicle (vehicle {each.who.vehicle.number})"] = each.score
    return Hypothesis(
        name="; ".join([plan.name, *(each.name for each in chain)]),
        score=round(sum(terms.values()), 6),
        evidence={name: round(value, 6) for name, value in sorted(terms.items())},
        participants=participants,
        impact_time_s=lead_s,
        impact_point_xy_m=first,
        checks=_checks(plan, participants, chain, lead_s),
        planned=tuple(planned),
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
    plan: StrikePlan | None,
) -> ParticipantState:
    vehicle = who.vehicle
    drives_on = bool(vehicle.hit_and_run)
    after_s = _HIT_AND_RUN_AFTER_S if drives_on else max(AFTER_IMPACT_S, AFTER_IMPACT_M / max(profile.impact_mps, 2.5))
    state = driven(scene.network, vehicle, option, path, station_m, speed, profile, lead_time_s=lead_s, after_s=after_s)
    clock_h = None
    if plan is not None:
        ahead, left = _in_axes(state.impact_pose, plan.contact_xy_m)
        clock_h = round(bearing_to_clock_h(math.atan2(left / vehicle.width_m, ahead / vehicle.length_m)), 3)
    return replace(state, impact_clock_h=clock_h, drives_on=drives_on)


def _in_axes(pose: Pose, xy_m: tuple[float, float]) -> tuple[float, float]:
    """A point in a pose's axes: ahead and left, metres."""
    ahead, left = pose.to_body(np.array(xy_m))
    return float(ahead), float(left)


def _walked(scene: Scene, walk: Walk, lead_s: float) -> ParticipantState:
    time, _, _ = SpeedProfile(walk.speed_mps, walk.speed_mps).sample(lead_s, AFTER_IMPACT_S)
    until = lead_s - time
    stations = walk.along_m(until)
    x, y, z, heading = walk.path.at(stations)
    moving = walk.speed_mps * until < walk.set_off_m
    speeds = np.where(moving, walk.speed_mps, 0.0)
    trajectory = rounded(time, x, y, z, heading, speeds)
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


def _pulling_over(plan: StrikePlan) -> Path:
    """The path of a driver who stops at the side after the strike."""
    drive = plan.drive
    speed_mps = max(drive.profile.impact_mps, 7.0)
    lateral = _PULL_OVER_G * GRAVITY_MPS2
    slope = steepest_slope(_PULL_OVER_M, speed_mps, lateral)
    ramp_m = min(max(1.5 * slope * speed_mps**2 / lateral, 4.0), _PULL_OVER_M / slope)
    shift = LateralShift(-_PULL_OVER_M, 0.0, slope, ramp_m)
    return shifted(drive.path, shift, anchor_s_m=drive.station_m + 2.0)


# --- strikes after the first -----------------------------------------------------------------------------------------
def _chain(
    scene: Scene,
    plan: StrikePlan,
    later: Sequence[Strike],
    lead_s: float,
    thrown: _Thrown,
    left_m: float,
    later_s: float,
) -> list[_Later] | None:
    """The strikes after the first, so far to the left of the first vehicle's line and so much later than at once; None
    where no way of a vehicle leads there in time."""
    at_s = thrown.at_rest_s + later_s
    lies_at = thrown.ahead_xy_m + left_m * thrown.left
    course = plan.drive.pose.heading_rad
    chain: list[_Later] = []
    for strike in later:
        found = _next_way(scene, strike, lies_at, course, at_s)
        if found is None or at_s > lead_s + _LONGEST_CHAIN_S:
            return None
        chain.append(replace(found, name=f"{found.name}, {left_m:+.1f} m to the left"))
        at_s = found.time_s + found.profile.impact_mps / (_PERSON_FRICTION * GRAVITY_MPS2) + _SETTLES_S
    return chain


@dataclass(frozen=True, eq=False)
class _Thrown:
    """Where a struck person comes to lie if it is thrown straight ahead, the unit vector to the left of that, when, and
    how far to the left it may lie instead."""

    ahead_xy_m: FloatArray
    left: FloatArray
    at_rest_s: float
    aside_m: tuple[float, ...]


def _thrown(plan: StrikePlan, lead_s: float) -> _Thrown:
    """Where the person comes to lie: ahead by the middle of Searle's bounds; aside by what it keeps of its own motion,
    by half of that or nothing, and a step further. Whom the side of a vehicle strikes is pushed off it, not taken
    along."""
    drive, walk = plan.drive, plan.walk
    grip = _PERSON_FRICTION * GRAVITY_MPS2
    ahead = -drive.pose.forward if drive.option.backing else drive.pose.forward
    left = np.array([-ahead[1], ahead[0]])
    if plan.at_side:
        off_m = math.copysign(_ASIDE_M, float((walk.pose.xy_m - drive.pose.xy_m) @ left))
        return _Thrown(walk.pose.xy_m, left, lead_s + _SETTLES_S, (off_m, 0.0, off_m / 2, 1.5 * off_m))
    speed = max(drive.profile.impact_mps, 0.1)
    distance = speed**2 / (2 * grip) * (1 + _PERSON_FRICTION**2 / 2)
    kept_m = distance * _KEPT_ASIDE * float(walk.speed_mps * walk.pose.forward @ left) / speed
    step_m = math.copysign(_ASIDE_M, kept_m)
    aside = (kept_m, kept_m / 2, 0.0, kept_m + step_m) if abs(kept_m) > _ASIDE_M else (kept_m, -step_m, 2 * step_m)
    at_rest_s = lead_s + speed / grip + _SETTLES_S
    return _Thrown(np.asarray(walk.pose.xy_m + distance * ahead), left, at_rest_s, aside)


def _next_way(scene: Scene, strike: Strike, lies_at: FloatArray, course_rad: float, at_s: float) -> _Later | None:
    """The likeliest way of the next vehicle over who lies there."""
    who = party(scene.record, strike.vehicle)
    best: _Later | None = None
    for option, speed, terms in ways_of(scene, who):
        profile = speed_profile(who.vehicle, speed.speed_mps)
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
        score = sum(terms.values()) - 0.5 * (off / _OFF_SIGMA_M) ** 2 + (_OTHER_WAY if other_way else 0.0)
        if best is None or round(score, 6) > round(best.score, 6):
            over = shifted(path, None, anchor_s_m=station, constant_m=off)
            station = over.project(float(lies_at[0]), float(lies_at[1]))[0] - who.vehicle.length_m / 2
            name = f"vehicle {who.vehicle.number}: {option.name}"
            best = _Later(strike, who, option, over, station, speed, profile, at_s, lies_at, score, name)
    return best


# --- checks ----------------------------------------------------------------------------------------------------------
def _checks(
    plan: StrikePlan, participants: Sequence[ParticipantState], chain: Sequence[_Later], lead_s: float
) -> tuple[EstimateCheck, ...]:
    states = {state.vehicle_number: state for state in participants}
    vehicle, person = (states[number] for number in plan.strike.pair)
    before = _least_gap_m(vehicle, person, lead_s - 0.05)
    checks = [EstimateCheck("no earlier contact", before > 0, f"least gap before the strike {before:.3f} m")]
    for each in chain:
        follower = states[each.who.vehicle.number]
        gap = min(_least_gap_m(follower, vehicle, lead_s), _least_gap_m(follower, person, lead_s))
        checks.append(
            EstimateCheck("nobody in the way", gap > _ROOM_M, f"least gap up to the first strike {gap:.2f} m")
        )
    return tuple(checks)


def _least_gap_m(one: ParticipantState, two: ParticipantState, until_s: float) -> float:
    """Least gap between two planned motions from the beginning to a time."""
    time = np.arange(0.0, max(until_s, 0.02), 0.02)

    def at(state: ParticipantState) -> tuple[FloatArray, FloatArray, FloatArray]:
        t = state.trajectory
        x, y, heading = (np.interp(time, t.time_s, values) for values in (t.x_m, t.y_m, np.unwrap(t.heading_rad)))
        return x, y, heading

    return float(gaps_m(at(one), (one.length_m, one.width_m), at(two), (two.length_m, two.width_m)).min())
