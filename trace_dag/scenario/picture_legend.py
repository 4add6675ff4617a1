"""What is written on the picture of a crash: headline, who is who, what the signs mean.

Letters are set on the finished picture by Pillow: matplotlib takes ten times as long for each line.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.report import MapReport
from trace_dag.scenario.colours import CONTACT_COLOUR, OBJECT_COLOUR, REPORTED_COLOUR, vehicle_colour
from trace_dag.scenario.map_surfaces import MINOR_SURFACE
from trace_dag.scenario.object_shapes import is_ours, names
from trace_dag.sim.types import SimulationLog, overturned_at
from trace_dag.states.types import Hypothesis
from trace_dag.units import mps_to_mph
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image
    from PIL.ImageFont import FreeTypeFont

INK: Final = "#1D2024"
_SIZE_PT: Final = 7.5
_HEADLINE_PT: Final = 10.5
_HEADLINE_IN: Final = (0.13, 0.32)
"""How far below the top its two lines have their middle."""
_STROKE_IN, _TEXT_IN = 0.2, 0.28
_PATH_COLOUR: Final = "#555555"


class _Column(NamedTuple):
    """How entries of the legend are set: how many rows, from where down and how far apart, and how wide (inches)."""

    rows: int
    first_row_in: float
    row_in: float
    width_in: float


_VEHICLES: Final = _Column(2, 0.11, 0.15, 3.2)
_MANY_VEHICLES: Final = _Column(3, 0.065, 0.115, 3.2)
_CROWD: Final = _Column(3, 0.065, 0.115, 1.6)
_SIGNS: Final = _Column(2, 0.11, 0.15, 2.3)
_MANY_SIGNS: Final = _Column(3, 0.065, 0.115, 2.3)


class Words(NamedTuple):
    """A line of text: its left end and the middle of its height in inches from the picture's top left."""

    x_in: float
    y_in: float
    text: str
    size_pt: float = _SIZE_PT


def write(picture: Image, words: Sequence[Words], dpi: int) -> None:
    """Set lines of text on a picture of so many pixels per inch."""
    from PIL import ImageDraw

    draw = ImageDraw.Draw(picture)
    for each in words:
        place = each.x_in * dpi, each.y_in * dpi
        draw.text(place, each.text, fill=INK, font=_font(each.size_pt * dpi / 72), anchor="lm")


@lru_cache(maxsize=8)
def _font(size_px: float) -> FreeTypeFont:
    """The font that the rest of the picture has."""
    from matplotlib.font_manager import findfont
    from PIL import ImageFont

    return ImageFont.truetype(findfont("DejaVu Sans"), size_px)


def headline(record: CrashRecord, verdict: Verdict | None) -> list[Words]:
    """Which crash it is, of what kind and where, and what it was judged to be."""
    roads = " / ".join(filter(None, (record.trafficway_1, record.trafficway_2)))
    place = ", ".join(filter(None, (roads, record.state_name)))
    classes = ", ".join(
        value.replace("_", " ") for value in (record.collision_type, record.road_topology, record.vehicle_trajectory)
    )
    lines = [f"{record.key}   {place}   ({classes})"]
    if verdict:
        outcome = "verified" if verdict.accepted else f"not verified: {verdict.reason}"
        lines.append(f"{outcome}   {verdict.detail}")
    return [Words(0.08, y_in, line, _HEADLINE_PT) for y_in, line in zip(_HEADLINE_IN, lines, strict=False)]


def draw_legend(
    figure: Figure,
    top_in: float,
    columns_in: tuple[float, float],
    record: CrashRecord,
    report: MapReport,
    hypothesis: Hypothesis | None,
    log: SimulationLog | None,
) -> list[Words]:
    """Draw the signs below the panels and give what is written beside them: vehicles in the first column, what the
    signs mean in the second."""
    words = []
    width_in, height_in = figure.get_size_inches()
    vehicles = _vehicles(record, hypothesis)
    set_as = next(
        each for each in (_VEHICLES, _MANY_VEHICLES, _CROWD) if len(vehicles) <= 2 * each.rows or each is _CROWD
    )
    meanings = _signs(report, hypothesis, log)
    entries = (
        (columns_in[0], set_as, vehicles),
        (columns_in[1], _SIGNS if len(meanings) <= 2 * _SIGNS.rows else _MANY_SIGNS, meanings),
    )
    for left_in, column, signs in entries:
        for number, (style, label) in enumerate(signs):
            x_in = left_in + 0.06 + number // column.rows * column.width_in
            y_in = top_in + column.first_row_in + column.row_in * (number % column.rows)
            figure.add_artist(_sign(x_in / width_in, 1 - y_in / height_in, _STROKE_IN / width_in, style))
            words.append(Words(x_in + _TEXT_IN, y_in, label))
    return words


def _sign(x: float, y: float, length: float, style: dict[str, Any]) -> Any:
    """A stroke or a symbol in its middle, in shares of the figure."""
    from matplotlib.lines import Line2D

    xs = [x + length / 2] if "marker" in style else [x, x + length]
    return Line2D(xs, [y] * len(xs), **style)


def _vehicles(record: CrashRecord, hypothesis: Hypothesis | None) -> list[tuple[dict[str, Any], str]]:
    """How each vehicle is drawn, and what it is, does and how fast."""
    reported = {vehicle.number: vehicle.travel_speed_mps for vehicle in record.vehicles}
    parked = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    planned = sorted(hypothesis.participants, key=lambda each: each.vehicle_number) if hypothesis else ()
    entries = []
    for index, each in enumerate(planned):
        source = "inferred" if reported.get(each.vehicle_number) is None else "as reported"
        speed = f"{mps_to_mph(each.initial_speed_mps):.0f} mph {source}"
        what = each.kind if each.is_person else each.vehicle_class
        words = [what.replace("_", " "), each.manoeuvre.replace("_", " "), speed]
        if each.vehicle_number in parked:
            words = [what.replace("_", " "), "parked or at work"]
        if len(planned) > 2 * _MANY_VEHICLES.rows:
            words = words[:1]
        entries.append(
            ({"color": vehicle_colour(index), "lw": 5}, f"{party_label(each.vehicle_number)} {', '.join(words)}")
        )
    return entries


def _signs(
    report: MapReport, hypothesis: Hypothesis | None, log: SimulationLog | None
) -> list[tuple[dict[str, Any], str]]:
    """How the signs in this picture look, and what they mean."""
    signs: list[tuple[dict[str, Any], str]] = []
    if hypothesis:
        signs.append(({"color": _PATH_COLOUR, "lw": 1, "ls": (0, (4, 3))}, "planned path, outline at its start"))
    if log:
        signs.append(({"color": _PATH_COLOUR, "lw": 1.6}, "driven path, pale body at rest"))
    if hypothesis and hypothesis.objects:
        ours = any(is_ours(item) for item in hypothesis.objects)
        label = f"{names(hypothesis.objects)}{': placed by us' if ours else ''}"
        signs.append(({"color": OBJECT_COLOUR, "lw": 4}, label))
    if log and log.first_contact:
        several = hypothesis is not None and len(hypothesis.planned) > 1
        what = "first contact of each pair" if several else "first contact"
        signs.append(({"color": CONTACT_COLOUR, "marker": "*", "ms": 9, "mew": 0}, what))
    if log and any(overturned_at(vehicle) is not None for vehicle in log.vehicles):
        signs.append(({"color": CONTACT_COLOUR, "marker": "P", "ms": 7, "mew": 0}, "overturned"))
    signs.append(({"color": REPORTED_COLOUR, "marker": "+", "ms": 9, "mew": 2}, "reported point (× on the road)"))
    if report.inferred_roads:
        signs.append(({"color": MINOR_SURFACE, "lw": 5}, "driveway: ours, not the map's"))
    return signs
