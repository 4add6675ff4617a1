"""Verified crashes in the forms that other tools read, each an exporter: ``trace-dag export --format NAME``.

Belongs here: a module per form, which turns one crash into files. Does not belong here: which crashes are written and
where (:mod:`trace_dag.export.export`); what a scenario package looks like (:mod:`trace_dag.scenario`).
"""

from collections.abc import Mapping, Sequence
from typing import Final, Protocol

from trace_dag.agents.stored_cases import case_of
from trace_dag.flow.contract import CrashFiles
from trace_dag.scenario.cases import Case

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


class Exporter(Protocol):
    """Writes crashes in one form (entry points of the group ``trace_dag.exporters``, usually a class)."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Prepare for the crashes ``keys``."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """Return the files of one verified crash, by path below the folder of the export.

        Raises :class:`trace_dag.common.errors.UserError` for a crash that the form has no words for: it is left out and
        named.
        """

    def beside(self) -> Mapping[str, bytes]:
        """Return the files of one verified crash, by path below the folder of the export.

        Raises :class:`trace_dag.common.errors.UserError` for a crash that the form cannot express; it is left out and
        named.
        """


def as_driven(crash: CrashFiles) -> Case:
    """Return the files about all crashes, after every crash has been written."""
    return case_of(crash, crash.settings.sim)
