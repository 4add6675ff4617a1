"""The notebooks run to their last cell on a root with crashes of the sample, and are kept without outputs."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
import sample_runs
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


def name_of(path: Path) -> str:
    return path.stem


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_is_kept_without_outputs(path):
    for cell in nbformat.read(path, as_version=4).cells:
        assert cell.cell_type != "code" or (cell.outputs == [] and cell.execution_count is None)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_runs_from_the_first_cell_to_the_last(path, tmp_path, monkeypatch):
    monkeypatch.setenv("TRACE_DAG_ROOT", str(sample_runs.finished()))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown), "a picture or a plot"
    assert not any(output.get("name") == "stderr" for output in shown)


def test_there_are_notebooks():
    assert {name_of(path) for path in NOTEBOOKS} >= {
        "coverage_and_funnel",
        "one_crash",
        "comparing_estimators",
        "what_to_sample_next",
    }
