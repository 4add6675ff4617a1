"""Storage against its own records: every way in which they can disagree is found, said and mended."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest

from trace_dag.common.processes import temporary_prefix
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.cohorts.registry import ReportSource
from trace_dag.flow.records import read_records, write_record
from trace_dag.flow.verify import DisagreementKind, Quarantine, StorageReport, repair_storage, verify_storage
from trace_dag.flow.workspace import Workspace

GOOD, OTHER = "2023-510001", "2023-510002"
MAP = f"road_map/{GOOD}.txt"


@pytest.fixture
def workspace(make_workspace) -> Workspace:
    made = make_workspace({GOOD: "", OTHER: "reject:road_map"})
    run(made)
    return made


def run(workspace: Workspace) -> None:
    list(run_stages(workspace, workspace.registry.keys(), run_id="test"))


def look(workspace: Workspace, **options: bool) -> StorageReport:
    return verify_storage(workspace.storage, Path(workspace.storage.root), **options)


def kinds(report: StorageReport) -> list[tuple[DisagreementKind, str | None, Stage | None]]:
    return [(each.kind, each.key, each.stage) for each in report.disagreements]


def test_the_files_of_a_run_agree(workspace):
    report = look(workspace, contents=True)
    assert report.disagreements == ()
    assert {key: len(of_crash) for key, of_crash in report.records.items()} == {GOOD: 7, OTHER: 4}
    assert report.files == 7 + 7 + 4 + 3  # the rejecting stage made a record and no artefact


def repair(workspace, report):
    with Quarantine(workspace.storage) as aside:
        repair_storage(workspace.storage, report.disagreements, aside)


def break_by(workspace: Workspace, damage: str) -> None:
    storage = workspace.storage
    if damage == "lost":
        storage.delete(MAP)
    elif damage == "cut short":
        storage.write(MAP, storage.read(MAP)[:-1])
    elif damage == "bit rot":
        storage.write(MAP, b"X" + storage.read(MAP)[1:])
    elif damage == "record lost":
        storage.delete(f"road_map/{GOOD}.outcome.json")
    elif damage == "record cut short":
        name = f"road_map/{GOOD}.outcome.json"
        storage.write(name, storage.read(name)[:100])
    elif damage == "record of another":
        storage.write(f"road_map/{GOOD}.outcome.json", storage.read(f"road_map/{OTHER}.outcome.json"))


@pytest.mark.parametrize(
    ("damage", "kind"),
    [
        ("lost", DisagreementKind.MISSING_ARTEFACT),
        ("cut short", DisagreementKind.DAMAGED_ARTEFACT),
        ("bit rot", DisagreementKind.DAMAGED_ARTEFACT),
        ("record lost", DisagreementKind.MISSING_RECORD),
        ("record cut short", DisagreementKind.UNREADABLE_RECORD),
        ("record of another", DisagreementKind.UNREADABLE_RECORD),
    ],
)
def test_damage_is_named_and_after_a_repair_one_run_makes_it_good(workspace, damage, kind):
    whole = workspace.storage.read(MAP)
    break_by(workspace, damage)
    report = look(workspace, contents=True)
    assert (kind, GOOD, Stage.ROAD_MAP) in kinds(report)
    assert all(each.key == GOOD for each in report.disagreements), "the other crash is as it was"
    repair(workspace, report)
    assert first_stale(workspace, [GOOD, OTHER]) == {GOOD: Stage.ROAD_MAP}
    run(workspace)
    assert look(workspace, contents=True).disagreements == ()
    assert workspace.storage.read(MAP) == whole


def test_sizes_alone_do_not_show_what_only_the_contents_do(workspace):
    break_by(workspace, "bit rot")
    assert look(workspace).disagreements == ()


def test_unlisted_files_are_put_aside(workspace):
    workspace.storage.write(f"verdict/{OTHER}.txt", b"of a run that was killed before it wrote its record")
    report = look(workspace)
    assert kinds(report) == [(DisagreementKind.UNLISTED_FILE, OTHER, Stage.VERDICT)]
    repair(workspace, report)
    assert look(workspace).disagreements == ()
    assert workspace.storage.exists(f"verdict/{GOOD}.txt")


def test_leftovers_of_dead_processes_are_removed_and_those_of_living_ones_left(workspace, tmp_path):
    dead = subprocess.run(
        [sys.executable, "-c", "from trace_dag.common.processes import temporary_prefix as name; print(name(''))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    root = Path(workspace.storage.root)
    (root / f"verdict/.writing-{dead}abc").write_bytes(b"half")
    (root / f".building-{dead}abc").mkdir()
    living = root / "verdict" / f"{temporary_prefix('.writing-')}abc"
    living.write_bytes(b"half")
    report = look(workspace)
    assert kinds(report) == [(DisagreementKind.LEFTOVER, None, None)] * 2
    repair(workspace, report)
    assert look(workspace).disagreements == ()
    assert living.exists()


def test_an_interrupted_stage_is_work_to_be_done_and_no_disagreement(workspace):
    record = read_records(workspace.storage, [GOOD])[GOOD][Stage.VERDICT]
    write_record(workspace.storage, record.begun_again())
    workspace.storage.delete(f"verdict/{GOOD}.txt")
    report = look(workspace)
    assert (report.disagreements, report.interrupted) == ((), 1)


def test_a_copied_report_that_is_gone_and_crashes_that_are_registered_no_more(workspace):
    workspace.registry.register("fars", {"2015-10001": ReportSource("stored", "reports/2015-10001.xml", "0")})
    workspace.registry.remove("fakes", [OTHER])
    report = look(workspace)
    assert kinds(report) == [(DisagreementKind.DAMAGED_REPORT, "2015-10001", Stage.RAW_REPORT)]
    assert report.unregistered == 1


def test_a_failed_stage_leaves_no_file_behind(make_workspace):
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    failing = replace(fake_flow.FLOW.definition(Stage.SIMULATION_LOG), function="fake_flow:broken")
    stages = tuple(failing if each.stage is failing.stage else each for each in fake_flow.FLOW.stages)
    run(replace(workspace, flow=replace(fake_flow.FLOW, stages=stages)))
    assert not workspace.storage.exists(f"simulation_log/{GOOD}.txt")
    assert look(workspace).disagreements == ()


def test_a_file_that_the_program_could_not_have_named_breaks_nothing_and_is_put_aside(workspace):
    copy = workspace.storage.local_root / "road_map" / f"Copy of {GOOD}.txt"
    unnamed = workspace.storage.local_root / "verdict" / "tmpabc"
    copy.write_text("by hand")
    unnamed.write_text("left over")
    assert list(read_records(workspace.storage, [GOOD])) == [GOOD]
    report = look(workspace)
    assert {(each.kind, Path(each.file).name) for each in report.disagreements} == {
        (DisagreementKind.UNLISTED_FILE, copy.name),
        (DisagreementKind.UNLISTED_FILE, unnamed.name),
    }
    repair(workspace, report)
    assert look(workspace).disagreements == ()
    (aside,) = workspace.storage.local_root.glob("quarantine/*/road_map/*")
    assert (aside.name, aside.read_text()) == (copy.name, "by hand")
