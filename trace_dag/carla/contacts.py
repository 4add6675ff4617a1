"""Contacts of two participants in CARLA: times from collision sensors, geometry from the states around them."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.carla.actors import CarlaActor
from trace_dag.common.geometry import Pose
from trace_dag.simulation.outlines import between, contact_point, first_touch, separation
from trace_dag.simulation.types import PULSE_S, Contact


@dataclass
class CarlaContact:
    """A contact of two actors under way, by the ticks in which sensors reported it."""

    one: CarlaActor
    two: CarlaActor
    first_tick: int
    last_tick: int
    impulse_ns: float = 0.0

    def add(self, tick: int, impulse_ns: float, step_s: float) -> None:
        """Add another report of the first actor's sensor."""
        self.last_tick = max(self.last_tick, tick)
        if (tick - self.first_tick) * step_s <= PULSE_S:
            self.impulse_ns += impulse_ns

    def contact(self, step_s: float) -> Contact:
        """Return the contact.

        Its position is computed from the two boxes between the last tick before the report and the tick of the report.
        """
        one, two = self.one, self.two
        last = len(one.rows) - 1
        after = min(self.first_tick, last)
        before = max(after - 1, 0)
        start, end = (one.outline(before), two.outline(before)), (one.outline(after), two.outline(after))
        fraction = first_touch(start, end) if separation(*end)[0] <= 0 < separation(*start)[0] else 1.0
        touching = between(start[0], end[0], fraction), between(start[1], end[1], fraction)
        _, nx, ny = separation(*touching)
        x, y = contact_point(*touching)
        v1, v2 = one.velocity(before), two.velocity(before)
        settled = min(self.first_tick + round(PULSE_S / step_s), self.last_tick + 1, last)
        w1, w2 = one.velocity(settled), two.velocity(settled)
        z1, z2 = one.rows[before][2], two.rows[before][2]
        return Contact(
            time_s=(before + fraction) * step_s,
            duration_s=(self.last_tick - self.first_tick) * step_s,
            x_m=x,
            y_m=y,
            z_m=(z1 + z2) / 2,
            normal_x=nx,
            normal_y=ny,
            impulse_ns=self.impulse_ns,
            closing_speed_mps=(v1[0] - v2[0]) * nx + (v1[1] - v2[1]) * ny,
            number_1=one.number,
            number_2=two.number,
            pose_1=Pose(touching[0].x_m, touching[0].y_m, touching[0].heading_rad, z1),
            pose_2=Pose(touching[1].x_m, touching[1].y_m, touching[1].heading_rad, z2),
            velocity_1_mps=v1,
            velocity_2_mps=v2,
            delta_v_1_mps=(w1[0] - v1[0], w1[1] - v1[1]),
            delta_v_2_mps=(w2[0] - v2[0], w2[1] - v2[1]),
        )
