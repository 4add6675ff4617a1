"""The stored extract of a crash: the streets as OSM PBF, the features beside them as GeoJSON.

Any OSM program reads the PBF: objects by type and id, ``version="1"`` on each since some readers insist on it. Facts
without a field in PBF stand elsewhere: nodes that were made at the border of the box carry the tag :data:`CLIPPED`; the
box (to the last digit, which libosmium cuts off), the source, its date and its attribution are foreign members of the
GeoJSON (RFC 7946, section 6.1).
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from operator import attrgetter
from pathlib import Path
from typing import Final

import osmium
import shapely
from osmium.osm import mutable
from shapely.geometry import shape

from trace_dag.common.errors import UserError
from trace_dag.osm.extraction import relation_of
from trace_dag.osm.road_classes import is_walkway
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmFeature, OsmNode, OsmRelation, OsmWay

CLIPPED: Final = "trace_dag:clipped"
"""The tag, with the value ``yes``, of a node that was made where a way was cut at the border of the box."""
_SAID: Final = ("source", "data_timestamp", "attribution")
_LONGEST: Final = 255  # characters of a text: OpenStreetMap takes no more, nor does libosmium write longer ones
_ID: Final = attrgetter("id")


def write_extract(extract: OsmExtract) -> tuple[bytes, bytes]:
    """Return the extract as PBF and GeoJSON, the same bytes for the same extract.

    >>> pbf, geojson = write_extract(extract)
    >>> geojson[:28]
    b'{"type":"FeatureCollection",'
    """
    return _write_pbf(extract), _write_geojson(extract)


def read_extract(pbf: bytes, geojson: bytes, *, name: str) -> OsmExtract:
    """Read an extract written by :func:`write_extract`; ``name`` is for messages.

    Raises :class:`UserError` for any other content.

    >>> len(read_extract(*write_extract(extract), name="2023-319003").ways)
    14
    """
    try:
        about = json.loads(geojson)
        features = tuple(
            OsmFeature(each["id"], shape(each["geometry"]), each["properties"]) for each in about["features"]
        )
        box = BoundingBox(**about["box"])
        said = {key: str(about[key]) for key in _SAID}
    except (ValueError, KeyError, TypeError, AttributeError, shapely.errors.ShapelyError) as error:
        raise UserError(f"{name}: not the GeoJSON of what stands around a crash: {error}") from error
    nodes: dict[int, OsmNode] = {}
    ways: list[OsmWay] = []
    relations: list[OsmRelation] = []
    try:
        for each in osmium.FileProcessor(osmium.io.FileBuffer(pbf, "osm.pbf")):
            tags = dict(each.tags)
            if isinstance(each, osmium.osm.Node):
                clipped = tags.pop(CLIPPED, None) is not None
                nodes[each.id] = OsmNode(each.id, each.lat, each.lon, tags, clipped)
            elif isinstance(each, osmium.osm.Way):
                ways.append(OsmWay(each.id, tuple(node.ref for node in each.nodes), tags))
            elif isinstance(each, osmium.osm.Relation):
                relations.append(relation_of(each))
    except (RuntimeError, osmium.InvalidLocationError) as error:
        raise UserError(f"{name}: cannot be read as OSM PBF ({error})") from error
    return OsmExtract(
        box=box,
        nodes=nodes,
        ways=tuple(way for way in ways if not is_walkway(way.tags)),
        walkways=tuple(way for way in ways if is_walkway(way.tags)),
        relations=tuple(relations),
        surroundings=features,
        **said,
    )


def _write_pbf(extract: OsmExtract) -> bytes:
    header, box = osmium.io.Header(), extract.box
    header.set("generator", "trace-dag")
    header.add_box(osmium.osm.Box(box.west_deg, box.south_deg, box.east_deg, box.north_deg))
    with tempfile.TemporaryDirectory(prefix="trace-dag-osm-") as folder:  # libosmium writes to files alone
        path = Path(folder) / "extract.osm.pbf"
        with osmium.SimpleWriter(osmium.io.File(path, "pbf,add_metadata=version"), header=header) as writer:
            for node in sorted(extract.nodes.values(), key=_ID):
                tags = _in_order({**node.tags, CLIPPED: "yes"} if node.clipped else node.tags)
                place = (node.longitude_deg, node.latitude_deg)
                writer.add_node(mutable.Node(id=node.id, version=1, location=place, tags=tags))
            for way in sorted((*extract.ways, *extract.walkways), key=_ID):
                writer.add_way(mutable.Way(id=way.id, version=1, nodes=way.node_ids, tags=_in_order(way.tags)))
            for relation in sorted(extract.relations, key=_ID):
                members = [(each.type[0], each.id, each.role[:_LONGEST]) for each in relation.members]
                tags = _in_order(relation.tags)
                writer.add_relation(mutable.Relation(id=relation.id, version=1, members=members, tags=tags))
        return path.read_bytes()


def _in_order(tags: Mapping[str, str]) -> dict[str, str]:
    return {key[:_LONGEST]: value[:_LONGEST] for key, value in sorted(tags.items())}


def _write_geojson(extract: OsmExtract) -> bytes:
    about = {"box": asdict(extract.box), **{name: getattr(extract, name) for name in _SAID}}
    start = f'{{"type":"FeatureCollection",{_json(about)[1:-1]},"features":['
    return (start + ",\n".join(_features(extract.surroundings)) + "]}\n").encode()


def _features(features: Iterable[OsmFeature]) -> Iterator[str]:
    ordered = sorted(features, key=_ID)
    for each, of_it in zip(ordered, shapely.to_geojson([each.geometry for each in ordered]), strict=True):
        tags = _json(dict(sorted(each.tags.items())))
        yield f'{{"type":"Feature","id":"{each.id}","geometry":{of_it},"properties":{tags}}}'


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
