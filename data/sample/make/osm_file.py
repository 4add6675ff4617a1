"""From roads to an OSM file: shared nodes at crossings, ways split where their tags change, relations, XML."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import numpy as np

from make.plane import TOWN, FloatArray, plane_point
from make.roads import Road

FIRST_NODE, FIRST_WAY, FIRST_RELATION = 9_100_000_001, 1_100_000_001, 15_000_001
TIMESTAMPS = ("2021-06-14T15:02:11Z", "2022-03-08T20:41:57Z", "2022-10-27T04:18:30Z", "2023-02-19T17:33:05Z")
Tags = dict[str, str]


@dataclass
class _Way:
    nodes: list[int]
    tags: Tags
    road: str = ""
    id: int = 0


@dataclass
class _Restriction:
    kind: str
    via: int
    from_road: tuple[str, int]  # road and direction (+1 along, -1 against) on which one comes
    to_road: tuple[str, int]


@dataclass
class OsmFile:
    """Collects map elements and writes them as OSM XML."""

    nodes: dict[int, tuple[FloatArray, Tags]] = field(default_factory=dict)
    ways: list[_Way] = field(default_factory=list)
    on_road: dict[str, dict[float, int]] = field(default_factory=dict)  # road key -> station -> node
    _roads: dict[str, Road] = field(default_factory=dict)
    _restrictions: list[_Restriction] = field(default_factory=list)

    def node(self, xy: FloatArray, **tags: str) -> int:
        """A node at a point of the town plane."""
        number = FIRST_NODE + len(self.nodes)
        self.nodes[number] = (xy, {k.replace("__", ":"): v for k, v in tags.items()})
        return number

    def add_road(self, road: Road) -> None:
        """Register a road; its ways are made by :meth:`finish_roads`, when all its crossings are known."""
        self._roads[road.key] = road
        self.on_road[road.key] = {}

    def join(self, u_m: float, v_m: float, *roads: str, **tags: str) -> int:
        """One node shared by roads that cross or meet at a point of the plan."""
        xy = plane_point(u_m, v_m)
        number = self.node(xy, **tags)
        for key in roads:
            curve = self._roads[key].curve
            if curve.distance(xy) > 0.05:
                raise ValueError(f"{key} passes {curve.distance(xy):.2f} m from ({u_m}, {v_m})")
            self.on_road[key][curve.station(xy)] = number
        return number

    def mark(self, road: str, u_m: float, v_m: float, **tags: str) -> None:
        """A tagged node on a road (signal, stop sign, crossing) at the station nearest to a point of the plan."""
        curve = self._roads[road].curve
        station = curve.station(plane_point(u_m, v_m))
        self.on_road[road][station] = self.node(curve.point(station), **tags)

    def restrict(self, kind: str, via: int, from_road: tuple[str, int], to_road: tuple[str, int]) -> None:
        """A turn restriction; the ways are split at its via node."""
        for key, _ in (from_road, to_road):
            road = self._roads[key]
            station = next(s for s, node in self.on_road[key].items() if node == via)
            if 1.0 < station < road.curve.length - 1.0 and station not in road.cuts:
                road.cuts.append(station)
        self._restrictions.append(_Restriction(kind, via, from_road, to_road))

    def area(self, uv: list[tuple[float, float]], **tags: str) -> None:
        """A closed way that is not a road: a building, a parking lot."""
        ids = [self.node(plane_point(u, v)) for u, v in uv]
        self.ways.append(_Way([*ids, ids[0]], {k.replace("__", ":"): v for k, v in tags.items()}))

    def line(self, uv: list[tuple[float, float]], **tags: str) -> None:
        """An open way that is not a road: a footway, a railway, a fence."""
        ids = [self.node(plane_point(u, v)) for u, v in uv]
        self.ways.append(_Way(ids, {k.replace("__", ":"): v for k, v in tags.items()}))

    def finish_roads(self) -> None:
        """Make the ways of all roads."""
        for road in self._roads.values():
            self._finish(road)

    def _finish(self, road: Road) -> None:
        stations = self.on_road[road.key]
        breaks = [s for s, _ in road.sections if s < road.curve.length - 0.5] + road.cuts
        vertices = road.mapped[:-1] if road.closed else road.mapped
        wanted = sorted({*breaks, *(road.curve.station(xy) for xy in vertices)})
        for station in wanted:
            near = next((s for s in stations if abs(s - station) < 1.0), None)
            if near is None:
                stations[station] = self.node(road.curve.point(station))
        order = sorted(stations)
        ids = [stations[s] for s in order]
        if road.closed:
            order, ids = [*order, road.curve.length], [*ids, ids[0]]
        ends = sorted({min(range(len(order)), key=lambda i, b=b: abs(order[i] - b)) for b in breaks})
        for first, last in zip([0, *ends], [*ends, len(order) - 1], strict=True):
            middle = (order[first] + order[last]) / 2
            self.ways.append(_Way(ids[first : last + 1], road.tags_at(middle), road.key))

    def _way_at(self, via: int, road: tuple[str, int], arriving: bool) -> int:
        """The way of ``road`` that ends (or begins) at ``via`` for someone driving in the given direction."""
        key, direction = road
        before = arriving == (direction > 0)
        for way in self.ways:
            if way.road == key and (way.nodes[-1] if before else way.nodes[0]) == via:
                return way.id
        raise ValueError(f"no way of {key} at node {via}")

    def xml(self) -> bytes:
        """The file, byte for byte the same on every run."""
        for i, way in enumerate(self.ways):
            way.id = FIRST_WAY + i
        used = {n for way in self.ways for n in way.nodes}
        order = [n for n in sorted(self.nodes) if n in used or self.nodes[n][1]]
        degrees = np.round(TOWN.to_degrees(np.array([self.nodes[n][0] for n in order])), 7)
        (south, west), (north, east) = degrees.min(0), degrees.max(0)
        out = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<osm version="0.6" generator="make_sample.py" copyright="fictional, CC0">',
            f'  <bounds minlat="{south:.7f}" minlon="{west:.7f}" maxlat="{north:.7f}" maxlon="{east:.7f}"/>',
        ]
        for number, (lat, lon) in zip(order, degrees, strict=True):
            head = f'  <node id="{number}" {_meta(number)} lat="{lat:.7f}" lon="{lon:.7f}"'
            out += _element(head, "node", [], self.nodes[number][1])
        for way in self.ways:
            refs = [f'    <nd ref="{n}"/>' for n in way.nodes]
            out += _element(f'  <way id="{way.id}" {_meta(way.id)}', "way", refs, way.tags)
        for i, r in enumerate(self._restrictions):
            number = FIRST_RELATION + i
            members = [
                f'    <member type="way" ref="{self._way_at(r.via, r.from_road, True)}" role="from"/>',
                f'    <member type="node" ref="{r.via}" role="via"/>',
                f'    <member type="way" ref="{self._way_at(r.via, r.to_road, False)}" role="to"/>',
            ]
            tags = {"restriction": r.kind, "type": "restriction"}
            out += _element(f'  <relation id="{number}" {_meta(number)}', "relation", members, tags)
        return ("\n".join([*out, "</osm>"]) + "\n").encode()


def _meta(number: int) -> str:
    version = 1 + number % 4
    return (
        f'visible="true" version="{version}" changeset="{130_000_000 + number % 977}" '
        f'timestamp="{TIMESTAMPS[number % 4]}" user="sample-mapper" uid="1000001"'
    )


def _element(head: str, name: str, inner: list[str], tags: Tags) -> list[str]:
    inner = inner + [f"    <tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in sorted(tags.items())]
    return [head + ">", *inner, f"  </{name}>"] if inner else [head + "/>"]
