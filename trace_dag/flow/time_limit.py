"""A limit on the time a stage may take for a crash.

In the main thread an alarm interrupts Python code. Other threads (those of a Dask worker) get no alarm: there the stage
has a thread of its own, which is interrupted at its next Python instruction, or abandoned. If a library hangs without
letting Python run, the worker ends itself later, by a thread that needs no interpreter; its crash is then treated like
that of any lost worker.
"""

from __future__ import annotations

import contextvars
import ctypes
import faulthandler
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

from trace_dag.common.errors import Failure

T = TypeVar("T")

SLOWEST_BYTES_PER_S = 1_000_000.0
"""Rate of reading a map file, a twentieth of the usual: so much longer may work on a large one take."""
_AGAIN_S = 5.0  # the alarm goes off again, should somebody have swallowed it
_LATER = 1.5  # a worker ends itself after this share of the limit
GRACE_S = 10.0  # and so much
_TO_STOP_S = 1.0  # for a thread to notice that it was interrupted; then it is left to itself


class _TimeIsUpError(BaseException):
    """Not a subclass of ``Exception``: a stage's own ``except Exception`` must not catch it."""


def within(limit_s: float, what: str, function: Callable[[], T]) -> T:
    """Call a function. Raises :class:`Failure` if it takes longer than ``limit_s``; ``what`` begins the message."""
    alarms = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
    try:
        with _ending_a_hung_worker(limit_s):
            return _with_an_alarm(limit_s, function) if alarms else _in_its_own_thread(limit_s, function)
    except _TimeIsUpError:
        raise Failure(
            f"{what}: not done after {limit_s:g} s (execution.stage_time_limit_s); look at its inputs, or "
            "raise the limit"
        ) from None


def _with_an_alarm(limit_s: float, function: Callable[[], T]) -> T:
    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise _TimeIsUpError

    before: Any = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
        return function()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def _ending_a_hung_worker(limit_s: float) -> Iterator[None]:
    """Kill the process if it hangs; if threads share it, the last stage to begin counts."""
    if multiprocessing.parent_process() is None:
        yield
        return
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - kept by its number
        faulthandler.dump_traceback_later(limit_s * _LATER + GRACE_S, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def _in_its_own_thread(limit_s: float, function: Callable[[], T]) -> T:
    answer: Future[T] = Future()
    context = contextvars.copy_context()

    def call() -> None:
        try:
            answer.set_result(context.run(function))
        except BaseException as error:
            if not answer.done():
                answer.set_exception(error)

    thread = threading.Thread(target=call, name="stage", daemon=True)
    thread.start()
    if not wait([answer], timeout=limit_s).done:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(_TimeIsUpError))
        wait([answer], timeout=_TO_STOP_S)
        raise _TimeIsUpError
    return answer.result()
