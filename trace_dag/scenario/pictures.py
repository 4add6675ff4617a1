"""The picture of a crash: the road with its lanes, the paths, the bodies at contact and at rest, the reported point.

Two views of the same thing side by side: the approach (everything from the start of the reconstruction on) and the
impact (close up), north up, each with a scale bar. What is not known yet is left out, so a picture can be drawn after
any stage from ``road_map`` on.
"""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.crash.parties import is_vehicle
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import Window
from trace_dag.scenario.maps import MapDrawing
from trace_dag.scenario.picture_legend import INK, Words, draw_legend, headline, write
from trace_dag.scenario.picture_motion import DrawnMotion, draw_reported_point
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import Hypothesis, StateEstimate
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from PIL.Image import Image

_IMPACT_HALF_WINDOW_M: Final = 16.0
_STRIKE_HALF_WINDOW_M: Final = 8.0  # of a person, who is smaller
_FARTHEST_IMPACTS_M: Final = 40.0
_APPROACH_MARGIN_M: Final = 20.0
_LEAST_APPROACH_HALF_WINDOW_M: Final = 45.0

_WIDTH_IN, _HEIGHT_IN, _PANEL_IN, _EDGE_IN = 13.0, 7.2, 6.36, 0.02
_LEGEND_IN: Final = 0.36
_THUMBNAIL_REDUCTION: Final = 2


def draw_crash(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate | None = None,
    log: SimulationLog | None = None,
    verdict: Verdict | None = None,
    *,
    dpi: int = 90,
) -> Image:
    """The picture, 13 by 7.2 inches. ``log`` is of the hypothesis that ``verdict`` names (else of the estimate's
    best)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    hypothesis = _shown_hypothesis(estimate, verdict)
    figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN), dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    approach = _approach_window(hypothesis, log)
    impact = _impact_window(hypothesis, log)
    drawing, motion = MapDrawing(network, _around(approach, impact)), DrawnMotion(hypothesis, log)
    words = headline(record, verdict)
    right_in = _WIDTH_IN - _PANEL_IN - _EDGE_IN
    for left_in, title, window in ((_EDGE_IN, "Approach", approach), (right_in, "Impact", impact)):
        panel = Panel.on_figure(figure, window, _place(left_in))
        drawing.draw(panel)
        motion.draw(panel)
        draw_reported_point(panel, report)
        words.append(_draw_scale(panel, left_in, title))
    top_in = _HEIGHT_IN - _LEGEND_IN
    words += draw_legend(figure, top_in, (_EDGE_IN, right_in), record, report, hypothesis, log)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    picture = Image.fromarray(pixels).convert("RGB")
    write(picture, words, dpi)
    return picture


def as_png(picture: Image) -> bytes:
    """A picture as a file, packed quickly rather than as small as can be."""
    stream = io.BytesIO()
    picture.save(stream, "PNG", compress_level=1)
    return stream.getvalue()


def as_thumbnail(picture: Image) -> bytes:
    """A picture reduced to what an event log can hold by the thousand; WebP."""
    stream = io.BytesIO()
    picture.reduce(_THUMBNAIL_REDUCTION).save(stream, "WEBP", quality=60, method=2)
    return stream.getvalue()


# --- what is shown ---------------------------------------------------------------------------------------------
def _shown_hypothesis(estimate: StateEstimate | None, verdict: Verdict | None) -> Hypothesis | None:
    if estimate is None:
        return None
    return estimate.hypotheses[verdict.hypothesis] if verdict else estimate.best


def _approach_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """A square that holds the reported point, all starts and all places of rest."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    if hypothesis:
        points += [(p.initial_pose.x_m, p.initial_pose.y_m) for p in hypothesis.participants]
    if log:
        for vehicle in log.vehicles:
            points += [(float(vehicle.x_m[i]), float(vehicle.y_m[i])) for i in (0, -1)]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    half_m = float(np.max(high - low)) / 2 + _APPROACH_MARGIN_M
    x, y = ((low + high) / 2).tolist()
    return _square((x, y), max(half_m, _LEAST_APPROACH_HALF_WINDOW_M))


def _impact_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """A square around the first contact; around all that are planned where several vehicles meet, as far as those are
    near."""
    contact = log.first_contact if log else None
    if log is None or contact is None:
        return _square(hypothesis.impact_point_xy_m if hypothesis else (0.0, 0.0), _IMPACT_HALF_WINDOW_M)
    if log.is_person(contact.number_2):
        return _square((contact.x_m, contact.y_m), _STRIKE_HALF_WINDOW_M)
    events = hypothesis.planned if hypothesis and all(is_vehicle(e.party_2) for e in hypothesis.planned) else ()
    points = np.array([(contact.x_m, contact.y_m), *(event.xy_m for event in events[1:])])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = ((low + high) / 2).tolist()
    half_m = float(np.max(high - low)) / 2 + _IMPACT_HALF_WINDOW_M / 2
    if half_m > _FARTHEST_IMPACTS_M:
        return _square((contact.x_m, contact.y_m), _IMPACT_HALF_WINDOW_M)
    return _square((x, y), max(half_m, _IMPACT_HALF_WINDOW_M))


def _square(centre: tuple[float, float], half_m: float) -> Window:
    x, y = centre
    return x - half_m, y - half_m, x + half_m, y + half_m


def _around(one: Window, other: Window) -> Window:
    west, south = (min(one[i], other[i]) for i in (0, 1))
    east, north = (max(one[i], other[i]) for i in (2, 3))
    return west, south, east, north


# --- the sheet -------------------------------------------------------------------------------------------------
def _place(left_in: float) -> tuple[float, float, float, float]:
    """Left, bottom, width and height of a panel as shares of the figure."""
    return left_in / _WIDTH_IN, _LEGEND_IN / _HEIGHT_IN, _PANEL_IN / _WIDTH_IN, _PANEL_IN / _HEIGHT_IN


def _draw_scale(panel: Panel, left_in: float, title: str) -> Words:
    """A frame, a bar of a round number of metres, where north is, and what is written beside them."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Rectangle

    west, south, east, north = panel.window
    unit = (east - west) / 100
    bar_m = _round_length(17 * unit)
    x, y = west + 2 * unit, south + 1.7 * unit
    shapes = (
        np.array([(-1.1, -1), (21.5, -1), (21.5, 4.1), (-1.1, 4.1)]) * unit,
        np.array([(0, 0), (bar_m, 0), (bar_m, 0.5 * unit), (0, 0.5 * unit)]),
        np.array([(18.4, 0), (19.4, 0.7), (20.4, 0), (19.4, 3.2)]) * unit,
    )
    drawn = PolyCollection(
        [shape + np.array([x, y]) for shape in shapes], facecolors=[("white", 0.85), INK, INK], lw=0, zorder=49
    )
    panel.add(drawn)
    panel.add(Rectangle((west, south), east - west, north - south, fill=False, edgecolor=INK, lw=1.6, zorder=48))
    up_in = _LEGEND_IN + 0.042 * _PANEL_IN
    return Words(left_in + 0.02 * _PANEL_IN, _HEIGHT_IN - up_in, f"{title}   {bar_m:g} m")


def _round_length(length_m: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is no longer."""
    power = 10.0 ** math.floor(math.log10(length_m))
    return power * max(step for step in (1, 2, 5) if step * power <= length_m)
