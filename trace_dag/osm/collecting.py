"""Keeps the ways near sites, and what belongs to them, from the lines that libosmium copied out of a map file.

Most ways of a town are buildings. To keep them cheap, only the first node of each is read; the rest is read only if
that node is near a site.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from trace_dag.geometry import FloatArray
from trace_dag.osm import opl
from trace_dag.osm.drivable import DRIVABLE_HIGHWAYS, SERVICE_HIGHWAYS, is_drivable
from trace_dag.osm.surroundings import feature_of_node, feature_of_way, is_thing
from trace_dag.osm.types import BoundingBox, OsmFeature, OsmRelation
from trace_dag.osm.walkways import WALKWAY_TAGS, is_walkway

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Gates,
# addresses and trees that share a node with a way say nothing about the road.
ROAD_NODE_KEYS: Final = frozenset(
    {"highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele"}
)
_BATCH: Final = 50_000  # ways whose geometry is held at a time
_LONGEST_BUILDING_DEG: Final = 0.004  # 440 m to the north; one that begins farther away than this may be missed

_FIRST_NODE: Final = 60  # bytes from the last space of a way's line in which its first node ends

_IntArray = npt.NDArray[np.int64]


class RawWay(NamedTuple):
    """A way as the file has it: (n,) nodes, WGS84 degrees, NaN where the file lacks the node."""

    id: int
    node_ids: _IntArray
    longitudes_deg: FloatArray
    latitudes_deg: FloatArray
    tags: Mapping[str, str]


@dataclass(eq=False)
class FilePass:
    """What one pass found: for each box the roads and walkways whose bounds overlap it, by id; node tags; restriction
    relations; for each of the nearer boxes the ways that are things beside roads, and the nodes.

    ``restrictions_of`` has them by the id of each way they speak of. ``road_bounds`` is the box of all roads of the
    file, None if there is none or the file itself says what it covers.
    """

    ways: list[dict[int, RawWay]]
    node_tags: dict[int, dict[str, str]] = field(default_factory=dict)
    restrictions_of: dict[int, list[OsmRelation]] = field(default_factory=dict)
    road_bounds: BoundingBox | None = None
    nearer: Sequence[BoundingBox] = ()
    things: list[dict[int, RawWay]] = field(default_factory=list)
    points: list[list[OsmFeature]] = field(default_factory=list)

    def surroundings(self, index: int) -> tuple[OsmFeature, ...]:
        """What stands and lies beside the roads in one of the nearer boxes."""
        of_ways = (
            feature_of_way(way.id, way.longitudes_deg, way.latitudes_deg, way.tags, self.nearer[index])
            for way in self.things[index].values()
        )
        return (*self.points[index], *(feature for feature in of_ways if feature is not None))


class Collector:
    """Reads what libosmium copied, and keeps the ways near a site and what belongs to them."""

    def __init__(
        self,
        boxes: Sequence[BoundingBox],
        nearer: Sequence[BoundingBox],
        *,
        measure_bounds: bool,
        service_roads: bool,
    ) -> None:
        self.incomplete = False  # some way has a node that was not located
        self.negative = False  # and one of those has an id below 0, which libosmium does not locate
        self._boxes = boxes
        self._nearer = nearer
        self._areas = _tree_of(boxes)
        self._nearer_areas = _tree_of(nearer)
        self._begin_areas = _tree_of(nearer, _LONGEST_BUILDING_DEG)
        self._measure_bounds = measure_bounds
        self._service_roads = service_roads
        self._may_be_road = re.compile(
            rb"[T,](?:"
            + b"|".join(f"{key}={value}".encode() for key, value in road_tags(service_roads=service_roads))
            + rb")(?:,|$)"
        ).search
        self._node_lines: list[bytes] = []
        self._restriction_lines: list[bytes] = []  # a fifth of what they take as objects
        self.forget_ways()

    def forget_ways(self) -> None:
        """They will all be read once more."""
        self._ways: list[dict[int, RawWay]] = [{} for _ in self._boxes]
        self._things: list[dict[int, RawWay]] = [{} for _ in self._nearer]
        self._bounds_deg: list[FloatArray] = []  # west, south, east, north of each batch

    def read(self, copy: Path) -> None:
        """Read a copy to its end."""
        way_lines: list[bytes] = []
        with copy.open("rb") as lines:
            for kind, run in groupby(lines, key=itemgetter(0)):
                if kind == ord("w"):
                    while more := list(islice(run, _BATCH - len(way_lines))):
                        way_lines += more
                        if len(way_lines) == _BATCH:
                            self._add_ways(way_lines)
                            way_lines = []
                elif kind == ord("n"):
                    while lines_of_nodes := list(islice(run, _BATCH)):
                        self._keep_nodes(lines_of_nodes)
                else:
                    self._restriction_lines.extend(run)
        self._add_ways(way_lines)

    def _keep_nodes(self, lines: Sequence[bytes]) -> None:
        """Keep the nodes in the boxes: a country has tens of millions with tags."""
        x_deg, y_deg = opl.read_places([line[line.rindex(b" x") :] for line in lines])
        places = shapely.points(x_deg, y_deg)
        near = np.union1d(self._areas.query(places)[0], self._nearer_areas.query(places)[0])
        self._node_lines += [lines[index] for index in near.tolist()]

    def found(self) -> FilePass:
        """Everything that was read."""
        found = FilePass(self._ways)
        in_ways = [way.node_ids for ways in self._ways for way in ways.values()]
        wanted = set(np.concatenate(in_ways).tolist() if in_ways else ())
        for line in self._node_lines:
            if (node_id := opl.read_id(line)) in wanted and not ROAD_NODE_KEYS.isdisjoint(tags := opl.read_tags(line)):
                found.node_tags[node_id] = tags
        kept = {way_id for ways in self._ways for way_id in ways}
        for line in self._restriction_lines:
            members = opl.read_members(line)
            if of_ways := {member.id for member in members if member.type == "way"} & kept:
                relation = OsmRelation(opl.read_id(line), members, opl.read_tags(line))
                for way_id in of_ways:
                    found.restrictions_of.setdefault(way_id, []).append(relation)
        if self._bounds_deg:
            bounds = np.array(self._bounds_deg)
            (west, south), (east, north) = bounds[:, :2].min(axis=0).tolist(), bounds[:, 2:].max(axis=0).tolist()
            found.road_bounds = BoundingBox(south, west, north, east)
        found.things, found.nearer = self._things, self._nearer
        if self._nearer:
            found.points = self._points()
        return found

    def _points(self) -> list[list[OsmFeature]]:
        points: list[list[OsmFeature]] = [[] for _ in self._nearer]
        x_deg, y_deg = opl.read_places([line[line.rindex(b" x") :] for line in self._node_lines])
        near, sites = self._nearer_areas.query(shapely.points(x_deg, y_deg))
        for index, site in zip(near.tolist(), sites.tolist(), strict=True):
            line = self._node_lines[index]
            if is_thing(tags := opl.read_tags(line), way=False):
                points[site].append(feature_of_node(opl.read_id(line), x_deg[index], y_deg[index], tags))
        return points

    def _add_ways(self, lines: Iterable[bytes]) -> None:
        """Keep the ways whose bounds overlap a box."""
        roads: list[bytes] = []
        things: list[bytes] = []
        buildings: list[bytes] = []
        begins: list[bytes] = []
        for line in lines:
            end = line.rindex(b" ")
            tags = line[:end]
            if b"highway=" in tags:  # the most of them are for people on foot alone
                if self._may_be_road(tags):
                    roads.append(line)
            elif b"building=" in tags:
                buildings.append(line)
                begins.append(line[end + 2 : end + _FIRST_NODE].partition(b",")[0])
            else:
                things.append(line)
        bounds = self._keep(self._ways, self._areas, roads, self._is_road)
        if self._measure_bounds and bounds.size:
            self._bounds_deg.append(np.concatenate([bounds[:2].min(axis=1), bounds[2:].max(axis=1)]))
        things += self._begun_near(buildings, begins)
        if things:
            self._keep(self._things, self._nearer_areas, things, partial(is_thing, way=True))

    def _begun_near(self, buildings: Sequence[bytes], begins: Sequence[bytes]) -> list[bytes]:
        """Those of many buildings that begin near one of the nearer boxes."""
        x_deg, y_deg = opl.read_places(begins)
        self.incomplete |= bool(np.isnan(x_deg).any())
        near = np.unique(self._begin_areas.query(shapely.points(x_deg, y_deg))[0])
        return [buildings[index] for index in near.tolist()]

    def _locate(self, lines: Sequence[bytes]) -> opl.WayNodes:
        nodes = opl.read_way_nodes(lines)
        missing = np.isnan(nodes.longitudes_deg)
        self.incomplete |= bool(missing.any())
        self.negative |= bool((nodes.ids[missing] < 0).any())
        return nodes

    def _is_road(self, tags: Mapping[str, str]) -> bool:
        return is_drivable(tags, service_roads=self._service_roads) or is_walkway(tags)

    def _keep(
        self,
        kept: Sequence[dict[int, RawWay]],
        areas: shapely.STRtree,
        lines: Sequence[bytes],
        is_wanted: Callable[[Mapping[str, str]], bool],
    ) -> FloatArray:
        """Keep those of the ways that overlap an area, for each area. The bounds of all that are located, (4, n)."""
        nodes = self._locate(lines)
        located, bounds = _bounds_of_ways(nodes)
        near, sites = areas.query(shapely.box(*bounds))
        ways = self._read_ways(lines, nodes, np.unique(located[near]), is_wanted)
        for index, site in zip(located[near].tolist(), sites.tolist(), strict=True):
            if (way := ways.get(index)) is not None:
                kept[site][way.id] = way
        return bounds

    def _read_ways(
        self,
        lines: Sequence[bytes],
        nodes: opl.WayNodes,
        wanted: _IntArray,
        is_wanted: Callable[[Mapping[str, str]], bool],
    ) -> dict[int, RawWay]:
        """Those of the ways that are wanted by their tags too, by their number among the lines."""
        chosen = np.zeros(len(lines), dtype=bool)
        chosen[wanted] = True
        of_wanted = np.repeat(chosen, nodes.counts)
        # Copies: what is kept of a batch must not keep all of it in memory.
        ids, x_deg, y_deg = nodes.ids[of_wanted], nodes.longitudes_deg[of_wanted], nodes.latitudes_deg[of_wanted]
        ends = np.cumsum(nodes.counts[wanted])
        starts = ends - nodes.counts[wanted]
        ways = {}
        for index, start, end in zip(wanted.tolist(), starts.tolist(), ends.tolist(), strict=True):
            tags = opl.read_tags(lines[index])
            if is_wanted(tags):
                way_id = opl.read_id(lines[index])
                ways[index] = RawWay(way_id, ids[start:end], x_deg[start:end], y_deg[start:end], tags)
        return ways


def road_tags(*, service_roads: bool) -> list[tuple[str, str]]:
    """Keys and values one of which every road and walkway has.

    >>> [("highway", "service") in road_tags(service_roads=wanted) for wanted in (True, False)]
    [True, False]
    """
    highways = DRIVABLE_HIGHWAYS if service_roads else DRIVABLE_HIGHWAYS - SERVICE_HIGHWAYS
    return [*(("highway", highway) for highway in sorted(highways)), *WALKWAY_TAGS]


def _tree_of(boxes: Sequence[BoundingBox], farther_deg: float = 0.0) -> shapely.STRtree:
    return shapely.STRtree(
        [
            shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg).buffer(
                farther_deg, join_style="mitre"
            )
            for box in boxes
        ]
    )


def _bounds_of_ways(nodes: opl.WayNodes) -> tuple[_IntArray, FloatArray]:
    """The numbers of the ways with a node that is located, (n,); their west, south, east and north, degrees, (4, n)."""
    filled = np.flatnonzero(nodes.counts)
    if not len(filled):
        return filled, np.empty((4, 0))
    first = (np.cumsum(nodes.counts) - nodes.counts)[filled]
    places = nodes.longitudes_deg, nodes.latitudes_deg
    # fmin and fmax pass over NaN: the bounds are those of the nodes that are there.
    bounds = np.array([extreme.reduceat(values, first) for extreme in (np.fmin, np.fmax) for values in places])
    located = ~np.isnan(bounds[0])
    return filled[located], bounds[:, located]
