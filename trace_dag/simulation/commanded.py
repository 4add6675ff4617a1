"""A vehicle that follows a driver's pedals and steering, on the tyres of :mod:`trace_dag.simulation.dynamics`.

Wheels turn at a limited rate and pedals act with a lag of first order, as in real vehicles: full braking builds up over
a quarter of a second, and steering is continuous.
"""

from __future__ import annotations

import math

from trace_dag.simulation.driving import Pace, Pedals, PlanClock
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.plan import SampledTrajectory
from trace_dag.simulation.types import Participant
from trace_dag.simulation.vehicles import VehicleModel

_STEER_RATE_RPS = 0.7  # of the front wheels: some 600 degrees per second at a steering wheel geared 1 to 15
_PEDAL_LAG_S = 0.1
_REVERSE_TRACTION = 0.5  # of that forward
_SLIP_FLOOR_MPS = 1.0  # slip angles are computed for at least this speed
_HOLD_MPS = 0.2  # brakes fade below this speed: they hold and do not push back
_LEAST_GRIP = 0.1  # share of the grip that is left sideways, however hard a tyre brakes


class CommandedVehicle(Vehicle):
    """A vehicle that follows its plan without a command, or at the last commanded pace.

    With pedals it follows them.
    """

    __slots__ = ("_brake", "_clock", "_step_s", "_throttle", "_wanted")

    def __init__(
        self,
        participant: Participant,
        model: VehicleModel,
        plan: SampledTrajectory,
        *,
        friction: float,
        locked_wheels: float,
        step_s: float,
    ) -> None:
        super().__init__(participant, model, plan, friction=friction, locked_wheels=locked_wheels)
        self._step_s = step_s
        self._throttle = self._brake = 0.0
        self._wanted: Pedals | None = None
        self._clock = PlanClock()

    @property
    def follows_plan(self) -> bool:
        """Return whether the vehicle is where its plan places it, because it has no command."""
        return self._wanted is None and self._clock.is_as_planned

    def command(self, wanted: Pedals | Pace | None, time_s: float) -> None:
        """Set the command from now on; None follows the plan at its own pace."""
        if self._wanted is None:
            self._throttle, self._brake = self.pedals  # taken over where they are
        self._wanted = wanted if isinstance(wanted, Pedals) else None
        self._clock.set_pace(time_s, wanted.pace if isinstance(wanted, Pace) else 1.0)

    def _tyre_force(self, step: int) -> tuple[float, float, float]:
        if self.crashed or step >= self.lost_from_step or self.follows_plan:
            return super()._tyre_force(step)
        if self._wanted is not None:
            return self._commanded(self._wanted)
        return self._paced(step * self._step_s)

    def _paced(self, time_s: float) -> tuple[float, float, float]:
        """Return the force for following the plan at the pace of its clock."""
        at, pace = self._clock.at(time_s) / self._step_s, self._clock.pace
        if at >= len(self._plan) - 1:
            return self._free(1.0) if self.plan_end_s > 0 else super()._tyre_force(0)
        k = int(at)
        before, after, share = self._plan.row(k), self._plan.row(k + 1), at - k
        row = [one + share * (two - one) for one, two in zip(before, after, strict=True)]
        row[2:7] = pace * row[2], pace * row[3], pace**2 * row[4], pace**2 * row[5], pace * row[6]
        return self._driven(row)

    def _commanded(self, wanted: Pedals) -> tuple[float, float, float]:
        model, limit = self.model, self._limit_n
        share = min(1.0, self._step_s / _PEDAL_LAG_S)
        self._throttle += share * (_clip(wanted.throttle, 0.0, 1.0) - self._throttle)
        self._brake += share * (_clip(wanted.brake, 0.0, 1.0) - self._brake)
        turn = _STEER_RATE_RPS * self._step_s
        most = model.max_steer_rad
        self.steer = steer = _clip(_clip(wanted.steer_rad, -most, most), self.steer - turn, self.steer + turn)

        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead_v, left_v = self.vx * c + self.vy * s, self.vy * c - self.vx * s
        traction = min(self._traction_n * self._throttle, limit)
        push = -_REVERSE_TRACTION * traction if wanted.reverse else traction
        along = _clip(push - limit * self._brake * _clip(ahead_v / _HOLD_MPS, -1.0, 1.0), -limit, limit)
        along_f = along * self._front_share
        along_r = along - along_f

        # Both tyres answer their slip, with what grip the longitudinal force leaves them.
        a, b = model.front_axle_m, model.rear_axle_m
        toward_f, toward_r = left_v + a * self.yaw_rate, left_v - b * self.yaw_rate
        cs, sn = math.cos(steer), math.sin(steer)
        slip_f = (toward_f * cs - ahead_v * sn) / max(abs(ahead_v * cs + toward_f * sn), _SLIP_FLOOR_MPS)
        slip_r = toward_r / max(abs(ahead_v), _SLIP_FLOOR_MPS)
        side_f = _side_force(self._front_grip_2, along_f, model.front_stiffness_npr, slip_f)
        side_r = _side_force(self._rear_grip_2, along_r, model.rear_stiffness_npr, slip_r)

        self._along_n = along if ahead_v > -_HOLD_MPS else -along
        across_f = side_f * cs + along_f * sn
        ahead, left = along_f * cs - side_f * sn + along_r, across_f + side_r
        return ahead * c - left * s, ahead * s + left * c, a * across_f - b * side_r


def _side_force(grip_n2: float, along_n: float, stiffness_npr: float, slip: float) -> float:
    cap = math.sqrt(max(grip_n2 - along_n * along_n, _LEAST_GRIP**2 * grip_n2))
    return -cap * math.tanh(stiffness_npr * slip / cap)


def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value
