"""Verified crashes in the forms that other tools read, each an exporter: ``trace-dag export --format NAME``.

Belongs here: a module per form, which turns one crash into files. Does not belong here: which crashes are written and
where (:mod:`trace_dag.export.export`); what a scenario package looks like (:mod:`trace_dag.scenario`).
"""

from typing import Final

MAP_FORMS: Final = ("geojson", "geoparquet", "commonroad", "lanelet2", "scenarionet", "sumo", "glb")
"""Forms that a road map by itself is written in; here, so that a command names them without what writes them."""
