"""The surfaces of a drawn map: lanes by type, the asphalt between them, the decks of bridges, heights as colours."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trace_dag.roads.map.model import LaneType
from trace_dag.scenario.canvas import Canvas, Ink
from trace_dag.scenario.map_scene import MapScene, SeenLane, SeenSection, Shapes
from trace_dag.scenario.paving import paved_gaps

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray

ASPHALT: Final = "#6B7075"
SURFACES: Final = {
    LaneType.DRIVING: ASPHALT,
    LaneType.ENTRY: ASPHALT,
    LaneType.EXIT: ASPHALT,
    LaneType.BIDIRECTIONAL: "#7A746B",
    LaneType.SHOULDER: "#8E9296",
    LaneType.PARKING: "#7F8488",
    LaneType.MEDIAN: "#C3CDAF",
    LaneType.SIDEWALK: "#D9D3C7",
    LaneType.BORDER: "#C9C4B8",
    LaneType.BIKING: "#7C8F7B",
}
MINOR_SURFACE: Final = "#878B8E"  # service roads and driveways
_BRIDGE_EDGE: Final = "#3A3D40"
_LEAST_RISE_M: Final = 0.5  # flatter ground is of one colour


_VIRIDIS: Final = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
"""Red, green and blue from the lowest to the highest ground: matplotlib's colour map of that name, in quarters."""


class Shade(NamedTuple):
    """Heights to colours."""

    low_m: float
    high_m: float

    def of(self, height_m: float) -> str:
        """The colour of a height.

        >>> Shade(0.0, 10.0).of(10.0)
        '#fde725'
        """
        share = min(max((height_m - self.low_m) / max(self.high_m - self.low_m, 1e-9), 0.0), 1.0)
        at = np.linspace(0.0, 1.0, len(_VIRIDIS))
        red, green, blue = (round(float(np.interp(share, at, part))) for part in _VIRIDIS.T)
        return f"#{red:02x}{green:02x}{blue:02x}"


def height_shades(scene: MapScene) -> Shade | None:
    """Colours for the heights in sight; none where the ground is flat."""
    heights = [lane.inner_m[:, 2] for lane in scene.lanes]
    if not heights:
        return None
    every = np.concatenate(heights)
    low, high = float(every.min()), float(every.max())
    return Shade(low, high) if high - low >= _LEAST_RISE_M else None


class Surfaces:
    """The paved and planted areas of one level, later ones above earlier ones."""

    def __init__(self, scene: MapScene, sections: Sequence[SeenSection], shade: Shade | None) -> None:
        rings: list[FloatArray] = []
        colours: list[str] = []
        lanes = [lane for section in sections for lane in section.lanes]
        for ring, colour in _gaps(scene, lanes, shade):
            rings.append(ring)
            colours.append(colour)
        self._first_lane = len(rings)
        for lane in sorted(lanes, key=lambda lane: _order(scene, lane)):
            lane_type = lane.geometry.lane.type
            if lane_type is LaneType.NONE:
                continue
            if shade is not None and lane_type.drivable:
                inner, outer = lane.inner_m, lane.outer_m
                # One quad per step, each with the colour of its own height.
                rings += list(np.stack([inner[:-1, :2], outer[:-1, :2], outer[1:, :2], inner[1:, :2]], axis=1))
                colours += [shade.of(height) for height in (inner[:-1, 2] + inner[1:, 2]) / 2]
                continue
            rings.append(lane.outline_m)
            colours.append(MINOR_SURFACE if _is_minor(scene, lane) else SURFACES[lane_type])
        self._shapes, self._colours = Shapes(rings), colours

    def draw(self, canvas: Canvas, z: float, *, bridge: bool) -> None:
        """Draw what the window shows; a bridge's deck has a dark rim against what lies below."""
        shown = self._shapes.within(canvas.window)
        if bridge:
            deck = [self._shapes.points_m[number] for number in shown if number >= self._first_lane]
            canvas.polygons(deck, Ink(_BRIDGE_EDGE, _BRIDGE_EDGE, 2.5), z)
        # Neighbours of one colour are one path; edges in the colour of the face close the hairlines between others.
        for colour, numbers in groupby(shown, key=lambda number: self._colours[number]):
            canvas.polygons([self._shapes.points_m[number] for number in numbers], Ink(colour, colour, 0.6), z + 0.1)


def _order(scene: MapScene, lane: SeenLane) -> tuple[bool, bool, bool]:
    """The order of drawing, later over earlier: drivable lanes, greater roads, centre lanes that go on past a
    driveway."""
    lane_type = lane.geometry.lane.type
    return lane_type.drivable, not _is_minor(scene, lane), lane_type is LaneType.BIDIRECTIONAL


def _gaps(scene: MapScene, lanes: Sequence[SeenLane], shade: Shade | None) -> list[tuple[FloatArray, str]]:
    """The pavement between the lanes of junctions, drawn below the lanes so that no seams show: rings and their
    colours."""
    paved: list[SeenLane] = []
    through: dict[str, list[int]] = defaultdict(list)
    for lane in lanes:
        lane_type, junction = lane.geometry.lane.type, lane.road.junction_id
        if lane_type.drivable and junction is not None:
            through[junction].append(len(paved))
        if lane_type is LaneType.BIDIRECTIONAL or (lane_type.drivable and junction is not None):
            paved.append(lane)
    gaps: list[tuple[FloatArray, str]] = []
    for gap in paved_gaps([lane.outline_m for lane in paved], through.values()):
        bordering = [paved[number] for number in gap.lanes]
        if shade is not None:
            gaps.append((gap.outline_m, shade.of(float(np.mean([lane.inner_m[:, 2].mean() for lane in bordering])))))
        else:
            gaps.append(
                (gap.outline_m, MINOR_SURFACE if all(_is_minor(scene, each) for each in bordering) else ASPHALT)
            )
    return gaps


def _is_minor(scene: MapScene, lane: SeenLane) -> bool:
    if lane.road.highway != "service" or lane.road.junction_id in scene.major_junctions:
        return False
    return lane.geometry.lane.type is LaneType.DRIVING
