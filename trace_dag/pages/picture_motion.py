"""Vehicles and people of a crash drawn over a map: planned and driven paths, bodies, first contacts, reported point.

The small moving picture of a crash is an SVG that plays in a loop wherever images are shown. It shows the seconds
around the first contact, or the overturn, on the same map as the still picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.crash.parties import is_vehicle, party_of_body
from trace_dag.osm.types import OsmFeature
from trace_dag.pages.canvas import Canvas, Ink
from trace_dag.pages.map_scene import Window
from trace_dag.pages.maps import MapDrawing
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.scenario.drawn_shapes import (
    CONTACT_COLOUR,
    OBJECT_COLOUR,
    REPORTED_COLOUR,
    WHEEL_M,
    FigureShape,
    body_colour,
    is_ours,
    logged_shape,
    outline,
)
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import Hypothesis
from trace_dag.simulation.types import Body, Moment, SimulationLog, VehicleLog, moment_of, overturned_at

_AT_REST_OPACITY, _OPACITY = 0.35, 0.85
_OBJECT_OPACITY = 0.55
_NOSE_M = 1.2  # the stroke ahead of a body
_RING_M, _LEAST_RING_PT, _LEAST_LIMB_PT = 0.95, 5.0, 0.9  # radius around a person; nothing is drawn smaller
_RIDDEN_COLOUR, _HEAD_COLOUR = "#1D2024", "#3B2A20"
_LEAST_M, _MOST_M = 11.0, 26.0  # half the height of what is seen
_WIDER = 1.6  # than high
_MARGIN_M = 4.0
_WIDTH_PT = 320.0
_BEFORE_S, _AFTER_S, _HELD_S = 1.2, 2.0, 1.0
_STEP_S = 0.1
_PERSON_RADIUS_M = 1.1  # drawn larger than to scale, to be visible


@dataclass(frozen=True)
class SampledBody:
    """A vehicle from above; with an ``opacity`` of 0 only its outline."""

    pose: Pose
    length_m: float
    width_m: float
    colour: str
    opacity: float


@dataclass(frozen=True)
class DrawnFigure:
    """A person from above."""

    shape: FigureShape
    colour: str
    opacity: float


class DrawnMotion:
    """The motions of vehicles and people: planned in ``hypothesis`` and simulated in ``log``, if they are there."""

    def __init__(self, hypothesis: Hypothesis | None, log: SimulationLog | None) -> None:
        self._objects = hypothesis.objects if hypothesis else log.objects if log else ()
        self._contacts = log.first_of_each if log else ()
        planned = {p.vehicle_number: p for p in hypothesis.participants} if hypothesis else {}
        driven = {v.number: v for v in log.vehicles} if log else {}
        self._overturns: list[tuple[float, float]] = []
        self._planned: list[tuple[str, FloatArray]] = []
        self._driven: list[tuple[str, FloatArray]] = []
        self._bodies: list[SampledBody] = []
        self._figures: list[DrawnFigure] = []
        numbers = sorted(planned.keys() | driven.keys())
        for number in numbers:
            colour = body_colour(number, numbers)
            if hypothesis and (participant := planned.get(number)):
                path = participant.trajectory
                before = path.time_s <= hypothesis.impact_time_s
                self._planned.append((colour, np.column_stack([path.x_m, path.y_m])[before]))
                size = participant.length_m, participant.width_m
                if is_vehicle(number):
                    self._bodies.append(SampledBody(participant.initial_pose, *size, colour, 0.0))
                    if not log:
                        self._bodies.append(SampledBody(participant.impact_pose, *size, colour, _OPACITY))
            if log and (vehicle := driven.get(number)):
                body = log.bodies[number]
                party = party_of_body(number)
                own = next((each for each in self._contacts if party in (each.number_1, each.number_2)), None)
                pose = None if own is None else log.pose_at_contact(own, number)
                self._driven.append((colour, np.column_stack([vehicle.x_m, vehicle.y_m])))
                if body.is_figure:
                    self._figures.append(DrawnFigure(logged_shape(vehicle, -1, body), colour, _AT_REST_OPACITY))
                    if own is not None:
                        struck = int(np.searchsorted(vehicle.time_s, own.time_s, side="right")) - 1
                        shape = logged_shape(vehicle, max(struck, 0), body)
                        self._figures.append(DrawnFigure(shape, colour, 1.0))
                    continue
                size = body.length_m, body.width_m
                if body.is_trailer:
                    self._bodies.append(SampledBody(vehicle.pose_at(0), *size, colour, 0.0))
                self._bodies.append(SampledBody(vehicle.pose_at(-1), *size, colour, _AT_REST_OPACITY))
                over = overturned_at(vehicle)
                if over is not None:
                    self._overturns.append((float(vehicle.x_m[over]), float(vehicle.y_m[over])))
                    pose = pose or vehicle.pose_at(over)
                if pose is not None:
                    self._bodies.append(SampledBody(pose, *size, colour, _OPACITY))

    def draw(self, canvas: Canvas) -> None:
        """Draw all of it, between z-orders 20 and 40."""
        for colour, line in self._planned:
            canvas.lines([line], Ink(stroke=colour, width_pt=1.0, dash_pt=(4.0, 3.0)), 20)
        for colour, line in self._driven:
            canvas.lines([line], Ink(stroke=colour, width_pt=1.6), 21)
        draw_objects(canvas, self._objects)
        for body in self._bodies:
            draw_body(canvas, body)
        for figure in self._figures:
            draw_figure(canvas, figure)
        for x, y in self._overturns:
            canvas.symbol("plus", x, y, 4.5, Ink(CONTACT_COLOUR, "white", 0.7), 40)
        for contact in self._contacts:
            # For two vehicles it lies between them; a person on foot would be covered by it.
            level = 40.0 if is_vehicle(contact.number_2) else 31.5
            canvas.symbol("star", contact.x_m, contact.y_m, 6.5, Ink(CONTACT_COLOUR, "white", 0.7), level)


def draw_objects(canvas: Canvas, objects: Sequence[FixedObject]) -> None:
    """Draw fixed objects, with a broken outline if placed by the program, else with a solid one."""
    for item in objects:
        dash = (3.7, 1.6) if is_ours(item) else ()
        ink = Ink(OBJECT_COLOUR, OBJECT_COLOUR, 1.0, fill_opacity=_OBJECT_OPACITY, dash_pt=dash)
        canvas.polygons([outline(item)], ink, 25)


def draw_body(canvas: Canvas, body: SampledBody) -> None:
    """Draw a vehicle as a box with its windscreen and a line ahead of it."""
    corners = rectangle_corners(body.pose, body.length_m, body.width_m)
    canvas.polygons([corners], Ink(body.colour, body.colour, 1.2, fill_opacity=body.opacity), 30)
    for line, colour, width_pt in _fronts(body):
        canvas.lines([line], Ink(stroke=colour, width_pt=width_pt), 31)


def _fronts(body: SampledBody) -> Iterator[tuple[FloatArray, str, float]]:
    """Yield the marks of a body's front, a windscreen and a line ahead: line, colour, width (points)."""
    screen, half, front = 0.22 * body.length_m, 0.42 * body.width_m, 0.5 * body.length_m
    yield body.pose.to_world(np.array([[screen, half], [screen, -half]])), "white" if body.opacity else body.colour, 1.6
    yield body.pose.to_world(np.array([[front, 0.0], [front + _NOSE_M, 0.0]])), body.colour, 1.2


def draw_figure(canvas: Canvas, figure: DrawnFigure) -> None:
    """Draw limbs, torso, head and bicycle to scale, in a ring that is visible from afar.

    A rim separates them from the road.
    """
    shape, least_m = figure.shape, _LEAST_LIMB_PT / canvas.points_per_m
    ring_m = max(_RING_M, _LEAST_RING_PT / canvas.points_per_m)
    canvas.discs([tuple(shape.torso.mean(axis=0))], ring_m, Ink(stroke=figure.colour, width_pt=1.2), 32)
    ridden = [(line, WHEEL_M, _RIDDEN_COLOUR) for line in shape.ridden]
    for line, width_m, colour in (*ridden, *((line, width_m, figure.colour) for line, width_m in shape.lines)):
        width_pt = max(width_m, least_m) * canvas.points_per_m
        for rim_pt, ink in ((1.0, "white"), (0.0, colour)):
            stroke = Ink(stroke=ink, width_pt=width_pt + rim_pt, opacity=figure.opacity, round_caps=True)
            canvas.lines([line], stroke, 34 - rim_pt)
    head = Ink(_HEAD_COLOUR, "white", 0.6, opacity=figure.opacity)
    canvas.discs([tuple(shape.head)], max(shape.head_m, least_m), head, 35)


def draw_cross(canvas: Canvas) -> None:
    """Draw the reported point, the origin of the frame."""
    canvas.cross(0.0, 0.0, 7.5, Ink(stroke=REPORTED_COLOUR, width_pt=2.4), 41)


def draw_reported_point(canvas: Canvas, report: MapReport) -> None:
    """Draw the reported point, and the point on the road to which it was moved, if any."""
    x, y = report.placement.x_m, report.placement.y_m
    draw_cross(canvas)
    if math.hypot(x, y) > 0.5:
        way = np.array([[0.0, 0.0], [x, y]])
        canvas.lines([way], Ink(stroke=REPORTED_COLOUR, width_pt=0.9, dash_pt=(0.9, 1.5)), 39)
        canvas.cross(x, y, 4.0, Ink(stroke=REPORTED_COLOUR, width_pt=1.6), 41, turned=True)


# --- the small moving picture ----------------------------------------------------------------------------------------
def draw_thumbnail(network: RoadNetwork, log: SimulationLog, surroundings: Sequence[OsmFeature] = ()) -> str:
    """Return the SVG of a crash; ``surroundings`` are drawn behind the roads.

    Raises ValueError without a contact or an overturn to show.

    >>> draw_thumbnail(network, log)[:4]
    '<svg'
    """
    moment = moment_of(log)
    if moment is None:
        raise ValueError("a log without a contact or an overturn has no moment to show")
    time_s = np.arange(moment.time_s - _BEFORE_S, moment.time_s + _AFTER_S, _STEP_S)
    window = _window(log, moment, time_s)
    canvas = Canvas(window, _WIDTH_PT)
    MapDrawing(network, window, surroundings=surroundings).draw(canvas, names=False)
    draw_objects(canvas, log.objects)
    for vehicle in log.vehicles:
        body, colour = log.bodies[vehicle.number], body_colour(vehicle.number, log.bodies)
        canvas.element(_moving(vehicle, body, colour, time_s, canvas), 30)
    return canvas.svg(f' width="{_WIDTH_PT:g}" height="{_WIDTH_PT / _WIDER:g}"')


def _window(log: SimulationLog, moment: Moment, time_s: FloatArray) -> Window:
    """Return a window around the parties from first to last, close enough to recognise vehicles."""
    both = [each for each in log.vehicles if each.number in moment.numbers]
    ways = [[np.interp(time_s, each.time_s, values) for values in (each.x_m, each.y_m)] for each in both]
    points = np.concatenate([*(np.stack(way, axis=-1) for way in ways), [[moment.x_m, moment.y_m]]])
    low, high = points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M
    wide_m, high_m = ((high - low) / 2).tolist()
    half_m = min(max(wide_m / _WIDER, high_m, _LEAST_M), _MOST_M)
    # One that comes from farther away drives into the picture: the middle is then nearer to where it happens.
    room = np.maximum(np.array([half_m * _WIDER, half_m]) - 2 * _MARGIN_M, 0.0)
    place = np.array([moment.x_m, moment.y_m])
    x, y = np.clip((low + high) / 2, place - room, place + room).tolist()
    return (x - half_m * _WIDER, y - half_m, x + half_m * _WIDER, y + half_m)


def _moving(vehicle: VehicleLog, body: Body, colour: str, time_s: FloatArray, canvas: Canvas) -> str:
    heading_rad = np.unwrap(vehicle.heading_rad)
    x, y, heading = (np.interp(time_s, vehicle.time_s, each) for each in (vehicle.x_m, vehicle.y_m, heading_rad))
    places = [f"{east:.0f},{south:.0f}" for east, south in canvas.places(np.column_stack([x, y])).tolist()]
    turns = [f"{-math.degrees(angle):.0f}" for angle in heading]
    length, width, radius = (canvas.PER_M * each for each in (body.length_m, body.width_m, _PERSON_RADIUS_M))
    if body.is_figure:
        shape = f'<circle r="{radius:.0f}" fill="{colour}" stroke="#000" stroke-width="20"/>'
    else:
        shape = (
            f'<rect x="{-length / 2:.0f}" y="{-width / 2:.0f}" width="{length:.0f}" height="{width:.0f}" rx="40" '
            f'fill="{colour}" stroke="#fff" stroke-width="10"/>'
            f'<path d="M{0.22 * length:.0f} {-0.4 * width:.0f}v{0.8 * width:.0f}" stroke="#fff" stroke-width="30"/>'
        )
    return f"<g>{_animated('translate', places)}{_animated('rotate', turns)}{shape}</g>"


def _animated(kind: str, values: Sequence[str]) -> str:
    """Return a transformation through equally spaced values; the last one is held for a while."""
    held = [*values, *[values[-1]] * round(_HELD_S / _STEP_S)]
    return (
        f'<animateTransform attributeName="transform" type="{kind}" additive="sum" values="{";".join(held)}" '
        f'dur="{len(held) * _STEP_S:g}s" repeatCount="indefinite"/>'
    )
