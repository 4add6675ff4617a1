"""A set of OSM files, and the choice of the covering file for each crash."""

from __future__ import annotations

import json
import math
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
import shapely

from trace_dag.common.errors import Failure, Reason, Rejection, UserError, UserErrors
from trace_dag.common.geometry import FloatArray
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.clip import clip_roads, join_ways, neighbours
from trace_dag.osm.extraction import Around, FileHeader, FilePass, read_around, read_header
from trace_dag.osm.map_check import MapChecker
from trace_dag.osm.plausibility import UnreadableMapError, check_roads
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmNode, Site

OSM_SUFFIXES: Final = (".osm", ".osm.gz", ".osm.bz2", ".pbf")

_EARTH_RADIUS_M: Final = 6_371_008.8  # mean radius, IUGG; good to 0.3 %, for boxes and sentences only
_MARGIN_M: Final = 500.0
"""Beyond the box of each crash: osmium keeps a way by its nodes, and most roads have one within that distance."""
_BORDER_DEG: Final = 5e-5  # a few metres
_MIN_COS_LATITUDE: Final = 1e-3  # nearer the poles a box around a point spans all longitudes anyway


_File = TypeVar("_File")
_Read = TypeVar("_Read")


@dataclass(frozen=True)
class MapFile:
    """One OSM file, and its header."""

    path: Path
    header: FileHeader


@dataclass(frozen=True)
class MapCatalog:
    """OSM files from which maps are cut. ``unreadable`` has the reasons why other files of the set cannot be read."""

    files: tuple[MapFile, ...]
    unreadable: tuple[str, ...] = ()

    @classmethod
    def open(cls, paths: Iterable[Path | str]) -> MapCatalog:
        """Return the catalog of the files that :func:`map_files` finds.

        Raises one :class:`UserError` for all that are not OSM data.
        """
        return cls(tuple(_each(map_files(paths), lambda path: MapFile(path, read_header(path)))))

    @classmethod
    def checked(cls, paths: Iterable[Path | str]) -> MapCatalog:
        """Return the catalog of untrusted files, which are opened after :func:`check_maps` has read them."""
        check_maps(files := map_files(paths))
        return cls.open(files)

    @classmethod
    def of_registered(cls, files: Iterable[Path | Failure]) -> MapCatalog:
        """Return the catalog of registered files.

        A file that can no longer be read does not affect the others.
        """
        readable: list[MapFile] = []
        unreadable: list[str] = []
        for file in files:
            if isinstance(file, Failure):
                unreadable.append(str(file))
                continue
            try:
                readable.append(MapFile(file, read_header(file)))
            except UnreadableMapError as error:
                unreadable.append(_with_remedy(error, file))
        return cls(tuple(readable), tuple(unreadable))

    def extract(self, sites: Sequence[Site], settings: OsmSettings) -> dict[str, OsmExtract | Rejection | Failure]:
        """Return the roads in a box of ``settings.radius_m`` around each site, by site key.

        Each file is read once.

        A file covers a site if there is a way in the box of the site, cut from that file. Among several, the file whose
        own bounds hold the whole box is taken, then the one with most road in the box, then the newest, then the first
        by name. Files of neighbouring ground, which share nodes with it, are joined to it.

        A site that no file covers is rejected, with the distance to the nearest data. If a file that might cover it
        cannot be read to its end, the result is a failure that names the file.
        """
        boxes = {site.key: box_around(site, settings.radius_m) for site in sites if is_on_earth(site)}
        parts: dict[str, list[_Part]] = {site.key: [] for site in sites}
        nearest_m: dict[str, tuple[float, str]] = {}
        missing = {site.key: [*self.unreadable] for site in sites}
        around_km2 = (2e-3 * settings.radius_m) ** 2
        for file in self.files:
            wanted = [site for site in sites if site.key in boxes and may_cover(file.header, boxes[site.key])]
            bounds = file.header.box
            if wanted or bounds is None:
                around = [
                    Around(site.key, boxes[site.key], box_around(site, settings.surroundings_radius_m))
                    for site in wanted
                ]
                try:
                    found = read_around(file.path, file.header, around, settings)
                except UnreadableMapError as error:
                    for site in wanted:
                        missing[site.key].append(_with_remedy(error, file.path))
                    continue
                bounds = bounds or found.road_bounds
                for index, each in enumerate(around):
                    part = _Part(file, found, index, each.box)
                    try:
                        check_roads(part.extract, file.path, area_km2=around_km2, length_m=part.length_m)
                    except UnreadableMapError as error:
                        missing[each.key].append(_with_remedy(error, file.path))
                        continue
                    if part.extract.ways:
                        parts[each.key].append(part)
            if bounds is not None:
                for site in sites:
                    distance_m = _distance_m(site, bounds)
                    nearest_m[site.key] = min(nearest_m.get(site.key, (math.inf, "")), (distance_m, file.path.name))
        answers: dict[str, OsmExtract | Rejection | Failure] = {}
        for site in sites:
            if parts[site.key]:
                answers[site.key] = _joined(parts[site.key])
            elif missing[site.key] and is_on_earth(site):
                answers[site.key] = Failure("; ".join(missing[site.key]))
            else:
                answers[site.key] = self._no_coverage(site, nearest_m, settings)
        return answers

    @property
    def bounds(self) -> BoundingBox:
        """Return the box of all data in the files.

        Raises :class:`UserError` if they have no drivable way.
        """
        boxes = [box for _, box in self._boxes()]
        if not boxes:
            raise UserError(f"{', '.join(str(file.path) for file in self.files)}: no drivable way in it")
        return BoundingBox(
            south_deg=min(box.south_deg for box in boxes),
            west_deg=min(box.west_deg for box in boxes),
            north_deg=max(box.north_deg for box in boxes),
            east_deg=max(box.east_deg for box in boxes),
        )

    def _boxes(self) -> list[tuple[MapFile, BoundingBox]]:
        """Return files with their box: as stated, or else that of their roads; files without either are left out."""
        boxes = [
            (file, file.header.box or read_around(file.path, file.header, [], OsmSettings()).road_bounds)
            for file in self.files
        ]
        return [(file, box) for file, box in boxes if box is not None]

    def extract_box(self, box: BoundingBox, settings: OsmSettings, *, surroundings: bool) -> OsmExtract:
        """Return the roads in a box, from the file that covers it and its neighbours.

        ``surroundings`` adds the features beside them.

        Raises :class:`UserError`, with the distance to the nearest data, if no file has a drivable way there.
        """
        parts = []
        for file in self.files:
            if may_cover(file.header, box):
                around = [Around("", box, box)]
                found = read_around(file.path, file.header, around, settings, surroundings=surroundings)
                part = _Part(file, found, 0, box)
                check_roads(part.extract, file.path, area_km2=area_km2(box), length_m=part.length_m)
                if part.extract.ways:
                    parts.append(part)
        if parts:
            return _joined(parts)
        middle = Site("", (box.south_deg + box.north_deg) / 2, (box.west_deg + box.east_deg) / 2)
        nearest = [(_distance_m(middle, bounds), file.path.name) for file, bounds in self._boxes()]
        distance_m, name = min(nearest, default=(math.inf, ""))
        place = f"({middle.latitude_deg:.5f}, {middle.longitude_deg:.5f})"
        if not nearest:
            raise UserError(f"{', '.join(str(file.path) for file in self.files)}: no drivable way in it")
        if distance_m > 0:
            raise UserError(f"no map covers {place}: the nearest, {name}, ends {distance_m / 1000:.1f} km away")
        raise UserError(f"{name} covers {place} but has no drivable way in the box around it")

    def _no_coverage(self, site: Site, nearest_m: dict[str, tuple[float, str]], settings: OsmSettings) -> Rejection:
        place = f"({site.latitude_deg:.6f}, {site.longitude_deg:.6f})"
        distance_m, name = nearest_m.get(site.key, (math.inf, ""))
        if not is_on_earth(site):
            return Rejection(Reason.NO_MAP_COVERAGE, f"The reported point {place} is not a place on Earth.")
        if not math.isfinite(distance_m):
            return Rejection(Reason.NO_MAP_COVERAGE, f"There is no map data at all to look for {place} in.")
        if distance_m > 0:
            detail = f"No map covers {place}: the nearest, {name}, ends {distance_m / 1000:.1f} km away."
            return Rejection(Reason.NO_MAP_COVERAGE, detail, measured=distance_m, threshold=0.0)
        detail = f"{name} covers {place} but has no drivable way within {settings.radius_m:.0f} m of it."
        return Rejection(Reason.NO_MAP_COVERAGE, detail, measured=0.0, threshold=settings.radius_m)


def map_files(paths: Iterable[Path | str]) -> list[Path]:
    """Return the given files, and the OSM files in given folders and their subfolders.

    Their suffixes are ``.osm``, ``.osm.gz``, ``.osm.bz2`` and ``.pbf``.

    Raises :class:`UserError` for a path that does not exist, a folder without OSM files, or another suffix.
    """
    files: dict[Path, None] = {}
    for path in map(Path, paths):
        if path.is_dir():
            found = sorted(file for file in path.rglob("*") if file.name.endswith(OSM_SUFFIXES) and file.is_file())
            if not found:
                raise UserError(f"{path}: no OSM file in this folder; expected {', '.join(OSM_SUFFIXES)}")
            files.update(dict.fromkeys(found))
        elif not path.is_file():
            raise UserError(f"{path}: no such file or folder; expected OSM data ({', '.join(OSM_SUFFIXES)})")
        elif not path.name.endswith(OSM_SUFFIXES):
            raise UserError(f"{path}: not an OSM file by its name; expected one ending in {', '.join(OSM_SUFFIXES)}")
        else:
            files[path] = None
    return [*files]


def check_maps(files: Iterable[Path]) -> None:
    """Read each file to its end, within limits. Raises :class:`UserError` that names all unreadable files."""
    with MapChecker() as checker:
        _each(files, checker.check)


def _each(files: Iterable[_File], read: Callable[[_File], _Read]) -> list[_Read]:
    """Read each file. Raise :class:`UserError` that names all that cannot be read."""
    found: list[_Read] = []
    unreadable: list[UserError] = []
    for file in files:
        try:
            found.append(read(file))
        except UserError as error:
            unreadable.append(error)
    if len(unreadable) == 1:
        raise unreadable[0]
    if unreadable:
        raise UserErrors(map(str, unreadable))
    return found


def _with_remedy(error: UnreadableMapError, path: Path) -> str:
    file = shlex.quote(str(path))
    return f"{error}; mend it and ingest it again, or leave it out: trace-dag cohort maps --drop {file}"


def box_around(site: Site, radius_m: float) -> BoundingBox:
    """Return the box reaching ``radius_m`` from a site in each direction, cut off at the poles and at 180 degrees.

    >>> box = box_around(Site("a place", 0.0, -101.5), 1113.2)  # a degree of the equator is 111.32 km
    >>> round(box.north_deg, 4), round(box.east_deg, 4)
    (0.01, -101.49)
    """
    lat_deg = math.degrees(radius_m / _EARTH_RADIUS_M)
    lon_deg = lat_deg / max(math.cos(math.radians(site.latitude_deg)), _MIN_COS_LATITUDE)
    return BoundingBox(
        south_deg=max(site.latitude_deg - lat_deg, -90.0),
        west_deg=max(site.longitude_deg - lon_deg, -180.0),
        north_deg=min(site.latitude_deg + lat_deg, 90.0),
        east_deg=min(site.longitude_deg + lon_deg, 180.0),
    )


def osmium_config(sites: Iterable[Site], radius_m: float, output: str) -> str:
    """Return, as JSON, a configuration that cuts one file, ``output``, around sites by ``radius_m`` and a margin.

    >>> config = json.loads(osmium_config([Site("2023-319003", 41.8, -101.5)], 300.0, "crashes.osm.pbf"))
    >>> (area,) = config["extracts"]
    >>> area["output"], [len(ring) for polygon in area["multipolygon"] for ring in polygon]
    ('crashes.osm.pbf', [5])
    """
    boxes = [box_around(site, radius_m + _MARGIN_M) for site in sites]
    areas = shapely.union_all([shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes])
    polygons = [
        [list(ring.coords) for ring in (polygon.exterior, *polygon.interiors)] for polygon in shapely.get_parts(areas)
    ]
    return json.dumps({"extracts": [{"output": output, "multipolygon": polygons}]})


def sides_m(box: BoundingBox) -> tuple[float, float]:
    """Return width and height of a box (metres).

    >>> width_m, height_m = sides_m(BoundingBox(60.0, 10.0, 60.01, 10.02))  # a degree east is half as long there
    >>> round(width_m), round(height_m)
    (1112, 1112)
    """
    middle_rad = math.radians((box.south_deg + box.north_deg) / 2)
    width_rad, height_rad = math.radians(box.east_deg - box.west_deg), math.radians(box.north_deg - box.south_deg)
    return _EARTH_RADIUS_M * width_rad * math.cos(middle_rad), _EARTH_RADIUS_M * height_rad


def area_km2(box: BoundingBox) -> float:
    """Return the area of a box (square kilometres)."""
    width_m, height_m = sides_m(box)
    return width_m * height_m / 1e6


class _Part:
    """The part of one file around one site."""

    def __init__(self, file: MapFile, found: FilePass, index: int, box: BoundingBox) -> None:
        self.file, self.box = file, box
        self.ways = found.ways[index]
        self.node_tags = found.node_tags
        self.restrictions = {
            relation.id: relation for way_id in self.ways for relation in found.restrictions_of.get(way_id, ())
        }
        self.extract = _cut([self])
        self.length_m = _road_length_m(self.extract)
        self.surroundings = found.surroundings(index) if self.extract.ways else ()

    @property
    def rank(self) -> tuple[bool, int, str]:
        """Return the rank of a file by three criteria: its bounds contain the whole box, length of road, date."""
        bounds, box = self.file.header.box, self.box
        whole = bounds is not None and (
            bounds.contains(box.south_deg, box.west_deg) and bounds.contains(box.north_deg, box.east_deg)
        )
        return whole, round(self.length_m), self.file.header.timestamp


def _joined(parts: Sequence[_Part]) -> OsmExtract:
    """Return the extract of the best part, joined with those of neighbouring files."""
    best, *others = sorted(
        sorted(parts, key=lambda part: part.file.path.name), key=lambda part: part.rank, reverse=True
    )
    chosen = [best, *(others[number] for number in neighbours(best.ways, [part.ways for part in others]))]
    extract = best.extract if len(chosen) == 1 else _cut(chosen)
    things = {thing.id: thing for part in reversed(chosen) for thing in part.surroundings}
    surroundings = best.surroundings if len(chosen) == 1 else tuple(things.values())
    return replace(extract, nodes=_with_data_ends(extract, chosen), surroundings=surroundings)


def _cut(parts: Sequence[_Part]) -> OsmExtract:
    first, ways = parts[0], join_ways(part.ways for part in parts)
    node_tags = {node_id: tags for part in reversed(parts) for node_id, tags in part.node_tags.items()}
    restrictions = {number: relation for part in parts for number, relation in part.restrictions.items()}
    roads = clip_roads(first.box, ways.values(), node_tags, restrictions.values())
    return OsmExtract(
        box=first.box,
        nodes=roads.nodes,
        ways=roads.ways,
        relations=roads.relations,
        walkways=roads.walkways,
        source=", ".join(part.file.path.name for part in parts),
        data_timestamp=first.file.header.timestamp,
        attribution="; ".join(dict.fromkeys(part.file.header.attribution for part in parts)),
    )


def _with_data_ends(extract: OsmExtract, parts: Sequence[_Part]) -> dict[int, OsmNode]:
    """Return the nodes, marking those at which a road ends on the border of all files, where the data end."""
    bounds = [part.file.header.box for part in parts]
    if None in bounds:
        return extract.nodes
    ends = Counter(end for way in extract.ways for end in (way.node_ids[0], way.node_ids[-1]))
    nodes = dict(extract.nodes)
    for node_id, uses in ends.items():
        node = nodes[node_id]
        if uses == 1 and not any(box is not None and _is_within(box, node) for box in bounds):
            nodes[node_id] = node._replace(clipped=True)
    return nodes


def _is_within(box: BoundingBox, node: OsmNode) -> bool:
    """Return whether a node lies in a box, more than a few metres from its border."""
    return (
        box.south_deg + _BORDER_DEG < node.latitude_deg < box.north_deg - _BORDER_DEG
        and box.west_deg + _BORDER_DEG < node.longitude_deg < box.east_deg - _BORDER_DEG
    )


def may_cover(header: FileHeader, box: BoundingBox) -> bool:
    """Return whether a file may have data in a box, by its stated bounds."""
    bounds = header.box
    return bounds is None or (
        bounds.south_deg <= box.north_deg
        and bounds.north_deg >= box.south_deg
        and bounds.west_deg <= box.east_deg
        and bounds.east_deg >= box.west_deg
    )


def is_on_earth(site: Site) -> bool:
    """Return whether a site has coordinates that any place has.

    >>> is_on_earth(Site("a place", 41.8, -101.5)), is_on_earth(Site("FARS has no place", 99.9999, 999.9999))
    (True, False)
    """
    return abs(site.latitude_deg) <= 90 and abs(site.longitude_deg) <= 180


def _road_length_m(extract: OsmExtract) -> float:
    nodes = extract.nodes
    ids = [node_id for way in extract.ways for node_id in way.node_ids]
    latitudes, longitudes = (
        np.radians([(nodes[node_id].latitude_deg, nodes[node_id].longitude_deg) for node_id in ids]).reshape(-1, 2).T
    )
    within = np.ones(max(len(ids) - 1, 0), dtype=bool)  # false from the last node of a way to the first of the next
    within[np.cumsum([len(way.node_ids) for way in extract.ways], dtype=np.int64)[:-1] - 1] = False
    return float(_great_circle_m(latitudes[:-1], longitudes[:-1], latitudes[1:], longitudes[1:])[within].sum())


def _distance_m(site: Site, box: BoundingBox) -> float:
    """Return the distance from a site to a box, 0 inside."""
    latitude_deg = min(max(site.latitude_deg, box.south_deg), box.north_deg)
    longitude_deg = min(max(site.longitude_deg, box.west_deg), box.east_deg)
    places = np.radians([site.latitude_deg, site.longitude_deg, latitude_deg, longitude_deg])
    return float(_great_circle_m(*places))


def _great_circle_m(lat_1: FloatArray, lon_1: FloatArray, lat_2: FloatArray, lon_2: FloatArray) -> FloatArray:
    """Return distances on the sphere between places in radians, (n,) (haversine)."""
    a = np.sin((lat_2 - lat_1) / 2) ** 2
    b = np.cos(lat_1) * np.cos(lat_2) * np.sin((lon_2 - lon_1) / 2) ** 2
    distances_m: FloatArray = 2 * _EARTH_RADIUS_M * np.arcsin(np.minimum(1.0, np.sqrt(a + b)))
    return distances_m
