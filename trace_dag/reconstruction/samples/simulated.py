"""Simulate the draws of an estimate, weigh them by the report, and compute intervals from them.

Every draw (:mod:`trace_dag.reconstruction.samples.draws`) is run from shortly before its first contact to the end of
that contact's pulse. The weight of a run is the likelihood of its contact by the report: struck areas, manner of
collision and place, as in :mod:`trace_dag.reconstruction.evidence`; a run without a contact has none. The runs of the
largest weights continue to rest, for their courses. Draws are always run by the embedded back-end, on the crash's own
map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydantic import ValidationError

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose, body_bearing_rad
from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.evidence import impact_area_log_likelihood, manner_log_likelihood, place_log_likelihood
from trace_dag.reconstruction.samples.crash import LONGEST_BACK_S, SampledCourse, SampledCrash, course_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.crash_run import CrashRun
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.run import surface_friction
from trace_dag.simulation.states import Sample, StateEstimate
from trace_dag.simulation.surface import NetworkSurface
from trace_dag.simulation.types import PULSE_S, Contact, SimulationLog

LOW, HIGH = 0.1, 0.9
"""Ends of the intervals: four in five draws are within."""
_LATEST_S: Final = 1.5  # after the planned impact: who touches nobody until then never does
_COURSES: Final = 3
_COURSE_AFTER_S: Final = 6.0
_LEAST_WEIGHT: Final = 1e-6


@dataclass(frozen=True)
class SampledParty:
    """A party of the first contact: its speed and change of velocity (m/s), and the bearing of the contact on it."""

    number: int
    impact_speed_mps: float
    delta_v_mps: float
    bearing_rad: float


@dataclass(frozen=True)
class SampledContact:
    """The first contact of a draw, with the draw's index and weight; all weights sum to 1."""

    sample: int
    weight: float
    x_m: float
    y_m: float
    angle_deg: float | None  # between the headings of two parties, 0 to 180
    parties: tuple[SampledParty, ...]


@dataclass(frozen=True)
class Interval:
    """A quantity of the best hypothesis and of the draws: four in five are between ``low`` and ``high``.

    ``party`` is None for a quantity of the whole crash.
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
    """The simulated draws of a crash.

    ``effective`` is the effective number of draws; ``courses`` are those of the draws with the largest weights, in
    falling order.
    """

    drawn: int
    effective: float
    contacts: tuple[SampledContact, ...]
    intervals: tuple[Interval, ...]
    courses: tuple[SampledCourse, ...] = ()

    def contact_of(self, course: SampledCourse) -> SampledContact:
        """Return the first contact of a course's draw."""
        return next(each for each in self.contacts if each.sample == course.sample)


def simulate_samples(
    network: RoadNetwork,
    estimate: StateEstimate,
    logs: Sequence[SimulationLog],
    settings: SimSettings,
    record: CrashRecord,
    place_xy_m: tuple[float, float],
) -> SampledRuns:
    """Simulate the draws of an estimate.

    ``logs`` are those of its hypotheses, ``place_xy_m`` is the reported place of the impact.
    """
    friction = surface_friction(settings, record)
    simulation = EmbeddedSimulation(settings, NetworkSurface(network), friction, network)

    def begun(drawn: SampledCrash, sample: Sample) -> CrashRun:
        parties, limit_s = drawn.participants(_COURSE_AFTER_S), LONGEST_BACK_S + _COURSE_AFTER_S
        here = simulation.of_draw(friction * sample.friction, settings.reaction_s * sample.reaction)
        return here.begin(parties, time_limit_s=limit_s, objects=drawn.objects)

    weighed: list[tuple[SampledContact, float]] = []
    heaviest: list[tuple[float, int, SampledCrash, CrashRun]] = []  # the likeliest so far, which may go on
    for k, sample in enumerate(estimate.samples):
        drawn = SampledCrash.of(estimate.hypotheses[sample.hypothesis], sample)
        if drawn is None:
            continue
        run = begun(drawn, sample)
        log = run.log(until_s=drawn.back_s + _LATEST_S, after_contact_s=PULSE_S)
        if log.first_contact is None:
            run.release()
            continue
        seen = _contact(log, log.first_contact, k)
        log_likelihood = _log_likelihood(record, seen, place_xy_m)
        weighed.append((seen, log_likelihood))
        heaviest = sorted([*heaviest, (-log_likelihood, k, drawn, run)], key=lambda each: each[:2])
        if len(heaviest) > _COURSES:
            *_, over = heaviest.pop()
            over.release()
    contacts = _with_weights(weighed)
    weigh_something = {contact.sample for contact in contacts}
    courses: list[SampledCourse] = []
    for _, k, drawn, run in heaviest:
        if k in weigh_something:
            courses += filter(None, [course_of(k, drawn, run.log(after_contact_s=_COURSE_AFTER_S))])
        run.release()
    best = next((log for log in logs if log.first_contact is not None), None)
    effective = 1.0 / math.fsum(each.weight**2 for each in contacts) if contacts else 0.0
    return SampledRuns(
        drawn=len(estimate.samples),
        effective=round(effective, 1),
        contacts=contacts,
        intervals=tuple(_intervals(best, contacts)) if best is not None and contacts else (),
        courses=tuple(courses),
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
    """Score a contact by the report."""
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    struck = [each for each in seen.parties if each.number in vehicles]
    bearings = [(vehicles[each.number], np.array([each.bearing_rad])) for each in struck]
    found = math.fsum(float(impact_area_log_likelihood(vehicle, bearing)[0]) for vehicle, bearing in bearings)
    if len(bearings) == 2:
        found += float(manner_log_likelihood(record, bearings[0][1], bearings[1][1])[0])
    away_m = math.hypot(seen.x_m - place_xy_m[0], seen.y_m - place_xy_m[1])
    return found + float(place_log_likelihood(record, np.array(away_m)))


def _with_weights(weighed: Sequence[tuple[SampledContact, float]]) -> tuple[SampledContact, ...]:
    """Return the contacts with their weights, without those of negligible weight."""
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
    low, middle, high = compute_weighted_quantiles(list(values), (LOW, 0.5, HIGH))
    return Interval(quantity, unit, party, *(round(value, 3) for value in (best, low, middle, high)))


def compute_weighted_quantiles(values: Sequence[tuple[float, float]], shares: Sequence[float]) -> list[float]:
    """Return quantiles of values with weights; each value counts at the middle of its weight.

    >>> compute_weighted_quantiles([(30.0, 1.0), (10.0, 2.0), (20.0, 1.0)], (0.25, 0.625, 0.9))
    [10.0, 20.0, 30.0]
    """
    ordered = np.array(sorted(values))
    weights = ordered[:, 1] / ordered[:, 1].sum()
    reached = np.cumsum(weights) - weights / 2
    return [float(value) for value in np.interp(shares, reached, ordered[:, 0])]


# --- stored ------------------------------------------------------------------------------------------------------
def samples_to_json(runs: SampledRuns) -> bytes:
    """Write the simulated draws as UTF-8 JSON; equal runs give equal bytes.

    >>> samples_to_json(SampledRuns(8, 0.0, (), ()))[:10]
    b'{"drawn":8'
    """
    return json_adapter(SampledRuns).dump_json(runs) + b"\n"


def samples_from_json(data: bytes) -> SampledRuns:
    """Read draws written by :func:`samples_to_json`.

    Raises :class:`Failure` for other content.

    >>> samples_from_json(b'{"drawn": 8, "effective": 5.5, "contacts": [], "intervals": []}').drawn
    8
    """
    try:
        return json_adapter(SampledRuns).validate_json(data)
    except ValidationError as error:
        raise Failure(f"sampled runs: not of this version ({error}); simulate again") from error
