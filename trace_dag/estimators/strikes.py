"""The estimator of crashes in which vehicles strike people or animals: one strike, or several in order.

Who is struck again lies where the first strike threw it. That is simulated, with whoever takes part so far, and the
next vehicle is led over the place once the person has come to rest there. The simulator's own settings are the usual
ones here, whatever those of the simulation are: an estimate follows from the record and the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.crash.animals import Pace, Species, StruckAnimal
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.strikes import Strike, order_is_told, strikes_of, untold_strike
from trace_dag.errors import Reason, Rejection
from trace_dag.estimators.usual_simulation import USUAL, usual_simulation
from trace_dag.geometry import FloatArray
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import StateSettings
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.run import participant
from trace_dag.sim.types import Contact, SimulationLog
from trace_dag.states.analytic import NAME, VERSION, build_scene
from trace_dag.states.contact import STANDING_MPS
from trace_dag.states.ranking import ambiguity, leaders_first
from trace_dag.states.scene import Scene
from trace_dag.states.strikes import ESSENTIAL, LaterStrike, first_states, later_state, next_way, strike_hypothesis
from trace_dag.states.striking import StrikePlan, strike_plans
from trace_dag.states.types import EstimatorRun, Hypothesis, ParticipantState, StateEstimate
from trace_dag.wording import counted

_LONGEST_CHAIN_S: Final = 12.0  # from the first strike to the last
_SETTLES_S: Final = 1.0  # after a thrown person has come to rest
_RESTS_M: Final = 0.05  # nearer to where it ends up, a person is at rest
_LATER_S: Final = (0.0, 2.0, 4.0, 6.0, 8.0)  # a slower vehicle comes so much later, else it would be in the way


@dataclass(frozen=True, eq=False)
class _Crash:
    """What is known of the crash throughout; the first strike comes ``lead_s`` after the beginning."""

    scene: Scene
    simulation: EmbeddedSimulation
    time_limit_s: float
    lead_s: float

    def simulated(
        self, states: Sequence[ParticipantState], as_long_as: Callable[[Sequence[Contact]], bool] | None = None
    ) -> SimulationLog:
        """What comes of those who take part, as long as the contacts are as asked for."""
        parties = tuple(map(participant, states))
        return self.simulation.run(parties, time_limit_s=self.time_limit_s, as_long_as=as_long_as)


def estimate_strikes(
    record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings
) -> StateEstimate:
    """The ranked hypotheses of a crash with people or an animal, best first.

    Raises :class:`Rejection` (``no_feasible_state``) where no way of the vehicle leads it to them as reported.
    """
    strikes = tuple(_assumed(strike, settings) for strike in strikes_of(record))
    if not strikes:
        raise Rejection(Reason.NO_FEASIBLE_STATE, untold_strike(record) or "no strike of a person in the record")
    chained = any(each.vehicle is not strikes[0].vehicle for each in strikes)
    lead_s = settings.lead_time_s
    scene = build_scene(record, network, report, lead_time_s=lead_s + (_LONGEST_CHAIN_S if chained else 0.0))
    simulation = usual_simulation(network, record)
    crash = _Crash(scene, simulation, USUAL.time_limit_s, lead_s)
    orders = [strikes] if order_is_told(record) or not chained else [strikes, tuple(reversed(strikes))]
    found: list[Hypothesis] = []
    examined = 0
    for order in orders:
        plans = leaders_first(strike_plans(scene, order[0]), lambda plan: plan.group)
        examined += len(plans)
        kept = 0
        for plan in plans:
            hypothesis = _hypothesis(crash, plan, order[1:])
            if hypothesis is not None:
                found.append(hypothesis)
                kept += 1
            if kept == settings.max_hypotheses:
                break
    if not found:
        raise Rejection(Reason.NO_FEASIBLE_STATE, _why_not(scene, examined), measured=examined)
    found.sort(key=lambda each: (-each.score, each.name))
    unsure = ambiguity(found[0].score, (each.score for each in found))
    return StateEstimate(record.key, tuple(found), EstimatorRun(NAME, VERSION), unsure)


def _assumed(strike: Strike, settings: StateSettings) -> Strike:
    """The strike with what the settings say of an animal."""
    if not isinstance(strike.person, StruckAnimal):
        return strike
    animal = replace(strike.person, species=Species(settings.animal), pace=Pace(settings.animal_pace))
    return replace(strike, person=animal)


def _why_not(scene: Scene, examined: int) -> str:
    plans = f" in any of {counted(examined, 'plan')} examined" if examined else ""
    return scene.no_way_that(f"leads the vehicle to whom it struck as reported{plans}")


def _hypothesis(crash: _Crash, plan: StrikePlan, rest: Sequence[Strike]) -> Hypothesis | None:
    """The hypothesis of a plan of the first strike; None where no later vehicle gets to who lies there.

    A driver whom another one follows stops at the side, or else in the lane: wherever the other one gets past. Where it
    does not either way, the first that strikes as reported is kept: a verdict says what it lacks.
    """
    together = [strike for strike in rest if strike.vehicle is plan.strike.vehicle]
    later = [strike for strike in rest if strike.vehicle is not plan.strike.vehicle]
    pairs = {strike.pair for strike in (plan.strike, *rest)}
    found: Hypothesis | None = None
    for pulls_over in (True, False) if later else (False,):
        states = first_states(crash.scene, plan, together, crash.lead_s, pulls_over=pulls_over)
        for chain in _chains(crash, plan, states, later):
            everybody = [*states, *(later_state(crash.scene, each) for each in chain)]
            hypothesis = strike_hypothesis(plan, everybody, together, chain, crash.lead_s)
            if not all(check.passed for check in hypothesis.checks if check.name in ESSENTIAL):
                continue
            if not later:
                return hypothesis
            contacts = crash.simulated(everybody, lambda so_far: not _unreported(so_far, pairs)).contacts
            unreported = _unreported(contacts, pairs)
            if not unreported:
                return hypothesis
            found = found or hypothesis
            if any(map(_with_who_stood, unreported)):
                break  # who stood in the way is there later too
    return found


def _unreported(contacts: Sequence[Contact], pairs: set[tuple[int, int]]) -> list[Contact]:
    return [contact for contact in contacts if (contact.number_1, contact.number_2) not in pairs]


def _with_who_stood(contact: Contact) -> bool:
    return min(math.hypot(*contact.velocity_1_mps), math.hypot(*contact.velocity_2_mps)) <= STANDING_MPS


def _chains(
    crash: _Crash, plan: StrikePlan, states: Sequence[ParticipantState], later: Sequence[Strike]
) -> Iterator[list[LaterStrike]]:
    """The strikes after the first, each so much later than it could come at the earliest; none where no way of a
    vehicle leads there in time."""
    if not later:
        yield []
        return
    lies_at, at_rest_s = _comes_to_lie(crash, states, later[0].person.party)
    for wait_s in _LATER_S:
        chain: list[LaterStrike] = []
        everybody, at_s = list(states), at_rest_s + _SETTLES_S + wait_s
        for strike in later:
            if chain:
                lies_at, at_rest_s = _comes_to_lie(crash, everybody, strike.person.party)
                at_s = at_rest_s + _SETTLES_S
            found = next_way(crash.scene, strike, lies_at, plan.drive.pose.heading_rad, at_s)
            if found is None or at_s > crash.lead_s + _LONGEST_CHAIN_S:
                return
            chain.append(found)
            everybody.append(later_state(crash.scene, found))
        yield chain


def _comes_to_lie(crash: _Crash, states: Sequence[ParticipantState], number: int) -> tuple[FloatArray, float]:
    """Where those who take part so far leave a person (x, y, m), and since when it lies there (s)."""
    (person,) = (each for each in crash.simulated(states).vehicles if each.number == number)
    away_m = np.hypot(person.x_m - person.x_m[-1], person.y_m - person.y_m[-1])
    moving = np.flatnonzero(away_m > _RESTS_M)
    at_rest_s = float(person.time_s[moving[-1]]) if len(moving) else crash.lead_s
    return np.array([person.x_m[-1], person.y_m[-1]]), at_rest_s
