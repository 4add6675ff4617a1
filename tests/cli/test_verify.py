"""``trace-dag verify`` as a user calls it: after a run, after damage, after a repair."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import duckdb
import pytest
import sample_runs
from sample_runs import SAMPLE, reports_of, trace_dag

VERIFIED = "2023-319003"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    sample_runs.copy_finished(tmp_path / "root")
    return tmp_path / "root"


def test_everything_agrees_after_a_run(root):
    done = trace_dag(root, "verify", "--contents")
    assert done.returncode == 0, done.stdout
    assert "storage, Dagster and the warehouse agree" in done.stdout


def test_stages_that_are_older_than_the_settings_are_named_and_are_no_disagreement(root):
    assert json.loads(trace_dag(root, "verify", "--json").stdout)["stale"] == {}
    assert "stale" not in trace_dag(root, "status").stdout
    changed = {"TRACE_DAG_VERDICT__MAX_CLOCK_ERROR_POSITIONS": "1.5"}
    done = trace_dag(root, "verify", "--json", **changed)
    crashes = json.loads(trace_dag(root, "status", "--json", **changed).stdout)["crashes"]
    judged = [key for key, crash in crashes.items() if crash["stage_reached"] == "verdict"]
    assert (done.returncode, json.loads(done.stdout)["stale"]) == (0, {"verdict": len(judged)})
    assert {key for key, crash in crashes.items() if crash["stale"] == "verdict"} == set(judged)
    assert crashes[VERIFIED]["stale_because"] == ["setting max_clock_error_positions"]
    shown = trace_dag(root, "status", **changed).stdout
    assert shown.splitlines()[-2].split() == ["verdict", str(len(judged)), "setting", "max_clock_error_positions"]


def test_damage_is_listed_mended_as_far_as_it_can_be_and_the_rest_is_for_a_run(root):
    (root / f"road_map/{VERIFIED}.xodr").write_bytes(b"<OpenDRIVE/>")
    (root / "verdict/2023-319999.json").write_text("{}")
    with duckdb.connect(str(root / "warehouse.duckdb")) as connection:
        connection.execute("DELETE FROM crashes WHERE final_state = 'rejected'")
    done = trace_dag(root, "verify", "--json")
    assert done.returncode == 1
    listed = json.loads(done.stdout)["disagreements"]
    assert {"damaged artefact", "file of no record", "not as in the warehouse"} == {
        row["disagreement"] for row in listed
    }
    assert all(row["remedy"] and row["detail"] for row in listed)
    (damaged,) = [row for row in listed if row["disagreement"] == "damaged artefact"]
    assert (damaged["key"], damaged["stage"]) == (VERIFIED, "road_map")

    done = trace_dag(root, "verify", "--repair", "--json")
    assert done.returncode == 1, "a stage waits to be run"
    left = json.loads(done.stdout)["disagreements"]
    assert left
    assert all(row["key"] == VERIFIED and row["remedy"].startswith("trace-dag run") for row in left)

    assert trace_dag(root, "run").returncode == 0
    done = trace_dag(root, "verify", "--contents")
    assert done.returncode == 0, done.stdout


def test_a_folder_in_a_files_place_is_put_aside_and_the_file_made_again(root):
    names = (f"verdict/{VERIFIED}.json", f"pictures/{VERIFIED}.png", f"benchmark/packages/{VERIFIED}.zip")
    for name in (*names, f"crash_record/{VERIFIED}.outcome.json"):
        (root / name).unlink()
        (root / name).mkdir()
        (root / name / "something").write_text("else")
    listed = json.loads(trace_dag(root, "verify", "--json").stdout)["disagreements"]
    assert {row["file"] for row in listed} >= {*names, f"crash_record/{VERIFIED}.outcome.json"}
    trace_dag(root, "verify", "--repair")
    assert trace_dag(root, "run").returncode == 0
    done = trace_dag(root, "verify", "--contents")
    assert done.returncode == 0, done.stdout
    assert all((root / name).is_file() for name in names)
    aside = {path.name for path in (root / "quarantine").rglob("*") if path.is_dir()}
    assert aside >= {Path(name).name for name in names}


def test_a_cohort_lost_with_its_copy_is_missed_and_its_crashes_keep_their_pages(root, tmp_path):
    trace_dag(root, "cohort", "remove", "sample", "--only", VERIFIED)
    again = ("--reports", str(reports_of(tmp_path / "reports", [VERIFIED])), "--maps", str(SAMPLE / "osm"))
    assert trace_dag(root, "ingest", *again, "--cohort", "other").returncode == 0
    assert trace_dag(root, "run").returncode == 0
    page = root / f"benchmark/crashes/{VERIFIED}.html"
    assert page.is_file()
    for name in ("cohorts/other.parquet", "cohorts/copies/other.parquet"):
        (root / name).unlink()
    for command in ("status", "run"):
        said = trace_dag(root, command)
        assert (said.returncode, said.stderr.count("\n")) == (1, 1), said.stderr
        assert "cohorts/other.parquet: damaged: it is not there" in said.stderr
    done = trace_dag(root, "verify", "--repair")
    assert done.returncode == 0, done.stdout
    assert page.is_file()
    status = json.loads(trace_dag(root, "status", "--json").stdout)["crashes"]
    assert (status[VERIFIED]["cohort"], status[VERIFIED]["final_state"], len(status)) == ("recovered", "verified", 10)
    trace_dag(root, "cohort", "remove", "recovered")
    assert trace_dag(root, "status").returncode == 0, "a cohort that was taken away is not missed"


def test_a_root_of_an_earlier_version_is_outdated_and_not_damaged(root):
    """Earlier versions listed files in a folder of lists, had no manifests, and kept no copies of cohorts."""
    (root / "ledgers").mkdir()
    (root / "ledgers/benchmark.json").write_text("{}")
    (root / "benchmark/manifest.json").unlink()
    shutil.rmtree(root / "cohorts/copies")
    done = trace_dag(root, "verify")
    assert done.returncode == 0, done.stdout
    assert "made by an earlier version of the program; trace-dag run brings it up to date" in done.stdout
    assert trace_dag(root, "run").returncode == 0
    done = trace_dag(root, "verify", "--contents")
    assert (done.returncode, "earlier version" in done.stdout) == (0, False), done.stdout


def test_a_warehouse_of_an_earlier_version_is_outdated_and_not_damaged(root, monkeypatch):
    monkeypatch.setattr("trace_dag.warehouse.build.VERSION", "of the next version")
    done = trace_dag(root, "verify", "--contents")
    assert done.returncode == 0, done.stdout
    assert "made by an earlier version of the program; trace-dag run brings it up to date" in done.stdout
    assert trace_dag(root, "run").returncode == 0
    done = trace_dag(root, "verify", "--contents")
    assert (done.returncode, "earlier version" in done.stdout) == (0, False), done.stdout
