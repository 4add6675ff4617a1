"""Makes the bundled sample anew: ``python data/sample/make_sample.py [--out DIR]``. Same bytes on every run.

Writes ``osm/*.osm``, ``reports/crash_<case>.xml`` and ``truth.json`` into ``--out`` (default: beside this script), and
the crashes with people in the same town as ``people/reports/crash_<case>.xml`` and ``people/truth.json``, those of
several contacts likewise below ``chains``, those of one vehicle that leaves the road below ``roadside``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from make import broken_map, chains, crossings, people, roadside, stretches, town
from make.crash import Crash
from make.crashapi import crashapi_xml
from make.motion import Collision, collide
from make.rejected import rejected
from make.report import Report, coded
from make.roads import Road
from make.truth import truth_of

_Crash = TypeVar("_Crash")
_Motion = TypeVar("_Motion")

ABOUT = (
    "True motion behind the sample's reports. Frame of each crash: transverse Mercator at its reported point, x east, "
    "y north, metres; headings radians counter-clockwise from east."
)


def sample_crashes(roads: dict[str, Road]) -> list[tuple[Crash, Collision, Report]]:
    """Every crash with truth: the crash, how it came to the impact, what was reported."""
    out = []
    for crash in [*crossings.crashes(roads), *stretches.crashes(roads)]:
        collision = collide(crash.units[0].driving(), crash.units[1].driving())
        out.append((crash, collision, coded(crash, collision)))
    return out


def files() -> dict[str, bytes]:
    """Every file of the sample by its path."""
    roads = town.roads()
    crashes = sample_crashes(roads)
    out = {"osm/merrow.osm": town.draw(roads).xml(), "osm/quill.osm": broken_map.draw().xml()}
    rows = []
    for crash, collision, report in crashes:
        out[f"reports/crash_{report.case}.xml"] = crashapi_xml(report)
        rows.append(truth_of(crash, report, collision))
    for item in rejected({report.number: report for _, _, report in crashes}):
        out[f"reports/crash_{item.case}.xml"] = item.xml
        expected = {"final_state": "rejected", "reason": item.reason}
        rows.append({"key": f"2023-{item.case}", "title": item.title, "expected": expected, "vehicles": []})
    out["truth.json"] = _truth(rows)
    out |= _part("people", people.crashes(roads), people.collision_of, people.coded, people.truth_of)
    out |= _part("chains", chains.crashes(roads), chains.meetings_of, chains.coded, chains.truth_of)
    out |= _part("roadside", roadside.crashes(roads), roadside.impact_of, roadside.coded, roadside.truth_of)
    return out


def _part(
    folder: str,
    crashes: Iterable[_Crash],
    motion_of: Callable[[_Crash], _Motion],
    coded_as: Callable[[_Crash, _Motion], Report],
    row_of: Callable[[_Crash, Report, _Motion], dict[str, Any]],
) -> dict[str, bytes]:
    """The files of the crashes in a folder of their own: how each came about, what is told of it, and its truth."""
    out, rows = {}, []
    for crash in crashes:
        motion = motion_of(crash)
        report = coded_as(crash, motion)
        out[f"{folder}/reports/crash_{report.case}.xml"] = crashapi_xml(report)
        rows.append(row_of(crash, report, motion))
    return out | {f"{folder}/truth.json": _truth(rows)}


def _truth(rows: list[dict[str, Any]]) -> bytes:
    """One line for each crash: readable enough, and a change shows where it is."""
    lines = ",\n".join(json.dumps(row, ensure_ascii=False, separators=(",", ":")) for row in rows)
    return f'{{"about":{json.dumps(ABOUT)},"crashes":[\n{lines}\n]}}\n'.encode()


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent)
    folder: Path = parser.parse_args().out
    for name, data in files().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


if __name__ == "__main__":
    main()
