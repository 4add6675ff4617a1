"""Which results a run would make again, and what has changed since."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace

import pytest

from trace_dag.common.stage import Stage
from trace_dag.flow.batch import first_stale, run_stages, stale_results
from trace_dag.flow.records import read_records

BEHAVIOURS = {
    "2023-510010": "",
    "2023-510011": "reject:road_map",
    "2023-510012": "fail:verdict",
    "2023-510013": "",
}
FIRST, _, _, LAST = BEHAVIOURS


@pytest.fixture
def workspace(make_workspace):
    """Three crashes that have run, and one that has not."""
    workspace = make_workspace(BEHAVIOURS)
    list(run_stages(workspace, list(BEHAVIOURS)[:3], run_id="x"))
    return workspace


def stale(workspace):
    """What has changed, by crash and stage."""
    found = stale_results(workspace, read_records(workspace.storage, workspace.registry.keys()))
    return {(each.key, each.stage): each.changed for each in found}


def test_failed_and_unrun_crashes_are_work_and_not_stale(workspace):
    assert stale(workspace) == {}
    assert first_stale(workspace, list(BEHAVIOURS)) == {"2023-510012": Stage.VERDICT, LAST: Stage.RAW_REPORT}


def test_other_settings_make_results_stale_and_the_old_ones_current_again(workspace, make_workspace):
    ran = list(BEHAVIOURS)[:3]
    changed = stale(make_workspace(osm={"radius_m": 123.0}))
    assert changed == {(key, Stage.OSM_EXTRACT): ("setting radius_m",) for key in ran}
    assert stale(workspace) == {}


def test_another_number_of_the_code_makes_results_stale(workspace):
    stages = tuple(replace(each, version=2) if each.stage is Stage.ROAD_MAP else each for each in workspace.flow.stages)
    changed = replace(workspace, flow=replace(workspace.flow, stages=stages))
    assert set(stale(changed).values()) == {("code",)}
    assert {stage for _, stage in stale(changed)} == {Stage.ROAD_MAP}
    assert first_stale(changed, [FIRST]) == {FIRST: Stage.ROAD_MAP}


def test_another_report_is_noticed_without_a_change_of_any_stored_file(workspace, tmp_path):
    other = tmp_path / "another.xml"
    other.write_bytes(b"<another/>")
    source = workspace.registry.sources([FIRST])[FIRST].report
    digest = hashlib.sha256(other.read_bytes()).hexdigest()
    workspace.registry.register("fakes", {FIRST: replace(source, location=str(other), sha256=digest)})
    assert stale(workspace) == {(FIRST, Stage.RAW_REPORT): ("input report",)}


def test_an_artefact_that_was_cut_short_is_seen(workspace):
    (artefact, *_) = (
        path for path in (workspace.storage.local_root / "verdict").glob(f"{FIRST}.*") if "outcome" not in path.name
    )
    os.truncate(artefact, artefact.stat().st_size - 1)
    assert stale(workspace) == {(FIRST, Stage.VERDICT): ("files",)}
