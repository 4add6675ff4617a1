"""Scenario packages before their judges: every one, read back without this project's own readers.

    trace-dag --root ROOT export --output packages
    TRACE_DAG_JUDGES=.venv-judges python -m lab packages packages

Each package is measured: its checksums against its manifest, both maps and all scenarios in ASAM's official checkers
(which hold the XML schemas), the trajectories of ``scenario.xosc`` and ``scenario.carla.xosc`` against
``trajectories.json``, and the collision that players see against the recorded one: a player written from the standard,
and esmini as it is started by default, in several steps. Without the judges, what they would have said is left out.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.roads import judges
from tests.scenario import esmini
from tests.scenario.player import Collision, Scenario
from trace_dag.crash.parties import party_label

_PACKAGES_AT_ONCE = 5
_PLAYER_STEP_S = 0.001
_STEPS_S = (0.001, 0.01, 0.02, 0.1)
_ON_TIME_S = 0.02
_SCENARIOS = ("scenario.xosc", "scenario.carla.xosc")
_LARGEST = {
    "position of vehicles": (0.01, "m"),
    "position of people": (0.1, "m"),  # nearer to each other players leave vertices out
    "time": (0.001, "s"),
    "collision, when": (0.1, "s"),
    "collision, where": (0.5, "m"),
}


class Seen(NamedTuple):
    """A collision as a player sees it: how late (s), and how far the bodies then are from where the log has them."""

    late_s: float
    away_m: float


class Deviation(NamedTuple):
    """Deviations of a scenario from the log it was written from."""

    vehicle_position_m: float
    person_position_m: float
    time_s: float
    collision_time_s: float
    collision_place_m: float


def damaged_files(package: Path) -> list[str]:
    """Return files that are not as the manifest has them, missing and additional ones included."""
    manifest = json.loads((package / "manifest.json").read_text())
    listed = {name: file["sha256"] for name, file in manifest["files"].items()}
    found = {
        file.name: hashlib.sha256(file.read_bytes()).hexdigest()
        for file in package.iterdir()
        if file.name != "manifest.json"
    }
    return sorted(name for name in listed.keys() | found.keys() if listed.get(name) != found.get(name))


def deviation(package: Path, scenario_name: str) -> Deviation:
    """Return a scenario's trajectories against the package's log, and its collision against the recorded contact."""
    log = json.loads((package / "trajectories.json").read_text())
    scenario = Scenario((package / scenario_name).read_bytes())
    position_m, time_s = {"V": 0.0, "P": 0.0}, 0.0  # of vehicles, of people and animals
    for number, columns in log["vehicles"].items():
        if party_label(int(number)) not in scenario.vertices:
            continue  # CARLA has no trailers
        times = np.array(columns["time_s"])
        x, y, _ = scenario.centres(party_label(int(number)), times).T
        kind = "P" if 1000 < int(number) < 3000 else "V"
        position_m[kind] = max(position_m[kind], float(np.hypot(x - columns["x_m"], y - columns["y_m"]).max()))
        vertices_s = scenario.vertices[party_label(int(number))][:, 0]
        time_s = max(time_s, float(np.abs(vertices_s[[0, -1]] - times[[0, -1]]).max()))
    contact = first_contact(log)
    if contact is None:
        return Deviation(position_m["V"], position_m["P"], time_s, 0.0, 0.0)
    collision = scenario.play(_PLAYER_STEP_S)
    if collision is None:
        return Deviation(position_m["V"], position_m["P"], time_s, math.inf, math.inf)
    return Deviation(
        position_m["V"],
        position_m["P"],
        time_s,
        abs(collision.time_s - contact["time_s"]),
        math.hypot(collision.x_m - contact["x_m"], collision.y_m - contact["y_m"]),
    )


def first_contact(log: dict[str, Any]) -> dict[str, Any] | None:
    """Return the first contact of two who move; scenarios have objects on their map, where players look for no
    collision.
    """
    moving = [each for each in log["contacts"] if str(each["number_2"]) in log["vehicles"]]
    return moving[0] if moving else None


def seen(package: Path, collision: Collision | None, scenario: Scenario, bodies: dict[str, Any]) -> Seen | None:
    """Return a player's collision against the recorded contact; ``bodies`` are x, y and h of reference points then."""
    if collision is None:
        return None
    log = json.loads((package / "trajectories.json").read_text())
    away_m = 0.0
    for number, columns in log["vehicles"].items():
        if party_label(int(number)) not in bodies:
            continue
        centre = scenario.box_at(party_label(int(number)), *bodies[party_label(int(number))]).centroid
        x, y = (np.interp(collision.time_s, columns["time_s"], columns[name]) for name in ("x_m", "y_m"))
        away_m = max(away_m, math.hypot(centre.x - x, centre.y - y))
    return Seen(collision.time_s - first_contact(log)["time_s"], away_m)


def seen_to_the_letter(package: Path, scenario_name: str, step_s: float) -> Seen | None:
    """Return the crash as a player written from the standard sees it."""
    scenario = Scenario((package / scenario_name).read_bytes())
    collision = scenario.play(step_s)
    times_s = np.array([collision.time_s if collision else 0.0])
    bodies = {entity: scenario.reference(entity, times_s)[0, [0, 1, 3]] for entity in scenario.vertices}
    return seen(package, collision, scenario, bodies)


def seen_in_esmini(package: Path, scenario_name: str, step_s: float) -> Seen | None:
    """Return the crash as esmini sees it with its default options."""
    with tempfile.TemporaryDirectory() as work:
        collision, places, _ = esmini.play(package / scenario_name, step_s, Path(work))
    time_s = collision.time_s if collision else 0.0
    bodies = {entity: rows[np.argmin(np.abs(rows[:, 0] - time_s)), 1:] for entity, rows in places.items()}
    return seen(package, collision, Scenario((package / scenario_name).read_bytes()), bodies)


def report_players(packages: Sequence[Path], steps_s: Sequence[float]) -> None:
    """Print, by scenario, player and step, in how many packages the crash is seen on time, late, early and never.

    On time is within 20 ms, or within a step where that is longer. Left out are packages without a contact of two who
    move.
    """
    packages = [each for each in packages if first_contact(json.loads((each / "trajectories.json").read_text()))]
    players = {"to the letter": seen_to_the_letter, "esmini": seen_in_esmini}
    try:
        esmini.program()
    except pytest.skip.Exception as missing:
        print(f"esmini: {missing}")
        del players["esmini"]
    for scenario_name in _SCENARIOS:
        for player, look in players.items():
            for step_s in steps_s:
                found = {package.name: look(package, scenario_name, step_s) for package in packages}
                when = {key: "never" if each is None else _when(each.late_s, step_s) for key, each in found.items()}
                on_time = [each for key, each in found.items() if each is not None and when[key] == "on time"]
                print(
                    f"{scenario_name}, {player}, steps of {1000 * step_s:g} ms: {dict(Counter(when.values()))}; "
                    f"on time at most {max((abs(each.late_s) for each in on_time), default=0):.4f} s and "
                    f"{max((each.away_m for each in on_time), default=0):.3f} m off",
                    flush=True,
                )
                for key, each in found.items():
                    if when[key] != "on time":
                        print(f"  {key}: {when[key]}" + ("" if each is None else f", {each.late_s:+.3f} s"))


def _when(late_s: float, step_s: float) -> str:
    if abs(late_s) <= max(_ON_TIME_S, step_s) + 1e-6:
        return "on time"
    return "late" if late_s > 0 else "early"


def judge(packages: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the findings of ASAM's checkers on every map and scenario; none where they are not installed."""
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
    """Print the largest deviation of each kind over all packages, and the packages beyond its bound."""
    for scenario_name in _SCENARIOS:
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
    """Print, by name of file, how many hold, how many rules ran, and every error."""
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
    parser.add_argument(
        "--steps", type=float, nargs="+", default=_STEPS_S, metavar="S", help="steps in which players play, in seconds"
    )
    arguments = parser.parse_args()
    folder = arguments.packages
    packages = sorted(manifest.parent for manifest in folder.glob("*/manifest.json"))
    if not packages:
        raise SystemExit(f"{folder}: no package (a folder with a manifest.json) in it; trace-dag export writes some")
    damaged = {package.name: names for package in packages if (names := damaged_files(package))}
    print(f"{len(packages)} packages, {len(packages) - len(damaged)} as their manifests have them")
    for key, names in damaged.items():
        print(f"  {key}: {', '.join(names)}")
    report_deviations(packages)
    report_players(packages, arguments.steps)
    report_verdicts(judge(packages))


if __name__ == "__main__":
    main()
