"""Signs, lights, limits, stop lines and marks of a map by the lanes where they hold, for the forms made of lanes."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.reconstruction.scene.approach_finder import TURN_RAD
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.model import LaneRef, Road, Signal, SignalType
from trace_dag.roads.map.network import RoadNetwork


class Post(NamedTuple):
    """A sign or light, and the lanes whose traffic passes it."""

    signal: Signal
    lanes: tuple[LaneRef, ...]


class Limit(NamedTuple):
    """A limit, and the lanes of a road where it holds; ``sign`` is None for an unsigned limit."""

    speed_mps: float
    lanes: tuple[LaneRef, ...]
    sign: Signal | None


class LaneRules:
    """The drivable lanes of a map (``shapes``) and their ``limits``, ``signs`` to stop or yield, and ``lights``."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self.shapes = [shape for shape in lane_shapes(network, drivable_only=True) if shape.length_m > 0.0]
        self._known = {shape.ref for shape in self.shapes}
        posts = [post for road in network.roads for post in self._posts(road)]
        self.limits = self._limits_of(
            {post.lanes: post.signal for post in posts if post.signal.type == SignalType.LIMIT}
        )
        self.signs = [post for post in posts if post.signal.type in (SignalType.YIELD, SignalType.STOP)]
        self.lights = [post for post in posts if post.signal.type == SignalType.LIGHT]

    def _posts(self, road: Road) -> Iterator[Post]:
        lanes = [ref for ref in self._network.drivable_lanes_of(road) if ref in self._known]
        for signal in road.signals:
            direction = -1 if signal.orientation == "-" else 1
            passed = [
                ref
                for ref in lanes
                for begin_m, end_m in [self._network.lane_span(ref)]
                if self._network.direction(ref) == direction and begin_m <= signal.s_m <= end_m
            ]
            if passed:
                yield Post(signal, tuple(passed))

    def _limits_of(self, signs: Mapping[tuple[LaneRef, ...], Signal]) -> list[Limit]:
        """Return the limits of each road and direction, with the sign on that road, if there is one."""
        by_limit: dict[tuple[str, int, float], list[LaneRef]] = defaultdict(list)
        for shape in self.shapes:
            if shape.speed_mps is not None:
                key = (shape.ref.road_id, self._network.direction(shape.ref), shape.speed_mps)
                by_limit[key].append(shape.ref)
        sign_of = {ref: signal for lanes, signal in signs.items() for ref in lanes}
        return [
            Limit(speed_mps, tuple(refs), next((sign_of[ref] for ref in refs if ref in sign_of), None))
            for (_, _, speed_mps), refs in by_limit.items()
        ]

    def stop_line(self, ref: LaneRef, s_m: float) -> FloatArray:
        """Return the left and right ends of a line across a lane, shape (2, 3)."""
        half_m = self._network.width_m(ref, s_m) / 2
        poses = [self._network.pose(ref, s_m, offset_m) for offset_m in (half_m, -half_m)]
        return np.array([(pose.x_m, pose.y_m, pose.z_m) for pose in poses])


def place_of(network: RoadNetwork, road_id: str, signal: Signal) -> FloatArray:
    """Return the position of a signal's lower edge: x, y, z (m, local frame)."""
    road = network.road_geometry(road_id)
    x, y, heading, _ = road.line.at(signal.s_m)
    z = road.height_at(signal.s_m) + signal.z_offset_m
    return np.array([x - signal.t_m * math.sin(heading), y + signal.t_m * math.cos(heading), z])


def mark_of(network: RoadNetwork, ref: LaneRef, *, left: bool) -> tuple[str, str] | None:
    """Return the kind and colour of the line on a lane's side of one of its borders, as the law requires.

    None without a line.
    """
    road = network.road_by_id[ref.road_id]
    outer = left == road.left_hand
    outward = 1 if ref.lane_id > 0 else -1
    number = ref.lane_id if outer else ref.lane_id - outward
    lane = next((each for each in road.lane_sections[ref.section].lanes if each.id == number), None)
    mark = None if lane is None else lane.legal_mark or lane.mark
    if mark is None:
        return None
    first = outer or (number == 0 and ref.lane_id > 0)  # parts: from the inner lane out, of the centre from the left
    part = mark.type.split(" ")[0 if first else -1]
    return (part, mark.colour) if part in ("solid", "broken") else None


def turn_of(shape: LaneShape) -> str:
    """Return the turn of a connecting lane, from the headings of its ends: Straight, Left or Right."""
    steps = np.diff(shape.centre_m[:, :2], axis=0)
    (x, y), (end_x, end_y) = steps[0], steps[-1]
    turn_rad = math.atan2(x * end_y - y * end_x, x * end_x + y * end_y)
    return "Straight" if abs(turn_rad) < TURN_RAD else "Left" if turn_rad > 0 else "Right"
