"""Digests of the outputs of each stage for all crashes of the sample: ``python -m tests.stage_outputs`` writes them.

Numbers are rounded to two decimals, so that processors that round differently agree.
"""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import osmium
import pyarrow.parquet as pq
import sample_runs

from trace_dag.common.stage import Stage
from trace_dag.flow.stages import VERSIONS

FILE = Path(__file__).with_name("stage_outputs.json")
REPORTS = ("reports", "people/reports", "chains/reports", "roadside/reports")
_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
_STEPS = "simulation_log/*.parquet"  # a chaotic motion after the impact amplifies the last digit


def run_sample(root: Path) -> Path:
    """Run every crash of the sample, of whatever kind; return the root."""
    folders = [word for each in REPORTS for word in ("--reports", str(sample_runs.SAMPLE / each))]
    for words in (["ingest", *folders, "--maps", str(sample_runs.SAMPLE / "osm")], ["run"]):
        done = sample_runs.trace_dag_process(root, *words)
        assert done.returncode == 0, done.stderr
    return root


def digests(root: Path) -> dict[str, str]:
    """Return a digest of the outcomes and artefacts of each stage."""
    found = {}
    for stage in Stage:
        text = hashlib.sha256()
        for path in sorted((root / stage.value).iterdir()):
            if not path.match(_STEPS):
                rounded = _NUMBER.sub(lambda number: f"{float(number[0]) + 0.0:.2f}", "\n".join(_lines(path)))
                text.update(f"{path.name}\n{rounded}\n".replace("-0.00", "0.00").encode())
        found[stage.value] = text.hexdigest()[:16]
    return found


def _lines(path: Path) -> Iterator[str]:
    if path.name.endswith(".outcome.json"):
        record = json.loads(path.read_text())
        yield json.dumps({name: record.get(name) for name in ("outcome", "reason", "detail")})
    elif path.suffix == ".parquet":
        yield repr(pq.read_table(path).to_pylist())
    elif path.suffix == ".pbf":
        for each in osmium.FileProcessor(str(path)):
            yield f"{each} {dict(each.tags)}"
    else:
        yield path.read_text()


def record(root: Path) -> dict[str, dict[str, int | str]]:
    """Return the number of each stage's code beside the digest of its outputs."""
    return {name: {"number": VERSIONS[Stage(name)], "digest": digest} for name, digest in digests(root).items()}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        FILE.write_text(json.dumps(record(run_sample(Path(folder) / "root")), indent=1) + "\n")
