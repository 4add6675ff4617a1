"""The notebooks run to their last cell on a root with crashes of the sample, and are kept without outputs."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import sample_runs

if TYPE_CHECKING:
    import nbformat

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


def name_of(path: Path) -> str:
    return path.stem


def read(path: Path) -> nbformat.NotebookNode:
    import nbformat  # builds forty parsers, a second for each worker, most of which run no notebook

    return nbformat.read(path, as_version=4)


def run(notebook: nbformat.NotebookNode, folder: Path) -> None:
    from nbclient import NotebookClient

    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}}).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_is_kept_without_outputs(path):
    for cell in read(path).cells:
        assert cell.cell_type != "code" or (cell.outputs == [] and cell.execution_count is None)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_runs_from_the_first_cell_to_the_last(path, tmp_path, monkeypatch):
    monkeypatch.setenv("TRACE_DAG_ROOT", str(sample_runs.finished()))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = read(path)
    run(notebook, tmp_path)
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown), "a picture or a plot"
    assert not any(output.get("name") == "stderr" for output in shown)


def test_one_crash_shows_a_person_who_was_struck(tmp_path, monkeypatch):
    root, key = sample_runs.copy_finished(tmp_path / "root"), "2023-319081"
    reports = tmp_path / "reports"
    reports.mkdir()
    shutil.copy(sample_runs.SAMPLE / "people" / "reports" / "crash_319081.xml", reports)
    assert sample_runs.ingest(root, reports).returncode == 0
    assert sample_runs.trace_dag(root, "run").returncode == 0
    monkeypatch.setenv("TRACE_DAG_ROOT", str(root))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = read(next(path for path in NOTEBOOKS if name_of(path) == "one_crash"))
    run(notebook, tmp_path)
    assert f"<Crash {key}>" in str(notebook.cells), "the crash with a pedestrian comes before those of vehicles"


def test_there_are_notebooks():
    assert {name_of(path) for path in NOTEBOOKS} >= {
        "coverage_and_funnel",
        "one_crash",
        "what_to_sample_next",
    }
