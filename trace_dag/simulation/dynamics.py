"""Planar single-track vehicle: its state, its tyres, its driver up to the first contact, and its motion afterwards.

The body is rigid. MuJoCo moves it while bodies can touch; this module computes the forces of the road at each step, and
moves it at all other times. Both axles carry their static load (no load transfer, no suspension, no roll). Frame of
forces: the local frame, at the centre of gravity.

* Driven: each axle's tyre force is friction-limited by an ellipse; lateral force saturates as a tanh of the slip with
  the class's cornering stiffness. The driver compares the plan at the current time and demands the acceleration that
  brings position and velocity back to it; the longitudinal part becomes traction or braking, the lateral part a
  steering angle, by inverting the front tyre (Kritayakirana and Gerdes, IJVAS 2012). At walking pace, where tyre slip
  is undefined, steering is kinematic. The motion stays within the forces of the tyres.
* Free (after the impact, or beyond the plan's end): nobody drives. A share of each axle's load is on locked wheels,
  which slide with full friction against their velocity; the rest is on free-rolling ones, which only resist sideways.
  Wheels point ahead.

A driver who strikes a person is not in a crash: see :mod:`trace_dag.simulation.post_impact_driving`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.overturn import ROLLS_G, Roll
from trace_dag.simulation.plan import SampledTrajectory
from trace_dag.simulation.post_impact_driving import PostImpactDriver
from trace_dag.simulation.states import LossOfControl
from trace_dag.simulation.surface import Ground
from trace_dag.simulation.types import AfterStriking, Participant
from trace_dag.simulation.vehicles import VehicleModel

_POSITION_GAIN = 6.0  # 1/s2
_VELOCITY_GAIN = 5.0  # 1/s; damping ratio 1
_YAW_DAMPING = 3.0  # 1/s
_LOOKAHEAD_M = 4.0  # of kinematic steering
_KINEMATIC_BELOW_MPS, _DYNAMIC_ABOVE_MPS = 3.0, 5.0
_SLIP_FLOOR_MPS = 1.0  # slip angles are taken as if at least this fast
_SLIDE_FLOOR_MPS = 0.2  # sliding friction fades below this speed
_ROLLING_RESISTANCE = 0.015
_ATANH_LIMIT = 0.98
_LEAST_GRIP_2 = 0.01  # of the squared grip, left across however hard a tyre brakes
_TOPPLED_FRICTION = 0.6  # of a motorcycle on its side, relative to rubber on the same road
_REST_MPS, _REST_RPS = 0.08, 0.05


class Vehicle:
    """One simulated vehicle: state at its centre of gravity, controls, and driver."""

    __slots__ = (
        "_after_strike",
        "_along_n",
        "_axles",
        "_drag_n",
        "_friction",
        "_front_floor_2",
        "_front_grip_2",
        "_front_share",
        "_limit_n",
        "_locked_wheels",
        "_losses",
        "_mass",
        "_outline",
        "_outline_place",
        "_plan",
        "_planned_steps",
        "_rear_floor_2",
        "_rear_grip_2",
        "_toppled",
        "_traction_n",
        "_turned_rad",
        "_yaw_damping",
        "crashed",
        "digs_in",
        "ground",
        "heading",
        "held_mps2",
        "lost_from_step",
        "model",
        "next_loss_step",
        "number",
        "off_road",
        "plan_end_s",
        "reach_m",
        "roll",
        "side_grip",
        "skids_from_s",
        "steer",
        "vx",
        "vy",
        "x",
        "y",
        "yaw_rate",
        "z",
    )

    def __init__(
        self,
        participant: Participant,
        model: VehicleModel,
        plan: SampledTrajectory,
        *,
        friction: float,
        locked_wheels: float,
    ) -> None:
        pose, speed = participant.initial_pose, participant.initial_speed_mps
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        self.model = model
        self.number = participant.number
        self.plan_end_s = plan.end_s
        self.skids_from_s = participant.skids_from_s
        self.reach_m = math.hypot(model.body.length_m / 2 + abs(model.cg_ahead_m), model.body.width_m / 2)
        self.x = pose.x_m + model.cg_ahead_m * c
        self.y = pose.y_m + model.cg_ahead_m * s
        self.z = pose.z_m
        self.heading = pose.heading_rad
        self._outline_place = self.x, self.y, self.heading
        self._outline = self.outline_at(*self._outline_place)
        self.yaw_rate = plan.row(0)[7] * speed  # it starts in the bend it is in
        self.vx = speed * c - model.cg_ahead_m * self.yaw_rate * s
        self.vy = speed * s + model.cg_ahead_m * self.yaw_rate * c
        self.steer = 0.0
        self.crashed = False
        self.roll: Roll | None = None  # of one that can overturn
        self.side_grip = 1.0  # across, of who is out of control: more where wheels dig in
        self.ground = Ground(math.inf, math.inf, pose.z_m, 0.0, 0.0)  # not looked at yet
        self._plan = plan
        self._after_strike: PostImpactDriver | None = None
        self._planned_steps = len(plan) if plan.end_s > 0 else sys.maxsize  # one point: it stands there for good
        self.held_mps2: tuple[float, float] | None = None  # what a trailer did to it in the last step
        self._friction = -1.0
        self._locked_wheels = locked_wheels
        self.lost_from_step, self._turned_rad = sys.maxsize, 0.0
        self._losses: list[tuple[int, LossOfControl]] = []
        self.next_loss_step, self.digs_in = sys.maxsize, False
        self.off_road = False  # beyond the pavement nobody accelerates
        self._toppled = participant.body.vehicle_class is VehicleClass.MOTORCYCLE
        self._mass = model.body.mass_kg
        self._traction_n = (self._mass + model.pulled_kg) * model.max_acceleration_mps2
        self._front_share = model.front_share
        self.stand_on(friction)
        self._yaw_damping = model.yaw_inertia_kgm2 / model.wheelbase_m * _YAW_DAMPING
        self._axles: tuple[tuple[float, float, float], ...] = (
            (model.front_axle_m, model.front_load_n, model.front_stiffness_npr),
            (-model.rear_axle_m, model.rear_load_n, model.rear_stiffness_npr),
        )
        self._drag_n = 0.0
        self._along_n = 0.0

    def stand_on(self, friction: float) -> None:
        """Set the friction of the ground, as for a car's tyres, from now on."""
        friction *= self.model.tyre_grip
        if friction == self._friction:
            return
        self._friction = friction
        self._limit_n = friction * self._mass * GRAVITY_MPS2 + friction * self.model.carried_n
        self._front_grip_2 = (friction * self.model.front_load_n) ** 2
        self._rear_grip_2 = (friction * self.model.rear_load_n) ** 2
        self._front_floor_2, self._rear_floor_2 = _LEAST_GRIP_2 * self._front_grip_2, _LEAST_GRIP_2 * self._rear_grip_2

    def lose_control(self, losses: Sequence[tuple[int, LossOfControl]]) -> None:
        """Remove the driver from the first of these steps on.

        The assumptions of a loss hold until the next one.
        """
        self._losses = list(losses)
        self.lost_from_step, self.next_loss_step = losses[0][0], losses[0][0]

    def begin_loss(self) -> None:
        """Apply the assumptions of the next loss of control."""
        _, loss = self._losses.pop(0)
        self._turned_rad, self.digs_in = loss.wheels_rad, loss.digs_in
        self.yaw_rate += loss.yaw_rps
        if loss.locked_wheels is not None:
            self._locked_wheels = loss.locked_wheels
        self.next_loss_step = self._losses[0][0] if self._losses else sys.maxsize

    def carry(self, time_s: float, step_s: float) -> None:
        """Move the vehicle to its planned place and motion at a time."""
        at = min(time_s / step_s, len(self._plan) - 1.001)
        k = int(at)
        before, after, share = self._plan.row(k), self._plan.row(k + 1), at - k
        x, y, vx, vy, _, _, _, _, heading, _ = (a + share * (b - a) for a, b in zip(before, after, strict=True))
        self.x, self.y, self.vx, self.vy, self.heading = x, y, vx, vy, heading
        self.yaw_rate = (after[8] - before[8]) / step_s

    def from_plan_m(self, time_s: float, step_s: float) -> float:
        """Return the distance of the vehicle from its planned place at a time."""
        x, y, *_ = self._plan.row(min(int(time_s / step_s), len(self._plan) - 1))
        return math.hypot(self.x - x, self.y - y)

    @property
    def follows_plan(self) -> bool:
        """Return whether it moves as planned, while it is not out of control."""
        return True

    def outline(self) -> Outline:
        """Return the body's outline now."""
        here = self.x, self.y, self.heading
        if here != self._outline_place:  # asked for many times in one state
            self._outline_place, self._outline = here, self.outline_at(*here)
        return self._outline

    def outline_at(self, x_m: float, y_m: float, heading_rad: float) -> Outline:
        """Return the body's outline with its centre of gravity elsewhere."""
        ahead, body = self.model.cg_ahead_m, self.model.body
        return Outline(
            x_m - ahead * math.cos(heading_rad),
            y_m - ahead * math.sin(heading_rad),
            heading_rad,
            body.length_m / 2,
            body.width_m / 2,
        )

    def body_state(self) -> BodyState:
        """Return the state of the body's centre now."""
        ahead, c, s = self.model.cg_ahead_m, math.cos(self.heading), math.sin(self.heading)
        return BodyState(
            self.number,
            self.x - ahead * c,
            self.y - ahead * s,
            self.z,
            self.heading,
            self.vx + ahead * self.yaw_rate * s,
            self.vy - ahead * self.yaw_rate * c,
            self.yaw_rate,
        )

    @property
    def at_rest(self) -> bool:
        """Return whether it no longer moves."""
        if self.roll is not None and not self.roll.settled:
            return False
        return math.hypot(self.vx, self.vy) < _REST_MPS and abs(self.yaw_rate) < _REST_RPS

    def road_force(self, step: int) -> tuple[float, float, float]:
        """Return the force x, y (N) and yaw moment (Nm) of the road for the step that begins now."""
        fx, fy, moment = self._tyre_force(step)
        if self.ground.slope_x or self.ground.slope_y:
            weight = self._mass * GRAVITY_MPS2
            return fx - weight * self.ground.slope_x, fy - weight * self.ground.slope_y, moment
        return fx, fy, moment

    def advance(self, force: tuple[float, float, float], step_s: float) -> None:
        """Move by one step under a force x, y (N) and a moment (Nm), by MuJoCo's semi-implicit Euler scheme."""
        fx, fy, moment = force
        per_mass = step_s / self._mass
        self.vx = vx = self.vx + fx * per_mass
        self.vy = vy = self.vy + fy * per_mass
        self.yaw_rate = yaw_rate = self.yaw_rate + moment * step_s / self.model.yaw_inertia_kgm2
        self.x += vx * step_s
        self.y += vy * step_s
        self.heading += yaw_rate * step_s

    def log_row(self) -> tuple[float, ...]:
        """Return the state as the recorder keeps it, at the centre of gravity."""
        state = (self.x, self.y, self.z, self.heading, self.vx, self.vy, self.yaw_rate, self.steer, *self.pedals)
        if self.roll is None:
            return (*state, self.model.body.height_m / 2, 0.0)
        return (*state, self.roll.above_road_m, self.roll.roll_rad)

    def strike(self, step: int, response: AfterStriking, step_s: float, *, beside: bool = False) -> None:
        """Record that the driver struck a person, or was pushed ``beside`` the path.

        The driver responds only to the first of several events.
        """
        if self._after_strike is None:
            self._after_strike = PostImpactDriver(self._plan, step, response, step_s, beside=beside)

    @property
    def stops(self) -> bool:
        """Return whether its driver brakes to a stop, regardless of the plan."""
        return self._after_strike is not None and self._after_strike.stops

    def _tyre_force(self, step: int) -> tuple[float, float, float]:
        if step >= self.lost_from_step:
            self.crashed = True
        if self.crashed:
            rolls = self.roll is not None and self.roll.over and not self._toppled
            turned_rad = self._turned_rad
            return self._rolling() if rolls else self._free(self._locked_wheels, turned_rad)
        if self._after_strike is not None:
            ahead_v = self.vx * math.cos(self.heading) + self.vy * math.sin(self.heading)
            return self._driven(self._after_strike.row(step, self.x, self.y, ahead_v))
        if step < self._planned_steps:
            return self._driven(self._plan.row(step if step < len(self._plan) else -1))
        return self._free(1.0)

    def _driven(self, row: Sequence[float]) -> tuple[float, float, float]:
        # The loop spends most of its time here: locals and comparisons instead of attributes, min and max.
        rx, ry, rvx, rvy, rax, ray, planned_speed, curvature, course, _ = row
        if self.held_mps2 is not None:  # what a trailer takes, the driver adds
            rax, ray = rax - self.held_mps2[0], ray - self.held_mps2[1]
        vx, vy, yaw_rate, ground = self.vx, self.vy, self.yaw_rate, self.ground
        if vx == 0.0 == vy == yaw_rate == planned_speed and self._drag_n == 0.0:
            self._along_n = 0.0
            return 0.0, 0.0, 0.0  # stands on its brakes: no tyre slips, so that none pushes
        model, mass, limit = self.model, self._mass, self._limit_n
        a, b = model.front_axle_m, model.rear_axle_m
        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead_v, left_v = vx * c + vy * s, vy * c - vx * s
        ex, ey = rx - self.x, ry - self.y
        want_x = rax + _VELOCITY_GAIN * (rvx - vx) + _POSITION_GAIN * ex + GRAVITY_MPS2 * ground.slope_x
        want_y = ray + _VELOCITY_GAIN * (rvy - vy) + _POSITION_GAIN * ey + GRAVITY_MPS2 * ground.slope_y
        want_left = want_y * c - want_x * s
        speed = -ahead_v if ahead_v < 0 else ahead_v

        # Along: traction up to what the class accelerates with, braking up to friction; shared by load.
        drag = self._drag_n
        if speed < 0.5 and -0.05 < planned_speed < 0.05:
            along = -limit * max(-1.0, min(1.0, ahead_v / _SLIDE_FLOOR_MPS))  # stands on its brakes
        else:
            along = mass * (want_x * c + want_y * s) + drag
        backward = ahead_v < -0.1 or (ahead_v < 0.1 and planned_speed < 0)
        traction = 0.0 if self.off_road else self._traction_n + (drag if drag > 0 else -drag)
        if traction > limit:
            traction = limit
        low, high = (-traction, limit) if backward else (-limit, traction)
        along = low if along < low else high if along > high else along
        along_f = along * self._front_share
        along_r = along - along_f

        # Across: the rear tyre answers its slip, the front one is steered to the rest.
        floor_v = speed if speed > _SLIP_FLOOR_MPS else _SLIP_FLOOR_MPS
        left_f, left_r = self._front_grip_2 - along_f * along_f, self._rear_grip_2 - along_r * along_r
        cap_f = math.sqrt(left_f if left_f > self._front_floor_2 else self._front_floor_2)
        cap_r = math.sqrt(left_r if left_r > self._rear_floor_2 else self._rear_floor_2)
        slip_r = (left_v - b * yaw_rate) / floor_v
        side_r = -cap_r * math.tanh(model.rear_stiffness_npr * slip_r / cap_r)
        toward_f = left_v + a * yaw_rate
        stiffness_f = model.front_stiffness_npr
        if backward or speed <= _KINEMATIC_BELOW_MPS:
            steer = self._kinematic_steer(ex, ey, curvature, course, ahead_v, left_v, backward)
        else:
            damping = self._yaw_damping * (want_left / ahead_v - yaw_rate)
            side_f = (mass * want_left - side_r + damping - along_f * math.sin(self.steer)) / math.cos(self.steer)
            ratio = side_f / cap_f
            ratio = -_ATANH_LIMIT if ratio < -_ATANH_LIMIT else _ATANH_LIMIT if ratio > _ATANH_LIMIT else ratio
            steer = math.atan2(toward_f, speed) + math.atan(math.atanh(ratio) * cap_f / stiffness_f)
            if speed < _DYNAMIC_ABOVE_MPS:
                share = (speed - _KINEMATIC_BELOW_MPS) / (_DYNAMIC_ABOVE_MPS - _KINEMATIC_BELOW_MPS)
                kinematic = self._kinematic_steer(ex, ey, curvature, course, ahead_v, left_v, backward)
                steer = share * steer + (1 - share) * kinematic
        most = model.max_steer_rad
        steer = -most if steer < -most else most if steer > most else steer
        cs, sn = math.cos(steer), math.sin(steer)
        rolling = abs(ahead_v * cs + toward_f * sn)
        slip_f = (toward_f * cs - ahead_v * sn) / (rolling if rolling > _SLIP_FLOOR_MPS else _SLIP_FLOOR_MPS)
        side_f = -cap_f * math.tanh(stiffness_f * slip_f / cap_f)

        self.steer = steer
        self._drag_n = side_f * sn
        self._along_n = -along if backward else along
        across_f = side_f * cs + along_f * sn
        ahead = along_f * cs - side_f * sn + along_r
        left = across_f + side_r
        return ahead * c - left * s, ahead * s + left * c, a * across_f - b * side_r

    @property
    def pedals(self) -> tuple[float, float]:
        """Return the throttle and brake, 0 to 1, of the last step."""
        if self.crashed:
            return 0.0, self._locked_wheels
        if self._along_n >= 0:
            return min(1.0, self._along_n / self._traction_n), 0.0
        return 0.0, min(1.0, -self._along_n / self._limit_n)

    def _kinematic_steer(
        self, ex: float, ey: float, curvature: float, course: float, ahead_v: float, left_v: float, backward: bool
    ) -> float:
        """Return the steering by geometry.

        It is the curvature that brings the path back to the plan over a fixed distance.
        """
        model = self.model
        offset = ex * math.sin(course) - ey * math.cos(course)  # of the vehicle, left of the plan
        drift = left_v / ahead_v if abs(ahead_v) > 0.5 else model.rear_axle_m * curvature
        angle = math.remainder(self.heading + math.atan(drift) - course, math.tau)
        sense = -1.0 if backward else 1.0
        wanted = curvature - sense * 2 * angle / _LOOKAHEAD_M - offset / _LOOKAHEAD_M**2
        return math.atan(model.wheelbase_m * wanted)

    def _rolling(self) -> tuple[float, float, float]:
        """Return the deceleration of an overturned vehicle, against its motion and its rotation."""
        speed = max(math.hypot(self.vx, self.vy), _SLIDE_FLOOR_MPS)
        drag_n = ROLLS_G * self._mass * GRAVITY_MPS2
        slowing = -drag_n * self.model.wheelbase_m / 4 * max(-1.0, min(1.0, self.yaw_rate / _REST_RPS / 4))
        return -drag_n * self.vx / speed, -drag_n * self.vy / speed, slowing

    def _free(self, locked: float, turned_rad: float = 0.0) -> tuple[float, float, float]:
        """Return the forces on a vehicle without a driver.

        A share of the load slides on locked wheels, the rest rolls; the front wheels are turned to the left by
        ``turned_rad``.
        """
        # As in _driven: locals and comparisons instead of attributes, min and max.
        friction, yaw_rate = self._friction, self.yaw_rate
        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead_v, left_v = self.vx * c + self.vy * s, self.vy * c - self.vx * s
        if self._toppled:
            friction, locked = friction * _TOPPLED_FRICTION, 1.0
        rolling = 1.0 - locked
        speed = -ahead_v if ahead_v < 0 else ahead_v
        floor_v = speed if speed > _SLIP_FLOOR_MPS else _SLIP_FLOOR_MPS
        resist = rolling * (friction if friction < _ROLLING_RESISTANCE else _ROLLING_RESISTANCE)
        if speed < _SLIDE_FLOOR_MPS:
            resist *= speed / _SLIDE_FLOOR_MPS
        if ahead_v < 0:
            resist = -resist
        ahead = left = moment = 0.0
        for arm, load, stiffness in self._axles:
            across_v = left_v + arm * yaw_rate
            past = math.hypot(ahead_v, across_v)
            grip = friction * load
            slide = grip * locked / (past if past > _SLIDE_FLOOR_MPS else _SLIDE_FLOOR_MPS)
            slips_n = stiffness * across_v / floor_v
            turned = turned_rad if arm > 0 else 0.0
            if turned:
                slips_n -= stiffness * math.copysign(turned, turned * ahead_v)
            rolls = -rolling * grip * math.tanh(slips_n / grip) * self.side_grip  # across the wheel, not the body
            side = rolls * math.cos(turned) - slide * across_v * self.side_grip
            ahead -= slide * ahead_v + load * resist + rolls * math.sin(turned)
            left += side
            moment += arm * side
        self.steer = turned_rad
        self._along_n = -locked * self._limit_n
        return ahead * c - left * s, ahead * s + left * c, moment
