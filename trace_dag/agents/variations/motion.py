"""A recorded motion, perturbed: along the same line or beside it, faster, later, braking.

A vehicle only follows its recorded path, moved sideways. Speeds are scaled about the recorded impact, so that a change
of speed alone still brings it to the same place at the same time; timing is its own perturbation. If a vehicle would
begin before its recorded path, the beginning is cut off for all vehicles alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trace_dag.agents.variations.perturbation import Perturbation, VehiclePerturbation
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import Participant

BRAKING_MPS2 = 5.0
"""With which a driver who reacts brakes, if friction allows it: usual emergency braking of untrained drivers."""

_STEP_S = 0.02
_STANDS_M = 0.05


def perturb_motion(
    participants: Sequence[Participant], perturbation: Perturbation, impact_time_s: float
) -> tuple[tuple[Participant, ...], float]:
    """Return the perturbed participants, and the time of the recorded impact on their clock.

    The clock begins when all participants are on their recorded paths.
    """
    by_number = {each.number: each for each in perturbation.vehicles}
    start_s = max((_earliest_s(each, by_number[each.number], impact_time_s) for each in participants), default=0.0)
    return (
        tuple(_moved(each, by_number[each.number], impact_time_s, start_s) for each in participants),
        impact_time_s - start_s,
    )


def _recorded_time_s(time_s: FloatArray | float, change: VehiclePerturbation, impact_time_s: float) -> FloatArray:
    """Return the time at which the recorded motion was at the perturbed one's place, without braking."""
    return np.asarray(impact_time_s + change.speed_factor * (np.asarray(time_s) - change.delay_s - impact_time_s))


def _earliest_s(participant: Participant, change: VehiclePerturbation, impact_time_s: float) -> float:
    """Return the time at which the perturbed motion is at the recorded one's beginning."""
    if _stands(participant.trajectory):
        return 0.0
    return max(0.0, impact_time_s - impact_time_s / change.speed_factor + change.delay_s)


def _stands(trajectory: Trajectory) -> bool:
    return float(np.hypot(np.diff(trajectory.x_m), np.diff(trajectory.y_m)).sum()) < _STANDS_M


def _moved(participant: Participant, change: VehiclePerturbation, impact_time_s: float, start_s: float) -> Participant:
    t = participant.trajectory
    last_s = float(t.time_s[-1])
    if _stands(t):
        time_s = recorded_s = t.time_s
        rate = np.ones(len(time_s))
    else:
        end_s = impact_time_s + change.delay_s + (last_s - impact_time_s) / change.speed_factor
        time_s = np.asarray(np.arange(math.floor((end_s - start_s) / _STEP_S) + 1) * _STEP_S, np.float64)
        recorded_s = np.asarray(np.clip(_recorded_time_s(time_s + start_s, change, impact_time_s), 0.0, last_s))
        rate = np.full(len(time_s), change.speed_factor)
        if change.reaction_s > 0:
            recorded_s, rate = _braking(t, time_s, recorded_s, rate, impact_time_s - start_s - change.reaction_s)
    heading = np.interp(recorded_s, t.time_s, np.unwrap(t.heading_rad))
    yaw_rate = (
        np.interp(recorded_s, t.time_s, np.gradient(np.unwrap(t.heading_rad), t.time_s)) if len(t.time_s) > 1 else 0
    )
    speed = np.interp(recorded_s, t.time_s, t.speed_mps)
    left = change.offset_left_m
    trajectory = Trajectory(
        time_s=time_s,
        x_m=np.interp(recorded_s, t.time_s, t.x_m) - left * np.sin(heading),
        y_m=np.interp(recorded_s, t.time_s, t.y_m) + left * np.cos(heading),
        z_m=np.interp(recorded_s, t.time_s, t.z_m),
        heading_rad=heading,
        speed_mps=rate * (speed - left * yaw_rate),
    )
    start = Pose(
        float(trajectory.x_m[0]),
        float(trajectory.y_m[0]),
        math.remainder(float(heading[0]), math.tau),
        float(trajectory.z_m[0]),
    )
    return replace(
        participant, initial_pose=start, initial_speed_mps=float(trajectory.speed_mps[0]), trajectory=trajectory
    )


def _braking(
    trajectory: Trajectory, time_s: FloatArray, recorded_s: FloatArray, rate: FloatArray, from_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the motion with brakes from a time on: recorded times reached, and their rate.

    A braking vehicle moves through the recorded motion ever slower, at a rate that follows from its speed there.
    """
    recorded_s, rate = recorded_s.copy(), rate.copy()
    lost_mps = 0.0
    for k in range(1, len(time_s)):
        if time_s[k] <= from_s:
            continue
        lost_mps += BRAKING_MPS2 * _STEP_S
        wanted_mps = abs(rate[0] * float(np.interp(recorded_s[k - 1], trajectory.time_s, trajectory.speed_mps)))
        share = max(0.0, 1 - lost_mps / wanted_mps) if wanted_mps > 0 else 0.0
        rate[k] = rate[0] * share
        recorded_s[k] = min(recorded_s[k - 1] + rate[k] * _STEP_S, float(trajectory.time_s[-1]))
    return recorded_s, rate
