"""The ground of a drawn map: lanes by type, the asphalt between them, the decks of bridges, heights as colours.

Painted lines, arrows and crosswalks. A junction has paved places that belong to no lane of the map.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.canvas import Canvas, Ink
from trace_dag.pages.map_scene import MapScene, SeenLane, SeenSection, Shapes, Window
from trace_dag.roads.map.model import LaneType, RoadMark
from trace_dag.roads.map.people import crosswalks

if TYPE_CHECKING:
    from trace_dag.roads.map.people import CrosswalkPlace

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
SURFACE_NAMES: Final = {ASPHALT: "roadway", MINOR_SURFACE: "service road"} | {
    colour: kind.value.replace("bidirectional", "centre turn lane").replace("biking", "cycle lane")
    for kind, colour in SURFACES.items()
    if colour != ASPHALT
}
_BRIDGE_EDGE: Final = "#3A3D40"
_LEAST_RISE_M: Final = 0.5  # flatter ground is of one colour


_VIRIDIS: Final = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
"""Red, green and blue from the lowest to the highest ground: matplotlib's colour map of that name, in quarters."""
LANE_WIDTH_M: Final = 3.66  # AASHTO Green Book, 7th edition, section 4.3: 12 ft
_LEAST_AREA_M2: Final = 0.01
_TOUCHING_M: Final = 0.1


class Shade(NamedTuple):
    """Heights to colours."""

    low_m: float
    high_m: float

    def of(self, height_m: float) -> str:
        """Return the colour of a height.

        >>> Shade(0.0, 10.0).of(10.0)
        '#fde725'
        """
        share = min(max((height_m - self.low_m) / max(self.high_m - self.low_m, 1e-9), 0.0), 1.0)
        at = np.linspace(0.0, 1.0, len(_VIRIDIS))
        red, green, blue = (round(float(np.interp(share, at, part))) for part in _VIRIDIS.T)
        return f"#{red:02x}{green:02x}{blue:02x}"


def height_shades(scene: MapScene) -> Shade | None:
    """Return colours for the heights in sight; None on flat ground."""
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
        # Cycle lanes of a junction lie below its pavement: others cross them there, so that they would show in pieces.
        across = [lane for lane in lanes if _is_crossed(lane)]
        rings += [lane.outline_m for lane in across]
        colours += [SURFACES[LaneType.BIKING]] * len(across)
        for ring, colour in _gaps(scene, lanes, shade):
            rings.append(ring)
            colours.append(colour)
        self._first_lane = len(rings)
        for lane in sorted((each for each in lanes if not _is_crossed(each)), key=lambda lane: _order(scene, lane)):
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
        self._shapes, self.colours = Shapes(rings), colours

    def draw(self, canvas: Canvas, z: float, *, bridge: bool) -> None:
        """Draw the surfaces in the window; a bridge's deck has a dark rim."""
        shown = self._shapes.within(canvas.window)
        if bridge:
            deck = [self._shapes.points_m[number] for number in shown if number >= self._first_lane]
            canvas.polygons(deck, Ink(_BRIDGE_EDGE, _BRIDGE_EDGE, 2.5), z)
        # Neighbours of one colour are one path; edges in the colour of the face close the hairlines between others.
        for colour, numbers in groupby(shown, key=lambda number: self.colours[number]):
            canvas.polygons([self._shapes.points_m[number] for number in numbers], Ink(colour, colour, 0.6), z + 0.1)


def _is_crossed(lane: SeenLane) -> bool:
    return lane.geometry.lane.type is LaneType.BIKING and lane.road.junction_id is not None


def _order(scene: MapScene, lane: SeenLane) -> tuple[bool, bool, bool]:
    """Return the drawing order of a lane as a sorting key; later lanes cover earlier ones.

    Drivable lanes cover others, then greater roads cover minor ones, then two-way centre lanes cover the rest.
    """
    lane_type = lane.geometry.lane.type
    return lane_type.drivable, not _is_minor(scene, lane), lane_type is LaneType.BIDIRECTIONAL


def _gaps(scene: MapScene, lanes: Sequence[SeenLane], shade: Shade | None) -> list[tuple[FloatArray, str]]:
    """Return the pavement between the lanes of junctions as rings with colours.

    It is drawn below the lanes, so that no seams show.
    """
    paved: list[SeenLane] = []
    through: dict[str, list[int]] = defaultdict(list)
    for lane in lanes:
        lane_type, junction = lane.geometry.lane.type, lane.road.junction_id
        if lane_type.drivable and junction is not None:
            through[junction].append(len(paved))
        if lane_type is LaneType.BIDIRECTIONAL or (lane_type.drivable and junction is not None):
            paved.append(lane)
    gaps: list[tuple[FloatArray, str]] = []
    for gap in find_paved_gaps([lane.outline_m for lane in paved], through.values()):
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


# --- painted lines ----------------------------------------------------------------------------------------------
WHITE: Final = "#F7F7F2"
YELLOW: Final = "#F2C230"
_COLOURS: Final = {"yellow": YELLOW, "white": WHITE, "standard": WHITE}
_DASH_M: Final = 3.05  # MUTCD 2009, section 3A.06: segments of 10 ft, gaps of 30 ft
_PERIOD_M: Final = 12.19
STROKE_M: Final = 0.15
"""Width of a painted line."""
_APART_M: Final = 0.13  # distance of a double line's parts from its middle, if they can be told apart
_NOT_PAINTED: Final = frozenset({"none", "grass", "curb"})


class Marks:
    """The marks of one level. ``legal`` takes the marks that the law requires, else those written in the map."""

    def __init__(self, sections: Sequence[SeenSection], *, legal: bool) -> None:
        found = list(_marks(sections, legal))
        self._lines = Shapes([line for line, _ in found])
        self._kinds = [mark for _, mark in found]

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the marks in the window.

        Double lines stay separate and thin lines visible at small scales.
        """
        apart_m = max(_APART_M, 0.8 / canvas.points_per_m)
        width_pt = min(max(STROKE_M * canvas.points_per_m, 0.45), 3.0)
        for colour, lines in self.strokes(canvas.window, apart_m).items():
            canvas.lines(lines, Ink(stroke=colour, width_pt=width_pt), z)

    def strokes(self, window: Window, apart_m: float = _APART_M) -> dict[str, list[FloatArray]]:
        """Return the painted lines in a window, by colour: lines, shape (n, 2), m.

        The parts of double lines are ``apart_m`` from their middle.
        """
        found: dict[str, list[FloatArray]] = defaultdict(list)
        for number in self._lines.within(window):
            line, mark = self._lines.points_m[number], self._kinds[number]
            kinds = mark.type.split()
            offsets = (0.0,) if len(kinds) == 1 else (apart_m, -apart_m)
            for kind, offset in zip(kinds, offsets, strict=False):
                if kind in _NOT_PAINTED:
                    continue
                shifted = _shifted(line, offset) if offset else line
                found[_COLOURS.get(mark.colour, mark.colour)] += _dashes(shifted) if kind == "broken" else [shifted]
        return found


def _marks(sections: Sequence[SeenSection], legal: bool) -> Iterator[tuple[FloatArray, RoadMark]]:
    """Yield the lines of marks, shape (n, 2), and their types; there are none in junctions."""
    for section in sections:
        if section.road.junction_id is not None:
            continue
        lines = {lane.geometry.lane.id: lane.outer_m[:, :2] for lane in section.lanes} | {0: section.centre_m}
        for lane in section.road.lane_sections[section.index].lanes:
            mark = (lane.legal_mark or lane.mark) if legal else lane.mark
            if mark is not None and mark.type != "none":
                yield lines[lane.id], mark


def _shifted(line: FloatArray, offset_m: float) -> FloatArray:
    step = np.gradient(line, axis=0)
    normal = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
    return np.asarray(line + offset_m * normal)


def _dashes(line: FloatArray) -> list[FloatArray]:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    starts = np.arange((_PERIOD_M - _DASH_M) / 2, max(along[-1] - _DASH_M, 0.0), _PERIOD_M)
    at = starts[:, None] + np.array([0.0, _DASH_M / 2, _DASH_M])
    return list(np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=-1))


# --- arrows -----------------------------------------------------------------------------------------------------
_FAINT_WHITE: Final = "#92969A"  # a quarter white on asphalt
_EVERY_M: Final = 35.0
_LEAST_LANE_M: Final = 12.0
_BEFORE_END_M: Final = 6.0
_ARROW: Final = np.array(
    [(-1.6, -0.13), (0.3, -0.13), (0.3, -0.45), (1.6, 0.0), (0.3, 0.45), (0.3, 0.13), (-1.6, 0.13)]
)
# Shafts of the turn arrows in lane axes (ahead, left), metres; the head points along the last piece.
_TURN_SHAFTS: Final = {
    "through": ((-1.5, 0.0), (1.5, 0.0)),
    "left": ((-1.5, 0.0), (0.6, 0.0), (0.9, 0.9)),
    "right": ((-1.5, 0.0), (0.6, 0.0), (0.9, -0.9)),
    "slight_left": ((-1.5, 0.0), (0.3, 0.0), (1.2, 0.6)),
    "slight_right": ((-1.5, 0.0), (0.3, 0.0), (1.2, -0.6)),
    "sharp_left": ((-1.5, 0.0), (0.9, 0.0), (0.3, 0.9)),
    "sharp_right": ((-1.5, 0.0), (0.9, 0.0), (0.3, -0.9)),
    "merge_to_left": ((-1.5, 0.0), (0.3, 0.0), (1.2, 0.6)),
    "merge_to_right": ((-1.5, 0.0), (0.3, 0.0), (1.2, -0.6)),
    "reverse": ((-1.2, 0.0), (0.9, 0.0), (0.9, 0.8), (-0.6, 0.8)),
}


class Arrows:
    """The arrows on the lanes of one level, without those in junctions; ``turns`` are the strokes of painted arrows."""

    def __init__(self, sections: Sequence[SeenSection]) -> None:
        travel: list[FloatArray] = []
        turns: list[FloatArray] = []
        for lane in (lane for section in sections if section.road.junction_id is None for lane in section.lanes):
            geometry = lane.geometry
            if not geometry.lane.type.drivable or geometry.length_m <= _LEAST_LANE_M:
                continue
            if geometry.lane.type is not LaneType.BIDIRECTIONAL:
                count = max(1, round(geometry.length_m / _EVERY_M))
                for share in (np.arange(count) + 0.5) / count:
                    travel.append(geometry.pose(geometry.begin_m + float(share) * geometry.length_m).to_world(_ARROW))
            if geometry.lane.turns:
                ends = (geometry.begin_m + _BEFORE_END_M, geometry.end_m - _BEFORE_END_M)
                pose = geometry.pose(ends[geometry.direction > 0])
                for turn in geometry.lane.turns:
                    turns += [pose.to_world(stroke) for stroke in _strokes(turn)]
        self._travel, self.turns = Shapes(travel), Shapes(turns)

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the arrows in the window."""
        canvas.polygons(self._travel.seen(canvas.window), Ink(_FAINT_WHITE), z)
        canvas.lines(self.turns.seen(canvas.window), Ink(stroke=WHITE, width_pt=1.0), z + 0.05)


def _strokes(turn: str) -> list[FloatArray]:
    """Return the shaft and head of a turn arrow, in lane axes; empty for a turn without an arrow."""
    if turn not in _TURN_SHAFTS:
        return []
    shaft = np.array(_TURN_SHAFTS[turn])
    ahead = shaft[-1] - shaft[-2]
    ahead /= np.hypot(*ahead)
    aside = np.array([-ahead[1], ahead[0]])
    back = shaft[-1] - 0.55 * ahead
    return [shaft, np.array([back + 0.4 * aside, shaft[-1], back - 0.4 * aside])]


# --- crosswalks -------------------------------------------------------------------------------------------------
_BAR_M: Final = 0.6  # MUTCD 2009, 3B.18: bars of 12 to 24 in, gaps of 12 to 60 in
_OUTLINE_PT: Final = 0.9


class Crosswalks:
    """The crosswalks of the roads in sight: painted bars, and the outlines of those without paint."""

    def __init__(self, scene: MapScene) -> None:
        seen = {section.road.id for section in scene.sections}
        places = [place for place in crosswalks(scene.network) if place.road_id in seen]
        bars = [bar for place in places if place.crosswalk.marked for bar in _bars(place)]
        self.bars = Shapes(bars)
        self.outlines = Shapes([place.corners_m for place in places if not place.crosswalk.marked])

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the crosswalks in the window."""
        canvas.polygons(self.bars.seen(canvas.window), Ink(WHITE), z)
        canvas.polygons(
            self.outlines.seen(canvas.window), Ink(stroke=WHITE, width_pt=_OUTLINE_PT, dash_pt=(2.7, 1.8)), z
        )


def _bars(place: CrosswalkPlace) -> list[FloatArray]:
    """Return bars from end to end of a crosswalk of four corners; an outline of another shape is filled."""
    corners = place.corners_m
    if len(corners) != 4:
        return [corners]
    right, left = corners[[0, 1]], corners[[3, 2]]  # as our maps have them: each end from its rear to its front
    across_m = float(np.hypot(*(left - right).mean(axis=0)))
    count = max(1, math.floor(across_m / (2 * _BAR_M)))
    shares = (np.arange(count)[:, None] + np.array([0.25, 0.75])) / count
    bars = []
    for begin, end in shares.tolist():
        one, two = right + begin * (left - right), right + end * (left - right)
        bars.append(np.array([one[0], one[1], two[1], two[0]]))
    return bars


# --- paving ----------------------------------------------------------------------------------------------------------
class PavedGap(NamedTuple):
    """A ring, shape (n, 2), m, and the numbers of the lanes that border it."""

    outline_m: FloatArray
    lanes: tuple[int, ...]


def find_paved_gaps(lanes: Sequence[FloatArray], junctions: Iterable[Sequence[int]]) -> Iterator[PavedGap]:
    """Yield the paved places beside the lanes of some junctions.

    ``lanes`` are outlines of lanes on one level, shape (n, 2), m: lanes through junctions, whose numbers are in
    ``junctions``, and lanes of the roads that end there. Inside a junction, which is the convex hull of its lanes, a
    gap is paved where it is narrower than a lane: islands are wider. A separation of carriageways outside is not a gap.

    >>> lane = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 3.5], [0.0, 3.5]])
    >>> list(find_paved_gaps([lane], [[0]]))  # a single lane leaves nothing between
    []
    """
    outlines = np.array([shapely.make_valid(shapely.Polygon(lane)) for lane in lanes], object)
    tree = shapely.STRtree(outlines)
    for numbers in junctions:
        hull = shapely.convex_hull(shapely.geometrycollections(outlines[list(numbers)]))
        around = shapely.buffer(hull, LANE_WIDTH_M)
        paved = shapely.union_all(shapely.intersection(outlines[tree.query(around, "intersects")], around))
        widened = shapely.buffer(paved, LANE_WIDTH_M / 2)
        closed = shapely.buffer(widened, -LANE_WIDTH_M / 2)
        for gap in shapely.get_parts(shapely.difference(shapely.intersection(closed, hull), paved)):
            if isinstance(gap, shapely.Polygon) and gap.area > _LEAST_AREA_M2:
                bordering = tree.query(gap, "dwithin", distance=_TOUCHING_M)
                yield PavedGap(shapely.get_coordinates(gap.exterior), tuple(bordering.tolist()))
