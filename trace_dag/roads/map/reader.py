"""OpenDRIVE read as :class:`~trace_dag.roads.map.network.RoadNetwork`: maps of this program and of others.

Reads versions 1.4 to 1.8 as far as the road model goes: plan view (line, arc, ``paramPoly3``; spirals as arcs,
``poly3`` as ``paramPoly3``), elevation, lane offset, lane sections with widths or borders, road marks, speeds, signals
and their controllers, links, junctions, and of the objects crosswalks, traffic islands and patches. Superelevation,
other objects and railways are ignored. XML is parsed without entities or network access.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Final

from lxml import etree

from trace_dag.common.errors import UserError
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.units import MPS_PER_KMH, MPS_PER_MPH
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import poly3_as_param_poly3, spiral_as_arcs
from trace_dag.roads.map.model import (
    Connection,
    ContactPoint,
    Controller,
    Crosswalk,
    Cubic,
    Junction,
    Lane,
    LaneSection,
    LaneType,
    PlanElement,
    Road,
    RoadLink,
    RoadMark,
    RoadObject,
    Signal,
)
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.opendrive_values import Notes, ValueReader, first_note, notes_of

_MPS_PER_UNIT: Final = {"m/s": 1.0, "mph": MPS_PER_MPH, "km/h": MPS_PER_KMH}
# e_laneType values that the model does not distinguish.
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
_LANE_TYPES: Final = {**_OTHER_LANE_TYPES, **{lane_type.value: lane_type for lane_type in LaneType}}
_READ_OBJECTS: Final = frozenset({"trafficIsland", "patch"})
_LONGEST_ROAD_M: Final = 1e6  # a longer one is an error, and sampling it would fill the memory
_MOST_TURN_RAD: Final = 100.0  # of a piece of road: 16 full circles


def read_opendrive(data: bytes, *, name: str) -> RoadNetwork:
    """Read an OpenDRIVE file; ``name`` (a path) is for error messages.

    The frame's origin is ``lat_0`` and ``lon_0`` of the ``geoReference``; a false origin is ignored, as in CARLA.
    ``legal_mark`` is set if it differs from ``mark``.

    Raises :class:`UserError` for anything that cannot be read as OpenDRIVE.
    """
    return network_of(parse_opendrive(data, name), name=name)


def network_of(root: etree._Element, *, name: str) -> RoadNetwork:
    """Return the network of a document parsed by :func:`parse_opendrive`, as :func:`read_opendrive` does."""
    reader = _Reader(name)
    header = root.find("header")
    if header is None:
        raise UserError(f"{name}: not OpenDRIVE: no <header>")
    return RoadNetwork(
        frame=reader.frame(header),
        roads=tuple(reader.road(element) for element in root.iterchildren("road")),
        junctions=tuple(reader.junction(element) for element in root.iterchildren("junction")),
        controllers=tuple(reader.controller(element) for element in root.iterchildren("controller")),
        converter=header.get("vendor", ""),
        attribution=first_note(notes_of(header), "attribution"),
    )


def parse_opendrive(data: bytes, name: str) -> etree._Element:
    """Return the document's root, tags without namespaces; ``name`` is for messages.

    Raises :class:`UserError`.

    >>> parse_opendrive(b'<OpenDRIVE><header revMajor="1"/></OpenDRIVE>', "map.xodr")[0].get("revMajor")
    '1'
    """
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise UserError(
            f"{name}: not OpenDRIVE ({error}); expected an XML document <OpenDRIVE> ... </OpenDRIVE>"
        ) from error
    if b"xmlns" in data or root.nsmap:  # in any other encoding than ASCII's kin the root at least says so
        for element in root.iter(tag=etree.Element):
            if element.tag.startswith("{"):
                element.tag = etree.QName(element).localname
    if root.tag != "OpenDRIVE":
        raise UserError(f"{name}: not OpenDRIVE: the document is a <{root.tag}>, expected <OpenDRIVE>")
    return root


class _Reader(ValueReader):
    """Elements to types."""

    # --- header ----------------------------------------------------------------------------------------------
    def frame(self, header: etree._Element) -> LocalFrame:
        reference = header.findtext("geoReference") or ""
        values = dict(re.findall(r"\+(lat_0|lon_0)=(-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?=\s|$)", reference))
        if len(values) < 2:
            raise UserError(
                f"{self.name}: no origin in <geoReference> ({reference.strip()[:80]!r}); expected a PROJ string with "
                "+lat_0 and +lon_0, without which the map has no place on Earth"
            )
        return LocalFrame(float(values["lat_0"]), float(values["lon_0"]))

    # --- roads -----------------------------------------------------------------------------------------------
    def road(self, element: etree._Element) -> Road:
        length = self.number(element, "length")
        parts = _children(element)
        plan = tuple(piece for child in parts.get("planView", ()) for piece in self._plan(child))
        if not plan or not 0.0 < length <= _LONGEST_ROAD_M:
            raise self.fail(element, f"road of length {length:g} with {len(plan)} pieces of plan view")
        junction = element.get("junction", "-1")
        link, lanes = parts.get("link"), parts.get("lanes", ())
        objects = [child for child in parts.get("objects", ()) if child.tag == "object" and _corners(child)]
        notes = notes_of(element)
        return Road(
            id=self.text(element, "id"),
            length_m=length,
            plan=plan,
            lane_sections=tuple(self._sections(element, lanes, length)),
            elevation=self._cubics(child for child in parts.get("elevationProfile", ()) if child.tag == "elevation"),
            lane_offset=self._cubics(child for child in lanes if child.tag == "laneOffset"),
            name=element.get("name", ""),
            junction_id=None if junction == "-1" else junction,
            predecessor=None if link is None else self._road_link(link, "predecessor"),
            successor=None if link is None else self._road_link(link, "successor"),
            signals=tuple(self._signal(child) for child in parts.get("signals", ()) if child.tag == "signal"),
            crosswalks=tuple(self._crosswalk(each) for each in objects if each.get("type") == "crosswalk"),
            objects=tuple(self._object(each) for each in objects if each.get("type") in _READ_OBJECTS),
            highway=first_note(notes, "highway"),
            names=tuple(notes.get("altName", ())),
            osm_way_ids=self.note_integers(element, notes, "osmWays"),
            speed_mps=next(map(self._speed, element.iterfind("type/speed")), None),
            layer=sum(self.note_integers(element, notes, "layer")),
            bridge=first_note(notes, "bridge") == "true",
            tunnel=first_note(notes, "tunnel") == "true",
            lanes_from_tags=first_note(notes, "lanesFromTags") == "true",
            turn=first_note(notes, "turn") or None,
            inferred=first_note(notes, "inferred"),
            left_hand=element.get("rule") == "LHT",
            reversible=first_note(notes, "reversible"),
        )

    def _plan(self, geometry: etree._Element) -> Iterable[PlanElement]:
        if geometry.tag != "geometry":
            return ()
        number = self.number
        place = (number(geometry, "s"), number(geometry, "x"), number(geometry, "y"), number(geometry, "hdg"))
        length = number(geometry, "length")
        if not 0.0 <= length <= _LONGEST_ROAD_M:
            raise self.fail(geometry, f"<geometry> of length {length:g}; expected 0 to {_LONGEST_ROAD_M:g} m")
        shape = next(iter(geometry), None)
        if shape is None:
            raise self.fail(geometry, "<geometry> without a shape")
        match shape.tag:
            case "line":
                return (PlanElement(*place, length),)
            case "arc":
                return (PlanElement(*place, length, number(shape, "curvature")),)
            case "paramPoly3":
                a_u, b_u, c_u, d_u = (number(shape, key) for key in ("aU", "bU", "cU", "dU"))
                a_v, b_v, c_v, d_v = (number(shape, key) for key in ("aV", "bV", "cV", "dV"))
                normalized = shape.get("pRange", "normalized") == "normalized"
                poly = (a_u, b_u, c_u, d_u, a_v, b_v, c_v, d_v)
                return (PlanElement(*place, length, poly=poly, poly_normalized=normalized),)
            case "poly3":
                a, b, c, d = (number(shape, key) for key in "abcd")
                return (poly3_as_param_poly3(PlanElement(*place, length), a, b, c, d),)
            case "spiral":
                start, end = number(shape, "curvStart"), number(shape, "curvEnd")
                if not max(abs(start), abs(end)) * length <= _MOST_TURN_RAD:
                    raise self.fail(geometry, f"spiral of {length:g} m that turns more than {_MOST_TURN_RAD:g} rad")
                return spiral_as_arcs(PlanElement(*place, length), start, end)
            case other:
                raise self.fail(geometry, f"shape <{other}>: expected line, arc, spiral, poly3 or paramPoly3")

    def _cubics(self, elements: Iterable[etree._Element], key: str = "s") -> tuple[Cubic, ...]:
        return tuple(self._cubic(element, key) for element in elements)

    def _cubic(self, element: etree._Element, key: str) -> Cubic:
        get = element.get
        numbers = get(key, "0"), get("a", "0"), get("b", "0"), get("c", "0"), get("d", "0")
        cubic = _cubic_of(numbers)
        if cubic is None:  # say which number it is
            cubic = Cubic(*(self.number(element, name, 0.0) for name in (key, "a", "b", "c", "d")))
        return cubic

    def _road_link(self, link: etree._Element, which: str) -> RoadLink | None:
        element = next(link.iterchildren(which), None)
        if element is None:
            return None
        return RoadLink(self.text(element, "elementType"), self.text(element, "elementId"), self._contact(element))

    def _contact(self, element: etree._Element) -> ContactPoint | None:
        value = element.get("contactPoint")
        if value is None:
            return None
        if value not in ("start", "end"):
            raise self.fail(element, f"contactPoint={value!r}: expected start or end")
        return ContactPoint(value)

    def _speed(self, element: etree._Element) -> float | None:
        if element.get("max") in ("no limit", "undefined"):
            return None
        unit = element.get("unit", "m/s")
        if unit not in _MPS_PER_UNIT:
            raise self.fail(element, f"speed unit {unit!r}: expected one of {', '.join(_MPS_PER_UNIT)}")
        return self.number(element, "max") * _MPS_PER_UNIT[unit]

    def _signal(self, element: etree._Element) -> Signal:
        value = element.get("value")
        return Signal(
            id=self.text(element, "id"),
            s_m=self.number(element, "s"),
            t_m=self.number(element, "t"),
            type=element.get("type", ""),
            subtype=element.get("subtype", "-1"),
            name=element.get("name", ""),
            orientation=element.get("orientation", "none"),
            value=None if value in (None, "-1") else self.number(element, "value"),
            unit=element.get("unit"),
            dynamic=element.get("dynamic") == "yes",
            z_offset_m=self.number(element, "zOffset", 0.0),
            height_m=self.number(element, "height", 0.0),
            width_m=self.number(element, "width", 0.0),
            osm_node_id=self._osm_node(element),
        )

    def _osm_node(self, element: etree._Element) -> int | None:
        return next(iter(self.note_integers(element, notes_of(element), "osmNode")), None)

    def _outline(self, element: etree._Element) -> tuple[float, tuple[tuple[float, float], ...]]:
        """Return the position of an object, and its corners relative to the road.

        Corners given by s and t are used as if the road were straight.
        """
        s_m, t_m, turn = (self.number(element, key, 0.0) for key in ("s", "t", "hdg"))
        cosine, sine = math.cos(turn), math.sin(turn)
        outline: list[tuple[float, float]] = []
        for corner in _corners(element):
            if corner.tag == "cornerRoad":
                outline.append((self.number(corner, "s") - s_m, self.number(corner, "t")))
            else:
                u, v = self.number(corner, "u"), self.number(corner, "v")
                outline.append((u * cosine - v * sine, t_m + u * sine + v * cosine))
        return s_m, tuple(outline)

    def _object(self, element: etree._Element) -> RoadObject:
        s_m, outline = self._outline(element)
        return RoadObject(
            id=self.text(element, "id"),
            type=element.get("type", ""),
            name=element.get("name", ""),
            s_m=s_m,
            outline_m=outline,
            height_m=self.number(element, "height", 0.0),
            osm_node_id=self._osm_node(element),
        )

    def _crosswalk(self, element: etree._Element) -> Crosswalk:
        s_m, outline = self._outline(element)
        notes = notes_of(element)
        return Crosswalk(
            id=self.text(element, "id"),
            s_m=s_m,
            outline_m=outline,
            marked=first_note(notes, "marked") != "false",
            signals=first_note(notes, "signals") == "true",
            osm_node_id=self._osm_node(element),
        )

    # --- lanes -----------------------------------------------------------------------------------------------
    def _sections(
        self, road: etree._Element, lanes: Iterable[etree._Element], road_length_m: float
    ) -> Iterator[LaneSection]:
        sections = [child for child in lanes if child.tag == "laneSection"]
        sections.sort(key=lambda section: self.number(section, "s"))
        if not sections:
            raise self.fail(road, "<road> without a lane section")
        ends = [*(self.number(section, "s") for section in sections[1:]), road_length_m]
        for section, end in zip(sections, ends, strict=True):
            begin = self.number(section, "s")
            if not -1e-6 <= begin <= road_length_m:
                raise self.fail(section, f"lane section at s={begin:g} of a road of {road_length_m:g} m")
            # A section without length holds no place on the road and would have to be skipped by every query.
            if end - begin <= 1e-9 and len(sections) > 1:
                raise self.fail(section, f"lane section at s={begin:g} without length")
            sides = [side for side in section if side.tag in ("left", "center", "right")]
            read = [self._lane(lane) for side in sides for lane in side.iterchildren("lane")]
            read.sort(key=lambda lane: -lane.id)
            if not all(lane.widths for lane in read if lane.id):
                read = self._with_border_widths(section, read)
            yield LaneSection(begin, tuple(read))

    def _lane(self, element: etree._Element) -> Lane:
        parts = _children(element)
        notes = notes_of(element) if "userData" in parts else {}
        written = None
        if (mark := parts.get("roadMark")) is not None:
            written = _mark(mark.get("type", "none"), mark.get("color", "standard"), mark.get("laneChange", "both"))
        legal = _mark_of(first_note(notes, "legalMark"))
        link, speed = parts.get("link"), parts.get("speed")
        turns = first_note(notes, "turns")
        return Lane(
            id=self.integer(element, "id"),
            type=_LANE_TYPES.get(element.get("type", "none"), LaneType.NONE),
            widths=self._cubics(element.iterchildren("width"), "sOffset") if "width" in parts else (),
            predecessor=None if link is None else self._lane_link(link, "predecessor"),
            successor=None if link is None else self._lane_link(link, "successor"),
            # Which of the two marks is the road mark depends on how the map was written.
            mark=written if legal is None else _mark_of(first_note(notes, "mark")),
            legal_mark=legal,
            speed_mps=None if speed is None else self._speed(speed),
            turns=tuple(turns.split(";")) if turns else (),
            bus=any(
                each.get("rule") == "allow" and each.get("restriction") == "bus" for each in element.iter("access")
            ),
        )

    def _lane_link(self, link: etree._Element, which: str) -> int | None:
        element = next(link.iterchildren(which), None)
        return None if element is None else self.integer(element, "id")

    def _with_border_widths(self, section: etree._Element, lanes: list[Lane]) -> list[Lane]:
        """Return lanes with widths from their ``<border>``.

        A width is the distance to the next border inwards.
        """
        borders = {
            self.integer(lane, "id"): CubicProfile.of(self._cubics(lane.iterchildren("border"), "sOffset"))
            for lane in section.iterfind("*/lane")
            if lane.find("border") is not None and lane.find("width") is None
        }
        out = []
        for lane in lanes:
            if lane.id in borders:
                sign = 1 if lane.id > 0 else -1
                terms = [(float(sign), borders[lane.id])]
                if lane.id - sign in borders:
                    terms.append((-float(sign), borders[lane.id - sign]))
                width = CubicProfile.weighted_sum(terms)
                widths = tuple(Cubic(s, *piece) for s, piece in zip(width.knots_m, width.pieces, strict=True))
                lane = replace(lane, widths=widths)
            out.append(lane)
        return out

    # --- junctions -------------------------------------------------------------------------------------------
    def junction(self, element: etree._Element) -> Junction:
        notes = notes_of(element)
        return Junction(
            id=self.text(element, "id"),
            connections=tuple(
                self._connection(child)
                for child in element.iterchildren("connection")
                # Virtual and direct junctions (1.7) connect roads without connecting roads of their own.
                if child.get("connectingRoad") is not None and child.get("incomingRoad") is not None
            ),
            name=element.get("name", ""),
            osm_node_ids=self.note_integers(element, notes, "osmNodes"),
            kind=first_note(notes, "kind"),
            centre_xy_m=self._centre(element, notes),
            controller_ids=tuple(self.text(child, "id") for child in element.iterchildren("controller")),
        )

    def controller(self, element: etree._Element) -> Controller:
        return Controller(
            id=self.text(element, "id"),
            signal_ids=tuple(self.text(child, "signalId") for child in element.iterchildren("control")),
            name=element.get("name", ""),
            sequence=0 if element.get("sequence") is None else self.integer(element, "sequence"),
        )

    def _centre(self, element: etree._Element, notes: Notes) -> tuple[float, float] | None:
        text = first_note(notes, "centre")
        if not text:
            return None
        try:
            x, y = (float(part) for part in text.split())
        except ValueError:
            raise self.fail(element, f"userData centre {text!r}: expected two numbers") from None
        return x, y

    def _connection(self, element: etree._Element) -> Connection:
        contact = self._contact(element)
        if contact is None:
            raise self.fail(element, "<connection> without 'contactPoint'")
        links = ((self.integer(e, "from"), self.integer(e, "to")) for e in element.iterchildren("laneLink"))
        return Connection(
            id=self.text(element, "id"),
            incoming_road=self.text(element, "incomingRoad"),
            connecting_road=self.text(element, "connectingRoad"),
            contact_point=contact,
            lane_links=tuple(links),
        )


def _corners(element: etree._Element) -> list[etree._Element]:
    """Return corners of an object's first outline, from either place that OpenDRIVE allows.

    Fewer than three corners count as none.
    """
    outline = next(element.iter("outline"), None)
    corners = [] if outline is None else [corner for corner in outline if corner.tag in ("cornerLocal", "cornerRoad")]
    return corners if len(corners) >= 3 else []


def _children(element: etree._Element) -> dict[str, etree._Element]:
    """Return the first child of each kind."""
    return {child.tag: child for child in element.iterchildren(reversed=True)}


@lru_cache(maxsize=1024)
def _mark(kind: str, colour: str, lane_change: str) -> RoadMark:
    return RoadMark(kind, colour, lane_change)


@lru_cache(maxsize=1024)
def _mark_of(text: str) -> RoadMark | None:
    return RoadMark(*text.split(",")) if text.count(",") == 2 else None


@lru_cache(maxsize=1024)  # widths and heights of a map repeat
def _cubic_of(texts: tuple[str, str, str, str, str]) -> Cubic | None:
    """Parse a cubic; return None if one of the texts is not a finite number."""
    try:
        numbers = tuple(map(float, texts))
    except ValueError:
        return None
    return Cubic(*numbers) if all(map(math.isfinite, numbers)) else None
