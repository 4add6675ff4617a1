"""A simulated crash as a moving picture, GIF, WebP or MP4: the whole crash on the left, the impact close up beside it.

The map is drawn once per view; frames are that picture with the bodies on it. Time runs at real speed, and at a quarter
of it around the impact.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from itertools import repeat
from typing import TYPE_CHECKING, Literal

import numpy as np

from trace_dag.crash.conditions import is_dark
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.colours import CONTACT_COLOUR, OBJECT_COLOUR, body_colour
from trace_dag.scenario.drive import AgentDrive
from trace_dag.scenario.figure_shapes import WHEEL_M, FigureShape, logged_shape
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import Window
from trace_dag.scenario.maps import MapDrawing
from trace_dag.scenario.object_shapes import outline
from trace_dag.scenario.replay_content import replay_windows
from trace_dag.scenario.video import encode_mp4
from trace_dag.sim.types import SimulationLog, moment_of
from trace_dag.units import mps_to_mph
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

    from trace_dag.osm.types import OsmFeature

MovingFormat = Literal["gif", "webp", "mp4"]

_FRAME_S = 0.06  # shown; GIF knows hundredths only
_VIDEO_FRAME_S = 0.04  # frames of a video are small: only changes are stored
_SLOW = 0.25
_SLOW_BEFORE_S, _SLOW_AFTER_S = 0.4, 0.8
_BEFORE_IMPACT_S, _AFTER_IMPACT_S = 3.0, 4.0
_LAST_FRAME_S = 1.2
_HEADER_PX = 44
_RING_M, _LEAST_RING_PX = 0.95, 7.0  # radius around a person
_SMOOTHING = 2  # frames are drawn this much larger and reduced


def write_animation(
    record: CrashRecord,
    network: RoadNetwork,
    log: SimulationLog,
    verdict: Verdict | None = None,
    *,
    drive: AgentDrive | None = None,
    surroundings: Sequence[OsmFeature] = (),
    image_format: MovingFormat = "webp",
    panel_px: int = 420,
) -> bytes:
    """The moving picture, twice ``panel_px`` wide. ``log`` is of the hypothesis that ``verdict`` is about, or
    of an agent's ``drive``; ``surroundings`` lie behind the roads.

    An MP4 needs the extra of that name: :class:`trace_dag.errors.UserError` without it.

    >>> write_animation(record, network, log, panel_px=60)[8:12]
    b'WEBP'
    """
    frame_s = _VIDEO_FRAME_S if image_format == "mp4" else _FRAME_S
    times = _frame_times(log, frame_s)
    windows = replay_windows(log, from_s=times[0][0])
    views = [
        View(network, window, panel_px, surroundings=surroundings, dark=is_dark(record))
        for window in (windows.overview, windows.impact)
    ]
    frames = (_frame(record, log, verdict, drive, views, time_s, rate) for time_s, rate in times)
    if image_format == "mp4":
        return encode_mp4(_staying(frames, round(_LAST_FRAME_S / frame_s)), round(1 / frame_s))
    return _encode_picture(list(frames), image_format)


def _staying(frames: Iterator[Image], times: int) -> Iterator[Image]:
    """The frames, with the last one repeated."""
    last = next(frames)
    yield last
    for last in frames:
        yield last
    yield from repeat(last, times)


def _encode_picture(frames: list[Image], image_format: Literal["gif", "webp"]) -> bytes:
    from PIL.Image import Dither

    durations = [round(1000 * _FRAME_S)] * (len(frames) - 1) + [round(1000 * _LAST_FRAME_S)]
    stream = io.BytesIO()
    if image_format == "gif":
        frames = [frame.quantize(colors=96, dither=Dither.NONE) for frame in frames]
        frames[0].save(stream, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)
    else:
        frames[0].save(
            stream, "WEBP", save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=70, method=2
        )
    return stream.getvalue()


def _frame_times(log: SimulationLog, frame_s: float) -> list[tuple[float, float]]:
    """The simulated time of each frame and the rate it is shown at; frames are ``frame_s`` apart as watched."""
    moment = moment_of(log)
    end_s = log.duration_s if moment is None else min(log.duration_s, moment.time_s + _AFTER_IMPACT_S)
    time_s = 0.0 if moment is None else max(0.0, moment.time_s - _BEFORE_IMPACT_S)
    times = []
    while time_s < end_s:
        slow = moment is not None and -_SLOW_BEFORE_S <= time_s - moment.time_s < _SLOW_AFTER_S
        rate = _SLOW if slow else 1.0
        times.append((time_s, rate))
        time_s += frame_s * rate
    times.append((end_s, 1.0))
    return times


class View:
    """A window of the map as a picture, and where points of the local frame lie on it."""

    def __init__(
        self,
        network: RoadNetwork,
        window: Window,
        size_px: int,
        *,
        surroundings: Sequence[OsmFeature] = (),
        dark: bool = False,
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from PIL import Image

        self.size_px = size_px * _SMOOTHING
        self._west, _, self._east, self._north = window
        figure = Figure(figsize=(self.size_px / 100, self.size_px / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        drawing = MapDrawing(network, window, surroundings=surroundings, dark=dark, fading=True)
        drawing.draw(Panel.on_figure(figure, window, (0.0, 0.0, 1.0, 1.0)))
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        self.background = Image.fromarray(pixels[..., :3].copy())

    @property
    def px_per_m(self) -> float:
        return self.size_px / (self._east - self._west)

    def px(self, points_m: FloatArray) -> list[tuple[float, float]]:
        scale = self.px_per_m
        return [((x - self._west) * scale, (self._north - y) * scale) for x, y in np.atleast_2d(points_m).tolist()]


def _frame(
    record: CrashRecord,
    log: SimulationLog,
    verdict: Verdict | None,
    drive: AgentDrive | None,
    views: list[View],
    time_s: float,
    rate: float,
) -> Image:
    from PIL import Image, ImageDraw

    panels = []
    for view in views:
        panel = view.background.copy()
        draw = ImageDraw.Draw(panel)
        for item in log.objects:
            draw.polygon(view.px(outline(item)), fill=OBJECT_COLOUR, outline="white")
        if drive is not None:
            pose = drive.ghost_pose(time_s)
            corners = view.px(rectangle_corners(pose, drive.body.length_m, drive.body.width_m))
            draw.polygon(corners, outline="black", width=_SMOOTHING)
        for index in range(len(log.vehicles)):
            _draw_vehicle(draw, view, log, index, time_s)
        moment = moment_of(log)
        if moment is not None and time_s >= moment.time_s:
            ((x, y),) = view.px(np.array([moment.x_m, moment.y_m]))
            r = 5 * _SMOOTHING
            draw.ellipse((x - r, y - r, x + r, y + r), outline=CONTACT_COLOUR, width=2 * _SMOOTHING)
        panels.append(panel.resize((view.size_px // _SMOOTHING,) * 2, Image.Resampling.BOX))
    width = sum(panel.width for panel in panels) + 4
    picture = Image.new("RGB", (width, panels[0].height + _HEADER_PX), "white")
    picture.paste(panels[0], (0, _HEADER_PX))
    picture.paste(panels[1], (panels[0].width + 4, _HEADER_PX))
    _draw_header(ImageDraw.Draw(picture), record, log, verdict, drive, time_s, rate)
    return picture


def _draw_vehicle(draw: ImageDraw, view: View, log: SimulationLog, index: int, time_s: float) -> None:
    vehicle = log.vehicles[index]
    body = log.bodies[vehicle.number]
    colour = body_colour(vehicle.number, log.bodies)
    past = vehicle.time_s <= time_s
    x_m, y_m, heading_rad = (
        float(np.interp(time_s, vehicle.time_s, values))
        for values in (vehicle.x_m, vehicle.y_m, np.unwrap(vehicle.heading_rad))
    )
    pose = Pose(x_m, y_m, heading_rad)
    if body.is_figure:
        trail = view.px(np.append(np.stack([vehicle.x_m, vehicle.y_m], axis=-1)[past], [pose.xy_m], axis=0))
        draw.line(trail, fill=colour, width=_SMOOTHING)
        _draw_person(draw, view, logged_shape(vehicle, max(int(past.sum()) - 1, 0), body), colour)
        return
    trail = view.px(np.append(np.stack([vehicle.x_m, vehicle.y_m], axis=-1)[past], [pose.xy_m], axis=0))
    draw.line(trail, fill=colour, width=_SMOOTHING)
    outline = view.px(rectangle_corners(pose, body.length_m, body.width_m))
    draw.polygon(outline, fill=colour, outline="white", width=_SMOOTHING)
    ahead, half = body.length_m / 2 - min(0.3 * body.length_m, 1.6), 0.4 * body.width_m
    windscreen = view.px(pose.to_world(np.array([[ahead, half], [ahead, -half]])))
    draw.line(windscreen, fill="white", width=max(_SMOOTHING, round(0.35 * view.px_per_m)))


def _draw_person(draw: ImageDraw, view: View, shape: FigureShape, colour: str) -> None:
    """Draw a person to scale, with a rim to set it off from the ground, in a ring that is visible in the wider view."""
    scale = view.px_per_m
    ((x, y),) = view.px(shape.torso.mean(axis=0))
    r = max(_RING_M * scale, _LEAST_RING_PX * _SMOOTHING)
    draw.ellipse((x - r, y - r, x + r, y + r), outline=colour, width=_SMOOTHING)
    ridden = [(line, WHEEL_M, "#1D2024") for line in shape.ridden]
    lines = [*ridden, *((line, width_m, colour) for line, width_m in shape.lines)]
    for rim in (True, False):
        for line, width_m, ink in lines:
            px = max(round(width_m * scale), _SMOOTHING) + 2 * rim
            ends = view.px(line)
            draw.line(ends, fill="white" if rim else ink, width=px)
            for end_x, end_y in ends:
                draw.ellipse(
                    (end_x - px / 2, end_y - px / 2, end_x + px / 2, end_y + px / 2), fill="white" if rim else ink
                )
    ((x, y),) = view.px(shape.head)
    r = max(shape.head_m * scale, _SMOOTHING)
    draw.ellipse((x - r, y - r, x + r, y + r), fill="#3B2A20", outline="white")


def _draw_header(
    draw: ImageDraw,
    record: CrashRecord,
    log: SimulationLog,
    verdict: Verdict | None,
    drive: AgentDrive | None,
    time_s: float,
    rate: float,
) -> None:
    from PIL import ImageFont

    font, small = ImageFont.load_default(size=15), ImageFont.load_default(size=13)
    outcome = "" if verdict is None else "verified" if verdict.accepted else f"not verified: {verdict.reason}"
    if drive is not None:
        outcome = drive.title
    draw.text((8, 4), "   ".join(filter(None, (record.key, outcome))), fill="black", font=font)
    moment = moment_of(log)
    clock = f"{time_s:5.2f} s"
    if moment is not None:
        clock = f"{time_s - moment.time_s:+.2f} s from impact"
    draw.text((8, 24), clock + ("   1/4 speed" if rate != 1.0 else ""), fill="black", font=small)
    x = 250
    for vehicle in log.parties:
        speed = float(np.interp(time_s, vehicle.time_s, np.hypot(vehicle.velocity_x_mps, vehicle.velocity_y_mps)))
        body = log.bodies[vehicle.number]
        what = str(body.kind if body.is_figure else body.vehicle_class).replace("_", " ")
        label = f"{party_label(vehicle.number)} {what} "
        text = label + f"{mps_to_mph(speed):.0f} mph"
        draw.text((x, 24), text, fill=body_colour(vehicle.number, log.bodies), font=small)
        x += 170
