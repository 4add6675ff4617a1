"""The storage root with fake crashes that the flow's tests use, and one of the sample."""

from pathlib import Path

import pytest
import sample_runs
from flow.conftest import make_workspace

__all__ = ["make_workspace"]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A root of its own, in which crashes of the sample have been run."""
    return sample_runs.copy_finished(tmp_path / "root")
