"""Damaged files below the root: nothing of them goes out, the rest does, and the remedy that is named works."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import duckdb
import pytest
from sample_runs import finished, trace_dag

from trace_dag.agents.evaluations import all_rows
from trace_dag.agents.replays import replay
from trace_dag.common.errors import DamagedFile, Failure
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage
from trace_dag.export.build import verify_benchmark
from trace_dag.export.export import accepted_keys, export
from trace_dag.export.release import build_release
from trace_dag.flow.batch import first_stale
from trace_dag.flow.cohorts.registry import Registry
from trace_dag.flow.controls import negative_controls
from trace_dag.flow.manifests import list_files, not_as_listed, read_listed, read_manifest
from trace_dag.flow.stages import FLOW
from trace_dag.flow.stored_crashes import stored_crash
from trace_dag.flow.verify import DisagreementKind, verify_storage
from trace_dag.flow.workspace import Workspace
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


# --- checksums and manifests ---------------------------------------------------------------------------------------
def test_a_checksum_finds_every_flipped_bit_and_leaves_a_document_of_json() -> None:
    document = b'{\n "name": "a",\n "length_m": 4.5\n}'
    stored = add_checksum(document)
    assert json.loads(stored) | {"checksum": ""} == {"name": "a", "length_m": 4.5, "checksum": ""}
    assert check_document(stored, name="x.json") == json.loads(document)
    for place in range(len(stored)):
        for bit in range(8):
            changed = bytearray(stored)
            changed[place] ^= 1 << bit
            with pytest.raises(DamagedFile, match=r"x\.json"):
                check_document(bytes(changed), name="x.json")


@DAMAGES
def test_a_listed_file_is_read_only_as_it_was_written(tmp_path: Path, damage: Damage) -> None:
    storage = Storage(tmp_path)
    file = storage.write("evaluations/x.parquet", b"0123456789" * 50)
    list_files(storage, "evaluations", [file])
    assert read_listed(storage, file.name, remedy="do it") == b"0123456789" * 50
    assert not list(not_as_listed(storage, [file], contents=True))
    damage(tmp_path / file.name)
    assert [each.name for each, _ in not_as_listed(storage, [file], contents=True)] == [file.name]
    with pytest.raises(DamagedFile, match=r"evaluations/x\.parquet: damaged: .*; do it$"):
        read_listed(storage, file.name, remedy="do it")


@DAMAGES
def test_a_damaged_manifest_lets_nothing_out(tmp_path: Path, damage: Damage) -> None:
    storage = Storage(tmp_path)
    list_files(storage, "evaluations", [storage.write("evaluations/x.parquet", b"0")])
    damage(tmp_path / "evaluations/manifest.json")
    with pytest.raises(DamagedFile, match="evaluations/"):
        read_listed(storage, "evaluations/x.parquet", remedy="do it")
    heard: list[Failure] = []
    assert all_rows(storage, on_problem=heard.append) == []
    assert len(heard) == 1


# --- what goes out -------------------------------------------------------------------------------------------------
@DAMAGES
def test_a_damaged_map_costs_its_crash_and_no_other(root: Path, tmp_path: Path, damage: Damage) -> None:
    workspace = Workspace.open(str(root), FLOW)
    damage(root / f"road_map/{KEY}.xodr")
    heard: list[str] = []
    others = [key for key in accepted_keys(workspace) if key != KEY]
    export(workspace, [KEY, others[0]], tmp_path / "out", "packages", on_problem=lambda each: heard.append(str(each)))
    assert [folder.name for folder in (tmp_path / "out").iterdir()] == others[:1]
    rows = negative_controls(workspace, "sample", most=2, on_problem=lambda each: heard.append(str(each)))
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
    assert KEY in accepted_keys(Workspace.open(str(root), FLOW))
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
    made = build_release(workspace, "1.0", tmp_path, unknown=unknown, on_problem=heard.append)
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
def test_a_changed_warehouse_is_built_again(root: Path, damage: Damage) -> None:
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
    (f"pictures/{KEY}.png", DisagreementKind.DAMAGED_PICTURE),
    (PACKAGE, DisagreementKind.DAMAGED_PAGE),
    (f"benchmark/crashes/{KEY}.html", DisagreementKind.DAMAGED_PAGE),
    (f"benchmark/replays/{KEY}.js", DisagreementKind.DAMAGED_PAGE),
    ("benchmark/index.html", DisagreementKind.DAMAGED_PAGE),
    ("cohorts/sample.parquet", DisagreementKind.LOST_COHORT),
    ("cohorts/copies/sample.parquet", DisagreementKind.LOST_COHORT),
    ("benchmark/manifest.json", DisagreementKind.DAMAGED_PAGE),
    ("cache/warehouse.json", DisagreementKind.DAMAGED_CACHE),
)


def look(root: Path) -> dict[str | None, DisagreementKind]:
    storage = Storage(root)
    report = verify_storage(storage, root, contents=True)
    return {each.file: each.kind for each in (*report.disagreements, *verify_benchmark(storage, contents=True))}


def test_a_flipped_bit_in_any_kind_of_file_is_found_whatever_else_is_damaged(root: Path) -> None:
    for name, kind in EVERYTHING:
        if not name.startswith("cohorts/"):
            flip(root / name)
            assert look(root).get(name) is kind, name
    found = look(root)
    assert {name: found.get(name) for name, _ in EVERYTHING} == {
        name: None if name.startswith("cohorts/") else kind for name, kind in EVERYTHING
    }
    for name in ("cohorts/sample.parquet", "cohorts/copies/sample.parquet"):
        whole = (root / name).read_bytes()
        flip(root / name)
        assert look(root)[name] is DisagreementKind.LOST_COHORT
        (root / name).write_bytes(whole)


def test_one_repair_and_one_run_bring_a_damaged_root_back(root: Path) -> None:
    """Damage of ten kinds at once, a lost list of crashes and a record of the first stage among them."""
    records = [f"raw_report/{KEY}.outcome.json", f"crash_record/{OTHER}.outcome.json"]
    artefacts = [name for name, _ in EVERYTHING[:7]]
    made = [PACKAGE, f"pictures/{OTHER}.png", "benchmark/index.html", "cohorts/sample.parquet"]
    before = {name: (root / name).read_bytes() for name in (*artefacts, *made)}
    pictures = {path: path.read_bytes() for path in (root / "pictures").iterdir()}
    for name in (*artefacts, *made[:-1]):
        flip(root / name)
    for name in records:
        truncate(root / name)
    (root / "cohorts/sample.parquet").unlink()
    assert trace_dag(root, "verify", "--contents", "--repair").returncode == 1, "stages are to be run again"
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr
    assert {name: (root / name).read_bytes() for name in before} == before
    assert {path: path.read_bytes() for path in pictures} == pictures
    (aside,) = (root / "quarantine").glob("*/list.json")
    assert set(records) <= json.loads(aside.read_bytes()).keys()
    again = trace_dag(root, "verify", "--contents")
    assert again.returncode == 0, again.stdout


def test_crashes_whose_cohorts_are_lost_with_their_copies_are_registered_from_their_records(root: Path) -> None:
    before = Registry(Storage(root)).cohorts()["sample"]
    shutil.rmtree(root / "cohorts")
    said = trace_dag(root, "verify")
    assert said.returncode == 1
    assert "no cohort is registered" in said.stdout
    assert "1 disagreement: 1 lost cohorts" in said.stdout, "what follows from it is not listed crash by crash"
    repaired = trace_dag(root, "verify", "--repair")
    (recovered,) = Registry(Storage(root)).cohorts().values()
    not_released = "2023-319061"  # whose report is an answer without a case, kept nowhere
    assert before.reports.keys() - recovered.reports.keys() == {not_released}
    assert f"nothing is kept of the report: {not_released}; ingest it again" in repaired.stderr
    workspace = Workspace.open(str(root), FLOW)
    assert first_stale(workspace, workspace.registry.keys()) == {}, "nothing has to be made again"


@pytest.mark.parametrize("damage", [flip, Path.unlink])
def test_a_lost_cohort_is_reported_in_one_line_and_comes_back_from_its_copy(root: Path, damage: Damage) -> None:
    cohort = root / "cohorts/sample.parquet"
    whole = cohort.read_bytes()
    damage(cohort)
    said = trace_dag(root, "status")
    assert (said.returncode, len(said.stderr.splitlines())) == (1, 1)
    assert "cohorts/sample.parquet" in said.stderr
    assert trace_dag(root, "verify", "--repair").returncode == 0
    assert cohort.read_bytes() == whole


def test_every_file_of_the_benchmark_is_in_its_manifest() -> None:
    listed = read_manifest(Storage(finished()), "benchmark").files
    there = {str(path.relative_to(finished())) for path in (finished() / "benchmark").rglob("*") if path.is_file()}
    assert there == {*listed, "benchmark/manifest.json"}
