"""Mapped ground of parties before the first event.

Carriageways, junctions, driveways, shoulders and pavements, and outside buildings.

A vehicle may leave the road if the report says so, it may be parked off mapped ground, and a person walks anywhere; no
party goes through a building.

In a hypothesis all parties are on possible ground before the first event. If the map's data end before a vehicle's
beginning, the time before the first event is shortened, so that no vehicle drives over gardens where the roads end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.codes.elements import CROSSED_MEDIAN, RAN_OFF, RAN_OFF_AT_END, RAN_OFF_LEFT, RAN_OFF_RIGHT
from trace_dag.crash.parties import PartyKind, party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import ON_ROADWAY
from trace_dag.reconstruction.alternatives import ambiguity_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MappedThing, MapReport
from trace_dag.simulation.states import Hypothesis, ParticipantState, StateEstimate

OFF_GROUND_M: Final = 1.0
"""Distance of a vehicle's middle from mapped ground that is allowed: widths of lanes and shoulders are known no
better."""
_STEP_S: Final = 0.1
_HALF_LANE_M: Final = 1.75
_NO_GROUND_M: Final = 1000.0  # where the map has none at all
_LEFT_ROAD: Final = frozenset({RAN_OFF_RIGHT, RAN_OFF_LEFT, RAN_OFF_AT_END, RAN_OFF, CROSSED_MEDIAN})
LEAST_LEAD_S: Final = 2.0
"""The least time before the first event: who reacts to it needs some 1.5 s (AASHTO's design value is 2.5 s)."""


_WIDER: Final = 4
Estimating: TypeAlias = Callable[[float, int], StateEstimate]
"""Makes an estimate for a time before the first event (s), of that many hypotheses at most."""


@dataclass(frozen=True, eq=False)
class Way:
    """The path of a party: its number and kind, and the positions of its middle (m, local frame) at times (s)."""

    number: int
    kind: PartyKind
    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray


@dataclass(frozen=True)
class Astray:
    """A party on impossible ground.

    It has the largest distance from mapped ground (m), or 0 m in a building. The party is there from the beginning
    until ``until_s`` (s), or later if that is None.
    """

    number: int
    off_m: float
    in_building: bool
    until_s: float | None

    @property
    def where(self) -> str:
        """Return the parties off mapped ground, as the beginning of a sentence."""
        who = party_in_words(self.number)
        if self.in_building:
            return f"{who} is inside a building"
        return f"{who} is up to {self.off_m:.1f} m off every mapped road, driveway and shoulder"

    def __str__(self) -> str:
        unsaid = "" if self.in_building else ", which the report does not say"
        return f"{self.where} before the first event{unsaid}"


def ways_of(participants: Iterable[ParticipantState]) -> Iterator[Way]:
    """Yield the planned ways of a hypothesis' parties.

    >>> [(way.number, way.kind.value) for way in ways_of(hypothesis.participants)]
    [(1, 'motor_vehicle'), (2, 'motor_vehicle')]
    """
    for state in participants:
        planned = state.trajectory
        yield Way(state.vehicle_number, state.kind, planned.time_s, planned.x_m, planned.y_m)


def astray(
    record: CrashRecord, network: RoadNetwork, things: Sequence[MappedThing], ways: Iterable[Way], event_s: float
) -> tuple[Astray, ...]:
    """Return the parties on impossible ground before the first event at ``event_s`` (s).

    >>> astray(record, network, map_report.things, ways_of(hypothesis.participants), hypothesis.impact_time_s)
    ()
    """
    walls = _buildings(things)
    parked = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    found = []
    for way in ways:
        time_s = np.append(np.arange(float(way.time_s[0]), event_s, _STEP_S), event_s)
        x_m, y_m = (np.interp(time_s, way.time_s, values) for values in (way.x_m, way.y_m))
        # A building that is struck is touched at the end.
        inside = shapely.contains_xy(walls, x_m, y_m) & (time_s < event_s - _STEP_S)
        off_m = np.zeros_like(time_s)
        if way.kind is PartyKind.MOTOR_VEHICLE and way.number not in parked:
            off_m = _off_m(network, x_m, y_m)
            if leaves_road(record, way.number) and (off_m <= OFF_GROUND_M).any():
                off_m[int(np.argmax(off_m <= OFF_GROUND_M)) :] = 0.0
        wrong = inside | (off_m > OFF_GROUND_M)
        if wrong.any():
            begins = int(np.argmin(wrong)) if not wrong.all() else len(wrong)
            until_s = None if wrong[begins:].any() else float(time_s[min(begins, len(time_s) - 1)])
            found.append(Astray(way.number, float(off_m.max()), bool(inside.any()), until_s))
    return tuple(found)


def leaves_road(record: CrashRecord, number: int) -> bool:
    """Return whether the report places a vehicle off the road before or at the first harmful event.

    >>> leaves_road(record, 1), leaves_road(tree_record, 1)
    (False, True)
    """
    if record.road_relation_code is not None and record.road_relation_code not in ON_ROADWAY:
        return True
    for event in record.events:
        if event.is_harmful:
            return False
        if event.code in _LEFT_ROAD and event.party_1 == number:
            return True
    return False


def _off_m(network: RoadNetwork, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
    """Return the distances of points from mapped ground (m)."""
    off_m = np.zeros_like(x_m)
    outside: NDArray[np.bool_] = ~network.paved_area.contains(x_m, y_m)
    if outside.any():
        outside &= ~shapely.contains_xy(_junctions(network, x_m[outside], y_m[outside]), x_m, y_m)
    if outside.any():
        off_m[outside] = np.nan_to_num(network.paved_area.beyond_m(x_m[outside], y_m[outside]), nan=_NO_GROUND_M)
    return off_m


def _junctions(network: RoadNetwork, x_m: FloatArray, y_m: FloatArray) -> shapely.Geometry:
    """Return the ground of the junctions around points.

    All of a junction is paved, also between the lanes of its movements.
    """
    box_m = (float(x_m.min()), float(y_m.min()), float(x_m.max()), float(y_m.max()))
    movements: dict[str, list[FloatArray]] = {}
    for road in network.roads_within(box_m):
        if road.junction_id is not None:
            lines = (network.centreline(lane)[:, :2] for lane in network.drivable_lanes_of(road))
            movements.setdefault(road.junction_id, []).extend(lines)
    hulls = [shapely.MultiPoint(np.concatenate(lines)).convex_hull for lines in movements.values() if lines]
    return shapely.union_all([hull.buffer(_HALF_LANE_M) for hull in hulls])


def _buildings(things: Sequence[MappedThing]) -> shapely.Geometry:
    """Return the footprints of the buildings near the crash."""
    rings = [each.xy_m for each in things if each.tag == "building" and len(each.xy_m) > 3]
    walls = shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in rings])
    shapely.prepare(walls)
    return walls


# --- hypotheses on mapped ground -------------------------------------------------------------------------------------
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
