"""The part of a road network in a window, for drawing.

Belongs here: the visible parts of roads. Does not belong here: lanes as points, which the network keeps
(:mod:`trace_dag.roads.map.lane_geometry`), and their look (:mod:`trace_dag.pages.maps` and the modules it draws with).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.lane_geometry import sample_lanes
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.reference_line import Stations, sample_reference_lines

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.lane_geometry import LaneGeometry
    from trace_dag.roads.map.model import Road
    from trace_dag.roads.map.network import RoadNetwork

Window = tuple[float, float, float, float]
"""West, south, east and north border, metres."""

_MARGIN_M: Final = 25.0  # half of a wide road, so that no road is missed whose edge is in the window
_STRAIGHT_M: Final = 0.004  # borders that are straight to this need no points on the way


def window_of(network: RoadNetwork) -> Window:
    """Return the window that shows a whole map.

    >>> west, south, east, north = window_of(network)
    >>> west < 0.0 < east and south < 0.0 < north
    True
    """
    lines = [network.road_geometry(road.id).line for road in network.roads]
    ends_m = np.array([line.length_m for line in lines])
    ends = sample_reference_lines(lines, Stations(ends_m, np.arange(len(lines)), np.arange(len(lines))))[:, :2]
    points = np.concatenate([ends, [(piece.x_m, piece.y_m) for road in network.roads for piece in road.plan]])
    (west, south), (east, north) = (points.min(axis=0) - _MARGIN_M).tolist(), (points.max(axis=0) + _MARGIN_M).tolist()
    return west, south, east, north


@dataclass(frozen=True, eq=False)
class SeenLane:
    """A lane in sight, with its inner and outer border as seen from the reference line, x, y, z, shape (n, 3).

    Its surface is a ring of shape (k, 2) without needless points.
    """

    geometry: LaneGeometry
    road: Road
    inner_m: FloatArray
    outer_m: FloatArray
    outline_m: FloatArray


@dataclass(frozen=True, eq=False)
class SeenSection:
    """The stretch of a lane section in sight. ``line_m``: x, y, heading and curvature of the reference line, (n, 4).

    ``centre_m``: where lane 0 lies, shape (n, 2).
    """

    road: Road
    index: int
    line_m: FloatArray
    centre_m: FloatArray
    lanes: tuple[SeenLane, ...]


class MapScene:
    """The sections inside a window (m), in the order of the network's roads."""

    def __init__(self, network: RoadNetwork, window: Window) -> None:
        self.network = network
        self.sections = _sections(network, list(_seen(network, window)))

    @property
    def lanes(self) -> Iterator[SeenLane]:
        """Return every lane in sight."""
        return (lane for section in self.sections for lane in section.lanes)

    @cached_property
    def surfaces(self) -> shapely.STRtree:
        """Return the surfaces of all lanes in sight, by place."""
        lanes = (lane for lane in self.lanes if lane.geometry.lane.type is not LaneType.NONE)
        return shapely.STRtree([shapely.Polygon(lane.outline_m) for lane in lanes if len(lane.outline_m) > 2])

    @cached_property
    def major_junctions(self) -> set[str | None]:
        """Return junctions of public roads, not of service roads alone."""
        return {road.junction_id for road in self.network.roads if road.highway != "service"} - {None}

    def sections_by_layer(self) -> list[tuple[int, list[SeenSection]]]:
        """Return the sections from the lowest layer to the highest, so that a bridge covers roads below it."""
        layers: dict[int, list[SeenSection]] = defaultdict(list)
        for section in self.sections:
            road = section.road
            layers[road.layer or (1 if road.bridge else -1 if road.tunnel else 0)].append(section)
        return sorted(layers.items())


class _Stretch(NamedTuple):
    road: Road
    section: int
    points: slice  # of its samples


def _seen(network: RoadNetwork, window: Window) -> Iterator[_Stretch]:
    roads = network.roads_within(window)
    sample_lanes(
        network.geometry(LaneRef(road.id, index, lane.id))
        for road in roads
        for index, section in enumerate(road.lane_sections)
        for lane in section.lanes
        if lane.id != 0
    )
    for road in roads:
        geometry = network.road_geometry(road.id)
        for index in range(len(road.lane_sections)):
            line = geometry.section_line(*geometry.section_span(index))
            shown = np.flatnonzero(inside(line.line, window, _MARGIN_M))
            if not len(shown):
                continue
            yield _Stretch(road, index, slice(max(int(shown[0]) - 1, 0), int(shown[-1]) + 2))


def _sections(network: RoadNetwork, stretches: Sequence[_Stretch]) -> tuple[SeenSection, ...]:
    lanes = [
        [network.geometry(LaneRef(road.id, index, each.id)) for each in road.lane_sections[index].lanes if each.id != 0]
        for road, index, _ in stretches
    ]
    borders = [
        (lane.samples.inner_m[seen], lane.samples.outer_m[seen])
        for (_, _, seen), beside in zip(stretches, lanes, strict=True)
        for lane in beside
    ]
    outlined = ((*sides, ring) for sides, ring in zip(borders, _outlines(borders), strict=True))
    sections = []
    for (road, index, seen), beside in zip(stretches, lanes, strict=True):
        geometry = network.road_geometry(road.id)
        line = geometry.section_line(*geometry.section_span(index))
        centre = line.beside(geometry.lane_offset.sample(line.stations_m))[seen, :2]
        seen_lanes = tuple(SeenLane(lane, road, *next(outlined)) for lane in beside)
        sections.append(SeenSection(road, index, line.line[seen], centre, seen_lanes))
    return tuple(sections)


def _outlines(borders: Sequence[tuple[FloatArray, FloatArray]]) -> list[FloatArray]:
    """Return the rings around lanes; all borders are simplified in one call, in a fifth of the time."""
    if not borders:
        return []
    lines = [line[:, :2] for inner, outer in borders for line in (inner, outer[::-1])]
    numbers = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    simple = shapely.simplify(
        shapely.linestrings(np.concatenate(lines), indices=numbers), _STRAIGHT_M, preserve_topology=False
    )
    points, numbers = shapely.get_coordinates(simple, return_index=True)
    return np.split(points, np.flatnonzero(np.diff(numbers // 2)) + 1)


def inside(points_m: FloatArray, window: Window, margin_m: float = 0.0) -> FloatArray:
    """Return a mask of the points, shape (n, 2 or more), in a window widened by a margin; shape (n,).

    >>> inside(np.array([[0.0, 0.0], [12.0, 0.0]]), (-10.0, -10.0, 10.0, 10.0)).tolist()
    [True, False]
    """
    west, south, east, north = window
    x, y = points_m[:, 0], points_m[:, 1]
    shown = (x > west - margin_m) & (x < east + margin_m) & (y > south - margin_m) & (y < north + margin_m)
    return np.asarray(shown)


class Shapes:
    """Rings or lines, shape (n, 2) each, found by window."""

    def __init__(self, points_m: Sequence[FloatArray]) -> None:
        self.points_m = points_m
        self._boxes = np.array([(*points.min(axis=0), *points.max(axis=0)) for points in points_m]).reshape(-1, 4)

    def seen(self, window: Window) -> list[FloatArray]:
        """Return the shapes whose box touches a window."""
        return [self.points_m[number] for number in self.within(window)]

    def within(self, window: Window) -> list[int]:
        """Return the indices of shapes whose box touches a window."""
        west, south, east, north = window
        boxes = self._boxes
        touching = (boxes[:, 0] < east) & (boxes[:, 2] > west) & (boxes[:, 1] < north) & (boxes[:, 3] > south)
        numbers: list[int] = np.flatnonzero(touching).tolist()
        return numbers
