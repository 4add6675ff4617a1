"""Road maps by themselves in the forms of other tools: lanes as GeoJSON and GeoParquet, CommonRoad, SUMO, glTF.

Lanes for geographic tools are in WGS84, longitude first; all else is in the map's local frame, as in its OpenDRIVE.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from trace_dag.formats.commonroad import road_scenario
from trace_dag.formats.sumo import netconvert, network_xml
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.geoparquet import geoparquet_of
from trace_dag.scenario.solid.scene import place_glb

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.osm.types import OsmFeature

_DIGITS: Final = 7  # of a degree: a centimetre


def lanes_geojson(network: RoadNetwork) -> bytes:
    """A feature per lane: its surface as a polygon with heights, and its road, type, name, limit and neighbours.

    >>> found = json.loads(lanes_geojson(network))
    >>> found["features"][0]["geometry"]["type"], len(found["features"]) == len(network.lanes())
    ('Polygon', True)
    """
    rows, surfaces = _lanes(network)
    features = [
        {"type": "Feature", "properties": row, "geometry": shapely.geometry.mapping(surface)}
        for row, surface in zip(rows, surfaces, strict=True)
    ]
    collection = {"type": "FeatureCollection", "attribution": network.attribution, "features": features}
    return json.dumps(collection, ensure_ascii=False).encode()


def lanes_geoparquet(network: RoadNetwork) -> bytes:
    """The rows of :func:`lanes_geojson` as GeoParquet 1.1.

    >>> lanes_geoparquet(network)[:4]
    b'PAR1'
    """
    import pyarrow as pa

    rows, surfaces = _lanes(network)
    return geoparquet_of(pa.Table.from_pylist(rows), np.array(surfaces))


def _lanes(network: RoadNetwork) -> tuple[list[dict[str, Any]], list[shapely.Polygon]]:
    def names(refs: Sequence[tuple[str, int, int]]) -> str:
        return " ".join(":".join(map(str, ref)) for ref in refs)

    rows, surfaces = [], []
    for shape in lane_shapes(network):
        road, lane = network.road_by_id[shape.ref.road_id], network.lane(shape.ref)
        rows.append(
            {
                "lane": names([shape.ref]),
                "road": road.id,
                "name": road.name,
                "highway": road.highway,
                "type": shape.type.value,
                "junction": shape.junction_id,
                "turn": road.turn,
                "turns": ";".join(lane.turns),
                "speed_mps": shape.speed_mps,
                "length_m": round(shape.length_m, 2),
                "osm_ways": " ".join(map(str, road.osm_way_ids)),
                "predecessors": names(shape.predecessors),
                "successors": names(shape.successors),
            }
        )
        surfaces.append(_polygon(network, np.concatenate([shape.left_m, shape.right_m[::-1]])))
    return rows, surfaces


def _polygon(network: RoadNetwork, ring_m: FloatArray) -> shapely.Polygon:
    latitudes, longitudes = network.frame.to_geographic(ring_m[:, :2]).T.round(_DIGITS)
    return shapely.Polygon(np.column_stack([longitudes, latitudes, ring_m[:, 2].round(2)]))


def _sumo(network: RoadNetwork, xodr: bytes, surroundings: Sequence[OsmFeature]) -> bytes:
    return network_xml(netconvert(), "map", xodr)


FORMS: Final[Mapping[str, tuple[str, Callable[[RoadNetwork, bytes, Sequence[OsmFeature]], bytes]]]] = {
    "geojson": ("lanes.geojson", lambda network, xodr, surroundings: lanes_geojson(network)),
    "geoparquet": ("lanes.parquet", lambda network, xodr, surroundings: lanes_geoparquet(network)),
    "commonroad": ("map.commonroad.xml", lambda network, xodr, surroundings: road_scenario(network)),
    "sumo": ("map.net.xml", _sumo),
    "glb": ("map.glb", lambda network, xodr, surroundings: place_glb(network, surroundings=surroundings)),
}
"""By form: the name of its file, and what makes it of a network, its OpenDRIVE, and what stands beside the roads."""
