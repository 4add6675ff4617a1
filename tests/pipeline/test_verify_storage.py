"""Storage against its own records: every way in which they can disagree is found, said and mended."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest

from trace_dag.errors import Stage
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.products import StageProduct
from trace_dag.pipeline.records import read_records, write_record
from trace_dag.pipeline.registry import ReportSource
from trace_dag.pipeline.verify import Kind, StorageReport, repair_storage, verify_storage
from trace_dag.processes import temporary_prefix

GOOD, OTHER = "2023-510001", "2023-510002"
MAP = f"road_map/{GOOD}.txt"


@pytest.fixture
def pipeline(make_pipeline) -> Pipeline:
    made = make_pipeline({GOOD: "", OTHER: "reject:road_map"})
    run(made)
    return made


def run(pipeline: Pipeline) -> None:
    list(pipeline.run(pipeline.registry.keys(), run_id="test"))


def look(pipeline: Pipeline, **options: bool) -> StorageReport:
    return verify_storage(pipeline.storage, Path(pipeline.storage.root), **options)


def kinds(report: StorageReport) -> list[tuple[Kind, str | None, Stage | None]]:
    return [(each.kind, each.key, each.stage) for each in report.disagreements]


def test_what_a_run_leaves_behind_agrees(pipeline):
    report = look(pipeline, contents=True)
    assert report.disagreements == ()
    assert {key: len(of_crash) for key, of_crash in report.records.items()} == {GOOD: 7, OTHER: 4}
    assert report.files == 7 + 7 + 4 + 3  # the rejecting stage made a record and no artefact


def break_by(pipeline: Pipeline, damage: str) -> None:
    storage = pipeline.storage
    if damage == "lost":
        storage.delete(MAP)
    elif damage == "cut short":
        storage.write(MAP, storage.read(MAP)[:-1])
    elif damage == "bit rot":
        storage.write(MAP, b"X" + storage.read(MAP)[1:])
    elif damage == "record cut short":
        name = f"road_map/{GOOD}.outcome.json"
        storage.write(name, storage.read(name)[:100])
    elif damage == "record of another":
        storage.write(f"road_map/{GOOD}.outcome.json", storage.read(f"road_map/{OTHER}.outcome.json"))


@pytest.mark.parametrize(
    ("damage", "kind"),
    [
        ("lost", Kind.MISSING_ARTEFACT),
        ("cut short", Kind.DAMAGED_ARTEFACT),
        ("bit rot", Kind.DAMAGED_ARTEFACT),
        ("record cut short", Kind.UNREADABLE_RECORD),
        ("record of another", Kind.UNREADABLE_RECORD),
    ],
)
def test_damage_is_named_and_after_a_repair_one_run_makes_it_good(pipeline, damage, kind):
    whole = pipeline.storage.read(MAP)
    break_by(pipeline, damage)
    report = look(pipeline, contents=True)
    assert (kind, GOOD, Stage.ROAD_MAP) in kinds(report)
    assert all(each.key == GOOD for each in report.disagreements), "the other crash is as it was"
    repair_storage(pipeline.storage, report)
    assert pipeline.first_stale([GOOD, OTHER]) == {GOOD: Stage.ROAD_MAP}
    run(pipeline)
    assert look(pipeline, contents=True).disagreements == ()
    assert pipeline.storage.read(MAP) == whole


def test_sizes_alone_do_not_show_what_only_the_contents_do(pipeline):
    break_by(pipeline, "bit rot")
    assert look(pipeline).disagreements == ()


def test_what_no_record_lists_is_deleted(pipeline):
    pipeline.storage.write(f"verdict/{OTHER}.txt", b"of a run that was killed before it wrote its record")
    report = look(pipeline)
    assert kinds(report) == [(Kind.UNLISTED_FILE, OTHER, Stage.VERDICT)]
    repair_storage(pipeline.storage, report)
    assert look(pipeline).disagreements == ()
    assert pipeline.storage.exists(f"verdict/{GOOD}.txt")


def test_leftovers_of_dead_processes_are_removed_and_those_of_living_ones_left(pipeline, tmp_path):
    dead = subprocess.run(
        [sys.executable, "-c", "from trace_dag.processes import temporary_prefix as name; print(name(''))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    root = Path(pipeline.storage.root)
    (root / f"verdict/.writing-{dead}abc").write_bytes(b"half")
    (root / f".building-{dead}abc").mkdir()
    living = root / "verdict" / f"{temporary_prefix('.writing-')}abc"
    living.write_bytes(b"half")
    report = look(pipeline)
    assert kinds(report) == [(Kind.LEFTOVER, None, None)] * 2
    repair_storage(pipeline.storage, report)
    assert look(pipeline).disagreements == ()
    assert living.exists()


def test_an_interrupted_stage_is_work_to_be_done_and_no_disagreement(pipeline):
    record = read_records(pipeline.storage, [GOOD])[GOOD][Stage.VERDICT]
    write_record(pipeline.storage, record.begun_again())
    pipeline.storage.delete(f"verdict/{GOOD}.txt")
    report = look(pipeline)
    assert (report.disagreements, report.interrupted) == ((), 1)


def test_a_copied_report_that_is_gone_and_crashes_that_are_registered_no_more(pipeline):
    pipeline.registry.register("fars", {"2015-10001": ReportSource("stored", "reports/2015-10001.xml", "0")})
    pipeline.registry.remove("fakes", [OTHER])
    report = look(pipeline)
    assert kinds(report) == [(Kind.MISSING_REPORT, "2015-10001", Stage.RAW_REPORT)]
    assert report.unregistered == 1


def test_a_failed_stage_leaves_no_file_behind(make_pipeline):
    pipeline = make_pipeline({GOOD: ""})
    run(pipeline)
    failing = replace(fake_flow.FLOW.definition(Stage.SIMULATION_LOG), function=f"{__name__}:broken")
    stages = tuple(failing if each.stage is failing.stage else each for each in fake_flow.FLOW.stages)
    run(replace(pipeline, flow=replace(fake_flow.FLOW, stages=stages)))
    assert not pipeline.storage.exists(f"simulation_log/{GOOD}.txt")
    assert look(pipeline).disagreements == ()


def broken(key: str) -> StageProduct:
    raise RuntimeError("the simulator is broken")
