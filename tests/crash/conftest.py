"""Fixtures of the crash tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from trace_dag.common.settings import CrashSettings


@pytest.fixture(scope="session")
def settings() -> CrashSettings:
    """The defaults: nothing is repaired, two vehicles."""
    return CrashSettings()


@pytest.fixture(scope="session")
def real_reports(shared_data: Path) -> dict[str, bytes]:
    """Real CrashAPI responses by file name, malformed ones included."""
    folder = shared_data / "va-2023" / "reports"
    if not folder.is_dir():
        pytest.skip(f"real reports not present at {folder}")
    found = {path.name: path.read_bytes() for path in sorted(folder.glob("*.xml"))}
    assert found, f"{folder} holds no report"
    return found


@pytest.fixture(scope="session")
def mapped_names(shared_data: Path) -> set[str]:
    """File names of the reports that have a map and belong to the published benchmark."""
    maps = (shared_data / "va-2023" / "osm").glob("map_*.osm")
    return {f"crash_{path.stem.removeprefix('map_')}.xml" for path in maps}
