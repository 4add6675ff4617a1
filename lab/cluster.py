"""A cohort on a cluster that shares nothing but an object store ends, byte for byte, as on one machine.

    python -m lab cluster --reports REPORTS --maps MAPS       a cohort of real crashes
    python -m lab cluster                                     the bundled sample
    python -m lab cluster --lose scheduler                    the scheduler is killed and started again
    python -m lab cluster --lose nothing --delay 0.05         each answer of the store takes 50 ms, some 0.5 s

The cohort is run twice: on a local folder, and on an S3-compatible server by the workers of a Dask scheduler, all of
them processes of their own on loopback. One of the workers, or the scheduler with all of them, is killed once maps
have been made, unless nothing is to be lost. Every table and view of both warehouses is then written as Parquet, its
rows in the order of all their columns, and the files are compared. Facts that must differ are left out and listed:
when, how long, in which run. Exit code 1 if anything else differs."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from lab.cohorts import MAPS, SAMPLE
from tests.faults.cluster import (
    BUCKET,
    DaskCluster,
    dask_cluster,
    kill_when_under_way,
    lose_scheduler_when_under_way,
    object_store,
)
from tests.result_tables import ABOUT_RUNS, WHEN_AND_WHERE, exported
from trace_dag.common.storage.files import Storage
from trace_dag.flow.workspace import WAREHOUSE_FILE

ROOT = f"s3://{BUCKET}/root"
WORKERS = 2
_LOSE: dict[str, Callable[[DaskCluster, subprocess.Popen[str], Storage], None]] = {
    "worker": kill_when_under_way,
    "scheduler": lose_scheduler_when_under_way,
    "nothing": lambda *_: None,
}


def trace_dag(root: str, *arguments: str, environment: Mapping[str, str]) -> subprocess.Popen[str]:
    """Return the command as a user calls it, under way."""
    return subprocess.Popen(
        [sys.executable, "-m", "trace_dag.cli", "--root", root, *arguments],
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> str:
    """Return the output of a command that ended well."""
    said, _ = process.communicate()
    if process.returncode:
        raise SystemExit(f"{' '.join(process.args)} ended with {process.returncode}\n{said}")
    return said


def here(folder: Path, reports: Path, maps: Path) -> Path:
    """Return the warehouse of the run on this machine."""
    root = str(folder / "here")
    ended(trace_dag(root, "ingest", "--reports", str(reports), "--maps", str(maps), environment={}))
    began = time.monotonic()
    ended(trace_dag(root, "run", environment={}))
    print(f"here: {time.monotonic() - began:.0f} s", flush=True)
    return Path(root) / WAREHOUSE_FILE


def there(folder: Path, reports: Path, maps: Path, lose: str, delay_s: float) -> Path:
    """Return the warehouse of the run on the cluster, fetched from the store."""
    with object_store(delay_s) as store:
        own = store | {"XDG_DATA_HOME": str(folder / "data")}
        ended(trace_dag(ROOT, "ingest", "--reports", str(reports), "--maps", str(maps), environment=own))
        began = time.monotonic()
        with dask_cluster(folder, WORKERS, store | {"TRACE_DAG_LOCAL_FOLDER": str(folder / "of-workers")}) as cluster:
            run = trace_dag(ROOT, "run", environment=own | cluster.settings())
            os.environ.update(store)  # for what this process asks the store
            _LOSE[lose](cluster, run, Storage(ROOT))
            print(f"there: {lose} lost after {time.monotonic() - began:.0f} s", flush=True)
            said = ended(run)
        print(f"there: {time.monotonic() - began:.0f} s\n{said.strip()}", flush=True)
        print(ended(trace_dag(ROOT, "verify", "--contents", environment=own)).strip(), flush=True)
        fetched = folder / WAREHOUSE_FILE
        fetched.write_bytes(Storage(ROOT).read(WAREHOUSE_FILE))
    return fetched


def main() -> int:
    """Run both, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reports", type=Path, default=SAMPLE / "reports")
    parser.add_argument("--maps", type=Path, default=MAPS)
    parser.add_argument("--lose", choices=list(_LOSE), default="worker")
    parser.add_argument("--delay", type=float, default=0.0, help="seconds that each answer of the store waits")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = exported(here(folder, options.reports, options.maps), folder / "tables-here")
        second = exported(
            there(folder, options.reports, options.maps, options.lose, options.delay), folder / "tables-there"
        )
        unequal = sorted(
            table for table in first.keys() | second.keys() if contents(first.get(table)) != contents(second.get(table))
        )
        size = sum(len(contents(path)) for path in first.values())
    print(f"left out: {', '.join(sorted(ABOUT_RUNS))}, and of others:")
    for table, columns in WHEN_AND_WHERE.items():
        print(f"  {table}: {', '.join(sorted(columns))}")
    print(f"{len(first)} tables compared, {size} bytes of Parquet; different: {', '.join(unequal) or 'none'}")
    return 1 if unequal else 0


def contents(path: Path | None) -> bytes:
    """Return a file's bytes; none of a table that is not there."""
    return path.read_bytes() if path else b""


if __name__ == "__main__":
    sys.exit(main())
