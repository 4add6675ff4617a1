"""Every form that ``trace-dag export`` writes before its own readers, over all verified crashes of a root.

    python -m lab formats ROOT                 writes all forms, asks their readers, prints a table
    python -m lab formats ROOT osi sumo        some forms
    python -m lab formats ROOT --sample 60     a sample of the crashes
    python -m lab formats ROOT --keep FOLDER   the files stay there; those already there are asked again
    python -m lab formats ROOT --page PAGE.md  writes the tables into a page

Each reader runs in an environment of its own, which uv makes (``uv run --with``): they need libraries that do not go
together, and none of them is a dependency of trace-dag. ``sumo`` needs SUMO's netconvert (the extra ``sumo``), the
validator of glTF needs npm, and esmini, which is on no registry, is the program that ``ESMINI`` names.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path
from typing import Any

import trace_dag

READERS: dict[str, dict[str, tuple[str, ...]]] = {
    "commonroad": {
        "commonroad": ("commonroad-io==2026.1",),
        "drivability": ("commonroad-drivability-checker==2025.4.0", "commonroad-io==2024.3"),
        "crime": ("commonroad-crime==0.4.5", "commonroad-io==2024.3"),
    },
    "lanelet2": {"lanelet2": ("lanelet2==1.2.3",)},
    "scenarionet": {"scenarionet": ("metadrive-simulator==0.4.3",)},
    "sumo": {"sumo": ("eclipse-sumo==1.28.0", "sumolib==1.28.0", "xmlschema==4.3.2")},
    "osi": {
        "osi": ("osi-python==3.8.0", "asam-osi-utilities==0.4.0", "betterosi==0.9.0"),
        "omega": ("omega-prime==0.3.7",),
    },
    "openlabel": {"openlabel": ("openlabel-checker==0.1.0",)},
    "glb": {"gltf": ()},
    "points": {"points": ("duckdb==2.0.1", "geopandas==1.2.0", "gpxpy==1.6.2", "pyarrow==26.0.1", "pyogrio==0.13.0")},
    "packages": {"designer": ("commonroad-scenario-designer==0.8.5",), "esmini": ()},
}
"""By form the functions of ``format_judges.py`` that judge it, with the packages that each needs."""
MAP_READERS = {
    "carla": ("carla==0.9.16",),
    "netconvert": ("eclipse-sumo==1.28.0", "sumolib==1.28.0"),
    "scenic": ("scenic==3.1.1",),
    "pyxodr": ("pyxodr==0.1.3",),
    "ad_map": ("ad-map-access==3.0.0",),
    "tactics2d": ("tactics2d==0.1.9",),
}
"""By reader of ``map_judges.py`` the packages that it needs."""
_PAGE = """# Readers of the files

Each form of `trace-dag export`, and the OpenDRIVE maps, before the tools that read them. Made on {date} with commit
{commit}, of {crashes} accepted crashes of ROOT, by `python -m lab formats ROOT --sample {sample} --page PAGE`.
[Crashes in other tools](../../how-to/formats.md#losses-by-reader) says what each reader loses or changes, and
what to do about it.

## Forms

{forms}

## Maps

The OpenDRIVE maps of these crashes: how much each reader finds of what is in the files. An empty cell means that its
interface does not offer the value. More than 100 % means that it adds something, such as assumed limits, or the same
sign again for each road. *Heights* compares the range of heights.

{maps}
"""
_JUDGES = Path(__file__).with_name("format_judges.py")
_MAP_JUDGES = Path(__file__).with_name("map_judges.py")
_PROGRAM = Path(sys.executable).with_name("trace-dag")


def form_table(root: Path, forms: list[str], folder: Path, keys: list[str]) -> tuple[list[str], bool]:
    """Print and return a row for each reader of each form, and whether all took everything."""
    only = [argument for key in keys for argument in ("--only", key)]
    lines, well = ["| format | reader | files | taken | what it finds |", "|---|---|---:|---:|---|"], True
    for form in forms:
        export = [_PROGRAM, "--root", root, "export", "--format", form, "--output", folder / form, *only]
        subprocess.run(export, stdout=subprocess.DEVNULL, check=True)
        for judges, packages in READERS[form].items():
            rows, done = _ask(_JUDGES, judges, packages, folder / form)
            for row in rows:
                lines.append(f"| `{form}` | {row['judge']} | {row['files']} | {row['taken']} | {row['says']} |")
                print(lines[-1], flush=True)
            well &= done and all(row["taken"] == row["files"] for row in rows)
    return lines, well


def map_table(folder: Path) -> tuple[list[str], bool]:
    """Print and return a row for each reader of the maps below a folder, and whether each opened all."""
    lines, well = [], True
    for reader, packages in MAP_READERS.items():
        rows, done = _ask(_MAP_JUDGES, reader, ("numpy", *packages), folder)
        for row in rows:
            facts = row["facts"]
            if not lines:
                lines = [f"| reader | files | opened | {' | '.join(facts)} |", f"|---|{'---:|' * (len(facts) + 2)}"]
            shares = ["" if each is None else f"{each[0] / each[1]:.0%}" if each[1] else "" for each in facts.values()]
            lines.append(f"| {row['reader']} | {row['files']} | {row['opened']} | {' | '.join(shares)} |")
            well &= row["opened"] == row["files"]
            print(lines[-1], flush=True)
        well &= done
    return lines, well


def _ask(program: Path, judges: str, packages: tuple[str, ...], folder: Path) -> tuple[list[dict[str, Any]], bool]:
    """Return the rows of one environment's readers, and whether they came to their end."""
    with_packages = [argument for package in packages for argument in ("--with", package)]
    command = ["uv", "run", "--quiet", "--isolated", "--no-project", "--python", sys.executable, *with_packages]
    done = subprocess.run([*command, "python", program, judges, folder], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        print(f"{judges} failed with exit code {done.returncode}", file=sys.stderr)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")], done.returncode == 0


def _sampled(root: Path, sample: int) -> list[str]:
    """Return so many verified crashes, evenly out of all; for 0 all that ``export`` writes, the accepted ones."""
    states = trace_dag.open(root).crashes["final_state"]
    wanted = ("verified",) if sample else ("verified", "first_event_only")
    keys = [str(key) for key in states.index[states.isin(wanted)]]
    return keys[:: max(1, len(keys) // sample)][:sample] if sample else keys


def main() -> int:
    """Exit code 1 if a reader did not take something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("forms", nargs="*", metavar="FORMAT", help=f"of {', '.join(READERS)}; all by default")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where the files are written and stay")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="so many crashes, evenly out of all")
    parser.add_argument("--page", type=Path, metavar="PAGE", help="write the tables into this page")
    options = parser.parse_args()
    unknown = set(options.forms) - READERS.keys()
    if unknown:
        parser.error(f"no readers of {', '.join(sorted(unknown))}; there are those of {', '.join(READERS)}")
    keys, forms = _sampled(options.root, options.sample), options.forms or list(READERS)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        form_lines, forms_well = form_table(options.root, forms, folder, keys)
        map_lines, maps_well = map_table(folder / "packages") if "packages" in forms else ([], True)
    if options.page:
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
        text = _PAGE.format(
            sample=options.sample,
            date=f"{date.today():%d %B %Y}".lstrip("0"),
            commit=commit.stdout.strip(),
            crashes=len(keys),
            forms="\n".join(form_lines),
            maps="\n".join(map_lines),
        )
        options.page.write_text(text)
    return 0 if forms_well and maps_well else 1


if __name__ == "__main__":
    sys.exit(main())
