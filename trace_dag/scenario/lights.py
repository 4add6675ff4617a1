"""Traffic lights around a crash: a program for each junction, with which the parties' motion agrees with the report.

A program goes through the groups of lights of a junction (:mod:`trace_dag.roads.from_osm.controllers`), one after the
other: green, yellow, red for all. It takes 90 s, as the programs that SUMO's netconvert makes do; yellow is by the
formula of the Institute of Transportation Engineers, within the 3 to 6 s of the MUTCD (4F.17). Only its beginning is
free. It is chosen so that drivers reported to have disobeyed the light cross the stop line on red, and all others on
green. If that is impossible and the report names no such driver, some driver ran the light, and every reading stays.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import accumulate, pairwise, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray, Poses
from trace_dag.crash.codes.elements import FLASHING, SIGNALS
from trace_dag.crash.parties import SURROUNDING, party_label
from trace_dag.crash.record import CrashRecord, PreCrashMovement
from trace_dag.roads.map.model import Controller, Road, Signal
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, VehicleLog

_TENTHS: Final = 10  # of a second, in which programs are made
_CYCLE_S, _CLEARANCE_S, _YELLOW_S = 90.0, 1.0, (3.0, 6.0)
_REACTION_S, _BRAKING_MPS2 = 1.0, 3.05  # ITE: 10 ft/s2
_USUAL_MPS: Final = 13.41  # 30 mph, where the map has no limit

_BEFORE_S: Final = 3.0  # a crash begins: who is past its stop line then came straight on
_STEP_S: Final = 0.02
_ASIDE_M, _ANOTHER_LEVEL_M = 1.0, 4.0  # of the lanes under a light
_WAITS_M, _OVER_M, _STANDS_MPS = 40.0, 3.0, 1.0  # before a stop line, with the front at most a little over it
_JUST_BEFORE: Final = 5  # steps: a tenth of a second before a contact, which is too quick for its first one
_JUNCTION_M: Final = 40.0  # beyond a stop line, to the crosswalk at the far side
_ACROSS, _ALONG = math.sin(math.radians(45.0)), math.cos(math.radians(45.0))
_AHEAD_M: Final = 150.0
_DISOBEYED: Final = frozenset({2, 3, 12})  # NMCC: failed to yield, disobeyed a signal, crossed improperly
_TURNS: Final = frozenset({PreCrashMovement.TURNING_LEFT, PreCrashMovement.TURNING_RIGHT, PreCrashMovement.U_TURN})


class Colour(StrEnum):
    """The lamp that is lit."""

    RED = "red"
    YELLOW = "yellow"
    GREEN = "green"


@dataclass(frozen=True)
class LightCycle:
    """The lights of one controller: how long (s) they show each colour, over and over from the crash's beginning."""

    controller_id: str
    signal_ids: tuple[str, ...]
    steps: tuple[tuple[float, Colour], ...]

    def at(self, time_s: float) -> Colour:
        """Return the colour at a time of the crash's clock.

        >>> LightCycle("0", ("6",), ((2.0, Colour.YELLOW), (58.0, Colour.RED), (30.0, Colour.GREEN))).at(-1.0).value
        'green'
        """
        ends_s = list(accumulate(duration_s for duration_s, _ in self.steps))
        return self.steps[min(bisect_right(ends_s, time_s % ends_s[-1]), len(self.steps) - 1)][1]


@dataclass(frozen=True, order=True)
class MetLight:
    """A light that a party met before its first contact: when it crossed the stop line, or stood before it.

    The contact is ``beyond_m`` past the line. ``wanted`` is the colour by this reading of the report, None where any
    may be, ``shown`` the program's.
    """

    party: int
    time_s: float
    signal_id: str
    stood: bool
    beyond_m: float
    wanted: Colour | None = None
    shown: Colour | None = None


@dataclass(frozen=True)
class Lights:
    """One reading of the lights around a crash. ``ran``: the parties that ran one in it."""

    cycles: tuple[LightCycle, ...]
    met: tuple[MetLight, ...] = ()
    ran: tuple[int, ...] = ()

    @property
    def cycle_of(self) -> dict[str, LightCycle]:
        """Return the program of each signal, by its id on the map."""
        return {signal_id: each for each in self.cycles for signal_id in each.signal_ids}

    @property
    def in_words(self) -> str:
        """Return the colours that the parties met."""
        return "; ".join(
            f"{party_label(each.party)} {'stood before' if each.stood else 'crossed'} its stop line on {each.shown}"
            for each in self.met
        )


@dataclass(frozen=True, eq=False)
class Party:
    """A body of the crash in motion; just before the crash it moves straight at its first speed."""

    body: Body
    log: VehicleLog

    def poses_at(self, times_s: FloatArray) -> Poses:
        """Return x, y and heading at times of the crash's clock, each shape (n,)."""
        log, before_s = self.log, np.minimum(times_s, 0.0)
        x, y, heading = (
            np.interp(times_s, log.time_s, values) for values in (log.x_m, log.y_m, np.unwrap(log.heading_rad))
        )
        return x + before_s * log.velocity_x_mps[0], y + before_s * log.velocity_y_mps[0], heading

    def front_at(self, times_s: FloatArray) -> FloatArray:
        """Return x, y of the middle of its front and degrees clockwise from north at times, shape (n, 3)."""
        x, y, heading = self.poses_at(times_s)
        ahead_m = self.body.length_m / 2
        angle_deg = np.remainder(90.0 - np.degrees(heading), 360.0)
        return np.column_stack([x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading), angle_deg])


def crash_lights(record: CrashRecord, network: RoadNetwork, log: SimulationLog) -> tuple[Lights, ...]:
    """Return the readings of the lights on a crash's map; none without lights.

    There are several if parties crossed each other and the report names neither as running the light. A junction whose
    lights flashed has no program, nor one whose crossing parties had no signal by the report.

    >>> crash_lights(record, network, log)[0].in_words  # a left turn across a motorcycle that came the other way
    'V1 crossed its stop line on green; V2 crossed its stop line on green'
    """
    junction_of = {number: each.id for each in network.junctions for number in each.controller_ids}
    groups: dict[str, list[Controller]] = defaultdict(list)
    for each in network.controllers:
        groups[junction_of.get(each.id, f"controller {each.id}")].append(each)
    met = sorted(_met_lights(network, log)) if groups else []
    readings = [list(_Junction(record, network, controllers, met).readings(log)) for controllers in groups.values()]
    return tuple(
        Lights(
            tuple(cycle for each in chosen for cycle in each.cycles),
            tuple(sorted(light for each in chosen for light in each.met)),
            tuple(sorted(number for each in chosen for number in each.ran)),
        )
        for chosen in product(*filter(None, readings))
        if chosen
    )


def lights_in_words(readings: Sequence[Lights]) -> str:
    """Return the colours that the parties met, by each reading; empty where nobody met a light."""
    said = [each.in_words for each in readings]
    if len(said) < 2:
        return f"Traffic lights by the report: {said[0]}." if any(said) else ""
    return f"The report has nobody who ran the light. Shown: {said[0]}. Or else: {'. Or else: '.join(said[1:])}."


class _Junction:
    """The lights of a junction, or of a crossing between junctions, and the parties that met them."""

    def __init__(
        self, record: CrashRecord, network: RoadNetwork, controllers: Sequence[Controller], met: Sequence[MetLight]
    ) -> None:
        self._record, self._controllers = record, controllers
        self._vehicles = {each.number: each for each in record.vehicles}
        self._group_of = {signal_id: k for k, each in enumerate(controllers) for signal_id in each.signal_ids}
        last = {each.party: each for each in met}  # they are in the order of times
        self._met = [each for each in met if each.signal_id in self._group_of]
        self._last = {each.party: each for each in self._met if last[each.party] is each and not each.stood}
        limits = {signal.id: road.speed_mps or _USUAL_MPS for road in network.roads for signal in road.signals}
        groups = max(len(controllers), 2)  # where there is one, people cross
        share = round(_TENTHS * _CYCLE_S / groups)
        # The colours of each group, every tenth of a second of the cycle.
        self._shown = np.full((len(controllers), share * groups), Colour.RED, dtype="<U6")
        for k, each in enumerate(controllers):
            yellow_s = _REACTION_S + max(limits[name] for name in each.signal_ids) / (2 * _BRAKING_MPS2)
            ends = (k + 1) * share - round(_TENTHS * _CLEARANCE_S)
            turns = ends - round(_TENTHS * min(max(yellow_s, _YELLOW_S[0]), _YELLOW_S[1]))
            self._shown[k, k * share : turns], self._shown[k, turns:ends] = Colour.GREEN, Colour.YELLOW

    def readings(self, log: SimulationLog) -> Iterator[Lights]:
        """Yield the possible programs: the reported one, or each possibility if the report leaves it open."""
        controls = {
            self._vehicles[each.party].traffic_control_code for each in self._met if each.party in self._vehicles
        }
        if FLASHING in controls:
            return
        ran = frozenset(
            number
            for number, each in self._vehicles.items()
            if number in self._last and each.disobeyed_control and each.traffic_control_code in (None, *SIGNALS)
        )
        walked = () if ran else self._walked_across(log)
        if not walked and not ran and not self._begins(ran)[1]:
            if controls and not controls & {None, *SIGNALS}:
                return
            crossed = sorted({each.party for each in self._met if not each.stood})
            walked = tuple(each for each in crossed if self._begins(frozenset({each}))[1])
        yield from map(self._reading, [frozenset({each}) for each in walked] or [ran])

    def _reading(self, ran: frozenset[int]) -> Lights:
        cycles = []
        for controller, shown in zip(self._controllers, self._shown, strict=True):
            rolled = np.roll(shown, -self._begins(ran)[0])
            ends = [0, *(np.flatnonzero(rolled[1:] != rolled[:-1]) + 1).tolist(), len(rolled)]
            steps = (((end - start) / _TENTHS, Colour(rolled[start])) for start, end in pairwise(ends))
            cycles.append(LightCycle(controller.id, controller.signal_ids, tuple(steps)))
        met = (
            replace(each, wanted=self._wanted(each, ran), shown=cycles[self._group_of[each.signal_id]].at(each.time_s))
            for each in self._met
        )
        return Lights(tuple(cycles), tuple(met), tuple(ran))

    def _wanted(self, met: MetLight, ran: frozenset[int]) -> Colour | None:
        if met.stood or (met.party in ran and self._last.get(met.party) is met):
            return Colour.RED
        near_side = PreCrashMovement.TURNING_LEFT if self._record.keeps_left else PreCrashMovement.TURNING_RIGHT
        vehicle = self._vehicles.get(met.party)
        return None if vehicle is not None and vehicle.movement is near_side else Colour.GREEN  # it may turn on red

    def _begins(self, ran: frozenset[int]) -> tuple[int, bool]:
        """Return the place in the cycle (tenths of a second) at time 0, and whether it does what is wanted of it.

        It is the middle of the longest stretch of best ones. Crossing a stop line counts more than standing before it,
        running the light more than having green, yellow more than red.
        """
        length = self._shown.shape[1]
        agreeing, score, wished = np.zeros(length), np.zeros(length), 0
        for met in self._met:
            wanted = self._wanted(met, ran)
            shown = np.roll(self._shown[self._group_of[met.signal_id]], -round(_TENTHS * met.time_s))
            if wanted is None or met.stood:
                score += shown == (wanted or Colour.GREEN)
                continue
            wished += 1
            agreeing += shown == wanted
            score += 100 * (1 + (wanted is Colour.RED)) * (shown == wanted) + 10 * (shown == Colour.YELLOW)
        best = score == score.max()
        if best.all():
            return 0, not wished
        lasts = {int(k): int(np.argmin(np.roll(best, -k))) for k in np.flatnonzero(best & ~np.roll(best, 1))}
        longest = max(lasts, key=lambda begin: lasts[begin])
        middle = (longest + lasts[longest] // 2) % length
        return middle, bool(agreeing[middle] == wished)

    def _walked_across(self, log: SimulationLog) -> tuple[int, ...]:
        """Return the parties that can have run the light if a person walked across the way of a driver straight on.

        It is only the person if the report notes that.
        """
        contact = log.first_contact
        if contact is None or not log.is_figure(contact.number_2) or contact.number_1 not in self._last:
            return ()
        person, driver = contact.number_2, contact.number_1
        (vx, vy), heading = contact.velocity_2_mps, contact.pose_1.heading_rad
        across = abs(vy * math.cos(heading) - vx * math.sin(heading)) > _ACROSS * max(math.hypot(vx, vy), 0.1)
        turns = self._vehicles[driver].movement in _TURNS
        animal = log.bodies[person].kind is BodyKind.ANIMAL
        if turns or animal or not across or self._last[driver].beyond_m > _JUNCTION_M:
            return ()
        circumstances = [each.circumstances for each in self._record.non_motorists if each.party == person]
        return (person,) if any(_DISOBEYED & set(each) for each in circumstances) else (person, driver)


def _met_lights(network: RoadNetwork, log: SimulationLog) -> Iterator[MetLight]:
    """Yield the lights that vehicles and cyclists crossed, or stood before, up to their first contacts."""
    lines = [StopLine(network, road, each) for road in network.roads for each in road.signals if each.dynamic]
    for each in log.parties:
        body = log.bodies[each.number]
        if each.number > SURROUNDING or body.kind not in (BodyKind.MOTOR_VEHICLE, BodyKind.CYCLIST):
            continue
        touched = [contact.time_s for contact in log.contacts if each.number in (contact.number_1, contact.number_2)]
        until_s = min(touched, default=log.duration_s)
        times = np.arange(-_BEFORE_S, until_s + _STEP_S / 2, _STEP_S)
        x, y, _ = Party(body, each).front_at(times).T
        z, speed = (np.interp(times, each.time_s, values) for values in (each.z_m, np.abs(each.speed_mps)))
        waits = []
        for line in lines:
            beyond_m, within = line.seen(x, y, z)
            crosses = np.flatnonzero((beyond_m[:-1] < 0.0) & (beyond_m[1:] >= 0.0) & within[1:])
            if len(crosses):
                yield MetLight(
                    each.number, round(float(times[crosses[0] + 1]), 2), line.signal_id, False, float(beyond_m[-1])
                )
            elif within[-1] and -_WAITS_M < beyond_m[-1] < _OVER_M:
                waits.append((float(beyond_m[-1]), line.signal_id))
        if waits and speed[-_JUST_BEFORE:].min() < _STANDS_MPS:
            yield MetLight(each.number, round(until_s, 2), max(waits)[1], True, max(waits)[0])


class StopLine:
    """A line across the lanes under a light, in the axes of their traffic."""

    def __init__(self, network: RoadNetwork, road: Road, signal: Signal) -> None:
        self.signal_id = signal.id
        x, y, heading, _ = network.road_geometry(road.id).line.at(signal.s_m)
        heading += math.pi if signal.orientation == "-" else 0.0
        self._at = x, y, math.cos(heading), math.sin(heading)
        self._z_m = network.road_geometry(road.id).height_at(signal.s_m)
        lanes = [each for each in network.drivable_lanes_of(road) if each.lane_id in road.lanes_under(signal)]
        edges = [
            network.pose(ref, signal.s_m, side * network.width_m(ref, signal.s_m) / 2)
            for ref in lanes
            for begin_m, end_m in [network.lane_span(ref)]
            if begin_m <= signal.s_m <= end_m
            for side in (1, -1)
        ]
        self._aside_m = [(e.y_m - y) * math.cos(heading) - (e.x_m - x) * math.sin(heading) for e in edges] or [math.nan]

    @property
    def ends_m(self) -> list[tuple[float, float]]:
        """Return its left and its right end."""
        x, y, c, s = self._at
        return [
            (round(x - s * aside_m, 2), round(y + c * aside_m, 2))
            for aside_m in (max(self._aside_m), min(self._aside_m))
        ]

    def faces(self, heading_rad: float) -> bool:
        """Return whether traffic that goes so comes to the line from before it."""
        return self._at[2] * math.cos(heading_rad) + self._at[3] * math.sin(heading_rad) > _ALONG

    def seen(self, x_m: FloatArray, y_m: FloatArray, z_m: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the distances of places beyond the line, and whether they are in its lanes."""
        x, y, c, s = self._at
        aside_m = (y_m - y) * c - (x_m - x) * s
        within = (aside_m < max(self._aside_m) + _ASIDE_M) & (aside_m > min(self._aside_m) - _ASIDE_M)
        return (x_m - x) * c + (y_m - y) * s, within & (np.abs(z_m - self._z_m) < _ANOTHER_LEVEL_M)


def lit_lines(network: RoadNetwork, lights: Lights | None) -> list[tuple[StopLine, LightCycle]]:
    """Return the stop lines of the lights that have a program, each with it."""
    cycle_of = {} if lights is None else lights.cycle_of
    signals = ((road, each) for road in network.roads for each in road.signals if each.id in cycle_of)
    return [(StopLine(network, road, each), cycle_of[each.id]) for road, each in signals]


def light_ahead(
    lines: Sequence[tuple[StopLine, LightCycle]], state: BodyState, length_m: float, time_s: float
) -> tuple[Colour, float] | tuple[None, None]:
    """Return the colour of the next light straight ahead of a body, and the way to its stop line (m), or None."""
    heading, ahead_m = state.heading_rad, length_m / 2
    x_m, y_m = state.x_m + ahead_m * math.cos(heading), state.y_m + ahead_m * math.sin(heading)
    ahead = (
        (-float(beyond_m[0]), cycle.at(time_s))
        for line, cycle in lines
        for beyond_m, within in [line.seen(np.array([x_m]), np.array([y_m]), np.array([state.z_m]))]
        if within[0] and -_AHEAD_M < beyond_m[0] < 0.0 and line.faces(heading)
    )
    to_go_m, colour = min(ahead, default=(0.0, None))
    return (None, None) if colour is None else (colour, to_go_m)
