"""Spaces of observations and actions: arrays of fixed shapes in the vehicle's own axes, x ahead, y to the left, metres.

Everything is ``float32``, clipped to the bounds of its space; missing rows are 0, and a mask marks the present ones. An
observation does not reveal the crash or its place.
"""

from __future__ import annotations

import math
from typing import Any, Final, Literal

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from trace_dag.agents.evaluation.agents import Motion, Observation, OwnState, Recorded
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.roads.map.lane_map import LaneMap, PathFollower
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.cases import Scenario
from trace_dag.simulation.types import BodyKind

Seen = dict[str, NDArray[Any]]

OTHERS: Final = 12
"""Road users in an observation, the nearest ones."""
ROUTE_POINTS, ROUTE_STEP_M = 20, 5.0
"""Points of the route ahead, and how far apart they are."""
LANE_POINTS: Final = 48
"""Points of lane centres in an observation, the nearest ones."""

_LANE_STEP_M = 5.0
_REACH_M, _FASTEST_MPS, _LONGEST_M, _YAW_RPS = 300.0, 100.0, 40.0, 10.0

_OWN = (  # speed ahead and to the left, yaw rate, length, width, friction of the road
    (-_FASTEST_MPS, _FASTEST_MPS),
    (-_FASTEST_MPS, _FASTEST_MPS),
    (-_YAW_RPS, _YAW_RPS),
    (0.0, _LONGEST_M),
    (0.0, _LONGEST_M),
    (0.0, 2.0),
)
_PLACE = ((-_REACH_M, _REACH_M), (-_REACH_M, _REACH_M), (-1.0, 1.0), (-1.0, 1.0))  # x, y, cosine and sine of heading
_OTHER = (
    *_PLACE,
    (-_FASTEST_MPS, _FASTEST_MPS),  # velocity ahead and to the left, over the ground
    (-_FASTEST_MPS, _FASTEST_MPS),
    (0.0, _LONGEST_M),  # length, width
    (0.0, _LONGEST_M),
    (0.0, 1.0),  # 1 for a person, on foot or riding
)
_LANE = (*_PLACE, (0.0, 30.0), (0.0, _FASTEST_MPS))  # width, speed limit (0 where the map has none)


def observation_space() -> spaces.Space[Seen]:
    """Return the space of :func:`as_seen`."""
    made: spaces.Space[Any] = spaces.Dict(
        {
            "own": _box(_OWN),
            "others": _box(_OTHER, OTHERS),
            "others_mask": spaces.MultiBinary(OTHERS),
            "route": _box(_PLACE, ROUTE_POINTS),
            "lanes": _box(_LANE, LANE_POINTS),
            "lanes_mask": spaces.MultiBinary(LANE_POINTS),
        }
    )
    return made


def _box(columns: tuple[tuple[float, float], ...], rows: int | None = None) -> spaces.Box:
    low, high = (np.array(bounds, np.float32) for bounds in zip(*columns, strict=True))
    if rows is not None:
        low, high = np.tile(low, (rows, 1)), np.tile(high, (rows, 1))
    return spaces.Box(low, high, dtype=np.float32)


class LanePoints:
    """Points on the centres of all lanes of a map, five metres apart, with heading, width and limit; made once."""

    def __init__(self, network: RoadNetwork) -> None:
        rows, lane_map = [], LaneMap(network)
        for ref in network.drivable_lanes():
            line = network.centreline(ref, _LANE_STEP_M)
            geometry = network.geometry(ref)
            width = geometry.width.at((geometry.begin_m + geometry.end_m) / 2)
            limit = lane_map.speed_limit_mps(ref) or 0.0
            rows.append(np.column_stack([line[:, [0, 1, 3]], np.full(len(line), width), np.full(len(line), limit)]))
        self.table = np.concatenate(rows) if rows else np.zeros((0, 5))
        """Shape (n, 5): x, y (m), heading (rad), width (m), speed limit (m/s)."""

    def nearest(self, x_m: float, y_m: float, count: int) -> NDArray[np.float64]:
        """Return the points nearest to a place, nearest first, shape (up to ``count``, 5)."""
        square = (self.table[:, 0] - x_m) ** 2 + (self.table[:, 1] - y_m) ** 2
        near = np.argpartition(square, count)[:count] if len(square) > count else np.arange(len(square))
        near = near[np.argsort(square[near], kind="stable")]
        return np.asarray(self.table[near])


class Eyes:
    """Turns the observations of one driver in one scenario into arrays."""

    def __init__(self, scenario: Scenario, lanes: LanePoints) -> None:
        self._scenario = scenario
        self._route = PathFollower(scenario.route)
        self._lanes = lanes

    def as_seen(self, seen: Observation) -> Seen:
        """Return an observation in :func:`observation_space`."""
        own, body = seen.own, self._scenario.body
        c, s = math.cos(own.heading_rad), math.sin(own.heading_rad)
        sideways = own.velocity_y_mps * c - own.velocity_x_mps * s
        me = (own.speed_mps, sideways, own.yaw_rate_rps, body.length_m, body.width_m, self._scenario.friction)
        others, others_mask = _padded(_others(seen, c, s), _OTHER, OTHERS)
        near = self._lanes.nearest(own.x_m, own.y_m, LANE_POINTS)
        lanes = np.column_stack([_placed(near[:, 0], near[:, 1], near[:, 2], own), near[:, 3:]])
        shown, lanes_mask = _padded(lanes, _LANE, LANE_POINTS)
        at_m, _ = self._route.locate(own.x_m, own.y_m)
        x, y, heading = self._scenario.route.plan(at_m + ROUTE_STEP_M * np.arange(1.0, ROUTE_POINTS + 1))
        route, _ = _padded(_placed(x, y, heading, own), _PLACE, ROUTE_POINTS)
        return {
            "own": _clipped(np.array(me), _OWN),
            "others": others,
            "others_mask": others_mask,
            "route": route,
            "lanes": shown,
            "lanes_mask": lanes_mask,
        }


def _others(seen: Observation, c: float, s: float) -> NDArray[np.float64]:
    own = seen.own
    near = sorted(seen.others, key=lambda each: (each.x_m - own.x_m) ** 2 + (each.y_m - own.y_m) ** 2)[:OTHERS]
    if not near:
        return np.zeros((0, len(_OTHER)))
    x, y, heading, vx, vy, length, width = np.array(
        [(e.x_m, e.y_m, e.heading_rad, e.velocity_x_mps, e.velocity_y_mps, e.length_m, e.width_m) for e in near]
    ).T
    person = np.array([each.kind is not BodyKind.MOTOR_VEHICLE for each in near], float)
    return np.column_stack([_placed(x, y, heading, own), vx * c + vy * s, vy * c - vx * s, length, width, person])


def _placed(
    x_m: NDArray[np.float64], y_m: NDArray[np.float64], heading_rad: NDArray[np.float64], own: OwnState
) -> NDArray[np.float64]:
    """Return positions in the vehicle's axes, shape (n, 4): x, y, cosine and sine of the heading."""
    c, s = math.cos(own.heading_rad), math.sin(own.heading_rad)
    dx, dy, turned = x_m - own.x_m, y_m - own.y_m, heading_rad - own.heading_rad
    return np.column_stack([dx * c + dy * s, dy * c - dx * s, np.cos(turned), np.sin(turned)])


def _padded(
    rows: NDArray[np.float64], columns: tuple[tuple[float, float], ...], count: int
) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
    out, mask = np.zeros((count, len(columns)), np.float32), np.zeros(count, np.int8)
    out[: len(rows)] = _clipped(rows, columns)
    mask[: len(rows)] = 1
    return out, mask


def _clipped(values: NDArray[np.float64], columns: tuple[tuple[float, float], ...]) -> NDArray[np.float32]:
    low, high = np.array(columns).T
    return np.clip(values, low, high).astype(np.float32)


# --- actions ---------------------------------------------------------------------------------------------------------
ActionKind = Literal["continuous", "discrete"]

HARDEST_MPS2: Final = GRAVITY_MPS2
"""Braking of the action -1; a vehicle does of it what its tyres allow on this road."""
BRISKEST_MPS2: Final = 4.0
"""Acceleration of the action +1."""
ASIDE_M: Final = 2.0
"""Distance beside its way at which a vehicle gets past."""

_GENTLE_MPS2 = 3.0
MANOEUVRES: Final[tuple[tuple[str, float | None, float], ...]] = (
    ("recorded", None, 0.0),
    ("keep", 0.0, 0.0),
    ("accelerate", 2.0, 0.0),
    ("brake", -_GENTLE_MPS2, 0.0),
    ("brake_hard", -HARDEST_MPS2, 0.0),
    ("left", 0.0, ASIDE_M),
    ("right", 0.0, -ASIDE_M),
    ("brake_left", -_GENTLE_MPS2, ASIDE_M),
    ("brake_right", -_GENTLE_MPS2, -ASIDE_M),
    ("brake_hard_left", -HARDEST_MPS2, ASIDE_M),
    ("brake_hard_right", -HARDEST_MPS2, -ASIDE_M),
)
"""The discrete actions by number: name, acceleration (m/s2), and how far left of its way (m). ``recorded`` leaves the
wheel to the recorded driver; the way of the others is the one the vehicle took, without the crash."""


def action_space(kind: ActionKind) -> spaces.Space[Any]:
    """Return the action space of a kind.

    ``continuous``: acceleration and steering, each from -1 to 1 (left is positive). ``discrete``: :data:`MANOEUVRES`.
    """
    if kind == "discrete":
        return spaces.Discrete(len(MANOEUVRES))
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


class Hands:
    """Turns the actions of one driver in one scenario into motions for the loop."""

    def __init__(self, scenario: Scenario, kind: ActionKind) -> None:
        self._kind = kind
        self._max_steer_rad = scenario.vehicle.max_steer_rad
        self._ways = {aside_m: _beside(scenario.recorded_path, aside_m) for aside_m in (0.0, ASIDE_M, -ASIDE_M)}

    def act(self, action: Any) -> Motion | Recorded:
        """Return the motion for an action.

        Raises :class:`UserError` for an action of another shape, or with numbers that are not finite, as an evaluation
        refuses it.
        """
        given = np.asarray(action, float)
        if given.shape != (() if self._kind == "discrete" else (2,)) or not np.isfinite(given).all():
            expected = f"a number below {len(MANOEUVRES)}" if self._kind == "discrete" else "two finite numbers"
            raise UserError(f"action {action!r}: expected {expected}")
        if self._kind == "discrete":
            if not 0 <= given < len(MANOEUVRES):
                raise UserError(f"action {action!r}: expected a number below {len(MANOEUVRES)}")
            _, acceleration, aside_m = MANOEUVRES[int(given)]
            if acceleration is None:
                return Recorded()
            return Motion(acceleration_mps2=acceleration, path_m=self._ways[aside_m])
        along, left = (float(value) for value in np.clip(given, -1.0, 1.0))
        acceleration = along * (BRISKEST_MPS2 if along > 0 else HARDEST_MPS2)
        return Motion(acceleration_mps2=acceleration, steer_rad=left * self._max_steer_rad)


def _beside(path: Path, aside_m: float) -> FloatArray:
    """Return points ``aside_m`` left of a path, x and y, shape (n, 2)."""
    x = path.x_m - aside_m * np.sin(path.heading_rad)
    y = path.y_m + aside_m * np.cos(path.heading_rad)
    return np.column_stack([x, y])
