"""Where the lanes of a road lie: centres, borders, widths and heights by ``s``, scalar and vectorised.

One :class:`RoadGeometry` per road, one :class:`LaneGeometry` per lane; both are made by
:class:`~trace_dag.roads.map.network.RoadNetwork` when first asked for and kept by it.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from trace_dag.geometry import Pose
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.reference_line import ReferenceLine

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.roads.map.model import Lane, LaneSection, Road

LANE_STEP_M = 2.0
"""Points of a sampled lane are at most so far apart along the reference line."""


class LaneProjection(NamedTuple):
    """A point relative to a lane: ``s_m``, ``offset_m`` left of its centre in travel direction, ``outside_m``."""

    s_m: float
    offset_m: float
    outside_m: float


class SectionLine(NamedTuple):
    """The reference line along a lane section every :data:`LANE_STEP_M`, which all its lanes are laid beside."""

    stations_m: FloatArray
    line: FloatArray  # (n, 4): x, y, heading, curvature
    height_m: FloatArray
    sine: FloatArray
    cosine: FloatArray

    def beside(self, t_m: FloatArray) -> FloatArray:
        """Points ``t_m`` to the left of the line, shape (n, 3)."""
        x, y = self.line[:, 0], self.line[:, 1]
        return np.stack([x - t_m * self.sine, y + t_m * self.cosine, self.height_m], axis=1)


class LaneSamples(NamedTuple):
    """A lane along its section every :data:`LANE_STEP_M`, in the direction of the reference line: its centre and its
    borders next to that line and away from it, shape (n, 3) each, x, y, z."""

    centre_m: FloatArray
    inner_m: FloatArray
    outer_m: FloatArray


class RoadGeometry:
    """Reference line, lane offset and elevation of one road."""

    def __init__(self, road: Road) -> None:
        self.road = road
        self.line = ReferenceLine(road.plan, road.length_m)
        self.lane_offset = CubicProfile.of(road.lane_offset)
        self.elevation = CubicProfile.of(road.elevation)
        self._section_lines: dict[tuple[float, float], SectionLine] = {}

    def section_line(self, begin_m: float, end_m: float) -> SectionLine:
        """The reference line between the ends of a lane section."""
        found = self._section_lines.get((begin_m, end_m))
        if found is None:
            stations_m = self.line.stations(LANE_STEP_M, begin_m, end_m)
            line, height_m = self.line.sample(stations_m), self.elevation.sample(stations_m)
            found = SectionLine(stations_m, line, height_m, np.sin(line[:, 2]), np.cos(line[:, 2]))
            self._section_lines[begin_m, end_m] = found
        return found

    def section_span(self, index: int) -> tuple[float, float]:
        """``s_m`` where a lane section begins and ends."""
        sections = self.road.lane_sections
        end_m = sections[index + 1].s_m if index + 1 < len(sections) else self.road.length_m
        return sections[index].s_m, end_m

    def lanes_of(self, index: int) -> dict[int, LaneGeometry]:
        """Geometry of every lane but the centre one of a section, by lane id."""
        section = self.road.lane_sections[index]
        out: dict[int, LaneGeometry] = {}
        span = self.section_span(index)
        for sign in (1, -1):
            inner: list[tuple[float, CubicProfile]] = [(1.0, self.lane_offset)]
            for lane in _outward(section, sign):
                width = CubicProfile.of(lane.widths, origin_m=section.s_m)
                centre = CubicProfile.weighted_sum([*inner, (0.5 * sign, width)])
                out[lane.id] = LaneGeometry(self, lane, span, centre, width)
                inner.append((float(sign), width))
        return out

    def height_at(self, s_m: float) -> float:
        """Height of the road surface, constant beyond the road's ends."""
        return self.elevation.at(min(max(s_m, 0.0), self.road.length_m))


def _outward(section: LaneSection, sign: int) -> list[Lane]:
    return sorted((lane for lane in section.lanes if lane.id * sign > 0), key=lambda lane: abs(lane.id))


class LaneGeometry:
    """Centre and width of one lane. ``direction`` is +1 along the reference line, -1 against it."""

    def __init__(
        self, road: RoadGeometry, lane: Lane, span: tuple[float, float], centre: CubicProfile, width: CubicProfile
    ) -> None:
        self.road = road
        self.lane = lane
        self.begin_m, self.end_m = span
        self.centre = centre
        self.width = width
        self.direction = -1 if lane.id > 0 else 1
        self._centrelines: dict[float, FloatArray] = {}

    @property
    def length_m(self) -> float:
        """Length along the reference line."""
        return self.end_m - self.begin_m

    def pose(self, s_m: float, offset_m: float = 0.0) -> Pose:
        """Pose at ``s_m``, ``offset_m`` to the left of the centre, heading in the direction of travel."""
        x, y, heading, curvature = self.road.line.at(s_m)
        s_on_lane = min(max(s_m, self.begin_m), self.end_m)
        t = self.centre.at(s_on_lane) + self.direction * offset_m
        slope = self.centre.slope(s_on_lane)
        lane_heading = heading + math.atan2(slope, max(1.0 - curvature * t, 1e-06)) if slope else heading
        if self.direction < 0:
            lane_heading += math.pi
        return Pose(
            x - t * math.sin(heading),
            y + t * math.cos(heading),
            math.remainder(lane_heading, math.tau),
            self.road.height_at(s_m),
        )

    def sample(self, s_m: FloatArray, offset_m: float = 0.0) -> FloatArray:
        """Like :meth:`pose` for many ``s_m``, shape (n, 4): x, y, z, heading (continuous along the array)."""
        line = self.road.line.sample(s_m)
        s_on_lane = np.clip(s_m, self.begin_m, self.end_m)
        t = self.centre.sample(s_on_lane) + self.direction * offset_m
        out = np.empty((len(s_m), 4))
        out[:, 0] = line[:, 0] - t * np.sin(line[:, 2])
        out[:, 1] = line[:, 1] + t * np.cos(line[:, 2])
        out[:, 2] = self.road.elevation.sample(np.clip(s_m, 0.0, self.road.road.length_m))
        out[:, 3] = line[:, 2]
        if self.centre.constant is None:
            slope = self.centre.sample_slope(s_on_lane)
            out[:, 3] += np.arctan2(slope, np.maximum(1.0 - line[:, 3] * t, 1e-6))
        if self.direction < 0:
            out[:, 3] += np.pi
        # One full turn is taken off the whole array, so that it starts in (-pi, pi] and stays continuous.
        out[:, 3] += math.remainder(out[0, 3], math.tau) - out[0, 3]
        return out

    def centreline(self, step_m: float) -> FloatArray:
        """The centre in the direction of travel, shape (n, 4), read-only."""
        line = self._centrelines.get(step_m)
        if line is None:
            line = self.between(self.begin_m, self.end_m, step_m)
            line.flags.writeable = False
            self._centrelines[step_m] = line
        return line

    def between(self, low_m: float, high_m: float, step_m: float) -> FloatArray:
        """The centre between two ``s_m``, in the direction of travel, shape (n, 4), both ends included."""
        stations = self.road.line.stations(step_m, low_m, high_m)
        return self.sample(stations if self.direction > 0 else stations[::-1])

    @cached_property
    def samples(self) -> LaneSamples:
        """The lane as points: sampled once for all that look at it."""
        line = self.road.section_line(self.begin_m, self.end_m)
        centre_m, half_m = self.centre.sample(line.stations_m), self.width.sample(line.stations_m) / 2
        outward_m = -self.direction * half_m
        return LaneSamples(
            self._search_samples[1], line.beside(centre_m - outward_m), line.beside(centre_m + outward_m)
        )

    def borders(self) -> tuple[FloatArray, FloatArray]:
        """Left and right border as seen in the direction of travel, shape (n, 3) each, in that direction."""
        _, left, right = self.samples  # traffic keeps to the right: a reference line is to the left of its lanes
        return (left, right) if self.direction > 0 else (left[::-1], right[::-1])

    @cached_property
    def _search_samples(self) -> tuple[FloatArray, FloatArray]:
        line = self.road.section_line(self.begin_m, self.end_m)
        return line.stations_m, line.beside(self.centre.sample(line.stations_m))

    @property
    def search_line(self) -> FloatArray:
        """Coarse centre along increasing ``s``, shape (n, 2), for spatial indexes."""
        return self._search_samples[1][:, :2]

    def project(self, x_m: float, y_m: float) -> LaneProjection:
        """The point in the lane's own coordinates, exact; the inverse of :meth:`pose` within the lane's span."""
        stations, points = self._search_samples
        nearest = int(np.argmin((points[:, 0] - x_m) ** 2 + (points[:, 1] - y_m) ** 2))
        s_m, t_m, beyond_m = self.road.line.project(x_m, y_m, float(stations[nearest]))
        if s_m < self.begin_m or s_m > self.end_m:
            # The section ends here though the road goes on: measure from the section's end.
            s_m = min(max(s_m, self.begin_m), self.end_m)
            x, y, heading, _ = self.road.line.at(s_m)
            c, s = math.cos(heading), math.sin(heading)
            beyond_m = abs((x_m - x) * c + (y_m - y) * s)
            t_m = -(x_m - x) * s + (y_m - y) * c
        offset_m = (t_m - self.centre.at(s_m)) * self.direction
        aside_m = max(abs(offset_m) - self.width.at(s_m) / 2, 0.0)
        return LaneProjection(s_m, offset_m, math.hypot(aside_m, beyond_m))
