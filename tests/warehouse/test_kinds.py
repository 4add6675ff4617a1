"""Kinds of crashes and groups of persons on real reports: SQL on the warehouse against counts made from the codes."""

from __future__ import annotations

import csv
import re
from collections import Counter, defaultdict
from pathlib import Path

import pytest

from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.sources import TableSource
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.query import query, rows

JUDGED = {
    "two_vehicles",
    "multi_vehicle",
    "parked",
    "fixed_object",
    "lying_object",
    "overturn",
    "pedestrian",
    "cyclist",
    "animal",
}
CONTACTS = {12, 14, 45, 55}
NO_HARM = {*range(60, 72), 79, 98, 99}
MALFORMED = ("crash_510030", "crash_510108", "crash_510150")
"""With a bare ampersand, which ``xmllint --noout`` refuses."""
NOT_FIXED = {18, 45, 49, 51, 54, 55}


def kind(harm_ev: int, vehicles: int, events: list[int]) -> str:
    """The kind by the words of the documentation, from codes alone."""
    for codes, name in (({8, 15}, "pedestrian"), ({9}, "cyclist"), ({14, 45}, "parked"), ({11, 49}, "animal")):
        if harm_ev in codes:
            return name
    harmful = [code for code in events if code not in NO_HARM]
    if vehicles > 1 and harm_ev != 10 and (harm_ev == 12 or not harmful or CONTACTS & set(harmful)):
        return "two_vehicles" if vehicles == 2 else "multi_vehicle"
    if harm_ev in {1, 18, 91}:
        return "overturn" if harm_ev == 1 else "lying_object"
    return "fixed_object" if 17 <= harm_ev <= 59 and harm_ev not in NOT_FIXED else "other"


@pytest.fixture(scope="module")
def folders(shared_data: Path) -> tuple[Path, Path]:
    return shared_data / "va-2023" / "reports", shared_data / "fars-csv"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, folders: tuple[Path, Path]) -> Path:
    """All reports of both cohorts, read; and one registered that is not."""
    root = tmp_path_factory.mktemp("kinds")
    workspace = Workspace.open(str(root), FLOW, {"execution": {"executor": "in_process"}})
    ingest(workspace.storage, "va-2023", reports=[folders[0]])
    ingest(workspace.storage, "fars", tables=[TableSource.of_plugin("fars-csv", str(folders[1]))])
    keys = workspace.registry.keys()
    list(run_stages(workspace, keys[1:], [Stage.RAW_REPORT, Stage.CRASH_RECORD], run_id="kinds"))
    build_warehouse(workspace.storage, root)
    return root


@pytest.fixture(scope="module")
def expected(folders: tuple[Path, Path]) -> dict[str, str]:
    """The kind of every crash by its key; of three reports that are not well-formed it is not known."""
    found = {}
    for path in folders[0].glob("*.xml"):
        if path.stem in MALFORMED:
            continue
        text = path.read_text()
        harm_ev, vehicles, year, case = (
            int(re.findall(rf"<{field}>(\d+)</{field}>", text)[0])
            for field in ("HARM_EV", "VE_FORMS", "CaseYear", "ST_CASE")
        )
        sequence = re.findall(r"<CEvents>.*</CEvents>", text, re.DOTALL)
        events = [int(code) for code in re.findall(r"<SOE>(\d+)</SOE>", sequence[0])] if sequence else []
        found[f"{year}-{case}"] = kind(harm_ev, vehicles, events)
    for folder in folders[1].iterdir():
        events_of: dict[str, list[int]] = defaultdict(list)
        if (folder / "vsoe.csv").is_file():
            for row in table(folder / "vsoe.csv"):
                if row["SOE"].strip():
                    events_of[row["ST_CASE"]].append(int(row["SOE"]))
        for row in table(folder / "accident.csv"):
            codes = int(row["HARM_EV"]), int(row["VE_FORMS"])
            found[f"{folder.name}-{row['ST_CASE']}"] = kind(*codes, events_of[row["ST_CASE"]])
    return found


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="latin-1", newline="") as file:
        return [{name.upper(): value for name, value in row.items()} for row in csv.DictReader(file)]


def test_every_crash_has_the_kind_its_codes_say(root: Path, expected: dict[str, str]) -> None:
    found = {row["key"]: row["kind"] for row in rows(root / "warehouse.duckdb", "crashes") if row["kind"]}
    assert found == expected


def test_the_funnel_by_kind_adds_up(root: Path, expected: dict[str, str]) -> None:
    by_kind = {row["kind"]: row for row in rows(root / "warehouse.duckdb", "funnel_by_kind")}
    counted = Counter([*expected.values(), *("not_known" for _ in MALFORMED)])
    assert {name: row["registered"] for name, row in by_kind.items()} == counted
    whole = {row["step"]: row["crashes"] for row in rows(root / "warehouse.duckdb", "funnel")}
    for step in ("registered", "complete", "mapped", "estimated", "collided", "verified"):
        assert sum(row[step] for row in by_kind.values()) == whole[step]
    assert sum(row["share_pct"] for row in by_kind.values()) == pytest.approx(100, abs=0.05)
    assert {name for name, row in by_kind.items() if row["complete"]} <= JUDGED


def test_coverage_by_kind_adds_up(root: Path) -> None:
    found: Counter[tuple[str, str]] = Counter()
    for row in rows(root / "warehouse.duckdb", "coverage_by_kind"):
        found[row["dimension"], row["class"]] += row["registered"]
    whole = rows(root / "warehouse.duckdb", "coverage")
    assert found == Counter({(row["dimension"], row["class"]): row["registered"] for row in whole})


def test_usable_information_is_of_the_kinds_that_are_judged(root: Path, expected: dict[str, str]) -> None:
    path = root / "warehouse.duckdb"
    usable: Counter[str] = Counter()
    for row in rows(path, "usable_information"):
        usable[row["kind"]] += row["crashes"]
    unusable = query(
        path,
        f"SELECT kind, count(*) FROM crashes WHERE kind IN ({', '.join(map(repr, sorted(JUDGED)))}) AND "
        "(reason IN ('not_modelled', 'incomplete_sequence') OR stage_reached IS NULL) GROUP BY kind",
    )[1]
    judged = {name: count for name, count in Counter(expected.values()).items() if name in JUDGED}
    assert usable + Counter(dict(unusable)) == Counter(judged)


def test_suggested_runs_are_of_kinds_that_are_judged(root: Path, expected: dict[str, str]) -> None:
    path = root / "warehouse.duckdb"
    judged = {row["kind"] for row in rows(path, "crash_kinds") if row["judged"]}
    assert judged == JUDGED
    pending = {row["key"] for row in rows(path, "crashes") if row["final_state"] == "pending"}
    suggested = {row["key"] for row in rows(path, "cohort_gaps")}
    assert suggested == {key for key in pending if expected.get(key, "two_vehicles") in judged}


def test_groups_of_persons_are_those_of_the_typing(root: Path, folders: tuple[Path, Path]) -> None:
    counted: Counter[tuple[str, int]] = Counter()
    for path in folders[0].glob("*.xml"):
        text = path.read_text()
        for element in ("PEDCGP", "BIKECGP"):
            counted.update((element, int(code)) for code in re.findall(rf"<{element}>(\d+)</{element}>", text))
    for path in folders[1].glob("*/pbtype.csv"):
        for row in table(path):
            counted.update((element, int(row[element])) for element in ("PEDCGP", "BIKECGP"))
    groups = {(row["element"], row["code"]): row for row in rows(root / "warehouse.duckdb", "person_crash_groups")}
    assert len(groups) == 16 + 21
    found = Counter({group: row["persons"] for group, row in groups.items() if row["persons"]})
    assert found == Counter({group: count for group, count in counted.items() if group[1] != 0})
    assert groups["PEDCGP", 750]["meaning"] == "crossing, vehicle not turning"


def test_events_name_their_parties(root: Path) -> None:
    path = root / "warehouse.duckdb"
    of_one = "WHERE key = '2023-510174' AND kind = 'person_struck'"
    strikes = query(path, f"SELECT party_2, count(*) FROM events {of_one} GROUP BY 1")
    assert strikes[1] == [(1001, 2)]
    unknown = query(
        path,
        "SELECT count(*) FROM events ANTI JOIN non_motorists AS n ON n.key = events.key AND n.party = events.party_2 "
        "WHERE events.party_2 BETWEEN 1001 AND 1999",
    )
    assert unknown[1] == [(0,)]
