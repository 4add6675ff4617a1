"""Where the CPU time of a crash goes, all in: the run command in this process, looked at every few milliseconds.

``python -m benchmarks.where_time_goes [CRASHES]`` runs the bundled sample, under new keys where more are wanted,
through everything ``trace-dag run`` does, without worker processes. Each sample counts the CPU time since the one
before it, for the innermost function of the table below that is at work, and beside it for the innermost function of
this package: a sampling profiler slows down nothing, where one that hears of every call makes small functions look
dear.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import FrameType

from benchmarks.cohorts import MAPS, repeated_sample
from trace_dag.cohorts.ingest import ingest
from trace_dag.storage.files import Storage

_EVERY_S = 0.002
_PACKAGE = f"{os.sep}trace_dag{os.sep}"
# Parts of the work by module and function: the innermost that is at work is charged.
_PARTS = {
    ("stages/raw_report", ""): "stage raw_report",
    ("stages/crash_record", ""): "stage crash_record",
    ("stages/osm_extract", ""): "stage osm_extract",
    ("stages/road_map", ""): "stage road_map",
    ("stages/state_estimate", ""): "stage state_estimate",
    ("stages/simulation_log", ""): "stage simulation_log",
    ("stages/verdict", ""): "stage verdict",
    ("crash_picture", ""): "picture of a run",
    ("flow/worker", ""): "running stages: files, records, locks",
    ("flow/crash_store", ""): "running stages: files, records, locks",
    ("flow/batch", ""): "running stages: files, records, locks",
    ("flow/contract", "load"): "reading back artefacts",
    ("benchmark/build", "build_benchmark"): "benchmark: planning, index, ledger",
    ("benchmark/crash_files", ""): "benchmark: files of a crash",
    ("benchmark/build", "_make_one"): "page",
    ("scenario/package", "package_files"): "package: documents",
    ("scenario/package", "zip_files"): "package: compressing",
    ("scenario/package", "_sources"): "package: maps",
    ("scenario/package", "_scenarios"): "package: OpenSCENARIO",
    ("scenario/pictures", "draw_crash"): "package: picture",
    ("scenario/replay", "write_html_player"): "replay",
    ("scenario/replay", "_map_svg"): "replay: map",
    ("scenario/thumbnail", ""): "moving thumbnail",
    ("scenario/crash_page", "write_crash_page"): "page",
    ("warehouse/build", ""): "warehouse",
    ("assets/", ""): "Dagster: assets and records",
    ("definitions/", ""): "Dagster: assets and records",
}
_NESTED = {("picture of a run", "package: picture"): "picture of a run"}  # inside: what it is charged to


class Sampler:
    """Counts CPU time by part of the work and by function while it is entered."""

    def __init__(self) -> None:
        self.parts: Counter[str] = Counter()
        self.functions: Counter[str] = Counter()
        self._last_s = 0.0

    def __enter__(self) -> Sampler:
        self._last_s = time.process_time()
        signal.signal(signal.SIGPROF, self._hear)
        signal.setitimer(signal.ITIMER_PROF, _EVERY_S, _EVERY_S)
        return self

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _hear(self, _number: int, frame: FrameType | None) -> None:
        now_s = time.process_time()
        part, function = _charged(frame)
        self.parts[part] += now_s - self._last_s  # type: ignore[assignment] # Counter counts seconds as well
        self.functions[function] += now_s - self._last_s  # type: ignore[assignment]
        self._last_s = now_s


def _charged(frame: FrameType | None) -> tuple[str, str]:
    function, parts = "", []
    while frame is not None:
        file, name = frame.f_code.co_filename, frame.f_code.co_name
        at = file.rfind(_PACKAGE)
        if at >= 0:
            module = file[at + len(_PACKAGE) :].removesuffix(".py")
            function = function or f"{module}:{frame.f_code.co_qualname}"
            parts += [label for (where, what), label in _PARTS.items() if where in module and what in ("", name)][:1]
        frame = frame.f_back
    part = parts[0] if parts else "command: imports, selection, summary"
    for outer in parts[1:]:
        part = _NESTED.get((outer, part), part)
    return part, function or "imports"


def main() -> None:
    """Print milliseconds per crash by part and by function."""
    crashes = int(sys.argv[1]) if sys.argv[1:] else 60
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        ingest(Storage.open(root), "sample", reports=[repeated_sample(Path(folder) / "reports", crashes)], maps=[MAPS])
        from trace_dag.cli.main import cli

        with Sampler() as sampler, contextlib.suppress(SystemExit):
            cli.main(["--root", str(root), "run", "--executor", "in_process"], standalone_mode=False)
        size = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    for title, counted, most in (("part", sampler.parts, 40), ("function", sampler.functions, 60)):
        print(f"\n{title:70} CPU ms per crash")
        for name, seconds in counted.most_common(most):
            print(f"{name:70} {1e3 * seconds / crashes:8.1f}")
        print(f"{'together':70} {1e3 * sum(counted.values()) / crashes:8.1f}")
    print(f"\n{size / crashes / 1e6:.2f} MB per crash; {crashes} crashes")


if __name__ == "__main__":
    main()
