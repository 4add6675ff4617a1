"""Traffic lights around a crash: a program for each junction, by which the parties did what the report says.

A program goes through the groups of lights of a junction (:mod:`trace_dag.roads.from_osm.controllers`), one after the
other: green, yellow, red for all. It takes 90 s, as the programs that SUMO's netconvert makes do; yellow is by the
formula of the Institute of Transportation Engineers, within the 3 to 6 s of the MUTCD (4F.17). All that is free is when
it began: so that who is reported to have disobeyed the light crosses its stop line on red, and everybody else on green.
If no beginning does that and the report has nobody who did, somebody ran the light: each reading stays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray
from trace_dag.crash.codes.vehicle import FLASHING, SIGNALS
from trace_dag.crash.parties import SURROUNDING, party_label
from trace_dag.crash.record import CrashRecord, PreCrashMovement
from trace_dag.roads.map.model import Controller, Road, Signal
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import BodyKind, Contact, SimulationLog, VehicleLog

_TENTHS: Final = 10  # of a second, in which programs are made
_CYCLE_S, _CLEARANCE_S, _LEAST_GREEN_S = 90.0, 1.0, 5.0
_YELLOW_S: Final = (3.0, 6.0)
_REACTION_S, _BRAKING_MPS2 = 1.0, 3.05  # ITE: 10 ft/s2
_USUAL_MPS: Final = 13.41  # 30 mph, where the map has no limit

_BEFORE_S: Final = 3.0  # a crash begins: who is past its stop line then came straight on
_STEP_S: Final = 0.02
_ASIDE_M: Final = 1.0  # of the lanes under a light
_ANOTHER_LEVEL_M: Final = 4.0
_WAITS_M, _STANDS_MPS = 40.0, 1.0
_JUST_BEFORE: Final = 5  # steps: a tenth of a second before a contact, which is too quick for its first one
_JUNCTION_M: Final = 40.0  # beyond a stop line, to the crosswalk at the far side
_ACROSS: Final = math.sin(math.radians(45.0))
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
        left_s = time_s % sum(duration_s for duration_s, _ in self.steps)
        for duration_s, colour in self.steps:
            left_s -= duration_s
            if left_s < 0.0:
                return colour
        return self.steps[-1][1]


@dataclass(frozen=True)
class MetLight:
    """A light that a party met before its first contact: when it crossed the stop line, or stood before it.

    ``wanted`` is the colour by the report, or of this reading of it, None where either may be; ``shown`` the program's.
    """

    party: int
    signal_id: str
    time_s: float
    stood: bool
    wanted: Colour | None
    shown: Colour


@dataclass(frozen=True)
class Lights:
    """One reading of the lights around a crash. ``ran``: the parties that ran one in it."""

    cycles: tuple[LightCycle, ...]
    met: tuple[MetLight, ...] = ()
    ran: tuple[int, ...] = ()

    def at(self, time_s: float) -> dict[str, Colour]:
        """Return the colour of each signal, by its id on the map."""
        return {signal_id: each.at(time_s) for each in self.cycles for signal_id in each.signal_ids}

    @property
    def in_words(self) -> str:
        """Return the colours that the parties met."""
        return "; ".join(
            f"{party_label(each.party)} {'stood before' if each.stood else 'crossed'} its stop line on {each.shown}"
            for each in self.met
        )


class _Meeting(NamedTuple):
    """A light that a party met; ``beyond_m`` is the way from the stop line to its first contact."""

    party: int
    signal_id: str
    time_s: float
    stood: bool
    beyond_m: float


def crash_lights(record: CrashRecord, network: RoadNetwork, log: SimulationLog) -> tuple[Lights, ...]:
    """Return the readings of the lights on a crash's map; none without lights.

    There are several where parties crossed each other and the report has nobody who ran the light. A junction whose
    lights flashed has no program, nor one whose crossing parties had no signal by the report.

    >>> crash_lights(record, network, log)[0].in_words  # a left turn across a motorcycle that came the other way
    'V1 crossed its stop line on green; V2 crossed its stop line on green'
    """
    junctions = [
        [each for each in network.controllers if each.id in junction.controller_ids]
        for junction in network.junctions
        if junction.controller_ids
    ]
    grouped = {each.id for controllers in junctions for each in controllers}
    meetings = sorted(_meetings(network, log), key=lambda met: (met.party, met.time_s)) if network.controllers else []
    readings = [
        found
        for controllers in (*junctions, *([each] for each in network.controllers if each.id not in grouped))
        if (found := list(_Junction(record, network, controllers, meetings, log).readings()))
    ]
    return tuple(
        Lights(
            tuple(cycle for each in chosen for cycle in each.cycles),
            tuple(sorted((met for each in chosen for met in each.met), key=lambda met: (met.party, met.time_s))),
            tuple(sorted(number for each in chosen for number in each.ran)),
        )
        for chosen in (product(*readings) if readings else ())
    )


class _Junction:
    """The lights of a junction, or of a crossing between junctions, and who met them."""

    def __init__(
        self,
        record: CrashRecord,
        network: RoadNetwork,
        controllers: Sequence[Controller],
        meetings: Sequence[_Meeting],
        log: SimulationLog,
    ) -> None:
        self._record, self._log, self._controllers = record, log, controllers
        self._group_of = {signal_id: k for k, each in enumerate(controllers) for signal_id in each.signal_ids}
        last = {each.party: each for each in meetings}  # they are in the order of times
        self._met = [each for each in meetings if each.signal_id in self._group_of]
        self._last = [each for each in self._met if last[each.party] is each and not each.stood]
        limits = {signal.id: road.speed_mps or _USUAL_MPS for road in network.roads for signal in road.signals}
        share = _CYCLE_S / max(len(controllers), 2)  # where there is one group, people cross
        phases = []
        for each in controllers:
            yellow_s = _REACTION_S + max(limits[name] for name in each.signal_ids) / (2 * _BRAKING_MPS2)
            yellow_s = min(max(yellow_s, _YELLOW_S[0]), _YELLOW_S[1])
            phases.append((max(share - yellow_s - _CLEARANCE_S, _LEAST_GREEN_S), yellow_s, _CLEARANCE_S))
        phases += [(0.0, 0.0, share)] * (len(phases) == 1)
        tenths = [[round(_TENTHS * each) for each in phase] for phase in phases]
        # The colours of each group, every tenth of a second of the cycle.
        self._shown = [
            np.concatenate(
                [
                    np.repeat([Colour.GREEN, Colour.YELLOW, Colour.RED] if k == own else [Colour.RED] * 3, phase)
                    for k, phase in enumerate(tenths)
                ]
            )
            for own in range(len(controllers))
        ]

    def readings(self) -> Iterator[Lights]:
        """Yield what the lights can have shown: as reported or, where the report leaves it open, each possibility."""
        vehicles = {each.number: each for each in self._record.vehicles}
        controls = {
            each.party: vehicles[each.party].traffic_control_code for each in self._met if each.party in vehicles
        }
        if FLASHING in controls.values():
            return
        ran = frozenset(
            each.party
            for each in self._last
            if each.party in vehicles
            and vehicles[each.party].disobeyed_control
            and controls[each.party] in (None, *SIGNALS)
        )
        person, driver = (None, None) if ran else self._walked_across()
        if person is not None and driver is not None:
            noted = any(
                _DISOBEYED & set(each.circumstances) for each in self._record.non_motorists if each.party == person
            )
            possible = [frozenset({each}) for each in ((person,) if noted else (person, driver))]
        elif ran or self._begins(ran)[1]:
            possible = [ran]
        elif None not in controls.values() and not SIGNALS & set(controls.values()):
            return
        else:
            crossed = sorted({each.party for each in self._met if not each.stood})
            possible = [each for each in map(frozenset, zip(crossed)) if self._begins(each)[1]] or [ran]
        yield from map(self._reading, possible)

    def _reading(self, ran: frozenset[int]) -> Lights:
        begins, _ = self._begins(ran)
        cycles = []
        for controller, shown in zip(self._controllers, self._shown, strict=True):
            rolled = np.roll(shown, -begins)
            ends = [*(np.flatnonzero(rolled[1:] != rolled[:-1]) + 1).tolist(), len(rolled)]
            steps = [
                ((end - start) / _TENTHS, Colour(rolled[start])) for start, end in zip([0, *ends], ends, strict=False)
            ]
            cycles.append(LightCycle(controller.id, controller.signal_ids, tuple(steps)))
        met = [
            MetLight(
                each.party,
                each.signal_id,
                round(each.time_s, 2),
                each.stood,
                self._wanted(each, ran),
                cycles[self._group_of[each.signal_id]].at(each.time_s),
            )
            for each in self._met
        ]
        return Lights(tuple(cycles), tuple(met), tuple(ran))

    def _wanted(self, met: _Meeting, ran: frozenset[int]) -> Colour | None:
        if met.stood or (met.party in ran and met in self._last):
            return Colour.RED
        near_side = PreCrashMovement.TURNING_LEFT if self._record.keeps_left else PreCrashMovement.TURNING_RIGHT
        may_turn = any(each.number == met.party and each.movement is near_side for each in self._record.vehicles)
        return None if may_turn else Colour.GREEN  # a turn on red is allowed

    def _begins(self, ran: frozenset[int]) -> tuple[int, bool]:
        """Return the place in the cycle (tenths of a second) at time 0, and whether it does what is wanted of it.

        It is the middle of the longest stretch of best ones. Crossing a stop line counts more than standing before it,
        running the light more than having green, yellow more than red.
        """
        length = len(self._shown[0])
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
        begins = np.flatnonzero(best & ~np.roll(best, 1)).tolist()
        lasts = {begin: int(np.argmin(np.roll(best, -begin))) for begin in begins}
        longest = max(begins, key=lambda begin: lasts[begin])
        middle = (longest + lasts[longest] // 2) % length
        return middle, bool(agreeing[middle] == wished)

    def _walked_across(self) -> tuple[int, int] | tuple[None, None]:
        """Return who walked across the way of a driver straight on at the junction, by number, and that driver."""
        contact = self._log.first_contact
        if contact is None or not self._log.is_figure(contact.number_2):
            return None, None
        person = self._log.bodies[contact.number_2]
        straight_on = all(
            each.movement not in _TURNS for each in self._record.vehicles if each.number == contact.number_1
        )
        met = any(each.party == contact.number_1 and each.beyond_m < _JUNCTION_M for each in self._last)
        across = person.kind is not BodyKind.ANIMAL and _goes_across(contact)
        return (contact.number_2, contact.number_1) if met and straight_on and across else (None, None)


def _goes_across(contact: Contact) -> bool:
    (vx, vy), heading = contact.velocity_2_mps, contact.pose_1.heading_rad
    return abs(vy * math.cos(heading) - vx * math.sin(heading)) > _ACROSS * max(math.hypot(vx, vy), 0.1)


def _meetings(network: RoadNetwork, log: SimulationLog) -> Iterator[_Meeting]:
    """Yield the lights that vehicles and cyclists crossed, or stood before, up to their first contacts."""
    found = (_stop_line(network, road, each) for road in network.roads for each in road.signals if each.dynamic)
    lines = [line for line in found if line is not None]
    for each in log.parties:
        body = log.bodies[each.number]
        if each.number > SURROUNDING or body.kind not in (BodyKind.MOTOR_VEHICLE, BodyKind.CYCLIST):
            continue
        touched = [c.time_s for c in log.contacts if each.number in (c.number_1, c.number_2)]
        until_s = min(touched, default=log.duration_s)
        times = np.arange(-_BEFORE_S, until_s + _STEP_S / 2, _STEP_S)
        front_m, speed_mps = _front(each, body.length_m, times)
        for line in lines:
            if (crosses := line.met(front_m)) is not None:
                yield _Meeting(each.number, line.signal_id, float(times[crosses]), False, line.beyond_m(front_m))
        waits = [(line.beyond_m(front_m), line.signal_id) for line in lines if line.waits(front_m)]
        if waits and speed_mps[-_JUST_BEFORE:].min() < _STANDS_MPS:
            beyond_m, signal_id = max(waits)
            yield _Meeting(each.number, signal_id, until_s, True, beyond_m)


class _StopLine(NamedTuple):
    """A line across the lanes under a light, in the axes of their traffic."""

    signal_id: str
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    left_m: float
    right_m: float

    def seen(self, places_m: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return how far beyond the line places x, y, z are, and whether they are in its lanes."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy, dz = places_m.T - np.array([[self.x_m], [self.y_m], [self.z_m]])
        aside = dy * c - dx * s
        within = (aside < self.left_m + _ASIDE_M) & (aside > self.right_m - _ASIDE_M) & (np.abs(dz) < _ANOTHER_LEVEL_M)
        return dx * c + dy * s, within

    def met(self, front_m: FloatArray) -> int | None:
        """Return the first of the places, in the order of time, at which a front is across the line."""
        beyond_m, within = self.seen(front_m)
        crosses = np.flatnonzero((beyond_m[:-1] < 0.0) & (beyond_m[1:] >= 0.0) & within[1:])
        return int(crosses[0]) + 1 if len(crosses) else None

    def beyond_m(self, front_m: FloatArray) -> float:
        """Return how far the last of the places is beyond the line."""
        return float(self.seen(front_m[-1:])[0][0])

    def waits(self, front_m: FloatArray) -> bool:
        """Return whether the last of the places is shortly before the line."""
        return bool(self.seen(front_m[-1:])[1][0]) and -_WAITS_M < self.beyond_m(front_m) <= 0.0


def _stop_line(network: RoadNetwork, road: Road, signal: Signal) -> _StopLine | None:
    x, y, heading, _ = network.road_geometry(road.id).line.at(signal.s_m)
    heading += math.pi if signal.orientation == "-" else 0.0
    c, s = math.cos(heading), math.sin(heading)
    edges = [
        network.pose(ref, signal.s_m, side * network.width_m(ref, signal.s_m) / 2)
        for ref in network.drivable_lanes_of(road)
        for begin_m, end_m in [network.lane_span(ref)]
        if begin_m <= signal.s_m <= end_m and ref.lane_id in road.lanes_under(signal)
        for side in (1, -1)
    ]
    if not edges:
        return None
    aside_m = [(each.y_m - y) * c - (each.x_m - x) * s for each in edges]
    return _StopLine(signal.id, x, y, edges[0].z_m, heading, max(aside_m), min(aside_m))


def _front(moved: VehicleLog, length_m: float, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middle of a front, shape (n, 3), and the speed at times; straight on before the crash begins."""
    before_s = np.minimum(times, 0.0)
    columns = (moved.x_m, moved.y_m, moved.z_m, np.unwrap(moved.heading_rad), moved.speed_mps)
    x, y, z, heading, speed = (np.interp(times, moved.time_s, values) for values in columns)
    x = x + before_s * moved.velocity_x_mps[0] + length_m / 2 * np.cos(heading)
    y = y + before_s * moved.velocity_y_mps[0] + length_m / 2 * np.sin(heading)
    return np.column_stack([x, y, z]), np.abs(speed)
