"""esmini, as people start it: the program where it is present, and what it makes of a trajectory where it is not.

``esmini`` (3.6.0) does two things to a polyline that the standard does not have. It leaves out vertices that lie close
together (its ``--traj_filter``, 0.1 m by default), and with the following mode ``position`` it turns a body from one
vertex's angle to the next at the corners of the path: half of the way between two vertices belongs to the corner
before it, half to the one after. :class:`FilteredScenario` does the same; a test holds it against the program.
"""

from __future__ import annotations

import csv
import math
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.scenario.player import Collision, Scenario

_RADIUS_M, _TURN_RAD, _STANDING_S, _SMALL = 0.1, 0.1, 1.0, 1e-6
_CORNER_M = 2.0
_LONGEST_RUN_S = 300.0
_QUIETLY = ("--headless", "--collision", "--disable_log", "--fixed_timestep")
_COLLISION = re.compile(r"^\[(\S+)\] \[warn\] Collision between (\S+) and (\S+)$", re.MULTILINE)


class FilteredScenario(Scenario):
    """A scenario as esmini plays it with its default options."""

    def __init__(self, xml: bytes) -> None:
        super().__init__(xml)
        self.vertices = {entity: _filtered(rows) for entity, rows in self.vertices.items()}

    def reference(self, entity: str, times_s: np.ndarray) -> np.ndarray:
        rows = self.vertices[entity]
        times = np.clip(np.asarray(times_s, float), rows[0, 0], rows[-1, 0])
        pose = np.stack([np.interp(times, rows[:, 0], rows[:, i]) for i in range(1, 7)], axis=-1)
        last = len(rows) - 2
        i = np.clip(np.searchsorted(rows[:, 0], times, side="left") - 1, 0, last)
        length = np.maximum(np.hypot(rows[i + 1, 1] - rows[i, 1], rows[i + 1, 2] - rows[i, 2]), _SMALL)
        along = length * (times - rows[i, 0]) / (rows[i + 1, 0] - rows[i, 0])
        along = np.where(length > _SMALL, along, 0.0)
        radius = np.minimum(_CORNER_M, length / 2)
        after, before = along < radius, along > length - radius
        for column in (4, 5, 6):
            angles = np.unwrap(rows[:, column])
            here, previous, following = angles[i], angles[np.maximum(i - 1, 0)], angles[i + 1]
            share = np.where(i < last, (radius + length - along) / (2 * radius), (length - along) / radius)
            angle = np.where(before, here + (1 - share) * (following - here), here)
            turned = previous + (radius + along) / (2 * radius) * (here - previous)
            pose[:, column - 1] = np.where(after, np.where(i > 0, turned, here), angle)
        return pose


def _filtered(rows: np.ndarray) -> np.ndarray:
    """What is left of a polyline's vertices, rows of time, x, y, z, h, p, r; the first and the last always are.

    ``start`` is the last vertex kept, ``middle`` the newest that merged into it. Longer than a second in one place is
    kept as standing there. Turns count to one side only, as they do in esmini.
    """
    kept = [rows[0]]
    middle: np.ndarray | None = None
    for row in rows[1:]:
        start = kept[-1]
        if _merge(start, row):
            middle = row
            continue
        if middle is not None and row[0] - start[0] >= _STANDING_S + _SMALL:
            kept.append(np.concatenate([middle[:1], start[1:]]))
        kept.append(row)
        middle = None
    return np.array(kept if middle is None else [*kept, middle])


def _merge(one: np.ndarray, two: np.ndarray) -> bool:
    near = math.hypot(one[1] - two[1], one[2] - two[2]) < _RADIUS_M + _SMALL
    return near and math.remainder(one[4] - two[4], math.tau) < _TURN_RAD + _SMALL


def program() -> Path:
    """Where esmini is; skips the test where it is not."""
    shared = Path(os.environ.get("TRACE_DAG_SHARED", Path(__file__).resolve().parents[3] / "shared"))
    found = shared / "judges" / "esmini"
    if not found.is_file():
        pytest.skip(f"esmini not present at {found} (set TRACE_DAG_SHARED to the folder that holds judges/)")
    return found


def collisions(scenario: Path, step_s: float, *options: str | Path) -> tuple[list[tuple[str, str, str]], list[str]]:
    """Plays a scenario beside its map with default options: time and entities of each collision in their order, and
    what it logged as an error."""
    run = subprocess.run(
        [program(), "--osc", scenario.name, *_QUIETLY, f"{step_s:g}", *options],
        cwd=scenario.parent,
        capture_output=True,
        text=True,
        timeout=_LONGEST_RUN_S,
        check=True,
    )
    return _COLLISION.findall(run.stdout), [line for line in run.stdout.splitlines() if "[error]" in line]


def play(scenario: Path, step_s: float, work: Path) -> tuple[Collision | None, dict[str, np.ndarray], list[str]]:
    """The first collision of a scenario, rows of time, x, y, h by entity, and what was logged as an error. A collision
    is where the two boxes overlap."""
    log = work / f"{scenario.parent.name}-{scenario.stem}.csv"
    met, errors = collisions(scenario, step_s, "--csv_logger", log.resolve())
    found = places(log)
    if not met:
        return None, found, errors
    entities = Scenario(scenario.read_bytes())
    times = next(iter(found.values()))[:, 0]
    (time_s, *pair), *_ = met
    k = int(np.argmin(np.abs(times - float(time_s))))
    one, two = (entities.box_at(entity, *found[entity][k, 1:]) for entity in pair)
    middle = one.intersection(two).centroid if one.intersects(two) else one.centroid
    return Collision(float(times[k]), middle.x, middle.y, (pair[0], pair[1])), found, errors


def places(log: Path) -> dict[str, np.ndarray]:
    """Rows of time, x, y, h by entity from a log with 31 columns an entity."""
    found: dict[str, list[list[float]]] = {}
    with log.open(newline="") as lines:
        for row in list(csv.reader(lines, skipinitialspace=True))[7:]:
            for first in range(2, len(row) - 30, 31):
                numbers = [row[1], *(row[first + i] for i in (11, 12, 24))]
                found.setdefault(row[first].strip(), []).append([float(number) for number in numbers])
    return {entity: np.array(rows) for entity, rows in found.items()}
