"""A window of the ground as an SVG, and SVGs as pixels; all drawing goes through this module.

Callers give shapes in metres of the local frame with an order (``z``); strokes, symbols and letters have sizes in
points at any scale of the window. Coordinates in the SVG are whole centimetres from the north-western corner, y
downward, and points that change a line by less than two centimetres are left out. The same shapes give the same text.
"""

from __future__ import annotations

import html
import math
import tempfile
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
import shapely

from trace_dag.common.messages.wording import printable
from trace_dag.pages.map_scene import Window

if TYPE_CHECKING:
    from PIL.Image import Image

    from trace_dag.common.geometry import FloatArray

FONT: Final = "Aileron, 'DejaVu Sans', 'Liberation Sans', Arial, sans-serif"
_MEASURED_PX: Final = 100  # size in which letters are measured
_MIDDLE_EM: Final = 0.35  # of letters, above their baseline
_NEEDLESS_M: Final = 0.02
_STAR: Final = [(math.sin(k * math.pi / 5) * r, math.cos(k * math.pi / 5) * r) for k, r in enumerate((1.0, 0.382) * 5)]
_PLUS: Final = [(x / 3, y / 3) for x, y in ((-1, 3), (1, 3), (1, 1), (3, 1), (3, -1), (1, -1), (1, -3), (-1, -3),
                                            (-1, -1), (-3, -1), (-3, 1), (-1, 1))]  # fmt: skip
_OCTAGON: Final = [(math.cos((k + 0.5) * math.pi / 4), math.sin((k + 0.5) * math.pi / 4)) for k in range(8)]
SYMBOLS: Final = {
    "star": _STAR,
    "plus": _PLUS,
    "octagon": _OCTAGON,
    "triangle down": [(-1.0, 1.0), (1.0, 1.0), (0.0, -1.0)],
    "square": [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
}
"""Outlines of symbols within a circle of radius 1, y upward."""


@dataclass(frozen=True)
class Ink:
    """The look of a shape: colours as in CSS, ``width_pt`` of its stroke, ``dash_pt`` of a broken one."""

    fill: str = "none"
    stroke: str = "none"
    width_pt: float = 0.0
    opacity: float = 1.0
    fill_opacity: float = 1.0
    dash_pt: tuple[float, ...] = ()
    round_caps: bool = False


@dataclass
class Canvas:
    """A window (west, south, east, north; m) that is ``width_pt`` points wide.

    Areas in ``taken`` stay clear of names.
    """

    PER_M: ClassVar[float] = 100.0  # units of the SVG

    window: Window
    width_pt: float
    taken: list[shapely.Geometry] = field(default_factory=list)
    _drawn: list[tuple[float, int, str]] = field(default_factory=list)

    @property
    def points_per_m(self) -> float:
        """Return the scale, points to a metre."""
        return self.width_pt / (self.window[2] - self.window[0])

    @property
    def span_m(self) -> float:
        """Return the longer side of the window."""
        west, south, east, north = self.window
        return max(east - west, north - south)

    # --- shapes -------------------------------------------------------------------------------------------------
    def polygons(self, rings_m: Sequence[FloatArray], ink: Ink, z: float) -> None:
        """Draw rings, shape (n, 2): as one path, or separately if they are transparent and would show overlaps."""
        clear = min(ink.opacity, ink.fill_opacity) < 1.0
        for rings in [[ring] for ring in rings_m] if clear else [rings_m]:
            self._path(self._joined(rings, closed=True), ink, z)

    def lines(self, lines_m: Sequence[FloatArray], ink: Ink, z: float) -> None:
        """Draw lines, shape (n, 2)."""
        self._path(self._joined(lines_m), ink, z)

    def discs(self, centres_m: FloatArray | Sequence[tuple[float, float]], radius_m: float, ink: Ink, z: float) -> None:
        """Draw circles of one radius."""
        radius = round(radius_m * self.PER_M, 1)
        arcs = [
            f"M{x - radius:g} {y:g}a{radius:g} {radius:g} 0 1 0 {2 * radius:g} 0"
            f"a{radius:g} {radius:g} 0 1 0 {-2 * radius:g} 0"
            for x, y in np.round(self.places(np.asarray(centres_m, float).reshape(-1, 2)), 1).tolist()
        ]
        self._path("".join(arcs), ink, z)

    def symbol(self, name: str, x_m: float, y_m: float, half_pt: float, ink: Ink, z: float) -> None:
        """Draw one of :data:`SYMBOLS`, of one size at any scale."""
        self._path(self._outline(SYMBOLS[name], x_m, y_m, half_pt), ink, z)

    def cross(self, x_m: float, y_m: float, half_pt: float, ink: Ink, z: float, *, turned: bool = False) -> None:
        """Draw a cross of two strokes, upright or turned by an eighth."""
        ((x, y),) = self.places(np.array([[x_m, y_m]])).tolist()
        half = self._units(half_pt) * (math.sqrt(0.5) if turned else 1.0)
        arms = ((half, half), (half, -half)) if turned else ((half, 0.0), (0.0, half))
        data = "".join(f"M{x - dx:.1f} {y - dy:.1f}l{2 * dx:.1f} {2 * dy:.1f}" for dx, dy in arms)
        self._path(data, ink, z)

    def text(
        self,
        text: str,
        x_m: float,
        y_m: float,
        size_pt: float,
        ink: str,
        z: float,
        *,
        angle_rad: float = 0.0,
        anchor: str = "middle",
    ) -> None:
        """Write a line around a place, its middle at the place's height, turned counter-clockwise."""
        ((x, y),) = self.places(np.array([[x_m, y_m]])).tolist()
        size = self._units(size_pt)
        turned = f' transform="rotate({-math.degrees(angle_rad):.1f} {x:.1f} {y:.1f})"' if angle_rad else ""
        self.element(
            f'<text x="{x:.1f}" y="{y + _MIDDLE_EM * size:.1f}" font-size="{size:g}" fill="{ink}" '
            f'text-anchor="{anchor}"{turned}>{html.escape(printable(text))}</text>',
            z,
        )

    # --- the whole ----------------------------------------------------------------------------------------------
    def elements(self) -> str:
        """Return the drawing, lower things first, without the frame of an SVG."""
        return "".join(element for _, _, element in sorted(self._drawn))

    def svg(self, place: str = "") -> str:
        """Return the SVG; ``place`` has attributes for its position in another one."""
        return self._framed(self.elements(), place)

    def with_panels(self, panels: Iterable[tuple[float, float, float, float, Canvas]]) -> str:
        """Return the SVG with others in it, above its own shapes below ``z`` 1.

        Each panel has left, bottom, width and height (m).
        """
        inner = []
        for left, bottom, width, height, canvas in panels:
            ((x, y),) = self.places(np.array([[left, bottom + height]])).tolist()
            box = f'width="{width * self.PER_M:.0f}" height="{height * self.PER_M:.0f}"'
            inner.append(canvas.svg(f' x="{x:.0f}" y="{y:.0f}" {box}'))
        below = "".join(element for z, _, element in sorted(self._drawn) if z < 1.0)
        above = "".join(element for z, _, element in sorted(self._drawn) if z >= 1.0)
        return self._framed(f"{below}{''.join(inner)}{above}")

    def _framed(self, elements: str, place: str = "") -> str:
        west, south, east, north = self.window
        size = f"{(east - west) * self.PER_M:.0f} {(north - south) * self.PER_M:.0f}"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" preserveAspectRatio="none"{place}>'
            f'<g stroke-linejoin="round" font-family="{FONT}" xml:space="preserve">{elements}</g></svg>'
        )

    # --- how it is written --------------------------------------------------------------------------------------
    def element(self, element: str, z: float) -> None:
        """Add an element of SVG that is written already."""
        self._drawn.append((z, len(self._drawn), element))

    def _path(self, data: str, ink: Ink, z: float) -> None:
        if data:
            self.element(f'<path d="{data}"{self._look(ink)}/>', z)

    def _look(self, ink: Ink) -> str:
        look = f' fill="{ink.fill}"'
        if ink.stroke != "none":
            look += f' stroke="{ink.stroke}" stroke-width="{self._units(ink.width_pt):g}"'
        if ink.dash_pt:
            look += f' stroke-dasharray="{" ".join(f"{self._units(each):g}" for each in ink.dash_pt)}"'
        if ink.round_caps:
            look += ' stroke-linecap="round"'
        if ink.opacity < 1.0:
            # Of a shape that is filled and stroked, it is applied to both together, on a layer that takes long.
            of = "fill-" if ink.stroke == "none" else "stroke-" if ink.fill == "none" else ""
            look += f' {of}opacity="{ink.opacity:g}"'
        return look + (f' fill-opacity="{ink.fill_opacity:g}"' if ink.fill_opacity < 1.0 else "")

    def _units(self, points: float) -> float:
        return round(points / self.points_per_m * self.PER_M, 1)

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return points (m), shape (n, 2), in units of the SVG."""
        return np.asarray((points_m - (self.window[0], self.window[3])) * (self.PER_M, -self.PER_M))

    def _outline(self, outline: Sequence[tuple[float, float]], x_m: float, y_m: float, half_pt: float) -> str:
        points = self.places(np.array([[x_m, y_m]])) + np.array(outline) * (1, -1) * self._units(half_pt)
        return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist()) + "z"

    def _joined(self, lines: Sequence[FloatArray], *, closed: bool = False) -> str:
        """Return lines as one path, clipped to the window.

        Rings have the same orientation, so that overlaps are filled.
        """
        seen = self._clipped([line[:, :2] for line in lines if len(line) > 1], closed=closed)
        if not len(seen):
            return ""
        simple = shapely.simplify(seen, _NEEDLESS_M, preserve_topology=False)
        points, numbers = shapely.get_coordinates(simple, return_index=True)
        places = np.round(self.places(points)).astype(np.int64)
        starts = np.flatnonzero(np.diff(numbers, prepend=-1)).tolist()
        words = []
        for start, end in zip(starts, [*starts, len(places)][1:], strict=True):  # none where all is cut away
            ring = places[start:end]
            if closed and _turns_left(ring.astype(float)):
                ring = ring[::-1]
            x, y = ring[0].tolist()
            moves = np.diff(ring, axis=0).ravel().tolist()
            words.append(f"M{x} {y}l{' '.join(map(str, moves))}{'z' if closed else ''}")
        return "".join(words)

    def _clipped(self, lines: Sequence[FloatArray], *, closed: bool) -> FloatArray:
        """Return lines, or the outlines of areas, as shapely geometries clipped to the window."""
        if not lines:
            return np.array([])
        numbers = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        made = np.asarray(shapely.linestrings(np.concatenate(lines), indices=numbers))
        west, south, east, north = self.window
        bounds = shapely.bounds(made)
        leaves = (bounds < (west, south, west, south)).any(axis=1) | (bounds > (east, north, east, north)).any(axis=1)
        window = shapely.box(*self.window)
        cut: list[shapely.LineString] = []
        for number in np.flatnonzero(leaves).tolist():
            line = lines[number]
            corners = line[:-1] if closed and bool((line[0] == line[-1]).all()) else line
            area = closed and len(corners) > 2
            whole = shapely.make_valid(shapely.Polygon(corners)) if area else made[number]
            for part in shapely.get_parts(shapely.intersection(whole, window)):
                if part.is_empty:  # it lies outside
                    continue
                if isinstance(part, shapely.Polygon):
                    cut += [part.exterior]
                elif isinstance(part, shapely.LineString) and not area:
                    cut += [part]
        return np.array([*made[~leaves], *cut])


def _turns_left(ring: FloatArray) -> bool:
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    return bool((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0)


def length_pt(text: str, size_pt: float) -> float:
    """Return the length of a line of text in the font of pictures; other fonts differ by a tenth."""
    from PIL import ImageFont

    return float(ImageFont.load_default(_MEASURED_PX).getlength(_english(text)) / _MEASURED_PX * size_pt)


# --- as pixels -----------------------------------------------------------------------------------------------------
def pixels_of(svg: str, width_px: int, *, background: str | None = "white") -> Image:
    """Return an SVG as a picture of that width, by resvg; without ``background`` it is transparent.

    Text is in Pillow's own font, so that a picture is the same on every machine. The font has English letters, to which
    others are reduced.

    >>> pixels_of(Canvas((0.0, 0.0, 20.0, 10.0), 72.0).svg(), 40).size
    (40, 20)
    """
    import io

    import resvg_py
    from PIL import Image as Images

    with tempfile.NamedTemporaryFile(suffix=".ttf") as font:  # which resvg reads from files alone
        font.write(_font())
        font.flush()
        png = resvg_py.svg_to_bytes(
            svg_string=_english(svg),
            width=width_px,
            background=background,
            skip_system_fonts=True,
            font_files=[font.name],
            font_family="Aileron",
            sans_serif_family="Aileron",
        )
    return Images.open(io.BytesIO(bytes(png)))


def as_png(picture: Image, colours: int = 128) -> bytes:
    """Return a picture as PNG with a palette, a third of the size, since a map has few colours.

    >>> from PIL import Image as Images
    >>> as_png(Images.new("RGB", (4, 4)))[1:4]
    b'PNG'
    """
    import io

    from PIL.Image import Dither, Quantize

    stream = io.BytesIO()
    few = picture.convert("RGB").quantize(colours, method=Quantize.FASTOCTREE, dither=Dither.NONE)
    few.save(stream, "PNG")
    return stream.getvalue()


def reduce_picture(png: bytes, width_px: int) -> bytes:
    """Return a picture as a smaller one with few colours, for a table."""
    import io

    from PIL import Image as Images

    picture = Images.open(io.BytesIO(png)).convert("RGB")
    picture.thumbnail((width_px, width_px))
    return as_png(picture, 16)


def _english(svg: str) -> str:
    return unicodedata.normalize("NFKD", svg.replace("×", "x").replace("…", "...")).encode("ascii", "ignore").decode()


@cache
def _font() -> bytes:
    """Return pillow's font."""
    from PIL import ImageFont

    font = ImageFont.load_default(12)
    assert isinstance(font, ImageFont.FreeTypeFont)
    assert font.font_bytes is not None
    return bytes(font.font_bytes)
