"""The CrashAPI client against a server on loopback with real responses, behaving and misbehaving."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from crash_reports import not_released, report
from loopback import Answer, Loopback, Request, serving

from trace_dag.common.errors import Failure, Reason, Rejection, TransientFailure, UserError
from trace_dag.common.network.http import HttpClient, HttpPolicy
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.fars.crashapi import CrashApiClient
from trace_dag.crash.parse import read_report

QUICK = HttpPolicy(timeout_s=0.5, attempts=3, first_wait_s=0.01, longest_wait_s=0.02, requests_per_s=1000)
KEY = "2023-519001"
OTHER = report({"ST_CASE": 519002})


def client(server: Loopback, cache_dir: Path | None = None, policy: HttpPolicy = QUICK) -> CrashApiClient:
    return CrashApiClient(HttpClient(policy, cache_dir), f"{server.url}/CrashAPI")


def case_list(*state_cases: int) -> bytes:
    cases = [
        {"CountyName": "HANOVER (85)", "CrashDate": "/Date(1675000000000-0500)/", "Fatals": 1, "Peds": 0, "Persons": 2,
         "St_Case": case, "State": case // 10000, "StateName": "Virginia", "TotalVehicles": 2}
        for case in state_cases
    ]  # fmt: skip
    return json.dumps({"Count": 1, "Message": "Results returned successfully", "Results": [cases]}).encode()


# --- behaving ------------------------------------------------------------------------------------------------------


def test_real_reports_are_fetched_as_served(real_reports: dict[str, bytes], tmp_path: Path) -> None:
    """All of them, those with a bare & included: what is served is kept, and judged when it is read."""

    def respond(request: Request, _: int) -> Answer:
        assert request.path == "/CrashAPI/crashes/GetCaseDetails"
        assert request.query["format"] == "xml"
        assert request.query["state"] == "51"
        return Answer(real_reports[f"crash_{request.query['stateCase']}.xml"])

    with serving(respond) as server:
        api = client(server, tmp_path)
        for name, data in real_reports.items():
            assert api.report(f"2023-{name.removeprefix('crash_').removesuffix('.xml')}") == data
    assert len(server.requests) == len(real_reports) == 62


def test_cases_are_listed_state_by_state_and_year_by_year() -> None:
    def respond(request: Request, _: int) -> Answer:
        assert request.path == "/CrashAPI/crashes/GetCaseList"
        assert request.query["fromYear"] == request.query["toYear"]
        assert (request.query["minNumOfVehicles"], request.query["maxNumOfVehicles"]) == ("2", "2")
        state = int(request.query["states"])
        return Answer(case_list(state * 10000 + 2, state * 10000 + 1))

    with serving(respond) as server:
        found = client(server).list_cases([51, 4], [2022, 2023], min_vehicles=2, max_vehicles=2)
    assert [listing.key for listing in found] == [
        "2022-40001", "2022-40002", "2022-510001", "2022-510002", "2023-40001", "2023-40002", "2023-510001",
        "2023-510002",
    ]  # fmt: skip
    assert found[0].county_name == "HANOVER (85)"
    assert len(server.requests) == 4


def test_no_cases_is_an_answer() -> None:
    with serving(lambda *_: Answer(b'{"Count": 0, "Message": "No results found", "Results": []}')) as server:
        assert client(server).list_cases([51], [2023]) == []


def test_a_case_that_is_not_released_is_an_answer_too(settings: CrashSettings) -> None:
    with serving(lambda *_: Answer(not_released())) as server:
        data = client(server).report(KEY)
    assert len(server.requests) == 1
    with pytest.raises(Rejection) as caught:
        read_report(data, name="the answer", settings=settings)
    assert caught.value.reason is Reason.NOT_RELEASED


# --- misbehaving ---------------------------------------------------------------------------------------------------

MISBEHAVIOUR: dict[str, Answer] = {
    "request time-out": Answer(status=408),
    "too many requests": Answer(status=429, headers={"Retry-After": "0"}),
    "server error": Answer(b"<html>", status=500),
    "unavailable": Answer(status=503),
    "silence": Answer(report(), delay_s=20),
    "torn connection": Answer(report()[:500], declared_length=len(report())),
    "error page with status 200": Answer(b"<!DOCTYPE html><html><body>Runtime Error</body></html>"),
    "another page": Answer(b"<html><body>Sign in</body></html>"),
    "nothing": Answer(b""),
    "truncated XML": Answer(report()[:-300]),
    "cut inside the last tag": Answer(report()[:-3]),
    "another case": Answer(OTHER),
    "another case, not released": Answer(not_released(519002)),
    "JSON": Answer(b'{"Count": 1}'),
}


@pytest.mark.parametrize("kind", MISBEHAVIOUR)
def test_misbehaviour_that_passes_is_waited_out(kind: str, tmp_path: Path) -> None:
    with serving(lambda _, before: Answer(report()) if before else MISBEHAVIOUR[kind]) as server:
        assert client(server, tmp_path).report(KEY) == report()
        assert len(server.requests) == 2
        assert client(server, tmp_path).report(KEY) == report()
        assert len(server.requests) == 2, "the right answer is in the cache"


@pytest.mark.parametrize("kind", MISBEHAVIOUR)
def test_misbehaviour_that_stays_is_a_failure_and_not_cached(kind: str, tmp_path: Path) -> None:
    with serving(lambda *_: MISBEHAVIOUR[kind]) as server, pytest.raises(TransientFailure, match="after 3 attempts"):
        client(server, tmp_path).report(KEY)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_no_such_service_is_not_asked_again() -> None:
    with serving(lambda *_: Answer(status=404)) as server, pytest.raises(Failure, match="404"):
        client(server).report(KEY)
    assert len(server.requests) == 1


@pytest.mark.parametrize(
    "body",
    [
        b"<html>",
        b"[]",
        b'{"Results": 1}',
        b'{"Results": [[{"State": 51}]]}',
        case_list(40001),
        b'{"Results": [[null]]}',
    ],
)
def test_an_answer_that_is_no_list_of_cases_is_recognised(body: bytes) -> None:
    with serving(lambda *_: Answer(body)) as server, pytest.raises(TransientFailure, match="wrong answer"):
        client(server).list_cases([51], [2023])


def test_a_full_list_may_be_cut_off_and_is_an_error() -> None:
    full = Answer(case_list(*range(510001, 515001)))
    with serving(lambda *_: full) as server, pytest.raises(Failure, match="ask for it in parts"):
        client(server).list_cases([51], [2023])


@pytest.mark.parametrize(
    "ask", [lambda api: api.report("2023-../../x"), lambda api: api.list_cases([3], [2023]), lambda api: api.report("")]
)
def test_impossible_questions_are_not_asked(ask: Callable[[CrashApiClient], object]) -> None:
    with serving(lambda *_: Answer()) as server, pytest.raises(UserError):
        ask(client(server))
    assert server.requests == []


def test_cache_only_serves_what_is_there(tmp_path: Path) -> None:
    offline = HttpPolicy(cache_only=True)
    with serving(lambda *_: Answer(report())) as server:
        client(server, tmp_path).report(KEY)
        assert client(server, tmp_path, offline).report(KEY) == report()
        with pytest.raises(Failure, match="cache-only"):
            client(server, tmp_path, offline).report("2023-519002")
        assert len(server.requests) == 1
