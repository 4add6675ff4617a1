"""Actions of a driver in a space: pedals and wheel by two numbers, or one of a dozen manoeuvres."""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from gymnasium import spaces

from trace_dag.agents.evaluation.agents import Motion, Recorded
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.scenario.cases import Scenario

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
