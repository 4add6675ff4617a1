"""Vehicles and people of a crash drawn over a map: planned and driven paths, bodies, first contacts, reported point."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trace_dag.crash.parties import is_vehicle, party_of_body
from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.report import MapReport
from trace_dag.scenario.colours import CONTACT_COLOUR, OBJECT_COLOUR, REPORTED_COLOUR, body_colour
from trace_dag.scenario.figure_shapes import WHEEL_M, FigureShape, logged_shape
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.object_shapes import is_ours, outline
from trace_dag.sim.types import Contact, SimulationLog, VehicleLog, overturned_at
from trace_dag.states.types import Hypothesis

_AT_REST_ALPHA, _ALPHA = 0.35, 0.85
_OBJECT_ALPHA = 0.55
_NOSE_M = 1.2  # the stroke ahead of a body
_RING_M, _LEAST_RING_PT, _LEAST_LIMB_PT = 0.95, 5.0, 0.9  # radius around a person; nothing is drawn smaller
_RIDDEN_COLOUR, _HEAD_COLOUR = "#1D2024", "#3B2A20"


@dataclass(frozen=True)
class _Body:
    """A body from above; an ``alpha`` of 0 leaves the outline."""

    pose: Pose
    length_m: float
    width_m: float
    colour: str
    alpha: float


@dataclass(frozen=True)
class _Figure:
    """A person from above."""

    shape: FigureShape
    colour: str
    alpha: float


class DrawnMotion:
    """The motions of vehicles and people: planned in ``hypothesis`` and simulated in ``log``, if they are there."""

    def __init__(self, hypothesis: Hypothesis | None, log: SimulationLog | None) -> None:
        contacts = sorted(log.contacts, key=lambda each: each.time_s) if log else []
        self._objects = hypothesis.objects if hypothesis else log.objects if log else ()
        self._contacts = _first_of_pairs(contacts)
        planned = {p.vehicle_number: p for p in hypothesis.participants} if hypothesis else {}
        driven = {v.number: v for v in log.vehicles} if log else {}
        self._overturns: list[tuple[float, float]] = []
        self._planned: list[tuple[str, FloatArray]] = []
        self._driven: list[tuple[str, FloatArray]] = []
        self._bodies: list[_Body] = []
        self._figures: list[_Figure] = []
        numbers = sorted(planned.keys() | driven.keys())
        for number in numbers:
            colour = body_colour(number, numbers)
            if hypothesis and (participant := planned.get(number)):
                path = participant.trajectory
                before = path.time_s <= hypothesis.impact_time_s
                self._planned.append((colour, np.column_stack([path.x_m, path.y_m])[before]))
                size = participant.length_m, participant.width_m
                if is_vehicle(number):
                    self._bodies.append(_Body(participant.initial_pose, *size, colour, 0.0))
                    if not contacts and not log:
                        self._bodies.append(_Body(participant.impact_pose, *size, colour, _ALPHA))
            if log and (vehicle := driven.get(number)):
                body = log.bodies[number]
                party = party_of_body(number)
                own = next((each for each in contacts if party in (each.number_1, each.number_2)), None)
                pose = None if own is None else log.pose_at_contact(own, number)
                self._driven.append((colour, np.column_stack([vehicle.x_m, vehicle.y_m])))
                if body.is_figure:
                    self._figures.append(_Figure(logged_shape(vehicle, -1, body), colour, _AT_REST_ALPHA))
                    if own is not None:
                        struck = int(np.searchsorted(vehicle.time_s, own.time_s, side="right")) - 1
                        shape = logged_shape(vehicle, max(struck, 0), body)
                        self._figures.append(_Figure(shape, colour, 1.0))
                    continue
                size = body.length_m, body.width_m
                if body.is_trailer:
                    self._bodies.append(_Body(_first_pose(vehicle), *size, colour, 0.0))
                self._bodies.append(_Body(_last_pose(vehicle), *size, colour, _AT_REST_ALPHA))
                over = overturned_at(vehicle)
                if over is not None:
                    self._overturns.append((float(vehicle.x_m[over]), float(vehicle.y_m[over])))
                    if pose is None:
                        pose = Pose(*self._overturns[-1], float(vehicle.heading_rad[over]))
                if pose is not None:
                    self._bodies.append(_Body(pose, *size, colour, _ALPHA))

    def draw(self, panel: Panel) -> None:
        """Draw all of it, between z-orders 20 and 40."""
        from matplotlib.collections import LineCollection, PolyCollection
        from matplotlib.lines import Line2D

        for paths, width, style, z in ((self._planned, 1.0, (0, (4, 3)), 20), (self._driven, 1.6, "solid", 21)):
            lines, colours = [line for _, line in paths], [colour for colour, _ in paths]
            panel.add(LineCollection(lines, colors=colours, linewidths=width, linestyles=[style], zorder=z))
        panel.add(
            PolyCollection(
                [rectangle_corners(body.pose, body.length_m, body.width_m) for body in self._bodies],
                facecolors=[(body.colour, body.alpha) for body in self._bodies],
                edgecolors=[body.colour for body in self._bodies],
                linewidths=1.2,
                zorder=30,
            )
        )
        if self._objects:
            panel.add(
                PolyCollection(
                    [outline(item) for item in self._objects],
                    facecolors=(OBJECT_COLOUR, _OBJECT_ALPHA),
                    edgecolors=OBJECT_COLOUR,
                    linewidths=1.0,
                    linestyles=["dashed" if is_ours(item) else "solid" for item in self._objects],
                    zorder=25,
                )
            )
        strokes = [stroke for body in self._bodies for stroke in _fronts(body)]
        panel.add(
            LineCollection(
                [line for line, _, _ in strokes],
                colors=[colour for _, colour, _ in strokes],
                linewidths=[width for _, _, width in strokes],
                zorder=31,
            )
        )
        for figure in self._figures:
            _draw_figure(panel, figure)
        for x, y in self._overturns:
            panel.add(Line2D([x], [y], marker="P", ms=9, color=CONTACT_COLOUR, mec="white", mew=0.7, zorder=40))
        for contact in self._contacts:
            # For two vehicles it lies between them; a person on foot would be covered by it.
            level = 40.0 if is_vehicle(contact.number_2) else 31.5
            star = Line2D([contact.x_m], [contact.y_m], marker="*", ms=13, color=CONTACT_COLOUR, mec="white", mew=0.7)
            star.set_zorder(level)
            panel.add(star)


def _fronts(body: _Body) -> Iterator[tuple[FloatArray, str, float]]:
    """The marks of a body's front, a windscreen and a stroke ahead: line, colour, width (points)."""
    screen, half, front = 0.22 * body.length_m, 0.42 * body.width_m, 0.5 * body.length_m
    yield body.pose.to_world(np.array([[screen, half], [screen, -half]])), "white" if body.alpha else body.colour, 1.6
    yield body.pose.to_world(np.array([[front, 0.0], [front + _NOSE_M, 0.0]])), body.colour, 1.2


def _draw_figure(panel: Panel, figure: _Figure) -> None:
    """Limbs, torso, head and bicycle to scale with a rim that parts them from the road, in a ring that is seen from
    afar."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    shape, scale = figure.shape, panel.points_per_m
    x, y = shape.torso.mean(axis=0).tolist()
    ring_pt = 2 * max(_RING_M * scale, _LEAST_RING_PT)
    panel.add(Line2D([x], [y], marker="o", ms=ring_pt, mfc="none", mec=figure.colour, mew=1.2, zorder=32))
    ridden = [(line, WHEEL_M, _RIDDEN_COLOUR) for line in shape.ridden]
    for line, width_m, colour in (*ridden, *((line, width_m, figure.colour) for line, width_m in shape.lines)):
        width = max(width_m * scale, _LEAST_LIMB_PT)
        for rim, ink in ((1.0, "white"), (0.0, colour)):
            strokes = LineCollection([line], colors=ink, linewidths=width + rim, capstyle="round", zorder=34 - rim)
            strokes.set_alpha(figure.alpha)
            panel.add(strokes)
    head_pt = 2 * max(shape.head_m * scale, _LEAST_LIMB_PT)
    head = Line2D(*shape.head[:, None], marker="o", ms=head_pt, mfc=_HEAD_COLOUR, mec="white", mew=0.6, zorder=35)
    head.set_alpha(figure.alpha)
    panel.add(head)


def _first_of_pairs(contacts: Sequence[Contact]) -> list[Contact]:
    """The first contact of each two parties, in order."""
    first: dict[tuple[int, int], Contact] = {}
    for each in contacts:
        first.setdefault((each.number_1, each.number_2), each)
    return list(first.values())


def _first_pose(vehicle: VehicleLog) -> Pose:
    return Pose(float(vehicle.x_m[0]), float(vehicle.y_m[0]), float(vehicle.heading_rad[0]))


def _last_pose(vehicle: VehicleLog) -> Pose:
    return Pose(float(vehicle.x_m[-1]), float(vehicle.y_m[-1]), float(vehicle.heading_rad[-1]))


def draw_cross(panel: Panel) -> None:
    """The reported point, the origin of the frame.

    >>> from matplotlib.figure import Figure
    >>> from trace_dag.scenario.map_panel import Panel
    >>> panel = Panel.on_figure(Figure(), (-60.0, -60.0, 60.0, 60.0), (0.0, 0.0, 1.0, 1.0))
    >>> draw_cross(panel)
    >>> [artist.get_marker() for artist in panel.figure.artists]
    ['+']
    """
    from matplotlib.lines import Line2D

    panel.add(Line2D([0.0], [0.0], marker="+", ms=15, mew=2.4, color=REPORTED_COLOUR, zorder=41))


def draw_reported_point(panel: Panel, report: MapReport) -> None:
    """The reported point, and the point on the road to which it was moved, if it was.

    >>> from matplotlib.figure import Figure
    >>> from trace_dag.scenario.map_panel import Panel
    >>> panel = Panel.on_figure(Figure(), (-60.0, -60.0, 60.0, 60.0), (0.0, 0.0, 1.0, 1.0))
    >>> draw_reported_point(panel, map_report)
    >>> [artist.get_marker() for artist in panel.figure.artists]  # on the road: it was not moved
    ['+']
    """
    from matplotlib.lines import Line2D

    x, y = report.placement.x_m, report.placement.y_m
    draw_cross(panel)
    if math.hypot(x, y) > 0.5:
        panel.add(Line2D([0.0, x], [0.0, y], color=REPORTED_COLOUR, lw=0.9, ls=":", zorder=39))
        panel.add(Line2D([x], [y], marker="x", ms=8, mew=1.6, color=REPORTED_COLOUR, zorder=41))
