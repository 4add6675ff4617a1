"""Whether anything grows with the crashes that a process has worked on: memory, files, threads, locks, Dagster's files.

    python -m benchmarks.nothing_grows                          500 crashes by a worker, 5 rounds of a whole run
    python -m benchmarks.nothing_grows --crashes 5000 --rounds 20

First one process does the work of a worker: all stages with pictures, for the crashes of the bundled sample over and
over. Then one process does all that ``trace-dag rerun`` does, with Dagster's records, warehouse, packages and pages,
again and again for the same crashes, which is what a daemon lives through. Both are counted after each round, with
garbage collected; the first rounds, in which modules and caches are loaded, are left out. Memory is what belongs to the
process alone (RssAnon); the growth is the slope of a straight line through the rounds.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import statistics
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

from benchmarks.cohorts import MAPS, SAMPLE
from benchmarks.measuring import Figure, exit_code
from benchmarks.results import keep
from trace_dag.cohorts.ingest import ingest
from trace_dag.flow.batch import run_stages
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage
from trace_dag.storage.files import Storage

_WARMING_UP = 3
_OF_RUN = 20  # crashes in each round of a whole run
_GOAL_KB = 20.0  # per crash: 5,000 crashes are 100 MB

Counts = dict[str, float]


def counted(root: Path, temporary: Path) -> Counts:
    """What this process holds at the moment, and what lies about."""
    gc.collect()
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines() if ":" in line)
    own = f" {os.getpid()} "
    return {
        "memory, kB": float(status["RssAnon"].split()[0]),
        "open files": float(len(list(Path("/proc/self/fd").iterdir()))),
        "threads": float(threading.active_count()),
        "processes": float(len(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())),
        "temporary files": float(sum(1 for _ in temporary.rglob("*"))),
        "leftovers in the root": float(len(Storage(root).leftovers())),
        "locks held": float(sum(own in line for line in Path("/proc/locks").read_text().splitlines())),
        "files in the root": float(
            sum(1 for each in root.rglob("*") if each.is_file() and "dagster" not in each.parts)
        ),
        "Dagster, kB": sum(each.stat().st_size for each in (root / "dagster").rglob("*") if each.is_file()) / 1024,
    }


def rounds(name: str, work: Callable[[], None], number: int, crashes: int, root: Path, temporary: Path) -> list[Figure]:
    """Do the work that often; how much each count grew per crash."""
    seen: list[Counts] = []
    for turn in range(number + _WARMING_UP):
        work()
        seen.append(counted(root, temporary))
        print(f"{name} {turn + 1}: " + ", ".join(f"{what} {value:.0f}" for what, value in seen[-1].items()), flush=True)
    level = seen[_WARMING_UP - 1 :]
    slopes = {
        what: statistics.linear_regression(range(len(level)), [each[what] for each in level]).slope / crashes
        for what in level[0]
    }
    first, last = (each["memory, kB"] / 1024 for each in (level[0], level[-1]))
    note = f"{number * crashes} crashes; from {first:.0f} to {last:.0f} MB"
    memory = Figure(f"{name}: growth of memory", slopes.pop("memory, kB"), "kB per crash", goal=_GOAL_KB, note=note)
    dagster = Figure(f"{name}: growth of Dagster's history", slopes.pop("Dagster, kB"), "kB per crash and run")
    rest = ", ".join(slopes)
    other = Figure(f"{name}: growth of {rest}", max(slopes.values()), "per crash", goal=0.0)
    return [memory, other, *([dagster] if dagster.value else [])]


def main() -> int:
    """Exit code 1 if something grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crashes", type=int, default=500, help="crashes by a worker (default 500)")
    parser.add_argument("--rounds", type=int, default=5, help=f"whole runs of {_OF_RUN} crashes (default 5)")
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root, temporary = Path(folder) / "root", Path(folder) / "temporary"
        temporary.mkdir()
        tempfile.tempdir = os.environ["TMPDIR"] = str(temporary)
        ingest(Storage.open(root), "sample", reports=[SAMPLE / "reports"], maps=[MAPS])
        workspace = Workspace.open(str(root), overrides={"execution": {"executor": "in_process"}})
        keys = workspace.registry.keys()

        def worker() -> None:
            for _ in run_stages(workspace, keys, run_id="level", force=tuple(Stage)):
                pass

        def whole() -> None:
            from trace_dag.cli.main import cli

            arguments = ["--root", str(root), "rerun", "--executor", "in_process"]
            for key in keys[:_OF_RUN]:
                arguments += ["--only", key]
            said = (Path(folder) / "said").open("w")
            with said, contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
                cli.main(arguments, standalone_mode=False)

        figures = rounds("worker", worker, max(options.crashes // len(keys), 2), len(keys), root, temporary)
        figures += rounds("whole run", whole, options.rounds, _OF_RUN, root, temporary)
    for figure in figures:
        print(f"{figure.name}: {figure.value:.3g} {figure.unit} {figure.note}")
    if not options.no_keep:
        keep(figures)
    return exit_code(figures)


if __name__ == "__main__":
    sys.exit(main())
