"""Plain OSM data of one site, as cut out of a source: nodes, ways and relations with all their tags.

Nodes and ways are named tuples, since a batch has hundreds of thousands of them: a frozen dataclass takes twice as long
to make.

Maps have an attribution and a licence, and show a real place or not. An XML file states it on its root element; data of
OpenStreetMap are attributed as its licence requires. A map that calls itself fictional belongs to invented crashes, and
everything that shows them has to say so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from shapely.geometry.base import BaseGeometry

from trace_dag.common.geometry import FloatArray, LocalFrame

NO_TAGS: Final[Mapping[str, str]] = {}
OSM_ATTRIBUTION: Final = "© OpenStreetMap contributors, ODbL 1.0"
"""The credit that https://www.openstreetmap.org/copyright asks for: of a map that says nothing else."""

_SPDX: Final = {"odbl": "ODbL-1.0", "openstreetmap": "ODbL-1.0", "cc0": "CC0-1.0"}
_UNKNOWN: Final = "NOASSERTION"  # SPDX 2.3, section 8.5: nobody has said which licence it is


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


def count_arms(ways: Iterable[OsmWay]) -> Counter[int]:
    """Count the ways that leave each node, one that passes through counting twice.

    >>> sorted(count_arms([OsmWay(1, (7, 8, 9)), OsmWay(2, (8, 10))]).items())
    [(7, 1), (8, 3), (9, 1), (10, 1)]
    """
    return Counter(node_id for way in ways for pair in pairwise(way.node_ids) for node_id in pair)


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

    def local_xy_m(self, node_ids: Iterable[int], frame: LocalFrame) -> FloatArray:
        """Return the places of nodes in a frame, shape (n, 2), metres."""
        nodes = [self.nodes[node_id] for node_id in node_ids]
        degrees = np.array([(node.latitude_deg, node.longitude_deg) for node in nodes]).reshape(-1, 2)
        return frame.to_local(degrees[:, 0], degrees[:, 1])


# --- rights ----------------------------------------------------------------------------------------------------------
def read_attribution(root: Mapping[str, str]) -> str:
    """Read a map's attribution from the attributes of its ``<osm>`` element.

    It is ``attribution`` if that is text, else ``copyright`` with ``license``. Servers of OpenStreetMap put addresses
    there (``attribution="http://www.openstreetmap.org/copyright"``); for them, and for a file without these attributes,
    it is :data:`OSM_ATTRIBUTION`.

    >>> read_attribution({"copyright": "City of Lincoln", "license": "CC0"})
    'City of Lincoln, CC0'
    """
    attribution = root.get("attribution", "").strip()
    if attribution and "://" not in attribution:
        return attribution
    said = [text for name in ("copyright", "license") if (text := root.get(name, "").strip())] or [attribution]
    words = ", ".join(filter(None, said))
    return OSM_ATTRIBUTION if not words or "openstreetmap" in f"{words} {attribution}".lower() else words


@dataclass(frozen=True)
class Rights:
    """The rights in some maps and in works made of them.

    ``attributions``: each once, in order.
    """

    attributions: tuple[str, ...]

    @classmethod
    def of(cls, attributions: Iterable[str]) -> Rights:
        """Return the rights of maps with these attributions."""
        return cls(tuple(sorted(set(attributions))))

    @property
    def fictional(self) -> bool:
        """Return whether all the maps show places that do not exist."""
        return bool(self.attributions) and all("fictional" in each.lower() for each in self.attributions)

    @property
    def openstreetmap(self) -> bool:
        """Return whether OpenStreetMap is the source of any map."""
        return any(_licence(each) == "ODbL-1.0" for each in self.attributions)

    @property
    def licence(self) -> str:
        """Return the SPDX licence expression for all maps together."""
        return " AND ".join(sorted({_licence(each) for each in self.attributions})) or _UNKNOWN


def _licence(attribution: str) -> str:
    return next((name for word, name in _SPDX.items() if word in attribution.lower()), _UNKNOWN)
