"""The pairs of vehicles of a run that can touch each other: their gaps, and their crush.

Belongs here: the relation of two vehicles at a moment, and lasting dents. Does not belong here: contacts with beginning
and end (:mod:`trace_dag.simulation.crash_run`), and the force between two (:mod:`trace_dag.simulation.crush`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from trace_dag.common.settings import SimSettings
from trace_dag.simulation.crush import Crush
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.people import Person
from trace_dag.simulation.towing import Hitch

BOUND, BOUND_MPS = 1.5, 10.0
"""A closing speed may grow by so much until it is looked at again."""


class VehiclePairs:
    """The pairs by the indices of both vehicles, in the order of their parties.

    Coupled vehicles do not touch.
    """

    def __init__(self, vehicles: Sequence[Vehicle], hitches: Sequence[Hitch], settings: SimSettings) -> None:
        self._vehicles = vehicles
        self._restitution, self._friction = settings.restitution, settings.contact_friction
        party = list(range(len(vehicles)))
        for hitch in hitches:
            puller, towed = hitch.pair
            party[towed] = puller
        pairs = [(i, j) for j in range(len(vehicles)) for i in range(j) if party[i] != party[j]]
        self.places = [(i, j) if party[i] < party[j] else (j, i) for i, j in pairs]
        self.crushed: dict[tuple[int, int], Crush] = {}
        """Contacts of those that overlap."""
        self.pressed_n: dict[tuple[int, int], tuple[float, float]] = {}
        """Force x, y on the second of each pair, as :meth:`press` found it last."""
        self._met = [
            (pair, vehicles[pair[0]], vehicles[pair[1]], sum(vehicles[i].reach_m for i in pair)) for pair in self.places
        ]
        # Of each pair the outlines that were compared last, and how far they are apart.
        self._compared: dict[tuple[int, int], tuple[Outline, Outline, float]] = {}

    @property
    def vehicles(self) -> list[tuple[Vehicle, Vehicle]]:
        """Return both vehicles of each pair."""
        return [(one, two) for _, one, two, _ in self._met]

    def gap_m(self, pair: tuple[int, int]) -> float:
        """Return the present distance of two vehicles, as from :func:`separation`.

        It is kept between the end of a part of a step and the beginning of the next.
        """
        one, two = self._vehicles[pair[0]].outline(), self._vehicles[pair[1]].outline()
        known = self._compared.get(pair)
        if known is not None and known[0] is one and known[1] is two:
            return known[2]
        gap_m = separation(one, two)[0]
        self._compared[pair] = one, two, gap_m
        return gap_m

    def press(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """Return forces on all vehicles in a part of a step, x, y (N) and moment (Nm) of each in a row.

        They are the given ones plus those of vehicles that crush each other.
        """
        self.pressed_n = {}
        total = list(forces)
        for pair, one, two, reach_m in self._met:
            apart = math.hypot(one.x - two.x, one.y - two.y) > reach_m or not same_level(one, two)
            if apart or self.gap_m(pair) >= 0:
                self.crushed.pop(pair, None)
                continue
            crush = self.crushed.get(pair)
            if crush is None:
                crush = Crush(one, two, self._restitution, self._friction)
            pressed = crush.press(self._compared[pair][:2], now_s, part_s)
            if pressed is None:
                continue
            self.crushed[pair] = crush
            self.pressed_n[pair] = pressed.fx, pressed.fy
            i, j = 3 * pair[0], 3 * pair[1]
            total[i] -= pressed.fx
            total[i + 1] -= pressed.fy
            total[i + 2] += pressed.moment_1
            total[j] += pressed.fx
            total[j + 1] += pressed.fy
            total[j + 2] += pressed.moment_2
        return total


def same_level(one: Vehicle, two: Vehicle | Person) -> bool:
    """Return whether two bodies are at heights at which they can touch, rather than at different levels of a bridge."""
    return one.z < two.z + two.model.body.height_m and two.z < one.z + one.model.body.height_m
