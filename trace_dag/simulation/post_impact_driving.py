"""Driving after a strike of a person or a light contact: along the planned path, with braking after a reaction time.

The driver keeps the planned path but not its times: a vehicle does not speed up to make up for the speed lost in the
strike. A driver who was braking at the strike has reacted already and brakes to a stop, and one who stood stays on the
brakes. A driver who left the scene by the report does neither. In a bend the brakes use only the grip that the bend
leaves: braking as hard as on a straight road would make the vehicle slide off. A vehicle that a contact pushed aside
continues beside the planned path.
"""

from __future__ import annotations

import math

from trace_dag.simulation.plan import SampledTrajectory
from trace_dag.simulation.types import AfterStriking

_BRAKES_MPS2 = 1.0  # a plan that slows down this much is braking; engine drag is less
_BRAKES_BEFORE_S = 0.5  # the plan up to the strike tells who brakes: a planned braking ends at the planned contact
_STANDS_MPS = 0.3
_LEAST_BRAKING = 0.3  # share of the wanted deceleration that a driver keeps in the sharpest bend
_PATH_ENDS_MPS2 = 4.0  # deceleration after the end of the planned path, of a driver who does not react to the strike


class PostImpactDriver:
    """The driver's intended motion, step by step, from the strike on, as a row of the plan."""

    def __init__(
        self, plan: SampledTrajectory, step: int, response: AfterStriking, step_s: float, *, beside: bool = False
    ) -> None:
        self._rows = plan.table.tolist()  # two of them are looked at in each step
        self._at = min(step, len(plan) - 1)
        _, _, _, _, ax, ay, speed, _, course, _ = self._rows[self._at]
        before = max(self._at - round(_BRAKES_BEFORE_S / step_s), 0)
        lost_mps = abs(self._rows[before][6]) - abs(speed)
        brakes_now_mps2 = -math.copysign(1.0, speed) * (ax * math.cos(course) + ay * math.sin(course))
        braked_mps2 = max(brakes_now_mps2, lost_mps / max((self._at - before) * step_s, step_s))
        stays = not math.isinf(response.reaction_s)
        brakes_already = stays and (braked_mps2 >= _BRAKES_MPS2 or abs(speed) < _STANDS_MPS)
        self._brakes_from = step if brakes_already else step + response.reaction_s / step_s
        self._deceleration_mps2 = max(response.deceleration_mps2, braked_mps2 if brakes_already else 0.0)
        self._beside_m = None if beside else 0.0  # to the left of the path; None until it is looked at first
        self.stops = False
        """True once it brakes, to a stop."""

    def row(self, step: int, x_m: float, y_m: float, ahead_mps: float) -> tuple[float, ...]:
        """Return the plan's row for the vehicle's present place.

        It is that of the nearest point of the path, at the vehicle's own speed.
        """
        rows = self._rows
        here = rows[self._at]
        while self._at + 1 < len(rows):
            following = rows[self._at + 1]
            if math.hypot(following[0] - x_m, following[1] - y_m) > math.hypot(here[0] - x_m, here[1] - y_m):
                break
            self._at += 1
            here = following
        if not self.stops:
            path_ends = self._at == len(rows) - 1 and math.isinf(self._brakes_from)
            self.stops = path_ends or step >= self._brakes_from
            self._deceleration_mps2 = _PATH_ENDS_MPS2 if path_ends else self._deceleration_mps2
        x, y, _, _, _, _, _, curvature, course, z = here
        c, s = math.cos(course), math.sin(course)
        along = (x_m - x) * c + (y_m - y) * s
        if self._beside_m is None:
            self._beside_m = (y_m - y) * c - (x_m - x) * s
        beside = self._beside_m
        sense = -1.0 if ahead_mps < 0 else 1.0
        across = ahead_mps * ahead_mps * curvature
        wanted = -sense * self._braking_mps2(across) if self.stops else 0.0
        speed = 0.0 if self.stops and abs(ahead_mps) < _STANDS_MPS else ahead_mps
        return (
            x + along * c - beside * s,
            y + along * s + beside * c,
            ahead_mps * c,
            ahead_mps * s,
            wanted * c - across * s,
            wanted * s + across * c,
            speed,
            curvature,
            course,
            z,
        )

    def _braking_mps2(self, across_mps2: float) -> float:
        most = self._deceleration_mps2
        return max(math.sqrt(max(most * most - across_mps2 * across_mps2, 0.0)), _LEAST_BRAKING * most)
