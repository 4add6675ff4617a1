"""OSM XML (API 0.6) to and from :class:`~trace_dag.osm.types.OsmExtract`.

The form of the extracts in packages, and of the answers of the OSM API and Overpass. Written so that other tools
(osmium, JOSM, netconvert, Osm2Odr) read it: objects sorted by type and id, coordinates at OSM's own resolution of
1e-7 degrees, ``version="1"`` on every object because some readers insist on it. Facts without a field in OSM XML are
attributes that other readers ignore: ``clipped`` on nodes made at the border of the box and ``source`` on the root.
Reading files of unknown size, of any format, is :mod:`trace_dag.osm.extraction`'s task.

OSM XML of editors, histories and Overpass is rewritten in its present state. JOSM gives new objects ids below 0 and
leaves deleted ones in the file; a history has every version of an object; Overpass, asked for ``out geom``, writes the
places of nodes into the ways. libosmium does not locate nodes with such ids, keeps deleted and old objects, and misses
or refuses places within ways.
"""

from __future__ import annotations

import io
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from operator import attrgetter
from pathlib import Path
from typing import Final
from xml.sax.saxutils import escape

from lxml import etree

from trace_dag.common.errors import UserError
from trace_dag.osm.plausibility import xml_opener
from trace_dag.osm.road_classes import is_walkway
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay, read_attribution

_GENERATOR: Final = "trace-dag"
_ID: Final = attrgetter("id")
_IN_ATTRIBUTES: Final = {'"': "&quot;", "\n": "&#10;", "\t": "&#9;", "\r": "&#13;"}
_KINDS: Final = ("node", "way", "relation")
# Everything XML 1.0 cannot hold: control characters, surrogates, the two non-characters.
_NOT_XML: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_BLOCK: Final = 2**20
_ODD: Final = re.compile(rb"""\b(?:id|ref)\s*=\s*["']-|\b(?:action|visible)\s*=|<nd\b[^>]*\blat\s*=""")
_LONGEST: Final = 2**10  # bytes of a tag that the pattern has to see whole
_ABOVE_ALL: Final = 4 * 10**15  # OSM's ids are below 2**36
_CHILDREN: Final = {"node": ("tag",), "way": ("nd", "tag"), "relation": ("member", "tag")}
_Element = etree._Element


def write_osm(extract: OsmExtract) -> bytes:
    """Return the extract as OSM XML, UTF-8, the same bytes for the same extract."""
    lines = [f"<?xml version='1.0' encoding='UTF-8'?>\n<osm version=\"0.6\" generator=\"{_GENERATOR}\""]
    for name, said in (("attribution", extract.attribution), ("source", extract.source)):
        lines[0] += f' {name}="{_text(said)}"' if said else ""
    lines[0] += ">"
    if extract.data_timestamp:
        lines.append(f'  <meta osm_base="{_text(extract.data_timestamp)}"/>')
    box = extract.box
    lines.append(
        f'  <bounds minlat="{box.south_deg:.7f}" minlon="{box.west_deg:.7f}" '
        f'maxlat="{box.north_deg:.7f}" maxlon="{box.east_deg:.7f}"/>'
    )
    for node in sorted(extract.nodes.values(), key=_ID):
        clipped = ' clipped="true"' if node.clipped else ""
        start = f'node id="{node.id}" version="1" lat="{node.latitude_deg:.7f}" lon="{node.longitude_deg:.7f}"{clipped}'
        _write(lines, start, _tags(node.tags))
    for way in sorted((*extract.ways, *extract.walkways), key=_ID):
        refs = [f'    <nd ref="{node_id}"/>' for node_id in way.node_ids]
        _write(lines, f'way id="{way.id}" version="1"', refs + _tags(way.tags))
    for relation in sorted(extract.relations, key=_ID):
        members = [
            f'    <member type="{member.type}" ref="{member.id}" role="{_text(member.role)}"/>'
            for member in relation.members
        ]
        _write(lines, f'relation id="{relation.id}" version="1"', members + _tags(relation.tags))
    return ("\n".join(lines) + "\n</osm>\n").encode()


def read_osm(data: bytes, *, name: str) -> OsmExtract:
    """Read OSM XML; ``name`` (a path or address) is for error messages.

    The newest version of an object counts. References of ways to missing nodes are dropped, and so are
    deleted objects and ways with fewer than two nodes left, as :class:`OsmExtract` requires. Without ``<bounds>`` the
    box is that of the nodes.

    Raises :class:`UserError` for anything that is not OSM XML.

    >>> extract = read_osm(b'<osm><node id="7" lat="41.8" lon="-101.5"/></osm>', name="town.osm")
    >>> extract.nodes[7].latitude_deg
    41.8
    """
    root = _parse(data, name)
    nodes: dict[int, OsmNode] = {}
    ways: dict[int, OsmWay] = {}
    relations: dict[int, OsmRelation] = {}
    timestamp = ""
    box: BoundingBox | None = None
    objects = (element for element in _newest(root, name).values() if not is_gone(element))
    for element in (*root.iterchildren("bounds", "meta"), *objects):
        match element.tag:
            case "bounds":
                box = BoundingBox(
                    *(_number(element, key, name, 180.0) for key in ("minlat", "minlon", "maxlat", "maxlon"))
                )
            case "meta":
                timestamp = element.get("osm_base", "")
            case "node":
                node = OsmNode(
                    _integer(element, "id", name),
                    _number(element, "lat", name, 90.0),
                    _number(element, "lon", name, 180.0),
                    _read_tags(element),
                    clipped=element.get("clipped") == "true",
                )
                nodes[node.id] = node
            case "way":
                ids = tuple(_integer(nd, "ref", name) for nd in element.iterchildren("nd"))
                way = OsmWay(_integer(element, "id", name), ids, _read_tags(element))
                ways[way.id] = way
            case "relation":
                members = tuple(_member(member, name) for member in element.iterchildren("member"))
                relation = OsmRelation(_integer(element, "id", name), members, _read_tags(element))
                relations[relation.id] = relation
    present = _present_ways(ways, nodes)
    return OsmExtract(
        box=box or _box_of(nodes),
        nodes=nodes,
        ways=tuple(way for way in present if not is_walkway(way.tags)),
        walkways=tuple(way for way in present if is_walkway(way.tags)),
        relations=tuple(relations[key] for key in sorted(relations)),
        source=root.get("source", ""),
        data_timestamp=timestamp,
        attribution=read_attribution({str(name): str(value) for name, value in root.attrib.items()}),
    )


def _newest(root: etree._Element, name: str) -> dict[tuple[str, int], etree._Element]:
    """Return the newest version of each object, by type and id."""
    newest: dict[tuple[str, int], etree._Element] = {}
    for element in root.iterchildren(*_KINDS):
        key = element.tag, _integer(element, "id", name)
        if key not in newest or age(element) >= age(newest[key]):
            newest[key] = element
    return newest


def _parse(data: bytes, name: str) -> etree._Element:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True, remove_comments=True)
    try:
        root = etree.parse(io.BytesIO(data), parser).getroot()
    except etree.XMLSyntaxError as error:
        raise UserError(
            f"{name}: not OSM XML ({error.msg or 'empty'}); expected a document <osm> ... </osm>"
        ) from error
    if root.tag != "osm":
        raise UserError(f"{name}: not OSM XML: the document is a <{root.tag}>, expected <osm>")
    return root


def _present_ways(ways: dict[int, OsmWay], nodes: dict[int, OsmNode]) -> tuple[OsmWay, ...]:
    present = []
    for way in (ways[key] for key in sorted(ways)):
        ids = tuple(node_id for node_id in way.node_ids if node_id in nodes)
        if len(ids) >= 2:
            present.append(OsmWay(way.id, ids, way.tags))
    return tuple(present)


def _box_of(nodes: dict[int, OsmNode]) -> BoundingBox:
    if not nodes:
        return BoundingBox(0.0, 0.0, 0.0, 0.0)
    latitudes = [node.latitude_deg for node in nodes.values()]
    longitudes = [node.longitude_deg for node in nodes.values()]
    return BoundingBox(min(latitudes), min(longitudes), max(latitudes), max(longitudes))


def _write(lines: list[str], start: str, children: list[str]) -> None:
    """Write an element that begins with ``start``."""
    if children:
        lines += [f"  <{start}>", *children, f"  </{start.partition(' ')[0]}>"]
    else:
        lines.append(f"  <{start}/>")


def _tags(tags: Mapping[str, str]) -> list[str]:
    return [f'    <tag k="{_text(key)}" v="{_text(value)}"/>' for key, value in sorted(tags.items())]


def _read_tags(element: etree._Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iterchildren("tag")}


def _member(element: etree._Element, name: str) -> OsmMember:
    kind = element.get("type", "")
    if kind not in _KINDS:
        raise UserError(f'{name}: <member type="{kind}"> at line {element.sourceline}, expected one of {_KINDS}')
    return OsmMember(kind, _integer(element, "ref", name), element.get("role", ""))


def _integer(element: etree._Element, key: str, name: str) -> int:
    value = element.get(key, "")
    try:
        return int(value)
    except ValueError:
        raise UserError(_complaint(element, key, name, "a whole number")) from None


def _number(element: etree._Element, key: str, name: str, limit_deg: float) -> float:
    try:
        value = float(element.get(key, ""))
    except ValueError:
        value = float("nan")
    if not -limit_deg <= value <= limit_deg:
        raise UserError(_complaint(element, key, name, f"degrees between {-limit_deg:g} and {limit_deg:g}"))
    return value


def _complaint(element: etree._Element, key: str, name: str, expected: str) -> str:
    return (
        f'{name}: <{element.tag}> at line {element.sourceline} has {key}="{element.get(key, "")}", expected {expected}'
    )


@lru_cache(maxsize=2**14)  # most tags of a place are among a few hundred
def _text(value: str) -> str:
    """Return a value escaped for an attribute in double quotes."""
    return escape(_NOT_XML.sub("\N{REPLACEMENT CHARACTER}", value), _IN_ATTRIBUTES)


# --- plain OSM XML ---------------------------------------------------------------------------------------------------
@contextmanager
def as_plain_xml(path: Path) -> Iterator[Path]:
    """Return a file in plain XML: the file itself, or a copy.

    A copy has the newest version of each existing object, ids above 0, and nodes with places.

    Binary files and XML that cannot be parsed are returned unchanged.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     town = Path(folder) / "town.osm"
    ...     way = '<way id="7"><nd ref="1" lat="41" lon="-101"/><nd ref="2" lat="41" lon="-100.9"/></way>'
    ...     _ = town.write_text(f'<osm version="0.6">{way}<way id="8" action="delete"/></osm>')
    ...     with as_plain_xml(town) as plain:
    ...         [(each.tag, each.get("id")) for each in etree.parse(plain).getroot()]
    [('node', '1'), ('node', '2'), ('way', '7')]
    """
    if not _is_odd(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder:
        plain = Path(folder) / "plain.osm"
        try:
            _rewrite(path, plain)
        except (etree.XMLSyntaxError, OSError, ValueError, UserError) as error:
            if getattr(error, "code", None) == etree.ErrorTypes.ERR_NO_MEMORY:
                raise MemoryError from error
            plain = path  # said by libosmium, which reads it next
        yield plain


def _is_odd(path: Path) -> bool:
    opener = xml_opener(path)
    if opener is None:
        return False
    end = b""
    try:
        with opener(path, "rb") as stream:
            while block := stream.read(_BLOCK):
                if _ODD.search(end + block):
                    return True
                end = block[-_LONGEST:]
    except (OSError, EOFError):
        pass  # said by libosmium, which reads it next
    return False


def _rewrite(source: Path, target: Path) -> None:
    opener = xml_opener(source)
    assert opener is not None
    with opener(source, "rb") as stream:
        root = etree.parse(stream, etree.XMLParser(resolve_entities=False, no_network=True)).getroot()
    newest = _newest(root, source.name)
    located: dict[int, _Element] = {}
    for nd in root.iterfind("way/nd[@lat]"):
        located.setdefault(int(nd.get("ref", "")), nd)
    with etree.xmlfile(str(target), encoding="utf-8") as file, file.element("osm", version="0.6"):
        for bounds in root.iterchildren("bounds"):
            file.write(bounds)
        for number, nd in located.items():
            if ("node", number) not in newest:
                file.write(_plain(nd, "node", number))
        for (kind, number), element in sorted(newest.items(), key=lambda each: _KINDS.index(each[0][0])):
            if not is_gone(element):
                file.write(_plain(element, kind, number))


def age(element: _Element) -> tuple[int, int]:
    """Return a sorting key by version; of equal versions, as in ways that Overpass repeats, the fuller is last.

    >>> age(etree.Element("way", version="3")) > age(etree.Element("way"))
    True
    """
    version = element.get("version", "")
    return int(version) if version.isdecimal() else 0, len(element)


def is_gone(element: _Element) -> bool:
    """Return whether the object was deleted, by a history or an editor.

    >>> is_gone(etree.Element("way", visible="false")), is_gone(etree.Element("way"))
    (True, False)
    """
    return element.get("visible") == "false" or element.get("action") == "delete"


def _plain(element: _Element, kind: str, number: int) -> _Element:
    plain = etree.Element(kind, {"id": str(_above_0(number)), **_some(element, "lat", "lon")})
    for child in element.iterchildren(*_CHILDREN[kind]):
        copy = etree.SubElement(plain, child.tag, _some(child, "k", "v", "type", "role"))
        if child.tag != "tag":
            copy.set("ref", str(_above_0(int(child.get("ref", "")))))
    return plain


def _some(element: _Element, *names: str) -> dict[str, str]:
    return {name: value for name in names if (value := element.get(name)) is not None}


def _above_0(number: int) -> int:
    return number if number > 0 else _ABOVE_ALL - number
