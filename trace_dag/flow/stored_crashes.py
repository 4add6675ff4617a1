"""Reading many stored crashes, for the studies.

Belongs here: choosing crashes, and reading them. The stored parts of a crash are its
:class:`~trace_dag.flow.contract.CrashFiles`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.flow.artefacts import ESTIMATE, LOGS, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import valid_records
from trace_dag.flow.records import OnProblem, log_problem, raise_problem, read_records
from trace_dag.flow.workspace import Workspace
from trace_dag.verdict.controls import JudgedCrash

_SEED = 1


Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class StoredCrash:
    """A crash that reached a verdict: its files, and the judged hypothesis."""

    files: CrashFiles
    judged: JudgedCrash
    verified: bool


def cohorts_of(workspace: Workspace, cohort: str | None) -> list[str]:
    """Return the named cohort, or all.

    Raises :class:`UserError` if it is not registered, or if there is none.
    """
    if cohort is not None:
        return [workspace.registry.cohort(cohort).name]
    names = list(workspace.registry.cohorts())
    if not names:
        raise UserError(f"no crash is registered in {workspace.root}; see trace-dag ingest")
    return names


def study_each(cohorts: Iterable[str], study: Callable[[str], Found]) -> dict[str, Found]:
    """Return a study's results by cohort, without cohorts that it does not apply to.

    If there is no result, raises the last cohort's :class:`UserError`.
    """
    found: dict[str, Found] = {}
    nothing: UserError | None = None
    for name in cohorts:
        try:
            found[name] = study(name)
        except UserError as error:
            nothing = error
    if nothing is not None and not found:
        raise nothing
    return found


def stored_crash(workspace: Workspace, key: str) -> CrashFiles:
    """Return one crash's artefacts.

    Raises :class:`UserError` for a key that is not registered.
    """
    return next(crash_files(workspace, [key]))


def crash_files(
    workspace: Workspace, keys: Collection[str], *, run_id: str = "", on_problem: OnProblem = log_problem
) -> Iterator[CrashFiles]:
    """Return the artefacts of some registered crashes, in their order.

    ``on_problem`` is called with records that are damaged.

    ``run_id`` is the run that will work on them. Raises :class:`UserError` for a key that is not registered.
    """
    settings, storage = workspace.settings, workspace.storage
    sources, records = workspace.registry.sources(keys), read_records(storage, keys, on_problem=on_problem)
    return (
        CrashFiles.recorded(key, sources[key], settings, storage, valid_records(records[key]), run_id=run_id)
        for key in keys
    )


def judged_crashes(
    workspace: Workspace,
    keys: Collection[str],
    *,
    most: int | None = None,
    on_progress: OnProgress = silent,
    on_problem: OnProblem = raise_problem,
) -> list[StoredCrash]:
    """Return crashes with a verdict on a simulation; if more than ``most``, that many drawn at random.

    The same crashes give the same draw. ``on_progress`` receives the numbers read and in total, ``on_problem`` the
    errors of crashes left out because of damaged files.
    """
    judged = [each for each in crash_files(workspace, keys, on_problem=on_problem) if each.has(VERDICT)]
    if most is not None:
        judged = draw_sample(judged, most, _SEED)
    found = []
    for done, each in enumerate(judged, 1):
        on_progress(done, len(judged))
        try:
            found.append(read_judged(each))
        except Failure as failure:
            on_problem(failure)
    return found


def read_judged(files: CrashFiles) -> StoredCrash:
    """Return a crash that reached a verdict, read."""
    verdict = files.load(VERDICT)
    crash = JudgedCrash(
        files.load(RECORD),
        files.load(ROAD_MAP),
        files.load(ESTIMATE).hypotheses[verdict.hypothesis],
        files.load(LOGS)[verdict.hypothesis],
    )
    return StoredCrash(files, crash, verdict.verified)


def draw_sample(crashes: Sequence[CrashFiles], most: int, seed: int) -> list[CrashFiles]:
    """Return all crashes, or ``most`` of them drawn at random, in their order."""
    if len(crashes) <= most:
        return list(crashes)
    chosen = np.random.default_rng(seed).choice(len(crashes), most, replace=False)
    return [crashes[index] for index in sorted(chosen)]
