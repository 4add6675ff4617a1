"""Where a window of the ground is drawn: a part of a figure, or axes.

A part of a figure has no axes: matplotlib takes longer to make two of them, with ticks and titles that no picture here
shows, than to draw the map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from trace_dag.scenario.map_scene import Window

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import BboxBase, Transform


@dataclass(frozen=True, eq=False)
class Panel:
    """Draws a window (m, local frame) into ``box`` (pixels) of a figure."""

    holder: Figure | Axes
    figure: Figure
    window: Window
    to_pixels: Transform
    box: BboxBase
    points_per_m: float

    @classmethod
    def on_figure(cls, figure: Figure, window: Window, place: tuple[float, float, float, float]) -> Self:
        """A part of a figure: left, bottom, width and height as shares of it, in the window's proportions."""
        from matplotlib.transforms import Bbox, BboxTransform, TransformedBbox

        west, south, east, north = window
        box = TransformedBbox(Bbox.from_bounds(*place), figure.transFigure)
        to_pixels = BboxTransform(Bbox.from_extents(west, south, east, north), box)
        points_per_m = 72.0 * figure.get_figwidth() * place[2] / (east - west)
        return cls(figure, figure, window, to_pixels, box, points_per_m)

    @classmethod
    def on_axes(cls, axes: Axes, window: Window) -> Self:
        """The whole of some axes, which are set to the window."""
        west, south, east, north = window
        axes.set_xlim(west, east)
        axes.set_ylim(south, north)
        axes.set_aspect("equal")
        figure = axes.get_figure(root=True)
        assert figure is not None
        width_pt = max(axes.bbox.width * 72.0 / figure.dpi, 1.0)
        return cls(axes, figure, window, axes.transData, axes.bbox, width_pt / max(east - west, north - south))

    @property
    def span_m(self) -> float:
        """The longer side of the window."""
        west, south, east, north = self.window
        return max(east - west, north - south)

    def add(self, artist: Artist) -> None:
        """Draw something given in metres, unless it has a transform of its own, as far as it lies in the window."""
        if not artist.is_transform_set():
            artist.set_transform(self.to_pixels)
        self.holder.add_artist(artist)
        artist.set_clip_box(self.box)
