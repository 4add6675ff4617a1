"""How the process of an agent comes to be: forked from a nursery that has read Python and this package, or isolated.

A process that measures has one nursery, which holds nothing of what is measured and runs no code of any agent; reading
Python and this package anew takes half a second, forking a hundredth of one.
"""

from __future__ import annotations

import atexit
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import IO

from trace_dag.evaluation.isolation import Isolation

_STANDARD_ERROR = 2  # the process's own, whatever sys.stderr stands for in a notebook or a test
_WAIT_S = 1.0
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Life:
    """A process of an agent: its number, the socket to it, what it prints (not blocking), and how to wait for its end.

    ``exit_code`` waits a second; None where it goes on.
    """

    number: int
    connection: socket.socket
    output: IO[bytes]
    exit_code: Callable[[], int | None]


def born(isolation: Isolation | None) -> Life:
    """A process that waits for the first message of :mod:`trace_dag.evaluation.agent_main`."""
    ours, theirs = socket.socketpair()
    reading, writing = os.pipe()
    try:
        if isolation is None:
            number, exit_code = _nursery().fork(theirs.fileno(), writing)
        else:
            process = _started("main", theirs.fileno(), writing, isolation)
            number, exit_code = process.pid, _waiting(process)
    finally:
        theirs.close()
        os.close(writing)
    os.set_blocking(reading, False)
    return Life(number, ours, os.fdopen(reading, "rb", buffering=0), exit_code)


def _waiting(process: subprocess.Popen[bytes]) -> Callable[[], int | None]:
    def exit_code() -> int | None:
        try:
            return process.wait(timeout=_WAIT_S)
        except subprocess.TimeoutExpired:
            return None

    return exit_code


def _started(function: str, number: int, output: int, isolation: Isolation | None = None) -> subprocess.Popen[bytes]:
    """Python in a new session, with a function of the agents' module given an open socket by its number."""
    code = f"from trace_dag.evaluation.agent_main import {function}; {function}({number})"
    command: Sequence[str] = [sys.executable, "-P", "-c", code]
    environment: Mapping[str, str] = {**_ONE_THREAD, **os.environ}
    if isolation is not None:
        command, environment = isolation.command(command), isolation.environment(environment)
    process: Future[subprocess.Popen[bytes]] = Future()

    def start() -> None:
        """Linux ends a process that belongs to its parent with the thread that started it, and whoever asks may be a
        thread that soon ends, as on a cluster's worker. So one of its own starts it, and lives as long."""
        try:
            started = subprocess.Popen(  # noqa: S603 - our own command
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=[number],
                start_new_session=True,
                env=environment,
            )
        except BaseException as error:
            process.set_exception(error)
            return
        process.set_result(started)
        if hasattr(os, "waitid"):
            with suppress(ChildProcessError):
                os.waitid(os.P_PID, started.pid, os.WEXITED | os.WNOWAIT)

    threading.Thread(target=start, name="parent of agents", daemon=True).start()
    return process.result()


class _Nursery:
    """The other end of :func:`trace_dag.evaluation.agent_main.nursery`."""

    def __init__(self) -> None:
        self._control, theirs = socket.socketpair()
        self._process = _started("nursery", theirs.fileno(), _STANDARD_ERROR)
        theirs.close()
        atexit.register(self._control.close)  # with which it ends

    def fork(self, connection: int, output: int) -> tuple[int, Callable[[], int | None]]:
        """A new process with a socket and where it prints to; its number, and what waits for its end."""
        socket.send_fds(self._control, [b"fork\n"], [connection, output])
        number = int(self._answer())

        def exit_code() -> int | None:
            self._control.sendall(f"{number} {_WAIT_S}\n".encode())
            answer = self._answer()
            return None if answer == "runs" else int(answer)

        return number, exit_code

    def _answer(self) -> str:
        data = b""
        while not data.endswith(b"\n"):
            part = self._control.recv(64)
            if not part:
                raise RuntimeError("the process that starts those of agents has ended")
            data += part
        return data.decode().strip()


@cache
def _nursery() -> _Nursery:
    return _Nursery()
