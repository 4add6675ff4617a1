"""One worker at a time on a crash, even if several runs share one storage root.

Two runs may be given the same crash. Each file would still be whole, but files of one could end up beside the record
of the other. So a worker holds the crash while it works on it, and the other waits. A lock goes with the process that
holds it. An object store has no locks: there the last record counts, and a file that is not the one it lists is
noticed when it is read, and made again.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from trace_dag.storage import Storage

if sys.platform != "win32":
    import fcntl

FOLDER = "locks"
_LOCKS = 256  # files, shared by the crashes: few enough to keep, many enough that two crashes seldom meet


@contextmanager
def held(storage: Storage, keys: Iterable[str]) -> Iterator[bool]:
    """Lock some crashes. Yields whether it had to wait for another worker: then records read before may be outdated."""
    if storage.local_root is None or sys.platform == "win32":
        yield False
        return
    folder = storage.local_root / FOLDER
    folder.mkdir(exist_ok=True)
    waited = False
    with ExitStack() as stack:
        # In one order for all, so that no two wait for each other.
        for number in sorted({_number(key) for key in keys}):
            waited |= stack.enter_context(_locked(folder / f"{number:02x}"))
        yield waited


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
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


def _number(key: str) -> int:
    return hashlib.sha256(key.encode()).digest()[0] % _LOCKS
