"""Compares what two versions of the program make of every cohort at hand, row by row.

    python -m lab compare_outcomes make COMMIT FOLDER       computes the cohorts with the code of a commit
    python -m lab compare_outcomes compare BEFORE AFTER     two such folders, or two storage roots

``make`` checks the commit out beside the repository (``git worktree``), installs it into an environment of its own,
registers the bundled sample and the shared cohorts in ``FOLDER/root``, runs it and prints what that cost. ``compare``
reads both warehouses. Numbers are equal within 1e-6, relative or absolute; all else is equal as it stands. Tables or
columns that one side lacks are named and left out. It ends with exit code 1 if a row differs.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd

from lab.measuring import SHARED

REPOSITORY = Path(__file__).resolve().parents[1]
COHORTS: dict[str, list[str | Path]] = {
    "sample": ["--reports", "data/sample/reports", "--maps", "data/sample/osm"],
    "va-2023": ["--reports", SHARED / "va-2023/reports", "--maps", SHARED / "va-2023/osm"],
    "fars-csv": ["--fars-csv", SHARED / "fars-csv", "--maps", SHARED / "osm"],
    "fresh": ["--fars-csv", SHARED / "fresh/fars-csv", "--maps", SHARED / "fresh/osm"],
}
ROW_KEYS = {
    "crashes": ["key"],
    "events": ["key", "event_number"],
    "maps": ["key"],
    "map_checks": ["key", "gate"],
    "estimates": ["key"],
    "estimated_states": ["key", "hypothesis", "vehicle_number"],
    "simulations": ["key", "hypothesis"],
    "contacts": ["key", "hypothesis"],
    "verdict_criteria": ["key", "criterion", "vehicle_number", "event_number"],
    "support": ["key", "fact", "vehicle_number"],
}
"""Tables that are compared, and what tells their rows apart; rows that are alike in it are compared in order."""
NOT_COMPARED = {"version", "backend_version", "latency_s", "outdated", "outdated_because", "seconds"}
TOLERANCE = 1e-6


def make(commit: str, folder: Path) -> None:
    """Compute all cohorts with the code of ``commit`` in ``folder/root``."""
    if folder.exists():
        raise SystemExit(f"{folder} exists already; name a folder that is to be made")
    folder.mkdir(parents=True)
    tree, environment = folder / "tree", folder / "venv"
    subprocess.run(["git", "-C", REPOSITORY, "worktree", "add", "--quiet", "--detach", tree, commit], check=True)
    try:
        subprocess.run([sys.executable, "-m", "venv", environment], check=True)
        pip = [environment / "bin/python", "-m", "pip", "install", "--quiet", "-c", "constraints.txt", "."]
        subprocess.run(pip, cwd=tree, check=True)
        program = [environment / "bin/trace-dag", "--root", folder / "root"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        for cohort, sources in COHORTS.items():
            subprocess.run([*program, "ingest", *sources, "--cohort", cohort], cwd=tree, check=True)
        subprocess.run([*program, "run"], cwd=tree, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    finally:
        subprocess.run(["git", "-C", REPOSITORY, "worktree", "remove", "--force", tree], check=True)
    with duckdb.connect(str(folder / "root/warehouse.duckdb"), read_only=True) as warehouse:
        crashes = warehouse.table("crashes").shape[0]
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    size = sum(file.stat().st_size for file in (folder / "root").rglob("*") if file.is_file())
    print(f"{crashes} crashes, {cpu_s:.0f} CPU s, {size / 1e6:.1f} MB")


def compare(before: Path, after: Path, shown: int) -> int:
    """Print what differs, table by table and column by column; the number of rows that differ in anything."""
    differing = 0
    for table, keys in ROW_KEYS.items():
        old, new = _rows(before, table, keys), _rows(after, table, keys)
        if old is None or new is None:
            print(f"{table}: only in {after if old is None else before}")
            continue
        lacking = sorted(set(old.columns) ^ set(new.columns))
        lines, rows = differences(old, new)
        differing += rows
        note = f"; not in both: {', '.join(lacking)}" if lacking else ""
        print(f"{table}: {len(old)} and {len(new)} rows, {rows} differ{note}")
        for line in lines[:shown]:
            print(f"  {line}")
        if len(lines) > shown:
            print(f"  and {len(lines) - shown} more values")
    return differing


def differences(old: pd.DataFrame, new: pd.DataFrame) -> tuple[list[str], int]:
    """Return a line for each value that differs between tables with the same kind of index; and how many rows do."""
    lines = [f"{_named(row)}: no longer there" for row in old.index.difference(new.index)]
    lines += [f"{_named(row)}: new" for row in new.index.difference(old.index)]
    rows = set(old.index.symmetric_difference(new.index))
    both = old.index.intersection(new.index)
    for column in old.columns.intersection(new.columns):
        one, other = old.loc[both, column], new.loc[both, column]
        for row in both[~_equal(one, other)]:
            lines.append(f"{_named(row)}: {column} {one[row]!r} -> {other[row]!r}")
            rows.add(row)
    return lines, len(rows)


def _equal(one: pd.Series, other: pd.Series) -> np.ndarray:
    if pd.api.types.is_numeric_dtype(one) and pd.api.types.is_numeric_dtype(other):
        return np.isclose(
            one.to_numpy(float, na_value=np.nan),
            other.to_numpy(float, na_value=np.nan),
            rtol=TOLERANCE,
            atol=TOLERANCE,
            equal_nan=True,
        )
    both_missing = (one.isna() & other.isna()).to_numpy()
    return both_missing | (one.astype(str).to_numpy() == other.astype(str).to_numpy())


def _named(row: tuple[object, ...]) -> str:
    return " ".join(str(part) for part in row[:-1] if part is not None and not pd.isna(part))


def _rows(folder: Path, table: str, keys: list[str]) -> pd.DataFrame | None:
    """Return a table of a root's warehouse, its index the row's key and a number among rows of one key; None without
    one.
    """
    root = folder / "root" if (folder / "root").is_dir() else folder
    with duckdb.connect(str(root / "warehouse.duckdb"), read_only=True) as warehouse:
        try:
            rows = warehouse.sql(f"FROM {table} ORDER BY ALL").df()
        except duckdb.CatalogException:
            return None
    for key in keys:
        rows[key] = rows[key].astype(object).where(rows[key].notna(), None)
    rows["number"] = rows.groupby(keys, dropna=False).cumcount()
    return rows.drop(columns=list(NOT_COMPARED & set(rows.columns))).set_index([*keys, "number"])


def main() -> int:
    """Exit code 1 if two versions differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="compute the cohorts with the code of a commit")
    making.add_argument("commit")
    making.add_argument("folder", type=Path)
    comparing = commands.add_parser("compare", help="compare two roots")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--shown", type=int, default=20, help="values shown of each table (default 20)")
    options = parser.parse_args()
    if options.command == "make":
        make(options.commit, options.folder)
        return 0
    return 1 if compare(options.before, options.after, options.shown) else 0


if __name__ == "__main__":
    sys.exit(main())
