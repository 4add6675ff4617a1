"""A look is the same with a note of an earlier one and without, whatever has happened between the two."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace
from pathlib import Path

import pytest

from trace_dag.code_versions import CodeVersion
from trace_dag.flow import contract, looks
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.looks import look_at, stale_results
from trace_dag.flow.records import read_records
from trace_dag.flow.standing import FinalState, standings
from trace_dag.stage import Stage

BEHAVIOURS = {
    "2023-510010": "",
    "2023-510011": "reject:road_map",
    "2023-510012": "fail:verdict",
    "2023-510013": "",
}
FIRST = "2023-510010"


@pytest.fixture
def workspace(make_workspace):
    """Three crashes that have run and been looked at, and one that has not run."""
    workspace = make_workspace(BEHAVIOURS)
    list(run_stages(workspace, list(BEHAVIOURS)[:3], run_id="x"))
    assert_true(workspace)
    return workspace


def assert_true(workspace):
    """A look finds what reading every record finds; the look."""
    keys = workspace.registry.keys()
    found = look_at(workspace, keys)
    records = read_records(workspace.storage, keys)
    assert list(found) == keys
    assert {key: look.standing for key, look in found.items()} == standings(records)
    assert [look.stale for look in found.values() if look.stale] == stale_results(workspace, records)
    return found


def keys_read(monkeypatch):
    """The crashes whose records looks read from now on."""
    read = []

    def counted(storage, keys, **options):
        read.extend(keys)
        return read_records(storage, keys, **options)

    monkeypatch.setattr(looks, "read_records", counted)
    return read


def note_of(workspace) -> Path:
    return workspace.storage.local_root / "cache" / "standing.json"


def test_a_second_look_reads_only_what_has_changed(workspace, monkeypatch):
    read = keys_read(monkeypatch)
    look_at(workspace, workspace.registry.keys())
    assert read == []
    list(run_stages(workspace, ["2023-510013"], run_id="y"))
    found = look_at(workspace, workspace.registry.keys())
    assert read == ["2023-510013"]
    assert found["2023-510013"].standing.final_state is FinalState.VERIFIED
    assert_true(workspace)


def test_other_settings_make_results_stale_and_the_old_ones_current_again(workspace, make_workspace):
    assert assert_true(workspace)[FIRST].stale is None
    changed = make_workspace(osm={"radius_m": 123.0})
    stale = assert_true(changed)[FIRST].stale
    assert stale is not None
    assert stale.changed == ("setting radius_m",)
    assert assert_true(workspace)[FIRST].stale is None


def test_after_other_code_or_settings_no_record_is_read(workspace, make_workspace, monkeypatch):
    read = keys_read(monkeypatch)
    keys = workspace.registry.keys()
    changed = make_workspace(osm={"radius_m": 123.0})
    assert [key for key, look in look_at(changed, keys).items() if look.stale] == list(BEHAVIOURS)[:3]
    code = contract.Flow.code
    monkeypatch.setattr(contract.Flow, "code", lambda *of_stage: replace(code(*of_stage), digest="another"))
    found = look_at(workspace, keys)
    assert {look.stale.changed for key, look in found.items() if look.stale} == {("code",)}
    assert {key: look.stale.stage for key, look in found.items() if look.stale} == {
        key: stage for key, stage in first_stale(workspace, keys).items() if key in list(BEHAVIOURS)[:3]
    }
    assert read == []


def test_after_other_code_of_looks_themselves_all_is_read(workspace, monkeypatch):
    read = keys_read(monkeypatch)
    monkeypatch.setattr(looks, "code_version", lambda _: CodeVersion("another"))
    look_at(workspace, workspace.registry.keys())
    assert read == workspace.registry.keys()


def test_another_report_is_noticed_without_a_change_of_any_stored_file(workspace, tmp_path):
    other = tmp_path / "another.xml"
    other.write_bytes(b"<another/>")
    source = workspace.registry.sources([FIRST])[FIRST].report
    digest = hashlib.sha256(other.read_bytes()).hexdigest()
    workspace.registry.register("fakes", {FIRST: replace(source, location=str(other), sha256=digest)})
    stale = assert_true(workspace)[FIRST].stale
    assert stale is not None
    assert (stale.stage, stale.changed) == (Stage.RAW_REPORT, ("input report",))


def test_an_artefact_that_was_cut_short_is_seen(workspace):
    (artefact, *_) = (
        path for path in (workspace.storage.local_root / "verdict").glob(f"{FIRST}.*") if "outcome" not in path.name
    )
    os.truncate(artefact, artefact.stat().st_size - 1)
    stale = assert_true(workspace)[FIRST].stale
    assert stale is not None
    assert stale.changed == ("files",)


def test_a_damaged_record_is_complained_about_each_time(workspace, caplog):
    record = workspace.storage.local_root / "verdict" / f"{FIRST}.outcome.json"
    record.write_bytes(record.read_bytes().replace(b"accepted", b"rejected"))
    for _ in range(2):
        caplog.clear()
        assert look_at(workspace, [FIRST])[FIRST].standing.final_state is FinalState.PENDING
        assert f"{FIRST}.outcome.json" in caplog.text


@pytest.mark.parametrize("content", [b"", b"{}", b"nothing that was noted"])
def test_a_note_that_is_none_counts_for_nothing(workspace, content):
    note_of(workspace).write_bytes(content)
    assert_true(workspace)
    assert note_of(workspace).read_bytes() != content


def test_a_note_changed_by_hand_counts_for_nothing(workspace):
    note = note_of(workspace)
    note.write_bytes(note.read_bytes().replace(b'"verified"', b'"rejected"'))
    assert assert_true(workspace)[FIRST].standing.final_state is FinalState.VERIFIED
