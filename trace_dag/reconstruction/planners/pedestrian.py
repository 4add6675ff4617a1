"""A vehicle strikes a person or an animal: as the first event of a crash, or later, if a person lies on the road.

A person who is struck again lies where the earlier strike threw them. The next vehicle is led over that place after the
person has come to rest. A driver followed by another vehicle stops at the side or in the lane, whichever lets the other
pass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.messages.wording import count_of
from trace_dag.common.paths import Path, shifted, straight
from trace_dag.common.settings import StateSettings
from trace_dag.common.units import bearing_to_clock_h
from trace_dag.crash.event_parties import Pace, Species, StruckAnimal
from trace_dag.crash.event_sequence import CrashEvent, EventSequence
from trace_dag.crash.record import NonMotorist, VehicleClass
from trace_dag.reconstruction.assemble import (
    AFTER_IMPACT_S,
    Drive,
    after_impact_s,
    drive_along,
    lane_under,
    planned_hypothesis,
    pose_of,
    round_trajectory,
)
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.motion.contact import Shape, shape_gaps_m, shapes
from trace_dag.reconstruction.motion.manoeuvres import drift
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile
from trace_dag.reconstruction.motion.walking import (
    CROSSING,
    RELATIVE_DEG,
    CourseReading,
    Gait,
    gait_of,
    reported_directions,
    usual_speed_mps,
)
from trace_dag.reconstruction.motion.walking import Course as Walking
from trace_dag.reconstruction.planners.impact_plans import (
    MANOEUVRES,
    ImpactPlan,
    Walk,
    impact_plans,
    person_kind_of,
    size_of,
)
from trace_dag.reconstruction.pre_crash_scenarios import party
from trace_dag.reconstruction.ranking import drawn, leaders_first
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import (
    EstimateCheck,
    Hypothesis,
    Manoeuvre,
    ParticipantState,
    PlannedEvent,
    SpeedSource,
)

LONGEST_CHAIN_S: Final = 12.0
"""From the first strike to the last."""
_SETTLES_S: Final = 1.0  # after a thrown person has come to rest
_RESTS_M: Final = 0.05  # nearer to where it ends up, a person is at rest
_FAR: Final = 50.0  # of log-likelihoods
_ALONG: Final = frozenset({Walking.ALONG, Walking.TOWARDS})
_MET_M: Final = 60.0  # before and behind the place where a person is met
_CROSSES: Final = frozenset({Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT})
_AT_THE_EDGE_S: Final = 1.0
_LONGEST_LEAD_S: Final = 12.0
_LATER_S: Final = (0.0, 2.0, 4.0, 6.0, 8.0)  # a slower vehicle comes so much later, else it would be in the way
_OFF_LANE_M: Final = 2.2  # farthest off its lane's centre that a vehicle strikes a person who lies there
_OFF_SIGMA_M: Final = 1.0
_OTHER_WAY: Final = -1.5  # log-likelihood that the next vehicle comes from another direction than the one before
_PULL_OVER_M: Final = 3.2
_PULL_OVER_G: Final = 0.35  # hard: it is at the side when the vehicle stops, after a reaction and with 0.6 g
_HIGH: Final = frozenset({VehicleClass.TRUCK, VehicleClass.TRACTOR_TRAILER, VehicleClass.BUS})
"""Vehicles that go over who lies between their wheels without touching: they strike with the wheels of one side."""
_TYRE_M: Final = 0.15  # from a vehicle's side to the middle of its tyres
_HIT_AND_RUN_AFTER_S: Final = 12.0
_LONGEST_AFTER_S: Final = 10.0
_COMPANION_M: Final = 0.8  # how far apart people walk who are struck together
_ROOM_M: Final = 0.2
"""Least gap up to the first strike between a later vehicle and who is there: nearer it would be in the way."""


def assume_animal(sequence: EventSequence, settings: StateSettings) -> EventSequence:
    """Return the sequence with the kind and pace of an animal from the settings.

    >>> assume_animal(sequence, StateSettings()) == sequence  # there is none
    True
    """

    def assumed(event: CrashEvent) -> CrashEvent:
        if not isinstance(event.partner, StruckAnimal):
            return event
        animal = replace(event.partner, species=Species(settings.animal), pace=Pace(settings.animal_pace))
        return replace(event, partner=animal)

    return replace(sequence, events=tuple(map(assumed, sequence.events)))


def companions_of(sequence: EventSequence) -> tuple[CrashEvent, ...]:
    """Return the strikes that follow the first at once, by the same vehicle, of companions of the first person.

    >>> companions_of(pedestrian_sequence)
    ()
    """
    first, *rest = sequence.events
    own = takewhile(lambda e: e.kind is first.kind and e.vehicle.number == first.vehicle.number, rest)
    return tuple(own)


def strike_hypotheses(search: Search, settings: StateSettings) -> tuple[Hypothesis, ...]:
    """Return at most ``most`` ranked hypotheses of a first strike.

    If another vehicle comes later there are two of each name: the driver stops at the side, or in the lane.

    Raises :class:`Rejection` (``no_feasible_state``) if no path of the vehicle leads to the persons as reported.
    """
    scene, sequence = search.scene, search.sequence
    first, together = sequence.first, companions_of(sequence)
    followed = any(event.is_contact and event.vehicle.number != first.vehicle.number for event in sequence.events)
    plans = leaders_first(impact_plans(scene, first), lambda plan: plan.group)
    shown = _drawn_course(scene.record.key, plans)
    plans = sorted(plans, key=lambda plan: plan.walk.reading.course is not shown)
    found: list[Hypothesis] = []
    kept = 0
    for plan in plans:
        made = []
        for pulls_over in (True, False) if followed else (False,):
            states = first_states(scene, plan, together, settings.lead_time_s, pulls_over=pulls_over)
            made.append(impact_hypothesis(plan, states, together, settings.lead_time_s))
        if all(check.passed for check in made[0].checks):
            found += made
            kept += 1
        if kept == settings.max_hypotheses:
            break
    if not found:
        examined = f" in any of {count_of(len(plans), 'plan')} examined" if plans else ""
        why = scene.no_way_that(f"leads the vehicle to whom it struck as reported{examined}")
        raise Rejection(Reason.NO_FEASIBLE_STATE, why, measured=len(plans))
    first_shown = None if shown is None else MANOEUVRES[shown]
    return tuple(sorted(found, key=lambda each: (_walks(each, first) is not first_shown, -each.score, each.name)))


def _drawn_course(key: str, plans: Sequence[ImpactPlan]) -> Walking | None:
    """Return the person's course that is shown.

    It is that of the likeliest plan. If the person may have crossed from either side, the side is drawn by the shares
    of both, so that over many crashes the sides occur in proportion.
    """
    best = {plan.walk.reading.course: plan.score for plan in sorted(plans, key=lambda plan: plan.score)}
    if not best:
        return None
    likeliest = max(best, key=lambda course: (best[course], course))
    if likeliest not in CROSSING or not best.keys() >= CROSSING:
        return likeliest
    left, right = best[Walking.FROM_LEFT], best[Walking.FROM_RIGHT]
    share = 1.0 / (1.0 + math.exp(min(right - left, _FAR)))
    return Walking.FROM_LEFT if drawn(key, "side of the person") < share else Walking.FROM_RIGHT


def _walks(hypothesis: Hypothesis, strike: CrashEvent) -> Manoeuvre:
    """Return the motions of the person of a strike in a hypothesis."""
    return next(s.manoeuvre for s in hypothesis.participants if s.vehicle_number == strike.person.party)


def crossing_lead_s(network: RoadNetwork, hypothesis: Hypothesis) -> float:
    """Return the time (s) by which the reconstruction has to begin before the strike; 0 without a crossing person.

    The time suffices for a crossing person to begin outside the lanes.
    """
    longest_s = 0.0
    for state in hypothesis.participants:
        start, at = state.initial_pose, state.impact_pose
        if state.manoeuvre not in _CROSSES or not network.drivable_area.has(start.x_m, start.y_m):
            continue
        back = Pose(at.x_m, at.y_m, at.heading_rad + math.pi / 2)
        from_m = network.drivable_area.edge_beside_m(back, 1.0)
        longest_s = max(longest_s, from_m / state.impact_speed_mps + _AT_THE_EDGE_S if from_m else 0.0)
    return round(min(longest_s, _LONGEST_LEAD_S), 1)


# --- parties of a strike ---------------------------------------------------------------------------------------------
def _companions(plan: ImpactPlan, together: Sequence[CrashEvent]) -> list[Walk]:
    """Return others struck by the same vehicle, beside the first person, as far apart as people walk."""
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
    if pulls_over and not drive.party.vehicle.hit_and_run:
        drive = replace(drive, path=_pulling_over(drive))
    driver = _driven(scene, drive, lead_s)
    middle, length_m, width_m = drive.party.vehicle.clock_body(driver.impact_pose)
    ahead, left = map(float, middle.to_body(np.array(plan.contact_xy_m)))
    clock_h = round(bearing_to_clock_h(math.atan2(left / width_m, ahead / length_m)), 3)
    driver = replace(driver, impact_clock_h=clock_h)
    return [driver, *(_walked(scene, walk, lead_s) for walk in (plan.walk, *_companions(plan, together)))]


def impact_hypothesis(
    plan: ImpactPlan, states: Sequence[ParticipantState], together: Sequence[CrashEvent], lead_s: float
) -> Hypothesis:
    """Return the hypothesis of the first strike's plan, together with other strikes by the same vehicle.

    >>> states = first_states(pedestrian_scene, strike_plan, [], 5.0, pulls_over=False)
    >>> made = impact_hypothesis(strike_plan, states, [], 5.0)
    >>> made.impact_time_s, made.name == strike_plan.name
    (5.0, True)
    """
    x_m, y_m = plan.contact_xy_m
    first = round(x_m, 6), round(y_m, 6)
    vehicle, person = (next(s for s in states if s.vehicle_number == number) for number in plan.strike.pair)
    before_m = _least_gap_m(vehicle, person, lead_s - 0.05)
    return planned_hypothesis(
        plan,
        states,
        lead_s,
        first,
        checks=(EstimateCheck("no earlier contact", before_m > 0, f"least gap before the strike {before_m:.3f} m"),),
        planned=tuple(PlannedEvent(each.number, *each.pair, lead_s, first) for each in (plan.strike, *together)),
    )


def _driven(scene: Scene, drive: Drive, at_s: float) -> ParticipantState:
    drives_on = bool(drive.party.vehicle.hit_and_run)
    after_s = _HIT_AND_RUN_AFTER_S if drives_on else after_impact_s(drive.profile, _LONGEST_AFTER_S)
    state = drive_along(scene.network, drive, lead_time_s=at_s, after_s=after_s)
    return replace(state, drives_on=drives_on)


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


def person_met(
    scene: Scene, person: NonMotorist, touched_xy_m: FloatArray, outward_rad: float, along: Pose, at_s: float
) -> ParticipantState:
    """Return a person or animal that a vehicle touches at a point with a given outward normal, at a time (s).

    If the report has the person move along the road, it moves in the direction of ``along`` or against it; else it
    stands, and faces across the way of the vehicle.
    """
    kind = person_kind_of(person)
    size = size_of(person, kind)
    course = next(iter(sorted(reported_directions(person, None) & _ALONG)), Walking.STANDING)
    heading = outward_rad + math.pi / 2
    gait = Gait.STANDING
    if course in _ALONG:
        heading = along.heading_rad + math.radians(RELATIVE_DEG[course])
        gait = gait_of(person)
    angle = outward_rad - heading
    reach_m = abs(math.cos(angle)) * size.length_m / 2 + abs(math.sin(angle)) * size.width_m / 2
    x, y = touched_xy_m + reach_m * np.array([math.cos(outward_rad), math.sin(outward_rad)])
    pose = Pose(float(x), float(y), math.remainder(heading, math.tau), along.z_m)
    path = straight(pose, back_m=_MET_M, ahead_m=_MET_M)
    reading = CourseReading(course, 0.0, told=course in _ALONG)
    walk = Walk(person, kind, size, reading, gait, path, _MET_M, pose, usual_speed_mps(person, gait))
    return _walked(scene, walk, at_s)


def _pulling_over(drive: Drive) -> Path:
    """Return the path of a driver who stops at the side after the strike."""
    total_m = drive.option.approach.kerb_sign * _PULL_OVER_M
    shift = replace(drift(total_m, drive.profile.impact_mps, _PULL_OVER_G), at_anchor_m=0.0)
    return shifted(drive.path, shift, anchor_s_m=drive.station_m + 2.0)


def _least_gap_m(one: ParticipantState, two: ParticipantState, until_s: float) -> float:
    """Return the least gap between two planned motions from the beginning to a time."""
    time = np.arange(0.0, max(until_s, 0.02), 0.02)

    def at(state: ParticipantState) -> tuple[Shape, ...]:
        t, trailing = state.trajectory, state.trailer_heading_rad
        x, y, heading = (np.interp(time, t.time_s, values) for values in (t.x_m, t.y_m, np.unwrap(t.heading_rad)))
        behind = None if trailing is None else np.interp(time, t.time_s, trailing)
        return shapes((x, y, heading), (state.length_m, state.width_m), state.trailer, behind)

    return float(shape_gaps_m(at(one), at(two)).min())


# --- later -----------------------------------------------------------------------------------------------------------
def lying_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield plans of another vehicle that runs over a person struck before, each later than the earlier one."""
    number = event.person.party
    struck = next((each for each in course.log.contacts if each.number_2 == number), None)
    if struck is None:
        yield f"person {event.person.number} was not struck before"
        return
    lies_at, at_rest_s = _comes_to_lie(course, number)
    found = next_way(search.scene, event, lies_at, struck.pose_1.heading_rad)
    for wait_s in _LATER_S:
        at_s = at_rest_s + _SETTLES_S + wait_s
        if found is None or at_s > search.lead_s + LONGEST_CHAIN_S:
            if not wait_s:
                yield f"no way of vehicle {event.vehicle.number} leads over the person who lies there in time"
            return
        drive, score = found
        state = _driven(search.scene, drive, at_s)
        if min(_least_gap_m(state, each, search.lead_s) for each in course.states) <= _ROOM_M:
            continue
        terms = {f"way of the next vehicle (vehicle {event.vehicle.number})": round(score, 6)}
        name = f"vehicle {event.vehicle.number}: {drive.option.name}"
        yield Plan((*course.states, state), course.objects, name, score, terms)


def _comes_to_lie(course: Course, number: int) -> tuple[FloatArray, float]:
    """Return the place where a person comes to rest (x, y, m), and the time (s)."""
    person = course.log.vehicle_log(number)
    away_m = np.hypot(person.x_m - person.x_m[-1], person.y_m - person.y_m[-1])
    moving = np.flatnonzero(away_m > _RESTS_M)
    at_rest_s = float(person.time_s[moving[-1]]) if len(moving) else 0.0
    last_s = max((each.time_s for each in course.matching.matched if each is not None), default=0.0)
    return np.array([person.x_m[-1], person.y_m[-1]]), max(at_rest_s, last_s)


def next_way(scene: Scene, strike: CrashEvent, lies_at: FloatArray, course_rad: float) -> tuple[Drive, float] | None:
    """Return the likeliest way of the next vehicle over the person who lies there, and its log-likelihood.

    >>> drive, _ = next_way(pedestrian_scene, strike_plan.strike, np.array(strike_plan.contact_xy_m), 0.0)
    >>> drive.party.vehicle.number
    1
    >>> next_way(pedestrian_scene, strike_plan.strike, np.array([500.0, 500.0]), 0.0) is None  # no road is there
    True
    """
    who = party(scene.record, strike.vehicle)
    best: tuple[Drive, float] | None = None
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
        if best is None or round(score, 6) > round(best[1], 6):
            over = shifted(path, None, anchor_s_m=station, constant_m=off)
            station = over.project(float(lies_at[0]), float(lies_at[1]))[0] - who.vehicle.length_m / 2
            best = Drive(who, option, over, station, speed, profile), score
    return best
