"""OSM XML as editors, histories and Overpass write it, rewritten in its present state.

JOSM gives new objects ids below 0 and leaves deleted ones in the file; a history has every version of an object;
Overpass, asked for ``out geom``, writes the places of nodes into the ways. libosmium does not locate nodes with such
ids, keeps deleted and old objects, and misses or refuses places within ways.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from lxml import etree

from trace_dag.osm.plausibility import xml_opener

_BLOCK: Final = 2**20
_ODD: Final = re.compile(rb"""\b(?:id|ref)\s*=\s*["']-|\b(?:action|visible)\s*=|<nd\b[^>]*\blat\s*=""")
_LONGEST: Final = 2**10  # bytes of a tag that the pattern has to see whole
_ABOVE_ALL: Final = 4 * 10**15  # OSM's ids are below 2**36
_KINDS: Final = ("node", "way", "relation")
_CHILDREN: Final = {"node": ("tag",), "way": ("nd", "tag"), "relation": ("member", "tag")}
_Element = etree._Element


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
        except (etree.XMLSyntaxError, OSError, ValueError) as error:
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
    newest: dict[str, dict[int, _Element]] = {kind: {} for kind in _KINDS}
    for element in root.iterchildren(*_KINDS):
        of_kind, number = newest[element.tag], int(element.get("id", ""))
        if number not in of_kind or age(element) >= age(of_kind[number]):
            of_kind[number] = element
    located: dict[int, _Element] = {}
    for nd in root.iterfind("way/nd[@lat]"):
        located.setdefault(int(nd.get("ref", "")), nd)
    with etree.xmlfile(str(target), encoding="utf-8") as file, file.element("osm", version="0.6"):
        for bounds in root.iterchildren("bounds"):
            file.write(bounds)
        for number, nd in located.items():
            if number not in newest["node"]:
                file.write(_plain(nd, "node", number))
        for kind, of_kind in newest.items():
            for number, element in of_kind.items():
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
