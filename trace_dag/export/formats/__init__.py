"""Verified crashes in the forms that other tools read, each an exporter: ``trace-dag export --format NAME``.

Belongs here: a module per form, which turns one crash into files. Does not belong here: which crashes are written and
where (:mod:`trace_dag.export.export`); what a scenario package looks like (:mod:`trace_dag.scenario`).
"""

from typing import Final

MAP_FORMS: Final = ("geojson", "geoparquet", "commonroad", "lanelet2", "scenarionet", "sumo", "glb")
"""Forms that a road map by itself is written in; here, so that a command names them without what writes them."""
FORM_OF_READER: Final = {
    "autoware": "lanelet2",
    "blender": "glb",
    "carla": "packages",
    "commonroad": "commonroad",
    "duckdb": "points",
    "esmini": "packages",
    "geopandas": "points",
    "lanelet2": "lanelet2",
    "metadrive": "scenarionet",
    "omega-prime": "osi",
    "qgis": "points",
    "scenarionet": "scenarionet",
    "scenic": "packages",
    "sumo": "sumo",
    "trimesh": "glb",
}
"""The form that each tool reads best, of those that it reads (``python -m lab formats`` tries those on PyPI)."""
