"""The network boundary against a server on loopback that misbehaves."""

from __future__ import annotations

import errno
import socket
import time
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from pathlib import Path

import pytest
from loopback import Answer, serving

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.network.http import HttpClient, HttpPolicy, UnreachableError

QUICK = HttpPolicy(timeout_s=0.3, attempts=3, first_wait_s=0.01, longest_wait_s=0.05, requests_per_s=1000)


class Naps:
    """A sleep that only notes how long it was asked for."""

    def __init__(self) -> None:
        self.taken_s: list[float] = []

    def __call__(self, seconds: float) -> None:
        self.taken_s.append(seconds)


def test_a_right_answer_is_given_once_asked() -> None:
    with serving(lambda request, _: Answer(request.query["a"].encode())) as server, HttpClient(QUICK) as http:
        assert http.get(f"{server.url}/x", {"a": "b"}) == b"b"
    assert len(server.requests) == 1


@pytest.mark.parametrize("status", [408, 429, 500, 502, 503, 504])
def test_transient_errors_are_retried(status: int) -> None:
    with serving(lambda _, before: Answer(status=status) if before < 2 else Answer(b"ok")) as server:
        assert HttpClient(QUICK, sleep=Naps()).get(server.url) == b"ok"
    assert len(server.requests) == 3


@pytest.mark.parametrize("status", [400, 401, 403, 404, 410])
def test_permanent_refusals_are_not_retried(status: int) -> None:
    with serving(lambda *_: Answer(status=status)) as server, pytest.raises(Failure, match=str(status)) as caught:
        HttpClient(QUICK).get(server.url)
    assert not isinstance(caught.value, TransientFailure)
    assert len(server.requests) == 1


def test_attempts_end() -> None:
    with serving(lambda *_: Answer(status=503)) as server, pytest.raises(TransientFailure, match=r"503.*3 attempts"):
        HttpClient(QUICK, sleep=Naps()).get(server.url)
    assert len(server.requests) == 3


def test_waits_grow_with_jitter() -> None:
    policy = HttpPolicy(attempts=6, first_wait_s=1, longest_wait_s=100, requests_per_s=1e9)
    first, second = Naps(), Naps()
    with serving(lambda *_: Answer(status=500)) as server:
        for naps in (first, second):
            with pytest.raises(TransientFailure):
                HttpClient(policy, sleep=naps).get(server.url)
    for index, wait_s in enumerate(first.taken_s):
        assert 2**index <= wait_s <= 2**index + 1
    assert first.taken_s != second.taken_s


@pytest.mark.parametrize("as_date", [False, True])
def test_retry_after_is_honoured(as_date: bool) -> None:
    moment = format_datetime(datetime.now(UTC) + timedelta(seconds=20), usegmt=True)
    headers = {"Retry-After": moment if as_date else "20"}
    naps = Naps()
    with serving(lambda _, before: Answer(b"ok") if before else Answer(status=429, headers=headers)) as server:
        assert HttpClient(QUICK, sleep=naps).get(server.url) == b"ok"
    assert max(naps.taken_s) == pytest.approx(20, abs=2)


def test_a_service_that_asks_to_come_back_tomorrow_is_left_alone() -> None:
    tomorrow = Answer(status=503, headers={"Retry-After": "86400"})
    with serving(lambda *_: tomorrow) as server, pytest.raises(TransientFailure, match="86400 s"):
        HttpClient(QUICK, sleep=Naps()).get(server.url)
    assert len(server.requests) == 1


def test_nonsense_in_retry_after_does_no_harm() -> None:
    headers = {"Retry-After": "soon"}
    with serving(lambda _, before: Answer(b"ok") if before else Answer(status=503, headers=headers)) as server:
        assert HttpClient(QUICK, sleep=Naps()).get(server.url) == b"ok"


def test_silence_is_a_time_out() -> None:
    with serving(lambda *_: Answer(b"late", delay_s=30)) as server, pytest.raises(TransientFailure, match=r"0\.3 s"):
        HttpClient(QUICK).get(server.url)


def test_a_torn_answer_is_asked_for_again() -> None:
    torn = Answer(b"half", declared_length=100)
    with serving(lambda _, before: Answer(b"whole") if before else torn) as server:
        assert HttpClient(QUICK, sleep=Naps()).get(server.url) == b"whole"


def test_nobody_there_may_pass() -> None:
    with serving(lambda *_: Answer()) as server:
        pass
    with pytest.raises(TransientFailure, match="ConnectError"):
        HttpClient(QUICK, sleep=Naps()).get(server.url)


@pytest.mark.parametrize("url", ["http://127.0.0.1:port/", "gopher://127.0.0.1/", "127.0.0.1"])
def test_no_url_at_all_will_not_pass(url: str) -> None:
    with pytest.raises(Failure, match="no URL"):
        HttpClient(QUICK).get(url)


def test_wrong_answers_are_asked_for_again_and_shown() -> None:
    def check(body: bytes) -> str | None:
        return None if body == b"right" else "not right"

    with serving(lambda _, before: Answer(b"right" if before else b"<html>")) as server:
        assert HttpClient(QUICK, sleep=Naps()).get(server.url, check=check) == b"right"
    with serving(lambda *_: Answer(b"<html>")) as server, pytest.raises(TransientFailure, match=r"not right.*<html>"):
        HttpClient(QUICK, sleep=Naps()).get(server.url, check=check)


def test_large_answers_are_cut_off() -> None:
    policy = HttpPolicy(max_bytes=1000)
    with serving(lambda *_: Answer(b"x" * 2000)) as server, pytest.raises(Failure, match="larger than"):
        HttpClient(policy).get(server.url)


def test_answers_that_drip_are_given_up() -> None:
    ticks = iter(range(0, 10_000, 100))
    client = HttpClient(
        HttpPolicy(total_s=50, attempts=1, requests_per_s=1e9), clock=lambda: float(next(ticks)), sleep=Naps()
    )
    with serving(lambda *_: Answer(b"x" * 1000)) as server, pytest.raises(TransientFailure, match="not complete"):
        client.get(server.url)


def test_the_rate_is_polite() -> None:
    policy = HttpPolicy(requests_per_s=20)
    with serving(lambda *_: Answer(b"ok")) as server, HttpClient(policy) as http:
        start_s = time.monotonic()
        for _ in range(5):
            http.get(server.url)
    assert time.monotonic() - start_s >= 4 / 20


# --- the cache -----------------------------------------------------------------------------------------------------


def test_the_same_request_is_sent_once(tmp_path: Path) -> None:
    with serving(lambda _, before: Answer(f"{before}".encode())) as server:
        for _ in range(2):
            with HttpClient(QUICK, cache_dir=tmp_path) as http:
                assert http.get(server.url, {"a": "1", "b": "2"}) == b"0"
                assert http.get(server.url, {"b": "2", "a": "1"}) == b"0"
                assert http.get(server.url, {"a": "2"}) == b"1"
                assert http.post(server.url, {"a": "1", "b": "2"}) == b"2"
    assert len(server.requests) == 3


@pytest.mark.parametrize(
    "failing", [Answer(status=500), Answer(status=404), Answer(b"wrong"), Answer(b"h", declared_length=9)]
)
def test_failures_are_never_stored(failing: Answer, tmp_path: Path) -> None:
    def check(body: bytes) -> str | None:
        return "wrong" if body == b"wrong" else None

    with serving(lambda *_: failing) as server, pytest.raises(Failure):
        HttpClient(QUICK, cache_dir=tmp_path, sleep=Naps()).get(server.url, check=check)
    assert list(tmp_path.rglob("*")) == []


def test_cache_only_sends_nothing(tmp_path: Path) -> None:
    cache_only = HttpPolicy(cache_only=True)
    with serving(lambda *_: Answer(b"ok")) as server:
        with pytest.raises(Failure, match="cache-only"):
            HttpClient(cache_only, cache_dir=tmp_path).get(server.url)
        with pytest.raises(Failure, match="cache-only"):
            HttpClient(cache_only).get(server.url)
        assert server.requests == []
        HttpClient(QUICK, cache_dir=tmp_path).get(server.url)
        assert HttpClient(cache_only, cache_dir=tmp_path).get(server.url) == b"ok"
        assert len(server.requests) == 1


@pytest.mark.parametrize(
    "broken",
    [socket.gaierror(socket.EAI_NONAME, "Name or service not known"), OSError(errno.ENETUNREACH, "unreachable")],
)
def test_without_a_network_one_look_is_enough_and_what_helps_is_reported(
    monkeypatch: pytest.MonkeyPatch, broken: OSError
) -> None:
    looks: list[object] = []

    def no_way(*address: object, **_: object) -> None:
        looks.append(address)
        raise broken

    monkeypatch.setattr(socket, "create_connection", no_way)
    monkeypatch.setattr(socket, "getaddrinfo", no_way)
    naps = Naps()
    http = HttpClient(HttpPolicy(requests_per_s=1e3), instead="download it by hand", sleep=naps)
    for url in ("http://crashes.invalid/a", "http://crashes.invalid/b"):
        with pytest.raises(UnreachableError, match=r"^crashes\.invalid cannot be reached \(.*\); download it by hand$"):
            http.get(url)
    assert len(looks) == 1
    assert naps.taken_s == []


def test_a_download_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    with serving(lambda _, before: Answer(status=503) if before == 0 else Answer(b"tables" * 1000)) as server:
        HttpClient(QUICK, sleep=Naps()).download(server.url, tmp_path / "tables.zip")
        assert (tmp_path / "tables.zip").read_bytes() == b"tables" * 1000
        with pytest.raises(Failure, match="larger than"):
            HttpClient(HttpPolicy(max_bytes=100)).download(server.url, tmp_path / "large.zip")
    assert [path.name for path in tmp_path.iterdir()] == ["tables.zip"]
