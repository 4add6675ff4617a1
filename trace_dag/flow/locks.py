"""One worker at a time on a crash, even if several runs share one storage root.

Two runs may be given the same crash. Each file would still be whole, but files of one could end up beside the record
of the other. So a worker holds the crash while it works on it, and the other waits. A lock goes with the process that
holds it. An object store has no locks: there the last record counts, and a file that is not the one it lists is
noticed when it is read, and made again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager

from trace_dag.file_locks import locked
from trace_dag.storage import Storage

FOLDER = "locks"
_LOCKS = 256  # files, shared by the crashes: few enough to keep, many enough that two crashes seldom meet


@contextmanager
def held(storage: Storage, keys: Iterable[str]) -> Iterator[bool]:
    """Lock some crashes. Yields whether it had to wait for another worker: then records read before may be outdated."""
    if storage.local_root is None:
        yield False
        return
    folder = storage.local_root / FOLDER
    folder.mkdir(exist_ok=True)
    waited = False
    with ExitStack() as stack:
        # In one order for all, so that no two wait for each other.
        for number in sorted({_number(key) for key in keys}):
            waited |= stack.enter_context(locked(folder / f"{number:02x}"))
        yield waited


def _number(key: str) -> int:
    return hashlib.sha256(key.encode()).digest()[0] % _LOCKS
