"""The one network boundary: every request to a public service goes through :class:`HttpClient`.

Time-outs, exponential back-off with jitter on what may pass by itself (408, 429, 5xx, lost connections, wrong answers),
``Retry-After`` honoured, a polite rate, bounded answers, and a cache on disk keyed by the request that never holds a
failure. A missing network is detected and reported once. In cache-only mode nothing leaves the machine. The client
knows no service: the caller defines which answers are right and how long they last.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final
from urllib.parse import urlsplit

from tenacity import (
    RetryCallState,
    RetryError,
    Retrying,
    retry_if_exception_type,
    stop_after_attempt,
    wait_exponential,
    wait_random,
)

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.messages.wording import count_of
from trace_dag.common.network.rate_limit import take_turn
from trace_dag.common.storage.files import Storage

if TYPE_CHECKING:
    import httpx

TRANSIENT_STATUS: Final = frozenset({408, 425, 429, 500, 502, 503, 504})
USER_AGENT: Final = "trace-dag (crash reconstruction research)"
_SNIPPET: Final = 120
_UNREACHABLE_FOR_S: Final = 60.0  # for so long a host to which there was no way is not tried again
_NO_ROUTE: Final = frozenset({errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN})
_BODY: Final = ".body"

Check = Callable[[bytes], str | None]
"""Looks at an answer: None if it is a right one, else what is wrong with it."""

Lasts = Callable[[bytes], bool]
"""Looks at a right answer: whether it will be the same tomorrow and belongs in the cache."""


@dataclass(frozen=True)
class HttpPolicy:
    """Pace and patience of requests.

    Times in seconds.

    ``timeout_s`` bounds every wait for the service, ``total_s`` a whole answer, however slowly it drips. ``refresh``
    asks again for what is in the cache. A service that did not answer after all attempts is asked once per request
    from then on, until it answers.
    """

    timeout_s: float = 60.0
    total_s: float = 600.0
    attempts: int = 5
    first_wait_s: float = 1.0
    longest_wait_s: float = 60.0
    longest_retry_after_s: float = 300.0
    requests_per_s: float = 2.0
    max_bytes: int = 256 * 1024 * 1024
    cache_only: bool = False
    refresh: bool = False


class _AskAgain(TransientFailure):
    """A failure that may pass, and how long the service asked to wait, if it did."""

    def __init__(self, message: str, retry_after_s: float | None = None) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class UnreachableError(TransientFailure):
    """A service cannot be reached from this machine now; it is not asked again at once."""

    def __init__(self, message: str) -> None:
        super().__init__(message, tried_again=True)


@dataclass
class HttpClient:
    """A client for one service. Safe to use from several threads; the rate holds over all of them.

    With ``turns``, a file, it holds over all processes of the machine that were given the same one.
    ``instead`` is the remedy that is named if there is no network. ``sleep`` and ``clock`` (monotonic seconds) are for
    tests.
    """

    policy: HttpPolicy = HttpPolicy()
    cache_dir: Path | None = None
    turns: Path | None = None
    instead: str = ""
    sleep: Callable[[float], None] = time.sleep
    clock: Callable[[], float] = time.monotonic
    _client: httpx.Client | None = field(default=None, init=False, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False)
    _next_free_s: float = field(default=float("-inf"), init=False, repr=False)
    _down: bool = field(default=False, init=False, repr=False)
    _unreachable: dict[str, tuple[float, str]] = field(default_factory=dict, init=False, repr=False)  # until when; why

    def get(
        self,
        url: str,
        params: Mapping[str, str] | None = None,
        *,
        check: Check | None = None,
        lasts: Lasts | None = None,
    ) -> bytes:
        """Return the body of a GET.

        See :meth:`request`.
        """
        return self.request("GET", url, params=params, check=check, lasts=lasts)

    def download(self, url: str, to: Path) -> None:
        """Write the body of a GET into a file, which appears only when complete.

        Raises the errors of :meth:`request`.
        """
        part = to.with_name(f"{to.name}.part")
        try:
            self.request("GET", url, to=part)
            part.replace(to)
        finally:
            part.unlink(missing_ok=True)

    def post(self, url: str, data: Mapping[str, str], *, check: Check | None = None) -> bytes:
        """Return the body of a POST of a form.

        See :meth:`request`.
        """
        return self.request("POST", url, data=data, check=check)

    def request(
        self,
        method: str,
        url: str,
        *,
        params: Mapping[str, str] | None = None,
        data: Mapping[str, str] | None = None,
        check: Check | None = None,
        lasts: Lasts | None = None,
        to: Path | None = None,
    ) -> bytes:
        """Return the body of a right answer, from the cache if the same request is kept there and ``lasts``.

        With ``to`` it is written into that file instead, and neither returned nor kept.

        Raises: UnreachableError: there is no network, or no such host in it. TransientFailure: no right answer after
        all attempts, of a kind that may pass by itself. Failure: the request was refused for good (a 4xx), or is not in
        the cache in cache-only mode.
        """
        cached = None if to else self._cached(method, url, params, data)
        if cached is not None and not (self.policy.refresh and not self.policy.cache_only):
            kept = _kept(cached)
            if kept is not None:
                return kept
        if self.policy.cache_only:
            raise Failure(
                f"{method} {url}: not in the cache, and cache-only mode allows no request; run once with it off"
            )
        back_off = wait_exponential(multiplier=self.policy.first_wait_s, max=self.policy.longest_wait_s) + wait_random(
            0, self.policy.first_wait_s
        )

        def wait(state: RetryCallState) -> float:
            error = state.outcome.exception() if state.outcome else None
            asked_s = error.retry_after_s if isinstance(error, _AskAgain) else None
            return max(back_off(state), asked_s or 0.0)

        attempts = 1 if self._down else self.policy.attempts
        retrying = Retrying(
            retry=retry_if_exception_type(_AskAgain),
            stop=stop_after_attempt(attempts),
            wait=wait,
            sleep=self.sleep,
            reraise=True,
        )
        try:
            body = retrying(self._ask_once, method, url, params, data, check, to)
        except _AskAgain as error:
            self._down = True
            raise TransientFailure(f"{error} (after {count_of(attempts, 'attempt')})") from error
        self._down = False
        if cached is not None and (lasts is None or lasts(body)):
            _store(cached, body, {"method": method, "url": url, "params": dict(params or {}), "data": dict(data or {})})
        return body

    def close(self) -> None:
        """Release the connections; it is safe to call this twice."""
        with self._lock:
            if self._client is not None:
                self._client.close()
                self._client = None

    def __enter__(self) -> HttpClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask_once(
        self,
        method: str,
        url: str,
        params: Mapping[str, str] | None,
        data: Mapping[str, str] | None,
        check: Check | None,
        to: Path | None,
    ) -> bytes:
        import httpx  # which takes a tenth of a second to load, and nothing is asked in most runs

        host = urlsplit(url).hostname or url
        until_s, why = self._unreachable.get(host, (-math.inf, ""))
        if self.clock() < until_s:
            raise UnreachableError(why)
        self._wait_for_turn()
        try:
            with self._connection().stream(method, url, params=params, data=data) as response:
                if response.status_code in TRANSIENT_STATUS:
                    raise _AskAgain(f"{method} {url}: {_status(response)}", self._retry_after_s(response))
                if not response.is_success:
                    raise Failure(
                        f"{method} {url}: {_status(response)}; the request is wrong, or the service has moved"
                    )
                with to.open("wb") if to else io.BytesIO() as body_file:
                    self._receive(response, f"{method} {url}", body_file)
                    body = body_file.getvalue() if isinstance(body_file, io.BytesIO) else b""
        except httpx.TimeoutException as error:
            raise _AskAgain(f"{method} {url}: no answer within {self.policy.timeout_s:g} s") from error
        except (httpx.InvalidURL, httpx.UnsupportedProtocol) as error:
            raise Failure(f"{method} {url}: no URL that can be asked: {error}") from error
        except httpx.TransportError as error:
            if (reason := _no_way_to(error)) is not None:
                why = f"{host} cannot be reached ({reason}){self.instead and f'; {self.instead}'}"
                self._unreachable[host] = (self.clock() + _UNREACHABLE_FOR_S, why)
                raise UnreachableError(why) from error
            raise _AskAgain(f"{method} {url}: {type(error).__name__}: {error}") from error
        problem = check(body) if check is not None else None
        if problem is not None:
            raise _AskAgain(f"{method} {url}: wrong answer: {problem}; it begins {body[:_SNIPPET]!r}")
        return body

    def _receive(self, response: httpx.Response, what: str, into: IO[bytes]) -> None:
        """Write a body of bounded size and duration into a file."""
        size = 0
        end_s = self.clock() + self.policy.total_s
        for chunk in response.iter_bytes():
            size += len(chunk)
            if self.clock() > end_s:
                raise _AskAgain(f"{what}: the answer was not complete after {self.policy.total_s:g} s")
            if size > self.policy.max_bytes:
                raise Failure(f"{what}: the answer is larger than {self.policy.max_bytes / 1e6:.0f} MB; ask for less")
            into.write(chunk)

    def _retry_after_s(self, response: httpx.Response) -> float | None:
        """Return the seconds that the service asks to wait (RFC 9110, 10.2.3: seconds or a date).

        Raises TransientFailure at once if that is longer than a run should wait.
        """
        value = response.headers.get("Retry-After", "").strip()
        if not value:
            return None
        if value.isascii() and value.isdigit():
            wait_s = float(value)
        else:
            try:
                moment = parsedate_to_datetime(value)
            except ValueError:
                return None
            wait_s = max(0.0, (moment.replace(tzinfo=moment.tzinfo or UTC) - datetime.now(UTC)).total_seconds())
        if wait_s > self.policy.longest_retry_after_s:
            raise TransientFailure(
                f"{response.request.url}: {_status(response)}; the service asks to wait {wait_s:.0f} s, more than "
                f"{self.policy.longest_retry_after_s:.0f} s; try again later"
            )
        return wait_s

    def _wait_for_turn(self) -> None:
        with self._lock:
            now_s = self.clock()
            gap_s = 1 / self.policy.requests_per_s
            turn_s = max(now_s, self._next_free_s)
            if self.turns is not None:
                turn_s = take_turn(self.turns, turn_s, gap_s)
            self._next_free_s = turn_s + gap_s
        if turn_s > now_s:
            self.sleep(turn_s - now_s)

    def _connection(self) -> httpx.Client:
        import httpx

        with self._lock:
            if self._client is None:
                self._client = httpx.Client(
                    timeout=self.policy.timeout_s, follow_redirects=True, headers={"User-Agent": USER_AGENT}
                )
            return self._client

    def _cached(
        self, method: str, url: str, params: Mapping[str, str] | None, data: Mapping[str, str] | None
    ) -> Path | None:
        if self.cache_dir is None:
            return None
        request = json.dumps([method, url, sorted((params or {}).items()), sorted((data or {}).items())])
        digest = hashlib.sha256(request.encode()).hexdigest()
        return self.cache_dir / digest[:2] / f"{digest}{_BODY}"


def send_json(url: str, document: Mapping[str, object], *, attempts: int = 3, timeout_s: float = 10.0) -> None:
    """POST a document to a web hook.

    Raises :class:`Failure`, which names only the host, because the path may be a secret.
    """
    import httpx

    host = urlsplit(url).hostname or "the web hook"
    trying = Retrying(
        retry=retry_if_exception_type(TransientFailure), stop=stop_after_attempt(attempts), wait=wait_random(0.2, 1.0)
    )

    def once() -> None:
        try:
            response = httpx.post(url, json=document, timeout=timeout_s, headers={"User-Agent": USER_AGENT})
        except httpx.TransportError as error:
            raise TransientFailure(f"{host}: {type(error).__name__}") from None
        except httpx.InvalidURL:
            raise Failure(f"{host}: no URL that can be asked") from None
        if response.status_code in TRANSIENT_STATUS:
            raise TransientFailure(f"{host}: {_status(response)}")
        if not response.is_success:
            raise Failure(f"{host}: {_status(response)}")

    try:
        trying(once)
    except RetryError as error:
        raise Failure(f"{error.last_attempt.exception()} (after {count_of(attempts, 'attempt')})") from None


def _status(response: httpx.Response) -> str:
    return f"{response.status_code} {response.reason_phrase}".strip()


def find_damaged_answers(folder: Path) -> Iterator[Path]:
    """Yield the damaged answers in the caches of all services below a folder, with their damage."""
    for body in sorted(folder.glob(f"*/??/*{_BODY}")):
        if _kept(body) is None:
            yield body
    for about in sorted(folder.glob("*/??/*.json")):
        if not about.with_suffix(_BODY).is_file():
            yield about


def _kept(path: Path) -> bytes | None:
    """Return a cached answer, or None if it is missing or damaged."""
    try:
        body, about = path.read_bytes(), json.loads(path.with_suffix(".json").read_bytes())
        return body if about["sha256"] == hashlib.sha256(body).hexdigest() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _store(path: Path, body: bytes, request: dict[str, object]) -> None:
    """Write the answer and its request, each at once."""
    said = {"fetched": datetime.now(UTC).isoformat(timespec="seconds"), "sha256": hashlib.sha256(body).hexdigest()}
    cache = Storage(path.parent)
    cache.write(path.with_suffix(".json").name, json.dumps({**request, **said}, indent=1).encode())
    cache.write(path.name, body)


def _no_way_to(error: BaseException | None) -> str | None:
    """Return the system's message if a name cannot be resolved or no route exists; None for other errors."""
    while error is not None:
        if isinstance(error, socket.gaierror) or (isinstance(error, OSError) and error.errno in _NO_ROUTE):
            return str(error.strerror)
        error = error.__cause__ or error.__context__
    return None
