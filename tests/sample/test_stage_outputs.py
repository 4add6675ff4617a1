"""Outputs of the stages for the sample, and the numbers of their code."""

from __future__ import annotations

import json
from pathlib import Path

from tests.stage_outputs import FILE, record, run_sample


def test_other_outputs_have_another_number(tmp_path: Path) -> None:
    recorded, now = json.loads(FILE.read_text()), record(run_sample(tmp_path / "root"))
    changed = [name for name in now if now[name] != recorded[name]]
    assert changed == [], (
        f"{', '.join(changed)}: other outputs, or another number, than recorded. If other outputs come of the same "
        "input, raise the stage's number in trace_dag/flow/stages/__init__.py; then: python -m tests.stage_outputs"
    )
