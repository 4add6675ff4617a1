"""A road network written as OpenDRIVE 1.7 (ASAM), readable by CARLA, SUMO and esmini.

Values that OpenDRIVE has no place for (OSM class, names, way ids, layer, painted turns, legal marks) are stored in
``<userData>``, which other readers skip. So a map written here reads back unchanged. A map of a town centre has a
hundred thousand elements, so the text is joined directly, in a third of the time of an element tree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Final, Literal

from trace_dag.common.units import mps_to_mph
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.map.model import (
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

_MARK_WIDTH_M: Final = "0.12"
_SPECIAL: Final = re.compile("[&<>\"'\t\n\r]|[^\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ENTITIES: Final = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&apos;"}
_LIGHT: Final = "1000001"
_GIVE_WAY: Final = frozenset({"205", "206"})
_CENTRE: Final = Lane(0, LaneType.NONE, ())

Marks = Literal["reconstruction", "legal"]


def write_opendrive(network: RoadNetwork, *, marks: Marks = "reconstruction") -> bytes:
    """Return the network as OpenDRIVE 1.7, UTF-8; equal networks give equal bytes.

    ``marks="legal"`` writes the marks that the law requires; the default marks allow traffic to cross the centre line
    and drive the wrong way.
    """
    out = ['<?xml version="1.0" encoding="UTF-8"?>\n<OpenDRIVE>\n']
    _write_header(out, network)
    for road in network.roads:
        # Without references to its lights, readers take a junction for one without lights.
        lights = [signal for signal in _signals_before(network, road) if signal.type == _LIGHT]
        _write_road(out, road, marks, lights)
    out.extend(map(_controller, network.controllers))
    for junction in network.junctions:
        _write_junction(out, junction, _priorities(network, junction))
    out.append("</OpenDRIVE>\n")
    return "".join(out).encode()


def _text(value: str) -> str:
    """Return text as an attribute's value: without characters forbidden by XML 1.0, white space as spaces."""
    return _SPECIAL.sub(lambda match: _ENTITIES.get(match[0], " " if match[0] in "\t\n\r" else ""), value)


def _number(value: float) -> str:
    """Return a number of metres or seconds as the shortest text that is exact to 1e-10."""
    text = f"{value:.10f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _last_start(start_m: float, length_m: float) -> str:
    """Return the beginning of a road's last lane section such that, as written, it ends within the road.

    CARLA adds the beginning and the length, and rejects the map if the sum is beyond the end by its last bit.
    """
    text, length = _number(start_m), float(_number(length_m))
    while (start := float(text)) + (length - start) > length:
        text = _number(start - 1e-10)
    return text


def _coefficient(value: float) -> str:
    """Return a curvature or polynomial coefficient with 12 digits, because small numbers count over long distances."""
    return "0" if value == 0 else f"{value:.12g}"


def _user_data(code: str, value: object) -> str:
    return "" if value in ("", None) else f'<userData code="{code}" value="{_text(str(value))}"/>\n'


def _write_header(out: list[str], network: RoadNetwork) -> None:
    extent = ""
    points = [(element.x_m, element.y_m) for road in network.roads for element in road.plan]
    if points:
        xs, ys = [x for x, _ in points], [y for _, y in points]
        sides = {"north": max(ys), "south": min(ys), "east": max(xs), "west": min(xs)}
        extent = "".join(f' {side}="{_number(value)}"' for side, value in sides.items())
    out.append(
        f'<header revMajor="1" revMinor="7" name="" version="1"{extent} '
        f'vendor="{_text(network.converter or "trace-dag")}">\n'
        f"<geoReference><![CDATA[{network.frame.proj}]]></geoReference>\n"
        f"{_user_data('attribution', network.attribution)}</header>\n"
    )


def _signals_before(network: RoadNetwork, road: Road) -> list[Signal]:
    """Return the signals that traffic passes on the way to a connecting road."""
    link = road.predecessor
    origin = None if link is None else network.road_by_id.get(link.element_id)
    if origin is None or link is None or road.junction_id is None:
        return []
    towards = "+" if link.contact_point is ContactPoint.END else "-"
    return [signal for signal in origin.signals if signal.orientation == towards]


def _priorities(network: RoadNetwork, junction: Junction) -> list[tuple[str, str]]:
    """Return pairs of connecting roads, the one with the right of way first, by stop and yield signs."""
    roads = [network.road_by_id[each.connecting_road] for each in junction.connections]
    types = {road.id: {signal.type for signal in _signals_before(network, road)} for road in roads}
    if any(_LIGHT in each for each in types.values()):
        return []
    low = [road_id for road_id, each in types.items() if each & _GIVE_WAY]
    high = [road_id for road_id, each in types.items() if not each & _GIVE_WAY]
    return [(major, minor) for major in high for minor in low]


def _write_road(out: list[str], road: Road, marks: Marks, lights: Iterable[Signal]) -> None:
    junction = "-1" if road.junction_id is None else road.junction_id
    out.append(
        f'<road name="{_text(road.name)}" length="{_number(road.length_m)}" id="{road.id}" junction="{junction}" '
        f'rule="{"LHT" if road.left_hand else "RHT"}">\n<link>\n{_road_link("predecessor", road.predecessor)}'
        f"{_road_link('successor', road.successor)}</link>\n"
        f'<type s="0" type="{road_class(road.highway).opendrive_type}" country="US">\n'
    )
    if road.speed_mps is not None:
        out.append(f'<speed max="{_mph(road.speed_mps)}" unit="mph"/>\n')
    out.append("</type>\n<planView>\n")
    out.extend(map(_geometry, road.plan))
    out.append("</planView>\n<elevationProfile>\n")
    out.extend(_cubics("elevation", "s", road.elevation or (Cubic(0.0, 0.0),)))
    out.append("</elevationProfile>\n<lateralProfile/>\n<lanes>\n")
    out.extend(_cubics("laneOffset", "s", road.lane_offset))
    for section in road.lane_sections[:-1]:
        _write_section(out, section, _number(section.s_m), marks)
    for section in road.lane_sections[-1:]:
        _write_section(out, section, _last_start(section.s_m, road.length_m), marks)
    out.append("</lanes>\n<objects>\n")
    out.extend(map(_crosswalk, road.crosswalks))
    out.extend(map(_object, road.objects))
    length = _number(road.length_m)
    if road.tunnel:
        out.append(f'<tunnel id="{road.id}" s="0" length="{length}" type="standard"/>\n')
    if road.bridge:
        out.append(f'<bridge id="{road.id}" s="0" length="{length}" type="concrete"/>\n')
    out.append("</objects>\n<signals>\n")
    out.extend(_signal(road, signal) for signal in road.signals)
    lanes = [lane.id for lane in road.lane_sections[0].lanes if lane.id and lane.type.drivable]
    out.extend(_signal_reference(lanes, signal) for signal in lights if lanes)
    out.append("</signals>\n")
    out.append(_user_data("highway", road.highway))
    out.extend(_user_data("altName", name) for name in road.names)
    out.append(_user_data("osmWays", " ".join(map(str, road.osm_way_ids))))
    out.append(_user_data("layer", road.layer or None))
    for code, flag in (("bridge", road.bridge), ("tunnel", road.tunnel), ("lanesFromTags", road.lanes_from_tags)):
        if flag:
            out.append(_user_data(code, "true"))
    if road.speed_mps is None:
        out.append(_user_data("assumedSpeedMph", _mph(road_class(road.highway).speed_mps)))
    out.append(_user_data("turn", road.turn))
    out.append(_user_data("inferred", road.inferred))
    out.append(_user_data("reversible", road.reversible))
    out.append("</road>\n")


def _mph(speed_mps: float) -> str:
    return _number(round(mps_to_mph(speed_mps), 6))


def _road_link(tag: str, target: RoadLink | None) -> str:
    if target is None:
        return ""
    contact = "" if target.contact_point is None else f' contactPoint="{target.contact_point.value}"'
    return f'<{tag} elementType="{target.element_type}" elementId="{target.element_id}"{contact}/>\n'


def _geometry(piece: PlanElement) -> str:
    if piece.poly is not None:
        names = ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV")
        numbers = " ".join(f'{name}="{_coefficient(c)}"' for name, c in zip(names, piece.poly, strict=True))
        shape = f'<paramPoly3 {numbers} pRange="{"normalized" if piece.poly_normalized else "arcLength"}"/>'
    elif piece.curvature_1pm:
        shape = f'<arc curvature="{piece.curvature_1pm:.12g}"/>'
    else:
        shape = "<line/>"
    heading = math.remainder(piece.heading_rad, math.tau)
    return (
        f'<geometry s="{_number(piece.s_m)}" x="{_number(piece.x_m)}" y="{_number(piece.y_m)}" '
        f'hdg="{_coefficient(heading)}" length="{_number(piece.length_m)}">{shape}</geometry>\n'
    )


def _cubics(tag: str, key: str, cubics: Iterable[Cubic]) -> list[str]:
    return [
        f'<{tag} {key}="{_number(cubic.s_m)}" a="{_coefficient(cubic.a)}" b="{_coefficient(cubic.b)}" '
        f'c="{_coefficient(cubic.c)}" d="{_coefficient(cubic.d)}"/>\n'
        for cubic in cubics
    ]


def _write_section(out: list[str], section: LaneSection, start: str, marks: Marks) -> None:
    out.append(f'<laneSection s="{start}">\n')
    ordered = sorted(section.lanes, key=lambda lane: -lane.id)
    sides = {
        "left": [lane for lane in ordered if lane.id > 0],
        "center": [lane for lane in ordered if lane.id == 0] or [_CENTRE],
        "right": [lane for lane in ordered if lane.id < 0],
    }
    for side, lanes in sides.items():
        if lanes:
            out += [f"<{side}>\n", *(_lane(lane, marks) for lane in lanes), f"</{side}>\n"]
    out.append("</laneSection>\n")


def _lane(lane: Lane, marks: Marks) -> str:
    parts = [f'<lane id="{lane.id}" type="{lane.type.value}" level="false">\n']
    if lane.predecessor is not None or lane.successor is not None:
        before = "" if lane.predecessor is None else f'<predecessor id="{lane.predecessor}"/>'
        after = "" if lane.successor is None else f'<successor id="{lane.successor}"/>'
        parts.append(f"<link>{before}{after}</link>\n")
    if lane.id:
        parts.extend(_cubics("width", "sOffset", lane.widths))
    written = lane.legal_mark if marks == "legal" and lane.legal_mark is not None else lane.mark
    if written is not None:
        parts.append(_road_mark(written))
    if lane.speed_mps is not None:
        parts.append(f'<speed sOffset="0" max="{_mph(lane.speed_mps)}" unit="mph"/>\n')
    if lane.bus:
        parts.append('<access sOffset="0" rule="allow" restriction="bus"/>\n')
    if lane.turns:
        parts.append(_user_data("turns", ";".join(lane.turns)))
    if lane.legal_mark is not None:
        parts.append(_user_data("mark", _mark_text(lane.mark)))
        parts.append(_user_data("legalMark", _mark_text(lane.legal_mark)))
    parts.append("</lane>\n")
    return "".join(parts)


def _mark_text(mark: RoadMark | None) -> str:
    return "" if mark is None else f"{mark.type},{mark.colour},{mark.lane_change}"


def _road_mark(mark: RoadMark) -> str:
    width = "0" if mark.type == "none" else _MARK_WIDTH_M
    return (
        f'<roadMark sOffset="0" type="{mark.type}" weight="standard" color="{mark.colour}" material="standard" '
        f'width="{width}" laneChange="{mark.lane_change}"/>\n'
    )


def _signal(road: Road, signal: Signal) -> str:
    """Write a signal with its lanes.

    Without them CARLA assigns it to the lanes of the opposite direction.
    """
    lanes = road.lanes_under(signal)
    sides = [side for side in ([i for i in lanes if i < 0], [i for i in lanes if i > 0]) if side]
    value = "" if signal.value is None else f' value="{_number(signal.value)}"'
    unit = "" if signal.value is None or signal.unit is None else f' unit="{_text(signal.unit)}"'
    return (
        f'<signal s="{_number(signal.s_m)}" t="{_number(signal.t_m)}" id="{signal.id}" name="{_text(signal.name)}" '
        f'dynamic="{"yes" if signal.dynamic else "no"}" orientation="{signal.orientation}" '
        f'zOffset="{_number(signal.z_offset_m)}" country="US" type="{_text(signal.type)}" '
        f'subtype="{_text(signal.subtype)}"{value}{unit} hOffset="0" pitch="0" roll="0" '
        f'height="{_number(signal.height_m)}" width="{_number(signal.width_m)}">\n'
        + "".join(f'<validity fromLane="{min(side)}" toLane="{max(side)}"/>\n' for side in sides)
        + f"{_user_data('osmNode', signal.osm_node_id)}</signal>\n"
    )


def _signal_reference(lanes: Sequence[int], signal: Signal) -> str:
    """Write a reference from a connecting road's lanes to the light on the way to it."""
    return (
        f'<signalReference s="0" t="0" id="{signal.id}" orientation="+">\n'
        f'<validity fromLane="{min(lanes)}" toLane="{max(lanes)}"/>\n</signalReference>\n'
    )


def _crosswalk(crosswalk: Crosswalk) -> str:
    notes = (
        ("marked", "" if crosswalk.marked else "false"),
        ("signals", "true" if crosswalk.signals else ""),
        ("osmNode", crosswalk.osm_node_id),
    )
    described = RoadObject(crosswalk.id, "crosswalk", "crosswalk", crosswalk.s_m, crosswalk.outline_m)
    return _object(described, "".join(_user_data(code, value) for code, value in notes))


def _object(thing: RoadObject, notes: str | None = None) -> str:
    """Write an object with its outline directly inside it.

    CARLA ignores ``<outlines>``, and 1.7 allows both.
    """
    ahead, left = zip(*thing.outline_m, strict=True)
    height = _number(thing.height_m)
    corners = "".join(
        f'<cornerLocal u="{_number(u)}" v="{_number(v)}" z="0" height="{height}" id="{number}"/>'
        for number, (u, v) in enumerate(thing.outline_m)
    )
    return (
        f'<object type="{thing.type}" id="{thing.id}" name="{_text(thing.name)}" s="{_number(thing.s_m)}" t="0" '
        f'zOffset="0" orientation="none" hdg="0" pitch="0" roll="0" height="{height}" '
        f'length="{_number(max(ahead) - min(ahead))}" '
        f'width="{_number(max(left) - min(left))}">\n<outline id="0" closed="true" outer="true">'
        f"{corners}</outline>\n{_user_data('osmNode', thing.osm_node_id) if notes is None else notes}</object>\n"
    )


def _controller(controller: Controller) -> str:
    controls = "".join(f'<control signalId="{signal_id}"/>' for signal_id in controller.signal_ids)
    return (
        f'<controller id="{controller.id}" name="{_text(controller.name)}" sequence="{controller.sequence}">'
        f"{controls}</controller>\n"
    )


def _write_junction(out: list[str], junction: Junction, priorities: Iterable[tuple[str, str]]) -> None:
    out.append(f'<junction name="{_text(junction.name)}" id="{junction.id}" type="default">\n')
    for connection in junction.connections:
        links = "".join(f'<laneLink from="{origin}" to="{target}"/>' for origin, target in connection.lane_links)
        out.append(
            f'<connection id="{connection.id}" incomingRoad="{connection.incoming_road}" '
            f'connectingRoad="{connection.connecting_road}" contactPoint="{connection.contact_point.value}">'
            f"{links}</connection>\n"
        )
    out.extend(f'<priority high="{high}" low="{low}"/>\n' for high, low in priorities)
    for sequence, controller_id in enumerate(junction.controller_ids):
        out.append(f'<controller id="{controller_id}" sequence="{sequence}"/>\n')
    out.append(_user_data("osmNodes", " ".join(map(str, junction.osm_node_ids))))
    out.append(_user_data("kind", junction.kind))
    if junction.centre_xy_m is not None:
        out.append(_user_data("centre", " ".join(map(_number, junction.centre_xy_m))))
    out.append("</junction>\n")
