"""Negative controls of a cohort.

Its verdicts against other crashes' reports, and with one party late, mirrored or moved.
"""

from __future__ import annotations

from dataclasses import replace

from trace_dag.common.errors import UserError
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.flow.records import OnProblem, raise_problem
from trace_dag.flow.stored_crashes import judged_crashes
from trace_dag.flow.study_tables import CONTROLS, store
from trace_dag.flow.workspace import Workspace
from trace_dag.verdict.changed_plans import changed_estimate, changed_row, make_changed_plans
from trace_dag.verdict.controls import ControlRow, changed_reports, true_pairing


def negative_controls(
    workspace: Workspace,
    cohort: str,
    *,
    most: int,
    on_progress: OnProgress = silent,
    on_problem: OnProblem = raise_problem,
) -> list[ControlRow]:
    """Judge the controls of a cohort, store them for the warehouse, and return them.

    Every judged crash is compared with its own report, and every verified one with all other reports of its kind.
    Verified crashes are also run with one vehicle or the person late, or with the person from the other side; a
    departure from the road is run with the side mirrored and the object moved.

    The number of comparisons grows with the square of the cohort, so at most ``most`` verdicts, drawn at random, are
    used. ``on_progress`` receives the numbers done and in total, first for reading and then for judging; ``on_problem``
    is called for omitted crashes.

    Raises :class:`UserError` for a cohort that is not registered or has no verdicts yet.
    """
    from trace_dag.simulation.embedded import EmbeddedBackend
    from trace_dag.simulation.run import simulate

    crashes = judged_crashes(
        workspace, workspace.registry.keys(cohort), most=most, on_progress=on_progress, on_problem=on_problem
    )
    if not crashes:
        raise UserError(f"no crash of cohort {cohort!r} has a verdict yet; trace-dag run --cohort {cohort} makes them")
    settings = workspace.settings
    kinds = {crash.judged.record.key: crash.judged.record.kind.value for crash in crashes}
    rows = [true_pairing(crash.judged, settings.verdict) for crash in crashes]
    verified = [crash.judged for crash in crashes if crash.verified]
    backend = EmbeddedBackend(settings.sim)

    for done, crash in enumerate(verified, 1):
        rows += changed_reports(crash, verified, settings.verdict)
        for name, changed in make_changed_plans(crash, settings.verdict):
            log = None
            if changed is not None:
                states = changed_estimate(crash, changed)
                (log,) = simulate(backend, crash.network, b"", states, settings.sim, record=crash.record)
            rows.append(changed_row(crash, name, changed, log, settings.verdict))
        on_progress(done, len(verified))
    rows = [replace(row, crash_kind=kinds[row.key]) for row in rows]
    store(workspace, CONTROLS, cohort, rows)
    return rows
