"""Features beside the roads in OpenStreetMap: those that a vehicle can strike, and the background of pictures.

Belongs here: the tags that are kept, the features around one crash, and the file that holds them, GeoJSON (RFC 7946)
with the tags of each object as its properties. Reading them out of a map file is :mod:`trace_dag.osm.extraction`'s
task.

Areas drawn by one way are kept. Those of relations (multipolygons) are not: their ways carry no tags of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import BoundingBox, OsmFeature, RawWay

_ANY: Final[frozenset[str]] = frozenset()
_BARRIERS: Final = frozenset(
    {
        *("block", "bollard", "cable_barrier", "city_wall", "fence", "guard_rail", "handrail", "hedge"),
        *("jersey_barrier", "kerb", "log", "median_strip", "retaining_wall", "traffic_island", "wall", "wire_fence"),
    }
)
_OF_WAYS: Final[Mapping[str, frozenset[str]]] = {
    "building": _ANY,
    "natural": frozenset(["grassland", "scrub", "tree_row", "water", "wetland", "wood"]),
    "landuse": frozenset(["basin", "farmland", "forest", "grass", "meadow", "orchard", "reservoir", "vineyard"]),
    "waterway": frozenset(["canal", "ditch", "drain", "river", "riverbank", "stream"]),
    "barrier": _BARRIERS,
    "railway": frozenset(["light_rail", "narrow_gauge", "rail", "subway", "tram"]),
    "amenity": frozenset({"parking"}),
    "man_made": frozenset(["bridge", "embankment"]),
    "bridge:support": _ANY,
}
_OF_NODES: Final[Mapping[str, frozenset[str]]] = {
    "natural": frozenset(["rock", "shrub", "stone", "tree"]),
    "power": frozenset(["catenary_mast", "pole", "portal", "tower"]),
    "highway": frozenset({"street_lamp"}),
    "traffic_sign": _ANY,
    "barrier": _BARRIERS,
    "man_made": frozenset(["flagpole", "mast", "street_cabinet", "utility_pole"]),
    "emergency": frozenset({"fire_hydrant"}),
    "advertising": _ANY,
    "amenity": frozenset(["letter_box", "post_box"]),
    "bridge:support": _ANY,
}
"""Keys and their values; :data:`_ANY` for all values but "no"."""

WAY_KEYS: Final = tuple(_OF_WAYS)
NODE_KEYS: Final = tuple(_OF_NODES)
_AREA_KEYS: Final = ("building", "landuse", "amenity")
_AREA_VALUES: Final = frozenset(["grassland", "riverbank", "scrub", "water", "wetland", "wood", "bridge"])
_DIGITS: Final = 7  # OSM stores coordinates as multiples of 1e-7 degrees


def is_thing(tags: Mapping[str, str], *, way: bool) -> bool:
    """Return whether a way, or a node, with ``tags`` is a feature beside roads that is kept.

    >>> is_thing({"natural": "tree"}, way=False), is_thing({"natural": "peak"}, way=False)
    (True, False)
    """
    kept = _OF_WAYS if way else _OF_NODES
    return any((tags[key] in values if values else tags[key] != "no") for key, values in kept.items() if key in tags)


def feature_of_node(node_id: int, longitude_deg: float, latitude_deg: float, tags: Mapping[str, str]) -> OsmFeature:
    """Return a node as a feature.

    >>> feature_of_node(5, -77.4, 37.5, {"natural": "tree"}).geometry.wkt
    'POINT (-77.4 37.5)'
    """
    return OsmFeature(f"node/{node_id}", shapely.Point(longitude_deg, latitude_deg), tags)


def features_of_ways(ways: Sequence[RawWay], box: BoundingBox) -> list[OsmFeature]:
    """Return features that are ways, areas or lines, cut at ``box``; those outside it are left out.

    Nodes that the source lacks are skipped.

    >>> corners_x, corners_y = np.array([0.0, 2.0, 2.0, 0.0, 0.0]), np.array([0.0, 0.0, 2.0, 2.0, 0.0])
    >>> house = RawWay(7, np.array([1, 2, 3, 4, 1]), corners_x, corners_y, {"building": "yes"})
    >>> (cut,) = features_of_ways([house], BoundingBox(0.0, 0.0, 1.0, 1.0))  # south, west, north, east
    >>> cut.geometry.area  # cut from 4 square degrees
    1.0
    """
    if not ways:
        return []
    sizes = np.array([len(way.node_ids) for way in ways])
    places = np.column_stack(
        [np.concatenate([way.longitudes_deg for way in ways]), np.concatenate([way.latitudes_deg for way in ways])]
    )
    of_way, located = np.repeat(np.arange(len(ways)), sizes), ~np.isnan(places[:, 0])
    counts = np.bincount(of_way[located], minlength=len(ways))
    lasts = np.cumsum(sizes) - 1
    closed = (places[lasts - sizes + 1] == places[lasts]).all(axis=1)
    areas = closed & (counts > 3) & np.array([_is_area(way.tags) for way in ways])
    shapes = np.empty(len(ways), dtype=object)
    for chosen, make in ((areas, _areas), (~areas & (counts > 1), shapely.linestrings)):
        if chosen.any():
            of_chosen = located & chosen[of_way]
            shapes[chosen] = make(places[of_chosen], indices=(np.cumsum(chosen) - 1)[of_way[of_chosen]])
    cut = shapely.clip_by_rect(shapes, box.west_deg, box.south_deg, box.east_deg, box.north_deg)
    kept = np.flatnonzero(~shapely.is_missing(cut) & ~shapely.is_empty(cut))
    rounded = shapely.transform(cut[kept], lambda corners: np.round(corners, _DIGITS))
    return [
        OsmFeature(f"way/{ways[index].id}", geometry, ways[index].tags)
        for index, geometry in zip(kept.tolist(), rounded.tolist(), strict=True)
    ]


def _areas(places: FloatArray, *, indices: npt.NDArray[np.int64]) -> npt.NDArray[np.object_]:
    return np.asarray(shapely.make_valid(shapely.polygons(shapely.linearrings(places, indices=indices))))


def _is_area(tags: Mapping[str, str]) -> bool:
    if tags.get("area") in ("yes", "no"):
        return tags["area"] == "yes"
    return any(key in tags for key in _AREA_KEYS) or not _AREA_VALUES.isdisjoint(
        tags.get(key, "") for key in ("natural", "waterway", "man_made")
    )
