"""Scenarios that keep a conflict before a player: the share of drivers without reaction that meet their recorded
opponent.

    python -m lab kept_conflicts ROOT            every verified crash of a root in esmini, at four speeds
    python -m lab kept_conflicts ROOT --every 4  every fourth
    python -m lab kept_conflicts ROOT --missed   and each place in which they do not meet

In every driver's place of a crash's first contact somebody drives the recorded way at 0.6, 0.8, 1.0 and 1.2 times its
speed (:func:`tests.scenario.player.driven_without_reacting`), once in ``scenario.free_V1.xosc``, in which the others go
by the clock, and once in ``scenario.conflict_V1.xosc``. The other one's motion is judged as well, up to the contact:
jumps, driving backwards, a speed above 1.25 times its highest recorded one, more than 0.4 g where less was recorded.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

import trace_dag
from tests.scenario import esmini
from tests.scenario.player import driven_without_reacting
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_label, trailer_body
from trace_dag.reading.crash import Crash
from trace_dag.reconstruction.motion.speeds import BRAKING_MPS2
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.scenario.progress import FASTEST_PACE
from trace_dag.simulation.types import VehicleLog

PACES = (0.6, 0.8, 1.0, 1.2)
STEP_S = 0.02
MOVES_MPS = 1.0
OVER_S = 0.2
JUMP_M, BACKWARDS_MPS, TOLERANCE_MPS, TOLERANCE_MPS2 = 0.2, 0.5, 0.5, 1.0
ALL = "all"


class Played(NamedTuple):
    """The meeting of somebody at a pace with the recorded other one, by the rule that keeps the conflict."""

    key: str
    ego: str
    rule: str
    keeps_conflict: bool
    pace: float
    met: bool
    faults: frozenset[str]  # of the other one's motion


def play(crash: Crash, work: Path) -> Iterator[Played]:
    """Yield every driver of the first contact at every pace, in both kinds of scenario."""
    log, contact = crash.log, crash.log.first_contact
    if contact is None:
        return
    pair = contact.number_1, contact.number_2
    if not set(pair) <= set(log.bodies):
        return  # a fixed object
    (work / "map.xodr").write_bytes(write_opendrive(crash.road_map))
    scenarios = OpenScenarios(crash.record, crash.road_map, log)
    recorded = scenarios.write()
    for ego, other in (pair, pair[::-1]):
        own = log.vehicle_log(ego)
        if log.bodies[ego].is_figure or abs(own.speed_mps[own.time_s < contact.time_s]).max() < MOVES_MPS:
            continue
        for keeps in (False, True):
            free = scenarios.write(Flavour(free=ego, keeps_conflict=keeps))
            rule = rule_of(scenarios.write(Flavour(free=ego, keeps_conflict=True)))
            for pace in PACES:
                name = party_label(ego)
                scenario = work / "played.xosc"
                scenario.write_bytes(driven_without_reacting(free, recorded, name, contact.time_s, pace))
                collisions, errors = esmini.collisions(scenario, STEP_S, "--csv_logger", "played.csv")
                assert not errors, errors
                times = [float(time_s) for time_s, *pair in collisions if name in pair and {*pair} & names_of(other)]
                until_s = min(times, default=contact.time_s / pace)
                moved = esmini.places(work / "played.csv")[party_label(other)]
                faults = faults_of(moved[moved[:, 0] <= until_s - STEP_S], log.vehicle_log(other), contact.time_s)
                if log.is_figure(other):
                    faults -= {"backwards", "acceleration"}
                yield Played(crash.key, name, rule, keeps, pace, bool(times), frozenset(faults))


def faults_of(moved: FloatArray, recorded: VehicleLog, contact_s: float) -> set[str]:
    """Return the impossible parts of a motion, rows of time, x, y, heading: by second differences over 0.2 s."""
    every = moved[:: round(OVER_S / STEP_S)]
    if len(moved) < 3 or len(every) < 3:
        return set()
    before = recorded.time_s < contact_s - STEP_S
    most_mps = FASTEST_PACE * max(np.abs(recorded.speed_mps[before]).max(initial=0.0), MOVES_MPS)
    own_mps2 = np.abs(np.gradient(recorded.speed_mps[before], recorded.time_s[before])).max(initial=0.0)
    steps = np.diff(moved[:, 1:3], axis=0)
    along_mps = (steps * np.column_stack([np.cos(moved[1:, 3]), np.sin(moved[1:, 3])])).sum(axis=1) / STEP_S
    speeds = np.hypot(*np.diff(every[:, 1:3], axis=0).T) / OVER_S
    faults = {
        "jump": np.hypot(*steps.T).max() > 2 * most_mps * STEP_S + JUMP_M,
        "backwards": (along_mps < -BACKWARDS_MPS).any() and recorded.speed_mps[before].min() >= -BACKWARDS_MPS,
        "speed": (speeds > most_mps + TOLERANCE_MPS).any(),
        "acceleration": np.abs(np.diff(speeds)).max() / OVER_S > max(BRAKING_MPS2, own_mps2) + TOLERANCE_MPS2,
    }
    return {name for name, is_so in faults.items() if is_so}


def names_of(number: int) -> set[str]:
    """Return the entities of a party: itself and its trailer."""
    return {party_label(number), party_label(trailer_body(number))}


def rule_of(scenario: bytes) -> str:
    """Return the rule that keeps the conflict."""
    for action, rule in (
        (b"RelativeSpeedToMaster", "drives ahead"),
        (b"SynchronizeAction", "arrives together"),
        (b"TimeToCollisionCondition", "person sets out"),
    ):
        if action in scenario:
            return rule
    return "by the clock"


def main() -> None:
    """Print contacts of places by rule and pace, and the faults of the others' motion over all paces."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--missed", action="store_true")
    options = parser.parse_args()
    home = trace_dag.open(options.root)
    keys = sorted(home.crashes.query("final_state == 'verified'").index)[:: options.every]

    def played(key: str) -> list[Played]:
        with tempfile.TemporaryDirectory() as work:
            return list(play(home[key], Path(work)))

    found: dict[tuple[str, bool, float], list[Played]] = defaultdict(list)
    with ThreadPoolExecutor(2) as pool:
        for each in (each for crash in pool.map(played, keys) for each in crash):
            for rule in (each.rule, ALL):
                found[rule, each.keeps_conflict, each.pace].append(each)
            if options.missed and each.keeps_conflict and (each.faults or not each.met):
                why = ", ".join([*sorted(each.faults), *([] if each.met else ["no contact"])])
                print(f"{each.key} {each.ego} {each.rule} {each.pace}: {why}", flush=True)
    for rule in sorted({rule for rule, _, _ in found}):
        for keeps in (False, True):
            runs = [found[rule, keeps, pace] for pace in PACES]
            counts = [f"{sum(each.met for each in played):5}" for played in runs]
            faults = Counter(fault for played in runs for each in played for fault in each.faults)
            said = ", ".join(f"{count} {fault}" for fault, count in sorted(faults.items())) or "none"
            print(f"{rule:16} {len(runs[0]):4} places, {'conflict' if keeps else 'free':8} {' '.join(counts)}; {said}")


if __name__ == "__main__":
    main()
