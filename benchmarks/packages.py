"""Scenario packages before their judges: every one, read back without this project's own readers.

    trace-dag --root ROOT export --output packages
    TRACE_DAG_JUDGES=.venv-judges python benchmarks/packages.py packages

Each package is measured: its checksums against its manifest, both maps and all scenarios in ASAM's official checkers
(which hold the XML schemas), the trajectories of ``scenario.xosc`` and ``scenario.carla.xosc`` against
``trajectories.json``, and the collision that a player written from the standard sees against the recorded one. Without
the judges' environment, what they would have said is left out.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.roads import judges
from tests.scenario.player import Scenario

_PACKAGES_AT_ONCE = 5
_PLAYER_STEP_S = 0.001
_LARGEST = {
    "position": (0.01, "m"),
    "time": (0.001, "s"),
    "collision, when": (0.1, "s"),
    "collision, where": (0.5, "m"),
}


class Deviation(NamedTuple):
    """How far a scenario is from the log it was written from."""

    position_m: float
    time_s: float
    collision_time_s: float
    collision_place_m: float


def damaged_files(package: Path) -> list[str]:
    """Files that are not as the manifest has them, missing and additional ones included."""
    manifest = json.loads((package / "manifest.json").read_text())
    listed = {name: file["sha256"] for name, file in manifest["files"].items()}
    found = {
        file.name: hashlib.sha256(file.read_bytes()).hexdigest()
        for file in package.iterdir()
        if file.name != "manifest.json"
    }
    return sorted(name for name in listed.keys() | found.keys() if listed.get(name) != found.get(name))


def deviation(package: Path, scenario_name: str) -> Deviation:
    """A scenario's trajectories against the package's log, and its collision against the recorded contact."""
    log = json.loads((package / "trajectories.json").read_text())
    scenario = Scenario((package / scenario_name).read_bytes())
    position_m = time_s = 0.0
    for number, columns in log["vehicles"].items():
        times = np.array(columns["time_s"])
        x, y, _ = scenario.centres(f"V{number}", times).T
        position_m = max(position_m, float(np.hypot(x - columns["x_m"], y - columns["y_m"]).max()))
        vertices_s = scenario.vertices[f"V{number}"][:, 0]
        time_s = max(time_s, float(np.abs(vertices_s[[0, -1]] - times[[0, -1]]).max()))
    collision, contact = scenario.play(_PLAYER_STEP_S), log["contacts"][0]
    if collision is None:
        return Deviation(position_m, time_s, math.inf, math.inf)
    return Deviation(
        position_m,
        time_s,
        abs(collision.time_s - contact["time_s"]),
        math.hypot(collision.x_m - contact["x_m"], collision.y_m - contact["y_m"]),
    )


def judge(packages: Sequence[Path]) -> list[dict[str, Any]]:
    """What ASAM's checkers say of every map and scenario; nothing where they are not installed."""
    verdicts = []
    for first in range(0, len(packages), _PACKAGES_AT_ONCE):
        some = packages[first : first + _PACKAGES_AT_ONCE]
        files = [file for package in some for file in sorted(package.iterdir()) if file.suffix in (".xodr", ".xosc")]
        try:
            verdicts += judges.official_check(files)
        except pytest.skip.Exception as missing:
            print(f"official checkers: {missing}")
            return []
        print(f"\rjudged {first + len(some)} of {len(packages)} packages", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return verdicts


def report_deviations(packages: Sequence[Path]) -> None:
    """Prints the largest deviation of each kind over all packages, and the packages beyond its bound."""
    for scenario_name in ("scenario.xosc", "scenario.carla.xosc"):
        found = {package.name: deviation(package, scenario_name) for package in packages}
        for index, (kind, (bound, unit)) in enumerate(_LARGEST.items()):
            values = {key: each[index] for key, each in found.items()}
            beyond = [key for key, value in values.items() if value > bound]
            print(
                f"{scenario_name}: {kind} at most {max(values.values()):.4f} {unit} off (bound {bound} {unit}), "
                f"{len(values) - len(beyond)} of {len(values)} within"
            )
            for key in beyond:
                print(f"  {key}: {values[key]:.4f} {unit}")


def report_verdicts(verdicts: Sequence[dict[str, Any]]) -> None:
    """Prints, by name of file, how many hold, how many rules ran, and every error."""
    by_name = defaultdict(list)
    for verdict in verdicts:
        name = Path(verdict["file"]).name
        by_name[name.split(".free")[0] + (".free.xosc" if ".free" in name else "")].append(verdict)
    for name, some in sorted(by_name.items()):
        wrong = {v["file"]: e for v in some if (e := [i for i in v["issues"] if " WARNING" not in i] + v["broken"])}
        rules = Counter(len(verdict["rules"]) for verdict in some)
        print(f"{name}: {len(some) - len(wrong)} of {len(some)} without error; files by rules run: {dict(rules)}")
        for file, errors in wrong.items():
            print(f"  {file}: {errors[0]} ({len(errors)} in all)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("packages", type=Path, help="folder of packages, as trace-dag export writes it")
    folder = parser.parse_args().packages
    packages = sorted(manifest.parent for manifest in folder.glob("*/manifest.json"))
    if not packages:
        raise SystemExit(f"{folder}: no package (a folder with a manifest.json) in it; trace-dag export writes some")
    damaged = {package.name: names for package in packages if (names := damaged_files(package))}
    print(f"{len(packages)} packages, {len(packages) - len(damaged)} as their manifests have them")
    for key, names in damaged.items():
        print(f"  {key}: {', '.join(names)}")
    report_deviations(packages)
    report_verdicts(judge(packages))


if __name__ == "__main__":
    main()
