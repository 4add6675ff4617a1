"""Road networks drawn from above: surfaces by lane type, marks, turn arrows, signals and signs, names, heights.

Draws on given matplotlib axes, in metres of the local frame, below z-order 15, and knows nothing of crashes. Built for
many small pictures: everything of one kind is one collection, and what lies outside the window is not looked at.
"""

from __future__ import annotations

import io
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trace_dag.roads.network import LaneRef, LaneType, Road, RoadMark, RoadNetwork, Signal
from trace_dag.scenario.paving import paved_gaps
from trace_dag.units import mps_to_mph

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trace_dag.geometry import FloatArray

Window = tuple[float, float, float, float]
"""West, south, east and north border, metres."""

_GROUND: Final = "#EFEDE4"
_ASPHALT: Final = "#6B7075"
_SURFACES: Final = {
    LaneType.DRIVING: _ASPHALT,
    LaneType.ENTRY: _ASPHALT,
    LaneType.EXIT: _ASPHALT,
    LaneType.BIDIRECTIONAL: "#7A746B",
    LaneType.SHOULDER: "#8E9296",
    LaneType.PARKING: "#7F8488",
    LaneType.MEDIAN: "#C3CDAF",
    LaneType.SIDEWALK: "#D9D3C7",
    LaneType.BORDER: "#C9C4B8",
}
_MINOR_SURFACE: Final = "#878B8E"  # service roads and driveways
_BRIDGE_EDGE: Final = "#3A3D40"
_WHITE: Final = "#F7F7F2"
_YELLOW: Final = "#F2C230"
_MARK_COLOURS: Final = {"yellow": _YELLOW, "white": _WHITE, "standard": _WHITE}
_DASH_M: Final = 3.05  # MUTCD 2009, section 3A.06: segments of 10 ft, gaps of 30 ft
_PERIOD_M: Final = 12.19
_STEP_M: Final = 2.0
_MARGIN_M: Final = 12.0
_ARROW_EVERY_M: Final = 35.0
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


def draw_network(
    axes: Axes,
    network: RoadNetwork,
    *,
    window_m: Window,
    legal_marks: bool = True,
    names: bool = True,
    heights: bool = False,
) -> None:
    """Draw what lies in the window and set the axes to it.

    ``legal_marks`` shows what the law paints, else what the reconstruction needs is written in the map. ``heights``
    colours the surfaces by height (metres, with a colour bar when they differ by more than half a metre).
    """
    west, south, east, north = window_m
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal")
    axes.set_facecolor(_GROUND)
    scene = _Scene(network, window_m)
    shade = _height_shades(axes, scene) if heights else None
    for level, (layer, lanes) in enumerate(scene.lanes_by_layer()):
        z = 1.0 + min(level, 9)
        _draw_gaps(axes, scene, lanes, z, shade)
        _draw_surfaces(axes, scene, lanes, z, layer, shade)
        _draw_marks(axes, scene, lanes, z + 0.3, legal_marks)
        _draw_arrows(axes, scene, lanes, z + 0.4)
    _draw_signals(axes, scene)
    if names:
        _draw_names(axes, scene)


def draw_side_by_side(networks: Sequence[tuple[str, RoadNetwork]], *, window_m: Window, dpi: int = 90) -> bytes:
    """The same window of several maps of one site beside each other, each under its title; PNG.

    Maps whose frames have other origins are shifted into the first one's.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height = (window_m[3] - window_m[1]) / (window_m[2] - window_m[0])
    figure = Figure(figsize=(6.5 * len(networks), 6.5 * height + 0.5), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    origin = networks[0][1].frame
    for axes, (title, network) in zip(np.ravel(figure.subplots(1, len(networks))), networks, strict=True):
        east, north = origin.to_local(network.frame.latitude_deg, network.frame.longitude_deg)
        west, south = window_m[0] - east, window_m[1] - north
        shifted = (west, south, west + window_m[2] - window_m[0], south + window_m[3] - window_m[1])
        draw_network(axes, network, window_m=shifted)
        axes.set_title(title, fontsize=10)
        axes.tick_params(labelsize=7)
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()


class _Scene:
    """The lanes inside the window, and how finely things show there."""

    def __init__(self, network: RoadNetwork, window: Window) -> None:
        self.network = network
        self.window = window
        self.span_m = max(window[2] - window[0], window[3] - window[1])
        self.spans = {ref: span for ref in network.lanes() if (span := self._visible_span(ref))}
        """The lanes inside the window, and between which ``s`` they are."""
        self.major_junctions = {road.junction_id for road in network.roads if road.highway != "service"} - {None}
        """Those that more than service roads lead through."""

    def _visible_span(self, ref: LaneRef) -> tuple[float, float] | None:
        geometry = self.network.geometry(ref)
        points = geometry.search_line
        west, south, east, north = self.window
        shown = (points[:, 0] > west - _MARGIN_M) & (points[:, 0] < east + _MARGIN_M)
        shown &= (points[:, 1] > south - _MARGIN_M) & (points[:, 1] < north + _MARGIN_M)
        numbers = np.flatnonzero(shown)
        if not len(numbers):
            return None
        step = geometry.length_m / (len(points) - 1)
        return geometry.begin_m + step * float(numbers[0]), geometry.begin_m + step * float(numbers[-1])

    def border(self, ref: LaneRef, *, left: bool) -> FloatArray:
        """A lane's border inside the window, shape (n, 3), in its direction of travel."""
        return self.network.geometry(ref).borders(_STEP_M, self.spans[ref])[0 if left else 1]

    def outline(self, ref: LaneRef) -> FloatArray:
        """A lane's surface inside the window, a ring of shape (n, 2)."""
        return np.concatenate([self.border(ref, left=True)[:, :2], self.border(ref, left=False)[::-1, :2]])

    def road(self, ref: LaneRef) -> Road:
        return self.network.road_by_id[ref.road_id]

    def inside(self, x_m: float, y_m: float, margin_m: float = 0.0) -> bool:
        west, south, east, north = self.window
        return west + margin_m < x_m < east - margin_m and south + margin_m < y_m < north - margin_m

    def lanes_by_layer(self) -> Iterator[tuple[int, list[LaneRef]]]:
        """From the lowest layer to the highest, so that a bridge covers what passes under it."""
        layers: dict[int, list[LaneRef]] = defaultdict(list)
        for ref in self.spans:
            road = self.road(ref)
            layers[road.layer or (1 if road.bridge else -1 if road.tunnel else 0)].append(ref)
        for layer in sorted(layers):
            yield layer, layers[layer]


# --- surfaces ------------------------------------------------------------------------------------------------
class _Shade(NamedTuple):
    """Heights to colours."""

    low_m: float
    high_m: float
    colours: FloatArray  # (256, 4)

    def of(self, height_m: float) -> FloatArray:
        share = (height_m - self.low_m) / max(self.high_m - self.low_m, 1e-9)
        return np.asarray(self.colours[int(255 * min(max(share, 0.0), 1.0))])


def _height_shades(axes: Axes, scene: _Scene) -> _Shade | None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    heights = [scene.border(ref, left=True)[:, 2] for ref in scene.spans]
    if not heights:
        return None
    every = np.concatenate(heights)
    low, high = float(every.min()), float(every.max())
    if high - low < 0.5:
        return None
    colour_map = colormaps["viridis"]
    bar = ScalarMappable(Normalize(low, high), colour_map)
    axes.figure.colorbar(bar, ax=axes, shrink=0.6, label="height of the surface (m)")
    return _Shade(low, high, colour_map(np.linspace(0.0, 1.0, 256)))


def _draw_surfaces(
    axes: Axes, scene: _Scene, lanes: Sequence[LaneRef], z: float, layer: int, shade: _Shade | None
) -> None:
    from matplotlib.collections import PolyCollection

    polygons: list[FloatArray] = []
    colours: list[object] = []
    for ref in sorted(lanes, key=lambda ref: _order(scene, ref)):
        geometry = scene.network.geometry(ref)
        lane_type = geometry.lane.type
        if lane_type is LaneType.NONE:
            continue
        if shade is not None and lane_type.drivable:
            left, right = scene.border(ref, left=True), scene.border(ref, left=False)
            # One quad per step, each with the colour of its own height.
            quads = np.stack([left[:-1, :2], right[:-1, :2], right[1:, :2], left[1:, :2]], axis=1)
            polygons += list(quads)
            colours += [shade.of(height) for height in (left[:-1, 2] + left[1:, 2]) / 2]
            continue
        polygons.append(scene.outline(ref))
        colours.append(_MINOR_SURFACE if _is_minor(scene, ref) else _SURFACES[lane_type])
    if layer > 0:
        # A dark rim shows the deck of a bridge against what lies below.
        axes.add_collection(
            PolyCollection(polygons, facecolors=_BRIDGE_EDGE, edgecolors=_BRIDGE_EDGE, linewidths=2.5, zorder=z),
            autolim=False,
        )
    # Edges in the colour of the face close the hairlines that smoothing leaves between neighbours.
    axes.add_collection(
        PolyCollection(polygons, facecolors=colours, edgecolors="face", linewidths=0.6, zorder=z + 0.1), autolim=False
    )


def _order(scene: _Scene, ref: LaneRef) -> tuple[bool, bool, bool]:
    """What is drawn later covers what is earlier: drivable lanes, greater roads, centre lanes that go on past a
    driveway."""
    lane_type = scene.network.lane(ref).type
    return lane_type.drivable, not _is_minor(scene, ref), lane_type is LaneType.BIDIRECTIONAL


def _draw_gaps(axes: Axes, scene: _Scene, lanes: Sequence[LaneRef], z: float, shade: _Shade | None) -> None:
    """What is paved between the lanes of junctions, below the lanes, so that seams close."""
    from matplotlib.collections import PolyCollection

    paved: list[LaneRef] = []
    through: dict[str, list[int]] = defaultdict(list)
    for ref in lanes:
        lane_type, junction = scene.network.lane(ref).type, scene.road(ref).junction_id
        if lane_type.drivable and junction is not None:
            through[junction].append(len(paved))
        if lane_type is LaneType.BIDIRECTIONAL or (lane_type.drivable and junction is not None):
            paved.append(ref)
    gaps = list(paved_gaps([scene.outline(ref) for ref in paved], through.values()))
    colours: list[object] = []
    for gap in gaps:
        bordering = [paved[number] for number in gap.lanes]
        if shade is not None:
            colours.append(shade.of(float(np.mean([scene.border(ref, left=True)[:, 2].mean() for ref in bordering]))))
        else:
            colours.append(_MINOR_SURFACE if all(_is_minor(scene, ref) for ref in bordering) else _ASPHALT)
    polygons = [gap.outline_m for gap in gaps]
    axes.add_collection(
        PolyCollection(polygons, facecolors=colours, edgecolors="face", linewidths=0.6, zorder=z + 0.05), autolim=False
    )


def _is_minor(scene: _Scene, ref: LaneRef) -> bool:
    road = scene.road(ref)
    if road.highway != "service" or road.junction_id in scene.major_junctions:
        return False
    return scene.network.lane(ref).type is LaneType.DRIVING


# --- marks ---------------------------------------------------------------------------------------------------
def _draw_marks(axes: Axes, scene: _Scene, lanes: Sequence[LaneRef], z: float, legal: bool) -> None:
    from matplotlib.collections import LineCollection

    metres_per_point = scene.span_m / max(axes.bbox.width * 72.0 / axes.figure.dpi, 1.0)
    gap_m = max(0.13, 0.8 * metres_per_point)
    lines: dict[str, list[FloatArray]] = defaultdict(list)
    for line, mark in _mark_lines(scene, lanes, legal):
        colour = _MARK_COLOURS.get(mark.colour, mark.colour)
        strokes = mark.type.split()
        offsets = (0.0,) if len(strokes) == 1 else (gap_m, -gap_m)
        for stroke, offset in zip(strokes, offsets, strict=False):
            shifted = _shifted(line, offset) if offset else line
            if stroke == "broken":
                lines[colour] += _dashes(shifted)
            elif stroke not in ("none", "grass", "curb"):
                lines[colour].append(shifted)
    width = min(max(0.15 / metres_per_point, 0.45), 3.0)
    for colour, segments in lines.items():
        axes.add_collection(LineCollection(segments, colors=colour, linewidths=width, zorder=z), autolim=False)


def _mark_lines(scene: _Scene, lanes: Sequence[LaneRef], legal: bool) -> Iterator[tuple[FloatArray, RoadMark]]:
    """Marks and where they run; junctions have none painted."""
    centres_done: set[tuple[str, int]] = set()
    for ref in lanes:
        road = scene.road(ref)
        if road.junction_id is not None:
            continue
        geometry = scene.network.geometry(ref)
        mark = _shown(geometry.lane.mark, geometry.lane.legal_mark, legal)
        if mark is not None and mark.type != "none":
            yield scene.border(ref, left=False)[:, :2], mark
        section = (ref.road_id, ref.section)
        if section in centres_done:
            continue
        centres_done.add(section)
        centre = next((lane for lane in road.lane_sections[ref.section].lanes if lane.id == 0), None)
        mark = _shown(centre.mark, centre.legal_mark, legal) if centre is not None else None
        if mark is not None and mark.type != "none":
            inner = scene.network.geometry(ref)
            stations = inner.road.line.stations(_STEP_M, *scene.spans[ref])
            line = inner.road.line.sample(stations)
            t = inner.road.lane_offset.sample(stations)
            yield (
                np.column_stack([line[:, 0] - t * np.sin(line[:, 2]), line[:, 1] + t * np.cos(line[:, 2])]),
                mark,
            )


def _shown(mark: RoadMark | None, legal_mark: RoadMark | None, legal: bool) -> RoadMark | None:
    return (legal_mark or mark) if legal else mark


def _shifted(line: FloatArray, offset_m: float) -> FloatArray:
    step = np.gradient(line, axis=0)
    normal = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
    return np.asarray(line + offset_m * normal)


def _dashes(line: FloatArray) -> list[FloatArray]:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    starts = np.arange((_PERIOD_M - _DASH_M) / 2, max(along[-1] - _DASH_M, 0.0), _PERIOD_M)
    at = starts[:, None] + np.array([0.0, _DASH_M / 2, _DASH_M])
    return list(np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=-1))


# --- arrows --------------------------------------------------------------------------------------------------
def _draw_arrows(axes: Axes, scene: _Scene, lanes: Sequence[LaneRef], z: float) -> None:
    """Faint arrows in the direction of travel, and the painted turn arrows where lanes have them."""
    from matplotlib.collections import LineCollection, PolyCollection

    if scene.span_m > 350.0:
        return
    travel: list[FloatArray] = []
    turns: list[FloatArray] = []
    for ref in lanes:
        geometry = scene.network.geometry(ref)
        if not geometry.lane.type.drivable or scene.road(ref).junction_id is not None:
            continue
        if geometry.lane.type is not LaneType.BIDIRECTIONAL and geometry.length_m > 12.0:
            count = max(1, round(geometry.length_m / _ARROW_EVERY_M))
            for share in (np.arange(count) + 0.5) / count:
                pose = geometry.pose(geometry.begin_m + float(share) * geometry.length_m)
                if scene.inside(pose.x_m, pose.y_m):
                    travel.append(pose.to_world(_ARROW))
        if geometry.lane.turns and geometry.length_m > 12.0:
            s_m = geometry.end_m - 6.0 if geometry.direction > 0 else geometry.begin_m + 6.0
            pose = geometry.pose(s_m)
            for turn in geometry.lane.turns:
                if turn in _TURN_SHAFTS and scene.inside(pose.x_m, pose.y_m):
                    turns += [pose.to_world(stroke) for stroke in _turn_strokes(turn)]
    axes.add_collection(PolyCollection(travel, facecolors=_WHITE, alpha=0.28, linewidths=0, zorder=z), autolim=False)
    axes.add_collection(LineCollection(turns, colors=_WHITE, linewidths=1.0, zorder=z + 0.05), autolim=False)


def _turn_strokes(turn: str) -> list[FloatArray]:
    shaft = np.array(_TURN_SHAFTS[turn])
    ahead = shaft[-1] - shaft[-2]
    ahead /= np.hypot(*ahead)
    aside = np.array([-ahead[1], ahead[0]])
    back = shaft[-1] - 0.55 * ahead
    return [shaft, np.array([back + 0.4 * aside, shaft[-1], back - 0.4 * aside])]


# --- signals -------------------------------------------------------------------------------------------------
def _draw_signals(axes: Axes, scene: _Scene) -> None:
    from matplotlib.markers import MarkerStyle
    from matplotlib.transforms import ScaledTranslation

    lights: list[tuple[float, float]] = []
    stops: list[tuple[float, float]] = []
    yields: list[tuple[float, float]] = []
    limits: list[tuple[float, float, str]] = []
    for road in scene.network.roads:
        for signal in road.signals:
            line = scene.network.road_geometry(road.id).line
            x, y, heading, _ = line.at(signal.s_m)
            place = (x - signal.t_m * math.sin(heading), y + signal.t_m * math.cos(heading))
            if not scene.inside(*place):
                continue
            match signal.type:
                case "1000001":
                    lights.append(place)
                case "206":
                    stops.append(place)
                case "205":
                    yields.append(place)
                case "274":
                    limits.append((*place, _limit_text(signal)))
    size = 60.0 if scene.span_m < 150 else 30.0
    for places, marker, face, edge in (
        (stops, MarkerStyle((8, 0, 22)), "#C1272D", _WHITE),
        (yields, MarkerStyle("v"), _WHITE, "#C1272D"),
        (lights, MarkerStyle("s"), "#202327", "#202327"),
    ):
        xy = np.reshape(places, (-1, 2))
        axes.scatter(xy[:, 0], xy[:, 1], s=size, marker=marker, c=face, edgecolors=edge, lw=0.9, zorder=13)
    # The lamps of a signal head, above each other inside its symbol at any scale.
    xy = np.reshape(lights, (-1, 2))
    for up, colour in ((1.0, "#E5443B"), (0.0, "#F2C230"), (-1.0, "#3FB35F")):
        move = ScaledTranslation(0, up * math.sqrt(size) * 0.3 / 72, axes.figure.dpi_scale_trans)
        axes.scatter(xy[:, 0], xy[:, 1], s=size * 0.07, c=colour, lw=0, zorder=13.5, transform=axes.transData + move)
    for x_m, y_m, text in limits:
        axes.text(
            *(x_m, y_m, text),
            fontsize=5.5,
            ha="center",
            va="center",
            zorder=13,
            clip_on=True,
            bbox={"boxstyle": "square,pad=0.25", "fc": "white", "ec": "#202327", "lw": 0.7},
        )


def _limit_text(signal: Signal) -> str:
    if signal.value is None:
        return "?"
    return f"{mps_to_mph(signal.value):.0f}" if signal.unit == "m/s" else f"{signal.value:.0f}"


# --- names ---------------------------------------------------------------------------------------------------
def _draw_names(axes: Axes, scene: _Scene) -> None:
    """Each street's name once, along its longest stretch in the window."""
    longest: dict[str, tuple[float, FloatArray]] = {}
    for road in scene.network.roads:
        if not road.name or road.junction_id is not None:
            continue
        geometry = scene.network.road_geometry(road.id)
        points = geometry.line.sample(geometry.line.stations(4.0))
        west, south, east, north = scene.window
        shown = (points[:, 0] > west) & (points[:, 0] < east) & (points[:, 1] > south) & (points[:, 1] < north)
        length = 4.0 * np.count_nonzero(shown)
        if length > max(longest.get(road.name, (0.0,))[0], 0.12 * scene.span_m):
            longest[road.name] = (length, points[shown])
    for name, (_, points) in longest.items():
        x, y, heading, _ = points[len(points) // 2]
        angle = math.degrees(math.remainder(heading, math.pi))
        axes.text(
            *(float(x), float(y), name),
            rotation=angle,
            rotation_mode="anchor",
            fontsize=6.5,
            ha="center",
            va="center",
            color="#1D2024",
            zorder=12,
            clip_on=True,
            bbox={"boxstyle": "round,pad=0.15", "fc": _GROUND, "ec": "none", "alpha": 0.75},
        )
