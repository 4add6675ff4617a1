"""The bundled sample, and the modules it is made by."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from cases import SETTINGS

from lab.truth.vehicles import SampleTruth, load_truth
from trace_dag.common.errors import Rejection
from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report

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


@pytest.fixture(scope="session")
def refused() -> Callable[[str, Mapping[str, str]], dict[str, str]]:
    """Why crashes of a folder of the sample are refused as read, by key; given with the kind each is to be read as."""

    def reasons(folder: str, kinds: Mapping[str, str]) -> dict[str, str]:
        found = {}
        for key, kind in kinds.items():
            path = SAMPLE / folder / "reports" / f"crash_{key[-6:]}.xml"
            record = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
            assert record.kind == kind
            try:
                check(record, SETTINGS.crash)
            except Rejection as rejection:
                found[key] = rejection.reason.value
        return found

    return reasons
