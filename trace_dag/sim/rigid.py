"""The vehicles in MuJoCo: upright rigid bodies that move in the plane.

Each has three joints (x, y, yaw) through its centre of gravity, at the height of the road under it; there is no
gravity, since the road carries it. Vehicles do not touch in MuJoCo, whose contacts return the energy: the forces
between them are computed in :mod:`trace_dag.sim.crush`.
"""

from __future__ import annotations

from collections.abc import Callable

from trace_dag.sim.vehicles import VehicleModel


class RigidBodies:
    """The bodies of one simulation in MuJoCo. Coordinates of body i: x, y, yaw of its centre of gravity."""

    def __init__(self, models: list[VehicleModel]) -> None:
        import mujoco

        self._mujoco = mujoco
        self._count = len(models)
        self._model = mujoco.MjModel.from_xml_string(self._mjcf(models))
        self._data = data = mujoco.MjData(self._model)
        # Parts of MuJoCo's own memory: the vehicles come first in it, three numbers each.
        numbers = 3 * len(models)
        self._positions, self._rates = data.qpos[:numbers], data.qvel[:numbers]
        self._forces = data.qfrc_applied[:numbers]
        self._inverse = [(1.0 / m.body.mass_kg, 1.0 / m.yaw_inertia_kgm2) for m in models]
        self.version = mujoco.mj_versionString()

    def _mjcf(self, models: list[VehicleModel]) -> str:
        return (
            '<mujoco><compiler inertiafromgeom="false"/>'
            '<option gravity="0 0 0" integrator="Euler"/>'
            f"<worldbody>{vehicle_bodies(models, lambda *_: '')}</worldbody></mujoco>"
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

    def step(self, forces: list[float], step_s: float) -> dict[tuple[int, int], tuple[float, float]]:
        """Advance a step under constant forces x, y and moments.

        Returns the force x, y (N) on the second body of each pair that MuJoCo has in contact: here none.
        """
        self._model.opt.timestep = step_s
        self._forces[:] = forces
        self._mujoco.mj_step(self._model, self._data)
        return {}


def vehicle_bodies(models: list[VehicleModel], inside: Callable[[int, VehicleModel], str]) -> str:
    """The vehicles as MJCF, in their order; ``inside`` gives what a vehicle's body has beside its box."""
    return "".join(
        f'<body><inertial pos="0 0 0" mass="{m.body.mass_kg!r}" '
        f'diaginertia="{m.yaw_inertia_kgm2!r} {m.yaw_inertia_kgm2!r} {m.yaw_inertia_kgm2!r}"/>'
        '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        f"{inside(i, m)}</body>"
        for i, m in enumerate(models)
    )
