"""Dagster's web server behind a guard, and its daemon: what ``trace-dag ui`` starts.

Dagster's web server has no users: anybody who reaches it can run and delete everything, even by a plain link (``GET
/graphql?query=mutation...``). A page open in a browser on the same machine reaches it. So the guard accepts only
requests to the server's own names and from its own pages, and changes only by POST. It does not replace users and
passwords if others can reach the port; see ``deploy/``.

``/site`` of the server is the benchmark page: the files that its pages link to, by their paths below the root, and
nothing else. A browser opens no local file from a page that a server sent, so the links in the UI lead there. Pages are
made of untrusted reports and maps. They are sent with a sandbox that gives them an origin of their own, so that nothing
in them can act as the user of the UI.
"""

from __future__ import annotations

import http.client
import importlib
import json
import logging
import mimetypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import click

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, check_name, writable_folder
from trace_dag.export.build import INDEX
from trace_dag.export.crash_files import FOLDER
from trace_dag.pages.replay import PAGE

log = logging.getLogger(__name__)

_LOCAL: Final = ("localhost", "127.0.0.1", "::1")
_WITHOUT_EFFECT: Final = ("GET", "HEAD", "OPTIONS")
_CODE: Final = ("-m", "trace_dag.assets.definitions")
_FRAMES: Final = ("frame", "iframe", "embed", "object", "fencedframe")
_NO_FRAMES: Final = [(b"content-security-policy", b"frame-ancestors 'none'"), (b"x-frame-options", b"DENY")]
_OF_RUNS: Final = ("/download_debug/", "/logs/", "/notebook")
_NAMED: Final = frozenset({b"op"})  # by this the UI names the question that is in the body
_MOST_ASKED: Final = 2**24
"""Bytes of a question: launching 100,000 partitions takes 2 MB."""
_QUIET: Final = ("--log-level", "warning")
PREFIX: Final = "/site"
_HOME: Final = f"{PREFIX}/{FOLDER}/"
REPLAY: Final = f"{_HOME}{PAGE}"
"""The one page that is shown in frames, those of the crashes' pages: their origins are nobody's, not even their own."""
_SERVED: Final = (FOLDER, "pictures", Stage.ROAD_MAP.value, Stage.VERDICT.value)
_SANDBOX: Final = b"sandbox allow-scripts allow-popups allow-popups-to-escape-sandbox allow-downloads"
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Message, Receive, Send], Awaitable[None]]


class Guard:
    """An ASGI application in front of another. ``hosts``: names of the server, without port."""

    def __init__(self, app: App, hosts: tuple[str, ...]) -> None:
        self._app = app
        self._hosts = {host.lower() for host in hosts}

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it in a line."""
        refused = self._refused(scope) if scope["type"] in ("http", "websocket") else ""
        if not refused and scope["type"] == "http" and scope["method"] == "POST" and _asks_graphql(scope):
            body = await read_body(receive, _MOST_ASKED)
            if body is None or _is_no_question(scope, body):
                status, said = (413, f"at most {_MOST_ASKED} bytes") if body is None else (400, "a JSON object")
                await send_bytes(send, status, f"trace-dag ui: a question to GraphQL is {said}\n".encode())
                return
            receive = again(body, receive)
        if not refused and scope["type"] == "http":
            await self._answer(scope, receive, send)
        elif not refused:
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": refused})
        else:
            await send_bytes(send, 403, f"trace-dag ui: {refused}\n".encode())

    async def _answer(self, scope: Message, receive: Receive, send: Send) -> None:
        """Pass a request on to Dagster; forbid frames other than the replay, and answer 404 for unknown runs."""
        of_a_run = str(scope["path"]).startswith(_OF_RUNS)
        broken = False

        async def send_guarded(message: Message) -> None:
            nonlocal broken
            if message["type"] == "http.response.start":
                broken = of_a_run and message["status"] == 500
                if scope["path"] != REPLAY:
                    message = {**message, "headers": [*message["headers"], *_NO_FRAMES]}
            if not broken:
                await send(message)

        try:
            await self._app(scope, receive, send_guarded)
        except Exception as error:
            if not broken:
                raise
            log.warning("%r is answered as not found: %r", scope["path"], error)
        if broken:
            await send_bytes(send, 404, b"trace-dag ui: there is nothing of such a run\n", _NO_FRAMES)

    def _refused(self, scope: Message) -> str:
        """Return the reason to refuse a request; empty if it is accepted."""
        headers: dict[bytes, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.lower(), []).append(value.decode("latin-1"))
        hosts, origins = headers.get(b"host", []), headers.get(b"origin", [])
        if len(hosts) != 1 or (_host_of(hosts[0]) or "") not in self._hosts:
            return "this is not a name of this server; trace-dag ui --allow-host adds one"
        if any(urlsplit(origin).netloc.lower() != hosts[0].lower() for origin in origins):
            return "pages of other origins may not ask this server"
        if scope["type"] == "websocket":
            return ""
        if headers.get(b"sec-fetch-dest", [""])[0] in _FRAMES and scope["path"] != REPLAY:
            return "its pages are shown in no frame"
        if scope["path"].startswith(f"{PREFIX}/") and scope["method"] in _WITHOUT_EFFECT:
            return ""  # its pages have an origin of their own, and what they show changes nothing
        navigates = headers.get(b"sec-fetch-mode") == ["navigate"] and scope["method"] in _WITHOUT_EFFECT
        if not navigates and headers.get(b"sec-fetch-site", ["none"])[0] not in ("none", "same-origin"):
            return "pages of other origins may not ask this server"
        if _asks_graphql(scope):
            return _refused_question(scope, headers)
        return ""


def _asks_graphql(scope: Message) -> bool:
    return str(scope["path"]).rstrip("/").endswith("/graphql")


def _is_no_question(scope: Message, body: bytes) -> bool:
    """Return whether a body is JSON but no object, which Dagster cannot handle."""
    if not any(name.lower() == b"content-type" and b"json" in value.lower() for name, value in scope["headers"]):
        return False
    try:
        return not isinstance(json.loads(body), dict)
    except (ValueError, RecursionError):
        return True


def _refused_question(scope: Message, headers: dict[bytes, list[str]]) -> str:
    """Return the reason to refuse a GraphQL request that a plain link or form could send."""
    asked = parse_qs(scope["query_string"], keep_blank_values=True).keys()
    if asked - _NAMED or (asked and scope["method"] != "POST"):
        return "questions to GraphQL are sent by POST, in the body"
    content_type = headers.get(b"content-type", [""])[0].partition(";")[0].strip().lower()
    if scope["method"] == "POST" and content_type not in ("application/json", "application/graphql"):
        return "questions to GraphQL are sent as application/json"
    return ""


def _host_of(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def serve(root: str, host: str, port: int, *, allowed: tuple[str, ...] = (), read_only: bool = False) -> None:
    """Serve the UI until the process is asked to end; with the daemon, unless ``read_only``.

    The address is printed once the server answers, so that a script can wait for that line.
    """
    with writable_folder(Path(os.environ["DAGSTER_HOME"])) as home:
        os.environ["DAGSTER_HOME"] = str(home)
        os.chdir(home)
        _serve(root, host, port, allowed, read_only=read_only)


def _serve(root: str, host: str, port: int, allowed: Sequence[str], *, read_only: bool) -> None:
    cli: Any = importlib.import_module("dagster_webserver.cli")
    hosts = (*_LOCAL, host, *allowed)
    unguarded = cli.create_app_from_workspace_process_context

    def guarded(*arguments: Any, **options: Any) -> Guard:
        return Guard(BenchmarkSite(unguarded(*arguments, **options), Storage(root)), hosts)

    cli.create_app_from_workspace_process_context = guarded
    daemon = None if read_only else _start_daemon()
    words = ["--host", host, "--port", str(port), *_CODE, "--dagster-log-level", "warning"]
    signal.signal(signal.SIGINT, _end)  # also where a script has started this in the background
    signal.signal(signal.SIGTERM, _end)
    only = ", read-only" if read_only else ""
    greeting = (
        f"Dagster UI on http://{host}:{port} for {root}{only}, the site on http://{host}:{port}{PREFIX}/; Dagster's "
        f"history is in {os.environ['DAGSTER_HOME']} (Ctrl-C ends it)"
    )
    threading.Thread(target=_print_once_it_answers, args=(host, port, greeting), daemon=True).start()
    try:
        cli.cli(["--read-only", *words] if read_only else words, standalone_mode=False)
    except KeyboardInterrupt:
        pass
    finally:
        if daemon is not None:
            daemon.send_signal(signal.SIGINT)
            try:
                daemon.wait(timeout=20)
            except subprocess.TimeoutExpired:
                daemon.kill()


def _print_once_it_answers(host: str, port: int, greeting: str) -> None:
    local = "127.0.0.1" if host in ("", "0.0.0.0", "::") else host  # noqa: S104 - every interface holds this one
    while True:
        connection = http.client.HTTPConnection(local, port, timeout=5)
        try:
            connection.request("GET", "/server_info", headers={"Host": "localhost"})
            connection.getresponse().read()
        except (OSError, http.client.HTTPException):
            time.sleep(0.2)
        else:
            click.echo(greeting)
            return
        finally:
            connection.close()


def _start_daemon() -> subprocess.Popen[bytes]:
    """Return the Dagster daemon, which starts launched runs, in a process of its own."""
    beside = Path(sys.executable).with_name("dagster-daemon")
    return subprocess.Popen([str(beside), "run", *_CODE, *_QUIET])  # noqa: S603 - a program of this environment


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


# --- the benchmark page ----------------------------------------------------------------------------------------------
class BenchmarkSite:
    """An ASGI application in front of another: it serves files of a root below ``/site``."""

    def __init__(self, app: App, storage: Storage) -> None:
        self._app = app
        self._storage = storage

    def _inside(self, name: str) -> str:
        """Return the name, unless a symbolic link leads out of the root."""
        root = self._storage.local_root
        if root is not None and not (root / name).resolve().is_relative_to(root.resolve()):
            raise FileNotFoundError(name)
        return name

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Send a file of the site, or pass the request on if it is for another path."""
        path = str(scope.get("path", ""))
        if scope["type"] != "http" or not (path == PREFIX or path.startswith(f"{PREFIX}/")):
            await self._app(scope, receive, send)
            return
        if path in (PREFIX, f"{PREFIX}/", _HOME.rstrip("/")):
            await send_bytes(send, 307, b"", [(b"location", _HOME.encode())])
            return
        name = INDEX if path == _HOME else path.removeprefix(f"{PREFIX}/")
        try:
            if name.partition("/")[0] not in _SERVED:
                raise FileNotFoundError(name)
            data = self._storage.read(self._inside(check_name(name)))
        except (FileNotFoundError, IsADirectoryError, ValueError, UserError, Failure):
            await send_bytes(
                send,
                404,
                f"There is no {name} in the site; trace-dag run makes it, of many crashes trace-dag open.\n".encode(),
            )
            return
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        headers = [(b"content-security-policy", _SANDBOX), (b"x-content-type-options", b"nosniff")]
        await send_bytes(send, 200, b"" if scope["method"] == "HEAD" else data, headers, kind)


# --- ASGI ------------------------------------------------------------------------------------------------------------
async def send_bytes(
    send: Send, status: int, body: bytes, headers: Sequence[tuple[bytes, bytes]] = (), kind: str = "text/plain"
) -> None:
    """Send a whole answer; text is UTF-8."""
    content_type = f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
    all_headers = [(b"content-type", content_type.encode()), *headers]
    await send({"type": "http.response.start", "status": status, "headers": all_headers})
    await send({"type": "http.response.body", "body": body})


async def read_body(receive: Receive, most_bytes: int) -> bytes | None:
    """Read the body of a request; return None as soon as it is too large."""
    body = bytearray()
    more = True
    while more:
        message = await receive()
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > most_bytes:
            return None
    return bytes(body)


def again(body: bytes, receive: Receive) -> Receive:
    """Return a ``receive`` that first delivers a body that was read before."""
    left = [body]

    async def receive_again() -> Message:
        return {"type": "http.request", "body": left.pop(), "more_body": False} if left else await receive()

    return receive_again


if __name__ == "__main__":
    _root, _host, _port, _read_only, *_allowed = sys.argv[1:]
    serve(_root, _host, int(_port), allowed=tuple(_allowed), read_only=_read_only == "read-only")
