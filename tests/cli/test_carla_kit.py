"""The kit for whoever has a CARLA server, against the stand-in for CARLA's client."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("carla", reason="the carla extra is not installed")

from lab.carla_kit.run import CRASHES, main
from tests.simulation.carla_stand_in import StandIn


def test_the_kit_compares_crashes_and_writes_the_file_to_send_back(
    finished_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main([str(finished_root), "--output", str(tmp_path / "kit.json")], StandIn())
    found = json.loads((tmp_path / "kit.json").read_bytes())
    assert 0 < len(found["crashes"]) <= CRASHES
    assert found["versions"]["carla"].startswith("0.9")
    for row in found["crashes"]:
        # The stand-in moves bodies as it is told to, and both follow the same plans until they touch.
        assert row["carla"]["parties"] == row["ours"]["parties"]
        assert row["carla"]["time_s"] == pytest.approx(row["ours"]["time_s"], abs=0.1)
    assert "the same" in capsys.readouterr().out
