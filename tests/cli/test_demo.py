"""``demo``: which crashes of the fictional town are registered."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from trace_dag.cli.main import cli
from trace_dag.flow.workspace import Workspace

CROSSING_IN_A_CROSSWALK, HEAD_ON = "2023-319091", "2023-319001"


@pytest.mark.parametrize("options", [[], ["--people"]], ids=["vehicles", "people too"])
def test_people_are_run_when_asked_for(options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trace_dag.cli.run.run_selection", lambda *_: 0)  # registered, not run
    result = CliRunner().invoke(cli, ["--root", str(tmp_path / "root"), "demo", *options])
    assert result.exit_code == 0, result.output
    keys = Workspace.open(str(tmp_path / "root")).registry.keys("sample")
    assert HEAD_ON in keys
    assert (CROSSING_IN_A_CROSSWALK in keys) is bool(options)
