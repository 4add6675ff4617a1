"""Hypotheses from solutions: participants with timed trajectories, and checks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import STEP_M, Path
from trace_dag.common.units import bearing_to_clock_h
from trace_dag.crash.record import VehicleRecord
from trace_dag.reconstruction.checks import check
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.solver import Solution
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.reconstruction.ranking import Scored
from trace_dag.roads.map.model import LaneMatch
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import Hypothesis, Manoeuvre, ParticipantState, SpeedSource, Trajectory

AFTER_IMPACT_S = 3.0
AFTER_IMPACT_M = 25.0  # a turn that has begun is complete by then
LONGEST_AFTER_S = 20.0
LANE_REACH_M = 4.0
_TRAILS_M = 1.0  # a trailer is followed from so far before a path's beginning
_DECIMALS = 6  # to a micrometre: equal on every machine, which the last bits are not


@dataclass(frozen=True, eq=False)
class Drive:
    """A vehicle's way to an event: its path, the station along it at the event (m), and its speed before."""

    party: Party
    option: Option
    path: Path
    station_m: float
    speed: TravelSpeed
    profile: SpeedProfile

    @property
    def pose(self) -> Pose:
        """Return the pose at the event."""
        pose = self.path.pose(self.station_m)
        if not self.option.backing:
            return pose
        return replace(pose, heading_rad=math.remainder(pose.heading_rad + math.pi, math.tau))


def hypothesis_of(solution: Solution, network: RoadNetwork, *, lead_time_s: float) -> Hypothesis:
    """Return a solution's hypothesis: each vehicle's profile run backward from the impact along its path.

    >>> made = hypothesis_of(solution, network, lead_time_s=5.0)
    >>> [(each.vehicle_number, each.manoeuvre.value) for each in made.participants]
    [(1, 'turn_left'), (2, 'straight')]
    >>> made.impact_time_s, all(check.passed for check in made.checks)
    (5.0, True)
    """
    candidate = solution.candidate
    mover, other, scenario = solution.mover, solution.other, candidate.scenario
    parts = (
        (scenario.mover, mover.option, mover.path, mover.station_m, candidate.mover_speed, candidate.mover_profile),
        (scenario.other, other.option, other.path, other.station_m, candidate.other_speed, candidate.other_profile),
    )
    drives = [Drive(*part) for part in parts]
    states = []
    for drive, bearing_rad in zip(drives, (mover.bearing_rad, other.bearing_rad), strict=True):
        after_s = after_impact_s(drive.profile, LONGEST_AFTER_S) if drive.profile.impact_mps > 0 else AFTER_IMPACT_S
        states.append(drive_along(network, drive, lead_time_s=lead_time_s, after_s=after_s, bearing_rad=bearing_rad))
    participants = in_order(states)
    mapped = {
        drive.party.vehicle.number: drive.station_m + _travelled(drive.profile, lead_time_s)
        < drive.option.approach.mapped_from_m
        for drive in drives
    }
    x_m, y_m = solution.contact_xy_m
    return Hypothesis(
        name=solution.name,
        score=solution.score,
        evidence={
            "reading of the record": round(candidate.scenario.log_prior, _DECIMALS),
            **{name: round(value, _DECIMALS) for name, value in sorted(solution.terms.items())},
        },
        participants=participants,
        impact_time_s=lead_time_s,
        impact_point_xy_m=(round(x_m, _DECIMALS), round(y_m, _DECIMALS)),
        checks=check(solution, participants, lead_time_s=lead_time_s, beyond_map=mapped),
    )


def _travelled(profile: SpeedProfile, lead_time_s: float) -> float:
    """Return the distance from the impact at the beginning, negative (metres)."""
    return float(profile.sample(lead_time_s, 0.0)[1][0])


def planned_hypothesis(
    plan: Scored, states: Iterable[ParticipantState], lead_s: float, at_xy_m: Iterable[float], **parts: Any
) -> Hypothesis:
    """Return the hypothesis made of a plan and its parties, with the event ``lead_s`` after the beginning at a place.

    ``parts``: what else the hypothesis has, such as its checks and objects.

    >>> states = hypothesis.participants
    >>> made = planned_hypothesis(strike_plan, states, 5.0, (1.0, 2.0))
    >>> made.name == strike_plan.name, made.score == strike_plan.score
    (True, True)
    """
    x_m, y_m = (round(float(value), _DECIMALS) for value in at_xy_m)
    return Hypothesis(
        name=plan.name,
        score=plan.score,
        evidence={name: round(value, _DECIMALS) for name, value in sorted(plan.terms.items())},
        participants=in_order(states),
        impact_time_s=lead_s,
        impact_point_xy_m=(x_m, y_m),
        **parts,
    )


def in_order(states: Iterable[ParticipantState]) -> tuple[ParticipantState, ...]:
    """Return parties in the order of their numbers."""
    return tuple(sorted(states, key=lambda state: state.vehicle_number))


def drive_along(
    network: RoadNetwork, drive: Drive, *, lead_time_s: float, after_s: float, bearing_rad: float | None = None
) -> ParticipantState:
    """Return a vehicle driven along its path.

    It is at the event after ``lead_time_s`` seconds, where it is touched in the direction ``bearing_rad`` of its body
    if that is known, and goes on for ``after_s`` seconds more.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> who, way = party(tree_record, tree_record.vehicles[0]), way_past_the_tree
    >>> speed, steady = TravelSpeed(20.0, SpeedSource.REPORTED), SpeedProfile(20.0, 20.0)
    >>> drive = Drive(who, way, way.path(), way.station_m, speed, steady)
    >>> state = drive_along(network, drive, lead_time_s=5.0, after_s=1.0)
    >>> t = state.trajectory
    >>> round(math.dist((t.x_m[0], t.y_m[0]), (t.x_m[-1], t.y_m[-1])), 1), float(t.time_s[-1])  # 6 s at 20 m/s
    (120.0, 6.0)
    """
    vehicle, profile = drive.party.vehicle, drive.profile
    time, distance, speeds = profile.sample(lead_time_s, after_s)
    x, y, z, heading = drive.path.at(drive.station_m + distance)
    trailing = _trailing(vehicle, drive.path, drive.station_m + distance, heading)
    if drive.option.backing:
        heading, speeds, trailing = heading + math.pi, -speeds, heading + math.pi
    trajectory = round_trajectory(time, x, y, z, heading, speeds)
    impact = int(np.argmin(np.abs(trajectory.time_s - lead_time_s)))
    state = _of_vehicle(network, vehicle, drive.option.manoeuvre, drive.speed.source, trajectory, impact)
    return replace(
        state,
        braking=profile.impact_mps < profile.initial_mps,
        impact_clock_h=None if bearing_rad is None else round(bearing_to_clock_h(bearing_rad), 3),
        trailer_heading_rad=None if vehicle.trailer is None else np.round(trailing, _DECIMALS),
    )


def after_impact_s(profile: SpeedProfile, most_s: float) -> float:
    """Return the time for which a vehicle's plan goes on after an event (s), long enough to complete a turn.

    >>> after_impact_s(SpeedProfile(20.0, 20.0), 20.0), after_impact_s(SpeedProfile(5.0, 5.0), 20.0)  # 25 m at 5 m/s
    (3.0, 5.0)
    """
    return max(AFTER_IMPACT_S, AFTER_IMPACT_M / max(profile.impact_mps, AFTER_IMPACT_M / most_s))


def stand_still(network: RoadNetwork, vehicle: VehicleRecord, pose: Pose) -> ParticipantState:
    """Return a vehicle that stands at a pose.

    >>> state = stand_still(network, record.vehicles[0], Pose(1.0, 2.0, 0.5))
    >>> state.initial_speed_mps, (state.initial_pose.x_m, state.initial_pose.y_m)
    (0.0, (1.0, 2.0))
    """
    still = np.zeros(2)
    time = np.array([0.0, AFTER_IMPACT_S])  # and on from there
    trajectory = Trajectory(time, still + pose.x_m, still + pose.y_m, still + pose.z_m, still + pose.heading_rad, still)
    source = SpeedSource.INFERRED_MANOEUVRE
    state = _of_vehicle(network, vehicle, Manoeuvre.STOPPED, source, trajectory, 0)
    trailing = None if vehicle.trailer is None else trajectory.heading_rad
    return replace(state, initial_pose=pose, impact_pose=pose, trailer_heading_rad=trailing)


def _of_vehicle(
    network: RoadNetwork,
    vehicle: VehicleRecord,
    manoeuvre: Manoeuvre,
    source: SpeedSource,
    trajectory: Trajectory,
    impact: int,
) -> ParticipantState:
    """Return the state of a vehicle on a trajectory, with its pose ``impact`` when it is struck."""
    initial_pose, impact_pose = pose_of(trajectory, 0), pose_of(trajectory, impact)
    return ParticipantState(
        vehicle_number=vehicle.number,
        vehicle_class=vehicle.vehicle_class,
        length_m=vehicle.length_m,
        width_m=vehicle.width_m,
        height_m=vehicle.height_m,
        mass_kg=vehicle.mass_kg,
        manoeuvre=manoeuvre,
        initial_pose=initial_pose,
        initial_speed_mps=float(trajectory.speed_mps[0]),
        impact_pose=impact_pose,
        impact_speed_mps=float(trajectory.speed_mps[impact]),
        speed_source=source,
        trajectory=trajectory,
        initial_lane=lane_under(network, initial_pose),
        impact_lane=lane_under(network, impact_pose),
        trailer=vehicle.trailer,
    )


def _trailing(vehicle: VehicleRecord, path: Path, stations_m: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Return headings of a vehicle's trailer along a path; those of the vehicle without one."""
    if vehicle.trailer is None:
        return heading_rad
    from_m = min(float(stations_m[0]), float(path.s_m[0])) - _TRAILS_M
    along = np.concatenate([np.arange(from_m, float(stations_m[0]), STEP_M), stations_m])
    following = vehicle.trailer.following(path.plan(along), vehicle.length_m)
    return following[-len(stations_m) :]


def round_trajectory(
    time_s: FloatArray,
    x_m: FloatArray,
    y_m: FloatArray,
    z_m: FloatArray,
    heading_rad: FloatArray,
    speed_mps: FloatArray,
) -> Trajectory:
    """Return the trajectory rounded to a micrometre, with its first heading between -pi and pi.

    >>> still = np.zeros(1)
    >>> round_trajectory(still, still, still, still, still + 7.0, still).heading_rad.tolist()  # 7 rad less a full turn
    [0.716815]
    """
    heading_rad = heading_rad - math.tau * round(float(heading_rad[0]) / math.tau)
    return Trajectory(*(np.round(values, _DECIMALS) for values in (time_s, x_m, y_m, z_m, heading_rad, speed_mps)))


def pose_of(trajectory: Trajectory, index: int) -> Pose:
    """Return the pose at one of the trajectory's times, by index."""
    values: tuple[FloatArray, ...] = (trajectory.x_m, trajectory.y_m, trajectory.heading_rad, trajectory.z_m)
    x, y, heading, z = (float(value[index]) for value in values)
    return Pose(x, y, round(math.remainder(heading, math.tau), _DECIMALS), z)


def lane_under(network: RoadNetwork, pose: Pose) -> LaneMatch | None:
    """Return the lane under a body: the nearest one, and among equally near ones that in its direction of travel.

    >>> turning, riding = hypothesis.participants
    >>> lane_under(network, riding.initial_pose).outside_m  # between the edges of a lane
    0.0
    """
    matches = network.nearest_lanes(pose.x_m, pose.y_m, LANE_REACH_M, z_m=pose.z_m)

    def order(match: LaneMatch) -> tuple[float, float, str, int]:
        lane = network.pose(match.lane, match.s_m)
        apart = abs(math.remainder(lane.heading_rad - pose.heading_rad, math.tau))
        return (round(match.outside_m, 2), round(apart, 2), match.lane.road_id, match.lane.lane_id)

    return min(matches, key=order, default=None)
