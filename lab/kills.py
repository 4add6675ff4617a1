"""Random kills: nothing that was finished is lost, and the end is that of an undisturbed run.

    python -m lab kills                            50 kills over a cohort of 200 crashes
    python -m lab kills --kills 5 --crashes 30     fewer

A cohort of the bundled sample under new keys is run once undisturbed, for comparison. Then another root is run and
killed with SIGKILL at random moments: a worker, the process of the run, or the whole tree. After each kill of a run
``verify --repair`` must leave nothing, every result that was finished before must still be there with the same
fingerprint, and the run is started again. When all is done before the kills are, random stages are computed again.
Exit code 1 if anything does not hold.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from lab.cohorts import MAPS, repeated_sample
from tests.result_tables import differences, result_tables
from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry
from trace_dag.flow.records import read_records

LONGEST_WAIT_S = 15.0
NEVER = ("damaged artefact", "missing artefact", "unreadable record")
FINAL = (Outcome.ACCEPTED, Outcome.REJECTED)


def command(root: Path, *arguments: str) -> list[str]:
    """Return a call of the command line."""
    return [sys.executable, "-m", "trace_dag.cli", "--root", str(root), *arguments]


def call(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(command(root, *arguments), capture_output=True, text=True, check=False)


def prepared(folder: Path, name: str, crashes: int) -> Path:
    """Return a root with the cohort registered."""
    reports = repeated_sample(folder / "reports", crashes)
    done = call(folder / name, "ingest", "--reports", str(reports), "--maps", str(MAPS), "--cohort", "kills")
    if done.returncode:
        raise SystemExit(done.stderr)
    return folder / name


def finished(root: Path) -> dict[tuple[str, Stage], str]:
    """Return fingerprints of all finished results."""
    storage = Storage(root)
    records = read_records(storage, Registry(storage).keys())
    return {
        (key, stage): record.fingerprint
        for key, of_crash in records.items()
        for stage, record in of_crash.items()
        if record.outcome in FINAL and record.fingerprint
    }


def workers_of(pid: int) -> list[int]:
    """Return the pool's processes below a run."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    found = [int(child) for child in children.read_text().split()] if children.exists() else []
    return [child for child in found if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


def kill(process: subprocess.Popen[bytes], whom: str, draw: random.Random) -> bool:
    """Kill one of three; whether there was one to kill."""
    if process.poll() is not None:
        return False
    if whom == "worker":
        workers = workers_of(process.pid)
        if not workers:
            return False
        os.kill(draw.choice(workers), signal.SIGKILL)
    elif whom == "run":
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)
    return True


def wait_for_work(process: subprocess.Popen[bytes], root: Path, draw: random.Random) -> None:
    """Wait a random time, four times in five from the moment at which the run has stored something."""
    if draw.random() < 0.8:
        began = last_write(root)
        while process.poll() is None and last_write(root) == began:
            time.sleep(0.1)
    time.sleep(draw.uniform(0.0, LONGEST_WAIT_S))


def last_write(root: Path) -> int:
    """Return the time of the last write of any stage (nanoseconds)."""
    folders = [root / stage.value for stage in Stage]
    return max((folder.stat().st_mtime_ns for folder in folders if folder.is_dir()), default=0)


def start(root: Path, draw: random.Random) -> subprocess.Popen[bytes]:
    """Return the run, going on with what is left; where nothing is, a random stage and all after it again."""
    arguments = ["run"]
    if draw.random() < 0.2:
        arguments += ["--from", draw.choice([stage.value for stage in Stage])]
    return subprocess.Popen(
        command(root, *arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def disturb(root: Path, kills: int, draw: random.Random) -> tuple[Counter[str], list[str]]:
    """Kill until there were enough; who was killed, and what did not hold."""
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    process = start(root, draw)
    while sum(counts.values()) < kills:
        wait_for_work(process, root, draw)
        before = finished(root)
        whom = draw.choice(["worker", "run", "tree"])
        if kill(process, whom, draw):
            counts[whom] += 1
            print(f"{sum(counts.values()):3} {whom:6} killed with {len(before)} results finished", flush=True)
            if whom == "worker":
                continue
            process.wait()
            time.sleep(1.0)  # orphaned workers end by themselves
        elif process.poll() is None:
            continue
        wrong += check(root, before)
        process = start(root, draw)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return counts, wrong


def check(root: Path, before: dict[tuple[str, Stage], str]) -> list[str]:
    """Return the faults after a kill."""
    answer = json.loads(call(root, "verify", "--contents", "--repair", "--json").stdout)
    seen = Counter(row["disagreement"] for row in (*answer["repaired"], *answer["disagreements"]))
    wrong = [f"{seen[title]} {title} after a kill" for title in NEVER if seen[title]]
    left = answer["disagreements"]
    wrong += [f"{row['key']} {row['stage']}: {row['detail']}" for row in left]
    after = finished(root)
    # A stage that was begun again by the killed run is not finished; one that is must not have changed.
    changed = [where for where, fingerprint in before.items() if after.get(where, fingerprint) != fingerprint]
    wrong += [f"{key} {stage}: another result than before" for key, stage in changed]
    print(f"    verify found {dict(seen) or 'nothing'}, left {len(left)}", flush=True)
    return wrong


def main() -> int:
    """Run undisturbed, run and kill, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--crashes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        calm = prepared(Path(folder), "calm", options.crashes)
        began = time.monotonic()
        if call(calm, "run").returncode:
            raise SystemExit("the undisturbed run failed")
        print(f"undisturbed: {options.crashes} crashes in {time.monotonic() - began:.0f} s", flush=True)
        root = prepared(Path(folder), "killed", options.crashes)
        counts, wrong = disturb(root, options.kills, random.Random(options.seed))
        last = call(root, "run")
        wrong += [f"the last run ended with {last.returncode}: {last.stderr[-300:]}"] if last.returncode else []
        final = call(root, "verify", "--contents")
        wrong += [f"verify after the last run: {final.stdout[-500:]}"] if final.returncode else []
        unequal = differences(calm / "warehouse.duckdb", root / "warehouse.duckdb")
        wrong += [f"table {table}: {one} undisturbed, {other} killed" for table, (one, other) in unequal.items()]
        tables = len(result_tables(calm / "warehouse.duckdb"))
    print(f"killed: {dict(counts)}; {tables} tables compared; {len(wrong)} things do not hold")
    for line in wrong:
        print(f"  {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
