"""Lane geometry: centres, borders, widths and heights by ``s``, scalar and vectorised.

One :class:`RoadGeometry` per road, one :class:`LaneGeometry` per lane; both are made by
:class:`~trace_dag.roads.map.network.RoadNetwork` on first use and kept.
"""

from __future__ import annotations

import math
from operator import attrgetter
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.reference_line import (
    ReferenceLine,
    Stations,
    sample_profiles,
    sample_reference_lines,
    stations_between,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import Lane, LaneSection, Road


LANE_STEP_M: Final = 2.0
"""Points of a sampled lane are at most so far apart along the reference line."""
_lane_id: Final = attrgetter("id")


class SectionLine(NamedTuple):
    """The reference line along a lane section every :data:`LANE_STEP_M`, from which its lanes are offset."""

    stations_m: FloatArray
    line: FloatArray  # (n, 4): x, y, heading, curvature
    height_m: FloatArray
    sine: FloatArray
    cosine: FloatArray

    def beside(self, t_m: FloatArray) -> FloatArray:
        """Return points ``t_m`` to the left of the line, shape (n, 3)."""
        x, y = self.line[:, 0], self.line[:, 1]
        return np.stack([x - t_m * self.sine, y + t_m * self.cosine, self.height_m], axis=1)


class LaneSamples(NamedTuple):
    """A lane along its section every :data:`LANE_STEP_M`, in the direction of the reference line.

    It has ``s_m``, (n,), the centre, and the inner and outer border, shape (n, 3) each, x, y, z.
    """

    stations_m: FloatArray
    centre_m: FloatArray
    inner_m: FloatArray
    outer_m: FloatArray


class LaneProjection(NamedTuple):
    """A point relative to a lane: ``s_m``, ``offset_m`` left of its centre in travel direction, ``outside_m``."""

    s_m: float
    offset_m: float
    outside_m: float


class RoadGeometry:
    """Reference line, lane offset and elevation of one road."""

    def __init__(self, road: Road) -> None:
        self.road = road
        self.line = ReferenceLine(road.plan, road.length_m)
        self.lane_offset = CubicProfile.of(road.lane_offset)
        self.elevation = CubicProfile.of(road.elevation)
        self._section_lines: dict[tuple[float, float], SectionLine] = {}

    def section_line(self, begin_m: float, end_m: float) -> SectionLine:
        """Return the reference line between the ends of a lane section, sampled once."""
        if (begin_m, end_m) not in self._section_lines:
            _sample_section_lines([(self, begin_m, end_m)])
        return self._section_lines[begin_m, end_m]

    def section_span(self, index: int) -> tuple[float, float]:
        """Return ``s_m`` of the beginning and the end of a lane section."""
        sections = self.road.lane_sections
        end_m = sections[index + 1].s_m if index + 1 < len(sections) else self.road.length_m
        return sections[index].s_m, end_m

    def lanes_of(self, index: int) -> dict[int, LaneGeometry]:
        """Return the geometry of every lane but the centre one of a section, by lane id."""
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
        """Return the height of the road surface, constant beyond the road's ends."""
        return self.elevation.at(min(max(s_m, 0.0), self.road.length_m))


def _outward(section: LaneSection, sign: int) -> list[Lane]:
    return sorted([lane for lane in section.lanes if lane.id * sign > 0], key=_lane_id, reverse=sign < 0)


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
        self.direction = road.road.direction(lane.id)
        self._centrelines: dict[float, FloatArray] = {}
        self._samples: LaneSamples | None = None

    @property
    def length_m(self) -> float:
        """Return the length along the reference line."""
        return self.end_m - self.begin_m

    def pose(self, s_m: float, offset_m: float = 0.0) -> Pose:
        """Return the pose at ``s_m``, ``offset_m`` to the left of the centre, in the direction of travel."""
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
        """Return poses at many ``s_m`` like :meth:`pose`, shape (n, 4): x, y, z, heading (continuous)."""
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
        """Return the centre in the direction of travel, shape (n, 4), read-only."""
        line = self._centrelines.get(step_m)
        if line is None:
            line = self.between(self.begin_m, self.end_m, step_m)
            line.flags.writeable = False
            self._centrelines[step_m] = line
        return line

    def between(self, low_m: float, high_m: float, step_m: float) -> FloatArray:
        """Return the centre between two ``s_m`` in the direction of travel, shape (n, 4), with both ends."""
        stations = self.road.line.stations(step_m, low_m, high_m)
        return self.sample(stations if self.direction > 0 else stations[::-1])

    @property
    def samples(self) -> LaneSamples:
        """Return the lane as points, which are sampled once."""
        if self._samples is None:
            sample_lanes([self])
        assert self._samples is not None
        return self._samples

    def borders(self) -> tuple[FloatArray, FloatArray]:
        """Return the left and right border in the direction of travel, shape (n, 3) each."""
        _, _, inner, outer = self.samples  # where traffic keeps to the right, the reference line is left of its lanes
        left, right = (outer, inner) if self.road.road.left_hand else (inner, outer)
        return (left, right) if self.direction > 0 else (left[::-1], right[::-1])

    def project(self, x_m: float, y_m: float) -> LaneProjection:
        """Return a point's exact coordinates in the lane; the inverse of :meth:`pose` within the lane's span."""
        stations, points = self.samples.stations_m, self.samples.centre_m
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


def lane_ends(lanes: Sequence[LaneGeometry]) -> Stations:
    """Return the beginning and the end of each lane along its reference line."""
    ends_m = np.array([(lane.begin_m, lane.end_m) for lane in lanes]).ravel()
    return Stations(ends_m, np.repeat(np.arange(len(lanes)), 2), 2 * np.arange(len(lanes)))


def _sample_section_lines(sections: Sequence[tuple[RoadGeometry, float, float]]) -> None:
    """Sample the reference lines of several lane sections: roads, and where along each a section begins and ends."""
    roads, begins_m, ends_m = zip(*sections, strict=True)
    stations = stations_between(np.array(begins_m), np.array(ends_m), LANE_STEP_M)
    line = sample_reference_lines([road.line for road in roads], stations)
    height_m = sample_profiles([road.elevation for road in roads], stations)
    sine, cosine = np.sin(line[:, 2]), np.cos(line[:, 2])
    for (road, begin_m, end_m), where in zip(sections, stations.slices, strict=True):
        made = SectionLine(stations.s_m[where], line[where], height_m[where], sine[where], cosine[where])
        road._section_lines[begin_m, end_m] = made


def sample_lanes(lanes: Iterable[LaneGeometry]) -> None:
    """Sample the lanes that have no samples yet."""
    wanted = [lane for lane in dict.fromkeys(lanes) if lane._samples is None]
    if not wanted:
        return
    sections = dict.fromkeys((lane.road, lane.begin_m, lane.end_m) for lane in wanted)
    missing = [each for each in sections if each[1:] not in each[0]._section_lines]
    if missing:
        _sample_section_lines(missing)
    lines = [lane.road.section_line(lane.begin_m, lane.end_m) for lane in wanted]
    counts = np.array([len(line.stations_m) for line in lines])
    owner = np.repeat(np.arange(len(lines)), counts)
    together = SectionLine(*(np.concatenate(columns) for columns in zip(*lines, strict=True)))
    stations = Stations(together.stations_m, owner, np.cumsum(counts) - counts)
    centre_m = sample_profiles([lane.centre for lane in wanted], stations)
    half_m = sample_profiles([lane.width for lane in wanted], stations) / 2
    outward_m = np.sign([lane.lane.id for lane in wanted])[owner] * half_m
    points = together.beside(centre_m), together.beside(centre_m - outward_m), together.beside(centre_m + outward_m)
    for lane, line, where in zip(wanted, lines, stations.slices, strict=True):
        lane._samples = LaneSamples(line.stations_m, *(each[where] for each in points))


def sample_at(lanes: Sequence[LaneGeometry], stations: Stations) -> FloatArray:
    """Return centres of several lanes, each at its stations, (n, 4).

    They have x, y, z (metres) and heading (radians) in the direction of travel, continuous along each lane.
    """
    owner, s_m = stations.owner, stations.s_m
    line = sample_reference_lines([lane.road.line for lane in lanes], stations)
    begin_m, end_m, length_m, direction = (
        np.array([(lane.begin_m, lane.end_m, lane.road.line.length_m, lane.direction) for lane in lanes])
        .reshape(-1, 4)
        .T
    )
    on_lane = stations._replace(s_m=np.clip(s_m, begin_m[owner], end_m[owner]))
    on_road = stations._replace(s_m=np.clip(s_m, 0.0, length_m[owner]))
    t = sample_profiles([lane.centre for lane in lanes], on_lane)
    out = np.empty((len(s_m), 4))
    out[:, 0] = line[:, 0] - t * np.sin(line[:, 2])
    out[:, 1] = line[:, 1] + t * np.cos(line[:, 2])
    out[:, 2] = sample_profiles([lane.road.elevation for lane in lanes], on_road)
    out[:, 3] = line[:, 2]
    for lane, where in zip(lanes, stations.slices, strict=True):
        if lane.centre.constant is None:
            slope = lane.centre.sample_slope(on_lane.s_m[where])
            out[where, 3] += np.arctan2(slope, np.maximum(1.0 - line[where, 3] * t[where], 1e-6))
    out[:, 3] += np.where(direction < 0, np.pi, 0.0)[owner]
    # Full turns are taken off a whole lane, so that it starts in (-pi, pi] and stays continuous.
    begins = out[stations.first, 3].tolist()
    out[:, 3] += np.array([math.remainder(begin, math.tau) - begin for begin in begins])[owner]
    return out
