"""Quill, a second place, whose only road is a raw GPS trace: maps like it exist and must not be used."""

from __future__ import annotations

import math

from make.osm_file import OsmFile

# Plan coordinates of the place, 20 km from the town.
U_M, V_M = 18_000.0, -9_000.0
SPACING_M, SCATTER_M = 3, 4.0


def draw() -> OsmFile:
    """The place as an OSM file: for 160 m the road is what a receiver wrote down every few metres, scatter and all."""
    osm = OsmFile()
    trace = [
        (u + _scatter(k + 7, 0.6 * SCATTER_M), _scatter(k, SCATTER_M)) for k, u in enumerate(range(-80, 81, SPACING_M))
    ]
    line = [(-700.0, 0.0), (-520.0, 4.0), (-300.0, 1.0), *trace, (300.0, 0.0), (700.0, 0.0)]
    osm.line(
        [(U_M + u, V_M + v) for u, v in line],
        highway="tertiary", name="Quill Road", lanes="2", maxspeed="50 mph", surface="asphalt", source="gps",
    )  # fmt: skip
    osm.line(
        [(U_M - 300, V_M + 1), (U_M - 298, V_M + 260)], highway="residential", name="Inkwell Lane", maxspeed="25 mph"
    )
    return osm


def _scatter(k: int, metres: float) -> float:
    """Something like noise, the same on every run."""
    return metres * math.sin(2.399 * k) + 0.6 * metres * math.sin(5.13 * k + 1)
