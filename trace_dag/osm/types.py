"""Plain OSM data of one site, as cut out of a source: nodes, ways and relations with all their tags.

Nodes and ways are named tuples, since a batch has hundreds of thousands of them: a frozen dataclass takes twice as long
to make.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from shapely.geometry.base import BaseGeometry

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.rights import OSM_ATTRIBUTION

NO_TAGS: Final[Mapping[str, str]] = {}


@dataclass(frozen=True)
class Site:
    """A place to cut a map around: the reported point of crash ``key``, WGS84 degrees."""

    key: str
    latitude_deg: float
    longitude_deg: float


class OsmNode(NamedTuple):
    """A node in WGS84 degrees.

    ``clipped`` marks a node where a road ends in the data but not in reality. Those with an id below 0 were made where
    a way was cut at the box.
    """

    id: int
    latitude_deg: float
    longitude_deg: float
    tags: Mapping[str, str] = NO_TAGS
    clipped: bool = False


class OsmWay(NamedTuple):
    """A way and the ids of its nodes, in order, all of them present in the extract."""

    id: int
    node_ids: tuple[int, ...]
    tags: Mapping[str, str] = NO_TAGS


class RawWay(NamedTuple):
    """A way as in the file: (n,) nodes, WGS84 degrees, NaN for nodes that the file lacks."""

    id: int
    node_ids: npt.NDArray[np.int64]
    longitudes_deg: FloatArray
    latitudes_deg: FloatArray
    tags: Mapping[str, str]


@dataclass(frozen=True)
class OsmMember:
    """A member of a relation: ``type`` is "node", "way" or "relation"."""

    type: str
    id: int
    role: str


@dataclass(frozen=True)
class OsmRelation:
    """A relation, in practice a turn restriction."""

    id: int
    members: tuple[OsmMember, ...]
    tags: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class BoundingBox:
    """A box in WGS84 degrees."""

    south_deg: float
    west_deg: float
    north_deg: float
    east_deg: float

    def contains(self, latitude_deg: float, longitude_deg: float) -> bool:
        """Return whether a point lies in the box, borders included."""
        return self.south_deg <= latitude_deg <= self.north_deg and self.west_deg <= longitude_deg <= self.east_deg


class OsmFeature(NamedTuple):
    """A feature beside the roads: a tree, a building, a wood.

    ``id`` is that of OpenStreetMap with its type ("node/12", "way/7"); the geometry has longitude and latitude, WGS84
    degrees: a point, or a line or area cut at the box of the extract.
    """

    id: str
    geometry: BaseGeometry
    tags: Mapping[str, str] = NO_TAGS


@dataclass(frozen=True)
class OsmExtract:
    """The pruned OSM data around one crash.

    ``osm_extract/<key>.osm.pbf`` holds the streets, ``osm_extract/<key>.geojson`` the ``surroundings``.
    """

    box: BoundingBox
    nodes: dict[int, OsmNode]
    ways: tuple[OsmWay, ...]
    relations: tuple[OsmRelation, ...] = ()
    walkways: tuple[OsmWay, ...] = ()  # sidewalks and crossings that are ways of their own, for people only
    surroundings: tuple[OsmFeature, ...] = ()  # what stands and lies near the crash beside the roads
    source: str = ""
    data_timestamp: str = ""
    attribution: str = OSM_ATTRIBUTION
