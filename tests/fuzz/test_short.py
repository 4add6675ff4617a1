"""A short run of every target; the long one is ``python -m tests.fuzz``."""

from __future__ import annotations

from pathlib import Path

import pytest
import sample_runs

from tests.fuzz.fuzzing import fuzz_briefly
from tests.fuzz.targets import targets

INPUTS = 40
NAMES = (
    "report",
    "report-rows",
    "fars-csv",
    "osm-xml",
    "osm-pbf",
    "opendrive",
    "package",
    "settings",
    "agent-answer",
    "model-answer",
)


@pytest.fixture(scope="module")
def package() -> Path:
    return sample_runs.finished() / "benchmark/packages/2023-319003.zip"


@pytest.mark.parametrize("name", NAMES)
def test_damaged_input_is_read_or_refused_and_nothing_else(name: str, package: Path, tmp_path: Path) -> None:
    found = fuzz_briefly(targets(package)[name], INPUTS, tmp_path)
    assert sum(found.values()) >= INPUTS


def test_undamaged_files_are_read(package: Path, tmp_path: Path) -> None:
    for name, target in targets(package).items():
        for data in target.seeds:
            folder = tmp_path / name
            folder.mkdir(exist_ok=True)
            target.read(data, folder)  # raises what it refuses
        assert target.seeds, name


def test_every_target_has_a_short_run(package: Path) -> None:
    assert set(NAMES) == targets(package).keys()
