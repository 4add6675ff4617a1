"""Cohorts: what registering adds, keeps and refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from trace_dag.common.errors import UserError
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.registry import RegisteredMap, Registry, ReportSource, in_order


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return Registry(Storage.open(tmp_path / "root"))


def source(text: str) -> ReportSource:
    return ReportSource("file", f"/reports/{text}.xml", text)


def test_keys_are_in_order_of_year_and_case_number():
    assert in_order(["2023-510002", "2023-60001", "2012-510003", "2023-510002"]) == [
        "2012-510003",
        "2023-60001",
        "2023-510002",
    ]


def test_registering_again_changes_nothing_and_more_extends(registry):
    first = registry.register("va", {"2023-510001": source("a")}, [RegisteredMap("/m1.osm", "d1", 1)])
    assert (first.added, first.maps_added) == (("2023-510001",), 1)
    again = registry.register("va", {"2023-510001": source("a")}, [RegisteredMap("/m1.osm", "d1", 1)])
    assert (again.added, again.known, again.maps_added) == ((), ("2023-510001",), 0)
    more = registry.register("va", {"2023-510002": source("b"), "2023-510001": source("c")})
    assert (more.added, more.changed) == (("2023-510002",), ("2023-510001",))
    sources = registry.sources(["2023-510001", "2023-510002"])
    assert sources["2023-510001"].report.sha256 == "c"
    assert [file.location for file in sources["2023-510002"].maps] == ["/m1.osm"]


def test_changes_by_another_process_are_seen(registry, tmp_path):
    another = Registry(Storage.open(tmp_path / "root"))
    registry.register("va", {"2023-510001": source("a")})
    assert another.keys() == ["2023-510001"]
    registry.register("va", {"2023-510002": source("b")})
    assert another.keys() == ["2023-510001", "2023-510002"]
    registry.remove("va", ["2023-510001"])
    assert another.keys() == ["2023-510002"]
    registry.remove("va")
    assert another.keys() == []


def test_a_crash_belongs_to_one_cohort(registry):
    registry.register("a", {"2023-510001": source("a")})
    second = registry.register("b", {"2023-510001": source("a"), "2023-510002": source("b")})
    assert second.elsewhere == {"2023-510001": "a"}
    assert registry.keys("b") == ["2023-510002"]
    assert registry.keys() == ["2023-510001", "2023-510002"]


def test_maps_can_be_added_later_and_change_what_extracts_depend_on(registry):
    registry.register("a", {"2023-510001": source("a")})
    before = registry.sources(["2023-510001"])["2023-510001"].maps_digest
    registry.register("a", {}, [RegisteredMap("/m1.osm", "d1", 1)])
    assert registry.sources(["2023-510001"])["2023-510001"].maps_digest != before


@pytest.mark.parametrize("key", ["2023-51", "../2023-510001", "2023-510001.xml", "", "510001"])
def test_invalid_keys_are_refused(registry, key):
    with pytest.raises(UserError):
        registry.sources([key])


def test_unknown_keys_and_cohorts_are_named(registry):
    registry.register("a", {"2023-510001": source("a")})
    with pytest.raises(UserError, match="2023-510999 is not registered"):
        registry.sources(["2023-510999"])
    with pytest.raises(UserError, match="cohort 'b' is not registered; there is a"):
        registry.keys("b")
    with pytest.raises(UserError, match="cohort name"):
        registry.register("../b", {})


def test_object_store_takes_copies_so_that_workers_need_nothing_else(tmp_path, shared_data):
    reports = sorted((shared_data / "va-2023/reports").glob("*.xml"))[:3]
    storage = Storage.open("memory://bucket/ingest")
    report = ingest(storage, "va", reports=reports, maps=sorted((shared_data / "va-2023/osm").glob("*.osm"))[:2])
    assert len(report.registration.added) == 3
    for crash in Registry(storage).sources(report.registration.added).values():
        assert crash.report.kind == "stored"
        assert storage.exists(crash.report.location)
        assert all(file.stored and storage.sizes([file.location])[file.location] == file.size for file in crash.maps)
