"""Where two named streets cross, in OpenStreetMap files: the place of a crash of which only its streets are known."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from trace_dag.crash.record import Octant
from trace_dag.geometry import LocalFrame
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.drivable import DRIVABLE_HIGHWAYS
from trace_dag.osm.extraction import reading
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity

ONE_CROSSING_M: Final = 80.0
"""Nodes of the two streets that lie within this are of one crossing: of carriageways, of streets that are staggered."""
_NAMES: Final = ("name", "ref", "alt_name", "official_name", "old_name")


class Streets(NamedTuple):
    """Two streets, as a narrative names them."""

    one: str
    other: str


class Place(NamedTuple):
    """A point, WGS84 degrees."""

    latitude_deg: float
    longitude_deg: float

    def away(self, distance_m: float, direction: Octant) -> Place:
        """The place so far away in a direction of the compass.

        >>> Place(41.8, -101.5).away(1000.0, Octant.NORTH).latitude_deg > 41.808
        True
        """
        angle = direction.heading_rad
        offset = np.array([distance_m * math.cos(angle), distance_m * math.sin(angle)])
        return Place(*LocalFrame(*self).to_geographic(offset).tolist())


def crossings(maps: Sequence[Path], wanted: Collection[Streets]) -> dict[Streets, list[Place]]:
    """Where each two streets cross: nothing where they do not, several places where they do so more than once.

    Streets are compared as :mod:`trace_dag.roads.crash_site.street_names` does. Every file is read twice. Raises
    :class:`UserError` for files that are no OSM data.
    """
    names = {name for streets in wanted for name in streets}
    found: dict[Streets, list[Place]] = {streets: [] for streets in wanted}
    if not names:
        return found
    for file in MapCatalog.open(maps).files:
        nodes = _nodes_of(file.path, names)
        shared = {streets: nodes[streets.one] & nodes[streets.other] for streets in wanted}
        located = _located(file.path, set().union(*shared.values()))
        for streets, ids in shared.items():
            found[streets] += [located[each] for each in sorted(ids) if each in located]
    return {streets: _together(places) for streets, places in found.items()}


def _nodes_of(path: Path, names: Collection[str]) -> dict[str, set[int]]:
    """The nodes of the roads that have each name."""
    import osmium

    @cache
    def meant(mapped: tuple[str, ...]) -> list[str]:
        return [name for name in names if (similarity(name, mapped) or 0.0) >= SAME_STREET]

    nodes: dict[str, set[int]] = {name: set() for name in names}
    with reading(path):
        for way in osmium.FileProcessor(str(path), osmium.osm.WAY).with_filter(osmium.filter.KeyFilter("highway")):
            if not isinstance(way, osmium.osm.Way) or way.tags["highway"] not in DRIVABLE_HIGHWAYS:
                continue
            mapped = tuple(part for key in _NAMES if (text := way.tags.get(key)) for part in text.split(";"))
            for name in meant(mapped):
                nodes[name].update(node.ref for node in way.nodes)
    return nodes


def _located(path: Path, ids: Collection[int]) -> dict[int, Place]:
    import osmium

    if not ids:
        return {}
    with reading(path):
        only = osmium.filter.IdFilter(ids)
        nodes = osmium.FileProcessor(str(path), osmium.osm.NODE).with_filter(only)
        return {node.id: Place(node.lat, node.lon) for node in nodes if isinstance(node, osmium.osm.Node)}


def _together(places: Iterable[Place]) -> list[Place]:
    """The middle of each crossing."""
    groups: list[list[Place]] = []
    for place in places:
        near = [group for group in groups if any(_apart_m(place, each) <= ONE_CROSSING_M for each in group)]
        groups = [group for group in groups if group not in near] + [
            [place, *(each for group in near for each in group)]
        ]
    return [Place(*np.mean(group, axis=0).tolist()) for group in groups]


def _apart_m(one: Place, other: Place) -> float:
    return float(np.hypot(*LocalFrame(*one).to_local(other.latitude_deg, other.longitude_deg)))
