"""The warehouse against counts made from the artefacts themselves, by other means."""

from __future__ import annotations

import io
import json
import re
from collections import Counter
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import sample_runs

from trace_dag.common.schemas import table_from_parquet
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.flow.cohorts.registry import Registry, ReportSource
from trace_dag.warehouse.build import build_warehouse, table_documentation
from trace_dag.warehouse.outcomes import CrashSnapshot, DocumentTables
from trace_dag.warehouse.query import open_warehouse, rows
from trace_dag.warehouse.updating import TABLES

UNKNOWN = {"MAN_COLL": {98, 99}, "TYP_INT": {98, 99}, "HARM_EV": {98, 99}, "REL_ROAD": {98, 99}}
CONTRACT = {
    "crashes": "key case_year state_case cohort latitude_deg longitude_deg final_state stage_reached reason "
    "collision_type road_topology vehicle_trajectory",
    "stage_outcomes": "key stage outcome reason detail duration_s",
    "verdicts": "key accepted contact_distance_m clock_error_max_positions direction_ok speed_error_initial_max_rel "
    "speed_error_impact_max_rel",
    "funnel": "step crashes published",
    "failure_reasons": "stage reason published_category crashes",
    "coverage": "dimension class registered verified published",
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Part of the sample, run, and one crash registered that has not been."""
    root = tmp_path_factory.mktemp("warehouse") / "root"
    sample_runs.copy_finished(root)
    Registry(Storage(root)).register("more", {"2023-319099": ReportSource("file", "/not/run", "0")})
    build_warehouse(Storage(root), root)
    return root


def table(root: Path, name: str) -> list[dict[str, object]]:
    return rows(root / "warehouse.duckdb", name)


@pytest.mark.parametrize("name", CONTRACT)
def test_tables_begin_with_the_columns_others_script_against(root, name):
    with open_warehouse(root / "warehouse.duckdb") as connection:
        columns = [row[0] for row in connection.execute(f"DESCRIBE {name}").fetchall()]
    assert columns[: len(CONTRACT[name].split())] == CONTRACT[name].split()


def test_every_column_of_every_table_is_documented(root):
    with open_warehouse(root / "warehouse.duckdb") as connection:
        documented = table_documentation(connection)
        comments = connection.execute(
            "SELECT table_name, comment FROM duckdb_tables() UNION SELECT view_name, comment FROM duckdb_views()"
            " WHERE NOT internal"
        ).fetchall()
    assert set(documented) == set(TABLES) == {name for name, comment in comments if comment}
    for name, columns in documented.items():
        assert columns
        assert all(comment for _, _, comment in columns), name


def test_every_crash_is_in_exactly_one_final_state(root):
    crashes = table(root, "crashes")
    assert len(crashes) == len({crash["key"] for crash in crashes}) == len(sample_runs.KEYS) + 1
    states = Counter(crash["final_state"] for crash in crashes)
    assert set(states) <= {"verified", "rejected", "failed", "pending"}
    assert states["pending"] == 1
    truth = json.loads((sample_runs.SAMPLE / "truth.json").read_text())["crashes"]
    expected = {crash["key"]: crash["expected"]["final_state"] for crash in truth}
    assert {crash["key"]: crash["final_state"] for crash in crashes if crash["key"] in expected} == {
        key: expected[key] for key in sample_runs.KEYS
    }


def test_outcomes_equal_the_records_on_disk(root):
    on_disk = {}
    for path in root.glob("*/*.outcome.json"):
        record = json.loads(path.read_text())
        on_disk[record["key"], record["stage"]] = (record["outcome"], record["reason"])
    assert {
        (row["key"], row["stage"]): (row["outcome"], row["reason"]) for row in table(root, "stage_outcomes")
    } == on_disk


def test_funnel_equals_a_count_of_artefacts(root):
    found = {row["step"]: row["crashes"] for row in table(root, "funnel")}
    accepted = Counter(
        path.parent.name for path in root.glob("*/*.outcome.json") if '"outcome": "accepted"' in path.read_text()
    )
    assert found == {
        "registered": len(sample_runs.KEYS) + 1,
        "complete": accepted["crash_record"],
        "mapped": accepted["road_map"],
        "estimated": accepted["state_estimate"],
        "collided": accepted["simulation_log"],
        "accepted": accepted["verdict"],
        "verified": sum('"label": "verified"' in path.read_text() for path in (root / "verdict").glob("*[0-9].json")),
    }
    assert [row["published"] for row in table(root, "funnel")] == [100, None, 65, None, None, 52, None]


def test_verdicts_equal_the_criteria_in_the_artefacts(root):
    found = {row["key"]: row for row in table(root, "verdicts")}
    documents = [json.loads(path.read_bytes()) for path in (root / "verdict").glob("*[0-9].json")]
    assert {document["key"] for document in documents} == set(found)
    for document in documents:
        values: dict[str, list[float]] = {}
        for criterion in document["criteria"]:
            if criterion["value"] is not None:
                values.setdefault(criterion["name"], []).append(criterion["value"])
        row = found[document["key"]]
        assert row["label"] == document["label"]
        assert row["contact_distance_m"] == pytest.approx(values["reported_distance"][0])
        assert row["judged_distance_m"] == pytest.approx(values["contact_distance"][0])
        harmful = [event["outcome"] for event in document["events"]]
        assert (row["events_reported"], row["events_happened"]) == (len(harmful), harmful.count("happened"))
        if "clock_error" in values:
            assert row["clock_error_max_positions"] == pytest.approx(max(values["clock_error"]))
        if "initial_speed_error" in values:
            assert row["speed_error_initial_max_rel"] == pytest.approx(max(map(abs, values["initial_speed_error"])))


def test_vehicles_and_classes_equal_the_records(root):
    vehicles = Counter(row["key"] for row in table(root, "vehicles"))
    classes = {row["key"]: row["collision_type"] for row in table(root, "crashes")}
    records = sorted((root / "crash_record").glob("*.parquet"))
    assert records
    for path in records:
        (row,) = table_from_parquet(path.read_bytes()).to_pylist()
        assert vehicles[row["key"]] == len(row["vehicles"])
        assert classes[row["key"]] == row["collision_type"]


def test_unknown_values_are_null_and_never_empty_text(root):
    with open_warehouse(root / "warehouse.duckdb") as connection:
        texts = connection.execute(
            "SELECT table_name, column_name FROM duckdb_columns() WHERE data_type = 'VARCHAR' AND NOT internal"
        ).fetchall()
        assert len(texts) > 100
        for name, column in texts:
            empty = connection.execute(f"SELECT count(*) FROM {name} WHERE {column} = ''").fetchall()
            assert empty == [(0,)], (name, column)


def test_codes_that_say_unknown_are_null_and_what_is_implied_is_named(root):
    crashes = {row["key"]: row for row in table(root, "crashes")}
    vehicles = {(row["key"], row["vehicle_number"]): row for row in table(root, "vehicles")}
    coded = (
        ("manner_of_collision", "MAN_COLL"),
        ("intersection_type", "TYP_INT"),
        ("first_harmful_event", "HARM_EV"),
        ("road_relation", "REL_ROAD"),
    )
    records = sorted((root / "crash_record").glob("*.parquet"))
    assert records
    for path in records:
        (record,) = table_from_parquet(path.read_bytes()).to_pylist()
        row = crashes[record["key"]]
        assert row["implied"] == record["implied"]
        for column, element in coded:
            code = record[f"{column}_code"]
            unknown = code is None or code in UNKNOWN[element]
            assert row[f"{column}_code"] == (None if unknown else code)
            assert bool(row[column]) is not unknown
        for vehicle in record["vehicles"]:
            said = vehicles[record["key"], vehicle["number"]]
            assert said["implied"] == vehicle["implied"]
            assert said["movement_code"] == (None if vehicle["movement"] == 99 else vehicle["movement"])
            assert said["initial_impact_code"] != 99


def test_usable_information_equals_a_count_over_the_records(root):
    reasons = {row["key"]: row["reason"] for row in table(root, "crashes")}
    counts: dict[tuple[str, int], Counter[str]] = {}
    for path in (root / "crash_record").glob("*.parquet"):
        (row,) = table_from_parquet(path.read_bytes()).to_pylist()
        if reasons[row["key"]] == "not_modelled":
            continue
        moving = [vehicle for vehicle in row["vehicles"] if vehicle["in_transport"]]
        counts.setdefault((row["kind"], len(moving)), Counter()).update(
            crashes=1,
            topology=reasons[row["key"]] != "incomplete_topology",
            trajectory=reasons[row["key"]] != "incomplete_trajectory",
            impact=all(vehicle["impact"] is not None for vehicle in moving),
            speed=all(vehicle["travel_speed_mps"] is not None for vehicle in moving),
        )
    found = {(row["kind"], row["vehicles"]): row for row in table(root, "usable_information")}
    assert found.keys() == counts.keys()
    for group, row in found.items():
        assert {name: row[name] for name in counts[group]} == dict(counts[group])


def test_coverage_counts_each_class_and_shows_the_empty_ones(root):
    coverage = {(row["dimension"], row["class"]): row for row in table(root, "coverage")}
    assert set(coverage) == {
        *(("collision_type", each.value) for each in CollisionType),
        *(("road_topology", each.value) for each in RoadTopology),
        *(("vehicle_trajectory", each.value) for each in VehicleTrajectory),
    }
    crashes = table(root, "crashes")
    for (dimension, name), row in coverage.items():
        of_class = [crash for crash in crashes if crash[dimension] == name]
        assert row["registered"] == len(of_class)
        assert row["verified"] == sum(crash["final_state"] == "verified" for crash in of_class)
    for dimension in ("collision_type", "road_topology", "vehicle_trajectory"):
        assert sum(row["published"] for (name, _), row in coverage.items() if name == dimension) == 52


def test_reasons_add_up_to_the_rejected_crashes(root):
    rejected = Counter(
        (crash["stage_reached"], crash["reason"])
        for crash in table(root, "crashes")
        if crash["final_state"] == "rejected"
    )
    found = {(row["stage"], row["reason"]): row["crashes"] for row in table(root, "failure_reasons")}
    assert found == rejected
    categories = {row["reason"]: row["published_category"] for row in table(root, "failure_reasons")}
    assert categories["incomplete_location"] == "incomplete information"
    assert categories["crash_off_road"] == "inconsistent crash location"


def test_a_reader_of_the_old_file_is_not_disturbed_by_a_rebuild(root):
    path = root / "warehouse.duckdb"
    with open_warehouse(path) as reader:
        before = reader.execute("SELECT count(*) FROM crashes").fetchall()
        inode = path.stat().st_ino
        build_warehouse(Storage(root), root)
        assert path.stat().st_ino != inode
        assert reader.execute("SELECT count(*) FROM crashes").fetchall() == before
    assert not list(root.glob(".building-*"))


def test_an_empty_root_gives_empty_tables(tmp_path):
    report = build_warehouse(Storage.open(tmp_path), tmp_path)
    assert report.rows["crashes"] == 0
    assert report.rows["coverage"] == 21
    assert [row["crashes"] for row in table(tmp_path, "funnel")] == [0] * 7


def test_object_store_root_gives_the_same_tables(root, tmp_path):
    remote = Storage.open("memory://bucket/warehouse")
    for path in root.glob("*/*"):
        if path.is_file() and path.parent.name not in ("dagster", "benchmark"):
            remote.write(str(path.relative_to(root)), path.read_bytes())
    build_warehouse(remote, tmp_path)
    assert remote.exists("warehouse.duckdb")
    for name in TABLES:
        assert table(tmp_path, name) == table(root, name), name


def test_sql_files_hold_what_their_names_say():
    folder = Path(__file__).resolve().parents[2] / "trace_dag/warehouse/sql"
    assert {path.stem for path in folder.glob("*.sql")} == set(TABLES)
    for path in folder.glob("*.sql"):
        made = re.findall(r"CREATE (?:TABLE|VIEW) (\w+)", path.read_text())
        assert made == [path.stem]


def test_records_of_an_older_version_lack_columns_of_their_vehicles_too():
    new = table_from_parquet((sample_runs.finished() / "crash_record/2023-319003.parquet").read_bytes())
    vehicles = [
        [{name: value for name, value in vehicle.items() if name != "keeps_left"} for vehicle in row]
        for row in new["vehicles"].to_pylist()
    ]
    kind = new.schema.field("vehicles").type.value_type
    older = pa.list_(pa.field("item", pa.struct([each for each in kind if each.name != "keeps_left"]), nullable=False))
    place = new.schema.get_field_index("vehicles")
    old = new.set_column(place, pa.field("vehicles", older), pa.array(vehicles, older))
    documents = [{(Stage.CRASH_RECORD, "parquet"): to_parquet(each)} for each in (old, new)]
    with duckdb.connect() as connection:
        tables = DocumentTables(connection)
        tables.add([CrashSnapshot(str(number), {}, {}, each) for number, each in enumerate(documents)])
        assert connection.sql("SELECT count(*) FROM crash_record").fetchall() == [(2,)]


def to_parquet(table: pa.Table) -> bytes:
    file = io.BytesIO()
    pq.write_table(table, file)
    return file.getvalue()
