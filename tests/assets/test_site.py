"""The benchmark page over http: its files and nothing else of the root, with an origin of their own."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from trace_dag.assets.webserver import BenchmarkSite
from trace_dag.common.storage.files import Storage


async def _dagster(_scope: Any, _receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"Dagster's"})


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    storage = Storage.open(tmp_path / "root")
    storage.write("benchmark/index.html", b"<h1>All crashes</h1>")
    storage.write("benchmark/crashes/2023-1.html", b"<h1>One</h1>")
    storage.write("pictures/2023-1.png", b"\x89PNG")
    storage.write("raw_report/2023-1.xml", b"<x/>")
    storage.write("settings.toml", b"")
    return storage


def asked(storage: Storage, path: str, method: str = "GET") -> tuple[int, dict[str, str], bytes]:
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(BenchmarkSite(_dagster, storage)({"type": "http", "path": path, "method": method}, None, send))
    headers = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    return sent[0]["status"], headers, sent[1]["body"]


def test_pages_are_served_with_their_type_and_cannot_act_for_the_ui(storage):
    status, headers, body = asked(storage, "/site/benchmark/crashes/2023-1.html")
    assert (status, body) == (200, b"<h1>One</h1>")
    assert headers["content-type"] == "text/html; charset=utf-8"
    policy = headers["content-security-policy"].split()
    assert policy[0] == "sandbox"
    assert "allow-same-origin" not in policy
    assert asked(storage, "/site/pictures/2023-1.png")[2] == b"\x89PNG"
    assert asked(storage, "/site/benchmark/")[2] == b"<h1>All crashes</h1>"
    assert asked(storage, "/site/benchmark/", "HEAD")[2] == b""
    for short in ("/site", "/site/", "/site/benchmark"):
        assert asked(storage, short)[1]["location"] == "/site/benchmark/"


@pytest.mark.parametrize(
    "path",
    [
        *("/site/../settings.toml", "/site/settings.toml", "/site/raw_report/2023-1.xml", "/site//etc/passwd"),
        *("/site/.hidden", "/site/benchmark/crashes", "/site/benchmark/x", "/site/benchmark/../settings.toml"),
    ],
)
def test_nothing_else_of_the_root_is_served(storage, path):
    status, _, body = asked(storage, path)
    assert status == 404
    assert b"trace-dag run makes it" in body


def test_everything_else_is_dagsters(storage):
    assert asked(storage, "/graphql")[2] == b"Dagster's"
    assert asked(storage, "/sites")[2] == b"Dagster's"


def test_a_link_out_of_the_root_is_not_followed(storage: Storage, tmp_path: Path) -> None:
    (tmp_path / "secret.txt").write_text("of others")
    (tmp_path / "root" / "pictures" / "linked.txt").symlink_to(tmp_path / "secret.txt")
    assert asked(storage, "/site/pictures/linked.txt")[0] == 404
    (tmp_path / "root" / "pictures" / "inside.png").symlink_to(tmp_path / "root" / "pictures" / "2023-1.png")
    assert asked(storage, "/site/pictures/inside.png")[0] == 200
