"""OSM to road network: the native converter.

Every street between two junctions becomes one road per stretch of one name, class and structure, with both directions
in it; every junction gets a connecting road per permitted movement. The parts are beside this module:
:mod:`~trace_dag.roads.from_osm.street_graph`, :mod:`~trace_dag.roads.from_osm.lanes`,
:mod:`~trace_dag.roads.from_osm.junction_areas`, :mod:`~trace_dag.roads.from_osm.arm_cuts`,
:mod:`~trace_dag.roads.from_osm.movements` and :mod:`~trace_dag.roads.from_osm.connecting_roads`; sidewalks and cycle
lanes are laid beside the finished roads by :mod:`~trace_dag.roads.from_osm.beside`, across them by
:mod:`~trace_dag.roads.from_osm.crosswalks` and through junctions by :mod:`~trace_dag.roads.from_osm.corners`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import count
from typing import Final

import numpy as np
import shapely

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import RoadSettings
from trace_dag.osm.road_classes import road_class
from trace_dag.osm.types import OsmExtract, OsmWay
from trace_dag.roads.from_osm.arm_cuts import StreetEnd, end_profile
from trace_dag.roads.from_osm.beside import add_lanes_beside
from trace_dag.roads.from_osm.carriageways import Carriageways
from trace_dag.roads.from_osm.connecting_roads import build_connections
from trace_dag.roads.from_osm.controllers import add_controllers
from trace_dag.roads.from_osm.converter import MapLimits, WayHints
from trace_dag.roads.from_osm.corners import add_lanes_through_junctions
from trace_dag.roads.from_osm.crosswalks import add_crosswalks
from trace_dag.roads.from_osm.elevation import elevate
from trace_dag.roads.from_osm.junction_areas import JunctionArea, Layout, lay_out
from trace_dag.roads.from_osm.movements import InnerWay, JunctionArm, Movement, find_movements, make_arm
from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.from_osm.signs import place_signs
from trace_dag.roads.from_osm.street_graph import Street, build_street_graph
from trace_dag.roads.from_osm.street_objects import add_objects, cut_turning_circles, turning_movement
from trace_dag.roads.from_osm.street_roads import StreetRoads, build_street_roads, ways_between
from trace_dag.roads.from_osm.tags import CrossSection, WayProfile, read_profile
from trace_dag.roads.from_osm.turn_curves import CORNER_RADIUS_M, widen_tight_bends
from trace_dag.roads.from_osm.turn_restrictions import read_restrictions
from trace_dag.roads.map.curves import PlanView, cut_plan, plan_pose, reverse_plan
from trace_dag.roads.map.model import ContactPoint, Junction, Road, RoadLink
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.version import __version__

CONVERTER: Final = f"trace-dag native {__version__}"
_EDGE_RATIO: Final = 1.3  # bends this much wider than the outermost lane's outer border
_CENTRE_RATIO: Final = 1.15  # with room for the lanes' own tapers
_FARTHEST_M: Final = 2.9  # a public road is laid no farther from its way so that all its lanes can be driven
_FOLD_RATIO: Final = 1.1  # narrower than this an edge folds
_LANE_STEP_RATIO: Final = 5.2  # bends this much wider than the outermost lane's offset: all lanes near equal length


class NativeConverter:
    """The native conversion as a :class:`Converter`."""

    limits = MapLimits()

    def require(self) -> None:
        """Require nothing, because the converter needs no extra."""

    def convert(
        self, extract: OsmExtract, frame: LocalFrame, settings: RoadSettings, hints: Mapping[int, WayHints]
    ) -> RoadNetwork:
        """See :func:`convert`."""
        return convert(extract, frame, settings, hints)


@gc_paused()
def convert(
    extract: OsmExtract, frame: LocalFrame, settings: RoadSettings, hints: Mapping[int, WayHints] | None = None
) -> RoadNetwork:
    """Return the road network of an extract, in ``frame``.

    ``hints`` by OSM way id fill gaps in its tags.

    Raises :class:`Rejection` (``map_distorted``) if no road can be built from the extract.

    >>> made = convert(extract, network.frame, RoadSettings())
    >>> len(made.junctions), {road.name for road in made.roads} == {road.name for road in network.roads}
    (18, True)
    """
    known = hints or {}

    def profile_of(way: OsmWay) -> WayProfile:
        hint = known.get(way.id)
        if hint is None:
            return read_profile(way)
        return read_profile(way, lanes_hint=hint.lanes, speed_hint_mps=hint.speed_mps)

    graph = build_street_graph(extract, frame, profile_of)
    streets = graph.streets
    if not streets:
        raise Rejection(
            Reason.MAP_DISTORTED,
            f"no road can be built from the extract: {count_of(len(extract.ways), 'way')}, none of them drivable with "
            "two nodes at different places",
            measured=0.0,
            threshold=1.0,
        )
    plans = [_plan(street) for street in streets]
    layout = lay_out(streets, plans)
    circles = cut_turning_circles(extract, graph, plans, layout)
    ids = count()

    def new_id() -> str:
        return str(next(ids))

    built: dict[int, StreetRoads] = {}
    returning = layout.returning()
    for index, street in enumerate(streets):
        if index not in layout.inner:
            built[index] = build_street_roads(
                street, plans[index], layout.trims[index], new_id, returns=index in returning
            )
    restrictions = read_restrictions(extract, graph.aliases)
    junctions: list[Junction] = []
    connecting: list[Road] = []
    links: dict[tuple[int, bool], str] = {}
    crossings: list[tuple[JunctionArea, list[Movement]]] = []
    for area in (*layout.junctions, *(JunctionArea([each.node_id], [end]) for end, each in circles.items())):
        arms = [_arm(built[end.street], end, layout) for end in area.ends]
        inner = [_inner_way(streets[i], plans[i]) for i in area.inner_streets]
        movements = find_movements(arms, inner, restrictions)
        if len(arms) == 1 and (circle := circles.get(area.ends[0])):
            movements = [turning_movement(arms[0], circle)]
        crossings.append((area, movements))
        junction_id = new_id()
        roads, connections = build_connections(movements, junction_id, new_id)
        if not connections:
            continue
        connecting.extend(roads)
        points = [graph.positions[node] for node in area.node_ids]
        centre = (math.fsum(x for x, _ in points) / len(points), math.fsum(y for _, y in points) / len(points))
        junctions.append(
            Junction(junction_id, tuple(connections), osm_node_ids=tuple(area.node_ids), centre_xy_m=centre)
        )
        used = {link for road in roads for link in (road.predecessor, road.successor)}
        for end, arm in zip(area.ends, arms, strict=True):
            if arm.link in used:
                links[end.street, end.at_start] = junction_id
    signs = place_signs(extract, graph, built, crossings)
    linked: list[Road] = []
    for index, street_roads in built.items():
        for road in _linked(street_roads.roads, links.get((index, True)), links.get((index, False))):
            linked.append(replace(road, signals=signs[road.id]) if road.id in signs else road)
    network = RoadNetwork(
        frame=frame,
        roads=(*linked, *connecting),
        junctions=tuple(junctions),
        converter=CONVERTER,
        attribution=extract.attribution,
    )
    network = add_controllers(network)
    if settings.elevation:
        network = elevate(network, extract)
    # Last, so that no lane for traffic depends on what is mapped for people.
    carriageways = Carriageways(network.roads)
    roads_out = add_lanes_beside(network.roads, extract, graph, built, carriageways)
    roads_out = add_crosswalks(roads_out, extract, graph, built)
    network = replace(network, roads=add_objects(roads_out, extract, graph, built))
    return add_lanes_through_junctions(network, carriageways, new_id)


def _plan(street: Street) -> PlanView:
    """Return the reference line of a street.

    Bends have the radius preferred by the lanes where there is room. They are never so tight that a lane folds at its
    inner edge, or that its centre is tighter than a corner that a car can take.
    """
    wanted, needed = zip(*(radii for span in street.spans for radii in _radii(span.profile.section)), strict=True)
    plan = fit_plan(street.points, max(wanted))
    wide = widen_tight_bends(plan, max(needed))
    if wide is not plan and any(road_class(span.profile.highway).public for span in street.spans):
        missed_m = shapely.distance(
            shapely.linestrings([plan_pose(wide, s_m)[:2] for s_m in np.arange(0.0, wide.length_m + 1.0, 1.0)]),
            shapely.points(shapely.get_coordinates(shapely.segmentize(shapely.linestrings(street.points), 1.0))),
        )
        wide = wide if missed_m.max() <= _FARTHEST_M else plan
    return widen_tight_bends(wide, CORNER_RADIUS_M)


def _radii(section: CrossSection) -> Iterator[tuple[float, float]]:
    """Yield the preferred and the least radius of the reference line for each lane of a cross-section.

    With the preferred one, lanes differ little in length.
    """
    for lanes, sign in ((section.left, 1), (section.forward, -1)):
        border = section.offset_m
        for lane in lanes:
            centre, border = border + sign * lane.width_m / 2, border + sign * lane.width_m
            edge_m, drivable = abs(border), lane.type.drivable
            yield (
                max(_EDGE_RATIO * edge_m, _LANE_STEP_RATIO * abs(centre) if drivable else 0.0),
                max(_FOLD_RATIO * edge_m, abs(centre) + _CENTRE_RATIO * CORNER_RADIUS_M if drivable else 0.0),
            )


def _linked(roads: list[Road], start_junction: str | None, end_junction: str | None) -> list[Road]:
    """Return roads of one street linked to each other and to the junctions at its ends.

    Lanes without a continuation are not linked.
    """
    linked = []
    for i, road in enumerate(roads):
        predecessor = RoadLink("junction", start_junction) if start_junction is not None else None
        successor = RoadLink("junction", end_junction) if end_junction is not None else None
        if i > 0:
            predecessor = RoadLink("road", roads[i - 1].id, ContactPoint.END)
        if i + 1 < len(roads):
            successor = RoadLink("road", roads[i + 1].id, ContactPoint.START)
        linked.append(replace(road, predecessor=predecessor, successor=successor))
    return linked


def _arm(made: StreetRoads, end: StreetEnd, layout: Layout) -> JunctionArm:
    street, plan = made.street, made.plan
    trim = layout.trims[end.street][0 if end.at_start else 1]
    if end.at_start:
        begin_m, end_m = 0.0, trim
        rest = reverse_plan(cut_plan(plan, begin_m, end_m))
        road, contact, lanes, node = made.roads[0], ContactPoint.START, made.start_lanes, street.node_ids[0]
    else:
        begin_m, end_m = plan.length_m - trim, plan.length_m
        rest = cut_plan(plan, begin_m, end_m)
        road, contact, lanes, node = made.roads[-1], ContactPoint.END, made.end_lanes, street.node_ids[-1]
    profile, cut_off = end_profile(street, end.at_start), ways_between(street, plan, begin_m, end_m)
    return make_arm(road.id, contact, node, profile, plan_pose(rest, 0.0), rest, lanes, cut_off)


def _inner_way(street: Street, plan: PlanView) -> InnerWay:
    nodes = (*(street.node_ids[span.first] for span in street.spans), street.node_ids[-1])
    ways = tuple(span.profile.way_id for span in street.spans)
    return InnerWay(street.spans[0].profile.oneway, ways, nodes, tuple(street.points), plan.length_m)
