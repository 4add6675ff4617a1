"""A year that nobody prepared: all kinds of crashes of a whole country, killed on the way, and what came of them.

    python -m lab year --crashes 1000             in a folder that is deleted in the end
    python -m lab year --crashes 34000 --folder F  in F, which is kept; called again it goes on

Records are made by :mod:`lab.made_records` and maps by :mod:`lab.set_down_maps`. They are registered as
a national release is, run, and the whole tree of the run is killed with SIGKILL as often as asked, spread over the
work. In the end ``verify --contents`` has to agree. Printed is the funnel by kind, and what it took.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lab.kills import command
from lab.made_records import made_crashes, write_tables
from lab.measuring import SHARED
from lab.set_down_maps import set_down
from trace_dag.common.stage import Stage
from trace_dag.warehouse.query import query

_LOOK_EVERY_S = 2.0
_LONGEST_MORE_S = 20.0
_RECORDS = 6  # of a crash, more or less
_FUNNEL = "SELECT kind, registered, complete, mapped, estimated, collided, verified FROM funnel_by_kind"
_REASONS = """
SELECT stage_reached AS stage, reason, count(*) AS crashes FROM crashes
WHERE final_state = 'rejected' GROUP BY ALL ORDER BY crashes DESC LIMIT 12
"""


def main() -> int:
    """Exit code 1 if anything is left to do or does not agree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crashes", type=int, default=1_000)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    if options.folder is None:
        with tempfile.TemporaryDirectory() as folder:
            return through(Path(folder), options.crashes, options.kills, options.seed)
    return through(options.folder, options.crashes, options.kills, options.seed)


def through(folder: Path, crashes: int, kills: int, seed: int) -> int:
    """Make, register, run, kill, verify, print."""
    root = folder / "root"
    if not (root / "cohorts").is_dir():
        prepare(folder, root, crashes, seed)
    began, draw = time.monotonic(), random.Random(seed)
    for number in range(kills):
        if not killed_after(root, _RECORDS * crashes * (number + 0.5) / kills, draw):
            break
        print(f"kill {number + 1}: {stored(root)} records of {crashes} crashes, {_minutes(began)}", flush=True)
    last = subprocess.run(command(root, "run"), capture_output=True, text=True, check=False)
    used = f"{_cpu_minutes():.1f} CPU min, {_largest_mb():.0f} MB"
    print(f"run: exit code {last.returncode}, {_minutes(began)}, {used}", flush=True)
    print("\n".join(last.stdout.splitlines()[-12:]), flush=True)
    verified = subprocess.run(command(root, "verify", "--contents"), capture_output=True, text=True, check=False)
    print(f"verify --contents: exit code {verified.returncode}: {verified.stdout.strip()[-400:]}", flush=True)
    for sql in (_FUNNEL, _REASONS):
        columns, rows = query(root / "warehouse.duckdb", sql)
        print("\n| " + " | ".join(columns) + " |\n|" + "---|" * len(columns))
        for row in rows:
            print("| " + " | ".join(map(str, row)) + " |")
    status = json.loads(subprocess.run(command(root, "status", "--json"), capture_output=True, check=True).stdout)
    print(f"\n{status['final_states']}; load {os.getloadavg()[0]:.1f}")
    left = status["final_states"]["pending"] + status["final_states"]["failed"]
    return 1 if last.returncode or verified.returncode or left else 0


def prepare(folder: Path, root: Path, crashes: int, seed: int) -> None:
    """Prepare records, maps, and the registered cohort."""
    began = time.monotonic()
    folder.mkdir(parents=True, exist_ok=True)
    made = made_crashes(SHARED, crashes, seed)
    maps = folder / "set-down.osm.pbf"
    mapped = set_down(made, SHARED / "osm", maps, seed)
    write_tables(made, folder / "release" / "2016")
    print(f"{len(made)} records and {mapped} pieces of map made in {_minutes(began)}", flush=True)
    done = subprocess.run(
        command(root, "ingest", "--fars-csv", str(folder / "release"), "--maps", str(maps), "--cohort", "year"),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    print(f"{done.stdout.strip()}\nregistered after {_minutes(began)}", flush=True)


def killed_after(root: Path, wanted: float, draw: random.Random) -> bool:
    """Run until that many records are stored and a random time more, and kill the tree; False if it ended before."""
    with (root / "run.log").open("ab") as log:
        process = subprocess.Popen(command(root, "run"), stdout=log, stderr=log, start_new_session=True)
    while process.poll() is None:
        if stored(root) >= wanted:
            time.sleep(draw.uniform(0.0, _LONGEST_MORE_S))
            os.killpg(process.pid, signal.SIGKILL)
            return process.wait() == -signal.SIGKILL
        time.sleep(_LOOK_EVERY_S)
    return False


def stored(root: Path) -> int:
    """Return records of all stages."""
    return sum(1 for stage in Stage for _ in (root / stage.value).glob("*.outcome.json"))


def _minutes(since: float) -> str:
    return f"{(time.monotonic() - since) / 60:.1f} min"


def _cpu_minutes() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (used.ru_utime + used.ru_stime) / 60


def _largest_mb() -> float:
    """Return the memory of the largest process that has ended."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


if __name__ == "__main__":
    sys.exit(main())
