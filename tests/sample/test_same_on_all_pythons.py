"""Results do not depend on how an interpreter adds floats, which `sum` compensates for since Python 3.12."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from sample_runs import ingest, reports_of, trace_dag

from trace_dag.common.stage import Stage

KEYS = ("2023-319003", "2023-319022")


def one_by_one(values: Iterable[Any], /, start: Any = 0) -> Any:
    """Add as Python 3.11 does."""
    for value in values:
        start = start + value
    return start


def compensated(values: Iterable[Any], /, start: Any = 0) -> Any:
    """Add floats without an error of rounding, which is as near as Python 3.12 comes."""
    found = list(values)
    return math.fsum((start, *found)) if any(isinstance(each, float) for each in found) else one_by_one(found, start)


@pytest.mark.parametrize("keys", [KEYS])
def test_every_artefact_is_the_same_however_floats_are_added(tmp_path: Path, keys: tuple[str, ...]) -> None:
    reports = reports_of(tmp_path / "reports", keys)
    made = []
    for adding in (one_by_one, compensated):
        root = tmp_path / adding.__name__
        with patch("builtins.sum", adding):
            assert ingest(root, reports).returncode == 0
            done = trace_dag(root, "run")
        assert done.returncode == 0, done.stderr
        files = [path for stage in Stage for path in (root / stage.value).iterdir() if ".outcome." not in path.name]
        made.append({path.relative_to(root): path.read_bytes() for path in files})
    first, second = made
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []
