"""Reported places of the crashes as points: GeoParquet 1.1 and GPX 1.1, WGS84."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from lxml import etree

from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.geoparquet import geoparquet
from trace_dag.flow.artefacts import RECORD, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.version import __version__

_GPX: Final = "http://www.topografix.com/GPX/1/1"
_NAMESPACES: Final[Any] = {None: _GPX}  # the default one, which the stubs of lxml do not know
_COLUMNS: Final = (
    "key",
    "case_year",
    "state_name",
    "kind",
    "collision_type",
    "road_topology",
    "month",
    "hour",
    "fatalities",
    "trafficway_1",
    "trafficway_2",
)


class CrashPoints(Exporter):
    """``crashes.parquet`` and ``crashes.gpx``: a point per crash, with the main facts of the report."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._rows: list[dict[str, Any]] = []

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """Add the crash as a row of the files beside; return no files of its own."""
        record = crash.load(RECORD)
        row = {name: getattr(record, name) for name in _COLUMNS}
        row |= {
            "grade": str(crash.load(VERDICT).grade),
            "summary": record.summary,
            "latitude_deg": record.latitude_deg,
            "longitude_deg": record.longitude_deg,
        }
        self._rows.append({name: str(value) if isinstance(value, str) else value for name, value in row.items()})
        return {}

    def beside(self) -> Mapping[str, bytes]:
        rows = sorted(self._rows, key=lambda row: str(row["key"]))
        return {"crashes.parquet": _geoparquet(rows), "crashes.gpx": _gpx(rows)} if rows else {}


def _geoparquet(rows: Sequence[Mapping[str, Any]]) -> bytes:
    import pyarrow as pa

    return geoparquet(pa.Table.from_pylist([dict(row) for row in rows]))


def _gpx(rows: Sequence[Mapping[str, Any]]) -> bytes:
    root = etree.Element(f"{{{_GPX}}}gpx", nsmap=_NAMESPACES, version="1.1", creator=f"trace-dag {__version__}")
    for row in rows:
        place = etree.SubElement(
            root, f"{{{_GPX}}}wpt", lat=f"{row['latitude_deg']:.7f}", lon=f"{row['longitude_deg']:.7f}"
        )
        etree.SubElement(place, f"{{{_GPX}}}name").text = row["key"]
        etree.SubElement(place, f"{{{_GPX}}}desc").text = row["summary"]
        etree.SubElement(place, f"{{{_GPX}}}type").text = row["kind"]
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
