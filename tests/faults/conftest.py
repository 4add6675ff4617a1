"""The storage root with fake crashes that the flow's tests use, and one of the sample."""

import shutil
from pathlib import Path

import pytest
from flow.conftest import make_workspace
from sample_runs import finished

__all__ = ["make_workspace"]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A root of its own, in which crashes of the sample have been run."""
    return Path(shutil.copytree(finished(), tmp_path / "root"))
