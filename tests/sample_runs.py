"""The command as a user calls it, and a root with a part of the bundled sample run through it."""

from __future__ import annotations

import fcntl
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import prepared

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
    """The command as the shell would run it, in this process, which has read its modules once for all tests.

    What it does to the process (signals, the environment, the working directory) is for :func:`trace_dag_process`. An
    error that the command does not expect is raised here, in the test.
    """
    from trace_dag.cli import main

    out, err = StringIO(), StringIO()
    words = ["trace-dag", "--root", str(root), *arguments]
    variables = {"COLUMNS": "200", "TRACE_DAG_EXECUTION__EXECUTOR": "in_process"} | environment
    with (
        patch.dict(os.environ, variables),
        patch.object(sys, "argv", words),
        patch.object(sys, "path", [*sys.path]),
        redirect_stdout(out),
        redirect_stderr(err),
        _logging_as_it_was(),
    ):
        try:
            main()
            code = 0
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def asked(root: Path | str, query: str) -> list[dict[str, Any]]:
    """The rows that ``trace-dag sql`` answers with."""
    return json.loads(trace_dag(root, "sql", query, "--format", "json").stdout)


@contextmanager
def _logging_as_it_was() -> Iterator[None]:
    """The command's log goes to the standard error of its own run, and to nobody's afterwards."""
    log = logging.getLogger("trace_dag")
    before = (log.level, log.propagate, list(log.handlers))
    try:
        yield
    finally:
        log.setLevel(before[0])
        log.propagate = before[1]
        log.handlers[:] = before[2]


def trace_dag_process(root: Path | str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command on a root in a process of its own, which has its modules already."""
    return _in_process("trace-dag", "--root", str(root), *arguments, **environment)


def study(root: Path | str, name: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a study of the laboratory on a root, likewise."""
    executor = {"TRACE_DAG_EXECUTION__EXECUTOR": "in_process"}
    return _in_process("python", "-m", "lab", "--root", str(root), name, *arguments, **executor | environment)


def _in_process(program: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [prepared.programs() / program, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=SAMPLE.parents[1] if program == "python" else None,
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
def finished(keys: tuple[str, ...] = KEYS) -> Path:
    """A root on which some crashes of the sample have been run; made once for all tests that only look at it.

    The first worker that asks makes it; the others wait for it.
    """
    shared = Path(os.environ["TRACE_DAG_TESTS_SHARED"])
    made = shared / f"finished {' '.join(keys)}.txt"
    with made.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.exists():
            folder = Path(tempfile.mkdtemp(prefix="finished-", dir=shared))
            assert ingest(folder / "root", reports_of(folder / "reports", keys)).returncode == 0
            done = trace_dag(folder / "root", "run")
            assert done.returncode == 0, done.stderr
            made.write_text(str(folder / "root"))
    return Path(made.read_text())


def copy_finished(target: Path, keys: tuple[str, ...] = KEYS) -> Path:
    """A copy of the finished root, for tests that write.

    What SQLite keeps beside a database that another test has open may be gone before it is copied, and is in the
    database then.
    """
    return Path(shutil.copytree(finished(keys), target, ignore=shutil.ignore_patterns("*.db-wal", "*.db-shm")))


def ingest(root: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    return trace_dag(root, "ingest", "--reports", str(folder), "--maps", str(SAMPLE / "osm"), "--cohort", "sample")
