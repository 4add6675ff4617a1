"""Scenarios that keep a conflict before a player: how often somebody who never reacts meets whom it was recorded to.

    python -m benchmarks.kept_conflicts ROOT            every verified crash of a root in esmini, at four speeds
    python -m benchmarks.kept_conflicts ROOT --every 4  every fourth
    python -m benchmarks.kept_conflicts ROOT --missed   and each place in which they do not meet

In every driver's place of a crash's first contact somebody drives the recorded way at 0.6, 0.8, 1.0 and 1.2 times its
speed (:func:`tests.scenario.player.driven_without_reacting`), once in ``scenario.free_V1.xosc``, in which the others go
by the clock, and once in ``scenario.conflict_V1.xosc``.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import trace_dag
from tests.scenario import esmini
from tests.scenario.player import driven_without_reacting
from trace_dag.crash.parties import party_label, trailer_body
from trace_dag.reading.crash import Crash
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.openscenario import Flavour, OpenScenarios

PACES = (0.6, 0.8, 1.0, 1.2)
STEP_S = 0.02
MOVES_MPS = 1.0
ALL = "all"


class Played(NamedTuple):
    """Whether somebody at a pace met the recorded other one, by what keeps the conflict."""

    key: str
    ego: str
    rule: str
    keeps_conflict: bool
    pace: float
    met: bool


def play(crash: Crash, work: Path) -> Iterator[Played]:
    """Every driver of the first contact at every pace, in both kinds of scenario."""
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
                collisions, errors = esmini.collisions(scenario, STEP_S)
                assert not errors, errors
                met = any(name in pair and {*pair} & names_of(other) for _, *pair in collisions)
                yield Played(crash.key, name, rule, keeps, pace, met)


def names_of(number: int) -> set[str]:
    """The entities of a party: itself and its trailer."""
    return {party_label(number), party_label(trailer_body(number))}


def rule_of(scenario: bytes) -> str:
    """What keeps the conflict."""
    for action, rule in (
        (b"RelativeSpeedToMaster", "drives ahead"),
        (b"SynchronizeAction", "arrives together"),
        (b"TimeToCollisionCondition", "person sets out"),
    ):
        if action in scenario:
            return rule
    return "by the clock"


def main() -> None:
    """Print contacts of places by rule and pace."""
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

    found: dict[tuple[str, bool, float], list[bool]] = defaultdict(list)
    with ThreadPoolExecutor(2) as pool:
        for each in (each for crash in pool.map(played, keys) for each in crash):
            for rule in (each.rule, ALL):
                found[rule, each.keeps_conflict, each.pace].append(each.met)
            if options.missed and each.keeps_conflict and not each.met:
                print(f"{each.key} {each.ego} {each.rule} {each.pace}: no contact", flush=True)
    for rule in sorted({rule for rule, _, _ in found}):
        for keeps in (False, True):
            counts = [f"{sum(found[rule, keeps, pace]):5}" for pace in PACES]
            places = len(found[rule, keeps, PACES[0]])
            print(f"{rule:16} {places:4} places, {'conflict' if keeps else 'free':8} {' '.join(counts)}")


if __name__ == "__main__":
    main()
