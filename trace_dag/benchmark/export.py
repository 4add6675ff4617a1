"""Verified crashes written out for use elsewhere: packages as folders, or the published benchmark's layout.

One crash at a time, whatever their number; a file that is already there as it should be is left alone, so an
interrupted export goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

from trace_dag.benchmark.packaging import package_of, published_files, published_readme
from trace_dag.errors import Failure, UserError
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.ledgers import Complaint, raised
from trace_dag.flow.records import log_complaint, read_records
from trace_dag.flow.standing import FinalState, standing
from trace_dag.flow.workspace import Workspace
from trace_dag.storage import Storage
from trace_dag.studies.stored_crashes import crash_files

Layout = Literal["packages", "published"]

_AT_A_TIME = 200  # crashes whose records are read together


def verified_keys(
    workspace: Workspace, cohort: str | None = None, only: Sequence[str] = (), *, complain: Complaint = log_complaint
) -> list[str]:
    """Keys of the verified crashes, of a cohort or among those named, in order.

    ``complain`` is called for damaged records: whether their crash is verified cannot be told. Raises
    :class:`UserError` if there is none, or if one of those named is not verified.
    """
    asked = list(only) or list(workspace.registry.keys(cohort))
    found = [
        key
        for start in range(0, len(asked), _AT_A_TIME)
        for key, records in read_records(
            workspace.storage, asked[start : start + _AT_A_TIME], complain=complain
        ).items()
        if standing(key, records).final_state is FinalState.VERIFIED
    ]
    missing = sorted(set(only) - set(found))
    if missing:
        raise UserError(f"{', '.join(missing)}: not verified; trace-dag status tells where a crash stands")
    if not found:
        raise UserError(f"no verified crash in {workspace.storage.root}; trace-dag run makes them")
    return sorted(found)


def export(
    workspace: Workspace,
    keys: Sequence[str],
    folder: Path,
    layout: Layout,
    *,
    told: Callable[[str], None] = lambda _key: None,
    complain: Complaint = raised,
    left_out: Callable[[str], None] = lambda _why: None,
) -> int:
    """Write verified crashes below ``folder``; how many files were written or replaced. ``told`` hears of each crash,
    ``complain`` of each that cannot be written because something stored of it is damaged, ``left_out`` of each that the
    layout has no words for.

    Packages lie in a folder per key. In the published layout crashes are known by their case number alone, which is
    unique only within a year: crashes of several years lie in a folder per year.
    """
    target, written = Storage.open(folder), 0
    years = {key.partition("-")[0] for key in keys}
    for files in _crashes(workspace, keys):
        year = files.key.partition("-")[0]
        try:
            if layout == "packages":
                contents = {f"{files.key}/{name}": data for name, data in package_of(files).items()}
            else:
                below = f"{year}/" if len(years) > 1 else ""
                contents = {below + name: data for name, data in published_files(files).items()}
        except Failure as failure:
            complain(failure)
            continue
        except UserError as error:
            left_out(f"{files.key}: {error}")
            continue
        written += sum(write_if_changed(target, name, data) for name, data in contents.items())
        told(files.key)
    if layout == "published":
        written += write_if_changed(target, "README.md", published_readme())
    return written


def write_if_changed(target: Storage, name: str, data: bytes) -> bool:
    """Write a file unless it is there with the same content; whether it was written."""
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
