"""The picture of a map for which a crash is rejected: the streets, the reported point, and the distance between them.

On the left all relevant streets around the point, on the right the point itself. OpenStreetMap's own lines are drawn
over the map made from them, so that differences are visible.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trace_dag.crash.record import CrashRecord
from trace_dag.osm.drivable import is_drivable
from trace_dag.osm.types import OsmExtract, OsmFeature
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import NearStreet, RejectedMapReport
from trace_dag.scenario.colours import CONTACT_COLOUR, REPORTED_COLOUR
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.maps import MapDrawing
from trace_dag.scenario.picture_legend import headline_words, place_line
from trace_dag.scenario.picture_motion import draw_cross
from trace_dag.scenario.picture_sheet import Sheet, around, square

if TYPE_CHECKING:
    from PIL.Image import Image

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
    dpi: int = 90,
) -> Image:
    """The picture, 13 by 7.2 inches; its second line is ``why``, the reason of the rejection.

    >>> far_off = RejectedMapReport("native", 30.0, ())
    >>> draw_rejected_map(record, network, extract, far_off, "57 m from any street", dpi=20).size  # 13 by 7.2 inches
    (260, 144)
    """
    sheet = Sheet(dpi)
    sheet.words += [place_line(record), headline_words(1, why)]
    pointed_at = _pointed_at(report)
    farthest_m = max((street.distance_m for street in pointed_at), default=0.0)
    wide = square((0.0, 0.0), max(_MARGIN * max(farthest_m, report.max_move_m), _LEAST_HALF_WINDOW_M))
    close = square((0.0, 0.0), _MARGIN * report.max_move_m)
    drawing = MapDrawing(network, around(wide, close), surroundings=surroundings, fading=True)
    lines = _osm_lines(network, extract)
    for column, title, window in ((0, "Streets around", wide), (1, "Reported point", close)):
        panel = sheet.panel(column, title, window)
        drawing.draw(panel)
        _draw_findings(panel, report, pointed_at, lines)
        if column == 0:
            for street in pointed_at:
                x, y = street.nearest_xy_m
                sheet.write_at(panel, (x, y), f"{street.distance_m:.1f} m  {street.name or street.highway}")
    sheet.legend(_KEY, _signs(report))
    return sheet.picture()


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
    panel: Panel, report: RejectedMapReport, streets: list[NearStreet], osm_lines: list[FloatArray]
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    panel.add(LineCollection(osm_lines, colors=_OSM_COLOUR, linewidths=1.0, linestyles=[(0, (1, 2))], zorder=19))
    ring = Circle((0.0, 0.0), report.max_move_m, fill=False, ec=REPORTED_COLOUR, lw=1.0, ls=(0, (6, 4)), zorder=38)
    panel.add(ring)
    ways = [[(0.0, 0.0), street.nearest_xy_m] for street in streets]
    colours = [_colour(street) for street in streets]
    panel.add(LineCollection(ways, colors=colours, linewidths=1.8, zorder=39))
    draw_cross(panel)


def _colour(street: NearStreet) -> str:
    return _NAMED_COLOUR if street.bears_reported_name else CONTACT_COLOUR


_KEY: Final = (
    ({"color": _NAMED_COLOUR, "lw": 2}, "to a street of a reported name"),
    ({"color": CONTACT_COLOUR, "lw": 2}, "to a street of another name, or of none"),
)


def _signs(report: RejectedMapReport) -> list[tuple[dict[str, Any], str]]:
    return [
        ({"color": REPORTED_COLOUR, "marker": "+", "ms": 9, "mew": 2}, "reported point"),
        (
            {"color": REPORTED_COLOUR, "lw": 1, "ls": (0, (6, 4))},
            f"{report.max_move_m:.0f} m, the farthest it is moved",
        ),
        ({"color": _OSM_COLOUR, "lw": 1, "ls": (0, (1, 2))}, "OpenStreetMap's lines"),
    ]
