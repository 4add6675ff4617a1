"""How long it takes, and how much memory, to register a national year: 40,000 crashes with 60,000 vehicles.

    python benchmarks/registering.py ../shared/data/fars-csv/2015

The rows of a real release are repeated under new case numbers, two-vehicle crashes twice as often. Registering is the
command a user gives, from its start to its end: reading the CSV files, writing each report, the cohort, a Dagster
partition for each crash.
"""

from __future__ import annotations

import argparse
import csv
import resource
import subprocess
import sys
import tempfile
import time
from itertools import cycle
from pathlib import Path

CRASHES = 40_000
STATES = (1, 2, 4, 5, 6, 8, 9, 10, 11, 12)
TABLES = ("accident", "vehicle", "vsoe")


def national_year(release: Path, folder: Path) -> dict[str, int]:
    """A release of ``CRASHES`` crashes; its rows by table."""
    tables = {name: rows(release / f"{name}.csv") for name in TABLES}
    of_case: dict[str, dict[str, list[dict[str, str]]]] = {name: {} for name in TABLES}
    for name, entries in tables.items():
        for entry in entries:
            of_case[name].setdefault(entry["ST_CASE"], []).append(entry)
    cases = list(of_case["accident"])
    cases += [case for case in cases if len(of_case["vehicle"].get(case, [])) >= 2]
    made: dict[str, list[dict[str, str]]] = {name: [] for name in TABLES}
    for number, case in zip(range(CRASHES), cycle(cases), strict=False):
        new = str(STATES[number % len(STATES)] * 10_000 + 1 + number // len(STATES))
        for name in TABLES:
            made[name] += [{**entry, "ST_CASE": new} for entry in of_case[name].get(case, [])]
    for name, entries in made.items():
        with (folder / f"{name}.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(entries[0]))
            writer.writeheader()
            writer.writerows(entries)
    return {name: len(entries) for name, entries in made.items()}


def rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        return list(csv.DictReader(file))


def main() -> None:
    """Make the year, register it, print what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("release", type=Path, help="folder with accident.csv, vehicle.csv and vsoe.csv")
    release = parser.parse_args().release
    with tempfile.TemporaryDirectory() as folder:
        csv_folder = Path(folder) / "2015"
        csv_folder.mkdir()
        counts = national_year(release, csv_folder)
        print(f"{counts['accident']} crashes, {counts['vehicle']} vehicles, {counts['vsoe']} events")
        command = [sys.executable, "-m", "trace_dag.cli", "--root", f"{folder}/root", "ingest"]
        began_s = time.monotonic()
        subprocess.run([*command, "--fars-csv", str(csv_folder)], check=True)
        wall_s = time.monotonic() - began_s
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(
        f"registered in {wall_s:.1f} s (processor {used.ru_utime + used.ru_stime:.1f} s), "
        f"at most {used.ru_maxrss / 1024:.0f} MiB"
    )


if __name__ == "__main__":
    main()
