"""A server on the loopback interface that answers as a test tells it to."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit


@dataclass(frozen=True)
class Request:
    """What was asked."""

    path: str
    query: dict[str, str]
    body: bytes = b""
    method: str = "GET"


@dataclass(frozen=True)
class Answer:
    """What is answered. ``declared_length`` above the body's tears the connection; ``delay_s`` waits before, ``byte_s``
    before each byte."""

    body: bytes = b""
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    declared_length: int | None = None
    delay_s: float = 0.0
    byte_s: float = 0.0


Respond = Callable[[Request, int], Answer]
"""From the request and how many came before it to the answer."""


@dataclass
class Loopback:
    """A running server: its address and what it was asked."""

    url: str
    requests: list[Request]


def free_port() -> int:
    """A port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def serving(respond: Respond) -> Iterator[Loopback]:
    """A server that answers with ``respond`` as long as the context lasts."""
    stop = threading.Event()
    requests: list[Request] = []

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def _answer(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            address = urlsplit(self.path)
            query = {name: values[0] for name, values in parse_qs(address.query).items()}
            request = Request(address.path, query, body, self.command)
            answer = respond(request, len(requests))
            requests.append(request)
            stop.wait(answer.delay_s)
            try:
                self.send_response(answer.status)
                for name, value in answer.headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(answer.declared_length or len(answer.body)))
                self.end_headers()
                for byte in answer.body if answer.byte_s else b"":
                    stop.wait(answer.byte_s)
                    self.wfile.write(bytes([byte]))
                    self.wfile.flush()
                if self.command != "HEAD" and not answer.byte_s:
                    self.wfile.write(answer.body)
            except ConnectionError:
                pass  # the client gave up, as it should
            if answer.declared_length is not None:
                self.close_connection = True

        do_GET = do_POST = do_HEAD = _answer

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield Loopback(f"http://127.0.0.1:{server.server_address[1]}", requests)
    finally:
        stop.set()
        server.shutdown()
        server.server_close()
