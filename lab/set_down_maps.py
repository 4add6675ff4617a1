"""Maps for made crashes: pieces of the shared extracts, set down where the crashes are said to be.

Each crash gets a piece of real OpenStreetMap around a point on a road of the class its record names, at a junction or
between junctions as in the record, moved to the crash's own coordinates and stretched along the parallels so that
lengths stay. The record then names that road. All pieces are one file with ids of its own, as a country's file is.
"""

from __future__ import annotations

import math
import random
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import osmium
import shapely

from lab.made_records import MadeCrash
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site

# Roads by FUNC_SYS (FHWA functional classes) in OpenStreetMap, as the wiki's page on highways in the US has them.
_CLASSES = {
    "motorway": "1",
    "trunk": "2",
    "primary": "3",
    "secondary": "4",
    "tertiary": "5",
    "unclassified": "6",
    "residential": "7",
}
_ANCHORS = 60  # different places for each class of road at most
_CUT = OsmSettings(radius_m=450.0, surroundings_radius_m=250.0)  # more than a run cuts out of it
_MPH = " mph"


@dataclass(frozen=True)
class Anchor:
    """A point on a road of an extract: the names of the road and the one it meets, and its speed limit in mph."""

    site: Site
    road_class: str
    at_junction: bool
    name: str
    other_name: str
    limit_mph: str


def set_down(crashes: Sequence[MadeCrash], extracts: Path, file: Path, seed: int = 1) -> int:
    """Write ``file`` (.osm.pbf) with a piece of map for each crash, and the names of its roads into the records.

    Crashes on roads of a class of which the extracts have no road keep their record and get no map; how many got one.
    """
    draw = random.Random(seed)
    anchors = _anchors(sorted(extracts.glob("*.osm.pbf")), draw)
    catalog = MapCatalog.open([extracts])
    chosen: list[tuple[MadeCrash, Anchor]] = []
    for crash in crashes:
        fitting = anchors.get((crash.road_class, crash.at_junction))
        if fitting:
            chosen.append((crash, draw.choice(fitting)))
    pieces = catalog.extract(list({anchor.site.key: anchor.site for _, anchor in chosen}.values()), _CUT)
    done = []
    for crash, anchor in chosen:
        piece = pieces[anchor.site.key]
        if isinstance(piece, OsmExtract):
            _name(crash, anchor)
            done.append((crash, anchor, piece))
    _write(done, file)
    return len(done)


def _name(crash: MadeCrash, anchor: Anchor) -> None:
    row = crash.accident
    row["TWAY_ID"], row["TWAY_ID2"] = anchor.name.upper(), anchor.other_name.upper() if crash.at_junction else ""
    if anchor.limit_mph:
        for vehicle in crash.tables["vehicle"]:
            vehicle["VSPD_LIM"] = anchor.limit_mph


def _anchors(files: Sequence[Path], draw: random.Random) -> dict[tuple[str, bool], list[Anchor]]:
    """Return points on named roads by class and whether a junction is there, some of each file."""
    found: dict[tuple[str, bool], list[Anchor]] = defaultdict(list)
    for file in files:
        roads: list[tuple[dict[str, str], list[tuple[int, float, float]]]] = []
        filtered = osmium.FileProcessor(str(file)).with_locations().with_filter(osmium.filter.KeyFilter("highway"))
        for way in filtered.with_filter(osmium.filter.EntityFilter(osmium.osm.WAY)):
            if not isinstance(way, osmium.osm.Way):
                continue
            tags = dict(way.tags)
            if tags.get("highway") in _CLASSES and (tags.get("name") or tags.get("ref")):
                roads.append((tags, [(node.ref, node.lat, node.lon) for node in way.nodes if node.location.valid()]))
        names: dict[int, set[str]] = defaultdict(set)
        uses: Counter[int] = Counter()
        for tags, nodes in roads:
            for number, _, _ in nodes:
                names[number].add(_road_name(tags))
                uses[number] += 1
        draw.shuffle(roads)
        for tags, nodes in roads:
            number, latitude_deg, longitude_deg = draw.choice(nodes)
            name = _road_name(tags)
            others = sorted(names[number] - {name})
            at_junction = bool(others)
            if uses[number] > 1 and not at_junction:
                continue  # where a road goes on as another way
            of_kind = found[_CLASSES[tags["highway"]], at_junction]
            if sum(anchor.site.key.startswith(file.stem) for anchor in of_kind) < _ANCHORS // len(files) + 1:
                limit = tags.get("maxspeed", "")
                of_kind.append(
                    Anchor(
                        Site(f"{file.stem}-{number}", latitude_deg, longitude_deg),
                        _CLASSES[tags["highway"]],
                        at_junction,
                        name,
                        others[0] if others else "",
                        limit.removesuffix(_MPH) if limit.endswith(_MPH) else "",
                    )
                )
    return found


def _road_name(tags: dict[str, str]) -> str:
    return tags.get("name") or tags.get("ref", "")


def _write(pieces: Sequence[tuple[MadeCrash, Anchor, OsmExtract]], file: Path) -> None:
    """Write nodes, then ways, then relations, all in order of ids that count up from 1."""
    file.unlink(missing_ok=True)
    header = osmium.io.Header()
    header.set("generator", "trace-dag lab")
    header.set("sorting", "Type_then_ID")
    nodes = ways = relations = 0
    later: list[tuple[list[osmium.osm.mutable.Way], list[osmium.osm.mutable.Relation]]] = []
    with osmium.SimpleWriter(str(file), header=header) as writer:
        for crash, anchor, piece in pieces:
            down = _Down(crash, anchor)
            numbers: dict[int, int] = {}
            for node in piece.nodes.values():
                nodes += 1
                numbers[node.id] = nodes
                writer.add_node(_node(nodes, down.of(node.longitude_deg, node.latitude_deg), dict(node.tags)))
            own_ways, own_relations, way_numbers = [], [], {}
            for way in (*piece.ways, *piece.walkways):
                ways += 1
                way_numbers[way.id] = ways
                refs = [numbers[each] for each in way.node_ids]
                own_ways.append(osmium.osm.mutable.Way(id=ways, version=1, nodes=refs, tags=dict(way.tags)))
            for feature in piece.surroundings:
                if isinstance(feature.geometry, shapely.Point):
                    nodes += 1
                    writer.add_node(_node(nodes, down.of(feature.geometry.x, feature.geometry.y), dict(feature.tags)))
                    continue
                for line in _lines(feature.geometry):
                    refs = []
                    closed = len(line) > 3 and line[0] == line[-1]
                    for place in line[:-1] if closed else line:
                        nodes += 1
                        refs.append(nodes)
                        writer.add_node(_node(nodes, down.of(*place), {}))
                    ways += 1
                    refs += refs[:1] if closed else []
                    own_ways.append(osmium.osm.mutable.Way(id=ways, version=1, nodes=refs, tags=dict(feature.tags)))
            for relation in piece.relations:
                relations += 1
                members = [
                    (each.type[0], (way_numbers if each.type == "way" else numbers)[each.id], each.role)
                    for each in relation.members
                ]
                own_relations.append(
                    osmium.osm.mutable.Relation(id=relations, version=1, members=members, tags=relation.tags)
                )
            later.append((own_ways, own_relations))
        for own_ways, _ in later:
            for each_way in own_ways:
                writer.add_way(each_way)
        for _, own_relations in later:
            for each_relation in own_relations:
                writer.add_relation(each_relation)


class _Down:
    """The place at the crash of a point of an anchor's piece: longitude, latitude, degrees."""

    def __init__(self, crash: MadeCrash, anchor: Anchor) -> None:
        self._crash, self._site = crash, anchor.site
        self._stretch = math.cos(math.radians(anchor.site.latitude_deg)) / math.cos(math.radians(crash.latitude_deg))

    def of(self, longitude_deg: float, latitude_deg: float) -> tuple[float, float]:
        """Return the place, where the anchor lies on the crash's reported point."""
        return (
            self._crash.longitude_deg + (longitude_deg - self._site.longitude_deg) * self._stretch,
            self._crash.latitude_deg + latitude_deg - self._site.latitude_deg,
        )


def _lines(geometry: shapely.Geometry) -> Iterator[list[tuple[float, float]]]:
    for part in shapely.get_parts(geometry):
        ring = part.exterior if isinstance(part, shapely.Polygon) else part
        if isinstance(ring, shapely.LineString):
            yield [(x, y) for x, y in ring.coords]


def _node(number: int, place: tuple[float, float], tags: dict[str, str]) -> osmium.osm.mutable.Node:
    return osmium.osm.mutable.Node(id=number, version=1, location=place, tags=tags)
