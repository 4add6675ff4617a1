"""Releases of the benchmark: whole, counted, reproducible, never changed."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tarfile
import zipfile
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import sample_runs
from sample_runs import trace_dag

from trace_dag.common.errors import UserError
from trace_dag.export.release import ReleaseReport, build_release
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root of their own: these commands write."""
    return sample_runs.copy_finished(tmp_path_factory.mktemp("releasing") / "root")


@pytest.fixture(scope="module")
def verified(root: Path) -> list[str]:
    """Keys of the verified crashes."""
    return sorted(archive.stem for archive in (root / "benchmark" / "packages").glob("*.zip"))


def release(root: Path, output: Path, version: str = "1.0", **options: str) -> ReleaseReport:
    workspace = Workspace.open(str(root), FLOW)
    return build_release(workspace, version, output, **options)


@pytest.fixture(scope="module")
def released(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of version 1.0, its archive beside it."""
    output = tmp_path_factory.mktemp("releases")
    done = trace_dag(root, "release", "--version", "1.0", "--output", str(output), "--archive", "tar")
    assert done.returncode == 0, done.stderr
    assert "DATASHEET.md" in done.stdout  # where to look
    return output / "trace-dag-benchmark-1.0"


def test_a_release_is_whole(released: Path, verified: list[str]) -> None:
    listed = [line.split("  ") for line in (released / "SHA256SUMS").read_text().splitlines()]
    present = {str(file.relative_to(released)) for file in released.rglob("*") if file.is_file()}
    assert {name for _, name in listed} == present - {"SHA256SUMS"}
    for sha256, name in listed:
        assert hashlib.sha256((released / name).read_bytes()).hexdigest() == sha256
    table = pq.read_table(released / "index.parquet")
    assert json.loads(table.schema.metadata[b"geo"])["primary_column"] == "geometry"
    index = table.drop_columns(["geometry"]).to_pylist()
    assert [row["key"] for row in index] == verified
    assert index == json.loads((released / "index.json").read_bytes())["packages"]
    for row in index:
        assert zipfile.ZipFile(released / row["package"]).testzip() is None
        assert row["package_bytes"] == (released / row["package"]).stat().st_size
        assert row["collision_type"]
        assert row["kind"] == "two_vehicles"
        assert row["contact_distance_m"] < 5.0


def test_search_engines_and_archives_get_a_description(released: Path, verified: list[str]) -> None:
    croissant = json.loads((released / "croissant.json").read_bytes())
    index = pq.read_table(released / "index.parquet")
    fields = croissant["recordSet"][0]["field"]
    assert [each["source"]["extract"]["column"] for each in fields] == index.drop_columns(["geometry"]).column_names
    (file, packages) = croissant["distribution"]
    assert file["sha256"] == hashlib.sha256((released / "index.parquet").read_bytes()).hexdigest()
    assert len(list(released.glob(packages["includes"]))) == len(verified)
    datacite = json.loads((released / "datacite.json").read_bytes())
    assert datacite["publicationYear"] == croissant["datePublished"][:4]
    assert {each["rightsIdentifier"] for each in datacite["rightsList"]} == {"CC0-1.0"}
    card = (released / "README.md").read_text().split("---\n")[1]
    assert "license: cc0-1.0" in card
    assert "data_files: index.parquet" in card


def test_the_datasheet_counts_what_is_there(root: Path, released: Path, verified: list[str]) -> None:
    datasheet = (released / "DATASHEET.md").read_text()
    rows = json.loads(
        trace_dag(root, "sql", "SELECT final_state, count(*) AS n FROM crashes GROUP BY 1", "--format", "json").stdout
    )
    counts = {row["final_state"]: row["n"] for row in rows}
    assert f"{len(verified)} packages" in datasheet
    assert f"of the {sum(counts.values())} crashes registered" in datasheet
    assert f"{counts['verified']} verified, {counts.get('first_event_only', 0)} first event only, " in datasheet
    for question in ("Motivation", "Composition", "Collection", "Uses", "Known limits", "Distribution and maintenance"):
        assert f"## {question}" in datasheet
    reasons = re.findall(
        r"^\| [a-z ]+ \| [a-z ]+ \| (\d+) \|$",
        datasheet.partition("Why the others")[2].partition("**What does")[0],
        re.M,
    )
    assert sum(map(int, reasons)) == counts["rejected"]


def test_a_release_of_fictional_crashes_claims_no_real_ones(released: Path) -> None:
    for name in ("README.md", "DATASHEET.md", "CITATION.cff", "LICENSES.md"):
        text = (released / name).read_text()
        assert "fictional" in text, name
        assert "OpenStreetMap" not in text, name
    assert {row["map_attribution"] for row in pq.read_table(released / "index.parquet").to_pylist()} == {
        "fictional, CC0"
    }


def test_releases_are_the_same_byte_for_byte(root: Path, released: Path, tmp_path: Path) -> None:
    done = trace_dag(
        *(root, "release", "--version", "1.0", "--output", str(tmp_path), "--archive", "tar"), PYTHONHASHSEED="11"
    )
    assert done.returncode == 0, done.stderr
    first, second = (folder / "trace-dag-benchmark-1.0.tar" for folder in (released.parent, tmp_path))
    assert first.read_bytes() == second.read_bytes()


def test_an_interrupted_release_goes_on(root: Path, released: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(released, tmp_path / released.name)
    (folder / "SHA256SUMS").unlink()  # written last
    lost = next((folder / "packages").iterdir())
    lost.unlink()
    (folder / "packages" / "2023-1.zip").write_bytes(b"of an earlier attempt")
    assert release(root, tmp_path).written == 2
    assert lost.is_file()
    assert not (folder / "packages" / "2023-1.zip").exists()
    assert release(root, tmp_path).written == 0


def test_a_finished_release_is_not_changed(root: Path, released: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(released, tmp_path / released.name)
    sums = (folder / "SHA256SUMS").read_text()
    (folder / "SHA256SUMS").write_text(sums.replace(sums[:8], "00000000"))
    before = {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    with pytest.raises(UserError, match=r"1 file not the same.*choose another --version"):
        release(root, tmp_path)
    assert before == {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    assert release(root, tmp_path, "1.1").written == len(before)


def test_the_archive_holds_the_folder(root: Path, released: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(released, tmp_path / released.name)
    made = release(root, tmp_path, archive="zip").archive
    assert made is not None
    archive = zipfile.ZipFile(made)
    inside = {name: archive.read(name) for name in archive.namelist()}
    files = [file for file in folder.rglob("*") if file.is_file()]
    assert inside == {f"{folder.name}/{file.relative_to(folder)}": file.read_bytes() for file in files}
    with tarfile.open(released.with_name(f"{released.name}.tar")) as tar:
        assert {member.name for member in tar} == inside.keys()
        assert {(member.uid, member.uname, member.mtime) for member in tar} == {(0, "", 315532800)}


@pytest.mark.parametrize("version", ["../up", "one", "1.0 beta", ""])
def test_a_version_is_a_version(root: Path, tmp_path: Path, version: str) -> None:
    with pytest.raises(UserError, match="expected a version"):
        release(root, tmp_path / "out", version)
    assert not (tmp_path / "out").exists()


def test_only_one_cohort_can_be_released(root: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cohort 'other' is not registered"):
        release(root, tmp_path, cohort="other")
    assert release(root, tmp_path, cohort="sample").packages > 0


def test_a_root_without_crashes_has_nothing_to_release(tmp_path: Path) -> None:
    said = {("export",): "there is nothing there", ("release", "--version", "1"): "there is nothing there"}
    for command, expected in said.items():
        done = trace_dag(tmp_path / "empty", *command)
        assert done.returncode == 2
        assert expected in done.stderr


def test_a_definition_is_made_again_to_the_same_bytes_on_another_day(
    root: Path, released: Path, tmp_path: Path
) -> None:
    again = release(root, tmp_path, bench=released / "trace-bench.json").folder
    assert (again / "SHA256SUMS").read_bytes() == (released / "SHA256SUMS").read_bytes()


def test_a_definition_states_which_input_is_another(
    root: Path, released: Path, verified: list[str], tmp_path: Path
) -> None:
    given = json.loads((released / "trace-bench.json").read_bytes())
    given["crashes"][verified[0]]["report_sha256"] = "0"
    given["crashes"][verified[1]]["map_sha256"] = "0"
    given["crashes"]["2023-999999"] = given["crashes"][verified[0]]
    (tmp_path / "theirs.json").write_text(json.dumps(given))
    with pytest.raises(UserError) as refused:
        release(root, tmp_path, bench=tmp_path / "theirs.json")
    assert "not verified here: 2023-999999" in str(refused.value)
    assert f"another report: {verified[0]}" in str(refused.value)
    assert f"map files that differ around: {verified[1]}" in str(refused.value)


def test_a_definition_of_part_of_the_crashes_releases_those(
    root: Path, released: Path, verified: list[str], tmp_path: Path
) -> None:
    given = json.loads((released / "trace-bench.json").read_bytes())
    given["crashes"] = {verified[0]: given["crashes"][verified[0]]}
    (tmp_path / "theirs.json").write_text(json.dumps(given))
    made = release(root, tmp_path, bench=tmp_path / "theirs.json")
    assert (made.packages, made.missing) == (1, 0)


def test_crashes_are_weighed_by_national_tables(root: Path, verified: list[str], tmp_path: Path) -> None:
    """A country with as many crashes in daylight as in the dark, all of them of two vehicles."""
    rows = ["HARM_EV,VE_FORMS,TYP_INT,LGT_COND,FUNC_SYS", "12,2,1,1,3", "12,2,1,2,3"]
    (tmp_path / "accident.csv").write_text("\n".join(rows))
    made = release(root, tmp_path, national=[tmp_path / "accident.csv"])
    definition = json.loads((made.folder / "trace-bench.json").read_bytes())
    assert definition["weights"]["margins"]["light"] == {"dark": 1, "daylight": 1}
    weights = [each["weight"] for each in definition["crashes"].values()]
    assert sum(weights) / len(weights) == pytest.approx(1.0)
    assert definition["weights"]["effective_crashes"] <= len(verified)
