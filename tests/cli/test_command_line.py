"""The contract others script against: commands, exit codes, one-line errors, output formats."""

from __future__ import annotations

import csv
import io
import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pandas as pd
import pytest
import sample_runs
from sample_runs import KEYS, SAMPLE, ingest, reports_of, study, trace_dag

from trace_dag.cli.main import cli


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run"], "no crash is registered"),
        (["status"], ""),
        (["run", "--only", "2023-510999"], ""),
        (["run", "--only", "../../etc/passwd"], ""),
        (["run", "--cohort", "nowhere"], "cohort 'nowhere' is not registered"),
        (["rerun"], "say what to run again"),
        (["rerun", "--rejected", "bad_luck"], "Invalid value for '--rejected'"),
        (["run", "--from", "breakfast"], "Invalid value for '--from'"),
        (["sql", "SELECT 1"], "there is no warehouse yet"),
        (["ingest", "--reports", "/nowhere/at/all"], "/nowhere/at/all does not exist"),
        (["ingest"], "which state and year"),
        (["breakfast"], "No such command"),
        (["cohort", "show", "nowhere"], "cohort 'nowhere' is not registered"),
        (["status", "--cohort", "nowhere"], "cohort 'nowhere' is not registered"),
        (["rerun", "--failed"], "no crash is registered"),
        (["replay", "breakfast"], "'breakfast' is not a crash key"),
        (["open", "../.."], "'../..' is not a crash key"),
        (["replay", 10_000 * "k"], f"'{40 * 'k'}'... is not a crash key"),
        (["evaluate"], "no crash is registered"),
        (["vary"], "no crash is registered"),
        (["release", "--version", "new"], "expected a version"),
    ],
)
def test_impossible_commands_give_one_line_and_exit_code_2(tmp_path, arguments, said):
    (tmp_path / "root").mkdir()
    done = trace_dag(tmp_path / "root", *arguments)
    if arguments == ["status"]:
        assert done.returncode == 0
        return
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("trace-dag")


def test_unusable_inputs_of_ingest_are_named(tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    done = trace_dag(tmp_path / "root", "ingest", "--reports", str(empty))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "no crash report" in done.stderr

    no_osm = tmp_path / "map.osm"
    no_osm.write_text("<html>not a map</html>")
    reports = reports_of(tmp_path / "reports")
    done = trace_dag(tmp_path / "root", "ingest", "--reports", str(reports), "--maps", str(no_osm))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "map.osm" in done.stderr
    assert json.loads(trace_dag(tmp_path / "root", "status", "--json").stdout)["crashes"] == {}, "nothing registered"


def commands_with_a_root(group: click.Group) -> Iterator[tuple[list[str], click.Command]]:
    """All commands but those that begin a root or need none, by what is typed."""
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        if isinstance(command, click.Group):
            yield from (([name, *words], found) for words, found in commands_with_a_root(command))
        elif name not in ("demo", "ingest", "map", "settings", "plugins", "registers"):
            yield [name], command


@pytest.mark.parametrize(("words", "command"), list(commands_with_a_root(cli)), ids=str)
def test_a_missing_root_is_named_and_not_made(tmp_path, words, command):
    options = {"release": ["--version", "1"], "rerun": ["--failed"], "osmium": ["--output", str(tmp_path / "x.json")]}
    values = ["2023-319003" for each in command.params if isinstance(each, click.Argument) and each.required]
    if words[-1] == "add":
        values = [str(SAMPLE / "truth.json")]
    done = trace_dag(tmp_path / "mistyped", *words, *values, *options.get(words[-1], []))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "there is nothing there" in done.stderr
    assert not (tmp_path / "mistyped").exists()


@pytest.mark.parametrize("name", ["a?b", "a%20b"])
def test_a_root_whose_path_sqlite_reads_otherwise_is_refused_before_anything_is_made(tmp_path, name):
    done = trace_dag(tmp_path / name, "ingest", "--reports", str(SAMPLE / "reports"))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "rename the folder" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_not_mounted_does_not_agree(tmp_path):
    done = trace_dag(tmp_path, "verify")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "mounted" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_unreadable_root_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    done = trace_dag(tmp_path / "file" / "root", "status")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "cannot read there" in done.stderr


def test_a_url_without_a_bucket_is_one_line_and_makes_no_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = trace_dag("s3://", "status")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "names no bucket" in done.stderr
    assert not list(tmp_path.iterdir())


def test_wrong_setting_is_one_line(tmp_path):
    ingest(tmp_path / "root", reports_of(tmp_path / "reports", KEYS[:1]))
    done = trace_dag(tmp_path / "root", "run", TRACE_DAG_SIM__FRICTION="-1")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "sim.friction" in done.stderr


def test_ingest_is_idempotent_and_names_what_it_left_aside(tmp_path):
    reports = reports_of(tmp_path / "reports")
    (reports / "copy.xml").write_bytes((reports / "crash_319003.xml").read_bytes())
    (reports / "notes.txt").write_text("not a report")
    first = ingest(tmp_path / "root", reports)
    assert first.returncode == 0, first.stderr
    assert f"{len(KEYS)} crashes registered" in first.stdout
    assert "copy.xml" in first.stdout
    assert "notes.txt" in first.stdout
    again = ingest(tmp_path / "root", reports)
    assert f"0 crashes registered, {len(KEYS)} known already" in again.stdout


def test_several_values_of_one_option_can_follow_each_other(tmp_path):
    reports = reports_of(tmp_path / "reports", KEYS[:2])
    maps = sorted(str(path) for path in (SAMPLE / "osm").glob("*.osm"))
    done = trace_dag(tmp_path / "root", "ingest", "--maps", *maps, "--cohort", "c", "--reports", str(reports))
    assert done.returncode == 0, done.stderr
    assert f"{len(maps)} map files" in done.stdout


def test_run_prints_the_funnel_and_every_crash_is_where_its_truth_states(finished_root):
    status = json.loads(trace_dag(finished_root, "status", "--json").stdout)
    assert sum(status["final_states"].values()) == len(KEYS) == len(status["crashes"])
    expected = {
        crash["key"]: crash["expected"]
        for crash in json.loads((SAMPLE / "truth.json").read_text())["crashes"]
        if crash["key"] in KEYS
    }
    found = {
        key: {"final_state": crash["final_state"], "reason": crash["reason"]}
        for key, crash in status["crashes"].items()
    }
    assert found == expected


def test_artefacts_lie_at_their_listed_paths(finished_root):
    key = KEYS[0]
    for name in (
        f"raw_report/{key}.xml",
        f"crash_record/{key}.parquet",
        f"osm_extract/{key}.osm.pbf",
        f"road_map/{key}.xodr",
        f"road_map/{key}.json",
        f"state_estimate/{key}.json",
        f"simulation_log/{key}.parquet",
        f"simulation_log/{key}.json",
        f"verdict/{key}.json",
        f"pictures/{key}.png",
        "warehouse.duckdb",
        "dagster/dagster.yaml",
    ):
        assert (finished_root / name).is_file(), name
    settings = (finished_root / "dagster/dagster.yaml").read_text()
    assert "telemetry:\n  enabled: false" in settings
    assert "nux:\n  enabled: false" in settings


def test_second_run_has_nothing_to_do(finished_root):
    before = {path: path.stat().st_mtime_ns for path in finished_root.glob("*/*.outcome.json")}
    done = trace_dag(finished_root, "run")
    assert done.returncode == 0
    assert "Nothing to run" in done.stdout
    assert {path: path.stat().st_mtime_ns for path in finished_root.glob("*/*.outcome.json")} == before


def test_nothing_to_run_again_is_not_called_up_to_date(tmp_path):
    ingest(tmp_path / "root", reports_of(tmp_path / "reports", KEYS[:1]))
    done = trace_dag(tmp_path / "root", "rerun", "--failed")
    assert done.returncode == 0, done.stderr
    assert "Nothing to run again" in done.stdout
    assert "up to date" not in done.stdout
    assert "1 pending" in done.stdout


def test_estimators_that_cannot_be_compared_are_one_line(finished_root):
    done = study(finished_root, "compare_estimators", "--estimators", "analytic,breakfast")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "'breakfast' is not an estimator" in done.stderr


def test_without_the_key_of_a_model_the_possible_comparisons_are_named(finished_root, monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    done = study(finished_root, "compare_estimators", "--estimators", "analytic,llm@openai/gpt-4o")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "the environment lacks OPENAI_API_KEY" in done.stderr
    for way in ("score_truth", "llm@ollama/"):
        assert way in done.stderr


def test_status_for_people_shows_the_funnel_and_the_reasons(finished_root):
    done = trace_dag(finished_root, "status")
    assert done.returncode == 0
    for word in ("registered", "verified", "published", "no_map_coverage", "malformed_report"):
        assert word in done.stdout


def test_sql_in_every_format(finished_root):
    query = "SELECT key, final_state FROM crashes ORDER BY key LIMIT 2"
    as_json = json.loads(trace_dag(finished_root, "sql", query, "--format", "json").stdout)
    as_csv = list(csv.DictReader(io.StringIO(trace_dag(finished_root, "sql", query, "--format", "csv").stdout)))
    assert as_json == as_csv
    assert [row["key"] for row in as_json] == sorted(KEYS)[:2]
    table = trace_dag(finished_root, "sql", query).stdout
    assert all(row["key"] in table for row in as_json)


@pytest.mark.parametrize(
    "query",
    [
        "",
        "DELETE FROM crashes",
        "SELEC 1",
        "SELECT * FROM read_csv('/etc/passwd')",
        "COPY crashes TO '/tmp/stolen.csv'",
        "ATTACH '/tmp/other.duckdb'",
        "INSTALL httpfs",
    ],
)
def test_sql_can_only_read_the_warehouse(finished_root, query):
    done = trace_dag(finished_root, "sql", query)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


ENDLESS = "WITH RECURSIVE r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) SELECT count(*) FROM r"


@pytest.mark.parametrize(
    ("query", "said"),
    [
        (ENDLESS, "no answer after 4 s"),
        ("SELECT repeat('x', 1000000) FROM range(100000)", "more than 1024 MB"),
        ("SELECT repeat('x', 4000000000)", "more than 1024 MB"),
    ],
    ids=["endless", "many rows", "one value"],
)
def test_a_question_without_end_or_bounds_is_ended_in_a_line(finished_root, query, said):
    limits = {"TRACE_DAG_WAREHOUSE__QUERY_TIME_S": "4", "TRACE_DAG_WAREHOUSE__QUERY_MEMORY_MB": "1024"}
    if query is not ENDLESS:
        limits["TRACE_DAG_WAREHOUSE__QUERY_TIME_S"] = "600"
    done = trace_dag(finished_root, "sql", query, **limits)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert said in done.stderr


def test_a_damaged_warehouse_is_reported_by_the_process_that_answers(tmp_path):
    damaged = tmp_path / "root"
    sample_runs.copy_finished(damaged)
    with (damaged / "warehouse.duckdb").open("r+b") as file:
        file.truncate(5000)
    done = trace_dag(damaged, "sql", "FROM crashes")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "damaged" in done.stderr


def test_values_tell_a_terminal_nothing_and_a_spreadsheet_no_formula(finished_root):
    query = (
        "SELECT chr(27) || '[2J' || chr(7) || chr(27) || ']0;title' AS said, '=HYPERLINK(1)' AS formula, "
        "'-5' AS text, -5.25 AS number, '@x' AS handle"
    )
    assert not set(trace_dag(finished_root, "sql", query).stdout) & {"\x1b", "\x07"}
    done = trace_dag(finished_root, "sql", f"SELECT * FROM nothing WHERE x = '{chr(27)}[2J'")
    assert "\x1b" not in done.stderr
    frame = pd.read_csv(io.StringIO(trace_dag(finished_root, "sql", query, "--format", "csv").stdout))
    ((_, formula, text, number, handle),) = frame.itertuples(index=False)
    assert (formula, handle) == ("'=HYPERLINK(1)", "'@x")
    assert (text, number) == (-5, -5.25)


def test_score_truth_measures_what_was_estimated(finished_root):
    result = json.loads(study(finished_root, "score_truth", "--json").stdout)
    estimated = {row["key"] for row in result["vehicles"] if row.get("impact_point_error_m") is not None}
    assert {"2023-319003", "2023-319022", "2023-319024"} <= estimated
    assert study(finished_root, "score_truth").returncode == 0


def test_root_from_the_environment(finished_root, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "trace_dag.cli", "status", "--json"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env={"PATH": "", "HOME": str(tmp_path), "TRACE_DAG_ROOT": str(finished_root)},
    )
    assert Path(json.loads(done.stdout)["root"]) == finished_root


def test_a_database_of_dagsters_that_does_not_answer_is_one_line(tmp_path):
    pytest.importorskip("dagster_postgres")
    with socket.socket() as free:  # bound and not listened on: connections are refused
        free.bind(("127.0.0.1", 0))
        url = f"postgresql://crash:secret@127.0.0.1:{free.getsockname()[1]}/history"
        down = trace_dag(tmp_path, "ingest", "--reports", str(SAMPLE / "reports"), TRACE_DAG_POSTGRES=url)
    assert (down.returncode, down.stderr.count("\n")) == (1, 1), down.stderr
    assert "TRACE_DAG_POSTGRES" in down.stderr
    assert "refused" in down.stderr
    assert "secret" not in down.stderr
    for wrong in ({}, {"TRACE_DAG_POSTGRES": "crash:secret@history"}):
        done = trace_dag(tmp_path, "verify", **wrong)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert "TRACE_DAG_POSTGRES does not name the database" in done.stderr
        assert "secret" not in done.stderr
