"""The road map of a crash from an extract and a record: converted, placed, filled, checked, compared.

Features beside the road include only objects that a report can name as fixed objects: trees, poles, barriers and
buildings. Areas farther off (water, woods, parking) are only drawn in pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import chain
from typing import Final

import numpy as np
import shapely

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.settings import RoadSettings
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.types import OsmExtract, OsmFeature
from trace_dag.roads.crash_site.agreement import NOT_COMPARABLE, compare
from trace_dag.roads.crash_site.crossings import add_kinds
from trace_dag.roads.crash_site.gap_filling import fill_gaps
from trace_dag.roads.crash_site.placement import place_crash
from trace_dag.roads.crash_site.streets import near_streets
from trace_dag.roads.from_osm.converter import Converter, WayHints
from trace_dag.roads.from_osm.left_hand import mirror_extract, mirror_network
from trace_dag.roads.from_osm.tags import read_profile
from trace_dag.roads.from_osm.turn_restrictions import unknown_kinds
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.gates.gates import check_map, require
from trace_dag.roads.gates.scope import check_in_scope, data_ends
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import (
    STRUCTURES_WITHIN_M,
    Comparison,
    CrashPlacement,
    InferredRoad,
    MapGate,
    MappedThing,
    MapReport,
    RejectedMapReport,
    ReversibleRoad,
    Structure,
    TagNotFollowed,
)

_REACH_M: Final = 40.0  # a vehicle that leaves the road stays within the clear zone
_KEYS: Final = ("barrier", "natural", "power", "highway", "man_made", "emergency", "amenity", "waterway", "building")
_ANY_VALUE: Final = ("traffic_sign", "bridge:support", "building")
_WITHOUT_WALLS: Final = frozenset({"roof", "carport", "canopy", "no"})  # of buildings that one drives below
_BACKGROUND: Final = frozenset(
    {"grassland", "scrub", "water", "wetland", "wood", "river", "riverbank", "parking", "bridge"}
)


@dataclass(frozen=True)
class RoadMap:
    """A road map, as converted and as written, and the report that is stored beside it."""

    network: RoadNetwork
    stored: StoredMap
    report: MapReport


@dataclass(frozen=True)
class PlainMap:
    """A road map without a crash, its gates, and the tags that it ignores."""

    stored: StoredMap
    gates: tuple[MapGate, ...]
    tags_not_followed: tuple[TagNotFollowed, ...]


class RejectedRoadMap(Rejection):
    """The map for which a crash is rejected, as converted and as OpenDRIVE, with its report."""

    def __init__(self, why: Rejection, network: RoadNetwork, xodr: bytes, report: RejectedMapReport) -> None:
        super().__init__(why.reason, why.detail, measured=why.measured, threshold=why.threshold)
        self.network = network
        self.xodr = xodr
        self.report = report


def build_road_map(extract: OsmExtract, record: CrashRecord, settings: RoadSettings) -> RoadMap:
    """Return the road map of one crash, in the local frame of its reported point.

    The extract is converted and the crash placed. If the report has facts about these streets that OSM lacks, the
    extract is converted again with them. The written map must pass every gate.

    Raises :class:`Rejection`: ``map_distorted``, ``crash_off_road``, or ``vertical_geometry`` if elevation is switched
    off; as :class:`RejectedRoadMap` if there is a map to look at.

    >>> built = build_road_map(extract, record, RoadSettings())
    >>> built.network.road_by_id[built.report.placement.road_id].names
    ('Main Street', 'NE 411')
    """
    extract = along_traffic(extract, _local_time(record))
    frame = LocalFrame(record.latitude_deg, record.longitude_deg)
    left_hand = record.keeps_left

    def converted(given: OsmExtract, hints: Mapping[int, WayHints]) -> RoadNetwork:
        return _network(given, frame, settings, hints, left_hand=left_hand)

    network = converted(extract, {})
    gates: tuple[MapGate, ...] = ()
    try:
        if not settings.elevation:
            _reject_vertical_geometry(extract, frame, settings)
        placement = place_crash(network, record, settings)
        comparisons = compare(network, record, placement)
        filling = fill_gaps(network, extract, record, placement)
        if filling.attributes:
            network = converted(filling.extract, filling.hints)
            placement = place_crash(network, record, settings)
            comparisons = tuple(_marked(comparison, filling.attributes) for comparison in comparisons)
        checked = check_in_scope(
            network,
            filling.extract,
            placement,
            name=f"road map of {record.key}",
            limits=road_converter(settings).limits,
            settings=settings,
        )
        network, gates = checked.network, checked.gates
        require(gates)
    except Rejection as why:
        beside = RejectedMapReport(network.converter, settings.max_move_m, near_streets(network, record), gates)
        raise RejectedRoadMap(why, network, write_opendrive(network, marks=settings.marks), beside) from why
    report = MapReport(
        converter=network.converter,
        placement=placement,
        gates=gates,
        comparisons=comparisons,
        structures=_find_structures(network, placement),
        roads=sum(road.junction_id is None for road in network.roads),
        junctions=len(network.junctions),
        attribution=extract.attribution,
        inferred_roads=tuple(
            InferredRoad(road.id, road.inferred) for road in network.roads if road.inferred and road.junction_id is None
        ),
        things=things_near(extract.surroundings, frame, placement),
        tags_not_followed=tags_not_followed(network, extract),
        left_out_roads=checked.left_out,
        data_ends=data_ends(network, extract, placement),
        reversible_roads=tuple(ReversibleRoad(road.id, road.reversible) for road in network.roads if road.reversible),
    )
    return RoadMap(network, checked.stored, report)


def road_converter(settings: RoadSettings) -> Converter:
    """Return the converter that the settings name.

    Raises :class:`trace_dag.common.errors.UserError` if it cannot be loaded.

    >>> type(road_converter(RoadSettings())).__name__
    'NativeConverter'
    """
    converter: Converter = load(PluginKind.CONVERTER, settings.converter)()
    return converter


def build_plain_map(
    extract: OsmExtract, frame: LocalFrame, settings: RoadSettings, *, name: str, left_hand: bool
) -> PlainMap:
    """Return the road map of an extract without a crash, in ``frame``; ``left_hand``: traffic keeps left.

    The gates of all roads are measured, but reject nothing. Raises :class:`Rejection` (``map_distorted``) if no map can
    be made of the extract.
    """
    extract = along_traffic(extract)
    network = _network(extract, frame, settings, {}, left_hand=left_hand)
    stored = StoredMap(write_opendrive(network, marks=settings.marks), name=name)
    gates = check_map(network, extract, stored, limits=road_converter(settings).limits)
    return PlainMap(stored, gates, tags_not_followed(network, extract))


def _network(
    extract: OsmExtract,
    frame: LocalFrame,
    settings: RoadSettings,
    hints: Mapping[int, WayHints],
    *,
    left_hand: bool,
) -> RoadNetwork:
    convert = road_converter(settings).convert
    if not left_hand:
        return add_kinds(convert(extract, frame, settings, hints), extract)
    return add_kinds(mirror_network(convert(mirror_extract(extract, frame), frame, settings, hints)), extract)


def tags_not_followed(network: RoadNetwork, extract: OsmExtract) -> tuple[TagNotFollowed, ...]:
    """Return the contradictory or unreadable tags of the ways that are roads of the map."""
    used = {way_id for road in network.roads for way_id in road.osm_way_ids}
    of_ways = ((way.id, what) for way in extract.ways if way.id in used for what in read_profile(way).not_followed)
    return tuple(TagNotFollowed(way_id, what) for way_id, what in chain(unknown_kinds(extract), of_ways))


def _local_time(record: CrashRecord) -> datetime | None:
    """Return the time of the crash; None if the hour is not reported."""
    if record.hour is None or record.month is None or record.day is None:
        return None
    return datetime(record.year or record.case_year, record.month, record.day, record.hour % 24, record.minute or 0)


def _find_structures(network: RoadNetwork, placement: CrashPlacement) -> tuple[Structure, ...]:
    """Return bridges and tunnels near the crash, nearest first, one entry per road."""
    nearest: dict[str, Structure] = {}
    for match in network.nearest_lanes(placement.x_m, placement.y_m, STRUCTURES_WITHIN_M):
        road = network.road_by_id[match.lane.road_id]
        if (road.bridge or road.tunnel) and road.id not in nearest:
            nearest[road.id] = Structure("bridge" if road.bridge else "tunnel", road.id, round(match.outside_m, 2))
    return tuple(nearest.values())


def _marked(comparison: Comparison, filled: frozenset[str]) -> Comparison:
    """Return the comparison, marked if the map has the value from the report alone."""
    only_report = comparison.agreement == NOT_COMPARABLE and comparison.reported is not None
    return replace(comparison, filled_from_report=only_report and comparison.attribute in filled)


def _reject_vertical_geometry(extract: OsmExtract, frame: LocalFrame, settings: RoadSettings) -> None:
    """Reject bridges and tunnels near the crash, like the published pipeline, which has no heights."""
    limit_m = settings.vertical_geometry_radius_m
    for way in extract.ways:
        raised = [key for key in ("bridge", "tunnel", "layer") if way.tags.get(key, "no") not in ("no", "0")]
        if not raised:
            continue
        line = shapely.LineString(extract.local_xy_m(way.node_ids, frame))
        distance_m = float(line.distance(shapely.Point(0.0, 0.0)))
        if distance_m <= limit_m:
            raise Rejection(
                Reason.VERTICAL_GEOMETRY,
                f"A way with {raised[0]}={way.tags[raised[0]]} passes {distance_m:.0f} m from the crash (within "
                f"{limit_m:.0f} m) and elevation is switched off.",
                measured=distance_m,
                threshold=limit_m,
            )


# --- things beside the road ------------------------------------------------------------------------------------------
def things_near(
    features: Iterable[OsmFeature], frame: LocalFrame, placement: CrashPlacement
) -> tuple[MappedThing, ...]:
    """Return things within 40 m of the crash, nearest first, in the local frame.

    >>> things = things_near(extract.surroundings, network.frame, map_report.placement)
    >>> [thing.tag for thing in things][:3], len(things) == len(map_report.things)
    (['building'], True)
    """
    place = shapely.Point(placement.x_m, placement.y_m)
    found: list[tuple[float, MappedThing]] = []
    for each in features:
        tag = _tag(each)
        if tag is None:
            continue
        for part in shapely.get_parts(each.geometry):
            outline = part.exterior if part.geom_type == "Polygon" else part
            longitude_deg, latitude_deg = np.array(outline.coords).T
            xy_m = frame.to_local(latitude_deg, longitude_deg)
            shape = shapely.Point(xy_m[0]) if len(xy_m) == 1 else shapely.LineString(xy_m)
            distance_m = float(shape.distance(place))
            if distance_m <= _REACH_M:
                corners = tuple((round(float(x), 3), round(float(y), 3)) for x, y in xy_m)
                found.append((distance_m, MappedThing(each.id, tag, corners)))
    found.sort(key=lambda pair: (pair[0], pair[1].osm_id))
    return tuple(thing for _, thing in found)


def _tag(feature: OsmFeature) -> str | None:
    """Return the tag that names the type of a feature, as "natural=tree"; only the key if any value will do."""
    for key in _ANY_VALUE:
        if feature.tags.get(key, "no") not in _WITHOUT_WALLS:
            return key
    return next(
        (f"{key}={feature.tags[key]}" for key in _KEYS if key in feature.tags and feature.tags[key] not in _BACKGROUND),
        None,
    )
