"""One root, run once for all tests that only look at it."""

from __future__ import annotations

from pathlib import Path

import pytest
import sample_runs


@pytest.fixture(scope="session")
def finished_root() -> Path:
    return sample_runs.finished()
