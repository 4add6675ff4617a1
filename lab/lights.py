"""Traffic lights against the reports: what each party met by each reading, as a table in Markdown.

python -m lab lights ROOT [ROOT ...]   every simulated crash of some roots in which a party met a light
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

import trace_dag
from trace_dag.crash.codes.elements import VTRAFCON
from trace_dag.crash.parties import party_label
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.reading.crash import Crash
from trace_dag.scenario.lights import MetLight, crash_lights

DISOBEYED = {True: "disobeyed it", False: "nothing noted", None: "unknown"}


def rows_of(crash: Crash) -> Iterator[tuple[int, MetLight, str]]:
    """Yield the number of the reading, each light that a party met by it, and what the report says of the party."""
    vehicles = {each.number: each for each in crash.record.vehicles}
    for number, reading in enumerate(crash_lights(crash.record, crash.stored.load(ROAD_MAP), crash.log), 1):
        for met in reading.met:
            vehicle = vehicles.get(met.party)
            said = "a cyclist" if vehicle is None else VTRAFCON.meaning(vehicle.traffic_control_code or 0)
            yield number, met, said if vehicle is None else f"{said}; {DISOBEYED[vehicle.disobeyed_control]}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="lab lights", description=__doc__.splitlines()[0])
    parser.add_argument("roots", nargs="+")
    agrees: Counter[str] = Counter()
    print("| crash | reading | party | report | stop line | wanted | shown |\n|---|---|---|---|---|---|---|")
    for root in parser.parse_args().roots:
        for crash in trace_dag.open(root).values():
            rows = list(rows_of(crash)) if crash.has("log") else []
            agrees["crashes with a met light"] += bool(rows)
            agrees["of them with two readings"] += any(number == 2 for number, *_ in rows)
            for number, met, said in rows:
                how = f"{'stood before' if met.stood else 'crossed'} at {met.time_s:.1f} s"
                print(f"| {crash.key} | {number} | {party_label(met.party)} | {said} | {how} "
                      f"| {met.wanted or 'any'} | {met.shown} |")  # fmt: skip
                agrees["lights met"] += 1
                agrees["shown as wanted"] += met.wanted in (None, met.shown)
    print("\n" + ", ".join(f"{name} {count}" for name, count in agrees.items()))


if __name__ == "__main__":
    main()
