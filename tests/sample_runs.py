"""The command as a user calls it, and a root with a part of the bundled sample run through it."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"

# Crashes of the sample that end at different stages for different reasons, and some that are verified.
KEYS = (
    "2023-319003",
    "2023-319022",
    "2023-319024",
    "2023-319061",
    "2023-319062",
    "2023-319063",
    "2023-319066",
    "2023-319067",
    "2023-319069",
    "2023-319072",
)


def trace_dag(root: Path | str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command on a root in a process of its own."""
    return subprocess.run(
        command(root, *arguments),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"COLUMNS": "200"} | environment,
    )


def command(root: Path | str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "trace_dag.cli", "--root", str(root), *arguments]


def reports_of(folder: Path, keys: Sequence[str] = KEYS) -> Path:
    """A folder with the reports of some crashes of the sample."""
    folder.mkdir(parents=True)
    for key in keys:
        name = f"crash_{key.partition('-')[2]}.xml"
        (folder / name).write_bytes((SAMPLE / "reports" / name).read_bytes())
    return folder


@cache
def finished() -> Path:
    """A root on which the crashes of :data:`KEYS` have been run; made once for all tests that only look at it."""
    folder = Path(tempfile.mkdtemp(prefix="trace-dag-tests-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    assert ingest(folder / "root", reports_of(folder / "reports")).returncode == 0
    done = trace_dag(folder / "root", "run")
    assert done.returncode == 0, done.stderr
    return folder / "root"


def ingest(root: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    return trace_dag(root, "ingest", "--reports", str(folder), "--maps", str(SAMPLE / "osm"), "--cohort", "sample")
