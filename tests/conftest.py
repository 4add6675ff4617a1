"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real reports and map extracts outside the project; tests that need them skip where they are absent."""
    folder = Path(os.environ.get("TRACE_DAG_SHARED", REPOSITORY.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"real data not present at {folder} (set TRACE_DAG_SHARED to the folder that holds data/)")
    return folder
