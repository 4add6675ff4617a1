"""The bundled sample, and the modules it is made by."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from trace_dag.studies.truth import SampleTruth, load_truth

SAMPLE = Path(__file__).resolve().parents[2] / "data" / "sample"
sys.path.insert(0, str(SAMPLE))  # make_sample.py finds its modules beside itself, as when it is run


@pytest.fixture(scope="session")
def sample() -> Path:
    """The sample's folder."""
    return SAMPLE


@pytest.fixture(scope="session")
def truth() -> SampleTruth:
    """What really happened."""
    return load_truth(SAMPLE / "truth.json")
