"""The vehicles in MuJoCo: upright rigid bodies that move in the plane.

Each has three joints (x, y, yaw) through its centre of gravity, at the height of the road under it, and no gravity,
since the road carries it. Vehicles do not touch in MuJoCo, whose contacts return the energy: the forces between them
are computed in :mod:`trace_dag.simulation.crush`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from copy import copy
from functools import cache
from typing import Any, Final

import numpy as np

from trace_dag.simulation.vehicles import VehicleModel

_BODY: Final = (
    '<body><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
    "{inside}</body>"
)

BodyStates = tuple[list[float], list[float]]
"""Positions and rates of all bodies as MuJoCo has them: x, y, yaw of each centre of gravity, one after the other."""


class RigidBodies:
    """The bodies of one simulation in MuJoCo. Coordinates of body i: x, y, yaw of its centre of gravity."""

    def __init__(self, models: list[VehicleModel]) -> None:
        import mujoco

        self._mujoco = mujoco
        self._count = len(models)
        self._model, self._data = model, data = self._in_mujoco(models)
        mujoco.mj_setConst(model, data)  # what MuJoCo derives from the masses
        # Parts of MuJoCo's own memory: the vehicles come first in it, three numbers each.
        numbers = 3 * len(models)
        self._positions, self._rates = data.qpos[:numbers], data.qvel[:numbers]
        self._forces = data.qfrc_applied[:numbers]
        self._inverse = [(1.0 / m.body.mass_kg, 1.0 / m.yaw_inertia_kgm2) for m in models]
        self.version = mujoco.mj_versionString()

    def _in_mujoco(self, models: list[VehicleModel]) -> tuple[Any, Any]:
        """Return MuJoCo's model of the bodies and its state at rest, reused from an earlier run if possible."""
        free = _NOT_IN_USE[len(models)]
        model, data = free.pop() if free else _made(len(models))
        model.body_mass[1:] = [m.body.mass_kg for m in models]
        model.body_inertia[1:] = np.array([m.yaw_inertia_kgm2 for m in models])[:, None]
        self._mujoco.mj_resetData(model, data)
        return model, data

    def release(self) -> None:
        """Release these bodies for another run."""
        _NOT_IN_USE[self._count].append((self._model, self._data))

    def place(self, positions: list[float], velocities: list[float]) -> None:
        """Set every body's x, y, yaw and their rates, flat lists."""
        self._positions[:] = positions
        self._rates[:] = velocities

    def set_heights(self, heights_m: list[float]) -> None:
        """Set the heights of the road under the bodies."""
        self._model.body_pos[1 : 1 + self._count, 2] = heights_m

    @property
    def state(self) -> tuple[list[float], list[float]]:
        """Return every body's x, y, yaw and their rates, flat lists."""
        return self._positions.tolist(), self._rates.tolist()

    def step(self, forces: list[float], step_s: float) -> dict[tuple[int, int], tuple[float, float]]:
        """Advance a step under constant forces x, y and moments.

        Return the force x, y (N) on the second body of each pair in contact in MuJoCo, of which there are none here.
        """
        self._model.opt.timestep = step_s
        self._forces[:] = forces
        self._mujoco.mj_step(self._model, self._data)
        return {}


_NOT_IN_USE: Final[defaultdict[int, list[tuple[Any, Any]]]] = defaultdict(list)
"""Models and states of runs that are over, by the number of vehicles: a crash is run some ten times, one after the
other, and making them takes longer than a simulated second of two vehicles."""


def _made(count: int) -> tuple[Any, Any]:
    import mujoco

    model = copy(_bodies_of_a_kilogram(count))
    return model, mujoco.MjData(model)


@cache
def _bodies_of_a_kilogram(count: int) -> Any:
    """Return bodies of a kilogram each.

    Crashes differ only in their masses, which are set later, because compiling takes long.
    """
    import mujoco

    return mujoco.MjModel.from_xml_string(
        '<mujoco><compiler inertiafromgeom="false"/><option gravity="0 0 0" integrator="Euler"/><worldbody>'
        + _BODY.format(mass=1.0, inertia=1.0, inside="") * count
        + "</worldbody></mujoco>"
    )


def vehicle_bodies(models: list[VehicleModel], inside: Callable[[int, VehicleModel], str]) -> str:
    """Return the vehicles as MJCF, in order; ``inside`` returns further parts of a vehicle's body.

    >>> from trace_dag.simulation.vehicles import vehicle_model
    >>> models = [vehicle_model(body) for body in log.bodies.values()]
    >>> vehicle_bodies(models, lambda _, model: "").count('mass="1600.0"')  # the car
    1
    """
    return "".join(
        _BODY.format(mass=float(m.body.mass_kg), inertia=repr(m.yaw_inertia_kgm2), inside=inside(i, m))
        for i, m in enumerate(models)
    )
