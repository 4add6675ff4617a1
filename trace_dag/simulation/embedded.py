"""The default back-end: vehicle and driver models over MuJoCo's rigid bodies, in this process.

Everything moves by one fixed step (semi-implicit Euler, forces held over the step). From the step in which two bodies
could touch until the end of their crash pulse, MuJoCo takes steps in parts of half a millisecond at most. The first
touch is located within such a part, and then by bisection between its two states to the micrometre. While nothing can
touch, each body moves by the same scheme by itself. Nothing is random: equal input gives equal bits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.crash_run import BACKEND_NAME, CrashRun
from trace_dag.simulation.driving import Driver
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.plan import check_participants
from trace_dag.simulation.roadside_terrain import RoadsideTerrain
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.surface import NetworkSurface, Surface
from trace_dag.simulation.types import BodyKind, Participant, SimulationLog


class EmbeddedBackend:
    """A back-end without a connection; loading a map samples its surface."""

    name = BACKEND_NAME
    one_at_a_time = False

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings

    @staticmethod
    def require(settings: SimSettings) -> None:
        """Require nothing beyond this package."""

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> EmbeddedSimulation:
        """Make a map's surface ready."""
        return EmbeddedSimulation(self._settings, NetworkSurface(network), friction, network)

    def close(self) -> None:
        """Release nothing."""


class EmbeddedSimulation:
    """Runs on one surface, with one tyre-road friction."""

    def __init__(
        self,
        settings: SimSettings,
        surface: Surface | NetworkSurface,
        friction: float,
        network: RoadNetwork | None = None,
    ) -> None:
        self._settings = settings
        self._network = network
        self._surface = surface
        self._friction = friction
        self._beyond: dict[
            tuple[FixedObject, ...] | Pose, RoadsideTerrain
        ] = {}  # by the objects, else the end of a plan

    def of_draw(self, friction: float, reaction_s: float) -> EmbeddedSimulation:
        """Return a copy with another friction and other drivers, which shares the sampled ground."""
        other = copy(self)
        other._friction = friction
        other._settings = self._settings.model_copy(update={"reaction_s": reaction_s})
        return other

    def run(
        self,
        participants: tuple[Participant, ...],
        *,
        time_limit_s: float,
        drivers: Mapping[int, Driver] | None = None,
        after_contact_s: float | None = None,
        objects: tuple[FixedObject, ...] = (),
    ) -> SimulationLog:
        """Simulate until rest or ``time_limit_s``.

        Raises :class:`trace_dag.common.errors.Failure` for an impossible plan.
        """
        run = self.begin(participants, time_limit_s=time_limit_s, drivers=drivers, objects=objects)
        after_s = math.inf if after_contact_s is None else after_contact_s
        log = run.log(after_contact_s=after_s)
        run.release()
        return log

    def begin(
        self,
        participants: tuple[Participant, ...],
        *,
        time_limit_s: float,
        drivers: Mapping[int, Driver] | None = None,
        objects: tuple[FixedObject, ...] = (),
    ) -> CrashRun:
        """Return a run at its start, which the caller can inspect and continue."""
        check_participants(participants)
        paths = [np.stack([p.trajectory.x_m, p.trajectory.y_m], axis=-1) for p in participants]
        surface = self._surface.around(np.concatenate(paths)) if paths else Surface()
        # Who strikes an animal often leaves the road or falls afterwards.
        leaves = any(
            p.beyond_edge or p.body.kind is BodyKind.ANIMAL or not math.isinf(p.skids_from_s) for p in participants
        )
        beyond = self._ground_beyond(objects, participants[0].trajectory) if objects or leaves else None
        settings, friction, driven = self._settings, self._friction, drivers or {}
        return CrashRun(settings, surface, friction, participants, time_limit_s, driven, objects=objects, beyond=beyond)

    def _ground_beyond(self, objects: tuple[FixedObject, ...], first: Trajectory) -> RoadsideTerrain:
        """Return the ground around the first object, or around the end of the first plan."""
        end = Pose(float(first.x_m[-1]), float(first.y_m[-1]), 0.0, float(first.z_m[-1]))
        place = objects or end
        if place not in self._beyond:
            self._beyond[place] = RoadsideTerrain(self._network, objects, end)
        return self._beyond[place]
