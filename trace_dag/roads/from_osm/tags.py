"""Tags of one OSM way read for a road: directions, lanes, widths, turns, speed, layer, names.

Real tags have all kinds of values (``maxspeed=signals``, ``lanes=many``, ``layer=ground``, ``width=20 ft``). A value
that cannot be read counts as untagged, and the usual value for the road's class is used instead
(:mod:`trace_dag.osm.road_classes`); the profile has a note on it. The number of lanes is read by
:mod:`trace_dag.roads.from_osm.lane_tags`. No geometry here.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.common.messages.wording import count_of
from trace_dag.osm.road_classes import road_class
from trace_dag.osm.types import OsmWay
from trace_dag.roads.from_osm.lane_tags import LaneReading, TaggedLane, read_lanes
from trace_dag.roads.from_osm.tag_values import MOST_LANES, parse_integer, parse_length_m, parse_speed_mps, read_beside
from trace_dag.roads.from_osm.way_direction import REVERSIBLE_TAG, TURNED_TAG
from trace_dag.roads.map.model import LaneType

_SINGLE_TRACK_WIDTH_M: Final = 2.25  # each half of a two-way way with lanes=1
_CENTRE_TURN_WIDTH_M: Final = 3.65
_MEDIAN_WIDTH_M: Final = 1.2
_PARKING_WIDTHS_M: Final = {"parallel": 2.2, "diagonal": 4.6, "perpendicular": 5.2, "lane": 2.2, "yes": 2.2}
_SHOULDER_WIDTH_M: Final = 2.4  # 8 ft
_NARROWEST_M: Final = 2.2  # a lane of a public road; a ``width`` that leaves less contradicts the number of lanes
_NARROWEST_TRACK_M: Final = 1.0  # half of a track on which two cars cannot pass
_WIDEST_M: Final = 5.5
_NO_LIMITS: Final = frozenset({"none", "signals", "variable", "walk", "unposted", "default", "implicit", "unknown"})
LEFT_TURNS: Final = frozenset({"left", "slight_left", "sharp_left", "reverse"})
RIGHT_TURNS: Final = frozenset({"right", "slight_right", "sharp_right"})
_NAME_KEYS: Final = (
    *(
        "name",
        "name:left",
        "name:right",
        "ref",
        "alt_name",
        "name_1",
        "name_2",
        "alt_name_1",
        "official_name",
        "short_name",
        "loc_name",
    ),
    *("old_name", "reg_name", "ref_1", "old_ref", "nat_ref", "unsigned_ref", "name:en", "adot_name", "bridge:name"),
)
INFERRED_TAG: Final = "trace_dag:inferred"
"""On ways that are ours, not OpenStreetMap's: why they were drawn."""


@dataclass(frozen=True)
class LaneSpec:
    """One lane of a cross-section.

    It has the type, width in metres, painted turns (OSM's words), own limit, permitted lane changes (``change:lanes``),
    and whether it is for buses only.
    """

    type: LaneType
    width_m: float
    turns: tuple[str, ...] = ()
    speed_mps: float | None = None
    change: str = ""
    bus: bool = False


@dataclass(frozen=True)
class CrossSection:
    """Lanes of a way from its middle outwards: ``forward`` right of the centre line, ``backward`` left of it.

    ``centre`` is a lane between the two directions (centre turn lane, median). ``offset_m`` is the distance of the
    centre line to the left of the way's geometry: the carriageway is centred on the geometry unless ``placement`` says
    otherwise.
    """

    forward: tuple[LaneSpec, ...]
    backward: tuple[LaneSpec, ...] = ()
    centre: LaneSpec | None = None
    offset_m: float = 0.0

    @property
    def left(self) -> tuple[LaneSpec, ...]:
        """Return lanes left of the centre line, outwards from it: OpenDRIVE ids 1, 2, ..."""
        return self.backward if self.centre is None else (self.centre, *self.backward)

    def reversed(self) -> CrossSection:
        """Return the same road seen against the way's direction."""
        centre_width = self.centre.width_m if self.centre else 0.0
        return CrossSection(self.backward, self.forward, self.centre, -self.offset_m - centre_width)


@dataclass(frozen=True)
class WayProfile:
    """All facts that the converter takes from a way's tags.

    ``oneway``: no lane goes the other way. ``reversible``: the reason why its one-way traffic may go the other way at
    other times. ``not_followed`` has the tags that contradict others or cannot be read.
    """

    way_id: int
    highway: str
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
    against_way: bool = False  # seen against the direction of the way
    turned: bool = False  # the way is OpenStreetMap's reversed
    inferred: str = ""  # why the way was drawn, if it is not OpenStreetMap's
    reversible: str = ""
    not_followed: tuple[str, ...] = ()

    def reversed(self) -> WayProfile:
        """Return the same way seen from its other end."""
        return replace(
            self,
            section=self.section.reversed(),
            speed_forward_mps=self.speed_backward_mps,
            speed_backward_mps=self.speed_forward_mps,
            against_way=not self.against_way,
        )

    @property
    def road_key(self) -> tuple[object, ...]:
        """Return the values that must be the same within one road object."""
        structure = self.layer, self.bridge, self.tunnel, self.roundabout
        return (self.highway, self.names, self.oneway, *structure, self.inferred, self.reversible)

    @property
    def rank(self) -> int:
        """Return 0 for motorways up to 7 for service roads; a link has the rank of its class."""
        return road_class(self.highway).rank

    @property
    def is_link(self) -> bool:
        """Return whether the way is a ramp or slip road."""
        return self.highway.endswith("_link")


def read_profile(way: OsmWay, *, lanes_hint: int | None = None, speed_hint_mps: float | None = None) -> WayProfile:
    """Return the profile of a drivable way.

    Hints give the total of lanes and the speed limit if untagged.

    >>> profile = read_profile(OsmWay(1, (1, 2), {"highway": "secondary", "lanes": "4", "maxspeed": "30 mph"}))
    >>> len(profile.section.forward), len(profile.section.backward), round(profile.speed_forward_mps, 2)
    (2, 2, 13.41)
    """
    tags = way.tags
    highway = tags.get("highway", "road")
    oneway = goes_one_way(tags)
    reading = read_lanes(tags, oneway=oneway, hint=lanes_hint)
    both_ways = not oneway or bool(reading.backward)
    notes = [*reading.not_followed]
    section = (_two_way_section if both_ways else _one_way_section)(tags, highway, reading, notes)
    notes += _unreadable(tags)
    speed = parse_speed_mps(tags.get("maxspeed"))
    forward, backward = (
        parse_speed_mps(tags.get(f"maxspeed:{direction}"))
        or speed
        or max((lane.speed_mps for lane in lanes if lane.speed_mps is not None), default=speed_hint_mps)
        for direction, lanes in (("forward", reading.forward), ("backward", reading.backward))
    )
    bridge = tags.get("bridge", "no") not in ("no", "abandoned", "proposed")
    tunnel = tags.get("tunnel", "no") not in ("no", "culvert", "building_passage")
    return WayProfile(
        way_id=way.id,
        highway=highway,
        oneway=not both_ways,
        section=section,
        lanes_from_tags=reading.tagged,
        names=_names(tags),
        name=_plain(tags.get("name") or tags.get("name:left") or tags.get("name:right") or tags.get("ref") or ""),
        speed_forward_mps=forward,
        speed_backward_mps=backward,
        layer=_layer(tags, bridge=bridge, tunnel=tunnel),
        bridge=bridge,
        tunnel=tunnel,
        roundabout=tags.get("junction") in ("roundabout", "circular"),
        inferred=tags.get(INFERRED_TAG, ""),
        reversible=tags.get(REVERSIBLE_TAG, ""),
        turned=TURNED_TAG in tags,
        not_followed=tuple(notes),
    )


def only_left(turns: Collection[str]) -> bool:
    """Return whether the turns painted on a lane all go left: whether it is a pocket for them.

    >>> only_left(("left", "reverse")), only_left(("left", "through")), only_left(())
    (True, False, False)
    """
    return bool(turns) and LEFT_TURNS.issuperset(turns)


def goes_one_way(tags: Mapping[str, str]) -> bool:
    """Return whether traffic only goes one way, along the way (:mod:`trace_dag.roads.from_osm.way_direction`).

    >>> goes_one_way({"highway": "motorway"}), goes_one_way({"highway": "primary", "oneway": "no"})
    (True, False)
    """
    value = tags.get("oneway")
    if value is None:
        return tags.get("junction") in ("roundabout", "circular") or tags.get("highway") == "motorway"
    return value in ("yes", "1", "true")


def _unreadable(tags: Mapping[str, str]) -> Iterator[str]:
    """Yield tags of lanes, widths and limits with unreadable values."""
    for key, value in tags.items():
        if key.split(":")[0] == "maxspeed" and key.split(":")[-1] in ("maxspeed", "forward", "backward"):
            if "lanes" not in key and value not in _NO_LIMITS and parse_speed_mps(value) is None:
                yield f"{key}={value}, which is no one limit"
        elif (key in ("width", "width:carriageway") and parse_length_m(value) is None) or (
            key in ("lanes", "lanes:forward", "lanes:backward") and parse_integer(value, 1, MOST_LANES) is None
        ):
            yield f"{key}={value}, which cannot be read"


def _layer(tags: Mapping[str, str], *, bridge: bool, tunnel: bool) -> int:
    tagged = parse_integer(tags.get("layer"), -5, 5)
    return tagged if tagged is not None else 1 if bridge else -1 if tunnel else 0


def _plain(value: str) -> str:
    """Return a name without XML escapes in its text: ``Terry&apos;s`` is ``Terry's``.

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


def _one_way_section(tags: Mapping[str, str], highway: str, reading: LaneReading, notes: list[str]) -> CrossSection:
    right, left = (_roadside(tags, side, oneway=True) for side in ("right", "left"))
    forward = _lanes(reading.forward, _lane_width_m(tags, highway, reading, [right, left], notes))
    width = math.fsum(lane.width_m for lane in forward)
    offset = _placement(tags, ("placement", "placement:forward"), forward, notes)
    return CrossSection(forward + right, left, offset_m=width / 2 if offset is None else offset)


def _two_way_section(tags: Mapping[str, str], highway: str, reading: LaneReading, notes: list[str]) -> CrossSection:
    right, left = _roadside(tags, "right", oneway=False), _roadside(tags, "left", oneway=False)
    width_m = _lane_width_m(tags, highway, reading, [right, left], notes)
    ahead, back = _lanes(reading.forward, width_m), _lanes(reading.backward, width_m)
    middle: LaneSpec | None = None
    if reading.centre is not None:
        centre_m = min(_CENTRE_TURN_WIDTH_M, max(width_m, 3.0))
        middle = LaneSpec(LaneType.BIDIRECTIONAL, reading.centre.width_m or centre_m)
    elif tags.get("median", "no") != "no" or "median:width" in tags:
        middle = LaneSpec(LaneType.MEDIAN, parse_length_m(tags.get("median:width")) or _MEDIAN_WIDTH_M)
    width_right = math.fsum(lane.width_m for lane in ahead)
    width_left = math.fsum(lane.width_m for lane in back) + (middle.width_m if middle else 0.0)
    offset = _placement(tags, ("placement:forward",), ahead, notes)
    if offset is None and (mirrored := _placement(tags, ("placement:backward",), back, notes)) is not None:
        offset = -mirrored - (middle.width_m if middle else 0.0)
    if "placement" in tags:
        notes.append(f"placement={tags['placement']}, without a direction on a road both ways")
    return CrossSection(
        ahead + right, back + left, middle, (width_right - width_left) / 2 if offset is None else offset
    )


def _lanes(read: Sequence[TaggedLane], width_m: float) -> tuple[LaneSpec, ...]:
    return tuple(
        LaneSpec(LaneType.DRIVING, lane.width_m or width_m, lane.turns, lane.speed_mps, lane.change, lane.bus)
        for lane in read
    )


def _lane_width_m(
    tags: Mapping[str, str], highway: str, reading: LaneReading, sides: Iterable[Sequence[LaneSpec]], notes: list[str]
) -> float:
    """Return the width of each lane without a tagged width.

    ``width`` is from kerb to kerb: parking, cycle lanes and shoulders are subtracted.
    """
    row = road_class(highway)
    lanes = [*reading.forward, *reading.backward, *([reading.centre] if reading.centre else [])]
    usual_m = _SINGLE_TRACK_WIDTH_M if reading.shared else row.lane_width_m
    untold = sum(lane.width_m is None for lane in lanes)
    total_m = parse_length_m(tags.get("width:carriageway") or tags.get("width"))
    if total_m is None or not untold:
        return usual_m
    beside = read_beside(tags, oneway=not reading.backward)
    said_m = [*(lane.width_m for side in sides for lane in side), *(lane.width_m for lane in lanes)]
    taken_m = math.fsum(each or 0.0 for each in (*said_m, beside.cycle_left_m, beside.cycle_right_m))
    each_m = (total_m - taken_m) / untold
    least_m = _NARROWEST_M if row.public and reading.tagged and not reading.shared else _NARROWEST_TRACK_M
    if each_m < least_m:
        notes.append(f"width={total_m:.4g} m, too narrow for {count_of(len(lanes), 'lane')}")
        return usual_m
    return min(each_m, _WIDEST_M)


def _placement(
    tags: Mapping[str, str], keys: Sequence[str], lanes: Sequence[LaneSpec], notes: list[str]
) -> float | None:
    """Return the distance from the inner border of ``lanes`` to the way's geometry, by OSM's ``placement``."""
    key = next((key for key in keys if key in tags), None)
    if key is None:
        return None
    match = re.match(r"^(left_of|middle_of|right_of):(\d+)$", tags[key])
    if match is None or not 1 <= int(match[2]) <= len(lanes):
        notes.append(f"{key}={tags[key]}")
        return None
    number = int(match[2])
    inner = math.fsum(lane.width_m for lane in lanes[: number - 1])
    share = {"left_of": 0.0, "middle_of": 0.5, "right_of": 1.0}[match[1]]
    return inner + share * lanes[number - 1].width_m


def _roadside(tags: Mapping[str, str], side: str, *, oneway: bool) -> tuple[LaneSpec, ...]:
    """Return the shoulder and parking lane of one side, from the carriageway outwards."""
    lanes: list[LaneSpec] = []
    shoulder = tags.get(f"shoulder:{side}") or tags.get("shoulder:both") or tags.get("shoulder", "no")
    if shoulder in ("both", side) or (shoulder == "yes" and not (oneway and side == "left")):
        width = parse_length_m(tags.get(f"shoulder:{side}:width") or tags.get("shoulder:width"))
        lanes.append(LaneSpec(LaneType.SHOULDER, min(max(width or _SHOULDER_WIDTH_M, 0.5), 4.0)))
    parking = tags.get(f"parking:{side}") or tags.get("parking:both") or ""
    if parking in ("lane", "yes"):
        parking = tags.get(f"parking:{side}:orientation") or tags.get("parking:both:orientation") or parking
    parking = parking or tags.get(f"parking:lane:{side}") or tags.get("parking:lane:both") or ""
    if parking in _PARKING_WIDTHS_M:
        lanes.append(LaneSpec(LaneType.PARKING, _PARKING_WIDTHS_M[parking]))
    return tuple(lanes)
