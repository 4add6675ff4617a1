"""Damage to every kind of file of a root: what is found, and what one repair and one run bring back.

    python -m lab damage                    each way of damage on each kind of file, then ten files at once
    python -m lab damage --ways delete      one way
    python -m lab damage --rounds 20        so many times ten files at once

A root of some crashes of the sample is made once: run, with an agent evaluated and controls. Each try damages a copy
of it; then ``verify --contents --repair`` and ``run`` have to bring back every file that was there with the same
bytes, but for times in records, the warehouse (whose rows ``verify`` compares) and what was noted of reports.
Printed are the way, the file, whether verify named it, and what is there afterwards. Exit code 1 where a file was
not found or did not come back; results of studies, which their own commands make, and notes need only be found.
Dagster's records of runs are not touched."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import random
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import trace_dag
from trace_dag.cli import main as main_command
from trace_dag.common.stage import Stage

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"
CASES = ("319003", "319022", "319042", "319055", "319061")
_KEY = re.compile(r"\d{4}-\d{5,6}")
_OUTSIDE = ("dagster", "locks", "quarantine", "settings.toml")
_OF_TIME = ("run_id", "started_at", "duration_s", "attempts", "history", "checksum", "failed_attempt", "fetched")
_NOTES = ("cache/", "listings.parquet")  # made anew when they are needed: their loss is no damage
_OF_AGENTS = ("benchmark/index.html", "benchmark/leaderboard.html")  # say which evaluations there are
_MADE_LATER = (*_NOTES, "comparisons", "evaluations", "variations", "estimators")


def truncate(path: Path, _: random.Random) -> None:
    os.truncate(path, path.stat().st_size // 2)


def flip(path: Path, draw: random.Random) -> None:
    data = bytearray(path.read_bytes())
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    path.write_bytes(data)


def empty(path: Path, _: random.Random) -> None:
    path.write_bytes(b"")


def delete(path: Path, _: random.Random) -> None:
    path.unlink()


def garbage(path: Path, draw: random.Random) -> None:
    path.write_bytes(draw.randbytes(path.stat().st_size))


def swap(path: Path, draw: random.Random) -> None:
    """Swap a file with another of its kind, or any other where there is none."""
    others = [each for each in path.parent.iterdir() if each.is_file() and each != path]
    alike = [each for each in others if each.suffixes == path.suffixes]
    if not others:
        garbage(path, draw)
        return
    other = draw.choice(sorted(alike or others))
    one, two = path.read_bytes(), other.read_bytes()
    path.write_bytes(two)
    other.write_bytes(one)


WAYS: dict[str, Callable[[Path, random.Random], None]] = {
    each.__name__: each for each in (truncate, flip, empty, delete, swap, garbage)
}


class Done(NamedTuple):
    """The end of a command, and its output."""

    returncode: int
    stdout: str
    stderr: str


def call(root: Path, *arguments: str) -> Done:
    """Run a command to its end in a fork of this process, which has read the modules: else that is most of its time."""
    with ProcessPoolExecutor(1, get_context("fork")) as pool:
        return pool.submit(_done, ["trace-dag", "--root", str(root), *arguments]).result()


def _done(words: list[str]) -> Done:
    os.environ["TRACE_DAG_EXECUTION__EXECUTOR"] = "in_process"  # done before workers would have started
    sys.argv[:] = words
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            main_command()
            code = 0
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return Done(code, out.getvalue(), err.getvalue())


def made(folder: Path) -> Path:
    """Return the root that is damaged."""
    reports, root = folder / "reports", folder / "root"
    reports.mkdir()
    for case in CASES:
        for report in SAMPLE.rglob(f"crash_{case}.xml"):
            shutil.copy(report, reports)
    for arguments in (
        ("ingest", "--reports", str(reports), "--maps", str(SAMPLE / "osm"), "--cohort", "sample"),
        ("run",),
        ("evaluate", "--agent", "brake"),
        ("controls",),
    ):
        done = call(root, *arguments)
        if done.returncode:
            raise SystemExit(f"{' '.join(arguments)}: {done.stderr}")
    return root


def files_of(root: Path) -> list[str]:
    """Return the files that the program answers for, by name."""
    names = (path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())
    return sorted(name for name in names if not name.startswith(_OUTSIDE))


def kind_of(name: str) -> str:
    """Return the kind of a file: its name without the key of a crash."""
    return _KEY.sub("<key>", name)


def content(path: Path) -> object:
    """Return the content that has to come back: the bytes, of JSON documents all but times."""
    if path.name in ("warehouse.duckdb", "warehouse.json", "listings.parquet") or path.parent.name == "cache":
        return path.is_file()
    data = path.read_bytes()
    if path.name == "manifest.json":
        return sorted(json.loads(data)["files"])
    if path.name.endswith(".outcome.json"):
        return _without_times(json.loads(data))
    return re.sub(rb"[\d.]+", b"", data) if path.suffix == ".html" else data  # pages say how long a stage took


def _without_times(value: object) -> object:
    if isinstance(value, dict):
        return {name: _without_times(each) for name, each in value.items() if name not in _OF_TIME}
    return value


def attempt(root: Path, folder: Path, damaged: Sequence[tuple[str, str]], draw: random.Random) -> bool:
    """Return the damage files, each in a way, repair and run; whether all was found and came back."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        copy = Path(shutil.copytree(root, Path(scratch) / "root"))
        for name, way in damaged:
            if (copy / name).is_file():
                WAYS[way](copy / name, draw)
        hurt = {name for name, _ in damaged if _bytes(root / name) != _bytes(copy / name)}
        answer = call(copy, "verify", "--contents", "--repair", "--json")
        try:
            rows = json.loads(answer.stdout)
        except ValueError:
            print(f"verify: {answer.stderr.strip()[-300:]}")
            return False
        named = [*rows["repaired"], *rows["disagreements"]]
        said = {str(row["file"] or "") for row in named}
        said |= {f"{row['stage']}/{row['key']}.outcome.json" for row in named}  # a lost record: its crash and stage
        ran = call(copy, "run")
        lost = [name for name in files_of(root) if not (copy / name).is_file()]
        other = [name for name in files_of(root) if name not in lost and _differs(root, copy, name)]
        again = call(copy, "verify", "--contents").returncode
    all_well = True
    for name, way in damaged:
        if name not in hurt:
            continue
        found = any(each.endswith(name) for each in said)
        all_well &= found and (name.startswith(_MADE_LATER) or (name not in lost and name not in other))
        print(
            f"{way:8} {name:55} {'found' if found else 'NOT FOUND':9} {'lost' if name in lost else 'there':5} "
            f"{'' if name in lost else 'other bytes' if name in other else 'same bytes'}",
            flush=True,
        )
    excused = (*_MADE_LATER, *(_OF_AGENTS if any(name.startswith("evaluations") for name in hurt) else ()))
    beside = [name for name in (*lost, *other) if name not in hurt and not name.startswith(excused)]
    if beside or ran.returncode or again:
        all_well = False
        print(f"  run {ran.returncode}, verify {again}, not as before: {', '.join(beside[:5])} {ran.stderr[-300:]}")
    return all_well


def _differs(root: Path, copy: Path, name: str) -> bool:
    try:
        return content(root / name) != content(copy / name)
    except ValueError:
        return True


def _bytes(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


def main() -> int:
    """Exit code 1 if something was not found or did not come back."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ways", nargs="*", choices=WAYS, default=list(WAYS))
    parser.add_argument("--kinds", default="", help="only kinds of file with this in their name")
    parser.add_argument("--rounds", type=int, default=5, help="times ten files are damaged at once (default 5)")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    for module in pkgutil.walk_packages(trace_dag.__path__, "trace_dag."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    with tempfile.TemporaryDirectory() as folder:
        root = made(Path(folder))
        kinds: dict[str, list[str]] = {}
        for name in files_of(root):
            kinds.setdefault(kind_of(name), []).append(name)
        print(f"{len(kinds)} kinds of file; {len(Stage)} stages, {len(CASES)} crashes", flush=True)
        tries = [
            [(draw.choice(names), way)]
            for kind, names in kinds.items()
            if options.kinds in kind
            for way in options.ways
            if way != "delete" or not kind.startswith(_NOTES)
        ]
        for _ in range(options.rounds):
            tries.append([(name, draw.choice(options.ways)) for name in draw.sample(files_of(root), 10)])
        wrong = sum(not attempt(root, Path(folder), each, draw) for each in tries)
    print(f"{len(tries)} tries, {wrong} in which not all was found or came back")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
