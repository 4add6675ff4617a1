"""The checks of every hypothesis, whichever estimator made it.

Some check the contract of estimators: the bodies touch at the impact and not before, reported speeds are kept, paths
can be driven. The others are the published criteria, measured on the plan. Each check has its measured value. A
hypothesis that fails one of ``ESSENTIAL`` is dropped.
"""

from __future__ import annotations

import math

import numpy as np

from trace_dag.common.units import GRAVITY_MPS2, bearing_to_clock_h, clock_difference_h
from trace_dag.crash.crash_types import Turn
from trace_dag.crash.record import VehicleRecord
from trace_dag.reconstruction.motion.contact import Shape, shape_gaps_m, shapes
from trace_dag.reconstruction.motion.solver import Placed, Solution
from trace_dag.reconstruction.motion.speeds import starts
from trace_dag.simulation.states import EstimateCheck, Manoeuvre, ParticipantState

ESSENTIAL = frozenset({"touching", "no earlier contact"})

MAX_GAP_M = 0.02
MAX_PLACE_M = 5.0
MAX_CLOCK_H = 2.0
MAX_LATERAL_G = 0.72  # dry asphalt holds 0.75
MAX_SPEED_ERROR_INITIAL = 0.02
MAX_SPEED_ERROR_IMPACT = 0.10
MAX_OUTSIDE_M = 0.1
_AGAINST_LANE_ALLOWED = frozenset(
    {Manoeuvre.WRONG_WAY, Manoeuvre.BACKING, Manoeuvre.PASS, Manoeuvre.CROSS_CENTRELINE, Manoeuvre.U_TURN}
)


def check(
    solution: Solution,
    participants: tuple[ParticipantState, ...],
    *,
    lead_time_s: float,
    beyond_map: dict[int, bool],
) -> tuple[EstimateCheck, ...]:
    """Return all checks of one hypothesis.

    ``beyond_map`` gives, for each vehicle number, whether it starts beyond the roads of the map.

    >>> states, lead_s = hypothesis.participants, hypothesis.impact_time_s
    >>> done = check(solution, states, lead_time_s=lead_s, beyond_map={1: False, 2: False})
    >>> [each.name for each in done][:3], all(each.passed for each in done)
    (['touching', 'no earlier contact', 'place'], True)
    """
    records = {
        party.vehicle.number: party for party in (solution.candidate.scenario.mover, solution.candidate.scenario.other)
    }
    checks = list(_contact(participants, lead_time_s))
    x_m, y_m = solution.contact_xy_m
    distance = math.hypot(x_m - solution.place_xy_m[0], y_m - solution.place_xy_m[1])
    most_m = max(MAX_PLACE_M, solution.place_accuracy_m)
    checks.append(
        EstimateCheck("place", distance <= most_m, f"{distance:.2f} m from the reported place, at most {most_m:g}")
    )
    for participant in participants:
        party = records[participant.vehicle_number]
        checks += _speed(party.vehicle, participant)
        checks.append(_lateral(participant, lead_time_s))
        checks.append(_on_road(participant, beyond_map[participant.vehicle_number]))
        checks.append(_side_of_road(solution, participant))
        checks += _area(party.vehicle, participant)
        checks.append(_direction(solution, participant, party.turn))
    return tuple(checks)


def _named(name: str, participant: ParticipantState) -> str:
    return f"{name} (vehicle {participant.vehicle_number})"


def _contact(participants: tuple[ParticipantState, ...], lead_time_s: float) -> list[EstimateCheck]:
    one, two = participants
    impact = int(np.argmin(np.abs(one.trajectory.time_s - lead_time_s)))
    until = slice(0, impact + 1)
    gap = shape_gaps_m(_shapes(one, until), _shapes(two, until))
    before = float(gap[:impact].min()) if impact else 0.0
    at = float(gap[impact])
    return [
        EstimateCheck("touching", abs(at) <= MAX_GAP_M, f"gap {at:.4f} m at the impact, at most {MAX_GAP_M:g}"),
        EstimateCheck("no earlier contact", before > 0, f"least gap before the impact {before:.3f} m"),
    ]


def _shapes(state: ParticipantState, steps: slice) -> tuple[Shape, ...]:
    t, trailing = state.trajectory, state.trailer_heading_rad
    poses = (t.x_m[steps], t.y_m[steps], t.heading_rad[steps])
    return shapes(poses, (state.length_m, state.width_m), state.trailer, None if trailing is None else trailing[steps])


def _speed(vehicle: VehicleRecord, participant: ParticipantState) -> list[EstimateCheck]:
    reported = vehicle.travel_speed_mps
    if reported is None:
        return []
    initial, impact = abs(participant.initial_speed_mps), abs(participant.impact_speed_mps)
    scale = max(reported, 1e-9)
    error = abs(initial - reported) / scale if reported else initial
    checks = [
        EstimateCheck(
            _named("reported speed", participant),
            error <= MAX_SPEED_ERROR_INITIAL,
            f"{initial:.2f} m/s at the beginning, reported {reported:.2f}",
        )
    ]
    if not participant.braking and not starts(vehicle, reported):
        error = abs(impact - reported) / scale if reported else impact
        checks.append(
            EstimateCheck(
                _named("speed at impact", participant),
                error <= MAX_SPEED_ERROR_IMPACT,
                f"{impact:.2f} m/s at the impact, reported {reported:.2f}",
            )
        )
    return checks


def _lateral(participant: ParticipantState, lead_time_s: float) -> EstimateCheck:
    trajectory = participant.trajectory
    driven = trajectory.time_s <= lead_time_s + 1e-6
    yaw_rate = np.gradient(trajectory.heading_rad, trajectory.time_s)
    worst = float(np.abs(yaw_rate * trajectory.speed_mps)[driven].max()) / GRAVITY_MPS2
    return EstimateCheck(
        _named("lateral acceleration", participant),
        worst <= MAX_LATERAL_G,
        f"{worst:.2f} g at most, limit {MAX_LATERAL_G:g}",
    )


def _on_road(participant: ParticipantState, beyond_map: bool) -> EstimateCheck:
    name = _named("starts on a road", participant)
    lane = participant.initial_lane
    if beyond_map:
        return EstimateCheck(name, True, "starts beyond the edge of the map")
    if lane is None:
        return EstimateCheck(name, False, "no lane near the initial position")
    return EstimateCheck(
        name, lane.outside_m <= MAX_OUTSIDE_M, f"{lane.outside_m:.2f} m outside road {lane.lane.road_id}"
    )


def _side_of_road(solution: Solution, participant: ParticipantState) -> EstimateCheck:
    name = _named("right side of the road", participant)
    placed = _placed(solution, participant)
    if placed.option.approach.wrong_way and participant.manoeuvre not in _AGAINST_LANE_ALLOWED:
        return EstimateCheck(name, False, "follows its lane the wrong way without being reported to")
    return EstimateCheck(name, True, f"{participant.manoeuvre} on {placed.option.approach.name}")


def _area(vehicle: VehicleRecord, participant: ParticipantState) -> list[EstimateCheck]:
    if vehicle.impact is None or participant.impact_clock_h is None:
        return []
    reported = bearing_to_clock_h(vehicle.impact.centre_rad)
    apart = clock_difference_h(participant.impact_clock_h, reported)
    allowed = max(MAX_CLOCK_H, vehicle.impact.half_width_rad * 6 / math.pi)
    return [
        EstimateCheck(
            _named("impact area", participant),
            apart <= allowed,
            f"struck at {participant.impact_clock_h:.1f} o'clock, reported {reported:g}, at most {allowed:g} h apart",
        )
    ]


def _direction(solution: Solution, participant: ParticipantState, turn: Turn | None) -> EstimateCheck:
    """Check that the vehicle turned the reported way.

    The turn has begun by the impact and is complete at the end of the plan.
    """
    name = _named("direction", participant)
    placed = _placed(solution, participant)
    if turn is None or placed.option.turn is None:
        change = math.remainder(participant.impact_pose.heading_rad - participant.initial_pose.heading_rad, math.tau)
        return EstimateCheck(name, True, f"heading changed by {math.degrees(change):.0f} deg along its road")
    sign = {Turn.LEFT: 1.0, Turn.RIGHT: -1.0}.get(turn, -placed.option.approach.kerb_sign)
    planned = math.degrees(sign * placed.option.turn.angle_rad)
    return EstimateCheck(name, planned > 0, f"turns {turn} by {planned:.0f} deg")


def _placed(solution: Solution, participant: ParticipantState) -> Placed:
    mover = solution.candidate.scenario.mover
    return solution.mover if mover.vehicle.number == participant.vehicle_number else solution.other
