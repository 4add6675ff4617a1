"""From a solution to a hypothesis: participants with timed trajectories, and its checks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import STEP_M, Path
from trace_dag.common.units import bearing_to_clock_h
from trace_dag.crash.record import VehicleRecord
from trace_dag.reconstruction.checks import check
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.solver import Placed, Solution
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.roads.map.model import LaneMatch
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import Hypothesis, Manoeuvre, ParticipantState, SpeedSource, Trajectory

AFTER_IMPACT_S = 3.0
AFTER_IMPACT_M = 25.0  # a turn that has begun is complete by then
LONGEST_AFTER_S = 20.0
LANE_REACH_M = 4.0
_TRAILS_M = 1.0  # a trailer is followed from so far before a path's beginning
_DECIMALS = 6  # to a micrometre: equal on every machine, which the last bits are not


def hypothesis_of(solution: Solution, network: RoadNetwork, *, lead_time_s: float) -> Hypothesis:
    """Return the solution as states: each vehicle's profile run backward from the impact along its path.

    >>> made = hypothesis_of(solution, network, lead_time_s=5.0)
    >>> [(each.vehicle_number, each.manoeuvre.value) for each in made.participants]
    [(1, 'turn_left'), (2, 'straight')]
    >>> made.impact_time_s, all(check.passed for check in made.checks)
    (5.0, True)
    """
    candidate = solution.candidate
    parts = (
        (candidate.scenario.mover, solution.mover, candidate.mover_speed, candidate.mover_profile),
        (candidate.scenario.other, solution.other, candidate.other_speed, candidate.other_profile),
    )
    participants = tuple(
        sorted(
            (_participant(network, *part, lead_time_s=lead_time_s) for part in parts),
            key=lambda participant: participant.vehicle_number,
        )
    )
    mapped = {
        party.vehicle.number: placed.station_m + _travelled(profile, lead_time_s) < placed.option.approach.mapped_from_m
        for party, placed, _, profile in parts
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


def _participant(
    network: RoadNetwork,
    party: Party,
    placed: Placed,
    speed: TravelSpeed,
    profile: SpeedProfile,
    *,
    lead_time_s: float,
) -> ParticipantState:
    after_s = AFTER_IMPACT_S
    if profile.impact_mps > 0:
        after_s = min(max(after_s, AFTER_IMPACT_M / profile.impact_mps), LONGEST_AFTER_S)
    state = drive_along(
        network,
        party.vehicle,
        placed.option,
        placed.path,
        placed.station_m,
        speed,
        profile,
        lead_time_s=lead_time_s,
        after_s=after_s,
    )
    return replace(state, impact_clock_h=round(bearing_to_clock_h(placed.bearing_rad), 3))


def drive_along(
    network: RoadNetwork,
    vehicle: VehicleRecord,
    option: Option,
    path: Path,
    station_m: float,
    speed: TravelSpeed,
    profile: SpeedProfile,
    *,
    lead_time_s: float,
    after_s: float,
) -> ParticipantState:
    """Return a vehicle driven along a path.

    It is at ``station_m`` of it (metres) after ``lead_time_s`` seconds, and goes on for ``after_s`` seconds more.

    >>> from trace_dag.simulation.states import SpeedSource
    >>> car, way = tree_record.vehicles[0], way_past_the_tree
    >>> speed, steady = TravelSpeed(20.0, SpeedSource.REPORTED), SpeedProfile(20.0, 20.0)
    >>> state = drive_along(network, car, way, way.path(), way.station_m, speed, steady, lead_time_s=5.0, after_s=1.0)
    >>> t = state.trajectory
    >>> round(math.dist((t.x_m[0], t.y_m[0]), (t.x_m[-1], t.y_m[-1])), 1), float(t.time_s[-1])  # 6 s at 20 m/s
    (120.0, 6.0)
    """
    time, distance, speeds = profile.sample(lead_time_s, after_s)
    x, y, z, heading = path.at(station_m + distance)
    trailing = _trailing(vehicle, path, station_m + distance, heading)
    if option.backing:
        heading, speeds, trailing = heading + math.pi, -speeds, heading + math.pi
    trajectory = round_trajectory(time, x, y, z, heading, speeds)
    impact = int(np.argmin(np.abs(trajectory.time_s - lead_time_s)))
    state = _of_vehicle(network, vehicle, option.manoeuvre, speed.source, trajectory, impact)
    return replace(
        state,
        braking=profile.impact_mps < profile.initial_mps,
        trailer_heading_rad=None if vehicle.trailer is None else np.round(trailing, _DECIMALS),
    )


def stand_still(network: RoadNetwork, vehicle: VehicleRecord, pose: Pose) -> ParticipantState:
    """Return a vehicle that stands at a pose throughout.

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
    """Return the body of a vehicle along a trajectory, at ``impact`` of it when it is struck."""
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
    """Return headings of what a vehicle pulls along a path; in line with it where it pulls nothing."""
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
    """Return the lane a body stands in: the nearest one; of several equally near, the one in its direction of travel.

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
