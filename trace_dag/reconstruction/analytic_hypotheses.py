"""The analytic estimator: it tries every reading of the record with every pair of paths and ranks them by the evidence.

Deterministic, no network, no key.
"""

from __future__ import annotations

from collections.abc import Hashable

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import StateSettings
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.assemble import hypothesis_of
from trace_dag.reconstruction.candidates import Candidate, candidates
from trace_dag.reconstruction.checks import ESSENTIAL
from trace_dag.reconstruction.motion.solver import Solution, solve
from trace_dag.reconstruction.pre_crash_scenarios import Party, PreCrashScenario, party, pre_crash_scenarios
from trace_dag.reconstruction.ranking import ambiguity, first_of_groups, leaders_first, move_to_front
from trace_dag.reconstruction.scene.approach_finder import ApproachFinder
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import Hypothesis

NAME = "analytic"
VERSION = "3"

MAX_SOLVED = 24  # candidates whose contact is solved for, by prior
PRIOR_REACH = 6.0  # log-likelihood below the best prior at which a candidate is not worth solving
ASSEMBLED = 4  # times the hypotheses kept
_FASTEST_MPS = 75.0
_MARGIN_M = 40.0


def build_scene(record: CrashRecord, network: RoadNetwork, report: MapReport, *, lead_time_s: float) -> Scene:
    """Return the scene with approaches past the crash that are long enough for the fastest vehicle of the record."""
    placement = report.placement
    speeds = [vehicle.travel_speed_mps or vehicle.speed_limit_mps or 30.0 for vehicle in record.vehicles]
    reach = min(max([*speeds, 25.0]) * 1.3, _FASTEST_MPS) * lead_time_s + _MARGIN_M
    finder = ApproachFinder(network, placement.x_m, placement.y_m, placement.z_m, back_m=reach, ahead_m=_MARGIN_M * 2)
    return Scene(record, network, placement, finder, finder.approaches(placement.junction_id), report.things)


def parties(record: CrashRecord, event: CrashEvent) -> tuple[Party, Party]:
    """Return the two vehicles of a contact.

    >>> both = parties(record, sequence.first)
    >>> {each.vehicle.number: each.turn and each.turn.value for each in both}  # crash types 69 and 68
    {2: None, 1: 'left'}
    """
    one, two = event.vehicles
    return party(record, one), party(record, two)


def first_contact(scene: Scene, event: CrashEvent, settings: StateSettings) -> tuple[tuple[Hypothesis, ...], float]:
    """Return the ranked hypotheses of a contact of two vehicles in transport, and the doubt of the best.

    The doubt is the posterior share of all the others.

    Raises :class:`Rejection` (``no_feasible_state``) if the vehicles meet in no reading of the record.

    >>> scene = build_scene(record, network, map_report, lead_time_s=5.0)
    >>> (best, *_), _ = first_contact(scene, sequence.first, StateSettings())
    >>> [state.manoeuvre.value for state in best.participants]
    ['turn_left', 'straight']
    """
    readings = pre_crash_scenarios(scene.record, *parties(scene.record, event))
    found = [candidate for reading in readings for candidate in candidates(scene, reading)]
    hypotheses, unsure = rank_hypotheses(scene, solve_all(scene, found), settings)
    if not hypotheses:
        raise Rejection(Reason.NO_FEASIBLE_STATE, _why_not(scene, readings, found), measured=len(found))
    return hypotheses, unsure


def solve_all(scene: Scene, found: list[Candidate]) -> list[Solution]:
    """Return solutions of the likeliest candidates, best first.

    >>> reading = pre_crash_scenarios(record, *parties(record, sequence.first))[0]
    >>> best = solve_all(scene, candidates(scene, reading))[0]
    >>> best.candidate.scenario.mover.vehicle.number  # vehicle 1 turns across the other
    1
    """
    if not found:
        return []
    order = sorted(range(len(found)), key=lambda index: (-round(found[index].log_prior, 6), index))
    best = found[order[0]].log_prior
    likely = [found[i] for i in order if found[i].log_prior >= best - PRIOR_REACH]
    worth = move_to_front(likely, first_of_groups(likely, _sides))[:MAX_SOLVED]
    solved = [solution for each in worth if (solution := solve(each, scene.record, *scene.place_xy_m)) is not None]
    return sorted(solved, key=lambda solution: (-solution.score, solution.name))


def rank_hypotheses(
    scene: Scene, solutions: list[Solution], settings: StateSettings
) -> tuple[tuple[Hypothesis, ...], float]:
    """Return the hypotheses to keep, those that pass every check first, and the posterior share of all but the best.

    ``solutions`` come from :func:`solve_all`, best first.

    Hypotheses from the same sides, with the same roles, differ only in detail. The best of each such group comes first,
    then all the others.

    >>> rank_hypotheses(scene, [], StateSettings())  # nothing to keep
    ((), 0.0)
    """

    def from_sides(solution: Solution) -> Hashable:
        return _sides(solution.candidate)

    leaders = first_of_groups(solutions, from_sides)
    chosen = leaders_first(solutions, from_sides)[: ASSEMBLED * settings.max_hypotheses]
    chosen += [
        leader for leader in leaders if leader not in chosen
    ]  # an unlikely one may be the only one without fault
    kept: list[tuple[int, int, Solution, Hypothesis]] = []
    flawless = 0
    for solution in chosen:
        built = hypothesis_of(solution, scene.network, lead_time_s=settings.lead_time_s)
        failed = {each.name for each in built.checks if not each.passed}
        if not failed & ESSENTIAL:
            kept.append((len(failed), len(kept), solution, built))
            flawless += not failed
        if flawless == settings.max_hypotheses:  # the first of each group stay in front
            break
    kept.sort(key=lambda each: each[:2])
    if not kept:
        return (), 0.0
    unsure = ambiguity(kept[0][2].score, (leader.score for leader in leaders))
    return tuple(each[3] for each in kept[: settings.max_hypotheses]), unsure


def _sides(candidate: Candidate) -> tuple[str, int, int, int]:
    scenario = candidate.scenario
    sides = candidate.mover.approach.side, candidate.other.approach.side
    return (scenario.relation, scenario.mover.vehicle.number, *sides)


def _why_not(scene: Scene, readings: tuple[PreCrashScenario, ...], found: list[Candidate]) -> str:
    relations = ", ".join(dict.fromkeys(reading.relation.value for reading in readings))
    if not found:
        return scene.no_way_that(f"lets the vehicles meet as reported ({relations})")
    examined = count_of(len(found), "pair of paths", "pairs of paths")
    return f"{examined} examined ({relations}), in none do the bodies touch near the crash"
