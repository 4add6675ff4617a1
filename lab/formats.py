"""Every form that ``trace-dag export`` writes before its own readers, over all verified crashes of a root.

    python -m lab formats ROOT                 writes all forms, asks their readers, prints a table
    python -m lab formats ROOT osi sumo        some forms
    python -m lab formats ROOT --sample 60     a sample of the crashes
    python -m lab formats ROOT --keep FOLDER   the files stay there; those already there are asked again

Each reader runs in an environment of its own, which uv makes (``uv run --with``): they need libraries that do not go
together, and none of them is a dependency of trace-dag. ``sumo`` needs SUMO's netconvert (the extra ``sumo``).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import trace_dag

READERS = {
    "commonroad": {"commonroad": ("commonroad-io==2026.1",)},
    "lanelet2": {"lanelet2": ("lanelet2==1.2.3",)},
    "scenarionet": {"scenarionet": ("metadrive-simulator==0.4.3",)},
    "sumo": {"sumo": ("eclipse-sumo==1.28.0", "sumolib==1.28.0", "xmlschema==4.3.2")},
    "osi": {
        "osi": ("osi-python==3.8.0", "asam-osi-utilities==0.4.0", "betterosi==0.9.0"),
        "omega": ("omega-prime==0.3.7",),
    },
    "openlabel": {"openlabel": ("openlabel-checker==0.1.0",)},
    "points": {"points": ("geopandas==1.2.0", "gpxpy==1.6.2", "pyarrow==26.0.1")},
    "packages": {"designer": ("commonroad-scenario-designer==0.8.5",)},
}
"""By form the functions of ``format_judges.py`` that judge it, with the packages that each needs."""
_JUDGES = Path(__file__).with_name("format_judges.py")
_PROGRAM = Path(sys.executable).with_name("trace-dag")


def table(root: Path, forms: list[str], folder: Path, sample: int) -> bool:
    """Print what the readers of each form say, a row per reader; whether all took everything."""
    only = [argument for key in _sampled(root, sample) for argument in ("--only", key)] if sample else []
    print("| format | judge | files | taken | what it says |\n|---|---|---:|---:|---|", flush=True)
    well = True
    for form in forms:
        subprocess.run(
            [_PROGRAM, "--root", root, "export", "--format", form, "--output", folder / form, *only],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        for judges, packages in READERS[form].items():
            well &= _ask(form, judges, packages, folder / form)
    return well


def _ask(form: str, judges: str, packages: tuple[str, ...], folder: Path) -> bool:
    """Print the rows of one environment's readers; whether they took everything."""
    with_packages = [argument for package in packages for argument in ("--with", package)]
    command = ["uv", "run", "--quiet", "--isolated", "--no-project", "--python", sys.executable, *with_packages]
    done = subprocess.run([*command, "python", _JUDGES, judges, folder], stdout=subprocess.PIPE, text=True, check=False)
    well = done.returncode == 0
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            row = json.loads(line)
            well &= row["taken"] == row["files"]
            print(f"| `{form}` | {row['judge']} | {row['files']} | {row['taken']} | {row['says']} |", flush=True)
    if done.returncode:
        print(f"| `{form}` | {judges} failed with exit code {done.returncode} | | | |", flush=True)
    return well


def _sampled(root: Path, sample: int) -> list[str]:
    """Return so many verified crashes, evenly out of all."""
    crashes = trace_dag.open(root).crashes
    keys = crashes.index[crashes["final_state"] == "verified"].tolist()
    return keys[:: max(1, len(keys) // sample)][:sample]


def main() -> int:
    """Exit code 1 if a reader did not take something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("forms", nargs="*", metavar="FORMAT", help=f"of {', '.join(READERS)}; all by default")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where the files are written and stay")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="so many crashes, evenly out of all")
    options = parser.parse_args()
    unknown = set(options.forms) - READERS.keys()
    if unknown:
        parser.error(f"no readers of {', '.join(sorted(unknown))}; there are those of {', '.join(READERS)}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        return 0 if table(options.root, options.forms or list(READERS), folder, options.sample) else 1


if __name__ == "__main__":
    sys.exit(main())
