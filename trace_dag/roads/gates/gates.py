"""The gates of a road map: each is measured on the stored file, with its threshold, and passes or does not.

A gate that could not be evaluated has the reason. :func:`require` turns the first gate that fails into the rejection
``map_distorted`` (``crash_off_road`` for the crash's place).
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.messages.wording import count_of
from trace_dag.roads.from_osm.converter import MapLimits
from trace_dag.roads.gates import measures
from trace_dag.roads.gates.against_osm import MapComparison
from trace_dag.roads.map.lane_geometry import lane_ends, sample_at
from trace_dag.roads.map.rules import roads_of
from trace_dag.roads.map.separations import find_separations
from trace_dag.roads.report import CrashPlacement, MapGate

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmExtract
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.map.rules import StoredMap

_SHOWN: Final = 3  # examples named in a gate's detail
_ANCHORS: Final = 8
_LEAST_ANCHORS: Final = 5
_CRASH_GATE: Final = "crash_on_road"
_CARLA_SPACING_M: Final = 10.0


def check_map(
    network: RoadNetwork,
    extract: OsmExtract,
    stored_map: StoredMap,
    placement: CrashPlacement | None = None,
    *,
    limits: MapLimits | None = None,
    left_out_ways: Collection[int] = (),
) -> tuple[MapGate, ...]:
    """Return all gates of a map: ``network`` as converted, ``stored_map`` as written, ``extract`` as its source.

    The map need not have roads of ``left_out_ways``. A failed gate names its roads. Everything is measured on the file
    as read back. If it breaks more rules than allowed, nothing else is measured.
    """
    limits = limits or MapLimits()
    broken = stored_map.violations
    rules = _count_gate("opendrive_rules", broken, "violations", limits.rule_violations, roads_of(broken))
    if not rules.passed:
        return (rules,)
    stored = stored_map.network
    comparison = MapComparison(stored, extract)
    return (
        rules,
        _stored(network, stored, limits),
        *_ways(comparison, limits, left_out_ways),
        _lanes(comparison, limits),
        *_links(stored, limits),
        *_curves(stored, limits),
        *_neighbours(stored),
        _geodesics(comparison, limits),
        *_heights(stored, limits),
        *_for_people(stored, comparison, limits),
        _crash(stored, placement, limits),
        _carla(stored_map),
    )


def require(gates: Iterable[MapGate]) -> None:
    """Raise :class:`Rejection` for the first gate that fails, with its measurement."""
    for gate in gates:
        if gate.passed is False:
            reason = Reason.CRASH_OFF_ROAD if gate.name == _CRASH_GATE else Reason.MAP_DISTORTED
            raise Rejection(reason, _sentence(gate), measured=gate.value, threshold=gate.threshold)


def _sentence(gate: MapGate) -> str:
    value = "" if gate.value is None else f" with {gate.value:.4g} {gate.unit}"
    limit = "" if gate.threshold is None else f" (limit {gate.threshold:.4g})"
    detail = f": {gate.detail.removesuffix('.')}" if gate.detail else ""
    return f"The map fails its gate {gate.name.replace('_', ' ')}{value}{limit}{detail}."


def _at_most(
    name: str, value: float, threshold: float, unit: str, detail: str = "", roads: Iterable[str] = ()
) -> MapGate:
    limit = threshold if math.isfinite(threshold) else None
    passed = value <= threshold
    return MapGate(name, value, limit, unit, passed, detail, () if passed else tuple(dict.fromkeys(roads)))


def _at_least(name: str, value: float, threshold: float, unit: str, detail: str, road_id: str) -> MapGate:
    # Lines are made exactly to the limit, so rounding errors are allowed for.
    passed = value >= threshold * (1 - 1e-3)
    return MapGate(name, value, threshold, unit, passed, detail, () if passed else (road_id,))


def _count_gate(name: str, found: list[str], unit: str, threshold: float = 0, roads: Iterable[str] = ()) -> MapGate:
    return _at_most(name, len(found), threshold, unit, "; ".join(found[:_SHOWN]), roads)


def _stored(network: RoadNetwork, stored: RoadNetwork, limits: MapLimits) -> MapGate:
    """Check that the stored file describes the same lanes in the same places."""
    name, unit = "stored_difference", "m"
    before, after = network.lanes(), stored.lanes()
    if set(before) != set(after):
        differing = count_of(len(set(before) ^ set(after)), "lane")
        return MapGate(name, None, limits.stored_difference_m, unit, False, f"{differing} not in both")
    here, there = ([road_map.geometry(ref) for ref in before] for road_map in (network, stored))
    apart_m = sample_at(here, lane_ends(here))[:, :3] - sample_at(there, lane_ends(there))[:, :3]
    largest_m = float(np.linalg.norm(apart_m, axis=1).max(initial=0.0))
    return _at_most(name, largest_m, limits.stored_difference_m, unit)


def _ways(comparison: MapComparison, limits: MapLimits, left_out_ways: Collection[int]) -> Iterator[MapGate]:
    deviation = comparison.way_deviation()
    length = f"over {deviation.length_m:.0f} m of ways outside junctions"

    def roads_of(way_id: int | None) -> tuple[str, ...]:
        return tuple(road.id for road in comparison.roads_of_way.get(way_id, ())) if way_id is not None else ()

    worst_roads = roads_of(deviation.worst_way_id)
    yield _at_most("way_deviation_mean", deviation.mean_m, limits.mean_way_deviation_m, "m", length, worst_roads)
    worst = f"way {deviation.worst_public_way_id}; {deviation.worst_m:.2f} m with service roads"
    yield _at_most(
        "way_deviation_worst",
        deviation.worst_public_m,
        limits.worst_way_deviation_m,
        "m",
        worst if deviation.worst_public_way_id is not None else "",
        roads_of(deviation.worst_public_way_id),
    )
    share = deviation.share_within_1m
    passed = share >= limits.share_within_1m
    roads = () if passed else worst_roads
    yield MapGate("way_length_within_1m", share, limits.share_within_1m, "of length", passed, length, roads)
    missing = [way_id for way_id in deviation.missing_public_way_ids if way_id not in left_out_ways]
    named = _count_gate("ways_missing", [f"way {way_id}" for way_id in missing], "public ways", limits.ways_missing)
    yield named if named.passed else replace(named, way_ids=tuple(missing))
    without = comparison.ways_without_road()
    detail = "; ".join(f"way {way_id} {why}" for way_id, why in without.items())  # all of them: no other list has them
    yield MapGate(
        "ways_without_road", len(without), None, "ways", None if without else True, detail, way_ids=tuple(without)
    )


def _lanes(comparison: MapComparison, limits: MapLimits) -> MapGate:
    compared, examples = comparison.lanes_against_tags()
    name, unit = "lanes_against_tags", "of tagged roads differ"
    if not compared:
        return MapGate(name, None, limits.lanes_against_tags, unit, None, "no road of this map has its lanes tagged")
    detail = "; ".join([f"{compared} roads compared", *[*examples.values()][:_SHOWN]])
    return _at_most(name, len(examples) / compared, limits.lanes_against_tags, unit, detail, examples)


def _links(stored: RoadNetwork, limits: MapLimits) -> Iterator[MapGate]:
    one_sided = measures.one_sided_links(stored)
    yield _count_gate(
        "links_both_ways", [*one_sided.values()], "one-sided links", roads=[ref.road_id for ref in one_sided]
    )
    gaps = measures.link_gaps(stored)
    for name, unit, limit, size in (
        ("link_gap", "m", limits.link_gap_m, [math.hypot(gap.position_m, gap.height_m) for gap in gaps]),
        ("link_kink", "degrees", limits.link_kink_deg, [math.degrees(gap.heading_rad) for gap in gaps]),
    ):
        if not gaps:
            yield MapGate(name, 0.0, limit, unit, True, "no lane leads into another")
            continue
        worst = int(np.argmax(np.round(size, 6)))
        source, target = gaps[worst].source, gaps[worst].target
        where = f"road {source.road_id} lane {source.lane_id} to road {target.road_id} lane {target.lane_id}"
        roads = (source.road_id, target.road_id)
        yield _at_most(name, size[worst], limit, unit, f"{len(gaps)} links, worst {where}", roads)
    stranded = measures.find_stranded_lanes(stored)
    detail = "; ".join(stranded[:_SHOWN])
    yield MapGate("lanes_leading_nowhere", len(stranded), None, "lanes", None if stranded else True, detail)


def _curves(stored: RoadNetwork, limits: MapLimits) -> Iterator[MapGate]:
    """Yield gates that a car can drive every lane through a junction, and that no piece of line is too short."""
    turns = measures.tightest_turns(stored)
    names = ("turn_radius", "u_turn_radius")
    least_m = (limits.turn_radius_m, limits.u_turn_radius_m)
    for name, (radius_m, road_id), limit_m in zip(names, turns, least_m, strict=True):
        if road_id is None:
            yield MapGate(name, None, limit_m, "m", True, "no lane turns")
        else:
            yield _at_least(name, radius_m, limit_m, "m", f"road {road_id}", road_id)
    length_m, road_id = measures.shortest_element(stored)
    yield _at_least("shortest_element", length_m, limits.shortest_element_m, "m", f"road {road_id}", road_id or "")


def _neighbours(stored: RoadNetwork) -> Iterator[MapGate]:
    """Yield the gate that lanes are neighbours in both directions, with a shared border."""
    broken: list[str] = []
    roads: list[str] = []
    for ref in stored.drivable_lanes():
        geometry = stored.geometry(ref)
        middle = (geometry.begin_m + geometry.end_m) / 2
        for side, other in zip(("left", "right"), stored.neighbours(ref), strict=True):
            if other is None:
                continue
            neighbour = stored.geometry(other)
            between = abs(geometry.centre.at(middle) - neighbour.centre.at(middle))
            widths = (geometry.width.at(middle) + neighbour.width.at(middle)) / 2
            if ref not in stored.neighbours(other) or abs(between - widths) > 1e-6:
                broken.append(f"lane {ref.lane_id} of road {ref.road_id} and its {side} neighbour {other.lane_id}")
                roads.append(ref.road_id)
    yield _count_gate("neighbours_both_ways", broken, "pairs", roads=roads)


def _geodesics(comparison: MapComparison, limits: MapLimits) -> MapGate:
    """Return the gate of pairwise distances between well-spread places.

    They are measured on the map, and on the WGS84 ellipsoid between OSM coordinates.
    """
    from pyproj import Geod

    geographic, places = comparison.geodesic_anchors(_ANCHORS)
    name, unit = "geodesic_distances", "m"
    if len(places) < _LEAST_ANCHORS:
        detail = f"{count_of(len(places), 'place')} far enough apart, {_LEAST_ANCHORS} needed"
        return MapGate(name, None, limits.geodesic_m, unit, None, detail)
    first, second = np.triu_indices(len(places), 1)
    on_map = np.hypot(*(places[first] - places[second]).T)
    _, _, on_earth = Geod(ellps="WGS84").inv(*geographic[first, ::-1].T, *geographic[second, ::-1].T)
    spread = float(on_map.max())
    detail = f"{count_of(len(first), 'distance')} between {count_of(len(places), 'place')} up to {spread:.0f} m apart"
    return _at_most(name, float(np.abs(on_map - on_earth).max()), limits.geodesic_m, unit, detail)


def _heights(stored: RoadNetwork, limits: MapLimits) -> Iterator[MapGate]:
    main, ramp = measures.steepest_grades(stored)
    for name, (grade, road_id), limit in (("grade", main, limits.grade), ("ramp_grade", ramp, limits.ramp_grade)):
        detail = f"road {road_id}" if road_id is not None else "level"
        # The profile is fitted exactly to the limit, so rounding errors are allowed for.
        passed = grade <= limit * (1 + 1e-3)
        yield MapGate(name, grade, limit, "rise over run", passed, detail, () if passed or not road_id else (road_id,))
    found = find_separations(stored)
    separated = [crossing for crossing in found if crossing.levels_differ]
    level = "; ".join(
        f"roads {' and '.join(road.id for road in each.roads)} cross at one level without a junction in OSM, at "
        f"({each.x_m:.0f}, {each.y_m:.0f})"
        for each in found
        if not each.levels_differ
    )
    if not separated:
        yield MapGate("clearance", None, limits.clearance_m, "m", True, level or "no road passes over another")
        return
    lowest_m, crossing = min(
        ((measures.clearance_m(stored, crossing), crossing) for crossing in separated), key=itemgetter(0)
    )
    ids = tuple(road.id for road in crossing.roads)
    where = f"roads {' and '.join(ids)} at ({crossing.x_m:.0f}, {crossing.y_m:.0f})"
    detail = "; ".join(filter(None, [f"{len(separated)} crossings of levels, lowest {where}", level]))
    passed = lowest_m >= limits.clearance_m - 1e-3
    yield MapGate("clearance", lowest_m, limits.clearance_m, "m", passed, detail, () if passed else ids)


def _for_people(stored: RoadNetwork, comparison: MapComparison, limits: MapLimits) -> Iterator[MapGate]:
    """Check crosswalks against OpenStreetMap's crossings, and sidewalks and cycle lanes against other roads."""
    distances = comparison.crosswalk_distances()
    worst = max(distances, key=lambda row: row[0], default=None)
    name, unit = "crosswalk_place", "m"
    if worst is None:
        yield MapGate(name, None, limits.crosswalk_m, unit, True, "the map has no crosswalk at a node of OpenStreetMap")
    else:
        yield _at_most(
            name, worst[0], limits.crosswalk_m, unit, f"{len(distances)} crosswalks, worst at node {worst[1]}"
        )
    beside = measures.lanes_beside(stored)
    name, unit = "lanes_beside_on_roadway", "of places"
    if not beside.length_m:
        detail = "the map has no sidewalk and no cycle lane"
        yield MapGate(name, None, limits.lanes_beside_on_roadway, unit, True, detail)
        return
    detail = f"{beside.length_m:.0f} m of sidewalks and cycle lanes"
    if beside.share_on_roadway:
        detail += f", worst road {beside.worst_road_id}"
    roads = [beside.worst_road_id] if beside.worst_road_id else []
    yield _at_most(name, beside.share_on_roadway, limits.lanes_beside_on_roadway, unit, detail, roads)


def _crash(stored: RoadNetwork, placement: CrashPlacement | None, limits: MapLimits) -> MapGate:
    if placement is None:
        return MapGate(_CRASH_GATE, None, limits.crash_outside_m, "m", None, "no crash was placed")
    search_m = 50.0
    matches = stored.nearest_lanes(placement.x_m, placement.y_m, search_m, z_m=placement.z_m)
    if not matches:
        detail = f"no lane within {search_m:.0f} m at the crash's height"
        return MapGate(_CRASH_GATE, None, limits.crash_outside_m, "m", False, detail)
    return _at_most(
        _CRASH_GATE, matches[0].outside_m, limits.crash_outside_m, "m", f"nearest road {matches[0].lane.road_id}"
    )


def _carla(stored_map: StoredMap) -> MapGate:
    """Check that CARLA's own parser reads the map and finds lanes in it."""
    unit = f"waypoints {_CARLA_SPACING_M:.0f} m apart"
    if importlib.util.find_spec("carla") is None:
        return MapGate("carla_map", None, None, unit, None, "the carla extra is not installed")
    import carla

    try:
        waypoints = len(carla.Map(stored_map.name, stored_map.xodr.decode()).generate_waypoints(_CARLA_SPACING_M))
    except RuntimeError as error:
        return MapGate("carla_map", None, None, unit, False, f"carla.Map: {error}")
    return MapGate("carla_map", waypoints, None, unit, waypoints > 0)
