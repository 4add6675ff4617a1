"""The report on a road map: the crash's place on it, its gates, its agreement with the crash report.

It is stored beside the map as ``road_map/<key>.json``, or for a rejected map as ``road_map/<key>.rejected.json``. Types
only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, Self

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.roads.map.model import LaneMatch

STRUCTURES_WITHIN_M: Final = 100.0
"""Distance within which a bridge or tunnel is noted; the published study left crashes out that were this near to
one."""


class _Stored:
    """A report that is stored as JSON."""

    def to_json(self) -> bytes:
        """Return the report as stored.

        >>> RejectedMapReport.from_json(RejectedMapReport("native", 30.0, ()).to_json()).max_move_m
        30.0
        """
        return json_adapter(type(self)).dump_json(self, indent=1)

    @classmethod
    def from_json(cls, data: bytes) -> Self:
        """Return a stored report."""
        return json_adapter(cls).validate_json(data)


@dataclass(frozen=True)
class CrashPlacement:
    """The place of the crash on the map.

    The reported point is the origin of the local frame; both are kept.

    ``road_id`` is the reported road (or the nearest), ``moved_m`` the distance of the point's move to its carriageway,
    ``junction_id`` the crossing of an intersection crash, ``matched_by`` the evidence used. ``cross_road_ids``: the
    other roads of that crossing, or those that ``TWAY_ID2`` names.
    """

    x_m: float
    y_m: float
    z_m: float
    road_id: str
    moved_m: float
    matched_by: str
    lane: LaneMatch | None = None
    junction_id: str | None = None
    cross_road_ids: tuple[str, ...] = ()


@dataclass(frozen=True)
class MapGate:
    """One measured property of a map: value, threshold, unit, and whether it holds."""

    name: str
    value: float | None
    threshold: float | None
    unit: str
    passed: bool | None  # None: not evaluated, ``detail`` says why
    detail: str = ""
    road_ids: tuple[str, ...] = ()  # where it does not hold
    way_ids: tuple[int, ...] = ()  # of which no road was made


@dataclass(frozen=True)
class Comparison:
    """One attribute of the map against the report: ``agreement`` is "agrees", "differs" or "not comparable"."""

    attribute: str
    reported: str | None
    mapped: str | None
    agreement: str
    filled_from_report: bool = False


@dataclass(frozen=True)
class Structure:
    """A bridge or tunnel near the crash: ``distance_m`` from the crash to its nearest lane, seen from above."""

    kind: Literal["bridge", "tunnel"]
    road_id: str
    distance_m: float


@dataclass(frozen=True)
class InferredRoad:
    """A road that is not from OpenStreetMap but drawn because of the crash report."""

    road_id: str
    why: str


@dataclass(frozen=True)
class MappedThing:
    """A feature of OpenStreetMap beside the road that a vehicle can strike.

    ``tag`` is its type ("natural=tree"); ``xy_m`` is its place in the local frame: a point or the corners of a line.
    """

    osm_id: str
    tag: str
    xy_m: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class DataEnd:
    """An end of the map's data where the road continues in reality: ``distance_m`` from the crash along the roads."""

    road_id: str
    name: str
    distance_m: float


@dataclass(frozen=True)
class LeftOutRoad:
    """A road left out because it failed a gate, or (``road_id`` "") a way that could not become a road.

    The crash cannot have used it.
    """

    road_id: str
    name: str
    osm_way_ids: tuple[int, ...]
    why: str


@dataclass(frozen=True)
class TagNotFollowed:
    """A tag of an OpenStreetMap way that the map ignores, since it contradicts other tags or cannot be read."""

    way_id: int
    what: str


@dataclass(frozen=True)
class ReversibleRoad:
    """A road whose lanes go one way at a time.

    ``direction`` is "by the hour" if the hour of the crash determines it, or "unknown". In that case the lanes have the
    direction of OpenStreetMap's way, and the real one may have been the opposite.
    """

    road_id: str
    direction: str


@dataclass(frozen=True)
class MapReport(_Stored):
    """Everything recorded beside a road map."""

    converter: str
    placement: CrashPlacement
    gates: tuple[MapGate, ...]
    comparisons: tuple[Comparison, ...] = ()
    structures: tuple[Structure, ...] = ()  # within STRUCTURES_WITHIN_M, nearest first
    roads: int = 0
    junctions: int = 0
    attribution: str = ""
    inferred_roads: tuple[InferredRoad, ...] = ()
    things: tuple[MappedThing, ...] = ()  # within 40 m, nearest first
    tags_not_followed: tuple[TagNotFollowed, ...] = ()
    reversible_roads: tuple[ReversibleRoad, ...] = ()
    left_out_roads: tuple[LeftOutRoad, ...] = ()
    data_ends: tuple[DataEnd, ...] = ()  # nearest first; none at the border of the box


@dataclass(frozen=True)
class NearStreet:
    """A street around the reported point.

    It has the distance to its surface, ``distance_m``, and the surface's nearest point, ``nearest_xy_m``.

    ``bears_reported_name``: whether it has a reported name; None if names cannot be compared.
    """

    name: str
    highway: str
    distance_m: float
    nearest_xy_m: tuple[float, float]
    bears_reported_name: bool | None


@dataclass(frozen=True)
class RejectedMapReport(_Stored):
    """The report beside a map for which its crash is rejected.

    ``streets`` around the reported point, nearest first; the point may be moved by at most ``max_move_m`` to its road.
    ``gates`` are measured only if the crash was placed on the map.
    """

    converter: str
    max_move_m: float
    streets: tuple[NearStreet, ...]
    gates: tuple[MapGate, ...] = ()
