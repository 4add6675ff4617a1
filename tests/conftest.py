"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def environment_as_it_was() -> Iterator[None]:
    """A command tells the processes that it starts its root in the environment; the next test has another one, and so
    has whoever runs the tests."""
    before = {name: value for name, value in os.environ.items() if name not in ("TRACE_DAG_ROOT", "DAGSTER_HOME")}
    os.environ.pop("TRACE_DAG_ROOT", None)
    os.environ.pop("DAGSTER_HOME", None)
    yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real reports and map extracts outside the project; tests that need them skip where they are absent."""
    folder = Path(os.environ.get("TRACE_DAG_SHARED", REPOSITORY.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"real data not present at {folder} (set TRACE_DAG_SHARED to the folder that holds data/)")
    return folder
