"""Verified crashes with one detail of their reports changed: does the verdict notice?

Draws the crashes, hands their changes to the workers and stores the rows at
``ROOT/comparisons/perturbed-<cohort>.json``, from where the warehouse takes them. Does not belong here: what the
changes are (:mod:`lab.changed_reports`), and how one becomes a row (:mod:`lab.changed_reports.rows`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from lab.changed_reports.kinds import KINDS, PERTURBED, Needs, PerturbationKind, begins_with
from lab.changed_reports.rows import FARTHEST_M, Change, PerturbedRow, PerturbTask, draw_stream, perturb_all
from trace_dag.common.errors import DamagedFile, Failure, Rejection, UserError
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.settings import StateSettings
from trace_dag.crash.keys import FARS
from trace_dag.flow.artefacts import EXTRACT, RECORD, VERDICT
from trace_dag.flow.batch import work_of
from trace_dag.flow.cohorts.registry import RegisteredMap
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import FinalState
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.records import OnProblem, raise_problem
from trace_dag.flow.stages.osm_extract import catalog_of
from trace_dag.flow.stored_crashes import crash_files, draw_sample
from trace_dag.flow.study_tables import PERTURBED as PERTURBED_TABLE
from trace_dag.flow.study_tables import store
from trace_dag.flow.workspace import Workspace
from trace_dag.osm.types import Site
from trace_dag.osm.xml import write_osm
from trace_dag.reconstruction.estimate import estimator_factory

MOST = 12
"""Crashes of a cohort that are perturbed unless more are asked for: some minutes of work."""
_MARGIN_M = 50.0
_TOGETHER = 8  # changes of one crash that a worker is given at a time


@dataclass(frozen=True)
class Request:
    """A request for changes: number of crashes, kinds (all if empty; wildcards allowed), and draws of drawn changes."""

    most: int = MOST
    only: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    draws: int = 1
    seed: int = 1

    def chosen(self) -> list[PerturbationKind]:
        """Return the kinds asked for.

        Raises :class:`UserError` for an unknown name.
        """
        for name in self.kinds:
            if not any(fnmatchcase(kind, name) for kind in KINDS):
                raise UserError(f"{name!r} is not a perturbation; there are {', '.join(KINDS)}")
        return [
            kind
            for name, kind in KINDS.items()
            if not self.kinds or any(fnmatchcase(name, pattern) for pattern in self.kinds)
        ]


def perturbed_controls(
    workspace: Workspace,
    cohort: str,
    request: Request,
    *,
    on_progress: OnProgress = silent,
    on_problem: OnProblem = raise_problem,
) -> list[PerturbedRow]:
    """Return the verified crashes of a cohort, drawn at random, each with its report changed in every way that applies
    to it.

    Collisions of two vehicles and crashes with people are drawn each for themselves. The same request on the same root
    gives the same rows, whatever the number of workers. ``on_progress`` receives how many changed reports of how many
    are through, ``on_problem`` of crashes left out because something stored of them is damaged. Stored for the
    warehouse, in place of the cohort's rows before.

    Raises :class:`UserError` for a kind or crash there is not, a cohort without a verified crash, or an estimator that
    would have to be paid for every changed report.
    """
    kinds = request.chosen()
    if estimator_factory(workspace.settings.states).paid:
        raise UserError(
            f"the estimator of the settings, {workspace.settings.states.estimator}, would have to be paid for every "
            f"changed report; set TRACE_DAG_STATES__ESTIMATOR={StateSettings().estimator}"
        )
    keys = workspace.registry.keys(cohort)
    unknown = [key for key in request.only if key not in keys]
    if unknown:
        raise UserError(f"{unknown[0]} is not a crash of cohort {cohort!r}")
    verified = []
    for each in crash_files(workspace, keys, on_problem=on_problem):
        try:
            each.check()
            verified += [each] if _is_verified(each) else []
        except DamagedFile as damaged:
            on_problem(damaged)
    if not any(not request.only or each.key in request.only for each in verified):
        asked = f"of {', '.join(request.only)} none is verified" if request.only else "no crash is verified yet"
        raise UserError(f"cohort {cohort!r}: {asked}; only verified crashes are perturbed")
    tasks: list[PerturbTask] = []
    for begins in sorted(PERTURBED):
        alike = [each for each in verified if begins_with(each.load(RECORD)) is begins]
        asked_for = [each for each in alike if not request.only or each.key in request.only]
        crashes = draw_sample(asked_for, request.most, request.seed)
        tasks += _tasks(workspace, crashes, alike, [kind for kind in kinds if begins in kind.of], request)
    rows = _run(workspace, tasks, on_progress)
    store(workspace, PERTURBED_TABLE, cohort, rows)
    return rows


def _is_verified(crash: CrashFiles) -> bool:
    """Return whether the crash is verified, of a kind whose reports are changed here, and reported in FARS' own
    words."""
    if not crash.has(VERDICT) or crash.load(RECORD).register != FARS:
        return False
    return crash.load(VERDICT).verified and begins_with(crash.load(RECORD)) in PERTURBED


def _tasks(
    workspace: Workspace,
    crashes: Sequence[CrashFiles],
    verified: Sequence[CrashFiles],
    kinds: Sequence[PerturbationKind],
    request: Request,
) -> Iterator[PerturbTask]:
    work = work_of(workspace, "perturbed")
    elsewhere = any(kind.moves or kind.needs is not Needs.NOTHING for kind in kinds)
    around = _maps_around(crashes) if elsewhere else {}
    by_key = {crash.key: crash for crash in verified}
    for crash in crashes:
        others = [key for key in by_key if key != crash.key]
        changes = []
        for kind in kinds:
            for draw in range(request.draws if kind.drawn else 1):
                other = None
                if kind.needs is Needs.OTHER_REPORT:
                    if not others:
                        continue
                    # Not from the change's own stream: a change of what it draws leaves the reports what they were.
                    other = by_key[
                        others[int(draw_stream(request.seed, crash.key, "other report", draw).integers(len(others)))]
                    ]
                changes.append(Change(kind.name, draw, other))
        for start in range(0, len(changes), _TOGETHER):
            together = tuple(changes[start : start + _TOGETHER])
            far = any(KINDS[change.kind].moves or change.other is not None for change in together)
            map_around = around[crash.key] if far else b""
            yield PerturbTask(by_key[crash.key], work, together, request.seed, map_around)


def _maps_around(crashes: Sequence[CrashFiles]) -> dict[str, bytes]:
    """Return the map as far around each crash as any report is set down, in one pass over each map file.

    If no file covers the crash (its map came from a service) its own extract."""
    found: dict[str, bytes] = {}
    by_maps: dict[tuple[RegisteredMap, ...], list[CrashFiles]] = {}
    for crash in crashes:
        by_maps.setdefault(crash.source.maps, []).append(crash)
    for maps, together in by_maps.items():
        records = {crash.key: crash.load(RECORD) for crash in together}
        sites = [Site(key, record.latitude_deg, record.longitude_deg) for key, record in records.items()]
        osm = together[0].settings.osm
        wide = osm.model_copy(update={"radius_m": FARTHEST_M + _MARGIN_M + osm.radius_m})
        extracts = catalog_of(maps, together[0].services).extract(sites, wide)
        for crash in together:
            extract = extracts[crash.key]
            if isinstance(extract, Rejection | Failure):
                extract = crash.load(EXTRACT)
            found[crash.key] = write_osm(extract)
    return found


def _run(workspace: Workspace, tasks: Sequence[PerturbTask], on_progress: OnProgress) -> list[PerturbedRow]:
    total, done = sum(len(task.changes) for task in tasks), 0
    rows: list[PerturbedRow] = []
    on_progress(0, total)
    with workspace.executing() as executor:
        for task, found in run_redoing_lost(executor, perturb_all, tasks, PerturbTask.split):
            if isinstance(found, Lost):
                change = task.changes[0]
                lost = PerturbedRow(task.crash.key, change.kind, change.draw, task.seed, final_state=FinalState.FAILED)
                found = (replace(lost, outcome_detail=f"its worker died ({found.detail})"),)
            rows += found
            done += len(task.changes)
            on_progress(done, total)
    order = {name: index for index, name in enumerate(KINDS)}
    return sorted(rows, key=lambda row: (row.key, order[row.perturbation], row.draw))
