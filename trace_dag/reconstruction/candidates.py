"""Candidates: for one reading of the record, the pairs of paths that can have led to the crash.

The solver finds whether and where the bodies touch on these paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from trace_dag.crash.crash_types import Relation
from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.path_pairs import PathPair, backing, crossing
from trace_dag.reconstruction.motion.path_pairs_along import opposite, same_direction, same_lane
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import PreCrashScenario
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import vehicle_terms


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pair of options, the mover's first.

    ``parallel``: both go along one road, so the contact can be anywhere along it.
    """

    scenario: PreCrashScenario
    mover: Option
    other: Option
    mover_speed: TravelSpeed
    other_speed: TravelSpeed
    mover_profile: SpeedProfile
    other_profile: SpeedProfile
    parallel: bool
    terms: dict[str, float] = field(default_factory=dict)

    @property
    def log_prior(self) -> float:
        """Return the log-likelihood of everything known before the contact is solved for."""
        return self.scenario.log_prior + math.fsum(self.terms.values())


def candidates(scene: Scene, scenario: PreCrashScenario) -> list[Candidate]:
    """Return all candidates of one reading.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import pre_crash_scenarios
    >>> from trace_dag.reconstruction.analytic_hypotheses import parties
    >>> found = candidates(scene, pre_crash_scenarios(record, *parties(record, sequence.first))[0])
    >>> {each.mover.manoeuvre.value for each in found}  # vehicle 1 turns left, by every reading of its path
    {'turn_left'}
    """
    if scenario.mover.backing:
        return [_judged(scene, scenario, pair) for pair in backing(scene, scenario)]
    makers: dict[Relation, Callable[[Scene, PreCrashScenario], Iterator[PathPair]]] = {
        Relation.SAME_LANE: same_lane,
        Relation.SAME_DIRECTION: same_direction,
        Relation.OPPOSITE_DIRECTION: opposite,
        Relation.CROSSING: crossing,
    }
    pairs = makers[scenario.relation](scene, scenario)
    return [_judged(scene, scenario, pair) for pair in pairs if _at_one_time(pair.mover.approach, pair.other.approach)]


def _at_one_time(one: Approach, two: Approach) -> bool:
    """Return whether both paths can be used at one time, since traffic on reversible roads goes one way."""
    if not (one.goes_either_way and two.goes_either_way) or one.wrong_way or two.wrong_way:
        return True
    return one.other_way == two.other_way


def _judged(scene: Scene, scenario: PreCrashScenario, pair: PathPair) -> Candidate:
    terms = pair.terms | evidence.crossing_ahead_terms(scene, scenario.relation, pair.mover.approach)
    sides = ((scenario.mover, pair.mover, pair.mover_speed), (scenario.other, pair.other, pair.other_speed))
    for side in sides:
        terms |= vehicle_terms(scene, *side)
    keep_on = [option.approach for party, option, _ in sides if not (party.turn or party.backing)]
    terms |= evidence.first_street_terms(scene, keep_on, cross=scenario.relation is Relation.CROSSING)
    if scenario.relation is Relation.CROSSING and not any(party.turn or party.backing for party, _, _ in sides):
        one, two = (
            evidence.CrossingVehicle(party.vehicle, option.approach, speed.speed_mps) for party, option, speed in sides
        )
        terms |= evidence.crossing_terms(one, two)
    return Candidate(
        scenario,
        pair.mover,
        pair.other,
        pair.mover_speed,
        pair.other_speed,
        speed_profile(scenario.mover, pair.mover_speed.speed_mps),
        pair.other_profile or speed_profile(scenario.other, pair.other_speed.speed_mps),
        pair.parallel,
        terms,
    )
