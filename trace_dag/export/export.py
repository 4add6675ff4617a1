"""Verified crashes written out for use elsewhere, by an exporter (:mod:`trace_dag.export.formats`).

One crash at a time, whatever their number; files that are already there unchanged are kept, so an interrupted export
resumes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.storage.files import Storage
from trace_dag.crash.keys import parse_key
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import crash_status
from trace_dag.flow.records import OnProblem, log_problem, raise_problem, read_records
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.workspace import Workspace

_AT_A_TIME = 200  # crashes whose records are read together


def accepted_keys(
    workspace: Workspace, cohort: str | None = None, only: Sequence[str] = (), *, on_problem: OnProblem = log_problem
) -> list[str]:
    """Return the keys of accepted crashes, of a cohort or among those named, in order.

    Accepted are ``verified`` and ``first_event_only``. ``on_problem`` is called for damaged records, whose crash may
    have been accepted. Raises :class:`UserError` if no crash is left, or if a named one is no key or not accepted.
    """
    for key in only:
        parse_key(key)  # a path would lead elsewhere
    asked = list(only) or list(workspace.registry.keys(cohort))
    found = [
        key
        for start in range(0, len(asked), _AT_A_TIME)
        for key, records in read_records(
            workspace.storage, asked[start : start + _AT_A_TIME], on_problem=on_problem
        ).items()
        if crash_status(key, records).final_state.accepted
    ]
    missing = sorted(set(only) - set(found))
    if missing:
        raise UserError(f"{', '.join(missing)}: not accepted; trace-dag status shows its state")
    if not found:
        raise UserError(f"no accepted crash in {workspace.storage.root}; trace-dag run makes them")
    return sorted(found)


def export(
    workspace: Workspace,
    keys: Sequence[str],
    folder: Path,
    export_format: str,
    *,
    told: Callable[[str], None] = lambda _key: None,
    on_problem: OnProblem = raise_problem,
    left_out: Callable[[str], None] = lambda _why: None,
) -> int:
    """Write verified crashes below ``folder`` in a format of an installed exporter.

    Return the number of files written or replaced.

    ``told`` is called with each crash, ``on_problem`` for each crash with damaged files, ``left_out`` for each crash
    that the format cannot express. Raises :class:`UserError` for an unknown format.
    """
    exporter = load(PluginKind.EXPORTER, export_format)(keys)
    target, written = Storage.open(folder, output=True), 0
    for files in _crashes(workspace, keys):
        try:
            contents = exporter.of_crash(files)
        except Failure as failure:
            on_problem(failure)
            continue
        except UserError as error:
            left_out(f"{files.key}: {error}")
            continue
        written += sum(write_if_changed(target, name, data) for name, data in contents.items())
        told(files.key)
    return written + sum(write_if_changed(target, name, data) for name, data in exporter.beside().items())


def write_if_changed(target: Storage, name: str, data: bytes) -> bool:
    """Write a file unless it exists with the same content; return whether it was written."""
    try:
        if target.read(name) == data:
            return False
    except FileNotFoundError:
        pass
    target.write(name, data)
    return True


def _crashes(workspace: Workspace, keys: Sequence[str]) -> Iterator[CrashFiles]:
    for start in range(0, len(keys), _AT_A_TIME):
        yield from crash_files(workspace, keys[start : start + _AT_A_TIME])
