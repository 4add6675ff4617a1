"""Simulate the draws of an estimate, weigh them by the report, and compute intervals from them.

Every draw (:mod:`trace_dag.states.samples`) is run from shortly before its first contact to the end of that contact's
pulse. A run counts as much as its contact is likely by the report: the areas that were struck, the manner of collision
and the place, as :mod:`trace_dag.states.evidence` weighs them; one without a contact does not count. Draws are always
run by the embedded back-end, on the crash's own map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from typing import Final

import numpy as np
from pydantic import TypeAdapter, ValidationError

from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Failure
from trace_dag.geometry import FloatArray, Pose, arc_lengths, body_bearing_rad
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import SimSettings
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.run import participant, surface_friction
from trace_dag.sim.surface import NetworkSurface
from trace_dag.sim.types import PULSE_S, Contact, Participant, SimulationLog
from trace_dag.states.contact import Shape, shape_gaps_m, shapes
from trace_dag.states.evidence import impact_area_log_likelihood, manner_log_likelihood, place_log_likelihood
from trace_dag.states.objects import FixedObject
from trace_dag.states.types import Hypothesis, ParticipantState, PartyDraw, Sample, StateEstimate, Trajectory

LOW, HIGH = 0.1, 0.9
"""Ends of the intervals: four in five draws are within."""
_APART_M: Final = 0.3
_BACK_S: Final = np.arange(0.1, 3.01, 0.1)
_AFTER_S: Final = 1.5
_LONGEST_S: Final = float(_BACK_S[-1]) + _AFTER_S
_STEP_S: Final = 0.05
_LEAST_WEIGHT: Final = 1e-6


@dataclass(frozen=True)
class SampledParty:
    """A party of the first contact: speed at it and change of velocity by it (m/s), bearing of the contact on it."""

    number: int
    impact_speed_mps: float
    delta_v_mps: float
    bearing_rad: float


@dataclass(frozen=True)
class SampledContact:
    """The first contact of a draw, by its place among the estimate's, and its weight: of all draws together 1."""

    sample: int
    weight: float
    x_m: float
    y_m: float
    angle_deg: float | None  # between the headings of two parties, 0 to 180
    parties: tuple[SampledParty, ...]


@dataclass(frozen=True)
class Interval:
    """A quantity of the best hypothesis and of the draws: four in five are between ``low`` and ``high``.

    ``party`` is None of what belongs to the crash.
    """

    quantity: str
    unit: str
    party: int | None
    best: float
    low: float
    middle: float
    high: float


@dataclass(frozen=True)
class SampledRuns:
    """The results of the draws of a crash. ``effective`` is the number of draws of equal weight that they are worth."""

    drawn: int
    effective: float
    contacts: tuple[SampledContact, ...]
    intervals: tuple[Interval, ...]


def simulate_samples(
    network: RoadNetwork,
    estimate: StateEstimate,
    logs: Sequence[SimulationLog],
    settings: SimSettings,
    record: CrashRecord,
    place_xy_m: tuple[float, float],
) -> SampledRuns:
    """The draws of an estimate; ``logs`` are those of its hypotheses, ``place_xy_m`` where the impact is to be."""
    surface, friction = NetworkSurface(network), surface_friction(settings, record)
    weighed: list[tuple[SampledContact, float]] = []
    for k, sample in enumerate(estimate.samples):
        hypothesis = estimate.hypotheses[sample.hypothesis]
        participants = _drawn(hypothesis, sample)
        if participants is None:
            continue
        simulation = EmbeddedSimulation(settings, surface, friction * sample.friction, network)
        log = simulation.run(participants, time_limit_s=_LONGEST_S, after_contact_s=PULSE_S, objects=hypothesis.objects)
        if log.first_contact is not None:
            seen = _contact(log, log.first_contact, k)
            weighed.append((seen, _log_likelihood(record, seen, place_xy_m)))
    contacts = _with_weights(weighed)
    best = next((log for log in logs if log.first_contact is not None), None)
    effective = 1.0 / sum(each.weight**2 for each in contacts) if contacts else 0.0
    return SampledRuns(
        drawn=len(estimate.samples),
        effective=round(effective, 1),
        contacts=contacts,
        intervals=tuple(_intervals(best, contacts)) if best is not None and contacts else (),
    )


# --- from a draw to a run ----------------------------------------------------------------------------------------
def _drawn(hypothesis: Hypothesis, sample: Sample) -> tuple[Participant, ...] | None:
    """The parties of a draw shortly before they would touch; None if they overlap however far back one looks."""
    meets_s = hypothesis.planned[0].time_s if hypothesis.planned else hypothesis.impact_time_s
    lines = [_Line(state, draw, meets_s) for state, draw in zip(hypothesis.participants, sample.parties, strict=True)]
    apart = np.ones(len(_BACK_S), dtype=bool)
    bodies = [line.shapes(-_BACK_S) for line in lines] + [_standing(item) for item in hypothesis.objects]
    moving = len(lines)
    for (i, one), (_, two) in combinations(enumerate(bodies), 2):
        if i < moving:
            apart &= shape_gaps_m(one, two) >= _APART_M
    back = np.flatnonzero(apart)
    if not len(back):
        return None
    return tuple(line.participant(float(_BACK_S[back[0]])) for line in lines)


def _standing(item: FixedObject) -> tuple[Shape, ...]:
    pose, same = item.pose, np.ones(len(_BACK_S))
    poses = (pose.x_m * same, pose.y_m * same, pose.heading_rad * same)
    return shapes(poses, (item.length_m, item.width_m), None, None)


class _Line:
    """The path of a party's plan, driven at a draw's speed: where it is so many seconds from when the plan has it at
    the impact. Beyond its ends the path goes straight on."""

    def __init__(self, state: ParticipantState, draw: PartyDraw, meets_s: float) -> None:
        plan = state.trajectory
        self._state, self._draw, self._meets_s = state, draw, meets_s
        self._xy_m = np.stack([plan.x_m, plan.y_m], axis=-1)
        self._heading_rad = np.unwrap(plan.heading_rad)
        self._trailing_rad = state.trailer_heading_rad
        self._station_m = arc_lengths(self._xy_m)
        self._from_m = float(np.interp(meets_s, plan.time_s, self._station_m)) + draw.ahead_m
        self._backward = state.impact_speed_mps < 0
        self._mps = draw.impact_mps

    def _at(self, seconds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """x, y, z and heading at times from the impact."""
        station, on_path = self._station_m, self._from_m + self._mps * seconds
        heading = np.interp(on_path, station, self._heading_rad)
        course = heading + math.pi if self._backward else heading
        beyond = on_path - np.clip(on_path, 0.0, station[-1])
        x = np.interp(on_path, station, self._xy_m[:, 0]) + beyond * np.cos(course)
        y = np.interp(on_path, station, self._xy_m[:, 1]) + beyond * np.sin(course)
        z = np.interp(on_path, station, self._state.trajectory.z_m)
        left_m = self._draw.left_m
        return x - left_m * np.sin(heading), y + left_m * np.cos(heading), z, heading

    def shapes(self, seconds: FloatArray) -> tuple[Shape, ...]:
        x, y, _, heading = self._at(seconds)
        state = self._state
        return shapes((x, y, heading), (state.length_m, state.width_m), state.trailer, self._trailing(seconds))

    def _trailing(self, seconds: FloatArray) -> FloatArray | None:
        """Heading of the trailer, as the plan has it there."""
        if self._trailing_rad is None:
            return None
        return np.asarray(np.interp(self._from_m + self._mps * seconds, self._station_m, self._trailing_rad))

    def participant(self, back_s: float) -> Participant:
        time_s = np.arange(0.0, back_s + _AFTER_S, _STEP_S)
        x, y, z, heading = self._at(time_s - back_s)
        speed = -self._mps if self._backward else self._mps
        planned = participant(self._state)
        trailing = self._trailing(np.array([-back_s]))
        return replace(
            planned,
            body=replace(planned.body, mass_kg=self._draw.mass_kg),
            initial_pose=Pose(float(x[0]), float(y[0]), math.remainder(float(heading[0]), math.tau), float(z[0])),
            initial_speed_mps=speed,
            trajectory=Trajectory(time_s, x, y, z, heading, np.full_like(time_s, speed)),
            skids_from_s=max(planned.skids_from_s - self._meets_s + back_s, 0.0),
            trailer_heading_rad=0.0 if trailing is None else float(trailing[0]),
        )


# --- what came of it ---------------------------------------------------------------------------------------------
def _contact(log: SimulationLog, contact: Contact, sample: int) -> SampledContact:
    sides = [
        (contact.number_1, contact.pose_1, contact.velocity_1_mps, contact.delta_v_1_mps),
        (contact.number_2, contact.pose_2, contact.velocity_2_mps, contact.delta_v_2_mps),
    ]
    sides = [side for side in sides if side[0] in log.bodies]
    point = np.array([contact.x_m, contact.y_m])
    return SampledContact(
        sample=sample,
        weight=0.0,
        x_m=round(contact.x_m, 3),
        y_m=round(contact.y_m, 3),
        angle_deg=_angle_deg(sides[0][1], sides[1][1]) if len(sides) > 1 else None,
        parties=tuple(
            SampledParty(
                number=number,
                impact_speed_mps=round(math.hypot(*velocity), 3),
                delta_v_mps=round(math.hypot(*delta_v), 3),
                bearing_rad=round(body_bearing_rad(*log.clock_body(contact, number), point), 4),
            )
            for number, _, velocity, delta_v in sides
        ),
    )


def _angle_deg(one: Pose, two: Pose) -> float:
    return round(abs(math.degrees(math.remainder(one.heading_rad - two.heading_rad, math.tau))), 2)


def _log_likelihood(record: CrashRecord, seen: SampledContact, place_xy_m: tuple[float, float]) -> float:
    """How likely a contact is by the report."""
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    struck = [each for each in seen.parties if each.number in vehicles]
    bearings = [(vehicles[each.number], np.array([each.bearing_rad])) for each in struck]
    found = sum(float(impact_area_log_likelihood(vehicle, bearing)[0]) for vehicle, bearing in bearings)
    if len(bearings) == 2:
        found += float(manner_log_likelihood(record, bearings[0][1], bearings[1][1])[0])
    away_m = math.hypot(seen.x_m - place_xy_m[0], seen.y_m - place_xy_m[1])
    return found + float(place_log_likelihood(np.array(away_m)))


def _with_weights(weighed: Sequence[tuple[SampledContact, float]]) -> tuple[SampledContact, ...]:
    """The contacts with their weights, without those of negligible weight."""
    if not weighed:
        return ()
    likeliest = max(log_likelihood for _, log_likelihood in weighed)
    weights = np.array([math.exp(log_likelihood - likeliest) for _, log_likelihood in weighed])
    weights /= weights.sum()
    return tuple(
        replace(contact, weight=round(float(weight), 6))
        for (contact, _), weight in zip(weighed, weights, strict=True)
        if weight > _LEAST_WEIGHT
    )


def _intervals(best: SimulationLog, contacts: Sequence[SampledContact]) -> Iterator[Interval]:
    first = best.first_contact
    assert first is not None
    planned = _contact(best, first, 0)
    for party in planned.parties:
        drawn = [(each, side) for each in contacts for side in each.parties if side.number == party.number]
        if not drawn:
            continue
        speeds = [(side.impact_speed_mps, each.weight) for each, side in drawn]
        yield _interval("impact_speed", "m/s", party.number, party.impact_speed_mps, speeds)
        if not best.is_figure(party.number):
            changes = [(side.delta_v_mps, each.weight) for each, side in drawn]
            yield _interval("delta_v", "m/s", party.number, party.delta_v_mps, changes)
    yield _interval("contact_x", "m", None, planned.x_m, [(each.x_m, each.weight) for each in contacts])
    yield _interval("contact_y", "m", None, planned.y_m, [(each.y_m, each.weight) for each in contacts])
    angles = [(each.angle_deg, each.weight) for each in contacts if each.angle_deg is not None]
    if planned.angle_deg is not None and angles:
        yield _interval("heading_angle", "deg", None, planned.angle_deg, angles)


def _interval(
    quantity: str, unit: str, party: int | None, best: float, values: Iterable[tuple[float, float]]
) -> Interval:
    low, middle, high = weighted_quantiles(list(values), (LOW, 0.5, HIGH))
    return Interval(quantity, unit, party, *(round(value, 3) for value in (best, low, middle, high)))


def weighted_quantiles(values: Sequence[tuple[float, float]], shares: Sequence[float]) -> list[float]:
    """Quantiles of values with weights; each value stands in the middle of its weight.

    >>> weighted_quantiles([(30.0, 1.0), (10.0, 2.0), (20.0, 1.0)], (0.25, 0.625, 0.9))
    [10.0, 20.0, 30.0]
    """
    ordered = np.array(sorted(values))
    weights = ordered[:, 1] / ordered[:, 1].sum()
    reached = np.cumsum(weights) - weights / 2
    return [float(value) for value in np.interp(shares, reached, ordered[:, 0])]


# --- stored ------------------------------------------------------------------------------------------------------
@cache
def _adapter() -> TypeAdapter[SampledRuns]:
    return TypeAdapter(SampledRuns)


def samples_to_json(runs: SampledRuns) -> bytes:
    """What the draws came to, as UTF-8 JSON; the same bytes for the same runs."""
    return _adapter().dump_json(runs) + b"\n"


def samples_from_json(data: bytes) -> SampledRuns:
    """Read what :func:`samples_to_json` wrote; :class:`Failure` where it is not that."""
    try:
        return _adapter().validate_json(data)
    except ValidationError as error:
        raise Failure(f"sampled runs: not of this version ({error}); simulate again") from error
