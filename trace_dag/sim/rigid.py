"""MuJoCo's part: rigid bodies in the plane, upright, and the contact between them.

Each body is a box with three joints (x, y, yaw) through its centre of gravity, at the height of the road under it;
there is no gravity, since the road carries it. Contact is a stiff spring and damper along the normal, chosen so that
it returns the given restitution whatever the masses. Coulomb friction across it is added here: MuJoCo's own is a convex
relaxation that pushes sliding bodies apart, by a quarter of the impulse in a sideswipe. The crash pulse is therefore
shorter than a real one (some 20 ms and a few centimetres of penetration instead of 100 ms and half a metre of crush);
what it conserves and what it changes, the velocities, is what is wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

from trace_dag.sim.vehicles import VehicleModel

_CONTACT_RATE_RPS = 150.0  # undamped natural frequency of the contact
_MAX_DAMPING_RATIO = 6.0  # beyond it the damper is faster than the contact steps; a restitution of 0.007
Touch = tuple[tuple[int, int], int, list[float], list[float]]
"""A point of contact: the two bodies, its first row among MuJoCo's constraints, its frame and its place."""

_IMPEDANCE = 0.9995  # near 1: the constraint is the spring and damper and nothing else


@lru_cache(maxsize=32)
def damping_ratio(restitution: float) -> float:
    """Damping ratio of a linear spring and damper that pushes only and returns ``restitution`` (0 to 1).

    Inverts the closed form of Schwager and Poeschel, Granular Matter 9 (2007) 465, where the contact ends
    as its force falls to zero, by bisection.

    >>> damping_ratio(1.0) < 1e-6  # nothing is lost
    True
    """
    low, high = 0.0, _MAX_DAMPING_RATIO
    for _ in range(80):
        middle = (low + high) / 2
        if _restitution(middle) > restitution:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _restitution(ratio: float) -> float:
    if ratio < 1:
        root = math.sqrt(1 - ratio * ratio)
        return math.exp(-ratio / root * math.atan2(2 * ratio * root, 2 * ratio * ratio - 1))
    if ratio == 1:
        return math.exp(-2)
    root = math.sqrt(ratio * ratio - 1)
    return math.exp(-ratio / root * math.log((ratio + root) / (ratio - root)))


class RigidBodies:
    """The bodies of one simulation in MuJoCo. Coordinates of body i: x, y, yaw of its centre of gravity."""

    def __init__(self, models: list[VehicleModel], restitution: float, friction: float) -> None:
        import mujoco

        self._mujoco = mujoco
        self._count = len(models)
        self._model = mujoco.MjModel.from_xml_string(self._mjcf(models, restitution))
        self._data = data = mujoco.MjData(self._model)
        # Parts of MuJoCo's own memory: the vehicles come first in it, three numbers each.
        numbers = 3 * len(models)
        self._positions, self._rates = data.qpos[:numbers], data.qvel[:numbers]
        self._forces = data.qfrc_applied[:numbers]
        self._friction = friction
        self._inverse = [(1.0 / m.body.mass_kg, 1.0 / m.yaw_inertia_kgm2) for m in models]
        self.version = mujoco.mj_versionString()

    def _mjcf(self, models: list[VehicleModel], restitution: float) -> str:
        return (
            '<mujoco><compiler inertiafromgeom="false"/>'
            '<option gravity="0 0 0" integrator="Euler"/>'
            f"<worldbody>{vehicle_bodies(models, restitution, lambda *_: '')}</worldbody></mujoco>"
        )

    def place(self, positions: list[float], velocities: list[float]) -> None:
        """Set every body's x, y, yaw and their rates, flat lists."""
        self._positions[:] = positions
        self._rates[:] = velocities

    def set_heights(self, heights_m: list[float]) -> None:
        """Heights of the road under the bodies."""
        self._model.body_pos[1 : 1 + self._count, 2] = heights_m

    @property
    def state(self) -> tuple[list[float], list[float]]:
        """Every body's x, y, yaw and their rates, flat lists."""
        return self._positions.tolist(), self._rates.tolist()

    def step(self, forces: list[float], step_s: float, count: int = 1) -> dict[tuple[int, int], tuple[float, float]]:
        """Advance ``count`` steps of ``step_s`` under constant forces x, y and moments.

        Returns the force x, y (N) on the second body of each touching pair, over the last of the steps.
        """
        self._model.opt.timestep = step_s
        self._forces[:] = forces
        self._mujoco.mj_step(self._model, self._data, count)
        return self._rub(count * step_s) if self._data.ncon else {}

    def _touching(self) -> Iterator[Touch]:
        """Every point of contact between two vehicles, by the numbers of their bodies; a body has one shape."""
        contacts: Any = self._data.contact
        return zip(
            map(tuple, contacts.geom.tolist()),
            contacts.efc_address.tolist(),
            contacts.frame.tolist(),
            contacts.pos.tolist(),
            strict=True,
        )

    def _rub(self, over_s: float) -> dict[tuple[int, int], tuple[float, float]]:
        """Friction at every point of contact, as an impulse now: as much as stops the sliding there, but no more than
        Coulomb's share of the normal force ``over_s``. Returns the forces of all contacts, friction among them."""
        total: dict[tuple[int, int], tuple[float, float]] = {}
        positions, rates, forces = self._positions.tolist(), self._rates.tolist(), self._data.efc_force.tolist()
        # Contacts without friction of MuJoCo's have one row of constraint each: its force is the normal one.
        for pair, row, (nx, ny, *_), (px, py, _) in self._touching():
            normal_n = forces[row] if row >= 0 else 0.0
            tx, ty = -ny, nx
            sliding = yielding = 0.0  # of the second body past the first, and how easily an impulse changes it
            arms = []
            for sign, body in zip((-1.0, 1.0), pair, strict=True):
                k = 3 * body
                rx, ry = px - positions[k], py - positions[k + 1]
                arm = rx * ty - ry * tx
                per_mass, per_inertia = self._inverse[body]
                sliding += sign * (rates[k] * tx + rates[k + 1] * ty + rates[k + 2] * arm)
                yielding += per_mass + arm * arm * per_inertia
                arms.append((sign, k, arm, per_mass, per_inertia))
            most = self._friction * max(normal_n, 0.0) * over_s
            impulse = min(most, max(-most, -sliding / yielding))
            for sign, k, arm, per_mass, per_inertia in arms:
                rates[k] += sign * impulse * tx * per_mass
                rates[k + 1] += sign * impulse * ty * per_mass
                rates[k + 2] += sign * impulse * arm * per_inertia
            x, y = total.get(pair, (0.0, 0.0))
            across_n = impulse / over_s
            total[pair] = (x + normal_n * nx + across_n * tx, y + normal_n * ny + across_n * ty)
        self._rates[:] = rates
        return total


def vehicle_bodies(models: list[VehicleModel], restitution: float, inside: Callable[[int, VehicleModel], str]) -> str:
    """The vehicles as MJCF, in their order; ``inside`` gives what a vehicle's body has beside its box."""
    stiffness = _CONTACT_RATE_RPS**2
    damping = 2 * damping_ratio(restitution) * _CONTACT_RATE_RPS
    geom = f'solref="{-stiffness} {-damping}" solimp="{_IMPEDANCE} {_IMPEDANCE} 0.001" condim="1"'
    return "".join(
        f'<body><inertial pos="0 0 0" mass="{m.body.mass_kg!r}" '
        f'diaginertia="{m.yaw_inertia_kgm2!r} {m.yaw_inertia_kgm2!r} {m.yaw_inertia_kgm2!r}"/>'
        '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        f'<geom name="v{i}" type="box" pos="{-m.cg_ahead_m!r} 0 {m.body.height_m / 2!r}" '
        f'size="{m.body.length_m / 2!r} {m.body.width_m / 2!r} {m.body.height_m / 2!r}" {geom}/>{inside(i, m)}</body>'
        for i, m in enumerate(models)
    )
