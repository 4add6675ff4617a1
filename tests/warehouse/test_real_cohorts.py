"""Both real cohorts in one root: tables and page against counts made from the artefacts alone.

Some crashes of each are run here. With ``TRACE_DAG_FINISHED_ROOT`` the counts are made over a finished root instead, of
which nothing is changed but a copy.
"""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from lxml import html

from trace_dag.common.errors import Reason
from trace_dag.common.schemas import table_from_parquet
from trace_dag.common.stage import Stage
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.export.build import build_benchmark
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.sources import TableSource
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.query import rows

IN_PROCESS = {"execution": {"executor": "in_process", "pictures": False}}
DIMENSIONS = ("collision_type", "road_topology", "vehicle_trajectory")
MARICOPA = Choice(CohortFilter(box=(32.9, -112.15, 33.15, -111.9)), sample=7)
VIRGINIA = Choice(sample=5)

Outcomes = dict[str, dict[Stage, dict]]


@pytest.fixture(scope="module")
def root(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("real") / "root"
    finished = os.environ.get("TRACE_DAG_FINISHED_ROOT")
    if finished:
        shutil.copytree(finished, root)
    workspace = Workspace.open(str(root), FLOW)
    workspace = workspace.with_settings(IN_PROCESS)
    if not finished:
        virginia, arizona = shared_data / "va-2023", shared_data / "osm" / "maricopa-az.osm.pbf"
        ingest(workspace.storage, "va-2023", reports=[virginia / "reports"], maps=[virginia / "osm"], choice=VIRGINIA)
        ingest(
            workspace.storage,
            "fars",
            tables=[TableSource.of_plugin("fars-csv", str(shared_data / "fars-csv"))],
            maps=[arizona],
            choice=MARICOPA,
        )
        list(run_stages(workspace, workspace.registry.keys(), run_id="real"))
    build_warehouse(workspace.storage, root)
    report = build_benchmark(workspace)
    assert report.errors == {}
    return root


@pytest.fixture(scope="module")
def registered(root: Path) -> set[str]:
    return {key for path in (root / "cohorts").glob("*.parquet") for key in pq.read_table(path)["key"].to_pylist()}


@pytest.fixture(scope="module")
def outcomes(root: Path) -> Outcomes:
    """What the records on disk say, by crash and stage."""
    found: Outcomes = {}
    for stage in Stage:
        for path in (root / stage).glob("*.outcome.json"):
            found.setdefault(path.name.removesuffix(".outcome.json"), {})[stage] = json.loads(path.read_text())
    return found


@pytest.fixture(scope="module")
def page(root: Path) -> html.HtmlElement:
    return html.fromstring((root / "benchmark" / "index.html").read_text(encoding="utf-8"))


def ends(outcomes: Outcomes, key: str) -> tuple[str, Stage | None, str | None]:
    """Final state, stage and reason of a crash by its last record."""
    if key not in outcomes:
        return "pending", None, None
    last = max(outcomes[key], key=lambda stage: stage.position)
    record = outcomes[key][last]
    if record["outcome"] == "accepted":
        return (record["figures"]["label"] if last is Stage.VERDICT else "pending"), last, None
    return record["outcome"], last, record["reason"]


def test_every_crash_of_both_cohorts_is_in_exactly_one_final_state(root, registered, outcomes):
    crashes = rows(root / "warehouse.duckdb", "crashes")
    assert len(crashes) == len(registered)
    found = {row["key"]: (row["final_state"], row["stage_reached"], row["reason"]) for row in crashes}
    assert found == {key: ends(outcomes, key) for key in registered}
    states = Counter((row["cohort"], row["final_state"]) for row in crashes)
    for cohort in ("va-2023", "fars"):
        assert min(states[cohort, "verified"], states[cohort, "rejected"]) > 0, "a count of nothing shows nothing"
    assert not any(state == "failed" for _, state in states)


def test_funnel_and_reasons_equal_a_count_of_the_records(root, registered, outcomes):
    accepted = Counter(
        stage for of_crash in outcomes.values() for stage, record in of_crash.items() if record["outcome"] == "accepted"
    )
    steps = {
        "complete": Stage.CRASH_RECORD,
        "mapped": Stage.ROAD_MAP,
        "estimated": Stage.STATE_ESTIMATE,
        "collided": Stage.SIMULATION_LOG,
        "accepted": Stage.VERDICT,
    }
    verified = sum(ends(outcomes, key)[0] == "verified" for key in registered)
    assert {row["step"]: row["crashes"] for row in rows(root / "warehouse.duckdb", "funnel")} == {
        "registered": len(registered),
        **{step: accepted[stage] for step, stage in steps.items()},
        "verified": verified,
    }
    rejected = Counter(
        (stage.value, record["reason"], Reason(record["reason"]).published_category.value)
        for of_crash in outcomes.values()
        for stage, record in of_crash.items()
        if record["outcome"] == "rejected"
    )
    found = rows(root / "warehouse.duckdb", "failure_reasons")
    assert {(row["stage"], row["reason"], row["published_category"]): row["crashes"] for row in found} == rejected


def test_coverage_equals_a_count_over_the_records_and_verdicts(root, outcomes):
    verified: Counter[tuple[str, str]] = Counter()
    read: Counter[tuple[str, str]] = Counter()
    for path in (root / "crash_record").glob("*.parquet"):
        (record,) = table_from_parquet(path.read_bytes()).to_pylist()
        classes = [(dimension, record[dimension]) for dimension in DIMENSIONS]
        read.update(classes)
        verdict = root / "verdict" / f"{record['key']}.json"
        if verdict.exists() and json.loads(verdict.read_bytes())["label"] == "verified":
            verified.update(classes)
    table = {(row["dimension"], row["class"]): row for row in rows(root / "warehouse.duckdb", "coverage")}
    assert {name: row["verified"] for name, row in table.items() if row["verified"]} == verified
    # Registered counts unread reports too, by what their source says: never fewer than were read.
    assert all(table[name]["registered"] >= count for name, count in read.items())


def test_the_numbers_on_the_page_are_those_of_the_tables(root, page):
    warehouse = root / "warehouse.duckdb"
    tables = page.xpath("//main//table")[1:]
    shown = [[[_text(cell) for cell in row.xpath("th|td")] for row in table.xpath("tbody/tr")] for table in tables]
    funnel, reasons, *coverage = shown
    assert [(row[0], row[1]) for row in funnel] == [
        (row["step"], str(row["crashes"])) for row in rows(warehouse, "funnel")
    ]
    assert [(row[0], row[1], row[3]) for row in reasons] == [
        (_words(row["stage"]), _words(row["reason"]), str(row["crashes"])) for row in rows(warehouse, "failure_reasons")
    ]
    assert [row[1:] for table in coverage for row in table] == [
        [str(row[name]) for name in ("verified", "registered", "published")] for row in rows(warehouse, "coverage")
    ]
    crashes = rows(warehouse, "crashes")
    states = Counter(row["final_state"] for row in crashes)
    for meaning in page.xpath("//ul[@class='tiles']//small"):
        meaning.drop_tree()
    tiles = dict(reversed(_text(tile).split(maxsplit=1)) for tile in page.xpath("//ul[@class='tiles']/li"))
    assert tiles == {"registered": str(len(crashes))} | {_words(state): str(count) for state, count in states.items()}


def test_the_rows_behind_the_pages_filters_are_those_of_the_table(root, page):
    (script,) = page.xpath("//script[@id='crashes-data']")
    data = json.loads(script.text)
    columns = {name: [each["values"][code] for code in each["codes"]] for name, each in data["coded"].items()}
    shown = [
        dict(zip(("key", *columns), values, strict=True)) for values in zip(data["key"], *columns.values(), strict=True)
    ]
    bodies: defaultdict[str, set[str]] = defaultdict(set)
    for row in rows(root / "warehouse.duckdb", "vehicles"):
        bodies[row["key"]].add(row["vehicle_class"])
    written: dict[str, Callable[[dict], str]] = {
        "month": lambda row: f"{row['year']}-{row['month']:02d}",
        "speed_limit_mph": lambda row: str(round(row["speed_limit_mph"])),
        "signalised": lambda _: "signalised",
    }
    searched = {row["key"]: row for row in rows(root / "warehouse.duckdb", "catalogue")}
    expected = []
    for row in rows(root / "warehouse.duckdb", "judged_crashes"):
        row = searched[row["key"]] | row | {"vehicle_classes": ", ".join(sorted(bodies[row["key"]]))}
        texts = {name: written.get(name, lambda row, name=name: row[name])(row) for name in columns if row[name]}
        expected.append({"key": row["key"]} | dict.fromkeys(columns) | texts)
    assert shown == expected
    assert {path.stem for path in (root / "benchmark" / "crashes").glob("*.html")} == set(data["key"])
    packages = {path.stem for path in (root / "benchmark" / "packages").glob("*.zip")}
    assert packages == {row["key"] for row in shown if row["final_state"] in ("verified", "first_event_only")}


def _text(element: html.HtmlElement) -> str:
    return " ".join(element.text_content().split())


def _words(name: str) -> str:
    return name.replace("_", " ")
