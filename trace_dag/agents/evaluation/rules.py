"""Rules of the road as an agent kept them, measured along its way: on the road, in its own lanes, at the limit, halts.

Signals are left out: nobody knows what they showed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.roads.map.lane_map import LaneMap
from trace_dag.roads.map.model import LaneMatch, LaneType, SignalType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.progress import FASTEST_PACE
from trace_dag.simulation.types import VehicleLog

_STEP_S = 0.2
_BESIDE_M = 0.5  # of the body's centre beside the outermost lane: a shoulder is not a field
_MAP_REACH_M = 250.0  # from the crash: farther out a map may simply end
_MOVING_MPS = 0.5
_AGAINST_RAD = math.radians(90.0)
_BEFORE_SIGN_M = 15.0
_HALT_MPS = 1.0  # the slowest of a halt as it is seen every fifth of a second


@dataclass(frozen=True)
class RuleMeasures:
    """Times in s, speeds in m/s. ``over_limit_mps`` is the highest excess over the limit of its lane, 0 if never.

    ``over_traffic_mps`` is the highest excess over :data:`FASTEST_PACE` times the limit of any lane there, or over the
    recorded top speed if that is higher.
    """

    off_road_s: float
    wrong_way_s: float
    over_limit_mps: float
    stop_signs_passed: int
    over_traffic_mps: float


@dataclass(frozen=True)
class _Moment:
    speed_mps: float
    course_rad: float
    matches: tuple[LaneMatch, ...]


def measure_rules(network: RoadNetwork, log: VehicleLog, until_s: float, recorded_mps: float) -> RuleMeasures:
    """Measure how far a vehicle keeps the rules until a time.

    ``recorded_mps`` is the recorded top speed.
    """
    moments = _moments(network, log, until_s)
    off_road = wrong_way = 0
    over_mps = over_traffic_mps = 0.0
    lane_map = LaneMap(network)
    for moment in moments:
        there = [lane_map.speed_limit_mps(match.lane) or 0.0 for match in moment.matches]
        over_traffic_mps = max(over_traffic_mps, moment.speed_mps - FASTEST_PACE * max(recorded_mps, *there, 0.0))
        if not moment.matches:
            off_road += 1
            continue
        inside = [match for match in moment.matches if match.outside_m == 0.0] or list(moment.matches[:1])
        own = [match for match in inside if _goes_along(network, match, moment.course_rad)]
        in_junction = any(network.road_by_id[match.lane.road_id].junction_id is not None for match in inside)
        if not own and not in_junction and moment.speed_mps > _MOVING_MPS:
            wrong_way += 1
        limits = [lane_map.speed_limit_mps(match.lane) for match in own]
        known = [limit for limit in limits if limit is not None]
        if known:
            over_mps = max(over_mps, moment.speed_mps - max(known))
    return RuleMeasures(
        off_road * _STEP_S, wrong_way * _STEP_S, over_mps, _stop_signs_passed(network, moments), over_traffic_mps
    )


def _moments(network: RoadNetwork, log: VehicleLog, until_s: float) -> list[_Moment]:
    moments = []
    step_s = float(log.time_s[1] - log.time_s[0]) if len(log.time_s) > 1 else _STEP_S
    for k in range(0, int(np.searchsorted(log.time_s, until_s, side="right")), max(1, round(_STEP_S / step_s))):
        x, y = float(log.x_m[k]), float(log.y_m[k])
        if math.hypot(x, y) > _MAP_REACH_M:
            continue
        vx, vy = float(log.velocity_x_mps[k]), float(log.velocity_y_mps[k])
        speed = math.hypot(vx, vy)
        course = math.atan2(vy, vx) if speed > _MOVING_MPS else float(log.heading_rad[k])
        matches = network.nearest_lanes(x, y, _BESIDE_M, z_m=float(log.z_m[k]))
        moments.append(_Moment(speed, course, tuple(matches)))
    return moments


def _goes_along(network: RoadNetwork, match: LaneMatch, course_rad: float) -> bool:
    if network.lane(match.lane).type is LaneType.BIDIRECTIONAL:
        return True
    lane_rad = network.pose(match.lane, match.s_m).heading_rad
    return abs(math.remainder(lane_rad - course_rad, math.tau)) < _AGAINST_RAD


def _stop_signs_passed(network: RoadNetwork, moments: list[_Moment]) -> int:
    """Stop signs that were passed without a halt before them."""
    before: dict[tuple[str, str], float] = {}  # slowest speed on the last metres before each sign
    at: dict[tuple[str, str], int] = {}
    for index, moment in enumerate(moments):
        for match in moment.matches:
            road = network.road_by_id[match.lane.road_id]
            sense = network.direction(match.lane)
            if not _goes_along(network, match, moment.course_rad):
                continue
            for signal in road.signals:
                to_go_m = sense * (signal.s_m - match.s_m)
                facing = signal.orientation == ("+" if sense > 0 else "-")
                if signal.type == SignalType.STOP and facing and 0 <= to_go_m <= _BEFORE_SIGN_M:
                    sign = (road.id, signal.id)
                    before[sign] = min(before.get(sign, math.inf), moment.speed_mps)
                    at[sign] = index
    passed = 0
    for sign, slowest_mps in before.items():
        went_on = any(moment.speed_mps > _HALT_MPS for moment in moments[at[sign] + 1 :])
        passed += slowest_mps > _HALT_MPS and went_on
    return passed
