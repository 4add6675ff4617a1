"""What workers make of a crash when its last stage is done is what is made of it later."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import pytest
from faults.stores import TroubledStore
from sample_runs import KEYS, ingest, reports_of

from trace_dag.common.storage.files import Storage
from trace_dag.export.build import build_benchmark
from trace_dag.export.crash_files import (
    made_of,
    make_at_once,
    make_files,
    note_made,
    package_name,
    read_notes,
    replay_name,
    thumbnail_name,
)
from trace_dag.flow.batch import run_stages
from trace_dag.flow.executors import InProcessExecutor
from trace_dag.flow.stored_crashes import stored_crash
from trace_dag.flow.tasks import MadeFiles
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse

VERIFIED, REJECTED = KEYS[0], "2023-319070"


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """A root with a crash that will be verified and one that will be simulated and rejected."""
    ingest(tmp_path / "root", reports_of(tmp_path / "reports", (VERIFIED, REJECTED)))
    return replace(Workspace.open(str(tmp_path / "root")), executor=InProcessExecutor())


def run(workspace: Workspace) -> dict[str, MadeFiles]:
    keys = workspace.registry.keys()
    events = run_stages(workspace, keys, run_id="x", afterwards=make_at_once(workspace.storage, keys))
    return {event.key: event.made for event in events if event.made is not None}


def test_a_worker_makes_what_would_be_made_later(workspace: Workspace) -> None:
    made = run(workspace)
    assert made.keys() == {VERIFIED, REJECTED}
    assert [file.name for file in made[REJECTED].files] == [replay_name(REJECTED)]
    names = [replay_name(VERIFIED), package_name(VERIFIED), thumbnail_name(VERIFIED)]
    assert [file.name for file in made[VERIFIED].files] == names
    with ZipFile(workspace.storage.path(package_name(VERIFIED))) as package:
        assert f"{VERIFIED}/scenario.xosc" in package.namelist()
    files = stored_crash(workspace, VERIFIED)
    assert made_of(files.records) == made[VERIFIED].made_of
    for name in names:
        workspace.storage.delete(name)
    assert make_files(files, accepted=True) == made[VERIFIED].files  # sizes and SHA-256 are the same


def test_it_is_noted_until_the_benchmark_lists_it(workspace: Workspace) -> None:
    made = run(workspace)
    assert read_notes(workspace.storage) == {}
    note_made(workspace.storage, {REJECTED: made[REJECTED]})
    note_made(workspace.storage, {VERIFIED: made[VERIFIED]})
    found = read_notes(workspace.storage)
    assert {key: (set(each.files), each.made_of) for key, each in found.items()} == {
        key: (set(each.files), each.made_of) for key, each in made.items()
    }
    workspace.storage.delete(package_name(VERIFIED))
    assert read_notes(workspace.storage).keys() == {REJECTED}
    build_warehouse(workspace.storage, workspace.local_folder)
    build_benchmark(workspace)
    assert read_notes(workspace.storage) == {}


def test_existing_pages_are_left_to_the_benchmark(workspace: Workspace) -> None:
    workspace.storage.write(replay_name(VERIFIED), b"as an earlier run made it")
    assert run(workspace).keys() == {REJECTED}
    assert workspace.storage.read(replay_name(VERIFIED)) == b"as an earlier run made it"
    assert run(workspace) == {}  # nothing was computed


def test_a_status_costs_an_object_store_one_listing_of_each_kind() -> None:
    TroubledStore.reset()
    make_at_once(Storage("troubled://bucket/root"), [f"2023-51{number:04}" for number in range(100)])
    assert TroubledStore.requests == {"list": 3}, "of replays, packages and thumbnails"
