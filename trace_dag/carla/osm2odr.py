"""CARLA's Osm2Odr as another converter behind the same interface, for comparison and as a cross-check.

It runs in a process of its own, because it writes to the terminal from C++ and ends the process when it fails. It makes
two roads of every street; those that run back to back are joined into one here, and each road gets the tags of the ways
it lies on, so that later stages find the same as in native maps. Needs the ``carla`` extra.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import math
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from trace_dag.common.errors import Failure, Reason, Rejection, UserError
from trace_dag.common.settings import RoadSettings
from trace_dag.osm.road_classes import is_drivable
from trace_dag.osm.xml import write_osm
from trace_dag.roads.from_osm.converter import MapLimits, WayHints
from trace_dag.roads.from_osm.lanes import YELLOW_BROKEN, YELLOW_DOUBLE
from trace_dag.roads.from_osm.tags import read_profile
from trace_dag.roads.map.model import (
    Connection,
    ContactPoint,
    Junction,
    Lane,
    LaneSection,
    LaneType,
    Road,
    RoadLink,
    Signal,
)
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive

if TYPE_CHECKING:
    from collections.abc import Mapping

    from trace_dag.common.geometry import FloatArray, LocalFrame
    from trace_dag.osm.types import OsmExtract, OsmWay

_TIME_LIMIT_S: Final = 120.0
_SAME_LINE_M: Final = 0.5  # two directions of one street share their reference line this closely
_ON_WAY_M: Final = 4.0


_LIMITS: Final = MapLimits(
    rule_violations=math.inf,
    mean_way_deviation_m=1.0,
    worst_way_deviation_m=math.inf,
    share_within_1m=0.8,
    ways_missing=math.inf,
    lanes_against_tags=math.inf,
    link_gap_m=math.inf,
    link_kink_deg=math.inf,
    turn_radius_m=0.0,
    u_turn_radius_m=0.0,
    shortest_element_m=0.0,
    geodesic_m=10.0,
    clearance_m=0.0,
)
"""Limits for Osm2Odr's maps: flat, with kinks in roads and gaps at links, lanes of its own at ramps."""


class Osm2OdrConverter:
    """CARLA's Osm2Odr as a :class:`Converter`. It takes no hints: it reads the tags by itself."""

    limits = _LIMITS

    def require(self) -> None:
        """Raise :class:`UserError` without the ``carla`` extra."""
        _require_osm2odr()

    def convert(
        self, extract: OsmExtract, frame: LocalFrame, settings: RoadSettings, hints: Mapping[int, WayHints]
    ) -> RoadNetwork:
        """See :func:`convert_with_osm2odr`."""
        return convert_with_osm2odr(extract, frame)


def convert_with_osm2odr(extract: OsmExtract, frame: LocalFrame) -> RoadNetwork:
    """Return the road network that Osm2Odr makes of an extract, both directions of a street in one road.

    Raises :class:`UserError` without the ``carla`` extra, :class:`Failure` if Osm2Odr breaks or takes longer than two
    minutes, :class:`Rejection` (``map_distorted``) if it makes no road of the extract.
    """
    network = read_opendrive(run_osm2odr(write_osm(extract), frame), name="Osm2Odr's map")
    if not any(road.junction_id is None for road in network.roads):
        raise Rejection(Reason.MAP_DISTORTED, "Osm2Odr made no road of the extract.")
    network = replace(
        network,
        frame=frame,
        converter=f"CARLA Osm2Odr {importlib.metadata.version('carla')}",
        attribution=extract.attribution,
    )
    return add_way_tags(merge_directions(drop_dangling_links(network)), extract)


def _require_osm2odr() -> None:
    """Raise :class:`UserError` without the ``carla`` extra, which Osm2Odr is a part of."""
    if importlib.util.find_spec("carla") is None:
        raise UserError(
            "roads.converter = 'osm2odr' needs the carla package, which is not installed: "
            "pip install 'trace-dag[carla]', or use roads.converter = 'native'"
        )


def run_osm2odr(osm: bytes, frame: LocalFrame) -> bytes:
    """Run Osm2Odr on OSM XML in a process of its own and return its OpenDRIVE, in ``frame``.

    Raises the errors of :func:`convert_with_osm2odr`.
    """
    _require_osm2odr()
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "map.osm", Path(folder) / "map.xodr"
        source.write_bytes(osm)
        command = [sys.executable, "-c", SCRIPT, str(source), str(target), frame.proj]
        try:
            done = subprocess.run(command, capture_output=True, timeout=_TIME_LIMIT_S, check=False)  # noqa: S603
        except subprocess.TimeoutExpired as error:
            raise Failure(f"Osm2Odr was still running after {_TIME_LIMIT_S:.0f} s and was stopped") from error
        if done.returncode != 0 or not target.exists():
            words = done.stderr.decode(errors="replace").strip().splitlines()
            raise Failure(f"Osm2Odr ended with code {done.returncode}: {words[-1] if words else 'no message'}")
        return target.read_bytes()


SCRIPT: Final = """
import sys
from pathlib import Path
import carla
source, target, proj = sys.argv[1:]
settings = carla.Osm2OdrSettings()
settings.proj_string = proj
settings.center_map = False
settings.use_offsets = False
settings.generate_traffic_lights = True
Path(target).write_text(carla.Osm2Odr.convert(Path(source).read_text(encoding="utf-8"), settings), encoding="utf-8")
"""


def drop_dangling_links(network: RoadNetwork) -> RoadNetwork:
    """Return the network without links to missing junctions, to which Osm2Odr links dead ends."""

    def kept(link: RoadLink | None) -> RoadLink | None:
        known = network.junction_by_id if link is not None and link.element_type == "junction" else network.road_by_id
        return link if link is not None and link.element_id in known else None

    roads = (
        replace(road, predecessor=kept(road.predecessor), successor=kept(road.successor)) for road in network.roads
    )
    return replace(network, roads=tuple(roads))


# --- two directions, one road ------------------------------------------------------------------------------------
def merge_directions(network: RoadNetwork) -> RoadNetwork:
    """Join pairs of one-way roads that share name, length and reference line in opposite directions.

    A pair is joined only if the neighbours at both ends are the same, so that one link serves both directions.
    """
    partner = _opposite_roads(network)
    while True:
        merged = {gone: kept for kept, gone in partner.items()}
        broken = [kept for kept in partner if not _same_surroundings(network, kept, partner[kept], merged)]
        if not broken:
            break
        for kept in broken:
            del partner[kept]
    merged = {gone: kept for kept, gone in partner.items()}
    relinked = {road.id: _relinked(road, merged) for road in network.roads}
    roads = [
        _joined(road, relinked[partner[road.id]]) if road.id in partner else road
        for road in relinked.values()
        if road.id not in merged
    ]
    junctions = tuple(
        replace(junction, connections=tuple(_moved_connection(c, merged) for c in junction.connections))
        for junction in network.junctions
    )
    return replace(network, roads=tuple(roads), junctions=_renumbered(junctions))


def _renumbered(junctions: tuple[Junction, ...]) -> tuple[Junction, ...]:
    """Return connections with new numbers within each junction, because Osm2Odr repeats numbers."""
    return tuple(
        replace(junction, connections=tuple(replace(c, id=str(n)) for n, c in enumerate(junction.connections)))
        for junction in junctions
    )


def _opposite_roads(network: RoadNetwork) -> dict[str, str]:
    """Return pairs of road ids: the road that is kept, and the road that becomes its left side."""
    simple = [road for road in network.roads if road.junction_id is None and _is_simple(road)]
    lines = {road.id: network.road_geometry(road.id).line for road in simple}
    pairs: dict[str, str] = {}
    taken: set[str] = set()
    for number, road in enumerate(simple):
        for other in simple[number + 1 :]:
            if {road.id, other.id} & taken or road.name != other.name:
                continue
            if abs(road.length_m - other.length_m) > 0.02 * road.length_m + _SAME_LINE_M:
                continue
            shares = np.linspace(0.0, 1.0, 9)
            here = lines[road.id].sample(shares * road.length_m)[:, :2]
            there = lines[other.id].sample((1.0 - shares) * other.length_m)[:, :2]
            if np.hypot(*(here - there).T).max() <= _SAME_LINE_M:
                pairs[road.id] = other.id
                taken |= {road.id, other.id}
    return pairs


def _is_simple(road: Road) -> bool:
    """Return one section of constant lanes to the right of its reference line."""
    lanes = road.lane_sections[0].lanes
    return (
        len(road.lane_sections) == 1
        and all(lane.id <= 0 for lane in lanes)
        and all(c.b == c.c == c.d == 0 for lane in lanes for c in lane.widths)
        and all(len(lane.widths) == 1 for lane in lanes if lane.id)
        and all(c.a == c.b == c.c == c.d == 0 for c in road.lane_offset)
    )


def _same_surroundings(network: RoadNetwork, kept: str, gone: str, merged: Mapping[str, str]) -> bool:
    a, b = network.road_by_id[kept], network.road_by_id[gone]
    return all(
        (_moved_link(one, merged) if one else None) == (_moved_link(two, merged) if two else None)
        for one, two in ((a.predecessor, b.successor), (a.successor, b.predecessor))
    )


def _moved_link(link: RoadLink, merged: Mapping[str, str]) -> RoadLink:
    """Return a link to a removed road as a link to the other end of the road that was kept."""
    if link.element_type != "road" or link.element_id not in merged:
        return link
    return RoadLink("road", merged[link.element_id], _other_end(link.contact_point))


def _other_end(contact: ContactPoint | None) -> ContactPoint | None:
    if contact is None:
        return None
    return ContactPoint.END if contact is ContactPoint.START else ContactPoint.START


def _joined(road: Road, gone: Road) -> Road:
    """Return one road made of two relinked ones: the lanes of ``gone`` become the left lanes."""
    left = tuple(
        replace(lane, id=-lane.id, predecessor=lane.successor, successor=lane.predecessor)
        for lane in gone.lane_sections[0].lanes
        if lane.id
    )
    centre = Lane(0, LaneType.NONE, (), mark=YELLOW_BROKEN, legal_mark=YELLOW_DOUBLE)
    right = tuple(lane for lane in road.lane_sections[0].lanes if lane.id)
    lanes = tuple(sorted((*left, centre, *right), key=lambda lane: -lane.id))
    signals = road.signals + tuple(_mirrored(signal, road.length_m) for signal in gone.signals)
    return replace(road, lane_sections=(LaneSection(0.0, lanes),), signals=signals)


def _mirrored(signal: Signal, length_m: float) -> Signal:
    orientation = {"+": "-", "-": "+"}.get(signal.orientation, signal.orientation)
    return replace(signal, s_m=max(length_m - signal.s_m, 0.0), t_m=-signal.t_m, orientation=orientation)


def _relinked(road: Road, merged: Mapping[str, str]) -> Road:
    """Return a road whose links, and those of its lanes, point to the merged neighbours."""
    sections = list(road.lane_sections)
    for link, index, key in ((road.predecessor, 0, "predecessor"), (road.successor, -1, "successor")):
        if link is not None and link.element_type == "road" and link.element_id in merged:
            lanes = (
                lane if getattr(lane, key) is None else replace(lane, **{key: -getattr(lane, key)})
                for lane in sections[index].lanes
            )
            sections[index] = replace(sections[index], lanes=tuple(lanes))
    return replace(
        road,
        lane_sections=tuple(sections),
        predecessor=_moved_link(road.predecessor, merged) if road.predecessor else None,
        successor=_moved_link(road.successor, merged) if road.successor else None,
    )


def _moved_connection(connection: Connection, merged: Mapping[str, str]) -> Connection:
    if connection.incoming_road not in merged:
        return connection
    return replace(
        connection,
        incoming_road=merged[connection.incoming_road],
        lane_links=tuple((-source, target) for source, target in connection.lane_links),
    )


# --- what the ways say -------------------------------------------------------------------------------------------
def add_way_tags(network: RoadNetwork, extract: OsmExtract) -> RoadNetwork:
    """Return the network with class, names, speed and sources of each road, taken from the ways under it.

    >>> nameless = replace(network, roads=tuple(replace(road, names=(), name="") for road in network.roads))
    >>> add_way_tags(nameless, extract).roads[0].names
    ('Cedar Street', 'NE 97')
    """
    ways = [way for way in extract.ways if is_drivable(way.tags, service_roads=True)]
    lines = np.array([shapely.LineString(_way_line(way, extract, network.frame)) for way in ways], dtype=object)
    tree = shapely.STRtree(lines)
    roads = []
    for road in network.roads:
        line = network.road_geometry(road.id).line
        points = np.asarray(shapely.points(line.sample(line.stations(2.0))[:, :2]), dtype=object)
        near, found = tree.query(points, predicate="dwithin", distance=_ON_WAY_M)
        counts: dict[int, int] = {}
        if road.junction_id is None and len(found):
            distances = np.asarray(shapely.distance(points[near], lines[found]))
            # Each point counts for the nearest of the ways it lies on.
            order = np.lexsort((distances, near))
            first = np.unique(near[order], return_index=True)[1]
            for index in found[order][first]:
                counts[int(index)] = counts.get(int(index), 0) + 1
        chosen = [index for index, count in counts.items() if count >= 0.1 * len(points)]
        roads.append(_tagged(road, [ways[i] for i in sorted(chosen, key=lambda i: -counts[i])]))
    return replace(network, roads=tuple(roads))


def _way_line(way: OsmWay, extract: OsmExtract, frame: LocalFrame) -> FloatArray:
    nodes = [extract.nodes[node_id] for node_id in way.node_ids]
    return frame.to_local(np.array([n.latitude_deg for n in nodes]), np.array([n.longitude_deg for n in nodes]))


def _tagged(road: Road, ways: list[OsmWay]) -> Road:
    if not ways:
        return road
    profile = read_profile(ways[0])
    return replace(
        road,
        highway=profile.highway,
        names=profile.names,
        osm_way_ids=tuple(way.id for way in ways),
        speed_mps=profile.speed_forward_mps if profile.speed_forward_mps is not None else road.speed_mps,
        layer=profile.layer,
        bridge=profile.bridge,
        tunnel=profile.tunnel,
    )
