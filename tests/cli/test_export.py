"""Packages, as somebody gets them who does not have this program."""

from __future__ import annotations

import hashlib
import html
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import sample_runs
from sample_runs import trace_dag

from tests.roads.judges import official_check
from tests.scenario.player import Scenario
from trace_dag.common.errors import UserError
from trace_dag.export.export import accepted_keys, export
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace

EVERY_PACKAGE = {
    *("README.md", "LICENSES.md", "manifest.json", "provenance.json"),
    *("report.xml", "summary.txt", "map.osm", "map.xodr", "map_legal_marks.xodr"),
    *("scenario.xosc", "scenario.free_V1.xosc", "scenario.free_V2.xosc"),
    *("scenario.conflict_V1.xosc", "scenario.conflict_V2.xosc"),
    *("scenario.carla.xosc", "scenario.carla.free_V1.xosc", "scenario.carla.free_V2.xosc"),
    *(
        "states.json",
        "intervals.json",
        "trajectories.json",
        "verdict.json",
        "map_report.json",
        "replay.html",
        "picture.png",
    ),
    *("lanes.json", "courses.json", "ensemble.json"),
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root of their own: these commands write."""
    return sample_runs.copy_finished(tmp_path_factory.mktemp("exporting") / "root")


@pytest.fixture(scope="module")
def packages(root: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The packages of the verified crashes, unpacked, by key."""
    folder = tmp_path_factory.mktemp("packages")
    archives = sorted((root / "benchmark" / "packages").glob("*.zip"))
    assert archives
    for archive in archives:
        zipfile.ZipFile(archive).extractall(folder)
    return {archive.stem: folder / archive.stem for archive in archives}


def test_a_package_has_everything_and_its_checksums_hold(packages: dict[str, Path]) -> None:
    for key, folder in packages.items():
        lit = b"<TrafficSignalController" in (folder / "scenario.xosc").read_bytes()
        expected = EVERY_PACKAGE | ({"lights.json"} if lit else set())
        assert {file.name for file in folder.iterdir()} == expected
        manifest = json.loads((folder / "manifest.json").read_bytes())
        assert manifest["key"] == key
        assert manifest["files"].keys() == expected - {"manifest.json"}
        for name, stated in manifest["files"].items():
            data = (folder / name).read_bytes()
            assert (stated["bytes"], stated["sha256"]) == (len(data), hashlib.sha256(data).hexdigest())


def test_a_package_explains_itself(packages: dict[str, Path]) -> None:
    for key, folder in packages.items():
        readme = (folder / "README.md").read_text()
        assert key in readme
        shown = html.unescape(readme.replace("\\", ""))  # as a reader of the Markdown sees it
        assert " ".join((folder / "summary.txt").read_text().split()) in shown
        for name in EVERY_PACKAGE - {"README.md"}:
            assert f"`{name}`" in readme, name
        licences = (folder / "LICENSES.md").read_text()
        assert 'attribution="fictional, CC0"' in (folder / "map.osm").read_text()[:400]
        assert "fictional, CC0" in licences
        for name in ("README.md", "LICENSES.md"):
            assert "such crash has happened" in (folder / name).read_text()
            assert "OpenStreetMap" not in (folder / name).read_text()
        stated = json.loads((folder / "manifest.json").read_bytes())["files"]
        assert {each["licence"] for each in stated.values()} == {"CC0-1.0"}


def test_a_package_states_nothing_of_the_machine(packages: dict[str, Path], root: Path) -> None:
    """No path of this machine, absolute or of the user, and nothing that looks like a key."""
    told = re.compile(
        rb"(?<![\w.:/-])/(?:home|root|tmp|work|Users|usr|var)/|[A-Z]:\\\\|api[_-]?key|token=|sk-[A-Za-z0-9]{16}"
    )
    for folder in packages.values():
        for file in folder.iterdir():
            data = file.read_bytes()
            assert str(root).encode() not in data
            if file.suffix not in (".png", ".html"):
                assert not told.search(data), (file.name, told.search(data))


def test_scenarios_say_what_the_trajectories_say(packages: dict[str, Path]) -> None:
    """Within 1 cm at every logged moment, and the collision within 0.1 s and 0.5 m of the contact."""
    for folder in packages.values():
        stated = json.loads((folder / "trajectories.json").read_bytes())
        for name in ("scenario.xosc", "scenario.carla.xosc"):
            scenario = Scenario((folder / name).read_bytes())
            assert scenario.vertices.keys() == {f"V{number}" for number in stated["vehicles"]}
            for number, vehicle in stated["vehicles"].items():
                x, y, _ = scenario.centres(f"V{number}", np.array(vehicle["time_s"])).T
                assert np.hypot(x - vehicle["x_m"], y - vehicle["y_m"]).max() < 0.01
                box = scenario.boxes[f"V{number}"]
                assert box.length_m == pytest.approx(vehicle["body"]["length_m"], abs=0.01)
        contact = stated["contacts"][0]
        collision = Scenario((folder / "scenario.xosc").read_bytes()).play(step_s=0.001)
        assert collision is not None
        assert collision.time_s == pytest.approx(contact["time_s"], abs=0.1)
        for number in (1, 2):
            x, y, _ = scenario.centres(f"V{contact[f'number_{number}']}", np.array([collision.time_s]))[0]
            pose = contact[f"pose_{number}"]
            assert np.hypot(x - pose["x_m"], y - pose["y_m"]) < 0.5


def test_maps_lie_where_the_scenarios_look(packages: dict[str, Path]) -> None:
    for folder in packages.values():
        scenarios = list(folder.glob("*.xosc"))
        assert scenarios
        for scenario in scenarios:
            named = Scenario(scenario.read_bytes()).root.find("RoadNetwork/LogicFile").get("filepath")
            assert (folder / named).is_file()
        # ScenarioRunner cuts the map's text at its root element, which therefore has no attributes.
        assert b"<OpenDRIVE>" in (folder / "map.xodr").read_bytes()


def test_the_official_checkers_find_nothing(packages: dict[str, Path]) -> None:
    folder = next(iter(packages.values()))
    files = [*sorted(folder.glob("*.xosc")), *sorted(folder.glob("*.xodr"))]
    found = official_check(files)
    assert len(found) == len(files) > 1
    for checked in found:
        assert checked["issues"] == [], checked["file"]
        assert checked["broken"] == []
        schema = "xosc" if checked["file"].endswith(".xosc") else "xodr"
        assert f"check_asam_{schema}_xml_valid_schema" in checked["rules"]


def test_another_process_makes_the_same_bytes(root: Path, packages: dict[str, Path], tmp_path: Path) -> None:
    key = next(iter(packages))
    done = trace_dag(root, "export", "--only", key, "--output", str(tmp_path), PYTHONHASHSEED="7", TZ="Asia/Tokyo")
    assert done.returncode == 0, done.stderr
    for name in EVERY_PACKAGE:
        assert (tmp_path / key / name).read_bytes() == (packages[key] / name).read_bytes(), name
    rezipped = (
        "import sys; from pathlib import Path; from trace_dag.export.package import zip_files;"
        "folder = Path(sys.argv[1]);"
        "sys.stdout.buffer.write(zip_files({f.name: f.read_bytes() for f in folder.iterdir()}, folder=folder.name))"
    )
    made = subprocess.run([sys.executable, "-c", rezipped, str(packages[key])], capture_output=True, check=True).stdout
    assert made == (root / "benchmark" / "packages" / f"{key}.zip").read_bytes()


def test_existing_exports_are_kept(root: Path, packages: dict[str, Path], tmp_path: Path) -> None:
    workspace, key = Workspace.open(str(root), FLOW), next(iter(packages))
    heard: list[str] = []
    written = export(workspace, [key], tmp_path, "openlabel", told=heard.append)
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert (written, heard) == (len(files), [key])
    files[0].write_bytes(b"damaged")
    assert export(workspace, [key], tmp_path, "openlabel") == 1
    assert export(workspace, [key], tmp_path, "openlabel") == 0


def test_the_tool_that_reads_chooses_the_form(root: Path, packages: dict[str, Path], tmp_path: Path) -> None:
    key = min(packages)
    trace_dag(root, "export", "--for", "geopandas", "--only", key, "--output", str(tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["crashes.gpx", "crashes.parquet"]
    both = trace_dag(root, "export", "--for", "sumo", "--format", "osi")
    assert both.returncode == 2
    assert "leave one out" in both.stderr


def test_only_verified_crashes_are_exported(root: Path) -> None:
    workspace = Workspace.open(str(root), FLOW)
    rejected = sorted(set(workspace.registry.keys()) - set(accepted_keys(workspace)))
    assert rejected
    with pytest.raises(UserError, match=f"{rejected[0]}: not accepted"):
        accepted_keys(workspace, only=[rejected[0]])
    with pytest.raises(UserError, match="is not a crash key"):
        accepted_keys(workspace, only=["2023-319003/../../x"])
