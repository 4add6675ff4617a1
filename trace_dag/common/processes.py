"""Identity of a process, in a form that shows later whether it still lives, and locks that go with it.

A process number alone is used again by others, so the moment it was started belongs to it.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

_FOREIGN_AGE_S = 86400.0


def this_process() -> str:
    """Return this process as ``host:number:start``."""
    return _identity(os.getpid())


def is_gone(process: str) -> bool | None:
    """Return whether a process named by :func:`this_process` has ended.

    None if that is unknown: for a process of another machine, or an invalid name.
    """
    host, _, rest = process.partition(":")
    number, _, started = rest.partition(":")
    if host != socket.gethostname() or not number.isdigit():
        return None
    return _started(int(number)) != started


def is_stopped(number: int) -> bool:
    """Return whether a process of this machine was stopped (SIGSTOP) and not continued; False if unknown."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    except (OSError, IndexError):
        return False


def children(number: int) -> list[int]:
    """Return the numbers of a process's children on this machine, adopted ones included.

    Empty on systems other than Linux.
    """
    found: list[int] = []
    for path in Path(f"/proc/{number}/task").glob("*/children"):
        with suppress(OSError):
            found += [int(each) for each in path.read_text().split()]
    return found


def descendants(number: int) -> list[int]:
    """Return the children of a process, theirs, and so on."""
    found: list[int] = []
    waiting = [number]
    while waiting:
        below = children(waiting.pop())
        found += below
        waiting += below
    return found


def processor_time_s(number: int) -> float:
    """Return the processor time of a process and of its descendants, s.

    It is 0 on systems other than Linux.
    """
    ticks = 0
    for each in (number, *descendants(number)):
        with suppress(OSError):
            told = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
            ticks += sum(map(int, told[11:15]))  # user, system, and both of its children
    return ticks / os.sysconf("SC_CLK_TCK")


def end_all(number: int) -> None:
    """Kill a process of this machine, its group and its descendants.

    All are stopped first, parents before children, so that none starts new processes.
    """
    known: set[int] = set()
    while found := {number, *descendants(number)} - known:
        known |= found
        for each in found:
            _send(each, signal.SIGSTOP)
    for each in sorted(known - {number}):
        _send(each, signal.SIGKILL)
    with suppress(OSError):
        if os.getpgid(number) == number:
            os.killpg(number, signal.SIGKILL)
    _send(number, signal.SIGKILL)


def _send(number: int, what: signal.Signals) -> None:
    with suppress(OSError):
        os.kill(number, what)


def how_it_ended(exit_code: int | None) -> str:
    """Return the meaning of an exit code of :mod:`subprocess` or :mod:`multiprocessing` as text."""
    if exit_code is not None and exit_code < 0:
        return f"signal {signal.Signals(-exit_code).name}"
    return f"exit code {exit_code}"


def temporary_prefix(kind: str) -> str:
    """Return the prefix for names of this process's temporary files and folders, for :func:`is_abandoned`."""
    return f"{kind}{this_process()}:"


def is_abandoned(path: Path, kind: str) -> bool:
    """Return whether the process that made a temporary file or folder is gone.

    A file of another machine counts as abandoned after a day.
    """
    gone = is_gone(path.name.removeprefix(kind).rpartition(":")[0])
    if gone is not None:
        return gone
    try:
        return time.time() - path.stat().st_mtime > _FOREIGN_AGE_S
    except FileNotFoundError:
        return False


@cache
def _identity(number: int) -> str:
    return f"{socket.gethostname()}:{number}:{_started(number)}"


def _started(number: int) -> str:
    """Return the start time of a process, in ticks since boot; '' if it is gone."""
    try:
        status = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return ""
    return "" if status[0] == "Z" else status[19]


# --- locks -----------------------------------------------------------------------------------------------------------
if sys.platform != "win32":
    import fcntl


@contextmanager
def lock_file(path: Path) -> Iterator[bool]:
    """Hold a lock on a file; yield whether it had to wait for another process.

    On Windows there is no lock.
    """
    if sys.platform == "win32":
        yield False
        return
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            waited = False
        except BlockingIOError:
            fcntl.flock(handle, fcntl.LOCK_EX)
            waited = True
        yield waited
    finally:
        os.close(handle)
