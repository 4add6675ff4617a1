"""Looking at a crash, the settings, the tables: ``show``, ``open``, ``settings``, ``tables``; running one again."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import click
import pytest
import sample_runs
from sample_runs import KEYS, finished, ingest, reports_of, trace_dag

from trace_dag.cli.printing import print_table
from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage
from trace_dag.warehouse.query import rows


def ending(state: str) -> str:
    """A crash of the finished root that ended so."""
    return next(row["key"] for row in rows(finished() / "warehouse.duckdb", "crashes") if row["final_state"] == state)


def test_show_names_events_and_files():
    key = ending("verified")
    done = trace_dag(finished(), "show", key)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{key}  verified")
    assert " collided." in done.stdout
    files = [line for line in done.stdout.splitlines() if line.startswith(str(finished()))]
    assert all(Path(file).is_file() for file in files)
    assert {Path(file).name for file in files} >= {f"{key}.xodr", f"{key}.html", f"{key}.zip"}


def test_show_names_the_reason_of_a_rejection_and_the_remedy():
    key = ending("rejected")
    said = json.loads(trace_dag(finished(), "show", key, "--json").stdout)
    row = next(row for row in rows(finished() / "warehouse.duckdb", "crashes") if row["key"] == key)
    reason = Reason(row["reason"])
    assert said["outcome"] == f"rejected at {row['stage_reached']}: {reason}"
    assert (said["why"], said["meaning"], said["remedy"]) == (row["detail"], reason.meaning, reason.remedy)


def test_show_of_a_crash_that_is_not_registered_is_one_line():
    done = trace_dag(finished(), "show", "2023-1")
    assert done.returncode == 2
    assert "2023-1" in done.stderr
    assert done.stderr.count("\n") == 1


def test_open_opens_the_page_and_prints_where_it_is(monkeypatch, tmp_path):
    opened = []
    monkeypatch.setattr(click, "launch", opened.append)
    key = KEYS[0]
    for arguments, page in (((), "index.html"), ((key,), f"crashes/{key}.html")):
        done = trace_dag(finished(), "open", *arguments)
        assert done.stdout.strip() == opened[-1] == str(finished() / "benchmark" / page)
    done = trace_dag(tmp_path, "open")
    assert done.returncode == 2
    assert "trace-dag run makes it" in done.stderr


def test_a_run_of_many_crashes_leaves_pages_to_open(monkeypatch, tmp_path):
    opened = []
    monkeypatch.setattr(click, "launch", opened.append)
    root, keys = tmp_path / "root", KEYS[:2]
    pages = root / "benchmark" / "crashes"
    ingest(root, reports_of(tmp_path / "reports", keys))
    (root / "settings.toml").write_text("[execution]\npages_up_to = 0\n")
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr
    assert "trace-dag open and trace-dag release make them" in done.stdout
    assert not [*(root / "benchmark").rglob("*"), *(root / "pictures").rglob("*")]
    assert "Nothing to run" in trace_dag(root, "run").stdout
    for number, key in enumerate(keys, 1):
        done = trace_dag(root, "open", key)
        assert done.stdout.strip() == opened[-1] == str(pages / f"{key}.html")
        assert {path.stem for path in pages.glob("*.html")} == set(keys[:number]), "one by one"
        assert f'src="{key}.svg"' in (pages / f"{key}.html").read_text()
    listed = (root / "benchmark" / "index.html").read_text()
    assert all(f"crashes/{key}.html" in listed for key in keys)
    assert trace_dag(root, "open").returncode == 0
    made, without = ({path.name for path in (of / "benchmark").rglob("*.*")} for of in (root, finished(keys)))
    assert made - {f"{key}.svg" for key in keys} == without - {f"{key}.svg" for key in keys}, "the same as a run makes"
    assert trace_dag(root, "verify").returncode == 0


def test_settings_say_where_each_value_comes_from(tmp_path):
    (tmp_path / "settings.toml").write_text("[sim]\nfriction = 0.5\n[osm]\nradius_m = 200\n")
    done = trace_dag(tmp_path, "settings", "--json", TRACE_DAG_OSM__RADIUS_M="250")
    settings = {(row["section"], row["name"]): row for row in json.loads(done.stdout)}
    assert settings["sim", "friction"]["source"] == "settings.toml"
    assert settings["sim", "friction"]["value"] == 0.5
    radius = settings["osm", "radius_m"]
    assert (radius["value"], radius["default"], radius["source"]) == (250.0, 300.0, "environment")
    assert settings["verdict", "max_contact_distance_m"]["source"] == "default"
    assert all(row["meaning"] for row in settings.values())
    assert trace_dag(tmp_path, "settings", "simm").returncode == 2


def test_tables_say_what_they_and_their_columns_mean():
    listed = trace_dag(finished(), "tables").stdout
    assert "verdicts" in listed
    assert "funnel_by_kind" in listed
    columns = trace_dag(finished(), "tables", "verdicts").stdout
    assert trace_dag(finished(), "sql", "DESCRIBE verdicts").stdout == columns
    names = trace_dag(finished(), "sql", "FROM verdicts LIMIT 0", "--format", "csv").stdout.strip().split(",")
    assert all(name in columns for name in names)
    found = trace_dag(finished(), "tables", "Closing  speed").stdout.splitlines()[2:]
    assert {line.split()[0] for line in found} >= {"contacts", "verdicts"}
    assert all("losing" in line for line in found), "words of a name or of its meaning"
    assert trace_dag(finished(), "tables", "verdict xyz").returncode == 2


def test_rows_wider_than_the_terminal_are_printed_as_a_block_each(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a terminal
    monkeypatch.setenv("COLUMNS", "30")
    rows = [("2023-1", "a car that turned left", 4.5), ("2023-2", None, 11.0)]
    print_table(["key", "summary", "speed_mps"], rows, fit=True)
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines == [
        "key        2023-1",
        "summary    a car that turned",
        "           left",
        "speed_mps  4.5",
        "",
        "key        2023-2",
        "summary",
        "speed_mps  11",
        "",
    ]
    monkeypatch.setenv("COLUMNS", "80")
    print_table(["key", "summary", "speed_mps"], rows, fit=True)
    assert len(capsys.readouterr().out.splitlines()) == 4, "a table where it fits"


@pytest.fixture
def own_root(tmp_path: Path) -> Path:
    return sample_runs.copy_finished(tmp_path / "root")


def test_rerun_of_named_crashes_runs_all_their_stages_and_no_other_crash(own_root):
    key = ending("verified")

    def times() -> dict[tuple[str, str], str]:
        files = own_root.glob("*/*.outcome.json")
        records = [json.loads(file.read_text()) for file in files]
        return {(record["key"], record["stage"]): record["started_at"] for record in records}

    before = times()
    assert trace_dag(own_root, "rerun", "--only", key).returncode == 0
    changed = {name for name, time in times().items() if time != before[name]}
    assert changed == {(key, stage.value) for stage in Stage}
    assert trace_dag(own_root, "rerun").returncode == 2


ROWS = (
    "SELECT key, latitude_deg, longitude_deg, '=1+1' AS formula, [1, 2] AS listed, "
    "nullif(vehicles, 1) AS whole FROM crashes ORDER BY key"
)


def test_columns_of_a_parquet_file_have_the_types_of_the_answer(tmp_path):
    import pyarrow.parquet as pq

    types = {
        "nullif(vehicles, vehicles)": "int64",
        "nullif(vehicles, 1)": "int64",
        "NULL::VARCHAR": "string",
        "NULL::DOUBLE": "double",
        "NULL::BOOLEAN[]": "list<element: bool>",
        "sum(vehicles)": "int64",
        "sum(170141183460469231731687303715884105727 // 10)": "decimal128(38, 0)",
    }
    asked = ", ".join(f"{expression} AS column_{k}" for k, expression in enumerate(types))
    path = tmp_path / "rows.parquet"
    done = trace_dag(finished(), "sql", f"SELECT {asked} FROM crashes GROUP BY vehicles", "--output", str(path))
    assert done.returncode == 0, done.stderr
    assert [str(each.type) for each in pq.read_schema(path)] == list(types.values())


def test_rows_go_into_files_that_other_tools_open(tmp_path):
    import pyarrow.parquet as pq

    plain = json.loads(trace_dag(finished(), "sql", ROWS, "--format", "json").stdout)
    keys = [row["key"] for row in plain]
    for name in ("xlsx", "parquet", "geojson"):
        done = trace_dag(finished(), "sql", ROWS, "--format", name, "--output", str(tmp_path / f"rows.{name}"))
        assert done.returncode == 0, done.stderr
    assert pq.read_table(tmp_path / "rows.parquet")["key"].to_pylist() == keys
    features = json.loads((tmp_path / "rows.geojson").read_text())["features"]
    assert [feature["properties"]["key"] for feature in features] == keys
    assert features[0]["geometry"]["coordinates"] == [plain[0]["longitude_deg"], plain[0]["latitude_deg"]]
    with zipfile.ZipFile(tmp_path / "rows.xlsx") as workbook:
        sheet = workbook.read("xl/worksheets/sheet1.xml").decode()
        texts = workbook.read("xl/sharedStrings.xml").decode()
    assert "<f>" not in sheet, "text of a report has become a formula"
    assert "=1+1" in texts
    assert all(key in texts for key in keys)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--format", "xlsx"), "--output FILE"),
        (("--output", "rows.txt"), "name the file .csv"),
        (("--format", "table", "--output", "rows.csv"), "is for the terminal"),
        (("--format", "geojson", "--output", "rows.geojson"), "latitude_deg"),
    ],
)
def test_rows_that_cannot_be_written_so_are_one_line(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = trace_dag(finished(), "sql", "SELECT key FROM crashes", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_file_knows_its_form_by_its_name(tmp_path):
    done = trace_dag(finished(), "sql", "SELECT key FROM crashes", "--output", str(tmp_path / "rows.xlsx"))
    assert done.returncode == 0
    with zipfile.ZipFile(tmp_path / "rows.xlsx") as sheets:
        sheet = sheets.read("xl/worksheets/sheet1.xml").decode()
    assert 'state="frozen"' in sheet
    assert "<autoFilter" in sheet
    assert "<cols>" in sheet


def test_the_ui_names_invalid_cron_hours_in_one_line(tmp_path):
    (tmp_path / "settings.toml").write_text('[[automation.schedules]]\nname = "nightly"\ncron = "0 25 * * *"\n')
    done = trace_dag(tmp_path, "ui", "--port", "0")
    assert done.returncode == 2
    assert "schedule nightly: '0 25 * * *' is not a cron expression" in done.stderr
    assert done.stderr.count("\n") == 1
