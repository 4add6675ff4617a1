"""The warehouse while crashes are worked on, and what it tells of crashes that were run again."""

from __future__ import annotations

import json
import threading
from itertools import islice
from pathlib import Path

from trace_dag.common.errors import Reason
from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry, ReportSource
from trace_dag.flow.records import read_records, write_record
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.outcomes import read_snapshots
from trace_dag.warehouse.query import open_warehouse, rows

KEYS = [f"2023-51000{number}" for number in range(1, 9)]


def note(storage: Storage, key: str, stage: Stage, run: int, reason: Reason | None = None, error: str = "") -> None:
    """Store what a stage says of a crash in a run, a verdict with its document, as a batch does."""
    artefacts = ()
    if stage is Stage.VERDICT and not error:
        document = {
            "key": key,
            "label": "verified" if reason is None else "rejected",
            "hypothesis": run,
            "rule_set": "x",
            "criteria": [],
        }
        document["criteria"] = [{"name": "contact_distance", "value": float(run), "unit": "m"}]
        artefacts = (storage.write(f"{stage}/{key}.json", json.dumps(document).encode()),)
    outcome = Outcome.FAILED if error else Outcome.REJECTED if reason else Outcome.ACCEPTED
    record = OutcomeRecord(
        key=key,
        stage=stage,
        outcome=outcome,
        provenance=Provenance("code", {"run": run}, {}),
        fingerprint=str(run),
        run_id=f"run {run}",
        started_at=f"2026-01-01T00:{run:02d}:{stage.position:02d}.000+00:00",
        duration_s=0.1,
        reason=reason,
        detail=error or (f"rejected in run {run}" if reason else ""),
        artefacts=artefacts,
    )
    earlier = read_records(storage, [key])[key].get(stage)
    write_record(storage, record.superseding(earlier))


def made(root: Path, keys: list[str]) -> Storage:
    storage = Storage.open(root)
    Registry(storage).register("one", {key: ReportSource("file", "/gone", "0") for key in keys})
    for key in keys:
        for stage in Stage:
            note(storage, key, stage, run=1)
    return storage


def test_tells_which_runs_changed_a_verdict(tmp_path):
    unchanged, rejected, back, broken = KEYS[:4]
    storage = made(tmp_path, [unchanged, rejected, back, broken])
    note(storage, unchanged, Stage.VERDICT, run=2)
    note(storage, rejected, Stage.VERDICT, run=2, reason=Reason.WRONG_IMPACT)
    # The map is refused once and then made as before: the old verdict holds again without being computed.
    note(storage, back, Stage.ROAD_MAP, run=2, reason=Reason.CRASH_OFF_ROAD)
    note(storage, back, Stage.ROAD_MAP, run=3)
    note(storage, broken, Stage.SIMULATION_LOG, run=2, error="the disk is full")
    build_warehouse(storage, tmp_path)
    changes = rows(tmp_path / "warehouse.duckdb", "verdict_changes")
    columns = ("key", "run_id", "result_before", "reason_before", "result_after", "reason_after")
    assert {tuple(row[column] for column in columns) for row in changes} == {
        (rejected, "run 2", "accepted", None, "rejected", "wrong_impact"),
        (back, "run 2", "accepted", None, "rejected", "crash_off_road"),
        (back, "run 3", "rejected", "crash_off_road", "accepted", None),
    }
    (failure,) = rows(tmp_path / "warehouse.duckdb", "failures")
    assert (failure["key"], failure["stage"], failure["message"]) == (broken, "simulation_log", "the disk is full")
    assert rows(tmp_path / "warehouse.duckdb", "stage_history")[0]["standing"] is True


def test_a_crash_that_is_judged_between_its_record_and_its_document_is_read_again(tmp_path, monkeypatch):
    storage = made(tmp_path, KEYS[:2])
    runs = iter([2, 3])  # that judge the crash just after its record was read

    def records_and_then_a_run(*arguments, **options):
        found = read_records(*arguments, **options)
        for run in islice(runs, 1):
            note(storage, KEYS[0], Stage.VERDICT, run)
        return found

    monkeypatch.setattr("trace_dag.warehouse.outcomes.read_records", records_and_then_a_run)
    problems = []
    ((judged, _),) = read_snapshots(storage, KEYS[:2], [(Stage.VERDICT, "json")], problems.append)
    assert problems == []
    assert judged.valid[Stage.VERDICT].run_id == "run 3"
    assert json.loads(judged.documents[Stage.VERDICT, "json"])["hypothesis"] == 3


def test_two_batches_write_while_it_is_read_and_rebuilt(tmp_path):
    """No row is lost, nothing is locked, and what a record says and its document agree in every build."""
    storage = made(tmp_path, KEYS)
    build_warehouse(storage, tmp_path)
    done = threading.Event()
    broken: list[BaseException] = []

    def batch(keys: list[str]) -> None:
        run = 1
        try:
            while not done.is_set():
                run = run % 50 + 1
                for key in keys:
                    note(storage, key, Stage.VERDICT, run, Reason.WRONG_LOCATION if run % 2 else None)
        except BaseException as error:
            broken.append(error)

    batches = [threading.Thread(target=batch, args=(keys,)) for keys in (KEYS[:4], KEYS[4:])]
    for thread in batches:
        thread.start()
    try:
        with open_warehouse(tmp_path / "warehouse.duckdb") as reader:
            for _ in range(2):
                build_warehouse(storage, tmp_path)
                assert reader.execute("SELECT count(*) FROM crashes").fetchall() == [(len(KEYS),)]
                verdicts = {row["key"]: row for row in rows(tmp_path / "warehouse.duckdb", "verdicts")}
                crashes = rows(tmp_path / "warehouse.duckdb", "crashes")
                assert [row["key"] for row in crashes] == KEYS
                for row in crashes:
                    if row["stage_reached"] == "verdict":  # the others are just being judged
                        assert verdicts[row["key"]]["accepted"] == (row["final_state"] == "verified")
    finally:
        done.set()
        for thread in batches:
            thread.join()
    assert broken == []
