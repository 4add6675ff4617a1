"""The command killed or interrupted in the middle, and what the next one makes of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path

from sample_runs import command, ingest, reports_of, trace_dag

KEYS = ("2023-319003", "2023-319022", "2023-319062", "2023-319069")


def under_way(root: Path) -> subprocess.Popen[str]:
    """A run of two workers, in a process group of its own, that has made its first map."""
    process = subprocess.Popen(
        command(root, "run", "--workers", "2"),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    while not list((root / "road_map").glob("*.outcome.json")):
        assert process.poll() is None, "ended before it could be stopped"
        time.sleep(0.02)
    return process


def assert_finished_by_the_next_run(root: Path, finished: dict[Path, bytes]) -> None:
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr
    status = json.loads(trace_dag(root, "status", "--json").stdout)
    assert status["final_states"]["pending"] == status["final_states"]["failed"] == 0
    assert len(status["crashes"]) == len(KEYS)
    redone = [path for path, content in finished.items() if path.read_bytes() != content]
    # Only what was being replaced at that moment may differ: at most the crashes the two workers had in hand.
    assert len(redone) <= 2, redone


def test_killed_run_is_finished_by_the_next_one(tmp_path):
    root = tmp_path / "root"
    ingest(root, reports_of(tmp_path / "reports", KEYS))
    process = under_way(root)
    process.kill()
    process.communicate()
    assert_finished_by_the_next_run(root, {path: path.read_bytes() for path in root.glob("*/*.outcome.json")})
    assert "Nothing to run" in trace_dag(root, "run").stdout


def test_ctrl_c_ends_a_run_with_its_workers_in_one_line_and_the_next_finishes_it(tmp_path):
    root = tmp_path / "root"
    ingest(root, reports_of(tmp_path / "reports", KEYS))
    process = under_way(root)
    os.killpg(process.pid, signal.SIGINT)  # a terminal sends it to all processes in the foreground
    said, _ = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in said
    assert said.splitlines()[-1] == "interrupted; what was finished is kept, run again for the rest"
    wait_for_none_of_group(process.pid)
    assert_finished_by_the_next_run(root, {path: path.read_bytes() for path in root.glob("*/*.outcome.json")})


def wait_for_none_of_group(group: int) -> None:
    """A process that was killed takes a moment to be gone; one that stays keeps this test from ending."""
    while processes_of_group(group):
        time.sleep(0.05)


def processes_of_group(group: int) -> list[str]:
    """Those that still run: what has ended and was not yet asked how does not count."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True, check=True).stdout
    found = [line.split(maxsplit=2) for line in listed.splitlines()]
    return [line[-1] for line in found if line[0] == str(group) and not line[1].startswith("Z")]
