"""Road networks drawn from above: surfaces by lane type, marks, crosswalks, turn arrows, signs, names, heights.

Draws in metres of the local frame, everything except names below z-order 15. It draws maps only, no crashes. Geometry
is made once for all windows, and only the part in a window is drawn.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.units import mps_to_mph
from trace_dag.pages.canvas import Canvas, Ink, length_pt
from trace_dag.pages.map_ground import (
    ASPHALT,
    SURFACE_NAMES,
    WHITE,
    YELLOW,
    Arrows,
    Crosswalks,
    Marks,
    Shade,
    Surfaces,
    height_shades,
)
from trace_dag.pages.map_scene import MapScene, Window, inside, window_of
from trace_dag.pages.picture_sheet import Sign, with_legend
from trace_dag.pages.scenery import Scenery, corners_of, draw_fading, draw_night, map_reach_m
from trace_dag.roads.map.lane_geometry import LANE_STEP_M
from trace_dag.roads.map.model import Signal, SignalType
from trace_dag.roads.map.network import RoadNetwork

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.osm.types import OsmFeature

GROUND: Final = "#EFEDE4"
_ARROWS_UP_TO_M: Final = 350.0  # in wider windows arrows are specks
_MARKS_FROM_PT: Final = 0.45  # to a metre: below, the lines of a lane are wider than the lane
_WIDTH_PT, _WIDEST_PT = 460.0, 1540.0  # as pixels, 1,200 and 4,000
_M_PER_PT: Final = 2.5  # in the picture of a whole map, as far as these allow
_HIGHEST_LEVEL: Final = 9
NAMES_Z: Final = 22.0
"""Above the paths that vehicles take, below their bodies."""
_RED: Final = "#C1272D"
_BLACK: Final = "#202327"
_LAMPS: Final = ("#E5443B", "#F2C230", "#3FB35F")
_NEAR_M: Final = 150.0  # windows wider than this have smaller symbols
_NEAR_HALF_PT, _FAR_HALF_PT = 3.9, 2.75  # of a symbol
_LIMIT_SIZE_PT: Final = 5.5
SIGNS: Final[Mapping[str, tuple[str, str, Ink]]] = {
    SignalType.LIGHT: ("traffic light", "square", Ink(_BLACK)),
    SignalType.STOP: ("stop sign", "octagon", Ink(_RED, WHITE, 0.9)),
    SignalType.YIELD: ("yield sign", "triangle down", Ink(WHITE, _RED, 0.9)),
    SignalType.LIMIT: ("speed limit, mph", "square", Ink("white", _BLACK, 0.7)),
}
"""Name, symbol and ink of each kind."""
_MOST_STEPS: Final = 9  # of a quarter of its height, that a sign is moved away from its road


class MapDrawing:
    """A map ready to be drawn in any windows inside an extent (m).

    ``legal_marks`` shows the marks that the law requires, else those in the map for the reconstruction. ``heights``
    colours the surfaces by height where they differ. ``surroundings`` are drawn behind the roads, ``dark`` means night,
    ``fading`` fades the edge of a map that was cut out around its origin.
    """

    def __init__(
        self,
        network: RoadNetwork,
        extent_m: Window,
        *,
        legal_marks: bool = True,
        heights: bool = False,
        surroundings: Sequence[OsmFeature] = (),
        dark: bool = False,
        fading: bool = False,
    ) -> None:
        scene = MapScene(network, extent_m)
        self.shade: Shade | None = height_shades(scene) if heights else None
        self._layers = [
            (layer > 0, Surfaces(scene, sections, self.shade), Marks(sections, legal=legal_marks), Arrows(sections))
            for layer, sections in scene.sections_by_layer()
        ]
        self._crosswalks = Crosswalks(scene)
        self._signs = Signs(scene)
        self._names = Names(scene)
        self._scenery = Scenery(surroundings, network.frame, extent_m)
        self._dark = dark
        self._reach_m = map_reach_m(network) if fading else 0.0

    def draw(self, canvas: Canvas, *, names: bool = True) -> None:
        """Draw the part of the map in a canvas' window."""
        canvas.polygons([corners_of(canvas.window)], Ink(GROUND), 0.0)
        self._scenery.draw(canvas)
        if self._reach_m:
            draw_fading(canvas, self._reach_m, GROUND)
        if self._dark:
            draw_night(canvas)
        for level, (bridge, surfaces, marks, arrows) in enumerate(self._layers):
            z = 1.0 + min(level, _HIGHEST_LEVEL)
            surfaces.draw(canvas, z, bridge=bridge)
            if canvas.points_per_m >= _MARKS_FROM_PT:
                marks.draw(canvas, z + 0.3)
            if canvas.span_m <= _ARROWS_UP_TO_M:
                arrows.draw(canvas, z + 0.4)
        self._crosswalks.draw(canvas, 12.0)
        self._signs.draw(canvas, 13.0)
        if names:
            self._names.draw(canvas, NAMES_Z, GROUND)

    def legend(self, canvas: Canvas) -> list[Sign]:
        """Return the legend of the features of the map that a canvas of this scale shows."""
        colours = {colour for _, surfaces, _, _ in self._layers for colour in surfaces.colours}
        found = [
            Sign(name, Ink(stroke=colour, width_pt=7.0)) for colour, name in SURFACE_NAMES.items() if colour in colours
        ]
        if canvas.points_per_m >= _MARKS_FROM_PT:
            found.append(Sign("line between directions, or left edge", Ink(stroke=YELLOW, width_pt=1.5)))
        if self._crosswalks.bars.points_m or self._crosswalks.outlines.points_m:
            found.append(Sign("crosswalk", Ink(stroke=ASPHALT, width_pt=7.0, dash_pt=(1.5, 1.5))))
        return found + [
            Sign(name, ink, symbol) for kind, (name, symbol, ink) in SIGNS.items() if kind in self._signs.kinds
        ]


def draw_network(
    network: RoadNetwork,
    window_m: Window,
    *,
    width_pt: float = _WIDTH_PT,
    legal_marks: bool = True,
    names: bool = True,
    heights: bool = False,
) -> str:
    """Return one window of a map as an SVG; options as of :class:`MapDrawing`.

    >>> draw_network(network, (-30.0, -20.0, 30.0, 20.0))[:4]
    '<svg'
    """
    canvas = Canvas(window_m, width_pt)
    MapDrawing(network, window_m, legal_marks=legal_marks, heights=heights).draw(canvas, names=names)
    return canvas.svg()


def draw_whole(network: RoadNetwork) -> str:
    """Return a whole map as an SVG, with a scale and a legend below; large maps are wider.

    >>> "traffic light</text>" in draw_whole(network)
    True
    """
    window_m = window_of(network)
    canvas = Canvas(window_m, whole_width_pt(network))
    drawing = MapDrawing(network, window_m)
    drawing.draw(canvas)
    return with_legend(canvas, drawing.legend(canvas))


def whole_width_pt(network: RoadNetwork) -> float:
    """Return the width of :func:`draw_whole` in points.

    >>> whole_width_pt(network)
    460.0
    """
    west, _, east, _ = window_of(network)
    return min(max(_WIDTH_PT, (east - west) / _M_PER_PT), _WIDEST_PT)


# --- signs -----------------------------------------------------------------------------------------------------------
class Signs:
    """The signals and signs in a scene, by kind; speed limits by their value."""

    def __init__(self, scene: MapScene) -> None:
        self._surfaces = scene.surfaces
        kinds: dict[tuple[str, str], list[tuple[float, float, float]]] = defaultdict(list)
        for each in place_signs(scene):
            kinds[each.signal.type, each.text].append((*each.xy_m, each.outward_rad))
        self._kinds = {kind: np.array(places) for kind, places in sorted(kinds.items())}

    @property
    def kinds(self) -> set[str]:
        """Return the types of the signals and signs."""
        return {kind for kind, _ in self._kinds}

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the signs in the window, moved away from the road if they would cover it; limits only beside it."""
        half_pt = _NEAR_HALF_PT if canvas.span_m < _NEAR_M else _FAR_HALF_PT
        for (kind, text), places in self._kinds.items():
            _, symbol, ink = SIGNS[kind]
            size_pt = (
                (length_pt(text, _LIMIT_SIZE_PT) / 2 + 1.4, 0.75 * _LIMIT_SIZE_PT)
                if kind == SignalType.LIMIT
                else half_pt
            )
            half_m = np.broadcast_to(size_pt, 2) / canvas.points_per_m
            for x, y, outward in places[inside(places, canvas.window)].tolist():
                place = self._beside(np.array([x, y]), outward, half_m)
                if kind == SignalType.LIMIT and (
                    place is None or any(map(_box(place, half_m).intersects, canvas.taken))
                ):
                    continue
                if place is not None:
                    x, y = place.tolist()
                canvas.taken.append(_box(np.array([x, y]), half_m))
                if kind == SignalType.LIMIT:
                    canvas.polygons([shapely.get_coordinates(canvas.taken[-1])], ink, z)
                    canvas.text(text, x, y, _LIMIT_SIZE_PT, _BLACK, z + 0.1)
                    continue
                canvas.symbol(symbol, x, y, half_pt, ink, z)
                if kind == SignalType.LIGHT:
                    # The lamps of a signal head, above each other inside its symbol.
                    for up, colour in zip((0.6, 0.0, -0.6), _LAMPS, strict=True):
                        canvas.discs([(x, y + up * half_m[1])], 0.27 * half_m[1], Ink(colour), z + 0.1)

    def _beside(self, xy_m: FloatArray, outward_rad: float, half_m: FloatArray) -> FloatArray | None:
        """Return the first position outward from the road where a sign covers no lane; None if none is near."""
        step = np.array([math.cos(outward_rad), math.sin(outward_rad)]) * half_m.min() / 2
        places = (xy_m + steps * step for steps in range(_MOST_STEPS))
        return next((each for each in places if not len(self._surfaces.query(_box(each, half_m), "intersects"))), None)


def _box(middle_m: FloatArray, half_m: FloatArray) -> shapely.Polygon:
    return shapely.box(*(middle_m - half_m), *(middle_m + half_m))


class PlacedSign(NamedTuple):
    """A signal or sign: its place (m), the directions of its traffic and away from its road (rad), and its text."""

    signal: Signal
    xy_m: tuple[float, float]
    heading_rad: float
    outward_rad: float
    text: str


def place_signs(scene: MapScene) -> Iterator[PlacedSign]:
    """Yield the traffic lights, and the signs of the kinds that are drawn."""
    for road in {section.road.id: section.road for section in scene.sections}.values():
        line = scene.network.road_geometry(road.id).line
        for signal in road.signals:
            if signal.type in SIGNS:
                x, y, heading, _ = line.at(signal.s_m)
                place = (x - signal.t_m * math.sin(heading), y + signal.t_m * math.cos(heading))
                text = _limit_text(signal) if signal.type == SignalType.LIMIT else ""
                towards = heading + (math.pi if signal.orientation == "-" else 0.0)
                yield PlacedSign(signal, place, towards, heading + math.copysign(math.pi / 2, signal.t_m), text)


def _limit_text(signal: Signal) -> str:
    if signal.value is None:
        return "?"
    return f"{mps_to_mph(signal.value):.0f}" if signal.unit == "m/s" else f"{signal.value:.0f}"


# --- names of streets -------------------------------------------------------------------------------------------
_SIZE_PT: Final = 6.5
_INK: Final = "#1D2024"
_LEAST_SHARE: Final = 0.7  # of a name's length: a shorter stretch of street is not named
_PLACES: Final = (0.5, 0.35, 0.65, 0.2, 0.8)  # along a stretch of street, the first one with room for the name


class Names:
    """The named streets of a scene and where they run: x, y, heading, and how far they reach left and right (m)."""

    def __init__(self, scene: MapScene) -> None:
        roads: dict[str, list[FloatArray]] = defaultdict(list)
        names: dict[str, str] = {}
        for section in scene.sections:
            if section.road.name and section.road.junction_id is None:
                line = section.line_m[:, :2]
                sides = [[lane for lane in section.lanes if lane.geometry.lane.id * sign > 0] for sign in (1, -1)]
                reach_m = [
                    np.max([0.0 * line[:, 0], *(np.hypot(*(lane.outer_m[:, :2] - line).T) for lane in lanes)], axis=0)
                    for lanes in sides
                ]
                roads[section.road.id].append(np.column_stack([section.line_m[:, :3], *reach_m]))
                names[section.road.id] = section.road.name
        self._lines = [(names[road], np.concatenate(lines)) for road, lines in roads.items()]
        self._surfaces = scene.surfaces

    def draw(self, canvas: Canvas, z: float, backing: str) -> None:
        """Write the names of streets in the window beside them, on a background that keeps the letters readable.

        No name covers a lane; one without room beside its street is left out.
        """
        height_m = _SIZE_PT / canvas.points_per_m
        whole = shapely.box(*canvas.window).buffer(-height_m)
        ground = Ink(stroke=backing, width_pt=1.5 * _SIZE_PT, opacity=0.75, round_caps=True)
        for name, half_m, places in self._places(canvas):
            for (x, y, heading, *reach_m), side in product(places.tolist(), (0, 1)):
                aside_m = (1 - 2 * side) * (reach_m[side] + height_m)
                x, y = x - aside_m * math.sin(heading), y + aside_m * math.cos(heading)
                angle = math.remainder(heading, math.pi)  # within a quarter turn, so that it is read from below
                east_m, north_m = half_m * math.cos(angle), half_m * math.sin(angle)
                room = shapely.LineString([(x - east_m, y - north_m), (x + east_m, y + north_m)])
                if (
                    whole.contains(room)
                    and not len(self._surfaces.query(room, "dwithin", 0.8 * height_m))
                    and not shapely.dwithin(room, np.array(canvas.taken, object), 1.6 * height_m).any()
                ):
                    canvas.taken.append(room)
                    canvas.lines([shapely.get_coordinates(room)], ground, z)
                    canvas.text(name, x, y, _SIZE_PT, _INK, z + 0.1, angle_rad=angle)
                    break

    def _places(self, canvas: Canvas) -> list[tuple[str, float, FloatArray]]:
        """Return each name, half its length (m), and places on its longest stretch, shape (n, 5), longest first."""
        window = canvas.window
        longest: dict[str, FloatArray] = {}
        for name, line in self._lines:
            shown = line[inside(line, window)]
            if len(shown) > len(longest.get(name, ())):
                longest[name] = shown
        centre = np.array([window[0] + window[2], window[1] + window[3]]) / 2
        places = []
        for name, line in sorted(longest.items(), key=lambda each: -len(each[1])):
            half_m = length_pt(name, _SIZE_PT) / canvas.points_per_m / 2
            # The crash is in the middle: the name stands on the longer side of it.
            nearest = int(np.hypot(*(line[:, :2] - centre).T).argmin())
            side = line[: nearest + 1] if nearest > len(line) / 2 else line[nearest:]
            if len(line) * LANE_STEP_M > _LEAST_SHARE * 2 * half_m:
                places.append((name, half_m, side[[int(share * len(side)) for share in _PLACES]]))
        return places
