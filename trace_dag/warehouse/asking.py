"""Queries of users to the warehouse, in a process with limits of time and memory.

DuckDB limits neither: a recursive query may run for ever, and one expression may hold gigabytes.
"""

from __future__ import annotations

import os
import pickle
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from trace_dag.common.errors import UserError
from trace_dag.common.settings import WarehouseSettings

Answer = TypeVar("Answer")

_CHILD = "from trace_dag.warehouse.asking import _answer; _answer()"


def ask(path: Path, sql: str, limits: WarehouseSettings, how: Callable[[Path, str], Answer]) -> Answer:
    """Run ``how``, a function such as :func:`trace_dag.warehouse.query.query`, within the limits of the settings.

    Raises :class:`UserError` also for a query that exceeds the limits of time or memory.
    """
    asked = pickle.dumps((how, path, sql, limits.query_memory_mb))
    try:
        done = subprocess.run(  # noqa: S603 - our own command
            [sys.executable, "-P", "-c", _CHILD],
            input=asked,
            capture_output=True,
            timeout=limits.query_time_s,
            check=False,
            start_new_session=True,  # Ctrl-C is for this process, which ends that one
        )
    except subprocess.TimeoutExpired as error:
        raise UserError(
            f"sql: no answer after {limits.query_time_s:g} s; ask for less, or set warehouse.query_time_s higher"
        ) from error
    if done.returncode or not done.stdout:
        raise _too_large(limits.query_memory_mb)
    answer: Answer | Exception
    answer = pickle.loads(done.stdout)  # noqa: S301 - written by this module
    if isinstance(answer, MemoryError | ImportError):  # DuckDB itself may find no room
        raise _too_large(limits.query_memory_mb) from answer
    if isinstance(answer, Exception):
        raise answer
    return answer


def _too_large(memory_mb: int) -> UserError:
    return UserError(
        f"sql: the answer needs more than {memory_mb} MB; ask for less, or set warehouse.query_memory_mb higher"
    )


def _answer() -> None:
    """Write the answer, or the error, to the child's original standard output.

    DuckDB draws a progress bar on standard output after two seconds, which is redirected to standard error.
    """
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    how, path, sql, memory_mb = pickle.load(sys.stdin.buffer)  # noqa: S301 - written by this module
    resource.setrlimit(resource.RLIMIT_AS, (memory_mb * 2**20, memory_mb * 2**20))
    said: object
    try:
        said = how(path, sql)
    except Exception as error:
        said = error
    with answer:
        pickle.dump(said, answer)
