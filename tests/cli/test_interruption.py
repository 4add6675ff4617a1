"""The command killed in the middle, and what the next one makes of it."""

from __future__ import annotations

import json
import signal
import subprocess
import time

from sample_runs import command, ingest, reports_of, trace_dag

KEYS = ("2023-319003", "2023-319022", "2023-319062", "2023-319069")


def test_killed_run_is_finished_by_the_next_one(tmp_path):
    root = tmp_path / "root"
    ingest(root, reports_of(tmp_path / "reports", KEYS))
    process = subprocess.Popen(command(root, "run"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not list((root / "road_map").glob("*.outcome.json")):
        assert time.monotonic() < deadline
        assert process.poll() is None, "ended before it could be killed"
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    finished = {path: path.read_bytes() for path in root.glob("*/*.outcome.json")}

    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr
    status = json.loads(trace_dag(root, "status", "--json").stdout)
    assert status["final_states"]["pending"] == status["final_states"]["failed"] == 0
    assert len(status["crashes"]) == len(KEYS)
    redone = [path for path, content in finished.items() if path.read_bytes() != content]
    # Only what was being replaced at that moment may differ: at most the crashes the two workers had in hand.
    assert len(redone) <= 2, redone
    assert "Nothing to run" in trace_dag(root, "run").stdout
