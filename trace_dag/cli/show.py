"""Everything known about one crash: ``show``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, write_json

if TYPE_CHECKING:
    from trace_dag.flow.records import Records
    from trace_dag.flow.standing import Standing
    from trace_dag.flow.workspace import Workspace


@click.command(epilog=examples("trace-dag show 2023-510179"))
@click.argument("key")
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
@click.pass_obj
def show(root: str, key: str, as_json: bool) -> None:
    """Show one crash: what happened, where it stands and why, what can be done, and where its files are."""
    from trace_dag.flow.records import read_records
    from trace_dag.flow.selection import registered
    from trace_dag.flow.standing import standing, valid_records
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, to_read=True)
    registered(workspace, None, [key])
    records = valid_records(read_records(workspace.storage, [key])[key])
    said = _said(workspace, standing(key, records), records)
    if as_json:
        write_json(said)
        return
    click.echo(f"{key}  {said['outcome']}")
    for name in ("what", "why", "meaning", "remedy"):
        if said[name]:
            click.echo(f"\n{said[name]}")
    click.echo()
    print_table(["stage", "outcome", "seconds"], [tuple(row.values()) for row in said["stages"]])
    click.echo()
    for file in said["files"]:
        click.echo(file)


def _said(workspace: Workspace, crash: Standing, records: Records) -> dict[str, Any]:
    storage = workspace.storage
    outcome = crash.final_state.value
    if crash.corroborated:
        outcome += ", corroborated"
    if crash.reason is not None:
        outcome += f" at {crash.stage_reached}: {crash.reason.value}"
    files = [file.name for record in records.values() for file in (*record.artefacts, *record.pictures)]
    return {
        "key": crash.key,
        "outcome": outcome,
        "what": _sentence(workspace, crash.key, records),
        "why": crash.detail,
        "meaning": crash.reason.meaning if crash.reason else "",
        "remedy": crash.reason.remedy if crash.reason else _remedy(crash),
        "stages": [
            {"stage": stage.value, "outcome": record.outcome.value, "seconds": round(record.duration_s, 3)}
            for stage, record in records.items()
        ],
        "files": [storage.path(name) for name in [*files, *_pages(workspace, crash.key)]],
    }


def _sentence(workspace: Workspace, key: str, records: Records) -> str:
    from trace_dag.crash.summary import in_one_sentence
    from trace_dag.flow.artefacts import RECORD
    from trace_dag.flow.contract import CrashFiles

    source = workspace.registry.sources([key])[key]
    files = CrashFiles.recorded(key, source, workspace.settings, workspace.storage, records)
    return in_one_sentence(files.load(RECORD)) if files.has(RECORD) else ""


def _remedy(crash: Standing) -> str:
    from trace_dag.flow.standing import FinalState

    if crash.final_state is FinalState.FAILED or crash.outdated:
        return "trace-dag rerun --failed runs it again."
    if crash.final_state is FinalState.PENDING:
        return f"trace-dag run --only {crash.key} computes it."
    return ""


def _pages(workspace: Workspace, key: str) -> list[str]:
    from trace_dag.benchmark.build import page_name
    from trace_dag.benchmark.crash_files import package_name

    return [name for name in (page_name(key), package_name(key)) if workspace.storage.exists(name)]
