"""Makes ``trace_dag/pages/templates/site_states.js``: outlines of the states for the map of the crashes.

    npm pack us-atlas@3.0.1 && tar xzf us-atlas-3.0.1.tgz
    python data/outlines/make.py package/states-10m.json trace_dag/pages/templates/site_states.js

The source is the US Census Bureau's cartographic boundary file of 2017 (public domain), as TopoJSON in the npm package
us-atlas. Borders are simplified to some 2 km and rounded to a hundredth of a degree, each border once for both its
states, and islands of less than some 100 km2 are left out. Kept: the 50 states, the District of Columbia, Puerto Rico.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from shapely import LineString, Polygon

_TOLERANCE_DEG = 0.02
_UNITS_PER_DEG = 100
_LEAST_ISLAND_DEG2 = 0.01
_OTHER_TERRITORIES = {"60", "66", "69", "78"}  # FIPS codes: American Samoa, Guam, Northern Marianas, Virgin Islands


def main(source: Path, target: Path) -> None:
    """Write the outlines of a TopoJSON file of states."""
    topology = json.loads(source.read_text())
    scale, shift = (np.array(topology["transform"][name]) for name in ("scale", "translate"))
    arcs_deg = [np.cumsum(arc, axis=0) * scale + shift for arc in topology["arcs"]]
    rings = [
        ring
        for state in topology["objects"]["states"]["geometries"]
        if state["id"] not in _OTHER_TERRITORIES
        for ring in _rings(state, arcs_deg)
    ]
    kept = sorted({_number(arc) for ring in rings for arc in ring})
    numbers = {arc: number for number, arc in enumerate(kept)}
    outlines = {
        "unitsPerDeg": _UNITS_PER_DEG,
        "arcs": [_steps(arcs_deg[arc]) for arc in kept],
        "rings": [[numbers[arc] if arc >= 0 else ~numbers[~arc] for arc in ring] for ring in rings],
    }
    target.write_text(
        '"use strict";\n'
        "// Borders of the states: US Census Bureau, cartographic boundaries of 2017, public domain. Made by\n"
        "// data/outlines/make.py. An arc is a place (longitude, latitude, in units) and the steps from it; a ring is\n"
        "// the arcs around an area in their order, ~n for arc n from its end to its beginning.\n"
        f"window.stateOutlines = {json.dumps(outlines, separators=(',', ':'))};\n"
    )


def _rings(state: dict[str, Any], arcs_deg: list[np.ndarray]) -> list[list[int]]:
    """The outer rings of a state, as numbers of arcs: its largest, and others that are no tiny islands."""
    polygons = state["arcs"] if state["type"] == "MultiPolygon" else [state["arcs"]]
    outer = [polygon[0] for polygon in polygons]
    areas = [Polygon(np.concatenate([_along(arcs_deg, arc) for arc in ring])).area for ring in outer]
    return [ring for ring, area in zip(outer, areas, strict=True) if area >= min(_LEAST_ISLAND_DEG2, max(areas))]


def _number(arc: int) -> int:
    return arc if arc >= 0 else ~arc


def _along(arcs_deg: list[np.ndarray], arc: int) -> np.ndarray:
    return arcs_deg[arc] if arc >= 0 else arcs_deg[~arc][::-1]


def _steps(arc_deg: np.ndarray) -> list[int]:
    """Longitude and latitude of the first point and the steps to each next one, in units, one after the other."""
    places = np.rint(np.array(LineString(arc_deg).simplify(_TOLERANCE_DEG).coords) * _UNITS_PER_DEG).astype(int)
    steps: list[int] = np.diff(places, axis=0, prepend=np.zeros((1, 2), dtype=int)).ravel().tolist()
    return steps


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
