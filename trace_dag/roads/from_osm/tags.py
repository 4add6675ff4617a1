"""What the tags of one OSM way say about the road: directions, lanes, widths, turns, speed, layer, names.

Real tags have all kinds of values (``maxspeed=signals``, ``lanes=many``, ``layer=ground``, ``width=20 ft``). A value
that cannot be read counts as untagged, and the usual value for the road's class is used instead
(:mod:`trace_dag.osm.road_classes`). No geometry here.
"""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.osm.road_classes import road_class
from trace_dag.osm.types import OsmWay
from trace_dag.roads.map.model import LaneType
from trace_dag.units import METRES_PER_FOOT, kmh_to_mps, mph_to_mps

_SINGLE_TRACK_WIDTH_M: Final = 2.25  # each half of a two-way way with lanes=1
_CENTRE_TURN_WIDTH_M: Final = 3.65
_MEDIAN_WIDTH_M: Final = 1.2
_PARKING_WIDTHS_M: Final = {"parallel": 2.2, "diagonal": 4.6, "perpendicular": 5.2, "lane": 2.2, "yes": 2.2}
_SHOULDER_WIDTH_M: Final = 2.4  # 8 ft
_MAX_LANES: Final = 12  # a larger number is a typing error
LEFT_TURNS: Final = frozenset({"left", "slight_left", "sharp_left", "reverse"})
RIGHT_TURNS: Final = frozenset({"right", "slight_right", "sharp_right"})
_NAME_KEYS: Final = (
    *("name", "ref", "alt_name", "name_1", "name_2", "alt_name_1", "official_name", "short_name", "loc_name"),
    *("old_name", "reg_name", "ref_1", "old_ref", "nat_ref", "unsigned_ref", "name:en", "adot_name", "bridge:name"),
)
_SPEED: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(mph|km/h|kmh|kph)?\s*$", re.IGNORECASE)
_METRES: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(m|ft)?\s*$", re.IGNORECASE)
_FEET_INCHES: Final = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*'\s*(?:(\d+(?:\.\d+)?)\s*\")?\s*$")
INFERRED_TAG: Final = "trace_dag:inferred"
"""On ways that are ours, not OpenStreetMap's: why they were drawn."""
_LEADING_INTEGER: Final = re.compile(r"^\s*(-?\d+)\b")


@dataclass(frozen=True)
class LaneSpec:
    """One lane of a cross-section: type, width in metres, and the turns painted on it (OSM's words)."""

    type: LaneType
    width_m: float
    turns: tuple[str, ...] = ()


@dataclass(frozen=True)
class CrossSection:
    """Lanes of a way from its middle outwards: ``forward`` right of the centre line, ``backward`` left of it.

    ``centre`` is a lane between the two directions (centre turn lane, median). ``offset_m`` is where the centre line
    lies left of the way's geometry: the carriageway is centred on the geometry unless ``placement`` says otherwise.
    """

    forward: tuple[LaneSpec, ...]
    backward: tuple[LaneSpec, ...] = ()
    centre: LaneSpec | None = None
    offset_m: float = 0.0

    @property
    def left(self) -> tuple[LaneSpec, ...]:
        """Lanes left of the centre line from it outwards, OpenDRIVE ids 1, 2, ..."""
        return self.backward if self.centre is None else (self.centre, *self.backward)

    def reversed(self) -> CrossSection:
        """The same road seen against the way's direction."""
        centre_width = self.centre.width_m if self.centre else 0.0
        return CrossSection(self.backward, self.forward, self.centre, -self.offset_m - centre_width)


@dataclass(frozen=True)
class WayProfile:
    """Everything the converter takes from a way's tags. One-way ways are always seen in their direction."""

    way_id: int
    highway: str
    service: str
    oneway: bool
    section: CrossSection
    lanes_from_tags: bool
    names: tuple[str, ...] = ()  # with escaped characters decoded, unlike the tags
    name: str = ""
    speed_forward_mps: float | None = None
    speed_backward_mps: float | None = None
    layer: int = 0
    bridge: bool = False
    tunnel: bool = False
    roundabout: bool = False
    incline: float | None = None  # rise per metre in the direction of the profile
    against_way: bool = False  # seen against the direction of the OSM way
    inferred: str = ""  # why the way was drawn, if it is not OpenStreetMap's

    def reversed(self) -> WayProfile:
        """The same way seen from its other end."""
        return replace(
            self,
            section=self.section.reversed(),
            speed_forward_mps=self.speed_backward_mps,
            speed_backward_mps=self.speed_forward_mps,
            incline=None if self.incline is None else -self.incline,
            against_way=not self.against_way,
        )

    @property
    def road_key(self) -> tuple[object, ...]:
        """The values that must be the same within one road object."""
        structure = self.layer, self.bridge, self.tunnel, self.roundabout
        return (self.highway, self.names, self.oneway, *structure, self.inferred)

    @property
    def rank(self) -> int:
        """0 for motorways up to 7 for service roads; a link ranks with its class."""
        return road_class(self.highway).rank

    @property
    def is_link(self) -> bool:
        """Whether the way is a ramp or slip road."""
        return self.highway.endswith("_link")


def read_profile(way: OsmWay, *, lanes_hint: int | None = None, speed_hint_mps: float | None = None) -> WayProfile:
    """The profile of a drivable way. Hints fill gaps: the total of lanes and the speed limit, if untagged.

    Ways tagged ``oneway=-1`` are returned in the direction of traffic with ``against_way`` set: reverse their nodes.

    >>> profile = read_profile(OsmWay(1, (1, 2), {"highway": "secondary", "lanes": "4", "maxspeed": "30 mph"}))
    >>> len(profile.section.forward), len(profile.section.backward), round(profile.speed_forward_mps, 2)
    (2, 2, 13.41)
    """
    tags = way.tags
    highway = tags.get("highway", "road")
    oneway = _oneway(tags, highway)
    if oneway == 0:
        section, tagged = _two_way_section(tags, highway, lanes_hint)
    else:
        section, tagged = _one_way_section(tags, highway, lanes_hint)
    speed = parse_speed_mps(tags.get("maxspeed"))
    forward = parse_speed_mps(tags.get("maxspeed:forward")) or speed or speed_hint_mps
    backward = parse_speed_mps(tags.get("maxspeed:backward")) or speed or speed_hint_mps
    bridge = tags.get("bridge", "no") not in ("no", "abandoned", "proposed")
    tunnel = tags.get("tunnel", "no") not in ("no", "culvert", "building_passage")
    incline = parse_incline(tags.get("incline"))
    reverse = oneway < 0
    return WayProfile(
        way_id=way.id,
        highway=highway,
        service=tags.get("service", ""),
        oneway=oneway != 0,
        section=section,
        lanes_from_tags=tagged,
        names=_names(tags),
        name=_plain(tags.get("name") or tags.get("ref") or ""),
        speed_forward_mps=backward if reverse else forward,
        speed_backward_mps=forward if reverse else backward,
        layer=_layer(tags, bridge=bridge, tunnel=tunnel),
        bridge=bridge,
        tunnel=tunnel,
        roundabout=tags.get("junction") in ("roundabout", "circular"),
        incline=-incline if reverse and incline is not None else incline,
        against_way=reverse,
        inferred=tags.get(INFERRED_TAG, ""),
    )


def parse_speed_mps(value: str | None) -> float | None:
    """``35 mph`` or ``60`` (km/h) in m/s; None for anything that is not a plausible limit (signals, none, walk, 0).

    >>> round(parse_speed_mps('25 mph'), 3), parse_speed_mps('36'), parse_speed_mps('signals')
    (11.176, 10.0, None)
    """
    match = _SPEED.match(value) if value else None
    if match is None:
        return None
    number = float(match[1])
    speed_mps = mph_to_mps(number) if (match[2] or "").lower() == "mph" else kmh_to_mps(number)
    return speed_mps if 1.0 <= speed_mps <= 45.0 else None


def parse_length_m(value: str | None) -> float | None:
    """``3.5``, ``3.5 m``, ``12 ft`` or ``12'6"`` in metres; None if unreadable.

    >>> parse_length_m('3.5 m'), round(parse_length_m('10 ft'), 3), parse_length_m('wide')
    (3.5, 3.048, None)
    """
    if not value:
        return None
    if match := _METRES.match(value):
        number = float(match[1])
        return number * METRES_PER_FOOT if (match[2] or "").lower() == "ft" else number
    if match := _FEET_INCHES.match(value):
        return (float(match[1]) + float(match[2] or 0) / 12) * METRES_PER_FOOT
    return None


def parse_incline(value: str | None) -> float | None:
    """``5%`` as rise per metre along the way; None for ``up`` and ``down``, which have no number.

    >>> parse_incline('5%'), parse_incline('up')
    (0.05, None)
    """
    match = re.match(r"^\s*([-+]?\d+(?:\.\d+)?)\s*%\s*$", value) if value else None
    if match is None:
        return None
    grade = float(match[1]) / 100
    return grade if abs(grade) <= 0.3 else None


def parse_turns(value: str | None) -> tuple[tuple[str, ...], ...]:
    """Turns painted on lanes as one tuple per lane, from left to right in the direction of travel.

    >>> parse_turns('left|through;right|')
    (('left',), ('through', 'right'), ())
    """
    if not value:
        return ()
    lanes = value.split("|")
    if len(lanes) > _MAX_LANES:
        return ()
    return tuple(tuple(t for t in lane.split(";") if t.strip() not in ("", "none")) for lane in lanes)


def _oneway(tags: Mapping[str, str], highway: str) -> int:
    value = tags.get("oneway")
    if value in ("yes", "1", "true"):
        return 1
    if value in ("-1", "reverse"):
        return -1
    if value is None and (tags.get("junction") in ("roundabout", "circular") or highway == "motorway"):
        return 1
    return 0


def _count(value: str | None, least: int = 1) -> int | None:
    match = _LEADING_INTEGER.match(value) if value else None
    if match is None:
        return None
    number = int(match[1])
    return number if least <= number <= _MAX_LANES else None


def _layer(tags: Mapping[str, str], *, bridge: bool, tunnel: bool) -> int:
    match = _LEADING_INTEGER.match(tags.get("layer", ""))
    if match is not None and -5 <= int(match[1]) <= 5:
        return int(match[1])
    return 1 if bridge else -1 if tunnel else 0


def _plain(value: str) -> str:
    """A name that its source escaped for XML before it wrote XML: ``Terry&apos;s`` is ``Terry's``.

    Extracts derived from other maps have such names; nine extracts of OpenStreetMap itself had none.
    """
    return html.unescape(value) if "&" in value and ";" in value else value


def _names(tags: Mapping[str, str]) -> tuple[str, ...]:
    names: dict[str, None] = {}
    for key in _NAME_KEYS:
        for part in _plain(tags.get(key, "")).split(";"):
            if part.strip():
                names[part.strip()] = None
    return tuple(names)


def _lane_width_m(tags: Mapping[str, str], highway: str, lanes: int) -> float:
    default = road_class(highway).lane_width_m
    total = parse_length_m(tags.get("width"))
    if total is None or not lanes:
        return default
    return min(max(total / lanes, 2.2), 5.5)


def _one_way_section(tags: Mapping[str, str], highway: str, hint: int | None) -> tuple[CrossSection, bool]:
    turns = parse_turns(tags.get("turn:lanes") or tags.get("turn:lanes:forward") or tags.get("turn:lanes:backward"))
    tagged = _count(tags.get("lanes")) or _count(tags.get("lanes:forward")) or (len(turns) or None)
    lanes = tagged or hint or road_class(highway).lanes_one_way
    forward = _lanes(lanes, turns, _lane_width_m(tags, highway, lanes))
    right = _roadside(tags, "right", oneway=True)
    width = sum(lane.width_m for lane in forward)
    offset = _placement(tags.get("placement") or tags.get("placement:forward"), forward)
    section = CrossSection(forward + right, offset_m=width / 2 if offset is None else offset)
    return section, tagged is not None


def _two_way_section(tags: Mapping[str, str], highway: str, hint: int | None) -> tuple[CrossSection, bool]:
    turns_forward = parse_turns(tags.get("turn:lanes:forward"))
    turns_backward = parse_turns(tags.get("turn:lanes:backward"))
    total = _count(tags.get("lanes"))
    forward = _count(tags.get("lanes:forward")) or (len(turns_forward) or None)
    backward = _count(tags.get("lanes:backward")) or (len(turns_backward) or None)
    tagged = total is not None or (forward is not None and backward is not None)
    forward, backward, centre = _split_directions(
        total or (hint if not (forward or backward) else None), forward, backward, _has_centre_turn_lane(tags)
    )
    single_track = total == 1 and forward == backward == 1
    width = _lane_width_m(tags, highway, 1 if single_track else forward + backward + int(centre))
    if single_track:
        width = max(width / 2, _SINGLE_TRACK_WIDTH_M) if "width" in tags else _SINGLE_TRACK_WIDTH_M
    ahead = _lanes(forward, turns_forward, width)
    back = _lanes(backward, turns_backward, width)
    middle: LaneSpec | None = None
    if centre:
        middle = LaneSpec(LaneType.BIDIRECTIONAL, min(_CENTRE_TURN_WIDTH_M, max(width, 3.0)))
    elif tags.get("median", "no") != "no" or "median:width" in tags:
        middle = LaneSpec(LaneType.MEDIAN, parse_length_m(tags.get("median:width")) or _MEDIAN_WIDTH_M)
    width_right = sum(lane.width_m for lane in ahead)
    width_left = sum(lane.width_m for lane in back) + (middle.width_m if middle else 0.0)
    offset = _placement(tags.get("placement:forward"), ahead)
    if offset is None and (mirrored := _placement(tags.get("placement:backward"), back)) is not None:
        offset = -mirrored - (middle.width_m if middle else 0.0)
    section = CrossSection(
        ahead + _roadside(tags, "right", oneway=False),
        back + _roadside(tags, "left", oneway=False),
        middle,
        (width_right - width_left) / 2 if offset is None else offset,
    )
    return section, tagged


def _has_centre_turn_lane(tags: Mapping[str, str]) -> bool:
    both = _count(tags.get("lanes:both_ways"), least=0)
    if both is not None:
        return both > 0
    return tags.get("centre_turn_lane") == "yes" or tags.get("turn:lanes:both_ways", "none") not in ("none", "")


def _split_directions(
    total: int | None, forward: int | None, backward: int | None, centre: bool
) -> tuple[int, int, bool]:
    """Lanes forward, lanes backward, and whether there is a centre lane, from those tags that are there."""
    if forward is not None and backward is not None:
        known = forward + backward
        return forward, backward, centre if total is None else total > known
    if total is None:
        return forward or 1, backward or 1, centre
    centre = centre and total >= 3
    rest = total - int(centre)
    if forward is not None:
        return forward, max(rest - forward, 1), centre
    if backward is not None:
        return max(rest - backward, 1), backward, centre
    if rest >= 3 and rest % 2 and not centre:
        return rest // 2, rest // 2, True  # three or five lanes both ways: in the US the middle one is for turning
    return max(rest - rest // 2, 1), max(rest // 2, 1), centre


def _lanes(count: int, turns: tuple[tuple[str, ...], ...], width_m: float) -> tuple[LaneSpec, ...]:
    if len(turns) != count:
        turns = ((),) * count
    return tuple(LaneSpec(LaneType.DRIVING, width_m, lane_turns) for lane_turns in turns)


def _placement(value: str | None, lanes: tuple[LaneSpec, ...]) -> float | None:
    """Distance from the inner border of ``lanes`` to the way's geometry by OSM's ``placement``."""
    match = re.match(r"^(left_of|middle_of|right_of):(\d+)$", value) if value else None
    if match is None or not 1 <= int(match[2]) <= len(lanes):
        return None
    number = int(match[2])
    inner = sum(lane.width_m for lane in lanes[: number - 1])
    share = {"left_of": 0.0, "middle_of": 0.5, "right_of": 1.0}[match[1]]
    return inner + share * lanes[number - 1].width_m


def _roadside(tags: Mapping[str, str], side: str, *, oneway: bool) -> tuple[LaneSpec, ...]:
    """Shoulder and parking lane of one side, from the carriageway outwards."""
    lanes: list[LaneSpec] = []
    shoulder = tags.get(f"shoulder:{side}") or tags.get("shoulder:both") or tags.get("shoulder", "no")
    if shoulder in ("yes", "both", side) and not (oneway and side == "left"):
        width = parse_length_m(tags.get(f"shoulder:{side}:width") or tags.get("shoulder:width"))
        lanes.append(LaneSpec(LaneType.SHOULDER, min(max(width or _SHOULDER_WIDTH_M, 0.5), 4.0)))
    parking = tags.get(f"parking:{side}") or tags.get("parking:both") or ""
    if parking in ("lane", "yes"):
        parking = tags.get(f"parking:{side}:orientation") or tags.get("parking:both:orientation") or parking
    parking = parking or tags.get(f"parking:lane:{side}") or tags.get("parking:lane:both") or ""
    if parking in _PARKING_WIDTHS_M:
        lanes.append(LaneSpec(LaneType.PARKING, _PARKING_WIDTHS_M[parking]))
    return tuple(lanes)
