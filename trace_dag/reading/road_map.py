"""Road maps without crashes.

From OpenStreetMap to OpenDRIVE and the forms of other tools, for Python and the command ``map``. Only saved files are
kept: no storage root, no Dagster.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.errors import Rejection, UserError
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.network.http import HttpClient
from trace_dag.common.settings import OsmSettings, RoadSettings
from trace_dag.osm.catalog import MapCatalog, box_around, sides_m
from trace_dag.osm.services import OverpassSource
from trace_dag.osm.types import BoundingBox, OsmExtract, Site
from trace_dag.roads.build import PlainMap, build_plain_map
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.network import RoadNetwork

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd

    from trace_dag.osm.types import OsmFeature
    from trace_dag.roads.report import MapGate

LONGEST_SIDE_M: Final = 10_000.0
"""Beyond it a local frame stretches distances by more than a millimetre in a kilometre, and no tool wants one file."""
_PX_PER_PT: Final = 2.6  # letters of 17 pixels
_WORDS: Final = "latitude within 90, longitude within 180 degrees, west less than east, south less than north"


@dataclass(frozen=True, eq=False)
class MadeMap:
    """A road map without a crash.

    ``extract`` is its OpenStreetMap data, ``source`` the origin of that, ``made`` the map.
    """

    extract: OsmExtract
    made: PlainMap
    source: MapCatalog | OverpassSource

    @property
    def network(self) -> RoadNetwork:
        """Return roads, lanes and junctions of the file, in the local frame of the place."""
        return self.made.stored.network

    @property
    def xodr(self) -> bytes:
        """Return the map as OpenDRIVE 1.7."""
        return self.made.stored.xodr

    @property
    def gates(self) -> tuple[MapGate, ...]:
        """Return the measures of the map, and whether it passes for every road."""
        return self.made.gates

    @cached_property
    def lanes(self) -> pd.DataFrame:
        """Return a row per lane with shapely shapes; see :func:`lane_table`."""
        return lane_table(self.network)

    @cached_property
    def surroundings(self) -> tuple[OsmFeature, ...]:
        """Return the features beside the roads, such as buildings and trees, read on first use."""
        return self.source.extract_box(self.extract.box, OsmSettings(), surroundings=True).surroundings

    def picture(self) -> str:
        """Return the map from above with a scale and a legend, as an SVG."""
        from trace_dag.pages.maps import draw_whole

        return draw_whole(self.network)

    def report(self) -> dict[str, object]:
        """Return the sources of the map, its gates, and the tags that it does not follow."""
        return {
            "converter": self.network.converter,
            "source": self.extract.source,
            "data_timestamp": self.extract.data_timestamp,
            "attribution": self.network.attribution,
            "origin_deg": (self.network.frame.latitude_deg, self.network.frame.longitude_deg),
            "roads": sum(road.junction_id is None for road in self.network.roads),
            "junctions": len(self.network.junctions),
            "gates": [asdict(gate) for gate in self.gates],
            "tags_not_followed": [asdict(each) for each in self.made.tags_not_followed],
        }

    @gc_paused()
    def save(self, folder: str | os.PathLike[str], forms: Iterable[str] = ()) -> list[Path]:
        """Write ``map.xodr``, ``map.json`` (the report), ``map.png`` and some forms into a folder.

        Forms are of :data:`trace_dag.export.formats.MAP_FORMS`. Return the files written.
        """
        from trace_dag.export.formats.road_maps import form_of_map
        from trace_dag.pages.canvas import as_png, pixels_of
        from trace_dag.pages.maps import whole_width_pt

        contents = {
            "map.xodr": self.xodr,
            "map.json": json.dumps(self.report(), indent=1, ensure_ascii=False).encode(),
            "map.png": as_png(pixels_of(self.picture(), round(_PX_PER_PT * whole_width_pt(self.network)))),
        }
        for form in forms:
            contents |= form_of_map(form, self.network, self.xodr, lambda: self.surroundings)
        target = Path(folder)
        for name, content in contents.items():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_bytes(content)
        return [target / name for name in contents]


@gc_paused()
def make_map(
    osm: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | None,
    *,
    at: tuple[float, float] | None,
    radius_m: float,
    box: tuple[float, float, float, float] | None,
    left_hand: bool,
) -> MadeMap:
    """See :func:`trace_dag.road_map`."""
    if at is not None and box is not None:
        raise UserError("a place (at) or a box, not both")
    files = [osm] if isinstance(osm, (str, os.PathLike)) else list(osm or ())
    catalog = MapCatalog.checked([Path(file) for file in files]) if files else None
    wanted = _box_of(at, radius_m, box, catalog)
    width_m, height_m = sides_m(wanted)
    if max(width_m, height_m) > LONGEST_SIDE_M:
        raise UserError(
            f"{width_m / 1000:.0f} km by {height_m / 1000:.0f} km: at most {LONGEST_SIDE_M / 1000:.0f} km each "
            "way fit a map; say which part with --at and --radius, or --box (in Python at, radius_m, box)"
        )
    source = catalog or OverpassSource(HttpClient(instead="give a file: --osm map.osm.pbf"))
    extract = source.extract_box(wanted, OsmSettings(), surroundings=False)
    middle = ((wanted.south_deg + wanted.north_deg) / 2, (wanted.west_deg + wanted.east_deg) / 2)
    try:
        made = build_plain_map(
            extract, LocalFrame(*(at or middle)), RoadSettings(), name="road map", left_hand=left_hand
        )
    except Rejection as why:
        raise UserError(why.detail) from why
    return MadeMap(extract, made, source)


def _box_of(
    at: tuple[float, float] | None,
    radius_m: float,
    box: tuple[float, float, float, float] | None,
    catalog: MapCatalog | None,
) -> BoundingBox:
    if at is not None:
        if not (abs(at[0]) <= 90 and abs(at[1]) <= 180 and radius_m > 0):
            raise UserError(f"{at[0]:g}, {at[1]:g}: no place; latitude comes first, and the radius is above 0")
        return box_around(Site("", *at), radius_m)
    if box is not None:
        west_deg, south_deg, east_deg, north_deg = box
        if not (-180 <= west_deg < east_deg <= 180 and -90 <= south_deg < north_deg <= 90):
            raise UserError(f"{', '.join(f'{side:g}' for side in box)}: no box of west, south, east, north: {_WORDS}")
        return BoundingBox(south_deg, west_deg, north_deg, east_deg)
    if catalog is None:
        raise UserError("which place? --at LAT,LON or --box W,S,E,N, or a whole small file: --osm FILE")
    return catalog.bounds


# --- lanes -----------------------------------------------------------------------------------------------------------
def lane_table(network: RoadNetwork) -> pd.DataFrame:
    """Return a row per lane, indexed by ``lane`` (:class:`trace_dag.roads.map.model.LaneRef`), local frame, metres.

    Columns: ``type``, ``speed_mps`` (its limit, or NaN), ``junction_id`` (None outside junctions), ``length_m``,
    ``centre`` (shapely ``LineString`` with heights, in the direction of travel), ``surface`` (``Polygon``),
    ``predecessors`` and ``successors`` (lists of lanes), ``left`` and ``right`` (the drivable lane directly beside it,
    or None).
    """
    import pandas as pd

    shapes = lane_shapes(network)
    rows = [_row(shape) for shape in shapes]
    index = pd.Index([shape.ref for shape in shapes], name="lane", tupleize_cols=False)
    return pd.DataFrame(rows, index=index, columns=_COLUMNS)


def lane_graph(network: RoadNetwork) -> nx.DiGraph[Any]:
    """Return the drivable lanes as a directed graph of networkx, the extra ``graph``.

    A node per lane (:class:`trace_dag.roads.map.model.LaneRef`) with the columns of :func:`lane_table` that are not
    lanes themselves. Edges have a ``kind``: ``successor`` for the next lane along the road, weighted with the
    ``length_m`` of the earlier lane; ``left`` and ``right`` for an adjacent lane in the same direction. Raises
    :class:`UserError` without networkx.
    """
    try:
        import networkx as nx
    except ImportError as error:
        raise UserError("a graph of lanes needs networkx: pip install 'trace-dag[graph]'") from error

    graph: nx.DiGraph[Any] = nx.DiGraph()
    shapes = lane_shapes(network, drivable_only=True)
    for shape in shapes:
        row = _row(shape)
        graph.add_node(shape.ref, **{name: row[name] for name in _COLUMNS if name not in _OTHER_LANES})
    for shape in shapes:
        for successor in shape.successors:
            graph.add_edge(shape.ref, successor, kind="successor", length_m=shape.length_m)
        for kind, beside, same_way in (
            ("left", shape.left, shape.left_same_way),
            ("right", shape.right, shape.right_same_way),
        ):
            if beside is not None and same_way:
                graph.add_edge(shape.ref, beside, kind=kind, length_m=0.0)
    return graph


_COLUMNS = (
    "type",
    "speed_mps",
    "junction_id",
    "length_m",
    "centre",
    "surface",
    "predecessors",
    "successors",
    "left",
    "right",
)
_OTHER_LANES = frozenset({"predecessors", "successors", "left", "right"})


def _row(shape: LaneShape) -> dict[str, Any]:
    import numpy as np
    import shapely

    return {
        "type": str(shape.type),
        "speed_mps": shape.speed_mps,
        "junction_id": shape.junction_id,
        "length_m": shape.length_m,
        "centre": shapely.LineString(shape.centre_m),
        "surface": shapely.Polygon(np.concatenate([shape.left_m, shape.right_m[::-1]])),
        "predecessors": list(shape.predecessors),
        "successors": list(shape.successors),
        "left": shape.left,
        "right": shape.right,
    }
