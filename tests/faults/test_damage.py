"""Damaged files below the root: nothing of them goes out, the rest does, and the remedy that is named works."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import duckdb
import pytest
from sample_runs import finished, trace_dag

from trace_dag.benchmark.export import export, verified_keys
from trace_dag.benchmark.release import build_release
from trace_dag.benchmark.verify import repair_benchmark, verify_benchmark
from trace_dag.cohorts.registry import Registry
from trace_dag.errors import DamagedFile, Failure
from trace_dag.flow.ledgers import not_as_listed, read_ledger, read_listed, write_ledger
from trace_dag.flow.stages import FLOW
from trace_dag.flow.verify import DisagreementKind, repair_storage, verify_storage
from trace_dag.flow.workspace import Workspace
from trace_dag.sealing import sealed, unsealed
from trace_dag.storage import Storage
from trace_dag.studies.controls import negative_controls
from trace_dag.studies.evaluations import all_rows
from trace_dag.studies.replays import replay
from trace_dag.studies.stored_crashes import stored_crash
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.query import query
from trace_dag.warehouse.verify import verify_warehouse

KEY, OTHER = "2023-319003", "2023-319022"  # verified
PACKAGE = f"benchmark/packages/{KEY}.zip"


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def overwrite(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 8)


Damage = Callable[[Path], None]
DAMAGES = pytest.mark.parametrize("damage", [flip, truncate, overwrite, Path.unlink])


@pytest.fixture(scope="module")
def packages() -> dict[str, bytes]:
    return {path.stem: path.read_bytes() for path in (finished() / "benchmark/packages").glob("*.zip")}


# --- seals and ledgers ---------------------------------------------------------------------------------------------
def test_a_seal_finds_every_flipped_bit_and_leaves_a_document_of_json() -> None:
    document = b'{\n "name": "a",\n "length_m": 4.5\n}'
    stored = sealed(document)
    assert json.loads(stored) | {"sha256": ""} == {"name": "a", "length_m": 4.5, "sha256": ""}
    assert json.loads(unsealed(stored, name="x.json")) == json.loads(document)
    assert json.loads(sealed(b"{}")).keys() == {"sha256"}
    for place in range(len(document) - 2):
        changed = bytearray(stored)
        changed[place] ^= 1
        with pytest.raises(DamagedFile, match=r"x\.json"):
            unsealed(bytes(changed), name="x.json")


@DAMAGES
def test_a_listed_file_is_read_only_as_it_was_written(tmp_path: Path, damage: Damage) -> None:
    storage = Storage(tmp_path)
    file = storage.write("evaluations/x.parquet", b"0123456789" * 50)
    write_ledger(storage, "evaluations/x", [file])
    assert read_listed(storage, "evaluations/x", file.name, remedy="do it") == b"0123456789" * 50
    assert not list(not_as_listed(storage, [file], contents=True))
    damage(tmp_path / file.name)
    assert [each.name for each, _ in not_as_listed(storage, [file], contents=True)] == [file.name]
    with pytest.raises(DamagedFile, match=r"evaluations/x\.parquet: damaged: .*; do it$"):
        read_listed(storage, "evaluations/x", file.name, remedy="do it")


@DAMAGES
def test_a_damaged_ledger_lets_nothing_out(tmp_path: Path, damage: Damage) -> None:
    storage = Storage(tmp_path)
    write_ledger(storage, "evaluations/x", [storage.write("evaluations/x.parquet", b"0")])
    damage(tmp_path / "ledgers/evaluations/x.json")
    with pytest.raises(DamagedFile, match="evaluations/x"):
        read_listed(storage, "evaluations/x", "evaluations/x.parquet", remedy="do it")
    heard: list[Failure] = []
    assert all_rows(storage, complain=heard.append) == []
    assert len(heard) == 1


# --- what goes out -------------------------------------------------------------------------------------------------
@DAMAGES
def test_a_damaged_map_costs_its_crash_and_no_other(root: Path, tmp_path: Path, damage: Damage) -> None:
    workspace = Workspace.open(str(root), FLOW)
    damage(root / f"road_map/{KEY}.xodr")
    heard: list[str] = []
    others = [key for key in verified_keys(workspace) if key != KEY]
    export(workspace, [KEY, others[0]], tmp_path / "out", "packages", complain=lambda each: heard.append(str(each)))
    assert [folder.name for folder in (tmp_path / "out").iterdir()] == others[:1]
    rows = negative_controls(workspace, "sample", most=2, complain=lambda each: heard.append(str(each)))
    assert all(row.key != KEY for row in rows)
    assert all(f"--only {KEY} --from road_map" in said for said in heard)
    with pytest.raises(DamagedFile, match=f"road_map/{KEY}.xodr: damaged"):
        replay(stored_crash(workspace, KEY), "html")


def test_the_command_names_the_crash_does_the_rest_and_its_remedy_works(root: Path, tmp_path: Path) -> None:
    whole = (root / f"road_map/{KEY}.xodr").read_bytes()
    flip(root / f"road_map/{KEY}.xodr")
    done = trace_dag(root, "export", "--output", str(tmp_path / "out"))
    assert done.returncode == 1
    (said,) = [line for line in done.stderr.splitlines() if line.startswith("failed:")]
    assert f"road_map/{KEY}.xodr: damaged" in said
    assert "Traceback" not in done.stderr
    remedy = said.rpartition("trace-dag ")[2].removesuffix(" makes it again").split()
    assert remedy == ["run", "--only", KEY, "--from", "road_map"]
    assert trace_dag(root, *remedy).returncode == 0
    assert (root / f"road_map/{KEY}.xodr").read_bytes() == whole
    assert KEY in verified_keys(Workspace.open(str(root), FLOW))
    assert trace_dag(root, "verify", "--contents").returncode == 0


@DAMAGES
def test_no_damaged_package_is_released(root: Path, tmp_path: Path, packages: dict[str, bytes], damage: Damage) -> None:
    damage(root / PACKAGE)
    workspace = Workspace.open(str(root), FLOW)
    made = build_release(workspace, "1.0", tmp_path)
    assert {path.stem: path.read_bytes() for path in (made.folder / "packages").iterdir()} == packages
    assert (root / PACKAGE).read_bytes() == packages[KEY], "made again"


def test_a_finished_release_is_put_right_before_it_is_archived(root: Path, tmp_path: Path, packages) -> None:
    workspace = Workspace.open(str(root), FLOW)
    made = build_release(workspace, "1.0", tmp_path)
    flip(made.folder / "packages" / f"{KEY}.zip")
    again = build_release(workspace, "1.0", tmp_path, archive="zip")
    assert again.written == 1
    assert again.archive is not None
    with zipfile.ZipFile(again.archive) as archive:
        assert archive.read(f"{made.folder.name}/packages/{KEY}.zip") == packages[KEY]


def test_a_release_waits_for_a_crash_that_cannot_be_packed(root: Path, tmp_path: Path, packages) -> None:
    flip(root / f"verdict/{KEY}.json")
    workspace = Workspace.open(str(root), FLOW)
    built = build_warehouse(workspace.storage, root)
    assert built.incomplete_crashes == {KEY}
    heard: list[Failure] = []
    unknown = built.incomplete_crashes
    made = build_release(workspace, "1.0", tmp_path, unknown=unknown, complain=heard.append)
    assert all(f"verdict/{KEY}.json: damaged" in str(each) for each in heard)
    assert (made.missing, made.packages) == (1, len(packages) - 1)
    assert not (made.folder / "SHA256SUMS").exists()


# --- the warehouse -------------------------------------------------------------------------------------------------
def change_rows(path: Path) -> None:
    with duckdb.connect(str(path)) as connection:
        connection.execute("UPDATE crashes SET final_state = 'verified', latitude_deg = 0.0")


def write_ahead(path: Path) -> None:
    path.with_name("warehouse.duckdb.wal").write_bytes(b"rows of somebody")


@pytest.mark.parametrize("damage", [flip, truncate, overwrite, change_rows, write_ahead])
def test_a_warehouse_that_is_not_as_it_was_built_says_nothing_and_is_built_again(root: Path, damage: Damage) -> None:
    warehouse, storage = root / "warehouse.duckdb", Storage(root)
    sql = "SELECT key, final_state, latitude_deg FROM crashes ORDER BY 1"
    before = query(warehouse, sql)
    damage(warehouse)
    with pytest.raises(DamagedFile, match="trace-dag verify --repair builds it again"):
        query(warehouse, sql)
    (found,) = verify_warehouse(warehouse, verify_storage(storage, root).records)
    assert found.kind is DisagreementKind.WAREHOUSE
    build_warehouse(storage, root)
    assert query(warehouse, sql) == before
    assert verify_warehouse(warehouse, verify_storage(storage, root).records) == []


@pytest.mark.parametrize("remedy", [("run",), ("verify", "--repair")])
def test_both_remedies_for_a_corrupt_warehouse_work(root: Path, remedy: tuple[str, ...]) -> None:
    overwrite(root / "warehouse.duckdb")
    asked = trace_dag(root, "sql", "FROM funnel")
    assert (asked.returncode, len(asked.stderr.splitlines())) == (1, 1)
    assert "Traceback" not in asked.stderr
    done = trace_dag(root, *remedy)
    assert done.returncode == 0, done.stderr
    assert trace_dag(root, "sql", "FROM funnel").returncode == 0


# --- verify --------------------------------------------------------------------------------------------------------
EVERYTHING = (
    (f"raw_report/{KEY}.xml", DisagreementKind.DAMAGED_ARTEFACT),
    (f"crash_record/{KEY}.parquet", DisagreementKind.DAMAGED_ARTEFACT),
    (f"osm_extract/{KEY}.osm.pbf", DisagreementKind.DAMAGED_ARTEFACT),
    (f"road_map/{KEY}.json", DisagreementKind.DAMAGED_ARTEFACT),
    (f"state_estimate/{KEY}.json", DisagreementKind.DAMAGED_ARTEFACT),
    (f"simulation_log/{KEY}.parquet", DisagreementKind.DAMAGED_ARTEFACT),
    (f"verdict/{KEY}.json", DisagreementKind.DAMAGED_ARTEFACT),
    (f"verdict/{OTHER}.outcome.json", DisagreementKind.UNREADABLE_RECORD),
    (f"pictures/{KEY}.png", DisagreementKind.DAMAGED_ARTEFACT),
    (PACKAGE, DisagreementKind.DAMAGED_PAGE),
    (f"benchmark/crashes/{KEY}.html", DisagreementKind.DAMAGED_PAGE),
    (f"benchmark/replays/{KEY}.js", DisagreementKind.DAMAGED_PAGE),
    ("benchmark/index.html", DisagreementKind.DAMAGED_PAGE),
    ("ledgers/benchmark.json", DisagreementKind.DAMAGED_PAGE),
)


def test_a_flipped_bit_in_any_kind_of_file_is_found_and_mended(root: Path) -> None:
    for name, _ in EVERYTHING[:-1]:
        flip(root / name)
    storage = Storage(root)
    report = verify_storage(storage, root, contents=True)
    found = {each.file: each.kind for each in (*report.disagreements, *verify_benchmark(storage, contents=True))}
    assert {name: found.get(name) for name, _ in EVERYTHING[:-1]} == dict(EVERYTHING[:-1])
    flip(root / "ledgers/benchmark.json")
    (damaged,) = verify_benchmark(storage, contents=True)
    assert (damaged.file, damaged.kind) == EVERYTHING[-1]
    repair_storage(storage, report)
    repair_benchmark(storage, [damaged])
    assert trace_dag(root, "run").returncode == 0
    done = trace_dag(root, "verify", "--contents")
    assert done.returncode == 0, done.stdout


def test_a_damaged_cohort_is_said_in_one_line_and_ingesting_again_mends_it(root: Path) -> None:
    (cohort,) = (root / "cohorts").iterdir()
    whole = Registry(Storage(root)).cohorts()["sample"]
    flip(cohort)
    with pytest.raises(DamagedFile, match="ingest the cohort again"):
        Registry(Storage(root)).cohorts()
    cohort.unlink()
    Registry(Storage(root)).register("sample", whole.reports, whole.maps)
    assert Registry(Storage(root)).cohorts()["sample"].reports == whole.reports


def test_every_file_of_the_benchmark_is_in_its_ledger() -> None:
    listed = read_ledger(Storage(finished()), "benchmark").files
    there = {str(path.relative_to(finished())) for path in (finished() / "benchmark").rglob("*") if path.is_file()}
    assert there == set(listed)
