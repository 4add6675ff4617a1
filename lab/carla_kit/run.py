"""Ten crashes of a root on a live CARLA server, beside our own log: a table, and a file to send back.

    python lab/carla_kit/run.py trace_dag_home [--host 127.0.0.1] [--port 2000] [--output carla-kit.json]

Crashes of motor vehicles alone: CARLA has no animals, no thrown people, and no objects that break or yield.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import trace_dag
from trace_dag.carla.backend import CarlaBackend
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.settings import SimSettings
from trace_dag.flow.artefacts import XODR
from trace_dag.reading.crash import Crash
from trace_dag.simulation.run import participants, surface_friction
from trace_dag.simulation.types import Contact
from trace_dag.version import __version__

CRASHES = 10


def crashes_of(home: trace_dag.Home) -> list[Crash]:
    """Return the first verified crashes in which motor vehicles alone touch."""
    verified = sorted(home.crashes.query("final_state == 'verified'").index)
    alone = (crash for crash in map(home.__getitem__, verified) if _is_of_vehicles(crash))
    return [crash for crash, _ in zip(alone, range(CRASHES), strict=False)]


def _is_of_vehicles(crash: Crash) -> bool:
    contact, bodies = crash.log.first_contact, crash.log.bodies
    parties = () if contact is None else (contact.number_1, contact.number_2)
    return bool(parties) and all(each in bodies and not bodies[each].is_figure for each in parties)


def compared(crash: Crash, backend: CarlaBackend, settings: SimSettings) -> dict[str, Any]:
    """Return a crash on the server beside our log; what went wrong in place of the former."""
    ours = _said(crash.log.first_contact)
    try:
        friction = surface_friction(settings, crash.record)
        simulation = backend.load(crash.road_map, crash.stored.load(XODR), friction=friction)
        hypothesis = crash.estimate.hypotheses[crash.verdict.hypothesis]
        log = simulation.run(participants(hypothesis), time_limit_s=settings.time_limit_s)
    except (Failure, UserError) as error:
        return {"key": crash.key, "ours": ours, "carla": None, "error": str(error)}
    return {"key": crash.key, "ours": ours, "carla": _said(log.first_contact), "ended": log.termination.value}


def _said(contact: Contact | None) -> dict[str, Any] | None:
    if contact is None:
        return None
    parties = sorted((contact.number_1, contact.number_2))
    place = round(contact.x_m, 3), round(contact.y_m, 3)
    return {"time_s": round(contact.time_s, 3), "place_m": place, "parties": parties}


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the comparison as text, a line per crash."""
    lines = [f"{'crash':14} {'later':>8} {'away':>8}  parties"]
    for row in rows:
        ours, theirs = row["ours"], row["carla"]
        if theirs is None:
            lines.append(f"{row['key']:14} {row.get('error', 'no contact in CARLA')}")
            continue
        later_s = theirs["time_s"] - ours["time_s"]
        away_m = math.dist(theirs["place_m"], ours["place_m"])
        same = "the same" if theirs["parties"] == ours["parties"] else f"{theirs['parties']} for {ours['parties']}"
        lines.append(f"{row['key']:14} {later_s:+6.2f} s {away_m:6.2f} m  {same}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None, module: Any = None) -> None:
    """Run them; ``module`` in the place of the carla package."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=2000)
    parser.add_argument("--output", type=Path, default=Path("carla-kit.json"))
    options = parser.parse_args(arguments)
    settings = SimSettings(backend="carla", carla_host=options.host, carla_port=options.port)
    if module is None:
        CarlaBackend.require(settings)
    backend = CarlaBackend(settings, module)
    rows = []
    for crash in crashes_of(trace_dag.open(options.root)):
        rows.append(compared(crash, backend, settings))
        print(table(rows[-1:]).splitlines()[-1], flush=True)
    versions = {"trace_dag": __version__, "python": platform.python_version(), "carla": backend.version}
    options.output.write_text(json.dumps({"versions": versions, "crashes": rows}, indent=1) + "\n")
    print(f"\n{table(rows)}\n\n{options.output}: the file to send back")


if __name__ == "__main__":
    try:
        main()
    except UserError as error:
        sys.exit(str(error))
