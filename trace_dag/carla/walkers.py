"""A person on foot in CARLA's world: a walker that keeps to its plan until touched, and then stands.

CARLA's walkers are moved by a character controller. They take part in no collision: a vehicle's sensor detects the
contact, but the person is not thrown and the vehicle loses no speed. So a run shows the parties, place, time and speed
of a strike; only the embedded back-end simulates its effect.
"""

from __future__ import annotations

import math
from typing import Any

from trace_dag.carla.actors import POSITION_GAIN, SPAWN_ABOVE_M, CarlaActor
from trace_dag.carla.frame import location_to_carla, transform_to_carla
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose
from trace_dag.scenario.carla_blueprints import choose_walker
from trace_dag.simulation.plan import resample
from trace_dag.simulation.types import Body, Participant, party_name

_STANDS_MPS = 0.05


class CarlaWalker(CarlaActor):
    """A walker of the server that represents a person on foot or on a conveyance.

    Its own origin is in the middle of its body.
    """

    @classmethod
    def spawn(
        cls, carla: Any, world: Any, participant: Participant, *, friction: float, step_s: float, time_limit_s: float
    ) -> CarlaWalker:
        """Spawn the walker most similar to the person at its start; ``friction`` has no effect.

        Raises :class:`Failure` if its place is taken.
        """
        library = world.get_blueprint_library()
        name = choose_walker(participant.body, [entry.id for entry in library])
        pose = participant.initial_pose
        above_m = participant.body.height_m / 2 + SPAWN_ABOVE_M
        actor = world.try_spawn_actor(library.find(name), transform_to_carla(carla, pose, above_m))
        if actor is None:
            who = party_name(participant.body, participant.number)
            raise Failure(
                f"CARLA could not spawn {who} ({name}) at x {pose.x_m:.1f} m, y {pose.y_m:.1f} m: something is there"
            )
        extent, body = actor.bounding_box.extent, participant.body
        return cls(
            carla=carla,
            world=world,
            participant=participant,
            plan=resample(participant.trajectory, step_s, time_limit_s, 0.0),
            actor=actor,
            body=Body(body.kind, body.vehicle_class, 2 * extent.x, 2 * extent.y, 2 * extent.z, body.mass_kg),
            step_s=step_s,
            max_steer_rad=0.0,
        )

    def hold(self) -> None:
        """Make the walker stand still."""
        self.actor.apply_control(self.carla.WalkerControl(speed=0.0))

    def put_at_start(self) -> None:
        """Move the settled walker one step short of its start."""
        start = self.participant.initial_pose
        back_m = self.participant.initial_speed_mps * self.step_s
        settled = self.actor.get_transform()
        origin = Pose(
            start.x_m - back_m * math.cos(start.heading_rad),
            start.y_m - back_m * math.sin(start.heading_rad),
            start.heading_rad,
            settled.location.z,
        )
        self.actor.set_transform(transform_to_carla(self.carla, origin))
        self.carry(0)

    def carry(self, tick: int) -> None:
        """Walk to the planned position of a tick at the planned speed; stand still at the plan's end."""
        last = len(self.plan) - 1
        here = self.plan.row(min(tick, last))
        vx, vy = (here[2], here[3]) if tick < last else (0.0, 0.0)
        if self.rows:
            before = self.plan.row(min(max(tick - 1, 0), last))
            vx += POSITION_GAIN * (before[0] - self.rows[-1][0])
            vy += POSITION_GAIN * (before[1] - self.rows[-1][1])
        speed = math.hypot(vx, vy)
        if speed < _STANDS_MPS:
            self.hold()
            return
        x, y = location_to_carla(vx / speed, vy / speed)
        self.actor.apply_control(self.carla.WalkerControl(direction=self.carla.Vector3D(x, y, 0.0), speed=speed))

    def let_go(self, brake: float) -> None:
        """Stop the walker where it was struck; CARLA does not throw it."""
        self.hold()
