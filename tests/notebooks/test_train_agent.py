"""The training script runs from its first line to its table, where what it learns with is installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import sample_runs

from trace_dag.agents.evaluation.registry import BASELINES

SCRIPT = Path(__file__).resolve().parents[2] / "notebooks" / "train_agent.py"


def test_an_agent_is_trained_and_set_beside_every_baseline():
    for library in ("torch", "stable_baselines3"):
        pytest.importorskip(
            library, reason=f"{library} is not a dependency of this project; the script says how to get it"
        )
    asked = [sys.executable, SCRIPT, sample_runs.finished(), "--steps", "1024", "--most", "1"]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown = [line[:28].strip() for line in done.stdout.splitlines() if " / " in line and "crashes" not in line]
    assert shown == 2 * [*BASELINES, "brakes hard from the start", "PPO"]
