"""One rate over several processes, clients and a machine that was started again."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest
from loopback import Answer, serving

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.network.http import HttpClient, HttpPolicy
from trace_dag.common.network.rate_limit import take_turn

TAKE_FIVE = """
import json, sys, time
from pathlib import Path
from trace_dag.common.network.rate_limit import take_turn
print(json.dumps([take_turn(Path(sys.argv[1]), time.monotonic(), 0.1) for _ in range(5)]))
"""


def test_turns_of_several_processes_keep_their_distance(tmp_path: Path) -> None:
    command = [sys.executable, "-c", TAKE_FIVE, str(tmp_path / "turns")]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(3)]
    turns = sorted(turn for process in processes for turn in json.loads(process.communicate()[0]))
    assert len(turns) == 15
    assert min(b - a for a, b in pairwise(turns)) == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("content", [b"", b"torn", b"\0" * 7])
def test_a_damaged_file_is_no_obstacle(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "turns"
    path.write_bytes(content)
    assert take_turn(path, 7.0, 1.0) == 7.0


def test_turns_left_by_a_machine_started_again_since_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "turns"
    take_turn(path, time.monotonic() + 1e6, 1.0)
    now_s = time.monotonic()
    assert take_turn(path, now_s, 1.0) == now_s


def test_clients_with_the_same_file_share_the_rate(tmp_path: Path) -> None:
    policy = HttpPolicy(requests_per_s=20.0)
    with serving(lambda *_: Answer(b"x")) as server:
        began_s = time.monotonic()
        for _ in range(5):
            with HttpClient(policy, turns=tmp_path / "turns") as http:
                http.get(server.url)
    assert time.monotonic() - began_s >= 4 / 20.0


def test_answers_that_will_not_last_are_asked_for_again(tmp_path: Path) -> None:
    with serving(lambda _, before: Answer(b"not yet" if before == 0 else b"here")) as server:
        http = HttpClient(HttpPolicy(requests_per_s=1e3), tmp_path)
        answers = [http.get(server.url, lasts=lambda body: body == b"here") for _ in range(3)]
        assert answers == [b"not yet", b"here", b"here"]
        assert len(server.requests) == 2


def test_refreshing_replaces_what_is_in_the_cache(tmp_path: Path) -> None:
    with serving(lambda _, before: Answer(str(before).encode())) as server:
        assert HttpClient(HttpPolicy(), tmp_path).get(server.url) == b"0"
        assert HttpClient(HttpPolicy(refresh=True), tmp_path).get(server.url) == b"1"
        assert HttpClient(HttpPolicy(), tmp_path).get(server.url) == b"1"
        assert HttpClient(HttpPolicy(refresh=True, cache_only=True), tmp_path).get(server.url) == b"1"


def test_a_service_that_is_down_is_asked_once_per_request_until_it_answers() -> None:
    down = {"it": True}
    policy = HttpPolicy(attempts=4, first_wait_s=0.0, requests_per_s=1e3)
    with serving(lambda *_: Answer(status=503) if down["it"] else Answer(b"ok")) as server:
        http = HttpClient(policy)
        for _ in range(3):
            with pytest.raises(TransientFailure):
                http.get(server.url)
        assert len(server.requests) == 4 + 1 + 1
        down["it"] = False
        assert http.get(server.url) == b"ok"
        down["it"] = True
        with pytest.raises(Failure):
            http.get(server.url)
        assert len(server.requests) == 6 + 1 + 4
