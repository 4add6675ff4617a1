"""Maps from the public OSM services: Overpass (several endpoints, one after the other) and the OSM API.

Both answer a box with OSM XML that holds every way in it whole. Every answer is checked before it is used or cached:
Overpass reports a query that ran out of time or memory as a ``remark`` inside an answer with status 200. All requests
go through :class:`trace_dag.common.network.http.HttpClient`. For more than a few hundred crashes, download extracts of
the states and use :class:`trace_dag.osm.catalog.MapCatalog`, which needs one pass instead of a request per crash.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol, TypeAlias

import numpy as np

from trace_dag.common.errors import Failure, Reason, Rejection, TransientFailure, UserError
from trace_dag.common.network.http import HttpClient, UnreachableError
from trace_dag.common.settings import OsmSettings, ServiceSettings
from trace_dag.osm.catalog import box_around, is_on_earth
from trace_dag.osm.clip import clip_roads
from trace_dag.osm.extraction import RESTRICTION_KEYS
from trace_dag.osm.road_classes import DRIVABLE_HIGHWAYS, WALKWAY_TAGS, is_drivable, is_walkway
from trace_dag.osm.surroundings import NODE_KEYS, WAY_KEYS, feature_of_node, features_of_ways, is_thing
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmFeature, OsmWay, RawWay, Site
from trace_dag.osm.xml import read_osm

OVERPASS_ENDPOINTS: Final = (
    "https://overpass-api.de/api/interpreter",
    "https://overpass.private.coffee/api/interpreter",
    "https://maps.mail.ru/osm/tools/overpass/api/interpreter",
)
OSM_API: Final = "https://api.openstreetmap.org/api/0.6"

_OVERPASS_TIMEOUT_S: Final = 90
_REMARK: Final = re.compile(rb"<remark>\s*([^<]*error[^<]*)</remark>", re.IGNORECASE)
_OSM_ROOT: Final = re.compile(rb"<osm[\s>]")
_HEAD_BYTES: Final = 2048


class MapSource(Protocol):
    """Sources of extracts: files, or one of the services."""

    def extract(self, sites: Sequence[Site], settings: OsmSettings) -> dict[str, OsmExtract | Rejection]:
        """Return the roads around each site by its key, or the reason why there are none."""
        ...


@dataclass(frozen=True)
class OverpassSource:
    """Overpass. If an endpoint gives no right answer, the next one is asked."""

    http: HttpClient
    endpoints: tuple[str, ...] = OVERPASS_ENDPOINTS

    def extract(self, sites: Sequence[Site], settings: OsmSettings) -> dict[str, OsmExtract | Rejection]:
        """Return the extract of each site, from one request per site.

        Raises the last endpoint's :class:`TransientFailure` or :class:`Failure`.
        """
        return {site.key: _extract(site, settings, self._download, "Overpass") for site in sites}

    def extract_box(self, box: BoundingBox, settings: OsmSettings, *, surroundings: bool) -> OsmExtract:
        """Return the roads in a box from one request; ``surroundings`` adds the features beside them.

        Raises :class:`UserError` if there are no roads.
        """
        beside = box if surroundings else BoundingBox(box.south_deg, box.west_deg, box.south_deg, box.west_deg)
        found = _extract_box(box, beside, settings, self._download, "Overpass")
        if not found.ways:
            raise UserError("Overpass has no drivable way in this box")
        return found

    def _download(self, box: BoundingBox, nearer: BoundingBox) -> bytes:
        query = {"data": _overpass_query(box, nearer)}
        failures: list[Failure] = []
        for endpoint in self.endpoints:
            try:
                return self.http.post(endpoint, query, check=whats_wrong)
            except Failure as failure:
                failures.append(failure)
        if all(isinstance(failure, UnreachableError) for failure in failures):
            raise failures[0]
        said = "; ".join(str(failure) for failure in failures)
        kind = TransientFailure if any(isinstance(failure, TransientFailure) for failure in failures) else Failure
        raise kind(f"no Overpass endpoint answered: {said}")


@dataclass(frozen=True)
class OsmApiSource:
    """The OSM API, which is meant for editing: for a handful of crashes."""

    http: HttpClient
    url: str = OSM_API

    def extract(self, sites: Sequence[Site], settings: OsmSettings) -> dict[str, OsmExtract | Rejection]:
        """Return the extract of each site, from one request per site.

        Raises the service's :class:`TransientFailure` or :class:`Failure`.
        """
        return {site.key: _extract(site, settings, self._download, "the OSM API") for site in sites}

    def _download(self, box: BoundingBox, nearer: BoundingBox) -> bytes:
        corners = (box.west_deg, box.south_deg, box.east_deg, box.north_deg)
        bbox = ",".join(f"{corner:.7f}" for corner in corners)
        return self.http.get(f"{self.url}/map", {"bbox": bbox}, check=whats_wrong)


class MapSourceFactory(Protocol):
    """A package's map source (entry points of the group ``trace_dag.map_sources``)."""

    def __call__(self, settings: ServiceSettings, http: HttpClient) -> MapSource:
        """Return the source by the settings.

        All its requests go through ``http``, which keeps the rate and caches answers.
        """
        ...


def overpass_source(settings: ServiceSettings, http: HttpClient) -> OverpassSource:
    """Return the overpass, at the endpoints of the settings.

    >>> settings = ServiceSettings(overpass_urls=("https://overpass.example/api/interpreter",))
    >>> overpass_source(settings, HttpClient()).endpoints
    ('https://overpass.example/api/interpreter',)
    """
    return OverpassSource(http, settings.overpass_urls or OVERPASS_ENDPOINTS)


def osm_api_source(settings: ServiceSettings, http: HttpClient) -> OsmApiSource:
    """Return the OSM API, at the address of the settings.

    >>> osm_api_source(ServiceSettings(osm_api_url="https://api.example/0.6/"), HttpClient()).url
    'https://api.example/0.6'
    """
    return OsmApiSource(http, (settings.osm_api_url or OSM_API).rstrip("/"))


_Download: TypeAlias = Callable[[BoundingBox, BoundingBox], bytes]
"""Fetches the roads of a box, and the features of a nearer one."""


def _overpass_query(box: BoundingBox, nearer: BoundingBox) -> str:
    """Return the Overpass QL for the roads, walkways, nodes and restrictions of a box.

    It also requests the features beside roads in a ``nearer`` box.
    """
    bbox, nearer_bbox = _corners(box), _corners(nearer)
    classes = "|".join(sorted(DRIVABLE_HIGHWAYS))
    walkways = "".join(f'way["{key}"="{value}"]({bbox});' for key, value in WALKWAY_TAGS)
    things = f'way[~"^({"|".join(WAY_KEYS)})$"~"."]({nearer_bbox});'
    points = f'node[~"^({"|".join(NODE_KEYS)})$"~"."]({nearer_bbox});'
    return (
        f'[out:xml][timeout:{_OVERPASS_TIMEOUT_S}];(way["highway"~"^({classes})$"]({bbox});{walkways})->.roads;'
        f'({things})->.things;(node(w.roads);.roads;rel(bw.roads)["type"="restriction"];'
        f"node(w.things);.things;{points});out body;"
    )


def _corners(box: BoundingBox) -> str:
    return ",".join(f"{corner:.7f}" for corner in (box.south_deg, box.west_deg, box.north_deg, box.east_deg))


def whats_wrong(answer: bytes) -> str | None:
    """Return the fault of an answer that is not the requested data, or None.

    >>> whats_wrong(b"<html>Too many requests</html>")
    'the answer is not OSM data, or not all of it'
    """
    if remark := _REMARK.search(answer):
        return f"the query failed: {remark[1].decode(errors='replace').strip()}"
    if not _OSM_ROOT.search(answer[:_HEAD_BYTES]) or b"</osm>" not in answer[-_HEAD_BYTES:]:
        return "the answer is not OSM data, or not all of it"
    return None


def _extract(site: Site, settings: OsmSettings, download: _Download, name: str) -> OsmExtract | Rejection:
    place = f"({site.latitude_deg:.6f}, {site.longitude_deg:.6f})"
    if not is_on_earth(site):
        return Rejection(Reason.NO_MAP_COVERAGE, f"The reported point {place} is not a place on Earth.")
    box, nearer = box_around(site, settings.radius_m), box_around(site, settings.surroundings_radius_m)
    found = _extract_box(box, nearer, settings, download, name)
    if not found.ways:
        detail = f"{name} has no drivable way within {settings.radius_m:.0f} m of {place}."
        return Rejection(Reason.NO_MAP_COVERAGE, detail, measured=0.0, threshold=settings.radius_m)
    return found


def _extract_box(
    box: BoundingBox, nearer: BoundingBox, settings: OsmSettings, download: _Download, name: str
) -> OsmExtract:
    try:
        data = read_osm(download(box, nearer), name=name)
    except UserError as error:
        raise Failure(str(error)) from error  # the service's fault, not the caller's
    roads = clip_roads(
        box,
        _raw_ways(data, service_roads=settings.service_roads),
        {node.id: node.tags for node in data.nodes.values() if node.tags},
        (relation for relation in data.relations if not relation.tags.keys().isdisjoint(RESTRICTION_KEYS)),
    )
    return replace(
        roads,
        surroundings=tuple(_surroundings(data, nearer)),
        source=name,
        data_timestamp=data.data_timestamp,
        attribution=data.attribution,
    )


def _raw_ways(data: OsmExtract, *, service_roads: bool) -> list[RawWay]:
    return [
        _raw(way, data)
        for way in (*data.ways, *data.walkways)
        if is_drivable(way.tags, service_roads=service_roads) or is_walkway(way.tags)
    ]


def _raw(way: OsmWay, data: OsmExtract) -> RawWay:
    nodes = [data.nodes[node_id] for node_id in way.node_ids]
    x_deg, y_deg = np.array([node.longitude_deg for node in nodes]), np.array([node.latitude_deg for node in nodes])
    return RawWay(way.id, np.array(way.node_ids), x_deg, y_deg, way.tags)


def _surroundings(data: OsmExtract, nearer: BoundingBox) -> Iterator[OsmFeature]:
    for node in data.nodes.values():
        if is_thing(node.tags, way=False) and nearer.contains(node.latitude_deg, node.longitude_deg):
            yield feature_of_node(node.id, node.longitude_deg, node.latitude_deg, node.tags)
    things = [_raw(way, data) for way in data.ways if "highway" not in way.tags and is_thing(way.tags, way=True)]
    yield from features_of_ways(things, nearer)
