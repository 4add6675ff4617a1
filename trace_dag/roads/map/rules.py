"""Rules an OpenDRIVE 1.7 file has to keep, checked on the file itself.

The official schema may not be redistributed and the official checker needs seconds per map. So the rules that a road
map of this project could break are checked here in milliseconds: element order and attributes as the schema has them,
ids, ``s`` coordinates, plan view continuity, lane numbering and widths, links, junctions, signals, objects (ASAM
OpenDRIVE 1.7.0, sections 6 to 14). The tests compare them with the official checker.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Final, TypeAlias

from lxml import etree

from trace_dag.common.data_files import read_toml
from trace_dag.roads.map.curves import along_arc
from trace_dag.roads.map.link_rules import broken_links
from trace_dag.roads.map.reader import network_of, parse_opendrive

if TYPE_CHECKING:
    from trace_dag.roads.map.network import RoadNetwork

_Rule: TypeAlias = Callable[[etree._Element], Iterator[str]]
"""A function that yields the violations of a rule in an element."""
_POSITION_TOLERANCE_M: Final = 1e-3
_HEADING_TOLERANCE_RAD: Final = 1e-3
_S_TOLERANCE_M: Final = 1e-4
_ROAD: Final = re.compile(r"\(road ([^,)]+)")

_SIDES: Final = ("left", "center", "right")
_ANYWHERE: Final = ("userData", "include", "dataQuality")  # children that any element may have
_SCHEMA: Final = read_toml("trace_dag.roads.map", "opendrive_schema.toml")
_CHILDREN: Final[Mapping[str, Sequence[str]]] = _SCHEMA["children"]
_REQUIRED: Final[Mapping[str, Sequence[str]]] = _SCHEMA["required"]
_ENUMERATED: Final = {
    (element, attribute): frozenset(values)
    for element, attributes in _SCHEMA["values"].items()
    for attribute, values in attributes.items()
}


def find_violations(xodr: bytes, *, name: str = "map") -> list[str]:
    """Return every broken rule with its place; empty for a file that keeps all rules.

    Raises :class:`~trace_dag.common.errors.UserError` if the file is not OpenDRIVE.

    >>> find_violations(xodr, name="map.xodr")
    []
    """
    return violations_of(parse_opendrive(xodr, name))


def violations_of(root: etree._Element) -> list[str]:
    """Find violations like :func:`find_violations`, in a document that ``parse_opendrive`` has parsed.

    >>> from trace_dag.roads.map.reader import parse_opendrive
    >>> violations_of(parse_opendrive(xodr, "map.xodr"))
    []
    """
    found = list(_schema(root))
    if found:
        return found  # the rules below rely on attributes that exist and can be read
    for rule in _RULES:
        found += rule(root)
    return [*found, *broken_links(root)]


def roads_of(violations: Iterable[str]) -> list[str]:
    """Return the ids of the roads that violations name as their places.

    >>> roads_of(["no lane section (road 12)", "no geoReference"])
    ['12']
    """
    return [found[1] for each in violations if (found := _ROAD.search(each)) is not None]


def _place(element: etree._Element) -> str:
    owner = next((e for e in (element, *element.iterancestors()) if e.tag in ("road", "junction")), element)
    return f"{owner.tag} {owner.get('id', '')}".strip()


def _float(element: etree._Element, key: str) -> float:
    return float(element.get(key, "nan"))


def _schema(root: etree._Element) -> Iterator[str]:
    """Yield the order of elements, required attributes, numbers, and words of the enumerations."""
    for element in root.iter(_RULES_OF_TAG):
        tag = element.tag
        children = tuple([child.tag for child in element]) if tag in _CHILDREN else ()
        for problem in _faults(tag, tuple(element.items()), children):
            yield f"{problem} ({_place(element)})"


@lru_cache(maxsize=4096)  # most elements of a map repeat
def _faults(tag: str, attributes: tuple[tuple[str, str], ...], children: tuple[str, ...]) -> tuple[str, ...]:
    """Return the faults of an element with these attributes and children."""
    rules, found = _RULES_OF_TAG[tag], []
    places = [rules.order.get(child, -1) for child in children]
    if -1 in places:
        found.append(f"<{tag}> holds <{children[places.index(-1)]}>, out of place")
    elif places != sorted(places):
        found.append(f"children of <{tag}> are out of order")
    values = dict(attributes)
    found += [f"<{tag}> without {key!r}" for key in sorted(rules.required - values.keys())]
    for key, value in attributes:
        if key in rules.numbers and not _is_finite(value):
            found.append(f"<{tag} {key}={value!r}> is not a finite number")
        if key in rules.words and value not in rules.words[key]:
            found.append(f"<{tag} {key}={value!r}> is not in the enumeration")
    if (
        tag == "roadMark"
        and "height" in values
        and not (_is_finite(values["height"]) and float(values["height"]) > 0.0)
    ):
        found.append(f"<{tag} height={values['height']!r}> is not above 0")
    return tuple(found)


_NUMBERS: Final[dict[str, tuple[str, ...]]] = {
    tag: tuple(key for key in keys if key not in ("type", "color", "dynamic", "orientation", "subtype", "code"))
    for tag, keys in _REQUIRED.items()
    if tag not in ("road", "signal", "object", "junction", "connection", "controller", "control")
} | {"road": ("length",), "signal": ("s", "t", "zOffset"), "object": ("s", "t", "zOffset", "length", "width")}


@dataclass(frozen=True)
class _TagRules:
    """The schema's rules for one kind of element."""

    order: dict[str, int]  # place of each child; empty if not looked at
    required: frozenset[str]
    numbers: frozenset[str]
    words: dict[str, frozenset[str]]


_RULES_OF_TAG: Final = {
    tag: _TagRules(
        order={child: place for place, child in enumerate(_CHILDREN.get(tag, ()))},
        required=frozenset(_REQUIRED.get(tag, ())),
        numbers=frozenset(_NUMBERS.get(tag, ())),
        words={key: words for (owner, key), words in _ENUMERATED.items() if owner == tag},
    )
    for tag in {*_CHILDREN, *_REQUIRED, *(tag for tag, _ in _ENUMERATED)}
}


def _is_finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _header(root: etree._Element) -> Iterator[str]:
    headers = root.findall("header")
    if len(headers) != 1:
        yield f"{len(headers)} headers, expected 1"
    elif (headers[0].get("revMajor"), headers[0].get("revMinor")) != ("1", "7"):
        yield f"revision {headers[0].get('revMajor')}.{headers[0].get('revMinor')}, expected 1.7"
    elif not (headers[0].findtext("geoReference") or "").strip():
        yield "no geoReference"


def _ids(root: etree._Element) -> Iterator[str]:
    for path in ("road", "junction", "road/signals/signal", "road/objects/object", "controller"):
        for key, count in Counter(e.get("id") for e in root.iterfind(path)).items():
            if count > 1:
                yield f"{count} of {path} have the id {key}"
    for junction in root.iterfind("junction"):
        for key, count in Counter(e.get("id") for e in junction.iterfind("connection")).items():
            if count > 1:
                yield f"{count} connections have the id {key} ({_place(junction)})"


def _ascending(elements: Iterable[etree._Element], key: str, what: str) -> Iterator[str]:
    texts = [element.get(key, "nan") for element in elements]
    if texts in (["0"], ["0.0"]):  # most have one record
        return
    values = list(map(float, texts))
    if values and abs(values[0]) > 1e-9:
        yield f"first {what} at {key}={values[0]:g}, expected 0"
    if any(b <= a for a, b in pairwise(values)):
        yield f"{what} records not in ascending order of {key}"


def _of_each_road(rule: _Rule) -> _Rule:
    """Return a rule of roads as one of the whole document, with the road as the place of its violations."""

    def of_document(root: etree._Element) -> Iterator[str]:
        for road in root.iterchildren("road"):
            for problem in rule(road):
                yield f"{problem} ({_place(road)})"

    return of_document


@_of_each_road
def _plan_view(road: etree._Element) -> Iterator[str]:
    length = _float(road, "length")
    pieces = [piece for plan in road.iterchildren("planView") for piece in plan.iterchildren("geometry")]
    if not pieces or length <= 0:
        yield "no plan view or no length"
        return
    yield from _ascending(pieces, "s", "geometry")
    if abs(_float(pieces[-1], "s") + _float(pieces[-1], "length") - length) > _S_TOLERANCE_M:
        yield f"plan view ends at another length than {length:g}"
    shapes = [[child for child in piece if child.tag not in _ANYWHERE] for piece in pieces]
    for (piece, following), own in zip(pairwise(pieces), shapes, strict=False):
        yield from _joint(piece, own, following)
    for piece, own in zip(pieces, shapes, strict=True):
        if len(own) != 1 or _float(piece, "length") <= 0:
            found = f"{len(own)} shapes, length {piece.get('length')}"
            yield f"geometry at s={piece.get('s')}: {found}; expected one shape with a length"


def _joint(piece: etree._Element, shapes: list[etree._Element], following: etree._Element) -> Iterator[str]:
    """Yield faults of position and heading between two pieces of plan view; only lines and arcs are followed."""
    s, length = _float(piece, "s"), _float(piece, "length")
    if abs(s + length - _float(following, "s")) > _S_TOLERANCE_M:
        yield f"gap in s after geometry at s={s:g}"
    arc = next((shape for shape in shapes if shape.tag == "arc"), None)
    if arc is None and not any(shape.tag == "line" for shape in shapes):
        return
    curvature = _float(arc, "curvature") if arc is not None else 0.0
    x, y, heading = along_arc(_float(piece, "x"), _float(piece, "y"), _float(piece, "hdg"), length, curvature)
    gap_m = math.hypot(x - _float(following, "x"), y - _float(following, "y"))
    if gap_m > _POSITION_TOLERANCE_M:
        yield f"gap of {gap_m:.3f} m after geometry at s={s:g}"
    kink = abs(math.remainder(heading - _float(following, "hdg"), math.tau))
    if kink > _HEADING_TOLERANCE_RAD:
        yield f"kink of {math.degrees(kink):.2f} degrees after geometry at s={s:g}"


@_of_each_road
def _profiles(road: etree._Element) -> Iterator[str]:
    lanes = _grouped(road.iterchildren("lanes"))
    sections = lanes["laneSection"]
    yield from _ascending(_grouped(road.iterchildren("elevationProfile"))["elevation"], "s", "elevation")
    yield from _ascending(lanes["laneOffset"], "s", "laneOffset")
    yield from _ascending(sections, "s", "laneSection")
    yield from _ascending(road.iterchildren("type"), "s", "type")
    if not sections:
        yield "no lane section"
    elif _float(sections[-1], "s") >= _float(road, "length"):
        yield "lane section beyond the road's end"


def _lanes(root: etree._Element) -> Iterator[str]:
    sections = (
        section
        for road in root.iterchildren("road")
        for lanes in road.iterchildren("lanes")
        for section in lanes.iterchildren("laneSection")
    )
    for section in sections:
        for problem in _problems_of_section(section):
            yield f"{problem} ({_place(section)}, section at s={section.get('s')})"


def _problems_of_section(section: etree._Element) -> Iterator[str]:
    sides = {
        side: [lane for each in section.iterchildren(side) for lane in each.iterchildren("lane")] for side in _SIDES
    }
    centre = [lane.get("id") for lane in sides["center"]]
    left = [int(lane.get("id", "0")) for lane in sides["left"]]
    right = [int(lane.get("id", "0")) for lane in sides["right"]]
    if centre != ["0"]:
        yield f"centre lanes {centre}, expected one with id 0"
    if left != list(range(len(left), 0, -1)):
        yield f"left lanes {left}, expected n to 1"
    if right != list(range(-1, -len(right) - 1, -1)):
        yield f"right lanes {right}, expected -1 to -n"
    if not left and not right:
        yield "no lane but the centre one"
    for lane in (lane for lanes in sides.values() for lane in lanes):
        parts = _grouped([lane])
        if lane.get("id") == "0":
            if parts["width"]:
                yield "centre lane with a width"
            continue
        if not parts["width"] and not parts["border"]:
            yield f"lane {lane.get('id')} without width"
        for what in ("width", "roadMark"):
            for problem in _ascending(parts[what], "sOffset", what):
                yield f"{problem}, lane {lane.get('id')}"


def _grouped(owners: Iterable[etree._Element]) -> defaultdict[str, list[etree._Element]]:
    """Return the children of some elements by tag."""
    groups: defaultdict[str, list[etree._Element]] = defaultdict(list)
    for owner in owners:
        for child in owner:
            groups[child.tag].append(child)
    return groups


@_of_each_road
def _signals(road: etree._Element) -> Iterator[str]:
    length = _float(road, "length")
    for signal in road.iterfind("signals/signal"):
        if not 0.0 <= _float(signal, "s") <= length + 1e-9:
            yield f"signal {signal.get('id')} at s={signal.get('s')}, beyond the road"
        if signal.get("value") is not None and signal.get("unit") is None:
            yield f"signal {signal.get('id')} with a value but no unit"


@_of_each_road
def _objects(road: etree._Element) -> Iterator[str]:
    length = _float(road, "length")
    for each in road.iterfind("objects/object"):
        where = f"object {each.get('id')}"
        if not 0.0 <= _float(each, "s") <= length + 1e-9:
            yield f"s={each.get('s')}, beyond the road: {where}"
        if any(not _float(each, key) > 0.0 for key in ("length", "width") if key in each.attrib):
            yield f"length {each.get('length')}, width {each.get('width')}, expected above 0: {where}"
        for outline in each.iter("outline"):
            if outline.get("closed") == "true" and len(outline) < 3:
                yield f"closed outline of {len(outline)} corners, expected 3 or more: {where}"


def _controllers(root: etree._Element) -> Iterator[str]:
    signals = {signal.get("id") for signal in root.iterfind("road/signals/signal")}
    controllers = {controller.get("id") for controller in root.iterfind("controller")}
    for controller in root.iterfind("controller"):
        if controller.find("control") is None:
            yield f"controller {controller.get('id')} controls no signal"
        for control in controller.iterfind("control"):
            if control.get("signalId") not in signals:
                yield f"controller {controller.get('id')} of signal {control.get('signalId')}, which does not exist"
    for junction in root.iterfind("junction"):
        for controller in junction.iterfind("controller"):
            if controller.get("id") not in controllers:
                yield f"junction with controller {controller.get('id')}, which does not exist ({_place(junction)})"


_RULES: Final = (_header, _ids, _plan_view, _profiles, _lanes, _signals, _objects, _controllers)


class StoredMap:
    """An OpenDRIVE file, ``xodr``, parsed when first needed; ``name`` is for messages.

    A file that is not OpenDRIVE raises :class:`~trace_dag.common.errors.UserError` then.
    """

    def __init__(self, xodr: bytes, *, name: str = "map") -> None:
        self.xodr = xodr
        self.name = name

    @cached_property
    def _root(self) -> etree._Element:
        return parse_opendrive(self.xodr, self.name)

    @cached_property
    def violations(self) -> list[str]:
        """Return every broken rule with its place (:func:`~trace_dag.roads.map.rules.find_violations`)."""
        return violations_of(self._root)

    @cached_property
    def network(self) -> RoadNetwork:
        """Return the network read back from the file."""
        return network_of(self._root, name=self.name)
