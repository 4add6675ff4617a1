"""The first reading of binary map files, in a process that may die of it.

libosmium believes what a ``.osm.pbf`` says: a zero byte within a name makes it read on beyond its memory, which is no
exception but the end of the process. So a new file is read to its end once where nothing else is lost. One process
reads all files that are registered together, so that many small ones cost one start of Python; after a death there is
another.
"""

from __future__ import annotations

import json
import os
import resource
import select
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Final, Self

from trace_dag.errors import UserError
from trace_dag.osm.extraction import extract_raw, is_divisible, read_header
from trace_dag.osm.first_look import first_look
from trace_dag.osm.large_map import LargeMap
from trace_dag.osm.plausibility import UnreadableMapError
from trace_dag.processes import how_it_ended
from trace_dag.progress import MapListener, MapProgress, unheard
from trace_dag.storage import Storage

_LIMIT_S: Final = 120.0  # by the clock, for Python to be there and a small file to be read
_SLOWEST_BYTES_PER_S: Final = 200_000.0  # a hundredth of the usual; what is slower than that never ends
_COMMAND: Final = (sys.executable, "-P", "-c", "from trace_dag.osm.first_reading import serve; serve()")


class FirstReader:
    """Reads files in a process of its own, which is started with the first and ended by :meth:`close`."""

    def __init__(self, *, limit_s: float = _LIMIT_S) -> None:
        self._limit_s = limit_s
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def read(self, path: Path, digest: str = "", storage: Storage | None = None, tell: MapListener = unheard) -> None:
        """Read a file to its end; with ``storage``, keep there what a first look finds in a large one.

        Raises :class:`UserError` for one that cannot be read, or not within its time.
        """
        if self._process is None:
            self._process = _started()
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        limit_s = self._limit_s + path.stat().st_size / _SLOWEST_BYTES_PER_S
        with suppress(BrokenPipeError):  # it has died meanwhile: listening to it says so
            process.stdin.write(json.dumps([str(path), digest, storage.root if storage else None]) + "\n")
            process.stdin.flush()
        while True:
            if not select.select([process.stdout], [], [], limit_s)[0]:
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
            if isinstance(said, dict):
                tell(MapProgress(**said))
            elif said:
                raise UserError(said)
            else:
                return

    def close(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()


def _started() -> subprocess.Popen[str]:
    """Python with :func:`serve`, which finds this package where this process has found it."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109 - as Python has it there
    return subprocess.Popen(  # noqa: S603 - our own command
        _COMMAND,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
    )


def serve() -> None:
    """Read the files named on standard input, a JSON list in a line each: path, SHA-256, storage root.

    Answers each with how far it is (objects), then with what is wrong (a string, empty if nothing is).
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # its death is nothing to be looked into
    for line in sys.stdin:
        path, digest, root = json.loads(line)
        said = ""
        try:
            _read(Path(path), digest, root)
        except UserError as error:
            said = str(error)
        except MemoryError:
            said = f"{path}: needs more memory than there is; cut the region of the crashes out of it (osmium extract)"
        _answer(said)


def _read(path: Path, digest: str, root: str | None) -> None:
    header = read_header(path)
    look = None
    if root is not None and is_divisible(path, header):
        look = first_look(LargeMap(path, header, digest, Storage(root)), lambda each: _answer(asdict(each)))
    if look is None or not look.sorted:
        extract_raw(path, header, [], service_roads=True)


def _answer(what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()
