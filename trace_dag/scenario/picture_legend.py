"""The text on the picture of a crash: headline, the parties, and the meaning of the signs.

Letters are set on the finished picture by Pillow: matplotlib takes ten times as long for each line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from trace_dag.crash.conditions import conditions_in_words
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import classes_in_words
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
_MARGIN_IN: Final = 0.08
_SMALLEST: Final = 0.75  # share of its size in which a long line is set; below, it could not be read
_STROKE_IN, _TEXT_IN = 0.2, 0.28
_PATH_COLOUR: Final = "#555555"


class LegendColumn(NamedTuple):
    """How entries of the legend are set: how many rows, from where down and how far apart, and how wide (inches)."""

    rows: int
    first_row_in: float
    row_in: float
    width_in: float


Signs = Sequence[tuple[dict[str, Any], str]]
"""How signs look, as options of a line of matplotlib's, and what they mean."""
_VEHICLES: Final = LegendColumn(2, 0.11, 0.15, 3.2)
_MANY_VEHICLES: Final = LegendColumn(3, 0.065, 0.115, 3.2)
_CROWD: Final = LegendColumn(3, 0.065, 0.115, 1.6)
_SIGNS: Final = LegendColumn(2, 0.11, 0.15, 2.3)
_MANY_SIGNS: Final = LegendColumn(3, 0.065, 0.115, 2.3)


class Words(NamedTuple):
    """A line of text: its left end and the middle of its height in inches from the picture's top left.

    ``anchor`` is Pillow's: "rm" for its right end. ``backed``: on white, to be read on whatever is below.
    """

    x_in: float
    y_in: float
    text: str
    size_pt: float = _SIZE_PT
    anchor: str = "lm"
    backed: bool = False


def write(picture: Image, words: Sequence[Words], dpi: int) -> None:
    """Write lines of text on a picture with a resolution in pixels per inch.

    >>> from PIL import Image as Images
    >>> picture = Images.new("RGB", (100, 40), "white")
    >>> write(picture, [Words(0.2, 0.2, "first contact")], 100)
    >>> len(picture.getcolors()) > 1  # no longer white alone
    True
    """
    from PIL import ImageDraw

    draw = ImageDraw.Draw(picture)
    for each in words:
        place = each.x_in * dpi, each.y_in * dpi
        room_px = (place[0] if each.anchor == "rm" else picture.width - place[0]) - _MARGIN_IN * dpi
        text, font = _fitted(each.text, each.size_pt * dpi / 72, room_px)
        if each.backed:
            left, top, right, bottom = draw.textbbox(place, text, font=font, anchor=each.anchor)
            draw.rectangle((left - 2, top - 2, right + 2, bottom + 2), fill="white")
        draw.text(place, text, fill=INK, font=font, anchor=each.anchor)


def _fitted(text: str, size_px: float, room_px: float) -> tuple[str, FreeTypeFont]:
    """A line that ends before the picture does: set smaller, and if that is not enough, cut after a word."""
    font = _font(size_px)
    if (length_px := font.getlength(text)) <= room_px:
        return text, font
    font = _font(math.floor(max(size_px * room_px / length_px, size_px * _SMALLEST)))
    while font.getlength(text) > room_px and " " in text:
        text = text.removesuffix(" …").rpartition(" ")[0] + " …"
    return text, font


@lru_cache(maxsize=8)
def _font(size_px: float) -> FreeTypeFont:
    """The font that the rest of the picture has."""
    from matplotlib.font_manager import findfont
    from PIL import ImageFont

    return ImageFont.truetype(findfont("DejaVu Sans"), size_px)


def place_line(record: CrashRecord) -> Words:
    """The first line of a headline: which crash it is, of what kind and where.

    >>> place_line(record).text[:40]
    '2023-319003   NE-411/MAIN ST / ELDER ST,'
    """
    roads = " / ".join(filter(None, (record.trafficway_1, record.trafficway_2)))
    place = ", ".join(filter(None, (roads, record.state_name)))
    described = "; ".join(filter(None, (", ".join(classes_in_words(record)), conditions_in_words(record))))
    return headline_words(0, f"{record.key}   {place}   ({described})")


def headline_words(line: int, text: str) -> Words:
    """A line of the headline, from 0.

    >>> headline_words(1, "second line").y_in > headline_words(0, "first line").y_in
    True
    """
    return Words(_MARGIN_IN, _HEADLINE_IN[line], text, _HEADLINE_PT)


def headline(record: CrashRecord, verdict: Verdict | None) -> list[Words]:
    """Which crash it is, its kind and place, and its verdict.

    >>> headline(record, verdict)[1].text.startswith("verified")
    True
    """
    lines = [place_line(record)]
    if verdict:
        outcome = "verified" if verdict.accepted else f"not verified: {verdict.reason}"
        lines.append(headline_words(1, f"{outcome}   {verdict.detail}"))
    return lines


def draw_legend(figure: Figure, top_in: float, entries: Sequence[tuple[float, LegendColumn, Signs]]) -> list[Words]:
    """Draw signs below the panels, in columns that begin so far from the left; what is written beside them.

    >>> from matplotlib.figure import Figure
    >>> signs = sign_entries(map_report, None, log)
    >>> [words.text for words in draw_legend(Figure(), 0.0, [(0.0, sign_column(signs), signs)])][:1]
    ['driven path, pale body at rest']
    """
    words = []
    width_in, height_in = figure.get_size_inches()
    for left_in, column, signs in entries:
        for number, (style, label) in enumerate(signs):
            x_in = left_in + 0.06 + number // column.rows * column.width_in
            y_in = top_in + column.first_row_in + column.row_in * (number % column.rows)
            figure.add_artist(_sign(x_in / width_in, 1 - y_in / height_in, _STROKE_IN / width_in, style))
            words.append(Words(x_in + _TEXT_IN, y_in, label))
    return words


def vehicle_column(entries: Signs) -> LegendColumn:
    """The column for a number of vehicles.

    >>> vehicle_column(vehicle_entries(record, None)) is _VEHICLES
    True
    """
    return next(each for each in (_VEHICLES, _MANY_VEHICLES, _CROWD) if len(entries) <= 2 * each.rows or each is _CROWD)


def sign_column(entries: Signs) -> LegendColumn:
    """The column for a number of signs.

    >>> sign_column([]) is _SIGNS
    True
    """
    return _SIGNS if len(entries) <= 2 * _SIGNS.rows else _MANY_SIGNS


def _sign(x: float, y: float, length: float, style: dict[str, Any]) -> Any:
    """A stroke or a symbol in its middle, in shares of the figure."""
    from matplotlib.lines import Line2D

    xs = [x + length / 2] if "marker" in style else [x, x + length]
    return Line2D(xs, [y] * len(xs), **style)


def vehicle_entries(record: CrashRecord, hypothesis: Hypothesis | None) -> list[tuple[dict[str, Any], str]]:
    """How each vehicle is drawn, its type, manoeuvre and speed.

    >>> [label for _, label in vehicle_entries(record, hypothesis)]
    ['V1 car, turn left, 14 mph as reported', 'V2 motorcycle, straight, 30 mph as reported']
    """
    reported = {vehicle.number: vehicle.travel_speed_mps for vehicle in record.vehicles}
    parked = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    planned = sorted(hypothesis.participants, key=lambda each: each.vehicle_number) if hypothesis else ()
    entries = []
    for index, each in enumerate(planned):
        source = "inferred" if reported.get(each.vehicle_number) is None else "as reported"
        speed = f"{mps_to_mph(each.initial_speed_mps):.0f} mph {source}"
        what = each.kind if each.is_figure else each.vehicle_class
        words = [what.replace("_", " "), each.manoeuvre.replace("_", " "), speed]
        if each.vehicle_number in parked:
            words = [what.replace("_", " "), "parked or at work"]
        if len(planned) > 2 * _MANY_VEHICLES.rows:
            words = words[:1]
        entries.append(
            ({"color": vehicle_colour(index), "lw": 5}, f"{party_label(each.vehicle_number)} {', '.join(words)}")
        )
    return entries


def sign_entries(
    report: MapReport, hypothesis: Hypothesis | None, log: SimulationLog | None
) -> list[tuple[dict[str, Any], str]]:
    """The signs in this picture and their meaning.

    >>> [label for _, label in sign_entries(map_report, None, None)]
    ['reported point (× on the road)']
    """
    signs: list[tuple[dict[str, Any], str]] = []
    if hypothesis:
        signs.append(({"color": _PATH_COLOUR, "lw": 1, "ls": (0, (4, 3))}, "planned path, outline at its start"))
    if log:
        signs.append(({"color": _PATH_COLOUR, "lw": 1.6}, "driven path, pale body at rest"))
    if hypothesis and hypothesis.objects:
        ours = [item for item in hypothesis.objects if is_ours(item)]
        mapped = [item for item in hypothesis.objects if not is_ours(item)]
        said = [f"{names(mapped)}: OpenStreetMap's"] if mapped else []
        label = "; ".join([*said, *([f"{names(ours)}: placed by us"] if ours else [])])
        signs.append(({"color": OBJECT_COLOUR, "lw": 4}, label))
    if log and log.first_contact:
        several = len({(contact.number_1, contact.number_2) for contact in log.contacts}) > 1
        what = "first contact of each pair" if several else "first contact"
        signs.append(({"color": CONTACT_COLOUR, "marker": "*", "ms": 9, "mew": 0}, what))
    if log and any(overturned_at(vehicle) is not None for vehicle in log.vehicles):
        signs.append(({"color": CONTACT_COLOUR, "marker": "P", "ms": 7, "mew": 0}, "overturned"))
    signs.append(({"color": REPORTED_COLOUR, "marker": "+", "ms": 9, "mew": 2}, "reported point (× on the road)"))
    if report.inferred_roads:
        signs.append(({"color": MINOR_SURFACE, "lw": 5}, "driveway: ours, not the map's"))
    return signs
