"""The configuration with which ``osmium extract`` cuts the surroundings of many crashes out of a country's file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Final

import shapely

from trace_dag.osm.catalog import box_around
from trace_dag.osm.types import Site

_MARGIN_M: Final = 500.0
"""Beyond the box of each crash: osmium keeps a way by its nodes, and most roads have one within that distance."""


def osmium_config(sites: Iterable[Site], radius_m: float, output: str) -> str:
    """Return, as JSON, a configuration that cuts one file, ``output``, around sites by ``radius_m`` and a margin.

    >>> config = json.loads(osmium_config([Site("2023-319003", 41.8, -101.5)], 300.0, "crashes.osm.pbf"))
    >>> (area,) = config["extracts"]
    >>> area["output"], [len(ring) for polygon in area["multipolygon"] for ring in polygon]
    ('crashes.osm.pbf', [5])
    """
    boxes = [box_around(site, radius_m + _MARGIN_M) for site in sites]
    areas = shapely.union_all([shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes])
    polygons = [
        [list(ring.coords) for ring in (polygon.exterior, *polygon.interiors)] for polygon in shapely.get_parts(areas)
    ]
    return json.dumps({"extracts": [{"output": output, "multipolygon": polygons}]})
