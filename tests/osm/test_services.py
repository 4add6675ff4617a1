"""Maps from Overpass and the OSM API, both on the loopback interface."""

from __future__ import annotations

from pathlib import Path

import pytest
from loopback import Answer, Request, Respond, serving

from tests.osm.osm_text import ORIGIN, document, node, place, restriction, way
from trace_dag.common.errors import Failure, Reason, Rejection, TransientFailure
from trace_dag.common.network.http import HttpClient, HttpPolicy
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.services import OsmApiSource, OverpassSource
from trace_dag.osm.types import OsmExtract, Site

SITE = Site("2023-1", *ORIGIN)
TOWN = document(
    node(1, -4000, 0),
    node(2, 0, 0),
    node(3, 4000, 0),
    node(4, 0, 80, highway="stop"),
    node(5, 10, 10),
    way(10, [1, 2, 3], name="Main Street"),
    way(11, [2, 4]),
    way(12, [2, 5], highway="footway"),
    node(6, 30, 10, natural="tree"),
    node(7, 30, 190, natural="tree"),
    restriction(20, 10, 2, 11),
).replace(b'<osm version="0.6">', b'<osm version="0.6"><meta osm_base="2026-01-02T03:04:05Z"/>')
OUT_OF_MEMORY = (
    b'<?xml version="1.0"?><osm version="0.6"><remark> runtime error: Query ran out of memory in "query" at line 1.'
    b" </remark></osm>"
)
EMPTY = document()
SETTINGS = OsmSettings(radius_m=200.0)


def client(cache_dir: Path | None = None, *, cache_only: bool = False) -> HttpClient:
    policy = HttpPolicy(attempts=2, first_wait_s=0.0, requests_per_s=1e6, timeout_s=5.0, cache_only=cache_only)
    return HttpClient(policy, cache_dir, sleep=lambda _: None)


def overpass(respond: Respond, tmp_path: Path, endpoints: tuple[str, ...] = ("/one", "/two")) -> OsmExtract | Rejection:
    with serving(respond) as server, client(tmp_path) as http:
        source = OverpassSource(http, tuple(server.url + path for path in endpoints))
        return source.extract([SITE], SETTINGS)[SITE.key]


def test_overpass_answers_are_cut_and_pruned_like_files(tmp_path: Path) -> None:
    asked: list[Request] = []

    def respond(request: Request, _: int) -> Answer:
        asked.append(request)
        return Answer(TOWN)

    cut = overpass(respond, tmp_path)
    assert isinstance(cut, OsmExtract)
    assert [w.id for w in cut.ways] == [10, 11]
    assert cut.nodes[4].tags == {"highway": "stop"}
    assert [r.id for r in cut.relations] == [20]
    assert cut.data_timestamp == "2026-01-02T03:04:05Z"
    ends = sorted(cut.nodes[i].longitude_deg for i in cut.ways[0].node_ids)
    assert ends[0] == pytest.approx(place(-200, 0)[1], abs=2e-6)
    assert ends[-1] == pytest.approx(place(200, 0)[1], abs=2e-6)
    assert len(asked) == 1
    assert b"residential" in asked[0].body
    assert b"building" in asked[0].body


def test_an_error_inside_a_good_status_moves_on_to_the_next_endpoint_and_is_not_cached(tmp_path: Path) -> None:
    paths: list[str] = []

    def respond(request: Request, _: int) -> Answer:
        paths.append(request.path)
        return Answer(OUT_OF_MEMORY if request.path == "/one" else TOWN)

    assert isinstance(overpass(respond, tmp_path), OsmExtract)
    assert paths == ["/one", "/one", "/two"]
    cached = b"".join(file.read_bytes() for file in tmp_path.rglob("*") if file.is_file())
    assert b"runtime error" not in cached
    assert b"Main Street" in cached


@pytest.mark.parametrize(
    "answer",
    [
        Answer(OUT_OF_MEMORY),
        Answer(b"<html>rate limited</html>"),
        Answer(TOWN[:300]),
        Answer(status=504),
        Answer(status=429, headers={"Retry-After": "0"}),
    ],
)
def test_when_no_endpoint_gives_a_right_answer_that_is_a_failure_that_may_pass(tmp_path: Path, answer: Answer) -> None:
    with pytest.raises(TransientFailure, match="no Overpass endpoint"):
        overpass(lambda *_: answer, tmp_path)


def test_a_refusal_for_good_is_a_failure_for_good(tmp_path: Path) -> None:
    with pytest.raises(Failure) as caught:
        overpass(lambda *_: Answer(b"bad query", status=400), tmp_path)
    assert not isinstance(caught.value, TransientFailure)


def test_a_place_without_roads_is_no_coverage(tmp_path: Path) -> None:
    rejection = overpass(lambda *_: Answer(EMPTY), tmp_path)
    assert isinstance(rejection, Rejection)
    assert rejection.reason == Reason.NO_MAP_COVERAGE


def test_the_same_box_is_asked_for_once(tmp_path: Path) -> None:
    with serving(lambda *_: Answer(TOWN)) as server:
        for cache_only in (False, True):
            with client(tmp_path, cache_only=cache_only) as http:
                source = OsmApiSource(http, server.url)
                assert isinstance(source.extract([SITE], SETTINGS)[SITE.key], OsmExtract)
        assert len(server.requests) == 1
        west, south, east, north = map(float, server.requests[0].query["bbox"].split(","))
        assert west < ORIGIN[1] < east
        assert south < ORIGIN[0] < north


def test_both_services_give_the_same_map(tmp_path: Path) -> None:
    from_overpass = overpass(lambda *_: Answer(TOWN), tmp_path)
    with serving(lambda *_: Answer(TOWN)) as server, client() as http:
        from_api = OsmApiSource(http, server.url).extract([SITE], SETTINGS)[SITE.key]
    assert isinstance(from_overpass, OsmExtract)
    assert isinstance(from_api, OsmExtract)
    assert (from_overpass.nodes, from_overpass.ways) == (from_api.nodes, from_api.ways)
    assert [each.id for each in from_overpass.surroundings] == ["node/6"]
    assert from_overpass.surroundings == from_api.surroundings


def test_a_site_off_the_earth_is_not_asked_for() -> None:
    with serving(lambda *_: Answer(status=500)) as server, client() as http:
        result = OsmApiSource(http, server.url).extract([Site("2023-9", 77.7777, 777.7777)], SETTINGS)["2023-9"]
        assert isinstance(result, Rejection)
        assert server.requests == []
