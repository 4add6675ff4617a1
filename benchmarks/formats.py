"""Every form that ``trace-dag export`` writes before its own readers, over all verified crashes of a root.

    python benchmarks/formats.py ROOT                 writes all forms, asks their readers, prints a table
    python benchmarks/formats.py ROOT osi sumo        some forms
    python benchmarks/formats.py ROOT --keep FOLDER   the files stay there; those already there are asked again

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

READERS = {
    "commonroad": ("commonroad-io==2026.1",),
    "scenarionet": ("metadrive-simulator==0.4.3",),
    "sumo": ("eclipse-sumo==1.28.0", "sumolib==1.28.0", "xmlschema==4.3.2"),
    "osi": ("osi-python==3.8.0", "asam-osi-utilities==0.4.0", "betterosi==0.9.0"),
    "openlabel": ("openlabel-checker==0.1.0",),
    "points": ("geopandas==1.2.0", "gpxpy==1.6.2", "pyarrow==26.0.1"),
}
_JUDGES = Path(__file__).with_name("format_judges.py")
_PROGRAM = Path(sys.executable).with_name("trace-dag")


def table(root: Path, forms: list[str], folder: Path) -> bool:
    """Print what the readers of each form say, a row per reader; whether all took everything."""
    print("| format | judge | files | taken | what it says |\n|---|---|---:|---:|---|", flush=True)
    well = True
    for form in forms:
        subprocess.run(
            [_PROGRAM, "--root", root, "export", "--format", form, "--output", folder / form],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        packages = [argument for package in READERS[form] for argument in ("--with", package)]
        command = ["uv", "run", "--quiet", "--isolated", "--no-project", "--python", sys.executable, *packages]
        done = subprocess.run(
            [*command, "python", _JUDGES, form, folder / form], stdout=subprocess.PIPE, text=True, check=False
        )
        for line in done.stdout.splitlines():
            if line.startswith("{"):
                row = json.loads(line)
                well &= row["taken"] == row["files"]
                print(f"| `{form}` | {row['judge']} | {row['files']} | {row['taken']} | {row['says']} |", flush=True)
        if done.returncode:
            well = False
            print(f"| `{form}` | failed with exit code {done.returncode} | | | |", flush=True)
    return well


def main() -> int:
    """Exit code 1 if a reader did not take something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("forms", nargs="*", metavar="FORMAT", help=f"of {', '.join(READERS)}; all by default")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where the files are written and stay")
    options = parser.parse_args()
    unknown = set(options.forms) - READERS.keys()
    if unknown:
        parser.error(f"no readers of {', '.join(sorted(unknown))}; there are those of {', '.join(READERS)}")
    with tempfile.TemporaryDirectory() as temporary:
        return 0 if table(options.root, options.forms or list(READERS), options.keep or Path(temporary)) else 1


if __name__ == "__main__":
    sys.exit(main())
