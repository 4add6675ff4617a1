"""A national year of FARS files: listed, and served as reports, in little time and memory.

``TRACE_DAG_SCALE_CRASHES`` sets the size (default a twentieth of a year; 40000 is a year).
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import textwrap
from collections import defaultdict
from pathlib import Path

import pytest
from fars_tables import Table, write

from trace_dag.crash.codes.elements import STATES

YEAR_CRASHES = 40_000
CRASHES = int(os.environ.get("TRACE_DAG_SCALE_CRASHES", YEAR_CRASHES // 20))


@pytest.fixture(scope="module")
def national_year(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Real rows repeated under new case numbers, over all states."""
    real = shared_data / "fars-csv" / "2015"
    if not real.is_dir():
        pytest.skip(f"FARS CSV files not present at {real}")
    rows: dict[str, dict[str, Table]] = {}
    for name in ("accident", "vehicle", "vsoe"):
        rows[name] = defaultdict(list)
        with (real / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                rows[name][row["ST_CASE"]].append(row)
    originals, states = list(rows["accident"]), list(STATES)
    tables: dict[str, Table] = {name: [] for name in rows}
    for index in range(CRASHES):
        original, state = originals[index % len(originals)], states[index % len(states)]
        case = str(state * 10_000 + index // len(states) + 1)
        for name, by_case in rows.items():
            tables[name] += [row | {"STATE": str(state), "ST_CASE": case} for row in by_case[original]]
    folder = tmp_path_factory.mktemp("national")
    write(tables, folder)
    return folder


def test_a_national_year_is_listed_and_served(national_year: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = textwrap.dedent(
        """
        import resource, sys
        from pathlib import Path
        from trace_dag.crash.fars.csv_tables import FarsCsvSource

        source = FarsCsvSource.open(Path(sys.argv[1]))
        listings = source.listings()
        size = sum(len(data) for _, data in source.reports(listing.key for listing in listings))
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(len(listings), peak_mb, size / 1e6)
        """
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(national_year)], capture_output=True, text=True, check=True, timeout=300
    )
    listed, peak_mb, size_mb = map(float, done.stdout.split())
    if CRASHES == YEAR_CRASHES:
        with capsys.disabled():
            print(f"\n{CRASHES} crashes served as {size_mb:.0f} MB of reports, peak {peak_mb:.0f} MB")  # noqa: T201
    assert listed == CRASHES
    assert peak_mb < 2048
