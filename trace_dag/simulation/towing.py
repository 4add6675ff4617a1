"""A trailer behind a vehicle: a second rigid body, and the hitch that couples the two.

The hitch is a hinge about the vertical. Its force is solved for at every step, so that at the step's end both bodies
have one velocity at the coupling (two equations for a force along and across); gaps by rounding are closed over some
steps. Force and counterforce act at one point: momentum is kept. Solved in the plane it costs little and serves both
ways of stepping, with MuJoCo where bodies can touch and without where none can. Beyond some angle cab or drawbar meet
the trailer, and a moment limits the angle.

Trailers brake as their pulling vehicle does, with the same share of their load. Both are out of control together. A
semitrailer presses on the tractor's axles and rolls with it; a drawbar trailer stays upright.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.crash.parties import trailer_body
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.plan import SampledTrajectory
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import AfterStriking, Body, BodyKind, Participant
from trace_dag.simulation.vehicles import VehicleModel, trailer_model

_TAKEN_BACK = 0.2  # of the distance between both ends of the hitch, per step
_MOST_ARTICULATION_RAD = {True: math.radians(100), False: math.radians(75)}
"""At which a cab meets the front corner of a semitrailer, and a towing vehicle's corner the drawbar trailer behind it:
judgement by the overhangs of both."""


def pulled_body(participant: Participant) -> Body | None:
    """Return the body that a participant pulls."""
    trailer = participant.trailer
    if trailer is None:
        return None
    size_m = trailer.length_m, trailer.width_m, trailer.height_m
    return Body(BodyKind.MOTOR_VEHICLE, VehicleClass.TRAILER, *size_m, trailer.mass_kg)


class Towed(Vehicle):
    """A simulated trailer, without driver and plan of its own."""

    __slots__ = ("puller", "trailer")

    def __init__(self, puller: Vehicle, participant: Participant, body: Body, *, friction: float) -> None:
        assert participant.trailer is not None
        trailer = participant.trailer
        self.puller, self.trailer = puller, trailer
        pose, heading = participant.initial_pose, participant.trailer_heading_rad
        x, y, _ = trailer.behind(
            (np.array(pose.x_m), np.array(pose.y_m), np.array(pose.heading_rad)),
            participant.body.length_m,
            np.array(heading),
        )
        stands = Trajectory(*(np.zeros(1) for _ in range(6)))
        place = Pose(float(x), float(y), heading, pose.z_m)
        plan = SampledTrajectory(np.zeros((1, 10)), 0.0)
        itself = Participant(trailer_body(participant.number), body, place, 0.0, stands)
        super().__init__(itself, trailer_model(body, trailer), plan, friction=friction, locked_wheels=0.0)
        self._axles = self._axles[1:]
        self._roll_on()

    def _roll_on(self) -> None:
        """Follow the hitch without sliding sideways on its axles."""
        puller, model = self.puller, self.model
        behind_m = _hitch_behind_cg_m(puller.model, self.trailer)
        hitch_vx = puller.vx + behind_m * puller.yaw_rate * math.sin(puller.heading)
        hitch_vy = puller.vy - behind_m * puller.yaw_rate * math.cos(puller.heading)
        c, s = math.cos(self.heading), math.sin(self.heading)
        self.yaw_rate = (hitch_vy * c - hitch_vx * s) / model.wheelbase_m
        self.vx = hitch_vx + model.front_axle_m * self.yaw_rate * s
        self.vy = hitch_vy - model.front_axle_m * self.yaw_rate * c

    @property
    def crashed(self) -> bool:
        """Return whether the vehicle that pulls it is out of control."""
        return self.puller.crashed

    @crashed.setter
    def crashed(self, value: bool) -> None:
        self.puller.crashed = value

    @property
    def stops(self) -> bool:
        """Return whether its driver brakes to a stop."""
        return self.puller.stops

    def strike(self, step: int, response: AfterStriking, step_s: float, *, beside: bool = False) -> None:
        """Record a strike of a person or a touch; the driver of the pulling vehicle reacts."""
        self.puller.strike(step, response, step_s, beside=beside)

    @property
    def pedals(self) -> tuple[float, float]:
        """Return the pedals: no throttle, and the brake of the pulling vehicle."""
        return 0.0, self.puller.pedals[1]

    def log_row(self) -> tuple[float, ...]:
        """Return the state for the recorder.

        A semitrailer has the roll of its tractor.
        """
        state = super().log_row()
        roll = self.puller.roll
        if roll is None or not self.trailer.is_semitrailer:
            return state
        body, tilt = self.model.body, roll.roll_rad
        above_m = (body.width_m * abs(math.sin(tilt)) + body.height_m * abs(math.cos(tilt))) / 2
        return (*state[:-2], above_m, tilt)

    def _tyre_force(self, step: int) -> tuple[float, float, float]:
        return self._free(self.pedals[1])


def whole_kg(vehicle: Vehicle) -> float:
    """Return the mass of a vehicle with its trailer, or of a trailer with its pulling vehicle.

    >>> whole_kg(simulated_pair[0])  # a car that pulls nothing
    1600.0
    """
    puller = vehicle.puller if isinstance(vehicle, Towed) else vehicle
    return puller.model.body.mass_kg + puller.model.pulled_kg


def _hitch_behind_cg_m(model: VehicleModel, trailer: Trailer) -> float:
    """Return the distance of a vehicle's coupling behind its centre of gravity."""
    return trailer.hitch_m - model.body.length_m / 2 + model.cg_ahead_m


class Hitch:
    """The coupling of two of a run's vehicles, by their indices."""

    def __init__(self, vehicles: Sequence[Vehicle], puller: int, towed: int) -> None:
        one, two = vehicles[puller], vehicles[towed]
        assert isinstance(two, Towed)
        self._one, self._two = one, two
        self._i, self._j = 3 * puller, 3 * towed
        self._behind_m = _hitch_behind_cg_m(one.model, two.trailer)
        self._ahead_m = two.model.front_axle_m
        self._most_rad = _MOST_ARTICULATION_RAD[two.trailer.is_semitrailer]
        self._per_mass = 1.0 / one.model.body.mass_kg, 1.0 / two.model.body.mass_kg
        self._per_inertia = 1.0 / one.model.yaw_inertia_kgm2, 1.0 / two.model.yaw_inertia_kgm2

    @property
    def pair(self) -> tuple[int, int]:
        """Return the places of both among the run's vehicles."""
        return self._i // 3, self._j // 3

    def hold(self, forces: list[float], step_s: float) -> None:
        """Add the hitch's forces on both vehicles to those of a step: x, y (N) and moment (Nm) of each in a row."""
        one, two, i, j = self._one, self._two, self._i, self._j
        (mass_1, mass_2), (inertia_1, inertia_2) = self._per_mass, self._per_inertia
        ax, ay = -self._behind_m * math.cos(one.heading), -self._behind_m * math.sin(one.heading)
        bx, by = self._ahead_m * math.cos(two.heading), self._ahead_m * math.sin(two.heading)
        rate_1 = one.yaw_rate + forces[i + 2] * inertia_1 * step_s
        rate_2 = two.yaw_rate + forces[j + 2] * inertia_2 * step_s
        # How fast both ends of the hitch would part, and by how much they are to: what they are apart is taken back.
        back = _TAKEN_BACK / step_s
        part_x = (one.vx + forces[i] * mass_1 * step_s - rate_1 * ay) - (
            two.vx + forces[j] * mass_2 * step_s - rate_2 * by
        )
        part_y = (one.vy + forces[i + 1] * mass_1 * step_s + rate_1 * ax) - (
            two.vy + forces[j + 1] * mass_2 * step_s + rate_2 * bx
        )
        part_x += back * (one.x + ax - two.x - bx)
        part_y += back * (one.y + ay - two.y - by)
        xx = mass_1 + mass_2 + inertia_1 * ay * ay + inertia_2 * by * by
        yy = mass_1 + mass_2 + inertia_1 * ax * ax + inertia_2 * bx * bx
        xy = -inertia_1 * ax * ay - inertia_2 * bx * by
        beyond = self._beyond_rad()
        held = 0.0
        if beyond:
            turning = rate_1 - rate_2 + back * beyond
            x_turn, y_turn = -inertia_1 * ay - inertia_2 * by, inertia_1 * ax + inertia_2 * bx
            matrix = ((xx, xy, x_turn), (xy, yy, y_turn), (x_turn, y_turn, inertia_1 + inertia_2))
            x, y, held = np.linalg.solve(np.array(matrix), -np.array((part_x, part_y, turning))).tolist()
        if held * beyond >= 0:  # it closes by itself
            determinant = xx * yy - xy * xy
            x, y, held = -(yy * part_x - xy * part_y) / determinant, -(xx * part_y - xy * part_x) / determinant, 0.0
        x, y, held = x / step_s, y / step_s, held / step_s
        for k, value in zip(
            (i, i + 1, i + 2, j, j + 1, j + 2),
            (x, y, ax * y - ay * x + held, -x, -y, -(bx * y - by * x) - held),
            strict=True,
        ):
            forces[k] += value
        one.held_mps2 = x * mass_1, y * mass_1

    def _beyond_rad(self) -> float:
        angle = math.remainder(self._one.heading - self._two.heading, math.tau)
        return math.copysign(max(abs(angle) - self._most_rad, 0.0), angle)


def couple(vehicles: list[Vehicle], participants: Sequence[Participant], friction: float) -> list[Hitch]:
    """Add every trailer behind its pulling vehicle, after all vehicles; return the hitches.

    >>> from trace_dag.simulation.run import participant
    >>> couple(list(simulated_pair), list(map(participant, hypothesis.participants)), friction=0.7)  # no trailers
    []
    """
    by_number = {each.number: each for each in participants}
    hitches = []
    for i, vehicle in enumerate(tuple(vehicles)):
        participant = by_number[vehicle.number]
        body = pulled_body(participant)
        if body is not None:
            vehicles.append(Towed(vehicle, participant, body, friction=friction))
            hitches.append(Hitch(vehicles, i, len(vehicles) - 1))
    return hitches
