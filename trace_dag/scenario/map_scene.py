"""The part of a road network in a window, for what is drawn of it.

Belongs here: which stretches of which roads are visible. Does not belong here: lanes as points, which the network keeps
for all that look at them (:mod:`trace_dag.roads.map.lane_geometry`), and how they look (:mod:`trace_dag.scenario.maps`
and the modules it draws with).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.roads.map.model import LaneRef

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.roads.map.lane_geometry import LaneGeometry
    from trace_dag.roads.map.model import Road
    from trace_dag.roads.map.network import RoadNetwork

Window = tuple[float, float, float, float]
"""West, south, east and north border, metres."""

_MARGIN_M: Final = 25.0  # half of a wide road, so that no road is missed whose edge is in the window


@dataclass(frozen=True, eq=False)
class SeenLane:
    """A lane of a road in sight: its borders next to the reference line and away from it, shape (n, 3): x, y, z."""

    geometry: LaneGeometry
    road: Road
    inner_m: FloatArray
    outer_m: FloatArray

    @cached_property
    def outline_m(self) -> FloatArray:
        """The surface, a ring of shape (2n, 2)."""
        return np.concatenate([self.inner_m[:, :2], self.outer_m[::-1, :2]])


@dataclass(frozen=True, eq=False)
class SeenSection:
    """The stretch of a lane section in sight. ``line_m``: x, y, heading and curvature of the reference line, (n, 4);
    ``centre_m``: where lane 0 lies, shape (n, 2)."""

    road: Road
    index: int
    line_m: FloatArray
    centre_m: FloatArray
    lanes: tuple[SeenLane, ...]


class MapScene:
    """The sections inside a window (m), in the order of the network's roads."""

    def __init__(self, network: RoadNetwork, window: Window) -> None:
        self.network = network
        self.sections = tuple(_seen(network, window))

    @property
    def lanes(self) -> Iterator[SeenLane]:
        """Every lane in sight."""
        return (lane for section in self.sections for lane in section.lanes)

    @cached_property
    def major_junctions(self) -> set[str | None]:
        """Junctions of public roads, not of service roads alone."""
        return {road.junction_id for road in self.network.roads if road.highway != "service"} - {None}

    def sections_by_layer(self) -> list[tuple[int, list[SeenSection]]]:
        """From the lowest layer to the highest, so that a bridge covers what passes under it."""
        layers: dict[int, list[SeenSection]] = defaultdict(list)
        for section in self.sections:
            road = section.road
            layers[road.layer or (1 if road.bridge else -1 if road.tunnel else 0)].append(section)
        return sorted(layers.items())


def _seen(network: RoadNetwork, window: Window) -> Iterator[SeenSection]:
    for road in network.roads_within(window):
        geometry = network.road_geometry(road.id)
        for index, section in enumerate(road.lane_sections):
            line = geometry.section_line(*geometry.section_span(index))
            shown = np.flatnonzero(inside(line.line, window, _MARGIN_M))
            if not len(shown):
                continue
            seen = slice(max(int(shown[0]) - 1, 0), int(shown[-1]) + 2)
            lanes = [network.geometry(LaneRef(road.id, index, each.id)) for each in section.lanes if each.id != 0]
            yield SeenSection(
                road,
                index,
                line.line[seen],
                line.beside(geometry.lane_offset.sample(line.stations_m))[seen, :2],
                tuple(SeenLane(lane, road, lane.samples.inner_m[seen], lane.samples.outer_m[seen]) for lane in lanes),
            )


def inside(points_m: FloatArray, window: Window, margin_m: float = 0.0) -> FloatArray:
    """Which points, shape (n, 2 or more), lie in a window widened by a margin, shape (n,).

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

    def within(self, window: Window) -> list[int]:
        """The indices of shapes whose box touches a window."""
        west, south, east, north = window
        boxes = self._boxes
        touching = (boxes[:, 0] < east) & (boxes[:, 2] > west) & (boxes[:, 1] < north) & (boxes[:, 3] > south)
        numbers: list[int] = np.flatnonzero(touching).tolist()
        return numbers
