"""The published coverage table on real reports: SQL on the warehouse against counts made without our reader."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.query import query

PUBLISHED = {
    ("collision_type", "angle"): 19,
    ("collision_type", "front_to_front"): 23,
    ("collision_type", "front_to_rear"): 3,
    ("collision_type", "sideswipe_opposite_direction"): 2,
    ("collision_type", "others"): 5,
    ("road_topology", "not_an_intersection"): 36,
    ("road_topology", "t"): 8,
    ("road_topology", "four_way"): 8,
    ("vehicle_trajectory", "same_direction"): 4,
    ("vehicle_trajectory", "opposite_direction"): 27,
    ("vehicle_trajectory", "turning"): 9,
    ("vehicle_trajectory", "intersecting"): 7,
    ("vehicle_trajectory", "others"): 5,
}
MANNERS = {"1": "front_to_rear", "2": "front_to_front", "6": "angle", "8": "sideswipe_opposite_direction"}
INTERSECTIONS = {"1": "not_an_intersection", "2": "four_way", "3": "t"}


def counted(path: Path) -> list[tuple[str, str]]:
    """The classes of a report, from its text and the code lists of the FARS manual alone."""
    text = path.read_text()
    acc_types = [int(code) for code in re.findall(r"<ACC_TYPE>(\d+)</ACC_TYPE>", text)]
    ranges = {
        "same_direction": range(20, 50),
        "opposite_direction": range(50, 68),
        "turning": range(68, 86),
        "intersecting": range(86, 92),
    }
    named = [name for code in acc_types[:2] for name, codes in ranges.items() if code in codes]
    manner, intersection = (re.findall(rf"<{field}>(\d+)</{field}>", text)[0] for field in ("MAN_COLL", "TYP_INT"))
    return [
        ("collision_type", MANNERS.get(manner, "others")),
        ("road_topology", INTERSECTIONS[intersection]),
        ("vehicle_trajectory", named[0] if named else "others"),
    ]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, shared_data: Path) -> Path:
    """The real reports that have a map, read."""
    root = tmp_path_factory.mktemp("coverage")
    ingest(Storage.open(root), "va-2023", reports=_mapped(shared_data))
    workspace = Workspace.open(str(root), FLOW, {"execution": {"executor": "in_process"}})
    events = list(
        run_stages(workspace, workspace.registry.keys(), [Stage.RAW_REPORT, Stage.CRASH_RECORD], run_id="coverage")
    )
    assert len(events) == 2 * 35
    assert not any(event.failed for event in events)
    build_warehouse(workspace.storage, root)
    return root


def _mapped(shared_data: Path) -> list[Path]:
    folder = shared_data / "va-2023"
    reports = [folder / "reports" / f"crash_{path.stem[4:]}.xml" for path in sorted((folder / "osm").glob("map_*.osm"))]
    assert len(reports) == 35
    return reports


def test_coverage_of_the_mapped_virginia_crashes_is_what_their_reports_say(root: Path, shared_data: Path) -> None:
    rows = query(root / "warehouse.duckdb", "SELECT dimension, class, registered FROM coverage")[1]
    found = Counter({(dimension, name): count for dimension, name, count in rows if count})
    assert found == Counter(pair for path in _mapped(shared_data) for pair in counted(path))
    assert {name: count for (dimension, name), count in found.items() if dimension == "road_topology"} == {
        "not_an_intersection": 25,
        "t": 7,
        "four_way": 3,
    }


def test_no_class_has_more_than_the_published_cases_of_which_these_are_a_part(root: Path) -> None:
    rows = query(root / "warehouse.duckdb", "SELECT dimension, class, registered, published FROM coverage")[1]
    assert {(dimension, name): published for dimension, name, _, published in rows if published} == PUBLISHED
    assert all(registered <= published for _, _, registered, published in rows)
