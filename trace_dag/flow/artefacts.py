"""The stored artefacts of a crash, each with its files and their reader.

``crash.load(RECORD)`` is the crash record of a crash, for stages and for all other users of stored crashes. A stage
function is given an artefact by naming a parameter after it: ``record``, ``road_map``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Generic, Protocol, TypeVar

from trace_dag.common.stage import Stage

if TYPE_CHECKING:
    from trace_dag.crash.record import CrashRecord
    from trace_dag.osm.types import OsmExtract, OsmFeature
    from trace_dag.reconstruction.samples.simulated import SampledRuns
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.report import MapReport, RejectedMapReport
    from trace_dag.simulation.states import StateEstimate
    from trace_dag.simulation.types import SimulationLog
    from trace_dag.verdict.types import Verdict

T = TypeVar("T")


@dataclass(frozen=True)
class Artefact(Generic[T]):
    """An artefact of a stage. ``reader`` (``module:function``) takes the bytes of each of its files.

    Without a reader the artefact is the bytes. A ``named`` reader also takes the file's name, for its messages.
    """

    stage: Stage
    extensions: tuple[str, ...]
    reader: str = ""
    named: bool = False


class CrashArtefacts(Protocol):
    """A stored crash, in a root or in a package: its artefacts and their reading."""

    @property
    def key(self) -> str:
        """Return the crash's key."""

    def has(self, artefact: Artefact[Any]) -> bool:
        """Return whether the artefact is stored."""

    def load(self, artefact: Artefact[T]) -> T:
        """Return an artefact as its reader reads it, read once."""

    def shown_log(self) -> SimulationLog | None:
        """Return the log that the verdict judges, or without a verdict the first one.

        None if nothing was simulated.
        """


REPORT_XML: Final[Artefact[bytes]] = Artefact(Stage.RAW_REPORT, ("xml",))
REPORT_JSON: Final[Artefact[bytes]] = Artefact(Stage.RAW_REPORT, ("json",))
RECORD: Final[Artefact[CrashRecord]] = Artefact(
    Stage.CRASH_RECORD, ("parquet",), "trace_dag.crash.tables:record_from_parquet"
)
EXTRACT: Final[Artefact[OsmExtract]] = Artefact(
    Stage.OSM_EXTRACT, ("osm.pbf", "geojson"), "trace_dag.osm.stored:read_extract", named=True
)
XODR: Final[Artefact[bytes]] = Artefact(Stage.ROAD_MAP, ("xodr",))
ROAD_MAP: Final[Artefact[RoadNetwork]] = Artefact(
    Stage.ROAD_MAP, ("xodr",), "trace_dag.roads.map.reader:read_opendrive", named=True
)
MAP_REPORT: Final[Artefact[MapReport]] = Artefact(
    Stage.ROAD_MAP, ("json",), "trace_dag.roads.report:MapReport.from_json"
)
REJECTED_MAP: Final[Artefact[RoadNetwork]] = Artefact(
    Stage.ROAD_MAP, ("rejected.xodr",), "trace_dag.roads.map.reader:read_opendrive", named=True
)
REJECTED_REPORT: Final[Artefact[RejectedMapReport]] = Artefact(
    Stage.ROAD_MAP, ("rejected.json",), "trace_dag.roads.report:RejectedMapReport.from_json"
)
ESTIMATE: Final[Artefact[StateEstimate]] = Artefact(
    Stage.STATE_ESTIMATE, ("json",), "trace_dag.simulation.states:estimate_from_json"
)
LOGS: Final[Artefact[tuple[SimulationLog, ...]]] = Artefact(
    Stage.SIMULATION_LOG, ("parquet", "json"), "trace_dag.simulation.log_io:logs_from_files"
)
SAMPLED: Final[Artefact[SampledRuns]] = Artefact(
    Stage.SIMULATION_LOG, ("samples.json",), "trace_dag.reconstruction.samples.simulated:samples_from_json"
)
VERDICT: Final[Artefact[Verdict]] = Artefact(Stage.VERDICT, ("json",), "trace_dag.verdict.types:verdict_from_json")
VERDICT_JSON: Final[Artefact[bytes]] = Artefact(Stage.VERDICT, ("json",))

ARTEFACTS: Final[Mapping[str, Artefact[Any]]] = {
    "report_xml": REPORT_XML,
    "report_json": REPORT_JSON,
    "record": RECORD,
    "extract": EXTRACT,
    "xodr": XODR,
    "road_map": ROAD_MAP,
    "map_report": MAP_REPORT,
    "estimate": ESTIMATE,
    "logs": LOGS,
}
"""The artefacts that stages are made from, by the name of the parameter that asks for them."""


def report_file(crash: CrashArtefacts) -> tuple[str, bytes]:
    """Return the report of a crash with its file name in packages: CrashAPI's XML, or JSON from a table."""
    artefact = REPORT_XML if crash.has(REPORT_XML) else REPORT_JSON
    return f"report.{artefact.extensions[0]}", crash.load(artefact)


def surroundings_of(crash: CrashArtefacts) -> tuple[OsmFeature, ...]:
    """Return the features beside the roads around a crash; empty if they were not kept."""
    return crash.load(EXTRACT).surroundings if crash.has(EXTRACT) else ()
