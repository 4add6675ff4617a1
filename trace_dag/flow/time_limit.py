"""A limit on the time a stage may take for a crash.

An alarm interrupts Python code. If the main thread hangs inside a library and never returns to Python, a worker of a
pool ends itself a while later, by a thread that needs no interpreter; its crash is then treated like that of any lost
worker. There is no limit in other threads than the main one (those of a Dask worker), nor on Windows.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from trace_dag.errors import Failure

_AGAIN_S = 5.0  # the alarm goes off again, should somebody have swallowed it
_LATER = 1.5  # a worker ends itself after this share of the limit
GRACE_S = 10.0  # and so much


class _TimeIsUpError(BaseException):
    """Not a subclass of ``Exception``: a stage's own ``except Exception`` must not catch it."""


@contextmanager
def at_most(limit_s: float, what: str) -> Iterator[None]:
    """Raise :class:`Failure` where the block takes longer than ``limit_s``; ``what`` begins its sentence."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise _TimeIsUpError

    before: Any = signal.signal(signal.SIGALRM, ring)
    in_worker = multiprocessing.parent_process() is not None
    try:
        signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
        if in_worker:
            with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - kept by its number
                faulthandler.dump_traceback_later(limit_s * _LATER + GRACE_S, exit=True, file=nowhere)
                yield
        else:
            yield
    except _TimeIsUpError:
        raise Failure(
            f"{what}: not done after {limit_s:g} s (execution.stage_time_limit_s); look at what it is made from, or "
            "raise the limit"
        ) from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if in_worker:
            faulthandler.cancel_dump_traceback_later()
