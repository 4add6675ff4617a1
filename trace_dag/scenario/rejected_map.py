"""The picture of a map for which a crash is rejected: the streets, the reported point, and the distance between them.

On the left all relevant streets around the point, on the right the point itself. OpenStreetMap's own lines are drawn
over the map made from them, so that differences are visible.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.crash.record import CrashRecord
from trace_dag.osm.drivable import is_drivable
from trace_dag.osm.types import OsmExtract, OsmFeature
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import NearStreet, RejectedMapReport
from trace_dag.scenario.canvas import Canvas, Ink
from trace_dag.scenario.colours import CONTACT_COLOUR, REPORTED_COLOUR
from trace_dag.scenario.maps import MapDrawing
from trace_dag.scenario.picture_legend import place_line
from trace_dag.scenario.picture_motion import draw_cross
from trace_dag.scenario.picture_sheet import Sheet, Sign, around, square

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray

_LEAST_HALF_WINDOW_M: Final = 60.0
_MARGIN: Final = 1.3
_STREETS: Final = 4  # no more streets are marked
_NAMED_COLOUR: Final = "#0B6E4F"
_OSM_COLOUR: Final = "#7A1FA2"


def draw_rejected_map(
    record: CrashRecord,
    network: RoadNetwork,
    extract: OsmExtract,
    report: RejectedMapReport,
    why: str,
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> str:
    """The picture as an SVG; its second line is ``why``, the reason of the rejection."""
    sheet = Sheet()
    sheet.headline(0, place_line(record))
    sheet.headline(1, why)
    pointed_at = _pointed_at(report)
    farthest_m = max((street.distance_m for street in pointed_at), default=0.0)
    wide = square((0.0, 0.0), max(_MARGIN * max(farthest_m, report.max_move_m), _LEAST_HALF_WINDOW_M))
    close = square((0.0, 0.0), _MARGIN * report.max_move_m)
    drawing = MapDrawing(network, around(wide, close), surroundings=surroundings, fading=True)
    lines = _osm_lines(network, extract)
    for column, title, window in ((0, "Streets around", wide), (1, "Reported point", close)):
        panel = sheet.panel(column, title, window)
        for street in pointed_at if column == 0 else ():
            x, y = street.nearest_xy_m
            sheet.write_at(panel, (x, y), f"{street.distance_m:.1f} m  {street.name or street.highway}")
        drawing.draw(panel)  # with the names of streets clear of what was written
        _draw_findings(panel, report, pointed_at, lines)
    sheet.legend(_KEY, _signs(report))
    return sheet.svg()


def _pointed_at(report: RejectedMapReport) -> list[NearStreet]:
    """The nearest street, and of the others with a name those of a reported one first."""
    named = [street for street in report.streets[1:] if street.name]
    order = sorted(named, key=lambda street: (not street.bears_reported_name, street.distance_m))
    return [*report.streets[:1], *order][:_STREETS]


def _osm_lines(network: RoadNetwork, extract: OsmExtract) -> list[FloatArray]:
    lines = []
    for way in extract.ways:
        if is_drivable(way.tags, service_roads=True):
            nodes = [extract.nodes[number] for number in way.node_ids]
            latitudes, longitudes = (
                np.array([getattr(node, name) for node in nodes]) for name in ("latitude_deg", "longitude_deg")
            )
            lines.append(network.frame.to_local(latitudes, longitudes))
    return lines


def _draw_findings(
    panel: Canvas, report: RejectedMapReport, streets: list[NearStreet], osm_lines: list[FloatArray]
) -> None:
    panel.lines(osm_lines, _OSM_INK, 19)
    panel.discs([(0.0, 0.0)], report.max_move_m, _REACH_INK, 38)
    for street in streets:
        colour = _NAMED_COLOUR if street.bears_reported_name else CONTACT_COLOUR
        panel.lines([np.array([(0.0, 0.0), street.nearest_xy_m])], Ink(stroke=colour, width_pt=1.8), 39)
    draw_cross(panel)


_OSM_INK: Final = Ink(stroke=_OSM_COLOUR, width_pt=1.0, dash_pt=(1.0, 2.0))
_REACH_INK: Final = Ink(stroke=REPORTED_COLOUR, width_pt=1.0, dash_pt=(6.0, 4.0))
_KEY: Final = (
    Sign("to a street of a reported name", Ink(stroke=_NAMED_COLOUR, width_pt=2.0)),
    Sign("to a street of another name, or of none", Ink(stroke=CONTACT_COLOUR, width_pt=2.0)),
)


def _signs(report: RejectedMapReport) -> list[Sign]:
    return [
        Sign("reported point", Ink(stroke=REPORTED_COLOUR, width_pt=2.0), "cross"),
        Sign(f"{report.max_move_m:.0f} m, the farthest it is moved", _REACH_INK),
        Sign("OpenStreetMap's lines", _OSM_INK),
    ]
