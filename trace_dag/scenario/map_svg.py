"""A drawn map as SVG for pages, several times quicker and smaller than matplotlib's own writer makes it.

It knows the few kinds of shapes that a map is made of (:mod:`trace_dag.scenario.maps`), and nothing else that could be
drawn. Coordinates are whole centimetres from the north-western corner, y downward. What has one look is one path, and
points that a line can do without by less than two centimetres are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import Window

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.path import Path

    from trace_dag.geometry import FloatArray

_PER_M: Final = 100.0  # units
_NEEDLESS_M: Final = 0.02
_COMMANDS: Final = {1: "M", 2: "L", 3: "Q", 4: "C"}  # by matplotlib's codes of the points of a path


@dataclass(frozen=True, eq=False)
class SvgPanel(Panel):
    """A window of a map that becomes an SVG: keeps what is added to it until it is written."""

    shapes: list[Artist] = field(default_factory=list)

    @classmethod
    def of(cls, window: Window, width_pt: float) -> SvgPanel:
        """A window (m) as wide as so many points, which strokes and symbols are measured in."""
        from matplotlib.figure import Figure

        west, south, east, north = window
        figure = Figure(figsize=(width_pt / 72.0, width_pt / 72.0 * (north - south) / (east - west)))
        return cls(**vars(Panel.on_figure(figure, window, (0.0, 0.0, 1.0, 1.0))))

    def add(self, artist: Artist) -> None:
        """Keep a shape."""
        self.shapes.append(artist)

    def written(self) -> str:
        """The SVG. The same shapes give the same text."""
        west, south, east, north = self.window
        size = f"{(east - west) * _PER_M:.0f} {(north - south) * _PER_M:.0f}"
        shapes = sorted(self.shapes, key=lambda shape: shape.get_zorder())
        return "".join(
            [
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" preserveAspectRatio="none">',
                '<g stroke-linejoin="round">',
                *(element for shape in shapes for element in self._elements(shape)),
                "</g></svg>",
            ]
        )

    def _elements(self, shape: Any) -> Iterator[str]:  # Any: the types of matplotlib leave open what these hold
        from matplotlib.collections import EllipseCollection, LineCollection, PathCollection, PolyCollection
        from matplotlib.patches import Rectangle

        if isinstance(shape, Rectangle):
            (x, y), width, height = shape.get_xy(), shape.get_width(), shape.get_height()
            corners = np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])
            colour: Any = shape.get_facecolor()
            yield _path(self._joined([corners], closed=True), _fill(colour))
        elif isinstance(shape, PolyCollection):
            yield from self._polygons(shape)
        elif isinstance(shape, LineCollection):
            yield self._lines(shape)
        elif isinstance(shape, EllipseCollection):
            yield self._discs(shape)
        elif isinstance(shape, PathCollection):
            yield from self._stamps(shape)
        else:
            raise TypeError(f"a map has no {type(shape).__name__}")

    def _polygons(self, shape: Any) -> Iterator[str]:
        """Neighbours of one look in one path, unless they can be seen through: such show where they overlap."""
        rings = [path.vertices for path in shape.get_paths()]
        looks = self._looks(shape, len(rings))
        clear = any(colour[3] < 1.0 for colour in shape.get_facecolor())
        first = 0
        for number in range(1, len(rings) + 1):
            if number == len(rings) or clear or looks[number] != looks[first]:
                yield _path(self._joined(rings[first:number], closed=True), looks[first])
                first = number

    def _looks(self, shape: Any, count: int) -> list[str]:
        """Fill and edge of each of ``count`` members, which take turns with the colours there are."""
        width = float(np.ravel(shape.get_linewidth())[0])
        fills = [_fill(colour) for colour in shape.get_facecolor()] or [' fill="none"']
        lines = [_stroke(colour) + self._width(width) for colour in shape.get_edgecolor() if width] or [""]
        _, pattern = shape.get_linestyle()[0]
        dashes = f' stroke-dasharray="{" ".join(str(self._units(each)) for each in pattern)}"' if pattern else ""
        return [fills[k % len(fills)] + lines[k % len(lines)] + dashes for k in range(count)]

    def _lines(self, shape: Any) -> str:
        lines = [path.vertices for path in shape.get_paths()]
        cap = f' stroke-linecap="{shape.get_capstyle()}"' if shape.get_capstyle() else ""
        width = float(np.ravel(shape.get_linewidth())[0])
        look = f' fill="none"{_stroke(shape.get_edgecolor()[0])}{self._width(width)}{cap}'
        return _path(self._joined(lines), look)

    def _discs(self, shape: Any) -> str:
        radius = self._units(float(shape.get_widths()[0]) / 2)
        arcs = [
            f"M{x - radius:g} {y:g}a{radius} {radius} 0 1 0 {2 * radius} 0a{radius} {radius} 0 1 0 {-2 * radius} 0"
            for x, y in np.round(self._places(np.asarray(shape.get_offsets()))).tolist()
        ]
        return _path("".join(arcs), _fill(shape.get_facecolor()[0]))

    def _stamps(self, shape: Any) -> Iterator[str]:
        """Paths in points, each at its offset."""
        paths, places = shape.get_paths(), self._places(np.asarray(shape.get_offsets()))
        count = max(len(paths), len(places))
        looks = self._looks(shape, count)
        for k in range(count):
            yield _path(self._outline(paths[k % len(paths)], places[k % len(places)]), looks[k])

    def _outline(self, path: Path, place: FloatArray) -> str:
        scale = _PER_M / self.points_per_m
        points = np.round(place + np.asarray(path.vertices, float) * (scale, -scale), 1).tolist()
        codes = [1] + [2] * (len(points) - 1) if path.codes is None else np.asarray(path.codes).tolist()
        words, last = [], 0
        for (x, y), code in zip(points, codes, strict=True):
            if code == 79:
                words.append("z")
            else:
                words.append(f"{_COMMANDS[code] if code != last or code == 1 else ' '}{x:g} {y:g}")
            last = code
        return "".join(words)

    def _joined(self, lines: Sequence[FloatArray], *, closed: bool = False) -> str:
        """Lines as one path; rings all one way round, so that where they lie on each other is filled."""
        lines = [line for line in lines if len(line) > 1]
        if not lines:
            return ""
        numbers = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        made = shapely.linestrings(np.concatenate(lines)[:, :2], indices=numbers)
        points, numbers = shapely.get_coordinates(
            shapely.simplify(made, _NEEDLESS_M, preserve_topology=False), return_index=True
        )
        places = np.round(self._places(points)).astype(np.int64)
        starts = np.flatnonzero(np.diff(numbers, prepend=-1))
        steps = np.diff(places, axis=0, prepend=places[:1])
        ends = [*starts[1:].tolist(), len(places)]
        words = []
        for start, end in zip(starts.tolist(), ends, strict=True):
            ring, moves = places[start:end], steps[start + 1 : end]
            if closed and _turns_left(ring.astype(float)):
                ring, moves = ring[::-1], -moves[::-1]
            x, y = ring[0].tolist()
            words.append(f"M{x} {y}l{' '.join(map(str, moves.ravel().tolist()))}{'z' if closed else ''}")
        return "".join(words)

    def _places(self, points_m: FloatArray) -> FloatArray:
        """Points (m) in units of the drawing."""
        return np.asarray((points_m - (self.window[0], self.window[3])) * (_PER_M, -_PER_M))

    def _units(self, points: float) -> float:
        return round(points / self.points_per_m * _PER_M, 1)

    def _width(self, points: float) -> str:
        return f' stroke-width="{self._units(points):g}"'


def _turns_left(ring: FloatArray) -> bool:
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    return bool((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0)


def _fill(colour: Sequence[float]) -> str:
    return _coloured("fill", colour)


def _stroke(colour: Sequence[float]) -> str:
    return _coloured("stroke", colour)


def _coloured(what: str, colour: Sequence[float]) -> str:
    red, green, blue, opacity = colour
    if opacity == 0.0:
        return f' {what}="none"'
    seen = "" if opacity == 1.0 else f' {what}-opacity="{opacity:.2f}"'
    return f' {what}="#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"{seen}'


def _path(data: str, look: str) -> str:
    return f'<path d="{data}"{look}/>'
