"""Turns taken by processes of one machine: one file holds the moment at which the next one is due.

The moment is one of the system's monotonic clock (seconds since it was started), which all processes read alike.
"""

from __future__ import annotations

import os
import struct
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

if sys.platform != "win32":
    import fcntl

_MOMENT: Final = struct.Struct("<d")
_LONGEST_QUEUE_S: Final = 600.0


def take_turn(path: Path, earliest_s: float, gap_s: float) -> float:
    """Return the first free turn at or after ``earliest_s``; the next is at least ``gap_s`` later.

    A turn more than ten minutes ahead was left before a restart of the machine, and does not count.
    """
    if sys.platform == "win32":
        return earliest_s  # no such locks there: every process keeps its own time
    path.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        turn_s = earliest_s
        with suppress(struct.error):
            due_s = _MOMENT.unpack(os.pread(handle, _MOMENT.size, 0))[0]
            if due_s - time.monotonic() < _LONGEST_QUEUE_S:
                turn_s = max(turn_s, due_s)
        os.pwrite(handle, _MOMENT.pack(turn_s + gap_s), 0)
        return turn_s
    finally:
        os.close(handle)
