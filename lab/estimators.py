"""Estimators set side by side on one cohort: each estimates every mapped crash, is simulated and judged.

The flow's own artefacts stay as they are. The estimates of each lie at ``ROOT/estimators/<estimator>/<key>.json``,
one beside the other; the rows at ``ROOT/comparisons/estimators-<cohort>.json``, from where the warehouse takes them."""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from lab.estimator_rows import EstimateErrors, EstimatorAttempt, EstimatorRow, compare_estimators
from lab.truth.vehicles import SampleTruth, score_truth
from trace_dag.common.errors import DamagedFile, Failure, Rejection, UserError
from trace_dag.common.messages.progress import OnProgress
from trace_dag.common.plugins import PluginKind, list_plugins
from trace_dag.common.settings import StateSettings
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import StoredFile
from trace_dag.flow.artefacts import MAP_REPORT, RECORD, ROAD_MAP, XODR
from trace_dag.flow.batch import check_requirements
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.study_tables import ESTIMATORS, store_comparison
from trace_dag.flow.workspace import Workspace
from trace_dag.reconstruction.estimate import UnusableAnswers, estimator_factory
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate, estimate_to_json
from trace_dag.verdict.judge import judge

ESTIMATES_FOLDER = "estimators"

_NAME = re.compile(r"([\w-]*)(.*)", re.DOTALL)
_UNSAFE = re.compile(r"[^A-Za-z0-9_.-]+")


def settings_of(estimator: str, states: StateSettings) -> StateSettings:
    """Return the settings an estimator's name stands for: that of one that is installed, such as ``analytic`` or
    ``llm``.

    A name may go on with a variant: ``llm:PROMPT``, ``llm@MODEL``. Whatever the name does not say is taken from the
    settings. Raises :class:`UserError` for any other name.
    """
    name, variant = _NAME.fullmatch(estimator).groups()  # type: ignore[union-attr] # it matches anything
    if name not in list_plugins(PluginKind.ESTIMATOR):
        raise UserError(f"{estimator!r} is not an estimator; give {', '.join(list_plugins(PluginKind.ESTIMATOR))}")
    chosen = states.model_copy(update={"estimator": name})
    return estimator_factory(chosen).variant(chosen, variant) if variant else chosen


def usual_estimators(states: StateSettings) -> list[str]:
    """Return the default choice: the estimator of the settings, and all others that are installed."""
    return [states.estimator, *(name for name in list_plugins(PluginKind.ESTIMATOR) if name != states.estimator)]


def estimates_folder(estimator: str) -> str:
    """Return the folder of an estimator's estimates below the storage root."""
    safe = _UNSAFE.sub("_", estimator)
    # Names that differ only in what a file's name cannot hold must not share a folder.
    digest = "" if safe == estimator else "-" + hashlib.sha256(estimator.encode()).hexdigest()[:8]
    return f"{ESTIMATES_FOLDER}/{safe}{digest}"


@dataclass(frozen=True)
class _Task:
    """One crash and the estimators it is given to; travels to the workers."""

    crash: CrashFiles
    estimators: tuple[tuple[str, StateSettings], ...]
    truth: SampleTruth | None


def estimators_compared(
    workspace: Workspace,
    cohort: str,
    estimators: Sequence[str],
    *,
    truth: SampleTruth | None = None,
    listener: OnProgress | None = None,
) -> list[EstimatorRow]:
    """Estimate every mapped crash of a cohort with each estimator; the first is the reference of the others.

    Crashes run on the executor of the settings; budget and rate of language models hold over all of them together.
    ``truth`` adds the errors against it. ``listener`` receives how many crashes of how many are done. Stored for the
    warehouse.

    Raises :class:`UserError` for an estimator there is not, a model that cannot be asked, a cohort that is not
    registered, or one without a map.
    """
    named = {name: settings_of(name, workspace.settings.states) for name in estimators}
    if len(named) < 2:
        raise UserError("give at least two different estimators to compare, such as analytic,llm")
    run_id = f"compare-{uuid.uuid4().hex}"
    crashes = crash_files(workspace, workspace.registry.keys(cohort), run_id=run_id)
    mapped = [crash for crash in crashes if crash.has(ROAD_MAP)]
    if not mapped:
        raise UserError(f"no crash of cohort {cohort!r} has a road map yet; trace-dag run --cohort {cohort} makes them")
    for chosen in named.values():
        its_own = workspace.settings.model_copy(update={"states": chosen})
        check_requirements(replace(workspace, settings=its_own), [Stage.STATE_ESTIMATE], run_id)
    tasks = [_Task(crash, tuple(named.items()), truth) for crash in mapped]
    rows: dict[str, Sequence[EstimatorRow]] = {}
    files: list[StoredFile] = []
    if listener is not None:
        listener(0, len(tasks))
    with workspace.executing() as executor:
        for task, compared in run_redoing_lost(executor, _compare, tasks, lambda task: [task]):
            if isinstance(compared, Lost):
                raise Failure(f"{task.crash.key}: its worker died ({compared.detail})")
            rows[task.crash.key], made = compared
            files += made
            if listener is not None:
                listener(len(rows), len(tasks))
    found = [row for key in sorted(rows) for row in rows[key]]
    content = [{"cohort": cohort, **asdict(row)} for row in found]
    store_comparison(workspace.storage, ESTIMATORS, cohort, content, files)
    return found


def _compare(task: _Task) -> tuple[tuple[EstimatorRow, ...], list[StoredFile]]:
    """Return all estimators on one crash, and the files of their estimates."""
    files: list[StoredFile] = []
    attempts = {}
    for name, settings in task.estimators:
        try:
            attempts[name] = _attempt(task, name, settings, files)
        except DamagedFile as damaged:
            attempts[name] = EstimatorAttempt(None, detail=str(damaged), failed=True)
    return compare_estimators(task.crash.key, attempts, reference=task.estimators[0][0]), files


def _attempt(task: _Task, name: str, chosen: StateSettings, files: list[StoredFile]) -> EstimatorAttempt:
    """Return one estimator on one crash; its estimate joins the ``files``.

    Raises :class:`DamagedFile`.
    """
    crash, stored_as = task.crash, f"{estimates_folder(name)}/{task.crash.key}.json"
    record, network, report = crash.load(RECORD), crash.load(ROAD_MAP), crash.load(MAP_REPORT)
    try:
        made = crash.services.estimator(chosen).estimate(record, network, report)
    except UnusableAnswers as unusable:
        crash.storage.delete(stored_as)
        return EstimatorAttempt(None, unusable.run, unusable.detail)
    except Rejection as rejection:
        crash.storage.delete(stored_as)
        return EstimatorAttempt(None, detail=rejection.detail)
    except Failure as failure:
        return EstimatorAttempt(None, detail=str(failure), failed=True)
    files.append(crash.storage.write(stored_as, estimate_to_json(made)))
    settings = crash.settings
    xodr = crash.load(XODR)
    logs = simulate(EmbeddedBackend(settings.sim), network, xodr, made, settings.sim, record=record)
    verdict = judge(record, network, report, made, logs, settings.verdict)
    return EstimatorAttempt(
        made,
        made.run,
        accepted=verdict.accepted,
        reason=verdict.reason.value if verdict.reason else None,
        truth=_against(task.truth, made) if task.truth is not None else None,
    )


def _against(truth: SampleTruth, made: StateEstimate) -> EstimateErrors | None:
    """Return errors against the truth; None where the crash has none."""
    crash = truth.by_key.get(made.key)
    if crash is None:
        return None
    rows = score_truth(SampleTruth(crashes=(crash,)), {made.key: made}).rows
    if not rows or any(row.approach_correct is None for row in rows):
        return None
    return EstimateErrors(
        approach_correct=all(bool(row.approach_correct) for row in rows),
        lane_correct=all(bool(row.lane_correct) for row in rows),
        impact_point_error_m=max(row.impact_point_error_m or 0.0 for row in rows),
        heading_error_deg=max(row.heading_error_deg or 0.0 for row in rows),
        initial_position_error_m=max(row.initial_position_error_m or 0.0 for row in rows)
        if all(row.speed_reported for row in rows)
        else None,
    )
