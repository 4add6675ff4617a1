"""The long run: ``python -m tests.fuzz [TARGET ...] [--inputs 100000] [--package FILE]``.

Without a package of a crash of the bundled sample the sample is run first. Prints a line per target and one for each
fault, whose input is kept in the folder it is run in and belongs into ``test_found.py``, made as small as it goes.
"""

from __future__ import annotations

import argparse
import logging
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for each in ("tests", "tests/crash", "tests/reconstruction", "tests/language"):  # as pytest has it
    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / each))

from tests.fuzz.fuzzing import fuzz_long
from tests.fuzz.targets import targets

_MOST_MEMORY = 4 << 30  # bytes


def main() -> None:
    """Fuzz the targets asked for, or all."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("targets", nargs="*")
    asked.add_argument("--inputs", type=int, default=100_000)
    asked.add_argument("--minutes", type=float, default=1e6, help="of each target, at most")
    asked.add_argument("--seed", type=int, default=int(time.time()))
    asked.add_argument("--package", type=Path)
    given = asked.parse_args()
    logging.disable()
    resource.setrlimit(resource.RLIMIT_DATA, (_MOST_MEMORY, _MOST_MEMORY))  # more is a fault, MemoryError
    all_targets = targets(given.package or _a_package())
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    faults = 0
    for name in given.targets or all_targets:
        began = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="trace-dag-fuzz-", dir=memory) as folder:
            until_s = began + 60 * given.minutes
            run = fuzz_long(all_targets[name], given.inputs, Path(folder), beginning=given.seed, until_s=until_s)
        outcomes = ", ".join(f"{count:,} {what}" for what, count in run.found.most_common())
        took_s = time.monotonic() - began
        print(
            f"{name}: {sum(run.found.values()):,} inputs in {took_s:.0f} s ({run.cpu_s:.0f} s of CPU): "
            f"{outcomes}; slowest {run.slowest_s:.2f} s"
        )
        for number, (what, data) in enumerate(run.faults.items()):
            kept = Path(f"fuzz-{name}-{number}.bin")
            kept.write_bytes(data)
            print(f"  {what} ({kept}, {len(data)} bytes)")
        faults += len(run.faults)
        sys.stdout.flush()
    sys.exit(1 if faults else 0)


def _a_package() -> Path:
    root = Path(tempfile.mkdtemp(prefix="trace-dag-fuzz-"))
    demo = [sys.executable, "-m", "trace_dag.cli", "--root", str(root), "demo"]
    subprocess.run(demo, check=True, stdout=subprocess.DEVNULL)
    return root / "benchmark/packages/2023-319003.zip"


main()
