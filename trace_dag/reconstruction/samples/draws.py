"""Draws of other possible courses of a crash, which vary what the report leaves open around the kept hypotheses.

A draw chooses one of the kept hypotheses (reading of the record, lanes, manoeuvres) by its likelihood before the
impact. It varies speeds, timing, lateral offset, mass, and the friction of the road. The draws are simulated and
weighed by the report in :mod:`trace_dag.reconstruction.samples.simulated`.

Spreads from sources:

* unreported speeds, and the loss of speed before the impact: :mod:`trace_dag.reconstruction.motion.speed_prior`;
* reported speeds: half of 5 mph either way, because they are rounded to 5 mph;
* drivers' reaction times: log-normal around the setting's, as of surprised drivers, half of whom react within 1.1 s
  and 95 % within 1.6 s (Olson and Sivak, Human Factors 28, 1986).

Spreads by judgement, not fitted:

* lateral: 0.25 m for a vehicle, half of its play in the lane, and 0.4 m for a person;
* along the way: 1.5 m for a vehicle and 0.5 m, a step, for a person;
* mass: 12 %, for load and models within a class;
* friction: 12 %, which is 0.65 to 0.85 of dry asphalt (0.5 to 0.9 over all pavements: Warner et al., SAE 830612);
* a person's pace: 20 %.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from statistics import NormalDist
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mph_to_mps, mps_to_mph
from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.reconstruction.motion.speed_prior import speed_kept_distribution, travel_speed_distribution
from trace_dag.reconstruction.motion.speeds import TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import party
from trace_dag.reconstruction.ranking import likelihood
from trace_dag.simulation.states import Hypothesis, ParticipantState, PartyDraw, Sample, SpeedSource

_OF_VEHICLE: Final = (1.5, 0.25)  # along and to the left, m
_OF_PERSON: Final = (0.5, 0.4)
_MASS, _FRICTION, _PACE = 0.12, 0.12, 0.2
_NORMAL: Final = NormalDist()
_REACTION: Final = math.log(1.6 / 1.1) / _NORMAL.inv_cdf(0.95)
_ROUNDED_TO_MPH: Final = 5.0
_WEIGHED_LATER: Final = ("impact area", "place of the impact", "manner of collision")
"""Terms of a hypothesis's score that the simulated contact is weighed by."""
_OF_EACH_PARTY: Final = 5  # numbers that a draw takes
_TAILS: Final = 0.005


def draw_samples(record: CrashRecord, hypotheses: Sequence[Hypothesis], count: int) -> tuple[Sample, ...]:
    """Return ``count`` draws; repeated calls give the same draws.

    They are spread evenly over each random number.

    >>> draws = draw_samples(record, state_estimate.hypotheses, 8)
    >>> len(draws), draws == draw_samples(record, state_estimate.hypotheses, 8)  # the same every time
    (8, True)
    """
    if count == 0:
        return ()
    most = max(len(hypothesis.participants) for hypothesis in hypotheses)
    columns = iter(_spread_evenly(record.key, count, 3 + _OF_EACH_PARTY * most))
    chosen = np.searchsorted(np.cumsum(_shares(hypotheses)), next(columns), side="right")
    friction = [math.exp(_FRICTION * _NORMAL.inv_cdf(share)) for share in next(columns)]
    *of_parties, reacts = [list(column) for column in columns]
    numbers = np.array(of_parties)
    return tuple(
        Sample(
            hypothesis=int(which),
            friction=round(friction[k], 4),
            parties=tuple(_draws(record, hypotheses[which], numbers[:, k])),
            reaction=round(math.exp(_REACTION * _NORMAL.inv_cdf(reacts[k])), 4),
        )
        for k, which in enumerate(np.minimum(chosen, len(hypotheses) - 1))
    )


def _spread_evenly(key: str, count: int, columns: int) -> Iterator[FloatArray]:
    """Yield a Latin hypercube sample (McKay, Beckman and Conover, 1979).

    Each column has one number in each of ``count`` equal parts."""
    random = np.random.default_rng(zlib.crc32(key.encode()))
    for _ in range(columns):
        yield np.clip((random.permutation(count) + random.random(count)) / count, _TAILS, 1 - _TAILS)


def _shares(hypotheses: Sequence[Hypothesis]) -> FloatArray:
    """Return the likelihood of each hypothesis by the evidence from before the impact; they sum to 1."""
    scores = [
        each.score - math.fsum(value for name, value in each.evidence.items() if name.startswith(_WEIGHED_LATER))
        for each in hypotheses
    ]
    shares = np.array([likelihood(score, max(scores)) for score in scores])
    return np.asarray(shares / shares.sum())


def _draws(record: CrashRecord, hypothesis: Hypothesis, numbers: FloatArray) -> Iterator[PartyDraw]:
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    for k, state in enumerate(hypothesis.participants):
        own = [float(value) for value in numbers[k * _OF_EACH_PARTY : (k + 1) * _OF_EACH_PARTY]]
        normal = [_NORMAL.inv_cdf(value) for value in own]
        along_m, left_m = _OF_PERSON if state.is_figure else _OF_VEHICLE
        vehicle = vehicles.get(state.vehicle_number)
        travel, impact = _speeds(record, vehicle, state, own[0], own[1], normal[0])
        yield PartyDraw(
            number=state.vehicle_number,
            travel_mps=round(travel, 3),
            impact_mps=round(impact, 3),
            ahead_m=round(along_m * normal[2], 3),
            left_m=round(left_m * normal[3], 3),
            mass_kg=round(state.mass_kg * math.exp(_MASS * normal[4]), 1),
        )


def _speeds(
    record: CrashRecord,
    vehicle: VehicleRecord | None,
    state: ParticipantState,
    share: float,
    kept: float,
    normal: float,
) -> tuple[float, float]:
    """Return the travel and impact speed of a party (m/s): those of the hypothesis, varied unless reported."""
    planned, at_impact = abs(state.initial_speed_mps), abs(state.impact_speed_mps)
    if state.is_figure or vehicle is None or state.initial_speed_mps < 0:
        pace = math.exp(_PACE * normal)
        return planned * pace, at_impact * pace
    own = party(record, vehicle)
    if state.speed_source is SpeedSource.REPORTED:
        travel = max(planned + _rounding_mps(planned) * (2 * share - 1), 0.0) if planned else 0.0
    else:
        speeds = travel_speed_distribution(own, TravelSpeed(planned, state.speed_source))
        travel = max(planned + speeds.at(share) - speeds.median, 0.0)
    if at_impact > planned:  # it sets off or speeds up
        return travel, at_impact * math.exp(_PACE * normal)
    return travel, travel * speed_kept_distribution(own).at(kept)


def _rounding_mps(speed_mps: float) -> float:
    """Return the error of a reported speed by its rounding (m/s)."""
    off_mph = abs(math.remainder(mps_to_mph(speed_mps), _ROUNDED_TO_MPH))
    return mph_to_mps(_ROUNDED_TO_MPH / 2 if off_mph < 0.1 else 0.5)
