"""How often an object store is asked: requests per crash of each command, by kind.

    python -m benchmarks.store_requests [--crashes 60]

The bundled sample (repeated where more crashes are wanted) lies on an S3-compatible server on loopback, whose log is
counted. Object stores charge by the request, and by far the most for PUT and LIST.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from pathlib import Path

from benchmarks.cohorts import MAPS, repeated_sample
from benchmarks.measuring import Figure
from benchmarks.results import keep
from tests.faults.cluster import BUCKET, free_port

_LINE = re.compile(r'"(GET|HEAD|PUT|POST|DELETE) ([^ ]+) HTTP')
_WAIT_S = 60.0


def main() -> None:
    """Print and keep the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crashes", type=int, default=60)
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = measured(folder, options.crashes)
    if not options.no_keep:
        keep(figures)


def measured(folder: Path, crashes: int) -> list[Figure]:
    """Start the server, call the commands, count."""
    address, log = f"http://127.0.0.1:{free_port()}", folder / "requests.log"
    port = address.rpartition(":")[2]
    with log.open("wb") as out:
        server = subprocess.Popen([sys.executable, "-m", "moto.server", "-p", port], stdout=out, stderr=out)
    try:
        _wait_for(f"{address}/{BUCKET}")
        environment = os.environ | {
            "AWS_ENDPOINT_URL": address,
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
            "XDG_DATA_HOME": str(folder / "data"),
        }
        reports = repeated_sample(folder / "reports", crashes)
        figures = []
        for what, arguments in (
            ("ingest", ["ingest", "--reports", str(reports), "--maps", str(MAPS)]),
            ("run", ["run"]),
            ("run with nothing to do", ["run"]),
            ("status", ["status"]),
            ("verify", ["verify"]),
        ):
            before = _counted(log)
            called = [sys.executable, "-m", "trace_dag.cli", "--root", f"s3://{BUCKET}/root", *arguments]
            done = subprocess.run(called, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                raise SystemExit(f"{what}: {done.stdout[-500:]}{done.stderr[-500:]}")
            asked = _counted(log) - before
            note = ", ".join(f"{count} {kind}" for kind, count in asked.most_common())
            title, per_crash = f"object store, {crashes} crashes: {what}", asked.total() / crashes
            figures.append(Figure(title, per_crash, "requests per crash", note=note))
            print(f"{title}: {per_crash:.2f} requests per crash ({note})", flush=True)
        return figures
    finally:
        server.kill()
        server.wait()


def _counted(log: Path) -> Counter[str]:
    """Requests so far: PUT, GET, HEAD, DELETE, and LIST, which is a GET of the bucket with a prefix."""
    found: Counter[str] = Counter()
    for method, path in _LINE.findall(log.read_text()):
        found["LIST" if method == "GET" and "list-type" in path else method] += 1
    return found


def _wait_for(bucket: str) -> None:
    """Make the bucket once the server answers."""
    until = time.monotonic() + _WAIT_S
    while True:
        try:
            urllib.request.urlopen(urllib.request.Request(bucket, method="PUT")).close()
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)
        else:
            return


if __name__ == "__main__":
    main()
