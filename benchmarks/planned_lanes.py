"""Whether planned motions lie in lanes that are there, crash by crash, over the verified crashes of storage roots.

    python benchmarks/planned_lanes.py ROOT [ROOT ...] [--worst 15]

Of each crash's best hypothesis, every vehicle's planned samples from the start to one second before the impact (the
last second belongs to the evasion): the share whose middle lies beside every lane, and whether the start does. A lane
is there where it is at least as wide as the vehicle; junctions' connecting lanes count. ROOT is a folder, the first
one a crash is found in counts.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.states.json_io import estimate_from_json
from trace_dag.states.types import ParticipantState

EVASION_S = 1.0
EVERY = 5  # samples are 0.02 s apart: every tenth of a second
EDGE_M = 0.1  # a middle this far beside a lane still counts as in it
REACH_M = 60.0


class Motion(NamedTuple):
    """One vehicle's planned motion against the lanes: metres beside the nearest one that is wide enough."""

    key: str
    vehicle: int
    manoeuvre: str
    start_m: float
    worst_m: float
    share_off: float


def beside_m(network: RoadNetwork, participant: ParticipantState, index: int) -> float:
    """How far the middle of a planned sample is from the nearest lane that is as wide as the body, 0 inside one."""
    motion = participant.trajectory
    x, y, z = (float(values[index]) for values in (motion.x_m, motion.y_m, motion.z_m))
    for match in network.nearest_lanes(x, y, REACH_M, z_m=z):
        if network.width_m(match.lane, match.s_m) >= participant.width_m:
            return match.outside_m
    return REACH_M


def measure(root: Path, key: str) -> list[Motion]:
    """Both vehicles of a crash's best hypothesis."""
    network = read_opendrive((root / "road_map" / f"{key}.xodr").read_bytes(), name=key)
    best = estimate_from_json((root / "state_estimate" / f"{key}.json").read_bytes()).best
    motions = []
    for participant in best.participants:
        until_s = best.impact_time_s - EVASION_S
        wanted = np.flatnonzero(participant.trajectory.time_s <= until_s)[::EVERY]
        off = np.array([beside_m(network, participant, int(index)) for index in wanted])
        share = float((off > EDGE_M).mean())
        number, manoeuvre = participant.vehicle_number, participant.manoeuvre.value
        motions.append(Motion(key, number, manoeuvre, float(off[0]), float(off.max()), share))
    return motions


def verified(root: Path) -> list[str]:
    """The crashes of a root that are verified."""
    outcomes = sorted((root / "verdict").glob("*.outcome.json"))
    return [
        path.name.removesuffix(".outcome.json")
        for path in outcomes
        if json.loads(path.read_text())["outcome"] == "accepted"
    ]


def main() -> int:
    """Measure and print: a line per root, then the worst motions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", type=Path, nargs="+")
    parser.add_argument("--worst", type=int, default=15)
    options = parser.parse_args()
    for root in options.roots:
        motions = [motion for key in verified(root) for motion in measure(root, key)]
        starts = [motion for motion in motions if motion.start_m > EDGE_M]
        mean = statistics.fmean(motion.share_off for motion in motions)
        clean = sum(motion.share_off == 0 for motion in motions)
        print(
            f"{root}: {len(motions)} motions, {clean} in lanes throughout, {len(starts)} start beside every lane, "
            f"{mean:.2%} of samples beside"
        )
        for motion in sorted(motions, key=lambda motion: -motion.share_off)[: options.worst]:
            if motion.share_off:
                print(
                    f"  {motion.key} vehicle {motion.vehicle} {motion.manoeuvre}: {motion.share_off:.0%} of samples, "
                    f"start {motion.start_m:.1f} m, worst {motion.worst_m:.1f} m"
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
