"""OpenDRIVE's concepts as plain types, written to and read from ``.xodr``.

Frame: the project's local frame. Lane ids follow OpenDRIVE: positive left of the reference line, negative right of it,
0 the reference line itself; in right-hand traffic negative lanes travel along the reference line and positive ones
against it. One-way roads have only negative lanes. In left-hand traffic it is the other way round. Queries over these
types are in :class:`trace_dag.roads.map.network.RoadNetwork`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple, Self


class LaneType(StrEnum):
    """OpenDRIVE 1.7 ``e_laneType`` values in use here."""

    DRIVING = "driving"
    BIDIRECTIONAL = "bidirectional"  # centre turn lane
    SHOULDER = "shoulder"
    PARKING = "parking"
    MEDIAN = "median"
    SIDEWALK = "sidewalk"
    BIKING = "biking"
    BORDER = "border"
    ENTRY = "entry"
    EXIT = "exit"
    NONE = "none"

    @property
    def drivable(self) -> bool:
        """Return whether traffic drives in the lane: driving, bidirectional, entry and exit lanes."""
        return self in _DRIVABLE

    @property
    def paved(self) -> bool:
        """Return whether the lane is paved, unlike the verges, medians and borders of roads."""
        return self in _PAVED

    @property
    def kept_clear(self) -> bool:
        """Return whether vehicles use the lane, so that no fixed object stands on it.

        These are traffic lanes, shoulders, parking and cycle lanes.
        """
        return self in _PAVED and self is not LaneType.SIDEWALK


_DRIVABLE: Final = frozenset({LaneType.DRIVING, LaneType.BIDIRECTIONAL, LaneType.ENTRY, LaneType.EXIT})
_PAVED: Final = _DRIVABLE | {LaneType.SHOULDER, LaneType.PARKING, LaneType.SIDEWALK, LaneType.BIKING}


@dataclass(frozen=True)
class Cubic:
    """``a + b*ds + c*ds**2 + d*ds**3`` from ``s_m`` on (widths, elevation, lane offset), metres."""

    s_m: float
    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0

    @classmethod
    def between(cls, s_m: float, start_m: float, end_m: float, length_m: float) -> Self:
        """Return the cubic from one value to another within a length, level at both ends."""
        rise_m = end_m - start_m
        return cls(s_m, start_m, 0.0, 3 * rise_m / length_m**2, -2 * rise_m / length_m**3)


@dataclass(frozen=True)
class PlanElement:
    """A piece of reference line: line (``curvature_1pm`` 0), arc, or ``paramPoly3`` (``poly`` set).

    ``poly`` holds aU, bU, cU, dU, aV, bV, cV, dV; ``poly_normalized`` is OpenDRIVE's ``pRange``. Only maps from other
    programs have it: the writer here uses lines and arcs.
    """

    s_m: float
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    curvature_1pm: float = 0.0
    poly: tuple[float, float, float, float, float, float, float, float] | None = None
    poly_normalized: bool = False


@dataclass(frozen=True)
class RoadMark:
    """Mark on the outer border of a lane (of lane 0: the centre line). ``type`` as OpenDRIVE ``e_roadMarkType``."""

    type: str = "broken"
    colour: str = "standard"
    lane_change: str = "both"


@dataclass(frozen=True)
class Lane:
    """One lane of a lane section. ``mark`` is the written one; ``legal_mark`` the one that the law requires."""

    id: int
    type: LaneType
    widths: tuple[Cubic, ...]  # s_m relative to the section's start
    predecessor: int | None = None
    successor: int | None = None
    mark: RoadMark | None = None
    legal_mark: RoadMark | None = None
    speed_mps: float | None = None
    turns: tuple[str, ...] = ()  # OSM turn:lanes values of this lane: left, through, right, ...
    bus: bool = False  # only buses drive in it


@dataclass(frozen=True)
class LaneSection:
    """Lanes from ``s_m`` to the next section or the road's end, by id; lane 0 has no width."""

    s_m: float
    lanes: tuple[Lane, ...]


class ContactPoint(StrEnum):
    """Ends of a road that a link touches."""

    START = "start"
    END = "end"


@dataclass(frozen=True)
class RoadLink:
    """Predecessor or successor of a road: a road (with contact point) or a junction."""

    element_type: str  # "road" or "junction"
    element_id: str
    contact_point: ContactPoint | None = None


class SignalType(StrEnum):
    """Types of signals whose meaning is used: CARLA's traffic light, and signs by their German numbers."""

    LIGHT = "1000001"
    YIELD = "205"
    STOP = "206"
    LIMIT = "274"


@dataclass(frozen=True)
class Signal:
    """A traffic signal or sign; ``type`` is a :class:`SignalType`, or another number of OpenDRIVE.

    ``orientation`` is OpenDRIVE's: "+" valid for traffic along the reference line, "-" against it.
    """

    id: str
    s_m: float
    t_m: float
    type: str
    subtype: str = "-1"
    name: str = ""
    orientation: str = "+"
    value: float | None = None
    unit: str | None = None
    dynamic: bool = False
    z_offset_m: float = 0.0
    height_m: float = 0.0
    width_m: float = 0.0
    osm_node_id: int | None = None


@dataclass(frozen=True)
class Crosswalk:
    """A crosswalk: a closed outline of corners, metres ahead and left of the reference line at ``s_m``.

    It may lie beyond the end of the road, which is cut back at a junction. ``marked``: lines are painted; ``signals``:
    it has lights for people on foot.
    """

    id: str
    s_m: float
    outline_m: tuple[tuple[float, float], ...]
    marked: bool = True
    signals: bool = False
    osm_node_id: int | None = None


@dataclass(frozen=True)
class RoadObject:
    """A thing on the road: a closed outline of corners, metres ahead and left of the reference line at ``s_m``.

    ``type`` is OpenDRIVE's ``e_objectType``: "trafficIsland"; "patch" for the ground of a track or a turning circle.
    """

    id: str
    type: str
    name: str
    s_m: float
    outline_m: tuple[tuple[float, float], ...]
    height_m: float = 0.0
    osm_node_id: int | None = None


@dataclass(frozen=True)
class Road:
    """A stretch of road between junctions, or a connecting road inside one (``junction_id`` set).

    ``highway`` is the OSM class it came from, ``names`` its street names and route numbers as tagged (name, ref,
    alt_name, ...), ``osm_way_ids`` its sources, in order.
    """

    id: str
    length_m: float
    plan: tuple[PlanElement, ...]
    lane_sections: tuple[LaneSection, ...]
    elevation: tuple[Cubic, ...] = ()
    lane_offset: tuple[Cubic, ...] = ()
    name: str = ""
    junction_id: str | None = None
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    signals: tuple[Signal, ...] = ()
    crosswalks: tuple[Crosswalk, ...] = ()
    objects: tuple[RoadObject, ...] = ()
    highway: str = ""
    names: tuple[str, ...] = ()
    osm_way_ids: tuple[int, ...] = ()
    speed_mps: float | None = None
    layer: int = 0
    bridge: bool = False
    tunnel: bool = False
    lanes_from_tags: bool = False  # lane counts were tagged in OSM, not class defaults or the report's
    turn: str | None = None  # of a connecting road: "straight", "left", "right", "u_turn"
    inferred: str = ""  # why it exists, if it is not from OpenStreetMap but drawn because of the crash report
    left_hand: bool = False  # traffic keeps left: OpenDRIVE's ``rule``
    reversible: str = ""  # its lanes go one way at a time: "by the hour" of the crash, or "unknown" which way they went

    @property
    def level(self) -> int:
        """Return the storey as tagged; for a bridge without a layer 1, for a tunnel -1."""
        return self.layer or (1 if self.bridge else -1 if self.tunnel else 0)

    @property
    def is_ramp(self) -> bool:
        """Return whether it is a ramp or slip road, by its class."""
        return self.highway.endswith("_link")

    @property
    def ends(self) -> tuple[tuple[ContactPoint, float, RoadLink | None], ...]:
        """Return the contact point, station and link of its start and its end."""
        return (ContactPoint.START, 0.0, self.predecessor), (ContactPoint.END, self.length_m, self.successor)

    @property
    def ends_at_junctions(self) -> Iterator[tuple[ContactPoint, float, str]]:
        """Yield contact point, station and junction of each end at a junction; none of a connecting road."""
        for contact, s_m, link in self.ends if self.junction_id is None else ():
            if link is not None and link.element_type == "junction":
                yield contact, s_m, link.element_id

    @property
    def linked_roads(self) -> tuple[str, ...]:
        """Return the ids of the roads at its ends."""
        return self._linked("road")

    @property
    def linked_junctions(self) -> tuple[str, ...]:
        """Return the ids of the junctions at its ends."""
        return self._linked("junction")

    def _linked(self, element_type: str) -> tuple[str, ...]:
        links = (self.predecessor, self.successor)
        return tuple(link.element_id for link in links if link is not None and link.element_type == element_type)

    def section_at(self, s_m: float) -> int:
        """Return the index of the lane section at a station."""
        return max(bisect_right(self.lane_sections, s_m, key=lambda section: section.s_m) - 1, 0)

    def direction(self, lane_id: int) -> int:
        """Return +1 for a lane with traffic along the reference line, -1 for one against it."""
        return -1 if (lane_id > 0) != self.left_hand else 1

    def lanes_under(self, signal: Signal) -> tuple[int, ...]:
        """Return the ids of the lanes to which a signal of this road applies, without centre turn lanes.

        Between two lane sections, they are those of the section from which traffic comes.
        """
        sense = {"+": 1, "-": -1}.get(signal.orientation)
        before_m = signal.s_m if sense == -1 else math.nextafter(signal.s_m, 0.0)
        begun = [section for section in self.lane_sections if section.s_m <= before_m]
        return tuple(
            lane.id
            for lane in (begun or self.lane_sections)[-1].lanes
            if lane.id and lane.type.drivable and lane.type is not LaneType.BIDIRECTIONAL
            if sense is None or self.direction(lane.id) == sense
        )

    @property
    def one_way(self) -> bool:
        """Return whether all traffic lanes go along the reference line."""
        return all(
            self.direction(lane.id) > 0
            for section in self.lane_sections
            for lane in section.lanes
            if lane.id and lane.type.drivable
        )


@dataclass(frozen=True)
class Connection:
    """A permitted movement through a junction: from an incoming road over a connecting road."""

    id: str
    incoming_road: str
    connecting_road: str
    contact_point: ContactPoint
    lane_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Controller:
    """Signals that always show the same; ``sequence`` is its place in the order of the controllers of one junction."""

    id: str
    signal_ids: tuple[str, ...]
    name: str = ""
    sequence: int = 0


@dataclass(frozen=True)
class Junction:
    """A crossing. ``osm_node_ids`` are the OSM nodes it was made of (several where crossings were joined)."""

    id: str
    connections: tuple[Connection, ...]
    name: str = ""
    osm_node_ids: tuple[int, ...] = ()
    kind: str = ""  # "four_way", "t", "y", "roundabout", ... as seen in the map
    centre_xy_m: tuple[float, float] | None = None
    controller_ids: tuple[str, ...] = ()  # controllers of its traffic lights, in their sequence


class LaneRef(NamedTuple):
    """A lane: road id, index of the lane section, OpenDRIVE lane id."""

    road_id: str
    section: int
    lane_id: int


@dataclass(frozen=True)
class LaneMatch:
    """The place of a point relative to a lane.

    It has ``s_m`` along the road's reference line, ``offset_m`` to the left of the lane's centre in its direction of
    travel, and the distance outside the lane's borders (0 inside).
    """

    lane: LaneRef
    s_m: float
    offset_m: float
    outside_m: float
