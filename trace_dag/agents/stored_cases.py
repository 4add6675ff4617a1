"""Verified crashes and their variations as cases, on which agents are evaluated and from which variations are made."""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Protocol, TypeVar

from trace_dag.agents.evaluation.crash_parts import part_of
from trace_dag.agents.evaluation.splits import Split, splits_of
from trace_dag.agents.stored_variations import families, read_variation
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.stage import Stage
from trace_dag.crash.event_sequence import OFF_THE_ROAD, sequence_of
from trace_dag.flow.artefacts import ESTIMATE, RECORD, ROAD_MAP, SAMPLED, VERDICT, XODR, CrashArtefacts
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import FinalState, status_of_valid
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.records import OnProblem, log_problem, raise_problem
from trace_dag.flow.selection import select_registered
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.workspace import Workspace
from trace_dag.scenario.cases import Case
from trace_dag.scenario.lights import crash_lights

if TYPE_CHECKING:
    from trace_dag.common.settings import SimSettings
    from trace_dag.simulation.states import Hypothesis
    from trace_dag.simulation.types import SimulationLog

_PART_OF_A_CRASH = re.compile(r"(?P<key>.+)-(?P<letter>[cv])\d+")  # 2023-319003-c02, 2023-319003-v001


class AgentRole(StrEnum):
    """The place that an agent takes among the two that collided first."""

    FIRST = "first"  # by their numbers in the report
    SECOND = "second"
    STRIKING = "striking"  # the one that closes in faster at the contact
    STRUCK = "struck"


@dataclass(frozen=True)
class StoredCase:
    """The origin of a case: a verified crash, its variation named ``variation``, or a likely course of it.

    A likely course is the draw ``sample`` of the crash's estimate, with a weight among all courses.
    """

    files: CrashFiles
    variation: str | None = None
    sample: int | None = None
    weight: float = 1.0

    @property
    def key(self) -> str:
        """Return the crash's key."""
        return self.files.key

    @property
    def case_id(self) -> str:
        """Return the id: the crash's key, the variation's id, or for a course the key and the number of the draw."""
        if self.sample is not None:
            return f"{self.key}-c{self.sample:02d}"
        return self.variation or self.key

    @property
    def fingerprint(self) -> str:
        """Return the fingerprint of the verdict that the case rests on."""
        return self.files.records[Stage.VERDICT].fingerprint


def load_case(stored: StoredCase) -> Case:
    """Return a stored case, ready for evaluation."""
    files = stored.files.unread()
    if stored.sample is not None:
        return _drawn_case(stored.case_id, files, stored.sample)
    if stored.variation is None:
        return case_of(files, files.settings.sim)
    varied = read_variation(files.storage, stored.variation)
    return _case(stored.case_id, files, varied.estimate.best, varied.log, varied.about.friction)


def case_of(crash: CrashArtefacts, settings: SimSettings) -> Case:
    """Return a verified crash, stored in a root or in a package, as a case for evaluation."""
    from trace_dag.simulation.run import surface_friction

    hypothesis = crash.load(ESTIMATE).hypotheses[crash.load(VERDICT).hypothesis]
    log = crash.shown_log()
    assert log is not None, "a crash with a verdict was simulated"
    return _case(crash.key, crash, hypothesis, log, surface_friction(settings, crash.load(RECORD)))


def _drawn_case(case_id: str, files: CrashFiles, sample: int) -> Case:
    """Return a likely course, simulated, so that the contact that an agent has to avoid is known."""
    from trace_dag.scenario.driving_files import draw_course
    from trace_dag.simulation.run import backend

    crash = case_of(files, files.settings.sim)
    course = draw_course(files.load(ESTIMATE), sample)
    case = replace(
        crash,
        case_id=case_id,
        participants=course.participants,
        objects=course.objects,
        impact_time_s=course.impact_time_s,
        friction=crash.friction * course.friction,
    )
    simulation = backend(files.settings.sim).load(case.network, case.xodr, friction=case.friction)
    return replace(case, recorded=simulation.run(case.going_on, time_limit_s=case.end_s, objects=case.objects))


def _case(case_id: str, crash: CrashArtefacts, hypothesis: Hypothesis, log: SimulationLog, friction: float) -> Case:
    from trace_dag.simulation.run import participants

    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    return Case(
        case_id=case_id,
        key=crash.key,
        network=network,
        xodr=crash.load(XODR),
        friction=friction,
        participants=participants(hypothesis),
        impact_time_s=hypothesis.impact_time_s,
        recorded=log,
        parked=frozenset(each.number for each in record.vehicles if not each.in_transport),
        departed=None if somebody_met(crash) else hypothesis.participants[0].vehicle_number,
        objects=hypothesis.objects,
        parts={each.number: part for each in record.vehicles if (part := part_of(record, each.number)) is not None},
        lights=next(iter(crash_lights(record, network, log)), None),
    )


def somebody_met(crash: CrashArtefacts) -> bool:
    """Return whether two parties met in a crash; a vehicle that left the road by itself met nobody."""
    return sequence_of(crash.load(RECORD)).first.kind not in OFF_THE_ROAD


def number_of(case: Case, role: AgentRole) -> int:
    """Return the number of the vehicle in a role of the recorded crash.

    In a near miss the first vehicle is the striking one. If one of the two is a person or parked, it has no driver to
    replace, and every role means the other. A vehicle that left the road by itself has every role, too.
    """
    first, second = case.pair
    if case.departed is not None:
        return case.departed
    if case.recorded.bodies[second].is_figure or second in case.parked:
        return first
    if first in case.parked:
        return second
    if role is AgentRole.FIRST:
        return first
    if role is AgentRole.SECOND:
        return second
    if role is AgentRole.STRIKING:
        return case.striking
    return second if case.striking == first else first


def verified_cases(
    workspace: Workspace,
    cohort: str | None,
    only: Collection[str],
    *,
    split: Split | None = None,
    departures: bool | None = False,
    on_problem: OnProblem = log_problem,
) -> list[StoredCase]:
    """Return the verified crashes among those asked for that have a contact between parties or a departure.

    ``departures`` chooses crashes in which a vehicle left the road by itself; None takes both. ``split`` takes one part
    of them, as in a release of the same crashes. ``on_problem`` is called for damaged records, whose verdict is
    unknown. Raises :class:`UserError` if none is left.
    """
    keys = select_registered(workspace, cohort, only)
    cases = [
        StoredCase(files)
        for files in crash_files(workspace, keys, on_problem=on_problem)
        if status_of_valid(files.key, files.records).final_state is FinalState.VERIFIED
    ]
    if not cases:
        raise UserError(f"no crash of the {len(keys)} asked for is verified; trace-dag status shows their state")
    if split is not None:
        records = {case.key: case.files.unread().load(RECORD) for case in cases}
        parts = splits_of({key: (record.latitude_deg, record.longitude_deg) for key, record in records.items()})
        cases = [case for case in cases if parts[case.key] is split]
        if not cases:
            raise UserError(f"none of the {len(parts)} verified crashes is in the part {split}")
    chosen = [case for case in cases if departures is None or somebody_met(case.files) is not departures]
    if not chosen and departures:
        raise UserError(
            f"none of the {len(cases)} verified crashes is of a vehicle that left the road without meeting a party"
        )
    if not chosen:
        raise UserError(
            f"none of the {len(cases)} verified crashes is between parties, so that an agent has nothing to react to; "
            "evaluate --departures evaluates vehicles that left the road by themselves"
        )
    return chosen


def likely_courses(cases: Sequence[StoredCase]) -> list[StoredCase]:
    """Return the likely courses of some crashes, the heaviest of each crash first.

    Raises :class:`UserError` if there are none.
    """
    from trace_dag.scenario.driving_files import likely_draws

    found = [
        replace(case, sample=sample, weight=weight)
        for case in cases
        if (files := case.files.unread()).has(SAMPLED)
        for sample, weight in likely_draws(files.load(SAMPLED))
    ]
    if not found:
        raise UserError(
            f"of {count_of(len(cases), 'crash', 'crashes')} asked for, no draw agrees with the report; "
            "the setting samples says how many are made"
        )
    return found


def stored_case(workspace: Workspace, case_id: str) -> StoredCase:
    """Return a verified crash, or one of its variations or likely courses, by its case id.

    Raises :class:`UserError` for an unknown id.
    """
    part = _PART_OF_A_CRASH.fullmatch(case_id)
    (crash,) = verified_cases(workspace, None, [part["key"] if part else case_id], departures=None)
    if part is None:
        return crash
    there = likely_courses([crash]) if part["letter"] == "c" else stored_variations(workspace, [crash])
    found = next((each for each in there if each.case_id == case_id), None)
    if found is None:
        raise UserError(f"{case_id} is not among {', '.join(each.case_id for each in there)}")
    return found


def stored_variations(
    workspace: Workspace, cases: Sequence[StoredCase], *, on_problem: OnProblem = raise_problem
) -> list[StoredCase]:
    """Return the stored variations of some crashes, without those made from an earlier verdict.

    ``on_problem`` is called for damaged families. Raises :class:`UserError` if there are no variations.
    """
    of_crash = {case.key: case for case in cases}
    found = [
        replace(of_crash[key], variation=each["variation_id"])
        for key, rows in families(workspace.storage, on_problem, of_crash).items()
        for each in rows
        if each["verdict_fingerprint"] == of_crash[key].fingerprint
    ]
    if not found:
        raise UserError(
            f"of {count_of(len(cases), 'crash', 'crashes')} have no stored variation; trace-dag vary makes them"
        )
    return found


# --- work by crash ---------------------------------------------------------------------------------------------------
class Report(Protocol):
    """A report of one crash: its key, and the error if it broke, else ""."""

    def __init__(self, key: str, *, error: str = "") -> None: ...

    @property
    def key(self) -> str: ...

    @property
    def error(self) -> str: ...


Reported = TypeVar("Reported", bound=Report)


def report_each(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    make: Callable[[StoredCase], Reported],
    report: type[Reported],
    on_progress: Callable[[Reported], None],
) -> list[Reported]:
    """Return the reports that ``make`` gives for the crashes, in order.

    ``on_progress`` is called with each finished report.
    """
    reports: dict[str, Reported] = {}
    with workspace.executing() as executor:
        for case, found in run_redoing_lost(executor, partial(_report, make, report), cases, lambda case: [case]):
            made = report(case.key, error=found.detail) if isinstance(found, Lost) else found
            reports[case.key] = made
            on_progress(made)
    return [reports[case.key] for case in cases]


def _report(make: Callable[[StoredCase], Reported], report: type[Reported], case: StoredCase) -> Reported:
    try:
        return make(case)
    except Failure as failure:
        return report(case.key, error=str(failure))
    except Exception as error:
        # One crash without a result keeps no other from having one.
        return report(case.key, error="".join(traceback.format_exception(error)))
