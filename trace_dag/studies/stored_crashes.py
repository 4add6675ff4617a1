"""Crashes as they are stored, for whoever asks something of many of them.

Belongs here: which crashes, and reading them. What is read of a crash is its
:class:`~trace_dag.flow.contract.CrashFiles`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trace_dag.cohorts.registry import CrashSource
from trace_dag.errors import Failure
from trace_dag.flow.artefacts import ESTIMATE, LOGS, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.ledgers import Complaint, raised
from trace_dag.flow.records import Records, log_complaint, read_records
from trace_dag.flow.standing import valid_records
from trace_dag.flow.workspace import Workspace
from trace_dag.progress import Progress, silent
from trace_dag.verdict.controls import JudgedCrash

_SEED = 1


@dataclass(frozen=True, eq=False)
class StoredCrash:
    """A crash that reached a verdict: its files, and the hypothesis the verdict is about."""

    files: CrashFiles
    judged: JudgedCrash
    accepted: bool


def stored_crash(workspace: Workspace, key: str) -> CrashFiles:
    """One crash's artefacts; :class:`UserError` for a key that is not registered."""
    source = workspace.registry.sources([key])[key]
    return _files(workspace, source, read_records(workspace.storage, [key])[key], key)


def crash_files(
    workspace: Workspace, keys: Collection[str], *, complain: Complaint = log_complaint
) -> Iterator[CrashFiles]:
    """The artefacts of some registered crashes, in their order; ``complain`` hears of records that are damaged."""
    sources, records = workspace.registry.sources(keys), read_records(workspace.storage, keys, complain=complain)
    return (_files(workspace, sources[key], records[key], key) for key in keys)


def _files(workspace: Workspace, source: CrashSource, records: Records, key: str) -> CrashFiles:
    files = CrashFiles(key, source, workspace.settings, workspace.storage)
    for record in valid_records(records).values():
        files.accept(record)
    return files


def judged_crashes(
    workspace: Workspace,
    keys: Collection[str],
    *,
    most: int | None = None,
    tell: Progress = silent,
    complain: Complaint = raised,
) -> list[StoredCrash]:
    """Those of some crashes that have a verdict on a simulation; of more than ``most``, so many drawn at random.

    The same crashes give the same draw. ``tell`` hears how many of how many have been read, ``complain`` of those left
    out because something stored of them is damaged.
    """
    judged = [each for each in crash_files(workspace, keys, complain=complain) if each.has(VERDICT)]
    if most is not None:
        judged = drawn(judged, most, _SEED)
    found = []
    for done, each in enumerate(judged, 1):
        tell(done, len(judged))
        try:
            found.append(read_judged(each))
        except Failure as failure:
            complain(failure)
    return found


def read_judged(files: CrashFiles) -> StoredCrash:
    """A crash that reached a verdict, read."""
    verdict = files.load(VERDICT)
    crash = JudgedCrash(
        files.load(RECORD),
        files.load(ROAD_MAP),
        files.load(ESTIMATE).hypotheses[verdict.hypothesis],
        files.load(LOGS)[verdict.hypothesis],
    )
    return StoredCrash(files, crash, verdict.accepted)


def drawn(crashes: Sequence[CrashFiles], most: int, seed: int) -> list[CrashFiles]:
    """All crashes, or ``most`` of them drawn at random, in their order."""
    if len(crashes) <= most:
        return list(crashes)
    chosen = np.random.default_rng(seed).choice(len(crashes), most, replace=False)
    return [crashes[index] for index in sorted(chosen)]
