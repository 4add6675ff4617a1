"""Crossings of two named streets in OpenStreetMap files, and places at a distance along one of them.

They place crashes whose report has no coordinates.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
import shapely

from trace_dag.common.geometry import FloatArray, LocalFrame
from trace_dag.crash.reported_place import FromCrossing, Place
from trace_dag.osm.catalog import MapCatalog, box_around
from trace_dag.osm.extraction import reading
from trace_dag.osm.road_classes import DRIVABLE_HIGHWAYS
from trace_dag.osm.types import Site
from trace_dag.roads.crash_site.street_names import StreetIndex

ONE_CROSSING_M: Final = 80.0
"""Nodes of the two streets that lie within this are of one crossing: of carriageways, of streets that are staggered."""
_MOST_OFF_RAD: Final = 3 * math.pi / 8
"""A street that leads north-east is called north or east, and an octant is 22.5 degrees to each side."""
_ARCS: Final = 64  # of a quarter of a circle: within 0.01 % of it
_NAMES: Final = ("name", "ref", "alt_name", "official_name", "old_name")


def find_places(maps: Sequence[Path], wanted: Collection[FromCrossing]) -> dict[FromCrossing, list[Place]]:
    """Return the points of each place: none if the streets do not cross, several if they cross repeatedly.

    The distance is measured in a straight line from the middle of the crossing to the street. Streets are compared as
    :mod:`trace_dag.roads.crash_site.street_names` does. Every file is read twice. Raises :class:`UserError` for files
    that are no OSM data.
    """
    found: dict[FromCrossing, list[Place]] = {each: [] for each in wanted}
    if not found:
        return found
    names = {name for each in wanted for name in (each.street, each.cross_street)}
    for file in MapCatalog.checked(maps).files:
        streets = _Streets(file.path, names, {each.street for each in wanted if each.direction is not None})
        for each in wanted:
            found[each] += streets.places(each)
    return {each: _together(places) for each, places in found.items()}


class _Streets:
    """The roads of a file that have one of some names. ``along``: the roads with places away from crossings."""

    def __init__(self, path: Path, names: Collection[str], along: Collection[str]) -> None:
        roads = _named_roads(path)
        index = StreetIndex(roads)
        self._ways = {name: [way for mapped in index.same(name) for way in roads[mapped]] for name in names}
        self._nodes = {name: frozenset(chain.from_iterable(ways)) for name, ways in self._ways.items()}
        uses: dict[int, int] = {}
        for node in chain.from_iterable(self._nodes.values()):
            uses[node] = uses.get(node, 0) + 1
        shared = {node for node, count in uses.items() if count > 1}
        self._located = _located(path, shared.union(*(self._nodes[name] for name in along)))
        self._lines = cache(self._lines_of)

    def places(self, wanted: FromCrossing) -> list[Place]:
        """Return the places found in this file."""
        shared = self._nodes[wanted.street] & self._nodes[wanted.cross_street]
        crossings = _together([self._located[node] for node in sorted(shared) if node in self._located])
        if wanted.direction is None or not wanted.distance_m:
            return crossings
        return [place for crossing in crossings if (place := self._away(wanted, crossing)) is not None]

    def _away(self, wanted: FromCrossing, crossing: Place) -> Place | None:
        """Return the middle of the street's exits from a circle around a crossing that are nearest to the direction."""
        assert wanted.direction is not None
        frame, lines = LocalFrame(*crossing), self._lines(wanted.street)
        box = box_around(Site("", *crossing), wanted.distance_m)
        near = lines.query(shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg))
        local = shapely.transform(
            lines.geometries.take(near), lambda points: frame.to_local(points[:, 1], points[:, 0])
        )
        circle = shapely.Point(0.0, 0.0).buffer(wanted.distance_m, quad_segs=_ARCS).exterior
        points: FloatArray = shapely.get_coordinates(shapely.intersection(local, circle))
        turns = np.arctan2(points[:, 1], points[:, 0]) - wanted.direction.heading_rad
        off_rad = np.abs(np.arctan2(np.sin(turns), np.cos(turns)))
        if not (off_rad <= _MOST_OFF_RAD).any():
            return None
        best = points[off_rad.argmin()]
        carriageways = points[np.hypot(*(points - best).T) <= min(ONE_CROSSING_M, wanted.distance_m)]
        return Place(*frame.to_geographic(carriageways.mean(axis=0)).tolist())

    def _lines_of(self, name: str) -> shapely.STRtree:
        located = self._located
        ways = ([located[node][::-1] for node in way if node in located] for way in self._ways[name])
        return shapely.STRtree([shapely.LineString(way) for way in ways if len(way) > 1])


def _named_roads(path: Path) -> dict[tuple[str, ...], list[array[int]]]:
    """Return the nodes of every road, by its names."""
    import osmium

    found: dict[tuple[str, ...], list[array[int]]] = {}
    with reading(path):
        for way in osmium.FileProcessor(str(path), osmium.osm.WAY).with_filter(osmium.filter.KeyFilter("highway")):
            if not isinstance(way, osmium.osm.Way) or way.tags["highway"] not in DRIVABLE_HIGHWAYS:
                continue
            names = tuple(part for key in _NAMES if (text := way.tags.get(key)) for part in text.split(";"))
            if names:
                found.setdefault(names, []).append(array("q", (node.ref for node in way.nodes)))
    return found


def _located(path: Path, ids: Collection[int]) -> Mapping[int, Place]:
    import osmium

    if not ids:
        return {}
    with reading(path):
        only = osmium.filter.IdFilter(ids)
        nodes = osmium.FileProcessor(str(path), osmium.osm.NODE).with_filter(only)
        return {node.id: Place(node.lat, node.lon) for node in nodes if isinstance(node, osmium.osm.Node)}


def _together(places: Iterable[Place]) -> list[Place]:
    """Return the middle of each crossing."""
    all_places = list(places)
    if len(all_places) < 2:
        return all_places
    frame = LocalFrame(*all_places[0])
    groups: list[list[FloatArray]] = []
    for point in frame.to_local(*np.array(all_places).T):
        near = [group for group in groups if any(math.dist(point, each) <= ONE_CROSSING_M for each in group)]
        groups = [group for group in groups if not any(group is each for each in near)]
        groups.append([point, *(each for group in near for each in group)])
    return [Place(*frame.to_geographic(np.mean(group, axis=0)).tolist()) for group in groups]
