"""OpenDRIVE to :class:`~trace_dag.roads.network.RoadNetwork`: our own maps and other converters'.

Reads versions 1.4 to 1.8 as far as the road model goes: plan view (line, arc, ``paramPoly3``; spirals as arcs,
``poly3`` as ``paramPoly3``), elevation, lane offset, lane sections with widths or borders, road marks, speeds, signals,
links, junctions. Superelevation, objects, railways and controllers are left aside. XML is parsed without entities or
network access.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from lxml import etree

from trace_dag.errors import UserError
from trace_dag.geometry import LocalFrame
from trace_dag.roads.cubic_profile import CubicProfile
from trace_dag.roads.network import (
    Connection,
    ContactPoint,
    Cubic,
    Junction,
    Lane,
    LaneSection,
    LaneType,
    PlanElement,
    Road,
    RoadLink,
    RoadMark,
    RoadNetwork,
    Signal,
)
from trace_dag.units import MPS_PER_KMH, MPS_PER_MPH

_MPS_PER_UNIT: Final = {"m/s": 1.0, "mph": MPS_PER_MPH, "km/h": MPS_PER_KMH}
# e_laneType values the model has no word of its own for.
_OTHER_LANE_TYPES: Final = {
    "onRamp": LaneType.ENTRY,
    "offRamp": LaneType.EXIT,
    "mwyEntry": LaneType.ENTRY,
    "mwyExit": LaneType.EXIT,
    "connectingRamp": LaneType.DRIVING,
    "slipLane": LaneType.DRIVING,
    "bus": LaneType.DRIVING,
    "taxi": LaneType.DRIVING,
    "HOV": LaneType.DRIVING,
    "stop": LaneType.SHOULDER,
    "curb": LaneType.BORDER,
    "walking": LaneType.SIDEWALK,
}
_LONGEST_ROAD_M: Final = 1e6  # longer is a slip, and sampling it would fill the memory
_ARC_TURN_RAD: Final = 0.005
"""Turn per arc that stands for a piece of a spiral: off the clothoid by less than a millimetre on any road."""


def read_opendrive(data: bytes, *, name: str) -> RoadNetwork:
    """Read an OpenDRIVE file; ``name`` (a path) is for error messages.

    The frame's origin is ``lat_0`` and ``lon_0`` of the ``geoReference``; a false origin is taken into account neither
    by CARLA nor here: coordinates are used as they stand. ``legal_mark`` is set where it differs from ``mark``.

    Raises :class:`UserError` for anything that cannot be read as OpenDRIVE.
    """
    root = parse_opendrive(data, name)
    reader = _Reader(name)
    header = root.find("header")
    if header is None:
        raise UserError(f"{name}: not OpenDRIVE: no <header>")
    return RoadNetwork(
        frame=reader.frame(header),
        roads=tuple(reader.road(element) for element in root.iterchildren("road")),
        junctions=tuple(reader.junction(element) for element in root.iterchildren("junction")),
        converter=header.get("vendor", ""),
        attribution=_note(header, "attribution"),
    )


def parse_opendrive(data: bytes, name: str) -> etree._Element:
    """The document's root, tags without namespaces; ``name`` is for messages. Raises :class:`UserError`."""
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise UserError(
            f"{name}: not OpenDRIVE ({error}); expected an XML document <OpenDRIVE> ... </OpenDRIVE>"
        ) from error
    for element in root.iter(tag=etree.Element):
        if element.tag.startswith("{"):
            element.tag = etree.QName(element).localname
    if root.tag != "OpenDRIVE":
        raise UserError(f"{name}: not OpenDRIVE: the document is a <{root.tag}>, expected <OpenDRIVE>")
    return root


@dataclass(frozen=True)
class _Reader:
    """Elements to types; knows the file's name for messages."""

    name: str

    # --- values ----------------------------------------------------------------------------------------------
    def _fail(self, element: etree._Element, problem: str) -> UserError:
        owner = next((e for e in (element, *element.iterancestors()) if e.get("id") is not None), element)
        place = f"<{owner.tag} id={owner.get('id')!r}>, line {element.sourceline}"
        return UserError(f"{self.name}: {problem} ({place}); mend the file or convert the map again")

    def _text(self, element: etree._Element, key: str) -> str:
        value = element.get(key)
        if value is None:
            raise self._fail(element, f"<{element.tag}> without {key!r}")
        return value

    def _number(self, element: etree._Element, key: str, default: float | None = None) -> float:
        value = element.get(key)
        if value is None and default is not None:
            return default
        try:
            number = float(self._text(element, key))
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self._fail(element, f"<{element.tag} {key}={value!r}>: expected a finite number")
        return number

    def _integer(self, element: etree._Element, key: str) -> int:
        value = self._text(element, key)
        try:
            return int(value)
        except ValueError:
            raise self._fail(element, f"<{element.tag} {key}={value!r}>: expected an integer") from None

    def _note_integers(self, element: etree._Element, code: str) -> tuple[int, ...]:
        text = _note(element, code)
        try:
            return tuple(int(part) for part in text.split())
        except ValueError:
            raise self._fail(element, f"userData {code} {text!r}: expected integers") from None

    # --- header ----------------------------------------------------------------------------------------------
    def frame(self, header: etree._Element) -> LocalFrame:
        reference = header.findtext("geoReference") or ""
        values = dict(re.findall(r"\+(lat_0|lon_0)=(-?[\d.]+(?:[eE][-+]?\d+)?)", reference))
        if len(values) < 2:
            raise UserError(
                f"{self.name}: no origin in <geoReference> ({reference.strip()[:80]!r}); expected a PROJ string with "
                "+lat_0 and +lon_0, without which the map has no place on Earth"
            )
        return LocalFrame(float(values["lat_0"]), float(values["lon_0"]))

    # --- roads -----------------------------------------------------------------------------------------------
    def road(self, element: etree._Element) -> Road:
        length = self._number(element, "length")
        plan = tuple(self._plan(element))
        if not plan or not 0.0 < length <= _LONGEST_ROAD_M:
            raise self._fail(element, f"road of length {length:g} with {len(plan)} pieces of plan view")
        offsets = tuple(self._cubics(element.iterfind("lanes/laneOffset")))
        junction = element.get("junction", "-1")
        link = element.find("link")
        return Road(
            id=self._text(element, "id"),
            length_m=length,
            plan=plan,
            lane_sections=tuple(self._sections(element, length)),
            elevation=tuple(self._cubics(element.iterfind("elevationProfile/elevation"))),
            lane_offset=offsets,
            name=element.get("name", ""),
            junction_id=None if junction == "-1" else junction,
            predecessor=self._road_link(link, "predecessor"),
            successor=self._road_link(link, "successor"),
            signals=tuple(self._signal(child) for child in element.iterfind("signals/signal")),
            highway=_note(element, "highway"),
            names=tuple(_notes(element, "altName")),
            osm_way_ids=self._note_integers(element, "osmWays"),
            speed_mps=self._road_speed(element),
            layer=sum(self._note_integers(element, "layer")),
            bridge=_note(element, "bridge") == "true",
            tunnel=_note(element, "tunnel") == "true",
            lanes_from_tags=_note(element, "lanesFromTags") == "true",
            turn=_note(element, "turn") or None,
        )

    def _plan(self, road: etree._Element) -> Iterator[PlanElement]:
        for geometry in road.iterfind("planView/geometry"):
            s, x, y, heading, length = (self._number(geometry, key) for key in ("s", "x", "y", "hdg", "length"))
            shape = next(iter(geometry), None)
            if shape is None:
                raise self._fail(geometry, "<geometry> without a shape")
            match shape.tag:
                case "line":
                    yield PlanElement(s, x, y, heading, length)
                case "arc":
                    yield PlanElement(s, x, y, heading, length, self._number(shape, "curvature"))
                case "paramPoly3":
                    a_u, b_u, c_u, d_u = (self._number(shape, key) for key in ("aU", "bU", "cU", "dU"))
                    a_v, b_v, c_v, d_v = (self._number(shape, key) for key in ("aV", "bV", "cV", "dV"))
                    normalized = shape.get("pRange", "normalized") == "normalized"
                    poly = (a_u, b_u, c_u, d_u, a_v, b_v, c_v, d_v)
                    yield PlanElement(s, x, y, heading, length, poly=poly, poly_normalized=normalized)
                case "poly3":
                    a, b, c, d = (self._number(shape, key) for key in "abcd")
                    u_end = _poly3_reach(b, c, d, length)
                    scaled = (0.0, u_end, 0.0, 0.0, a, b * u_end, c * u_end**2, d * u_end**3)
                    yield PlanElement(s, x, y, heading, length, poly=scaled, poly_normalized=True)
                case "spiral":
                    start, end = self._number(shape, "curvStart"), self._number(shape, "curvEnd")
                    yield from _spiral_as_arcs(PlanElement(s, x, y, heading, length), start, end)
                case other:
                    raise self._fail(geometry, f"shape <{other}>: expected line, arc, spiral, poly3 or paramPoly3")

    def _cubics(self, elements: Iterable[etree._Element], key: str = "s") -> Iterator[Cubic]:
        for e in elements:
            yield Cubic(*(self._number(e, name, 0.0) for name in (key, "a", "b", "c", "d")))

    def _road_link(self, link: etree._Element | None, which: str) -> RoadLink | None:
        element = link.find(which) if link is not None else None
        if element is None:
            return None
        return RoadLink(self._text(element, "elementType"), self._text(element, "elementId"), self._contact(element))

    def _contact(self, element: etree._Element) -> ContactPoint | None:
        value = element.get("contactPoint")
        if value is None:
            return None
        if value not in ("start", "end"):
            raise self._fail(element, f"contactPoint={value!r}: expected start or end")
        return ContactPoint(value)

    def _road_speed(self, road: etree._Element) -> float | None:
        return next((self._speed(speed) for speed in road.iterfind("type/speed")), None)

    def _speed(self, element: etree._Element) -> float | None:
        if element.get("max") in ("no limit", "undefined"):
            return None
        unit = element.get("unit", "m/s")
        if unit not in _MPS_PER_UNIT:
            raise self._fail(element, f"speed unit {unit!r}: expected one of {', '.join(_MPS_PER_UNIT)}")
        return self._number(element, "max") * _MPS_PER_UNIT[unit]

    def _signal(self, element: etree._Element) -> Signal:
        value = element.get("value")
        return Signal(
            id=self._text(element, "id"),
            s_m=self._number(element, "s"),
            t_m=self._number(element, "t"),
            type=element.get("type", ""),
            subtype=element.get("subtype", "-1"),
            name=element.get("name", ""),
            orientation=element.get("orientation", "none"),
            value=None if value in (None, "-1") else self._number(element, "value"),
            unit=element.get("unit"),
            dynamic=element.get("dynamic") == "yes",
            z_offset_m=self._number(element, "zOffset", 0.0),
            height_m=self._number(element, "height", 0.0),
            width_m=self._number(element, "width", 0.0),
            osm_node_id=next(iter(self._note_integers(element, "osmNode")), None),
        )

    # --- lanes -----------------------------------------------------------------------------------------------
    def _sections(self, road: etree._Element, road_length_m: float) -> Iterator[LaneSection]:
        sections = sorted(road.iterfind("lanes/laneSection"), key=lambda section: self._number(section, "s"))
        if not sections:
            raise self._fail(road, "<road> without a lane section")
        ends = [*(self._number(section, "s") for section in sections[1:]), road_length_m]
        for section, end in zip(sections, ends, strict=True):
            begin = self._number(section, "s")
            # A section without length holds no place on the road and would have to be skipped by every query.
            if end - begin <= 1e-9 and len(sections) > 1:
                raise self._fail(section, f"lane section at s={begin:g} without length")
            lanes = [
                self._lane(lane) for side in ("left", "center", "right") for lane in section.iterfind(f"{side}/lane")
            ]
            lanes.sort(key=lambda lane: -lane.id)
            yield LaneSection(begin, tuple(self._with_border_widths(section, lanes)))

    def _lane(self, element: etree._Element) -> Lane:
        lane_type = element.get("type", "none")
        known = lane_type in LaneType._value2member_map_
        mark = element.find("roadMark")
        written = None
        if mark is not None:
            written = RoadMark(mark.get("type", "none"), mark.get("color", "standard"), mark.get("laneChange", "both"))
        speed = element.find("speed")
        legal = _mark_of(_note(element, "legalMark"))
        turns = _note(element, "turns")
        return Lane(
            id=self._integer(element, "id"),
            type=LaneType(lane_type) if known else _OTHER_LANE_TYPES.get(lane_type, LaneType.NONE),
            widths=tuple(self._cubics(element.iterchildren("width"), "sOffset")),
            predecessor=self._lane_link(element, "predecessor"),
            successor=self._lane_link(element, "successor"),
            # Which of the two marks is the road mark depends on how the map was written.
            mark=written if legal is None else _mark_of(_note(element, "mark")),
            legal_mark=legal,
            speed_mps=None if speed is None else self._speed(speed),
            turns=tuple(turns.split(";")) if turns else (),
        )

    def _lane_link(self, lane: etree._Element, which: str) -> int | None:
        element = lane.find(f"link/{which}")
        return None if element is None else self._integer(element, "id")

    def _with_border_widths(self, section: etree._Element, lanes: list[Lane]) -> list[Lane]:
        """Lanes given by ``<border>`` instead of ``<width>``: the width is the distance to the border further in."""
        borders = {
            self._integer(lane, "id"): CubicProfile.of(self._cubics(lane.iterchildren("border"), "sOffset"))
            for lane in section.iterfind("*/lane")
            if lane.find("border") is not None and lane.find("width") is None
        }
        if not borders:
            return lanes
        out = []
        for lane in lanes:
            if lane.id in borders:
                sign = 1 if lane.id > 0 else -1
                terms = [(float(sign), borders[lane.id])]
                if lane.id - sign in borders:
                    terms.append((-float(sign), borders[lane.id - sign]))
                width = CubicProfile.weighted_sum(terms)
                widths = tuple(Cubic(s, *piece) for s, piece in zip(width.knots_m, width.pieces, strict=True))
                lane = Lane(**{**vars(lane), "widths": widths})
            out.append(lane)
        return out

    # --- junctions -------------------------------------------------------------------------------------------
    def junction(self, element: etree._Element) -> Junction:
        return Junction(
            id=self._text(element, "id"),
            connections=tuple(
                self._connection(child)
                for child in element.iterchildren("connection")
                # Virtual and direct junctions (1.7) connect roads without connecting roads of their own.
                if child.get("connectingRoad") is not None and child.get("incomingRoad") is not None
            ),
            name=element.get("name", ""),
            osm_node_ids=self._note_integers(element, "osmNodes"),
            kind=_note(element, "kind"),
            centre_xy_m=self._centre(element),
        )

    def _centre(self, element: etree._Element) -> tuple[float, float] | None:
        text = _note(element, "centre")
        if not text:
            return None
        try:
            x, y = (float(part) for part in text.split())
        except ValueError:
            raise self._fail(element, f"userData centre {text!r}: expected two numbers") from None
        return x, y

    def _connection(self, element: etree._Element) -> Connection:
        contact = self._contact(element)
        if contact is None:
            raise self._fail(element, "<connection> without 'contactPoint'")
        links = ((self._integer(e, "from"), self._integer(e, "to")) for e in element.iterchildren("laneLink"))
        return Connection(
            id=self._text(element, "id"),
            incoming_road=self._text(element, "incomingRoad"),
            connecting_road=self._text(element, "connectingRoad"),
            contact_point=contact,
            lane_links=tuple(links),
        )


def _notes(element: etree._Element, code: str) -> Iterator[str]:
    """Values of an element's ``<userData>`` of one code."""
    return (child.get("value", "") for child in element.iterchildren("userData") if child.get("code") == code)


def _note(element: etree._Element, code: str) -> str:
    return next(_notes(element, code), "")


def _mark_of(text: str) -> RoadMark | None:
    return RoadMark(*text.split(",")) if text.count(",") == 2 else None


def _spiral_as_arcs(start: PlanElement, curvature_start: float, curvature_end: float) -> Iterator[PlanElement]:
    """A clothoid as short arcs, each with the clothoid's mean curvature over its length, so that headings are exact."""
    sharpest = max(abs(curvature_start), abs(curvature_end))
    count = max(4, math.ceil(sharpest * start.length_m / _ARC_TURN_RAD))
    step = start.length_m / count
    x, y, heading = start.x_m, start.y_m, start.heading_rad
    for index in range(count):
        curvature = curvature_start + (curvature_end - curvature_start) * (index + 0.5) / count
        yield PlanElement(start.s_m + index * step, x, y, heading, step, curvature)
        turn = curvature * step
        chord = step * (math.sin(turn / 2) / (turn / 2) if abs(turn) > 1e-12 else 1.0)
        x += chord * math.cos(heading + turn / 2)
        y += chord * math.sin(heading + turn / 2)
        heading += turn


def _poly3_reach(b: float, c: float, d: float, length_m: float) -> float:
    """``u`` at which the cubic v(u) has the given arc length, by bisection."""

    def arc_length(u_end: float) -> float:
        count = 64
        step = u_end / count
        slopes = (b + u * (2 * c + 3 * d * u) for u in (step * (i + 0.5) for i in range(count)))
        return sum(math.hypot(1.0, slope) for slope in slopes) * step

    low, high = 0.0, length_m
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if arc_length(middle) < length_m else (low, middle)
    return (low + high) / 2
