"""``trace_dag.open``: a root, a package and a release are read alike, and only what is asked for."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import sample_runs
import shapely
from PIL import Image

import trace_dag
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.reading.crashes import Crashes

VERIFIED, REJECTED_EARLY = "2023-319003", "2023-319061"


@pytest.fixture(scope="module")
def home() -> Crashes:
    return trace_dag.open(sample_runs.finished())


@pytest.fixture(scope="module")
def package() -> Path:
    return sample_runs.finished() / "benchmark" / "packages" / f"{VERIFIED}.zip"


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a release as a folder and as a tar."""
    base = tmp_path_factory.mktemp("released")
    root = sample_runs.copy_finished(base / "root")
    done = sample_runs.trace_dag(root, "release", "--version", "1.0", "--output", str(base), "--archive", "tar")
    assert done.returncode == 0, done.stderr
    return base


def test_a_root_is_a_mapping_of_all_registered_crashes_with_their_table(home):
    assert sorted(home) == sorted(sample_runs.KEYS)
    assert sorted(home.crashes.index) == sorted(sample_runs.KEYS)
    assert home.crashes.loc[VERIFIED, "final_state"] == "verified"
    assert home[VERIFIED].verdict.accepted
    with pytest.raises(KeyError, match="2023-1"):
        home["2023-1"]


def test_grade_and_change_of_velocity_have_one_name_in_a_root_a_package_and_a_release(home, package, released):
    names = ["grade", "contact_distance_m", "delta_v_max_mps", "delta_v_max_mph", "events_reported", "events_happened"]
    of_root = home.crashes.loc[VERIFIED, names]
    assert of_root["delta_v_max_mph"] == pytest.approx(of_root["delta_v_max_mps"] * 3600 / 1609.344)
    for place in (package, released / "trace-dag-benchmark-1.0"):
        found = trace_dag.open(place)
        assert found.crashes.loc[VERIFIED, names].to_dict() == pytest.approx(of_root.to_dict())
        assert found.sql(f"SELECT grade FROM crashes WHERE key = '{VERIFIED}'").df()["grade"].tolist() == [
            of_root["grade"]
        ]


def test_questions_in_sql_come_as_pandas_and_as_arrow(home):
    answer = home.sql("SELECT key, accepted FROM verdicts WHERE key = '2023-319003'")
    assert answer.df().to_dict("records") == [{"key": VERIFIED, "accepted": True}]
    assert answer.to_arrow_table().num_rows == 1
    with pytest.raises(UserError, match="no_such_table"):
        home.sql("FROM no_such_table")


def test_a_root_is_asked_by_two_homes_and_many_threads(home):
    with ThreadPoolExecutor(8) as pool:
        homes = [home, *pool.map(lambda _: trace_dag.open(home.place), range(8))]
        counts = pool.map(lambda each: len(each.sql("FROM judged_crashes").df()), 5 * homes)
        assert set(counts) == {len(home)}


def test_steps_are_the_log_row_by_row_with_units(home):
    crash = home[VERIFIED]
    steps, log = crash.steps, crash.log
    for vehicle in log.vehicles:
        rows = steps[steps["vehicle_number"] == vehicle.number]
        np.testing.assert_array_equal(rows["x_m"], vehicle.x_m)
        np.testing.assert_array_equal(rows["speed_mps"], vehicle.speed_mps)
    assert isinstance(crash.steps_arrow, pa.Table)
    assert crash.steps_arrow.schema.field("x_m").metadata[b"unit"] == b"m"
    assert list(crash.contacts["time_s"]) == [each.time_s for each in log.contacts]
    assert len(crash.criteria) == len(crash.verdict.criteria)


def test_lanes_are_shapes_whose_links_hold_on_the_ground(home):
    crash = home[VERIFIED]
    lanes, network = crash.lanes, crash.road_map
    drivable = [ref for ref in lanes.index if network.is_drivable(ref)]
    followed = [(ref, after) for ref in drivable for after in lanes.loc[[ref], "successors"].iloc[0]]
    assert followed
    centre = lanes["centre"].to_dict()
    for ref, after in followed:
        ends, begins = shapely.Point(centre[ref].coords[-1]), shapely.Point(centre[after].coords[0])
        assert ends.distance(begins) < 0.5, (ref, after)
    for ref in drivable:
        assert lanes.at[ref, "surface"].buffer(0.01).covers(centre[ref])


def test_a_graph_of_lanes_has_an_edge_for_each_way_on(home):
    graph, lanes = home[VERIFIED].lane_graph(), home[VERIFIED].lanes
    onward = [(one, two) for one, two, kind in graph.edges(data="kind") if kind == "successor"]
    assert sorted(onward) == sorted((ref, after) for ref in graph for after in lanes.at[ref, "successors"])
    for one, two, kind in graph.edges(data="kind"):
        if kind in ("left", "right"):  # the first point of the lane beside is on that side of the first metres
            (x0, y0, _), (x1, y1, _) = graph.nodes[one]["centre"].coords[:2]
            x, y, _ = graph.nodes[two]["centre"].coords[0]
            assert ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0) == (kind == "left")


def test_without_networkx_the_graph_names_what_to_install(home, monkeypatch):
    monkeypatch.setitem(sys.modules, "networkx", None)
    with pytest.raises(UserError, match=r"trace-dag\[graph\]"):
        home[VERIFIED].lane_graph()


def test_a_package_gives_the_same_crash_without_its_root(home, package, tmp_path):
    zipfile.ZipFile(package).extractall(tmp_path)
    stored = home[VERIFIED]
    for place in (package, str(tmp_path / VERIFIED)):
        crash = trace_dag.open(place).only
        assert crash.key == VERIFIED
        assert crash.report == stored.report
        assert crash.record == stored.record
        assert crash.verdict == stored.verdict
        assert crash.map_report == stored.map_report
        assert crash.lanes.index.equals(stored.lanes.index)
        assert [each.impact_time_s for each in crash.estimate.hypotheses] == [
            each.impact_time_s for each in stored.estimate.hypotheses
        ]
        assert_the_same_motion(crash.log, stored.log)
        assert crash.intervals.equals(stored.intervals)
        assert crash.likely_courses.equals(stored.likely_courses)


def test_intervals_hold_a_row_per_party_and_quantity_in_order_of_size(home):
    intervals = home[VERIFIED].intervals
    speeds = intervals[intervals["quantity"] == "impact_speed"]
    assert sorted(speeds["party"]) == [vehicle.number for vehicle in home[VERIFIED].log.vehicles]
    assert (intervals["low"] <= intervals["middle"]).all()
    assert (intervals["middle"] <= intervals["high"]).all()


def test_likely_courses_come_with_the_heaviest_first(home):
    courses = home[VERIFIED].likely_courses
    weights = courses.groupby("course")["weight"].first()
    assert list(weights.index) == [1, 2, 3]
    assert weights.is_monotonic_decreasing
    assert set(courses["number"]) == {vehicle.number for vehicle in home[VERIFIED].log.vehicles}
    assert courses["time_s"].min() == pytest.approx(-3.0)
    assert courses["time_s"].max() > 0.5


def assert_the_same_motion(one, two):
    """To the micrometre, which is what a package writes."""
    assert (one.termination, one.backend, one.bodies) == (two.termination, two.backend, two.bodies)
    assert [vehicle.number for vehicle in one.vehicles] == [vehicle.number for vehicle in two.vehicles]
    for a, b in zip(one.vehicles, two.vehicles, strict=True):
        for name in ("time_s", "x_m", "y_m", "heading_rad", "landmarks_m"):
            np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=1e-6)
    for a, b in zip(one.contacts, two.contacts, strict=True):
        assert (a.number_1, a.number_2) == (b.number_1, b.number_2)
        assert a.time_s == pytest.approx(b.time_s, abs=1e-6)


@pytest.mark.parametrize("form", ["trace-dag-benchmark-1.0", "trace-dag-benchmark-1.0.tar"])
def test_a_release_is_read_as_a_folder_and_as_an_archive(form, released, home):
    release = trace_dag.open(released / form)
    verified = home.crashes.query("final_state == 'verified'")
    assert list(release) == list(verified.index)
    assert release.crashes.loc[VERIFIED, "kind"] == verified.loc[VERIFIED, "kind"]
    assert release[VERIFIED].verdict == home[VERIFIED].verdict
    assert release.sql("SELECT count(*) FROM crashes").fetchall() == [(len(verified),)]
    with pytest.raises(UserError, match="by its key"):
        _ = release.only


def test_pictures_and_replays_are_made_from_a_package(package, tmp_path):
    crash = trace_dag.open(package).only
    picture = crash.figure()
    assert isinstance(picture, Image.Image)
    assert np.asarray(picture).std() > 10, "something is drawn"
    page = crash.replay()
    assert page.save(tmp_path / "replay.html").read_bytes() == page.content
    assert page._repr_html_().startswith("<div><iframe srcdoc=")
    moving = Image.open(io.BytesIO(crash.replay("webp").content))
    assert moving.n_frames > 10


def test_a_notebook_shows_roots_crashes_and_logs_in_few_words(home, package):
    key = next(key for key in home if home[key].has("verdict"))
    for crashes in (home, trace_dag.open(package)):
        assert crashes._repr_html_().startswith(f"<p>&lt;{type(crashes).__name__} ")
        assert "<th>kind</th>" in crashes._repr_html_()
    assert home[key]._repr_html_().startswith(f"<p><b>{key}</b>, ")
    assert len(repr(home[key].log)) < 500
    assert len(repr(home[key].replay())) < 200


def test_stages_that_a_crash_did_not_reach_are_named(home):
    crash = home[REJECTED_EARLY]
    assert not crash.has("verdict")
    with pytest.raises(UserError, match=f"{REJECTED_EARLY} has no verdict"):
        _ = crash.verdict
    with pytest.raises(UserError, match="no part 'verdikt'"):
        crash.has("verdikt")


def test_a_damaged_file_of_a_package_is_found_when_it_is_read_and_not_before(package, tmp_path):
    zipfile.ZipFile(package).extractall(tmp_path)
    folder = tmp_path / VERIFIED
    (folder / "trajectories.json").write_bytes(b"{}")
    (folder / "states.json").unlink()
    crash = trace_dag.open(folder).only
    assert crash.verdict.accepted
    with pytest.raises(DamagedFile, match=r"trajectories\.json.*differs from the manifest"):
        _ = crash.log
    with pytest.raises(DamagedFile, match=r"states\.json.*it is not there"):
        _ = crash.estimate


def test_a_path_that_is_no_root_package_or_release_is_named(tmp_path):
    (tmp_path / "notes.txt").write_text("no archive")
    (tmp_path / "empty").mkdir()
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("other/notes.txt", "no package")
    for name, said in (
        ("notes.txt", "neither a zip nor a tar"),
        ("empty", "no storage root"),
        ("other.zip", "an archive without"),
        ("nowhere", "there is nothing"),
    ):
        with pytest.raises(UserError, match=said):
            trace_dag.open(tmp_path / name)


def test_neither_dagster_nor_a_heavy_library_is_loaded_before_it_is_needed():
    code = (
        "import sys, trace_dag\n"
        "heavy = {'numpy', 'pandas', 'duckdb', 'pydantic'} & sys.modules.keys()\n"
        f"home = trace_dag.open({str(sample_runs.finished())!r})\n"
        f"home.crashes, home[{VERIFIED!r}].lanes, home[{VERIFIED!r}].steps\n"
        "sys.exit(bool(heavy) or any(name.split('.')[0] == 'dagster' for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
