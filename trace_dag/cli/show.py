"""Everything known about one crash, and the benchmark page in a browser: ``show`` and ``open``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, progress_bar, say, write_json
from trace_dag.common.errors import UserError
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.messages.wording import last_line

if TYPE_CHECKING:
    from trace_dag.flow.contract import CrashFiles
    from trace_dag.flow.crash_status import CrashStatus
    from trace_dag.flow.records import Records
    from trace_dag.flow.workspace import Workspace

_FIRST = 3  # figures that stand before all else


@click.command(epilog=examples("trace-dag show 2023-510179"))
@click.argument("key")
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
@pass_root
def show(root: str, key: str, as_json: bool) -> None:
    """Show one crash: events, state and reason, next commands, and files."""
    from trace_dag.flow.crash_status import crash_status, valid_records
    from trace_dag.flow.records import read_records
    from trace_dag.flow.selection import select_registered
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, to_read=True)
    select_registered(workspace, None, [key])
    records = valid_records(read_records(workspace.storage, [key])[key])
    said = _said(workspace, crash_status(key, records), records)
    if as_json:
        write_json(said)
        return
    say(f"{key}  {said['outcome']}")
    for line in said["numbers"][:_FIRST]:
        say(f"  {line}")
    for name in ("what", "why", "meaning", "remedy"):
        if said[name]:
            say(f"\n{said[name]}")
    if said["against"]:
        say("\nSpeaks against it:")
        for line in said["against"]:
            say(f"  {line}")
    if said["numbers"][_FIRST:]:
        say()
        for line in said["numbers"][_FIRST:]:
            say(f"  {line}")
    say()
    print_table(["stage", "outcome", "seconds"], [tuple(row.values()) for row in said["stages"]])
    say()
    for file in said["files"]:
        say(file)


def _said(workspace: Workspace, crash: CrashStatus, records: Records) -> dict[str, Any]:
    from trace_dag.crash.summary import in_one_sentence
    from trace_dag.flow.artefacts import RECORD
    from trace_dag.flow.contract import CrashFiles

    storage = workspace.storage
    source = workspace.registry.sources([crash.key])[crash.key]
    stored = CrashFiles.recorded(crash.key, source, workspace.settings, storage, records)
    outcome = crash.final_state.value.replace("_", " ")
    if crash.corroborated:
        outcome += ", corroborated"
    if crash.reason is not None:
        outcome += f" at {crash.stage_reached}: {crash.reason.value}"
    numbers, against = _judged(stored)
    files = [file.name for record in records.values() for file in (*record.artefacts, *record.pictures)]
    return {
        "key": crash.key,
        "outcome": outcome,
        "numbers": numbers,
        "what": in_one_sentence(stored.load(RECORD)) if stored.has(RECORD) else "",
        "why": crash.detail,
        "meaning": crash.reason.meaning if crash.reason else "",
        "against": against,
        "remedy": crash.reason.remedy if crash.reason else _remedy(crash),
        "stages": [
            {"stage": stage.value, "outcome": record.outcome.value, "seconds": round(record.duration_s, 3)}
            for stage, record in records.items()
        ],
        "files": [storage.path(name) for name in [*files, *_pages(workspace, crash.key)]],
    }


def _judged(stored: CrashFiles) -> tuple[list[str], list[str]]:
    """Return the figures of a judged crash, and the evidence against it."""
    from trace_dag.flow.artefacts import MAP_REPORT, RECORD, VERDICT
    from trace_dag.verdict.in_words import events_in_words, numbers_of, sight_in_words

    if not (stored.has(VERDICT) and stored.has(RECORD)):
        return [], []
    verdict = stored.load(VERDICT)
    placement = stored.load(MAP_REPORT).placement if stored.has(MAP_REPORT) else None
    figures = [f"{value} {what}" for value, what in numbers_of(verdict, stored.load(RECORD), placement)]
    if verdict.accepted:
        happened = [line for line in (events_in_words(verdict), verdict.alternatives, sight_in_words(verdict)) if line]
        figures[_FIRST - 1 : _FIRST - 1] = happened
    return figures, [each.detail for each in verdict.reservations]


def _remedy(crash: CrashStatus) -> str:
    from trace_dag.flow.crash_status import FinalState

    if crash.final_state is FinalState.FAILED or crash.outdated:
        return "trace-dag rerun --failed runs it again."
    if crash.final_state is FinalState.PENDING:
        return f"trace-dag run --only {crash.key} computes it."
    return ""


def _pages(workspace: Workspace, key: str) -> list[str]:
    from trace_dag.export.crash_files import package_name, page_name

    return [name for name in (page_name(key), package_name(key)) if workspace.storage.exists(name)]


@click.command("open", epilog=examples("trace-dag open", "trace-dag open 2023-510179"))
@click.argument("key", required=False)
@pass_root
def open_page(root: str, key: str | None) -> None:
    """Open the benchmark page in a browser, or the page of one crash, and print where it is.

    Runs make no pages if there are more crashes than execution.pages_up_to; this command makes them all, or that of the
    crash.
    """
    from trace_dag.crash.keys import parse_key
    from trace_dag.export.build import INDEX, build_benchmark, build_page
    from trace_dag.export.crash_files import page_name
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, to_read=True)
    storage = workspace.storage
    if key is not None:
        parse_key(key)
    name = INDEX if key is None else page_name(key)
    if not workspace.pages_in_runs and workspace.warehouse.is_file():
        with progress_bar("pages") as on_progress:
            listened = replace(workspace, page_listener=on_progress)
            errors = build_benchmark(listened).errors if key is None else build_page(workspace, key)
        for of_crash, error in errors.items():
            print_problem(f"no page of {of_crash}: {last_line(error)}")
    if not storage.exists(name):
        raise UserError(f"{storage.path(name)}: there is no such page yet; trace-dag run makes it")
    say(storage.path(name))
    if storage.local_root is None:
        raise UserError("the root is not on this machine; serve it with any web server and open benchmark/")
    click.launch(storage.path(name))
