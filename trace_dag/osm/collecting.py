"""Keeps the ways near sites, and what belongs to them, from the lines that libosmium copied out of a map file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import BinaryIO, Final

import numpy as np
import shapely

from trace_dag.osm import opl
from trace_dag.osm.drivable import is_drivable
from trace_dag.osm.near_lines import NearLines, NearWays
from trace_dag.osm.surroundings import feature_of_node, features_of_ways, is_thing
from trace_dag.osm.types import BoundingBox, OsmFeature, OsmRelation, RawWay
from trace_dag.osm.walkways import is_walkway

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Gates,
# addresses and trees that share a node with a way say nothing about the road.
ROAD_NODE_KEYS: Final = frozenset(
    {"highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele"}
)


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
        return (*self.points[index], *features_of_ways([*self.things[index].values()], self.nearer[index]))


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
        self.near = NearLines(boxes, nearer, service_roads=service_roads, measure_bounds=measure_bounds)
        self._boxes = boxes
        self._nearer = nearer
        self._service_roads = service_roads
        self._node_lines: list[bytes] = []
        self._restriction_lines: list[bytes] = []  # a fifth of what they take as objects
        self.forget_ways()

    def forget_ways(self) -> None:
        """They will all be read once more."""
        self._ways: list[dict[int, RawWay]] = [{} for _ in self._boxes]
        self._things: list[dict[int, RawWay]] = [{} for _ in self._nearer]
        self.near.bounds_deg.clear()

    def read(self, copied: BinaryIO) -> None:
        """Read the lines of a copy."""
        for lines in opl.read_lines(copied):
            nodes = lines.of_kind("n")  # those in the boxes: a country has tens of millions with tags
            self._node_lines += nodes.some(np.unique(self.near.of_nodes(nodes)[0]))
            for near in self.near.of_ways(lines.of_kind("w")):
                self._keep(near)
            self._restriction_lines += lines.of_kind("r")

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
        if self.near.bounds_deg:
            bounds = np.array(self.near.bounds_deg)
            (west, south), (east, north) = bounds[:, :2].min(axis=0).tolist(), bounds[:, 2:].max(axis=0).tolist()
            found.road_bounds = BoundingBox(south, west, north, east)
        found.things, found.nearer = self._things, self._nearer
        if self._nearer:
            found.points = self._points()
        return found

    def _points(self) -> list[list[OsmFeature]]:
        points: list[list[OsmFeature]] = [[] for _ in self._nearer]
        x_deg, y_deg = opl.Lines.of(b"".join(self._node_lines)).node_places()
        near, sites = self.near.nearer_areas.query(shapely.points(x_deg, y_deg))
        for index, site in zip(near.tolist(), sites.tolist(), strict=True):
            line = self._node_lines[index]
            if is_thing(tags := opl.read_tags(line), way=False):
                points[site].append(feature_of_node(opl.read_id(line), x_deg[index], y_deg[index], tags))
        return points

    def _keep(self, near: NearWays) -> None:
        """Keep those that are wanted by their tags too, for each site they are near."""
        kept: Sequence[dict[int, RawWay]] = self._ways if near.roads else self._things
        is_wanted: Callable[[Mapping[str, str]], bool] = self._is_road if near.roads else partial(is_thing, way=True)
        ways = _read_ways(near, is_wanted)
        for number, site in zip(near.numbers.tolist(), near.sites.tolist(), strict=True):
            if (way := ways.get(number)) is not None:
                kept[site][way.id] = way

    def _is_road(self, tags: Mapping[str, str]) -> bool:
        return is_drivable(tags, service_roads=self._service_roads) or is_walkway(tags)


def _read_ways(near: NearWays, is_wanted: Callable[[Mapping[str, str]], bool]) -> dict[int, RawWay]:
    """Those of the near ways that are wanted by their tags too, by their number among the lines."""
    nodes, wanted = near.nodes, np.unique(near.numbers)
    chosen = np.zeros(len(near.lines), dtype=bool)
    chosen[wanted] = True
    of_wanted = np.repeat(chosen, nodes.counts)
    # Copies: what is kept of a batch must not keep all of it in memory.
    ids, x_deg, y_deg = nodes.ids[of_wanted], nodes.longitudes_deg[of_wanted], nodes.latitudes_deg[of_wanted]
    ends = np.cumsum(nodes.counts[wanted])
    starts = ends - nodes.counts[wanted]
    ways = {}
    for index, line, start, end in zip(
        wanted.tolist(), near.lines.some(wanted), starts.tolist(), ends.tolist(), strict=True
    ):
        tags = opl.read_tags(line)
        if is_wanted(tags):
            ways[index] = RawWay(opl.read_id(line), ids[start:end], x_deg[start:end], y_deg[start:end], tags)
    return ways
