"""What a stored year takes: building the warehouse, bringing it up to date, ``status``, ``verify``.

    python -m benchmarks.warehouse ROOT FOLDER [--crashes 36000] [--dagster]

The stored crashes of ROOT are multiplied into FOLDER (:mod:`benchmarks.multiplied`), which is kept, and used again if
it is there. The warehouse is built anew while a reader holds the old one open, then brought up to date after 100
crashes have changed, and ``status`` and ``verify`` look at all of it. ``verify`` has Dagster's records of all crashes
to compare with if ``--dagster`` asks for them, which takes some minutes the first time. Times are CPU seconds of all
processes together; a machine with two free cores takes between half and all of that.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.kills import command
from benchmarks.measuring import Figure
from benchmarks.multiplied import multiply
from benchmarks.results import keep
from trace_dag.cohorts.registry import Registry
from trace_dag.definitions.launch import dagster_records
from trace_dag.flow.records import read_records, write_record
from trace_dag.flow.verify import Disagreement, DisagreementKind
from trace_dag.flow.workspace import WAREHOUSE_FILE, Workspace
from trace_dag.storage.files import Storage
from trace_dag.warehouse.build import BuildReport, build_warehouse
from trace_dag.warehouse.query import open_warehouse

_CHANGED = 100
_Taken = tuple[float, float]  # CPU seconds, and the most memory, MB


def main() -> None:
    """Make the cohort if need be, measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--crashes", type=int, default=36_000)
    parser.add_argument("--dagster", action="store_true", help="tell Dagster of all crashes first")
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    if not (options.folder / "cohorts").is_dir():
        multiply(options.root, options.folder, options.crashes)
    workspace = Workspace.open(str(options.folder))
    keys = workspace.registry.keys()
    if options.dagster:
        began = time.monotonic()
        tell_dagster(workspace)
        print(f"Dagster told in {time.monotonic() - began:.0f} s", flush=True)
    figures: list[Figure] = []

    def measured(what: str, taken: _Taken, goal_s: float) -> None:
        figures.append(
            Figure(f"{len(keys):,} crashes: {what}", taken[0], "CPU s", goal=goal_s, note=f"at most {taken[1]:.0f} MB")
        )
        print(f"{figures[-1].name}: {taken[0]:.1f} CPU s, goal {goal_s:.0f}, {taken[1]:.0f} MB", flush=True)

    (options.folder / "cache" / "warehouse.json").unlink(missing_ok=True)
    if (options.folder / WAREHOUSE_FILE).exists():
        with reader(options.folder / WAREHOUSE_FILE) as counts:
            built, taken = build(options.folder)
        print(f"a reader asked {len(counts)} times meanwhile and was always told of {set(counts)} crashes")
    else:
        built, taken = build(options.folder)
    measured("building the warehouse", taken, 60.0)
    change(workspace.storage, keys[:: len(keys) // _CHANGED][:_CHANGED])
    updated, taken = build(options.folder)
    measured(f"warehouse after {_CHANGED} changed", taken, 5.0)
    if updated.rows != built.rows:
        raise SystemExit(f"other rows after the update: {updated.rows}, {built.rows}")
    measured("status", called(options.folder, "status"), 5.0)
    measured("verify", called(options.folder, "verify"), 60.0)
    if not options.no_keep:
        keep(figures)


def change(storage: Storage, keys: Sequence[str]) -> None:
    """Let the last stage of some crashes have been begun at another time."""
    for of_crash in read_records(storage, keys).values():
        record = of_crash[max(of_crash, key=lambda stage: stage.position)]
        write_record(storage, replace(record, attempts=record.attempts + 1))


def tell_dagster(workspace: Workspace) -> None:
    """What ``verify --repair`` tells Dagster where its folder was lost."""
    from trace_dag.assets.verify import repair_dagster, verify_dagster

    keys = Registry(workspace.storage).keys()
    records = read_records(workspace.storage, keys)
    with dagster_records(workspace) as instance:
        missing = [Disagreement(DisagreementKind.NO_PARTITION, "", key) for key in keys]
        repair_dagster(instance, workspace.storage, records, missing)
        repair_dagster(instance, workspace.storage, records, verify_dagster(instance, records))


def called(root: Path, name: str) -> _Taken:
    """A command to its end: CPU time of it and its children, and the most memory one of them held."""
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command(root, name, "--json"), stdout=said)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        found = len(json.load(said).get("disagreements", ()))
    print(f"{name}: exit code {process.returncode}, {found} disagreements", flush=True)
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def build(folder: Path) -> tuple[BuildReport, _Taken]:
    """Build in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_build, (folder,))


def _build(folder: Path) -> tuple[BuildReport, _Taken]:
    started_s = time.process_time()
    report = build_warehouse(Storage(folder), folder)
    return report, (time.process_time() - started_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


class reader:  # noqa: N801 - used as a function
    """A process that holds a warehouse open and asks it again and again; what it was answered."""

    def __init__(self, path: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop, self._answers = context.Event(), context.Queue()
        self._process = context.Process(target=_ask, args=(path, self._stop, self._answers))
        self.counts: list[int] = []

    def __enter__(self) -> list[int]:
        self._process.start()
        self.counts.append(self._answers.get())
        return self.counts

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self.counts.extend(iter(self._answers.get, None))
        self._process.join()


def _ask(path: Path, stop: multiprocessing.Event, answers: multiprocessing.Queue) -> None:  # type: ignore[type-arg,valid-type]
    with open_warehouse(path) as connection:
        while not stop.is_set():
            row = connection.execute("SELECT count(*) FROM crashes").fetchone()
            answers.put(row[0] if row else 0)
            time.sleep(0.5)
    answers.put(None)


if __name__ == "__main__":
    main()
