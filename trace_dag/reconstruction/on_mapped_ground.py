"""Hypotheses with all parties on possible ground before the first event.

If the map's data end before a vehicle's beginning, the time before the first event is shortened, so that no vehicle
drives over gardens where the roads end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final, TypeAlias

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.alternatives import ambiguity_of
from trace_dag.reconstruction.scene.mapped_ground import OFF_GROUND_M, Astray, astray, ways_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import Hypothesis, StateEstimate

LEAST_LEAD_S: Final = 2.0
"""The least time before the first event: who reacts to it needs some 1.5 s (AASHTO's design value is 2.5 s)."""


_WIDER: Final = 4
Estimating: TypeAlias = Callable[[float, int], StateEstimate]
"""Makes an estimate for a time before the first event (s), of that many hypotheses at most."""


def on_mapped_ground(
    record: CrashRecord, network: RoadNetwork, report: MapReport, made_with: Estimating, lead_s: float, most: int
) -> StateEstimate:
    """Return the estimate of ``made_with``, without hypotheses off mapped ground or in a building.

    The time before the first event is shortened if only the beginning of the best one is off the ground. If none is
    left, less likely ones are requested.

    Raises :class:`Rejection`: ``map_too_small`` if the data end too near to the crash, ``no_feasible_state`` if a party
    strays later in every hypothesis.
    """

    def strays(each: Hypothesis) -> tuple[Astray, ...]:
        return astray(record, network, report.things, ways_of(each.participants), each.impact_time_s)

    made = made_with(lead_s, most)
    judged = [(each, strays(each)) for each in made.hypotheses]
    begun = [(each, found) for each, found in judged if all(stray.until_s is not None for stray in found)]
    if begun and begun[0][1]:
        best, found = begun[0]
        clear_s = max(stray.until_s or 0.0 for stray in found)
        shorter_s = math.floor(10.0 * (best.impact_time_s - clear_s)) / 10.0
        if shorter_s >= LEAST_LEAD_S:
            again = made_with(shorter_s, most)
            if kept := [each for each in again.hypotheses if not strays(each)]:
                return _only(again, kept)
    if kept := [each for each, found in judged if not found]:
        return _only(made, kept)
    if begun:
        worst = max(begun[0][1], key=lambda stray: (stray.in_building, stray.off_m, stray.number))
        if not worst.in_building:
            raise Rejection(Reason.MAP_TOO_SMALL, _too_small(worst), measured=worst.off_m, threshold=OFF_GROUND_M)
    wider = made_with(lead_s, _WIDER * most)
    if kept := [each for each in wider.hypotheses if not strays(each)]:
        return _only(wider, kept[:most])
    raise Rejection(Reason.NO_FEASIBLE_STATE, f"In the best of {len(judged)} hypotheses, {judged[0][1][0]}.")


def _only(made: StateEstimate, kept: list[Hypothesis]) -> StateEstimate:
    """Return the estimate with some of its hypotheses."""
    if kept[0] is made.best:
        return replace(made, hypotheses=tuple(kept))
    return replace(made, hypotheses=tuple(kept), ambiguity=ambiguity_of(kept))


def _too_small(worst: Astray) -> str:
    return f"The map ends too near: {worst.where} until less than {LEAST_LEAD_S:g} s before the first event."
