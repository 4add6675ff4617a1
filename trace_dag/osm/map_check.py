"""Reading of new map files in a separate process, with limits of memory and time.

libosmium trusts a ``.osm.pbf``: a zero byte within a name makes it read beyond its memory, which ends the process
without an exception. A packed text can unpack to a thousand times its size. So a new file is first read to its end in a
process that may die without harm. One process reads all files that are checked together, so that many small ones cost
one start of Python; after a death there is another.
"""

from __future__ import annotations

import json
import logging
import os
import resource
import select
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Self

from trace_dag.common.errors import UserError
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.processes import how_it_ended
from trace_dag.osm.extraction import MOST_THREADS, TOLD_EVERY_S, read_header, reading
from trace_dag.osm.plausibility import UnreadableMapError, check_text
from trace_dag.osm.xml import as_plain_xml

_LIMIT_S: Final = 120.0  # by the clock, for Python to be there and a small file to be read
_SLOWEST_BYTES_PER_S: Final = 200_000.0  # a hundredth of the usual; what is slower than that never ends
_MEMORY_MB: Final = 2048  # a state as .osm.pbf takes a tenth of it; what is rewritten as plain XML ten times its size
_COMMAND: Final = "import sys; from trace_dag.osm.map_check import serve; serve(int(sys.argv[1]))"


class MapChecker:
    """Reads files in a process of its own, which is started with the first and ended by :meth:`close`."""

    def __init__(self, *, limit_s: float = _LIMIT_S, memory_mb: int = _MEMORY_MB) -> None:
        self._limit_s, self._memory_mb = limit_s, memory_mb
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def check(self, path: Path) -> None:
        """Read a file to its end. Raises :class:`UserError` for one that cannot be read, or not in time."""
        if self._process is None:
            self._process = _started(self._memory_mb)
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        limit_s = self._limit_s + path.stat().st_size / _SLOWEST_BYTES_PER_S
        with suppress(BrokenPipeError):  # it has died meanwhile: listening to it says so
            process.stdin.write(json.dumps(str(path)) + "\n")
            process.stdin.flush()
        deadline_s = time.monotonic() + limit_s
        while True:
            if not select.select([process.stdout], [], [], max(deadline_s - time.monotonic(), 0.0))[0]:
                self.close()
                raise UnreadableMapError(f"{path}: not read after {limit_s:.0f} s; fetch it again, or leave it out")
            answer = process.stdout.readline()
            if not answer:
                ended = how_it_ended(process.wait())
                self.close()
                raise UnreadableMapError(
                    f"{path}: damaged, reading it ended the process that did so ({ended}); fetch it again, or leave it "
                    "out"
                )
            said = json.loads(answer)
            if isinstance(said, int):
                print_problem(f"{path.name}: {said:,} ways checked", level=logging.INFO)
            elif said:
                self.close()  # a writer that failed ends its process when it is destructed
                raise UnreadableMapError(said)
            else:
                return

    def close(self) -> None:
        """End the process at once."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()


def _started(memory_mb: int) -> subprocess.Popen[str]:
    """Return a Python process that runs :func:`serve`, and imports this package from the same place."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109 - as Python has it there
    return subprocess.Popen(  # noqa: S603 - our own command
        (sys.executable, "-P", "-c", _COMMAND, str(memory_mb)),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": paths, "OSMIUM_POOL_THREADS": str(MOST_THREADS)},
    )


def serve(memory_mb: int) -> None:
    """Read the files named on standard input, a JSON string in a line each.

    It answers each with the number of ways read so far, and at last with the error (a string, empty if there is none).
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # its death is nothing to be looked into
    with suppress(OSError, ValueError):  # not everywhere, and there may be a lower one
        resource.setrlimit(resource.RLIMIT_DATA, (memory_mb * 2**20, memory_mb * 2**20))
    for line in sys.stdin:
        path = Path(json.loads(line))
        try:
            _read(path)
            _answer("")
        except UserError as error:
            _answer(str(error))
        except MemoryError:
            _answer(f"{path}: takes more than {memory_mb} MB of memory; cut the region you need out of it")


def _read(path: Path) -> None:
    """Write all objects as text to the null device, so that libosmium reads every character of them."""
    import osmium

    check_text(path)
    read_header(path)
    looking = _Looking(path)
    with as_plain_xml(path) as plain, reading(path):
        nowhere = osmium.SimpleWriter(osmium.io.File(os.devnull, "opl"), overwrite=True)
        osmium.apply(str(plain), looking, nowhere)
        nowhere.close()


class _Looking:
    """A handler for :func:`osmium.apply` that reports the number of ways so far."""

    def __init__(self, path: Path) -> None:
        self._path, self._ways, self._told_s = path, 0, time.monotonic()

    def way(self, way: Any) -> None:
        """Count it. Raises :class:`UnreadableMapError` for an id below 0."""
        if way.id < 0:
            raise UnreadableMapError(f"{self._path}: has ids below 0; save it as .osm, where they are read")
        self._ways += 1
        if self._ways % 1000 == 0 and time.monotonic() - self._told_s >= TOLD_EVERY_S:
            self._told_s = time.monotonic()
            _answer(self._ways)


def _answer(what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()
