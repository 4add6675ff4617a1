"""Crashes from the CrashAPI and maps from Overpass or the OSM API, through the real first stages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from public_services import MAP, NOT_RELEASED, OFF_THE_MAP, VERIFIED, PublicServices, public_services

from trace_dag.common.errors import Reason, TransientFailure, UserError
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import IngestReport, ingest
from trace_dag.flow.cohorts.services import crash_api
from trace_dag.flow.selection import select_again
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace

FIRST_STAGES = (Stage.RAW_REPORT, Stage.CRASH_RECORD, Stage.OSM_EXTRACT)
NEBRASKA_2023 = CohortFilter(states=frozenset({31}), years=frozenset({2023}), min_vehicles=2, max_vehicles=2)


@pytest.fixture
def api() -> Iterator[PublicServices]:
    with public_services() as services:
        yield services


class Root:
    """A storage root whose crashes come from the services."""

    def __init__(self, folder: Path, api: PublicServices, **services: Any) -> None:
        execution = {"executor": "in_process", "retry_wait_s": 0.0, "transient_retries": 1}
        overrides = {"execution": execution, "services": {**api.settings, **services}}
        self.workspace = Workspace.open(str(folder), FLOW, overrides)

    def ingest(self, choice: Choice, maps: list[Path] | None = None, map_service: str | None = None) -> IngestReport:
        client = crash_api(self.workspace.settings.services, self.workspace.storage)
        return ingest(
            self.workspace.storage, "ne", maps=maps or [], crash_api=client, choice=choice, map_service=map_service
        )

    def run(self, keys: list[str] | None = None) -> dict[str, OutcomeRecord]:
        """The last outcome of each crash, by case."""
        last = {}
        for event in run_stages(self.workspace, keys or self.workspace.registry.keys(), FIRST_STAGES, run_id="test"):
            assert event.record is not None
            last[event.key[5:]] = event.record
        return last


@pytest.mark.parametrize(("service", "path"), [("overpass", "/overpass"), ("osm-api", "/osm/map")])
def test_listed_fetched_and_mapped_without_a_file(tmp_path, api, service, path):
    root = Root(tmp_path, api)
    report = root.ingest(Choice(NEBRASKA_2023), map_service=service)
    assert len(report.registration.added) == 3
    assert (api.asked("GetCaseList"), api.asked("GetCaseDetails")) == (1, 0)
    records = root.run()
    assert {records[case].outcome for case in VERIFIED} == {Outcome.ACCEPTED}
    assert {records[case].stage for case in VERIFIED} == {Stage.OSM_EXTRACT}
    assert records[NOT_RELEASED].reason is Reason.NOT_RELEASED
    assert (api.asked("GetCaseDetails"), api.asked(path)) == (3, 2)
    stored = root.workspace.storage.read(f"raw_report/2023-{VERIFIED[0]}.xml")
    assert stored == (MAP.parents[1] / "reports" / f"crash_{VERIFIED[0]}.xml").read_bytes()
    root.run()
    assert (api.asked("GetCaseDetails"), api.asked(path)) == (3, 2), "all is up to date"


def test_another_root_needs_the_cache_alone_and_fails_for_what_is_not_in_it(tmp_path, api):
    first = Root(tmp_path / "first", api)
    first.ingest(Choice(NEBRASKA_2023), map_service="overpass")
    first.run()
    before = api.asked()
    offline = Root(tmp_path / "second", api, cache_dir=str(tmp_path / "first" / "cache"), cache_only=True)
    offline.ingest(Choice(NEBRASKA_2023), map_service="overpass")
    records = offline.run()
    assert {records[case].outcome for case in VERIFIED} == {Outcome.ACCEPTED}
    assert records[NOT_RELEASED].outcome is Outcome.FAILED
    assert "cache-only" in records[NOT_RELEASED].detail
    assert api.asked() == before


def test_services_that_do_not_answer_are_failures_that_pass_and_keep_no_other_crash_from_going_on(tmp_path, api):
    root = Root(tmp_path, api)
    root.ingest(Choice(NEBRASKA_2023), maps=[MAP])
    api.down = {VERIFIED[0]}
    records = root.run()
    broken = records[VERIFIED[0]]
    assert (broken.stage, broken.outcome, broken.transient) == (Stage.RAW_REPORT, Outcome.FAILED, True)
    assert broken.attempts == 2
    assert records[VERIFIED[1]].outcome is Outcome.ACCEPTED
    api.down = set()
    again = select_again(root.workspace, failed=True)
    assert list(again.start) == [f"2023-{VERIFIED[0]}"]
    assert root.run(list(again.start))[VERIFIED[0]].outcome is Outcome.ACCEPTED


def test_a_map_service_that_does_not_answer_fails_those_it_was_asked_for_alone(tmp_path, api):
    root = Root(tmp_path, api)
    cases = Choice(cases=frozenset({f"2023-{VERIFIED[0]}", f"2023-{OFF_THE_MAP}"}))
    root.ingest(cases, maps=[MAP], map_service="overpass")
    assert api.asked("GetCaseList") == 0
    api.down = {"map"}
    records = root.run()
    assert records[VERIFIED[0]].outcome is Outcome.ACCEPTED
    assert (records[OFF_THE_MAP].outcome, records[OFF_THE_MAP].transient) == (Outcome.FAILED, True)
    api.down = set()
    before = api.asked("/overpass")
    assert root.run()[OFF_THE_MAP].reason is Reason.NO_MAP_COVERAGE
    assert api.asked("/overpass") == before + 1, "only where no file covers"


def test_a_case_that_is_released_meanwhile_is_found_when_it_is_asked_for_again(tmp_path, api):
    root = Root(tmp_path, api)
    root.ingest(Choice(cases=frozenset({f"2023-{NOT_RELEASED}"})))
    assert root.run()[NOT_RELEASED].reason is Reason.NOT_RELEASED
    list(run_stages(root.workspace, [f"2023-{NOT_RELEASED}"], FIRST_STAGES, run_id="again", force=[Stage.RAW_REPORT]))
    assert api.asked("GetCaseDetails") == 2


def test_filters_on_what_only_reports_say_look_them_up_once(tmp_path, api):
    root = Root(tmp_path, api)
    choice = Choice(NEBRASKA_2023, stratified=2)
    assert choice.reads_reports
    report = root.ingest(choice)
    assert (report.offered, len(report.registration.added)) == (2, 2)  # what is not released tells no vehicles
    assert api.asked("GetCaseDetails") == 3
    root.run()
    assert api.asked("GetCaseDetails") == 3, "the run finds them in the cache"


def test_a_list_that_is_not_given_registers_nothing(tmp_path, api):
    root = Root(tmp_path, api)
    api.cases = ("510001",)  # of another state
    with pytest.raises(TransientFailure, match="wrong answer"):
        root.ingest(Choice(NEBRASKA_2023))
    assert root.workspace.registry.cohorts() == {}
    with pytest.raises(UserError, match="which cases"):
        root.ingest(Choice())
