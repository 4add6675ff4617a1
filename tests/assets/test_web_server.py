"""Dagster's real web server as ``trace-dag ui`` starts it, and what pages of other sites make a browser ask it."""

from __future__ import annotations

import http.client
import itertools
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlencode

import pytest
from loopback import free_port
from sample_runs import command, ingest, reports_of
from waiting import eventually

from tests.browser import CHROMIUM, Page

REPOSITORY = Path(__file__).resolve().parents[2]
MUTATION = "mutation { setNuxSeen } "
VERSION = "{ version }"


class Server:
    def __init__(self, port: int) -> None:
        self.port = port
        self.host = f"127.0.0.1:{port}"

    def ask(self, method: str, path: str, body: str = "", **headers: str) -> tuple[int, str]:
        """Status and text of an answer; headers by name with ``_`` for ``-``, Host as it should be unless given."""
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=300)
        try:
            connection.request(method, path, body or None, {"Host": self.host, **named})
            answer = connection.getresponse()
            return answer.status, answer.read().decode(errors="replace")
        finally:
            connection.close()

    def graphql(self, query: str, **headers: str) -> tuple[int, str]:
        given = {"Content_Type": "application/json", **headers}
        return self.ask("POST", "/graphql", json.dumps({"query": query}), **given)


@contextmanager
def serving(root: Path, *options: str) -> Iterator[Server]:
    server = Server(free_port())
    process = subprocess.Popen(
        command(root, "ui", "--port", str(server.port), *options),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env=os.environ | {"TRACE_DAG_EXECUTION__EXECUTOR": "in_process"},
    )
    try:
        greeting = f"Dagster UI on http://127.0.0.1:{server.port} for {root}"
        said = list(itertools.takewhile(lambda line: not line.startswith(greeting), process.stdout))
        assert process.poll() is None, said
        assert server.ask("GET", "/server_info")[0] == 200, "the address was printed before it answered"
        yield server
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(timeout=300)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ui")
    assert ingest(folder / "root", reports_of(folder / "reports", ("2023-319003",))).returncode == 0
    return folder / "root"


@pytest.fixture(scope="module")
def server(root: Path) -> Iterator[Server]:
    with serving(root, "--allow-host", "crashes.example.org") as started:
        yield started


def test_its_own_page_and_programs_may_ask_and_change(server: Server):
    for headers in ({}, {"Origin": f"http://{server.host}", "Sec_Fetch_Site": "same-origin"}):
        status, said = server.graphql(VERSION, **headers)
        assert (status, "version" in json.loads(said)["data"]) == (200, True)
        status, said = server.graphql(MUTATION, **headers)
        assert (status, json.loads(said)["data"]) == (200, {"setNuxSeen": True})
    named = server.ask("POST", "/graphql?op=Version", json.dumps({"query": VERSION}), Content_Type="application/json")
    assert named[0] == 200, "the UI names its questions in the address"
    assert server.ask("GET", "/", Accept="text/html")[0] == 200
    assert server.ask("GET", "/", Accept="text/html", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="navigate")[0] == 200
    assert server.graphql(VERSION, Host=f"localhost:{server.port}")[0] == 200
    assert server.graphql(VERSION, Host="crashes.example.org", Origin="https://crashes.example.org")[0] == 200


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_in_a_browser_the_ui_is_refused_nothing(server: Server, tmp_path: Path):
    with Page(tmp_path / "profile") as page:
        page.open(f"http://{server.host}/assets/verdict")
        page.wait("document.body.innerText.includes('Materialize')")
        assert [error for error in page.errors if "403" in error or "Application error" in error] == []


def test_no_page_frames_it(server: Server):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=300)
    for path in ("/", "/site/"):
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        assert answer.getheader("X-Frame-Options") == "DENY"
        assert "frame-ancestors 'none'" in answer.getheader("Content-Security-Policy")
    connection.close()
    for path in ("/", "/site/"):
        assert server.ask("GET", path, Sec_Fetch_Dest="iframe", Sec_Fetch_Mode="navigate")[0] == 403


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_of_a_crash_shows_its_replay_in_a_frame(server: Server, root: Path, tmp_path: Path):
    crashes = root / "benchmark" / "crashes"
    crashes.mkdir(parents=True)
    (crashes / "crash.html").write_text("<iframe src='../replay.html?2023-319003'></iframe>")
    (crashes.parent / "replay.html").write_text("<p>A replay")
    with Page(tmp_path / "profile") as page:
        page.open(f"http://{server.host}/site/benchmark/crashes/crash.html")
        assert any("replay.html" in each for each in page.requests)
        assert [error for error in page.errors if "replay.html" in error] == []


def test_absent_records_of_a_run_are_not_found(server: Server):
    assert server.ask("GET", "/download_debug/x")[0] == 404
    assert server.ask("GET", "/logs/x/y/z")[0] == 404


def test_plain_dagster_shows_the_same_history(server: Server, root: Path):
    """As ``dagster dev -w workspace.yaml`` in a checkout: dagster.yaml and .env lead it to the root's history."""
    asked = '{ assetNodeOrError(assetKey: {path: ["verdict"]}) { ... on AssetNode { partitionKeys } } }'
    plain = Server(free_port())
    command = [Path(sys.executable).with_name("dagster-webserver"), "-w", "workspace.yaml", "-p", str(plain.port)]
    inherited = {name: value for name, value in os.environ.items() if name != "DAGSTER_HOME"}
    process = subprocess.Popen(command, cwd=REPOSITORY, env=inherited | {"TRACE_DAG_ROOT": str(root)})
    try:
        eventually(lambda: process.poll() is not None or answers(plain), "it does not answer")
        answer = json.loads(plain.graphql(asked)[1])
        assert answer["data"]["assetNodeOrError"]["partitionKeys"] == ["2023-319003"]
        assert answer == json.loads(server.graphql(asked)[1])
    finally:
        process.terminate()
        process.wait(timeout=300)


def answers(server: Server) -> bool:
    try:
        return server.ask("GET", "/server_info")[0] == 200
    except OSError:
        return False


FOREIGN = {"Origin": "http://evil.example.org", "Sec_Fetch_Site": "cross-site"}


@pytest.mark.parametrize(
    ("method", "path", "body", "headers"),
    [
        ("GET", "/graphql?" + urlencode({"query": MUTATION}), "", {}),
        ("GET", "/graphql?" + urlencode({"query": MUTATION}), "", {"Sec_Fetch_Mode": "navigate", **FOREIGN}),
        ("GET", "/graphql/?" + urlencode({"query": VERSION}), "", {}),
        ("POST", "/graphql?" + urlencode({"query": MUTATION}), "", {}),
        ("POST", "/graphql?op=Nux&" + urlencode({"query": MUTATION}), "", {}),
        ("GET", "/graphql?op=Nux", "", {}),
        ("POST", "/graphql", json.dumps({"query": MUTATION}), {"Content_Type": "text/plain"}),
        ("POST", "/graphql", json.dumps({"query": MUTATION}), {"Content_Type": "application/json", **FOREIGN}),
        (
            "POST",
            "/graphql",
            json.dumps({"query": MUTATION}),
            {"Content_Type": "application/json", "Origin": "null"},
        ),
        ("POST", "/graphql", MUTATION, {"Content_Type": "application/graphql", "Sec_Fetch_Site": "same-site"}),
        ("POST", "/graphql", json.dumps({"query": VERSION}), {"Content_Type": "application/json", "Host": "evil.org"}),
        ("GET", "/", "", {"Host": "evil.example.org"}),
        ("GET", "/server_info", "", {"Host": "127.0.0.1.evil.example.org"}),
        ("GET", "/server_info", "", FOREIGN),
    ],
)
def test_requests_from_another_site_are_refused(
    server: Server, method: str, path: str, body: str, headers: dict[str, str]
):
    status, said = server.ask(method, path, body, **headers)
    assert status == 403, said
    assert said.startswith("trace-dag ui: ")
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize(
    ("body", "status"),
    [("[]", 400), ("null", 400), ("1", 400), ("{", 400), ("[" * 100_000, 400), ('"' + "a" * 2**24, 413)],
    ids=["list", "null", "number", "half", "nested", "large"],
)
def test_a_body_that_is_no_question_is_refused_in_a_line(server: Server, body: str, status: int):
    answered, said = server.ask("POST", "/graphql", body, Content_Type="application/json")
    assert answered == status
    assert said.startswith("trace-dag ui: a question to GraphQL is ")
    assert len(said.splitlines()) == 1


def test_a_socket_is_for_its_own_pages(server: Server):
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec_WebSocket_Protocol": "graphql-ws",
    }
    assert server.ask("GET", "/graphql", **upgrade, Origin="http://evil.example.org")[0] == 403
    assert server.ask("GET", "/graphql", **upgrade, Host="evil.example.org")[0] == 403
    assert server.ask("GET", "/graphql", **upgrade, Origin=f"http://{server.host}")[0] == 101


LAUNCH = """
mutation { launchRun(executionParams: {
  selector: {
    repositoryLocationName: "trace_dag.assets.definitions", repositoryName: "__repository__", pipelineName: "summary"
  },
  runConfigData: %s, mode: "default"}) { __typename ... on PythonError { message }
  ... on RunConfigValidationInvalid { errors { message } } } }
"""


def test_a_runs_configuration_cannot_move_the_root(server: Server, root: Path, tmp_path: Path):
    moved = json.dumps(json.dumps({"resources": {"workspace": {"config": {"root": str(tmp_path / "elsewhere")}}}}))
    status, said = server.graphql(LAUNCH % moved)
    assert status == 200
    assert json.loads(said)["data"]["launchRun"]["__typename"] == "RunConfigValidationInvalid", said
    assert not (tmp_path / "elsewhere").exists()


def test_read_only_is_read_only(root: Path):
    with serving(root, "--read-only") as server:
        assert server.graphql(VERSION)[0] == 200
        _, said = server.graphql(LAUNCH % json.dumps("{}"))
        assert json.loads(said)["data"]["launchRun"]["__typename"] == "UnauthorizedError", said
        _, said = server.graphql(
            'mutation { wipeAssets(assetPartitionRanges: [{assetKey: {path: ["warehouse"]}}]) { __typename } }'
        )
        assert json.loads(said)["data"]["wipeAssets"]["__typename"] == "UnauthorizedError", said
