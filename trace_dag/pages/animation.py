"""A simulated crash as a moving picture, WebP: the whole crash on the left, the impact close up beside it.

The map is drawn once per view; frames are that picture with the parties on it, drawn as in the still picture. Time runs
at real speed, and at a quarter of it around the impact.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import is_dark
from trace_dag.pages.canvas import Canvas, Ink, pixels_of
from trace_dag.pages.drive import AgentDrive
from trace_dag.pages.map_scene import Window
from trace_dag.pages.maps import MapDrawing
from trace_dag.pages.picture_motion import DrawnFigure, SampledBody, draw_body, draw_figure, draw_objects
from trace_dag.pages.replay_content import replay_windows
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drawn_shapes import CONTACT_COLOUR, body_colour, logged_shape
from trace_dag.simulation.types import Body, SimulationLog, VehicleLog, moment_of
from trace_dag.verdict.in_words import label_in_words
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from PIL.Image import Image

    from trace_dag.osm.types import OsmFeature

_FRAME_S = 0.06  # shown
_SLOW = 0.25
_SLOW_BEFORE_S, _SLOW_AFTER_S = 0.4, 0.8
_BEFORE_IMPACT_S, _AFTER_IMPACT_S = 3.0, 4.0
_LAST_FRAME_S = 1.2
_HEADER_PX = 44
_GAP_PX = 4  # between the views
_PT_PER_PX = 0.8  # strokes as on a screen of 90 dots an inch
_CONTACT_PT = 4.0  # radius of the ring around the contact


def write_animation(
    record: CrashRecord,
    network: RoadNetwork,
    log: SimulationLog,
    verdict: Verdict | None = None,
    *,
    drive: AgentDrive | None = None,
    surroundings: Sequence[OsmFeature] = (),
    panel_px: int = 420,
) -> bytes:
    """Return the moving picture as WebP, twice ``panel_px`` wide.

    ``log`` is that of the hypothesis that ``verdict`` judges, or of an agent's ``drive``; ``surroundings`` are drawn
    behind the roads.

    >>> write_animation(record, network, log, panel_px=60)[8:12]
    b'WEBP'
    """
    times = _frame_times(log)
    windows = replay_windows(log, from_s=times[0][0])
    views = [
        View(network, window, panel_px, surroundings=surroundings, dark=is_dark(record))
        for window in (windows.overview, windows.impact)
    ]
    frames = [_frame(record, log, verdict, drive, views, time_s, rate) for time_s, rate in times]
    durations = [round(1000 * _FRAME_S)] * (len(frames) - 1) + [round(1000 * _LAST_FRAME_S)]
    stream = io.BytesIO()
    frames[0].save(
        stream, "WEBP", save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=70, method=2
    )
    return stream.getvalue()


def _frame_times(log: SimulationLog) -> list[tuple[float, float]]:
    """Return the simulated time of each frame and its playback rate; frames are evenly spaced in playback time."""
    moment = moment_of(log)
    end_s = log.duration_s if moment is None else min(log.duration_s, moment.time_s + _AFTER_IMPACT_S)
    time_s = 0.0 if moment is None else max(0.0, moment.time_s - _BEFORE_IMPACT_S)
    times = []
    while time_s < end_s:
        slow = moment is not None and -_SLOW_BEFORE_S <= time_s - moment.time_s < _SLOW_AFTER_S
        rate = _SLOW if slow else 1.0
        times.append((time_s, rate))
        time_s += _FRAME_S * rate
    times.append((end_s, 1.0))
    return times


class View:
    """A window of the map as a picture, on which moving bodies are drawn."""

    def __init__(
        self,
        network: RoadNetwork,
        window: Window,
        size_px: int,
        *,
        surroundings: Sequence[OsmFeature] = (),
        dark: bool = False,
    ) -> None:
        self._window, self._size_px = window, size_px
        canvas = self.canvas()
        MapDrawing(network, window, surroundings=surroundings, dark=dark, fading=True).draw(canvas)
        self._background = pixels_of(canvas.svg(), size_px).convert("RGBA")

    def canvas(self) -> Canvas:
        """Return an empty canvas of the window, for moving bodies."""
        return Canvas(self._window, self._size_px * _PT_PER_PX)

    def picture(self, moving: Canvas) -> Image:
        """Return the map with a canvas drawn above it."""
        from PIL import Image

        above = pixels_of(moving.svg(), self._size_px, background=None).convert("RGBA")
        return Image.alpha_composite(self._background, above).convert("RGB")


def _frame(
    record: CrashRecord,
    log: SimulationLog,
    verdict: Verdict | None,
    drive: AgentDrive | None,
    views: list[View],
    time_s: float,
    rate: float,
) -> Image:
    from PIL import Image

    panels = [_panel(view, log, drive, time_s) for view in views]
    header = _header(record, log, verdict, drive, time_s, rate, panels[0].width * 2 + _GAP_PX)
    picture = Image.new("RGB", (header.width, header.height + panels[0].height), "white")
    picture.paste(header, (0, 0))
    picture.paste(panels[0], (0, header.height))
    picture.paste(panels[1], (panels[0].width + _GAP_PX, header.height))
    return picture


def _panel(view: View, log: SimulationLog, drive: AgentDrive | None, time_s: float) -> Image:
    canvas = view.canvas()
    draw_objects(canvas, log.objects)
    if drive is not None:
        draw_body(canvas, SampledBody(drive.ghost_pose(time_s), drive.body.length_m, drive.body.width_m, "black", 0.0))
    for vehicle in log.vehicles:
        _draw_party(canvas, vehicle, log.bodies[vehicle.number], body_colour(vehicle.number, log.bodies), time_s)
    moment = moment_of(log)
    if moment is not None and time_s >= moment.time_s:
        ring = Ink(stroke=CONTACT_COLOUR, width_pt=1.6)
        canvas.discs([(moment.x_m, moment.y_m)], _CONTACT_PT / canvas.points_per_m, ring, 45)
    return view.picture(canvas)


def _draw_party(canvas: Canvas, vehicle: VehicleLog, body: Body, colour: str, time_s: float) -> None:
    past = vehicle.time_s <= time_s
    x_m, y_m, heading_rad = (
        float(np.interp(time_s, vehicle.time_s, values))
        for values in (vehicle.x_m, vehicle.y_m, np.unwrap(vehicle.heading_rad))
    )
    trail = np.append(np.stack([vehicle.x_m, vehicle.y_m], axis=-1)[past], [(x_m, y_m)], axis=0)
    canvas.lines([trail], Ink(stroke=colour, width_pt=1.0, opacity=0.6), 21)
    if body.is_figure:
        shape = logged_shape(vehicle, max(int(past.sum()) - 1, 0), body)
        draw_figure(canvas, DrawnFigure(shape, colour, 1.0))
    else:
        draw_body(canvas, SampledBody(Pose(x_m, y_m, heading_rad), body.length_m, body.width_m, colour, 1.0))


def _header(
    record: CrashRecord,
    log: SimulationLog,
    verdict: Verdict | None,
    drive: AgentDrive | None,
    time_s: float,
    rate: float,
    width_px: int,
) -> Image:
    """Draw the crash's name and outcome, the clock below, and each party's speed in its colour."""
    canvas = Canvas((0.0, 0.0, float(width_px), float(_HEADER_PX)), float(width_px))
    outcome = "" if verdict is None else label_in_words(verdict)
    if drive is not None:
        outcome = drive.title
    canvas.text("   ".join(filter(None, (record.key, outcome))), 8, 32, 15, "black", 1, anchor="start")
    moment = moment_of(log)
    clock = f"{time_s:5.2f} s" if moment is None else f"{time_s - moment.time_s:+.2f} s from impact"
    canvas.text(clock + ("   1/4 speed" if rate != 1.0 else ""), 8, 12, 13, "black", 1, anchor="start")
    x = 250.0
    for vehicle in log.parties:
        speed = float(np.interp(time_s, vehicle.time_s, np.hypot(vehicle.velocity_x_mps, vehicle.velocity_y_mps)))
        body = log.bodies[vehicle.number]
        what = str(body.kind if body.is_figure else body.vehicle_class).replace("_", " ")
        text = f"{party_label(vehicle.number)} {what} {mps_to_mph(speed):.0f} mph"
        canvas.text(text, x, 12, 13, body_colour(vehicle.number, log.bodies), 1, anchor="start")
        x += 170.0
    return pixels_of(canvas.svg(), width_px).convert("RGB")
