"""Choosing among what sources offer, and registering a cohort of any size."""

from __future__ import annotations

import csv
import re
import zipfile
from collections import Counter
from pathlib import Path

import pytest

from trace_dag.assets.run_requests import add_partitions, remove_partitions
from trace_dag.common.errors import UserError
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import CollisionType
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.export.crash_files import delete_artefacts
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.registry import Registry
from trace_dag.flow.cohorts.sources import TableSource

REPORTS = Path(__file__).resolve().parents[2] / "data" / "sample" / "reports"


def fars_folder(folder: Path, crashes: int) -> Path:
    """A release of two-vehicle crashes in ten states."""
    folder.mkdir(parents=True)
    states = (1, 2, 4, 5, 6, 8, 9, 10, 11, 12)
    cases = [states[number % 10] * 10_000 + 1 + number // 10 for number in range(crashes)]
    accident = [
        {"STATE": case // 10_000, "ST_CASE": case, "YEAR": 2015, "VE_FORMS": 2, "MAN_COLL": 1 + case % 3, "COUNTY": 7,
         "LATITUDE": 33.4, "LONGITUD": -112.0}
        for case in cases
    ]  # fmt: skip
    vehicle = [{"ST_CASE": case, "VEH_NO": number, "ACC_TYPE": 50} for case in cases for number in (1, 2)]
    for name, rows in (("ACCIDENT.CSV", accident), ("Vehicle.csv", vehicle)):
        with (folder / name).open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    return folder


@pytest.fixture
def storage(tmp_path):
    return Storage.open(tmp_path / "root")


def test_a_zip_registers_what_its_folder_does(tmp_path, storage):
    folder = fars_folder(tmp_path / "FARS2015", 30)
    archive = tmp_path / "FARS2015NationalCSV.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in folder.iterdir():
            file.write(path, f"inside/{path.name}")
    first = ingest(storage, "folder", tables=[TableSource.of_plugin("fars-csv", str(folder))])
    second = ingest(Storage.open(tmp_path / "other"), "zip", tables=[TableSource.of_plugin("fars-csv", str(archive))])
    assert len(first.registration.added) == 30
    assert first.registration == second.registration


def test_filters_choose_by_what_reports_say(storage):
    wanted = {
        f"2023-{path.stem[6:]}"
        for path in REPORTS.glob("*.xml")
        if re.search(r"<MAN_COLL>2</MAN_COLL>", path.read_text()) and "<VE_FORMS>2</VE_FORMS>" in path.read_text()
    }
    choice = Choice(
        CohortFilter(collision_types=frozenset({CollisionType.FRONT_TO_FRONT}), min_vehicles=2, max_vehicles=2)
    )
    report = ingest(storage, "head-on", reports=[REPORTS], choice=choice)
    assert set(report.registration.added) == wanted
    assert Registry(storage).cohort("head-on").origins == ("reports: front_to_front; 2 vehicles",)


def test_a_larger_sample_extends_a_cohort_that_was_a_smaller_one(storage):
    first = ingest(storage, "some", reports=[REPORTS], choice=Choice(sample=10, seed=3)).registration
    second = ingest(storage, "some", reports=[REPORTS], choice=Choice(sample=15, seed=3)).registration
    assert (len(first.added), len(second.added), len(second.known)) == (10, 5, 10)
    assert len(Registry(storage).cohort("some").origins) == 2


def test_a_stratified_sample_has_classes_a_random_one_of_its_size_lacks(tmp_path):
    def classes(name, choice):
        storage = Storage.open(tmp_path / name)
        keys = ingest(storage, name, reports=[REPORTS], choice=choice).registration.added
        texts = [(REPORTS / f"crash_{key[5:]}.xml").read_text() for key in keys]
        return Counter(re.findall(r"<MAN_COLL>(\d+)</MAN_COLL>", "".join(texts)))

    stratified = classes("stratified", Choice(stratified=10))
    assert len(stratified) > max(len(classes(f"random{seed}", Choice(sample=10, seed=seed))) for seed in range(3))


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (Choice(CohortFilter(states=frozenset({51}))), "no crash that is asked for \\(VA\\)"),
        (Choice(cases=frozenset({"2023-510001"})), "no crash that is asked for"),
        (Choice(cases=frozenset({"2023-510001", "2023-319003"})), "no crash 2023-510001"),
    ],
)
def test_a_choice_that_leaves_nothing_registers_nothing(storage, choice, said):
    with pytest.raises(UserError, match=said):
        ingest(storage, "none", reports=[REPORTS], choice=choice)
    assert Registry(storage).cohorts() == {}


def test_two_kinds_of_sample_at_once_are_refused():
    with pytest.raises(UserError, match="choose one"):
        Choice(sample=1, stratified=1)
    with pytest.raises(UserError, match="not a crash key"):
        Choice(cases=frozenset({"../../etc/passwd"}))


def test_removing_crashes_leaves_the_others_and_what_was_made_of_them(storage):
    ingest(storage, "some", reports=[REPORTS], choice=Choice(sample=5))
    keys = Registry(storage).keys("some")
    for key in keys:
        storage.write(f"verdict/{key}.json", b"{}")
        storage.write(f"benchmark/replays/{key}.js", b"")
    assert Registry(storage).remove("some", keys[:2]) == tuple(keys[:2])
    assert Registry(storage).keys("some") == keys[2:]
    assert delete_artefacts(storage, keys[:2]) == 4
    assert set(storage.list("verdict")) == {f"verdict/{key}.json" for key in keys[2:]}
    assert not storage.exists(f"benchmark/replays/{keys[0]}.js")
    with pytest.raises(UserError, match="is not in cohort some"):
        Registry(storage).remove("some", keys[:1])
    assert Registry(storage).remove("some") == tuple(keys[2:])
    with pytest.raises(UserError, match="is not registered"):
        Registry(storage).remove("some")


def test_thousands_of_crashes_are_registered_and_become_partitions(tmp_path, storage):
    """A tenth of a national year."""
    from dagster import DagsterInstance

    folder = fars_folder(tmp_path / "csv", 4_000)
    report = ingest(storage, "year", tables=[TableSource.of_plugin("fars-csv", str(folder))])
    with DagsterInstance.ephemeral() as instance:
        assert add_partitions(instance, report.registration.added) == 4_000
        keys = Registry(storage).keys("year")
        assert list(instance.get_dynamic_partitions("crashes")) == keys
        assert remove_partitions(instance, keys[:10]) == 10
        assert list(instance.get_dynamic_partitions("crashes")) == keys[10:]
