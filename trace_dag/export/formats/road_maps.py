"""Road maps by themselves in the forms of other tools.

Lanes as GeoJSON and GeoParquet, CommonRoad, Lanelet2, ScenarioNet, SUMO, glTF.

Lanes for geographic tools are in WGS84, longitude first; all else is in the map's local frame, as in its OpenDRIVE. The
modules of a form are loaded on use, since most maps are only needed as OpenDRIVE.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from trace_dag.common.errors import UserError
from trace_dag.export.formats import MAP_FORMS
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.network import RoadNetwork

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.osm.types import OsmFeature

_DIGITS: Final = 7  # of a degree: a centimetre


def lanes_geojson(network: RoadNetwork) -> bytes:
    """Return a GeoJSON feature per lane: its surface with heights, road, type, name, limit and neighbours.

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
    """Return the rows of :func:`lanes_geojson` as GeoParquet 1.1.

    >>> lanes_geoparquet(network)[:4]
    b'PAR1'
    """
    import pyarrow as pa

    from trace_dag.export.geoparquet import geoparquet_of

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


def form_of_map(
    form: str, network: RoadNetwork, xodr: bytes, surroundings: Callable[[], Sequence[OsmFeature]]
) -> Mapping[str, bytes]:
    """Return the files of one of :data:`trace_dag.export.formats.MAP_FORMS`, by path.

    They are made from a map, its OpenDRIVE, and ``surroundings``, which returns the features beside its roads.

    Raises :class:`UserError` for another form, or if a program for the form is missing.

    >>> sorted(form_of_map("geojson", network, xodr, tuple))
    ['lanes.geojson']
    """
    if form == "geojson":
        return {"lanes.geojson": lanes_geojson(network)}
    if form == "geoparquet":
        return {"lanes.parquet": lanes_geoparquet(network)}
    if form == "commonroad":
        from trace_dag.export.formats.commonroad import road_scenario

        return {"map.commonroad.xml": road_scenario(network)}
    if form == "lanelet2":
        from trace_dag.export.formats.lanelet2 import lanelets

        return {"map.lanelet2.osm": lanelets(network)}
    if form == "scenarionet":
        from trace_dag.export.formats.scenarionet import road_description

        return {f"scenarionet/{name}": content for name, content in road_description(network).items()}
    if form == "sumo":
        from trace_dag.scenario.traffic.sumo_network import network_xml, sumo_program

        return {"map.net.xml": network_xml(sumo_program("netconvert"), "map", network, xodr)}
    if form == "glb":
        from trace_dag.pages.solid.scene import place_glb

        return {"map.glb": place_glb(network, surroundings=surroundings())}
    raise UserError(f"{form}: no form of a map; there are {', '.join(MAP_FORMS)}")
