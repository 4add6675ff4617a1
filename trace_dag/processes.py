"""Which process did something, in a form that tells later whether it still lives.

A process number alone is used again by others, so the moment it was started belongs to it.
"""

from __future__ import annotations

import os
import socket
import time
from functools import cache
from pathlib import Path

_FOREIGN_AGE_S = 86400.0


def this_process() -> str:
    """This process as ``host:number:start``."""
    return _identity(os.getpid())


def is_gone(process: str) -> bool | None:
    """Whether a process named by :func:`this_process` has ended; None where that cannot be told from here.

    It cannot for a process of another machine, nor for a text that names none.
    """
    host, _, rest = process.partition(":")
    number, _, started = rest.partition(":")
    if host != socket.gethostname() or not number.isdigit():
        return None
    return _started(int(number)) != started


def is_stopped(number: int) -> bool:
    """Whether a process of this machine was stopped (SIGSTOP) and not continued; False where that cannot be told."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    except (OSError, IndexError):
        return False


def temporary_prefix(kind: str) -> str:
    """How the name of a temporary file or folder of this process begins, so that :func:`abandoned` can tell whose."""
    return f"{kind}{this_process()}:"


def abandoned(path: Path, kind: str) -> bool:
    """Whether the process that made a temporary file or folder is gone; for one of another machine, after a day."""
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
    """When a process began, in ticks since the machine did; '' if it is gone."""
    try:
        status = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return ""
    return "" if status[0] == "Z" else status[19]
