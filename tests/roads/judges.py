"""Independent judges of road maps: CARLA's map library, ASAM's official checker, SUMO's netconvert.

CARLA is the ``carla`` extra; the other two live in an environment of their own (``./check`` makes ``.venv-judges``;
``TRACE_DAG_JUDGES`` names another one), because the checker needs older libraries than this project.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from trace_dag.common.geometry import FloatArray
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.network import RoadNetwork

_REPOSITORY = Path(__file__).resolve().parents[2]
_CHECKER = Path(__file__).with_name("official_checker.py")
_FILES_PER_PROCESS = 10
_SUMO_LANE_TYPES = (LaneType.DRIVING, LaneType.ENTRY, LaneType.EXIT, LaneType.BIDIRECTIONAL)


def judges_environment() -> Path:
    """Folder of the judges' executables; skips where it is absent."""
    folder = Path(os.environ.get("TRACE_DAG_JUDGES", _REPOSITORY / ".venv-judges")) / "bin"
    if not (folder / "netconvert").exists():
        pytest.skip(f"judges not installed at {folder} (./check installs them; TRACE_DAG_JUDGES names another place)")
    return folder


def sumo_home() -> Path:
    """Folder of the judges' SUMO, its programs and TraCI; skips where it is absent."""
    return next(judges_environment().parent.glob("lib/python*/site-packages/sumo"))


@dataclass(frozen=True)
class CarlaSteps:
    """Driving on by 1 m from every waypoint: distances (metres), changes of height and heading, and how many led on."""

    distances_m: FloatArray
    height_m: FloatArray
    heading_deg: FloatArray


def carla_map(xodr: bytes) -> Any:
    """The map in CARLA's own library; skips without the ``carla`` extra."""
    carla = pytest.importorskip("carla", reason="the carla extra is not installed")
    return carla.Map("judged", xodr.decode())


def carla_steps(carla_map: Any, spacing_m: float = 1.0) -> CarlaSteps:
    """Steps of 1 m to every next waypoint, junctions included, starting every ``spacing_m`` in every lane."""
    rows = []
    for waypoint in carla_map.generate_waypoints(spacing_m):
        here = waypoint.transform
        for following in waypoint.next(1.0):
            there = following.transform
            rows.append(
                (
                    here.location.distance(there.location),
                    abs(there.location.z - here.location.z),
                    abs(math.remainder(there.rotation.yaw - here.rotation.yaw, 360)),
                )
            )
    steps = np.array(rows).reshape(-1, 3)
    return CarlaSteps(steps[:, 0], steps[:, 1], steps[:, 2])


def distance_from_carla(network: RoadNetwork, carla_map: Any, per_lane: int = 5) -> FloatArray:
    """How far our poses lie from CARLA's for the same road, lane and ``s``, in metres, over all drivable lanes."""
    distances = []
    for ref in network.drivable_lanes():
        geometry = network.geometry(ref)
        inset = min(0.01, geometry.length_m / 10)
        for s in np.linspace(geometry.begin_m + inset, geometry.end_m - inset, per_lane):
            waypoint = carla_map.get_waypoint_xodr(int(ref.road_id), ref.lane_id, float(s))
            assert waypoint is not None, (ref, s)
            pose, place = geometry.pose(float(s)), waypoint.transform.location
            distances.append(math.dist((pose.x_m, pose.y_m, pose.z_m), (place.x, -place.y, place.z)))
    return np.array(distances)


def carla_landmarks(network: RoadNetwork, carla_map: Any) -> dict[LaneRef, list[str]]:
    """The types of the signals and signs that CARLA finds for each driving lane outside junctions, on its own road."""
    found = {}
    for ref in network.drivable_lanes():
        if network.road_by_id[ref.road_id].junction_id is None and network.lane(ref).type is not LaneType.BIDIRECTIONAL:
            begin_m, end_m = network.lane_span(ref)
            start_m = begin_m + 0.01 if network.direction(ref) > 0 else end_m - 0.01
            waypoint = carla_map.get_waypoint_xodr(int(ref.road_id), ref.lane_id, start_m)
            seen = waypoint.get_landmarks(end_m - begin_m, True)
            found[ref] = sorted(mark.type for mark in seen if mark.road_id == int(ref.road_id))
    return found


def official_check(files: Sequence[Path]) -> list[dict[str, Any]]:
    """ASAM's checker on every file: ``rules`` run, ``skipped``, ``broken`` and ``issues``.

    Its start takes a second and a large map some more: many files are divided among as many processes as there are
    cores, a few files at a time.
    """
    python = judges_environment() / "python"

    def check(batch: Sequence[Path]) -> list[dict[str, Any]]:
        done = subprocess.run([python, _CHECKER, *batch], capture_output=True, text=True, timeout=900, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
        return [json.loads(line) for line in done.stdout.splitlines()]

    batches = [files[start : start + _FILES_PER_PROCESS] for start in range(0, len(files), _FILES_PER_PROCESS)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return [verdict for verdicts in pool.map(check, batches) for verdict in verdicts]


def sumo_lanes(xodr: Path, folder: Path) -> dict[tuple[str, int], int]:
    """Lanes per road and direction (+1 along the reference line) as netconvert reads the file."""
    net = folder / f"{xodr.stem}.net.xml"
    done = subprocess.run(
        [
            *(judges_environment() / "netconvert", "--opendrive-files", xodr, "--output-file", net),
            *("--output.original-names", "true"),
        ],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "Error" not in done.stderr, done.stderr[-2000:]
    most: dict[tuple[str, int], int] = defaultdict(int)
    for edge in etree.parse(str(net)).iterfind("edge"):
        if edge.get("function") == "internal":
            continue
        counts: dict[tuple[str, int], int] = defaultdict(int)
        for parameter in edge.iterfind("lane/param[@key='origId']"):
            road_id, lane_id = parameter.get("value", "").split()[0].rsplit("_", 1)
            counts[road_id, 1 if int(lane_id) < 0 else -1] += 1
        for key, count in counts.items():
            most[key] = max(most[key], count)
    return dict(most)


def our_lanes(network: RoadNetwork) -> dict[tuple[str, int], int]:
    """Lanes per road and direction, junctions left out, as our own model has them."""
    most: dict[tuple[str, int], int] = defaultdict(int)
    for road in network.roads:
        if road.junction_id is not None:
            continue
        for section in road.lane_sections:
            for direction in (1, -1):
                count = sum(lane.type in _SUMO_LANE_TYPES and lane.id * direction < 0 for lane in section.lanes)
                if count:
                    most[road.id, direction] = max(most[road.id, direction], count)
    return dict(most)
