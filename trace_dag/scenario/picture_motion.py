"""The vehicles of a crash drawn over a map: planned and driven paths, bodies, first contact, reported point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.report import MapReport
from trace_dag.scenario.colours import CONTACT_COLOUR, REPORTED_COLOUR, vehicle_colour
from trace_dag.scenario.map_panel import Panel
from trace_dag.sim.types import SimulationLog, VehicleLog
from trace_dag.states.types import Hypothesis

_AT_REST_ALPHA, _ALPHA = 0.35, 0.85
_NOSE_M = 1.2  # the stroke ahead of a body


@dataclass(frozen=True)
class _Body:
    """A body from above; an ``alpha`` of 0 leaves the outline."""

    pose: Pose
    length_m: float
    width_m: float
    colour: str
    alpha: float


class DrawnMotion:
    """How the vehicles move: as planned in ``hypothesis`` and as simulated in ``log``, as far as there are any."""

    def __init__(self, hypothesis: Hypothesis | None, log: SimulationLog | None) -> None:
        contact = log.first_contact if log else None
        self._contact_m = (contact.x_m, contact.y_m) if contact else None
        planned = {p.vehicle_number: p for p in hypothesis.participants} if hypothesis else {}
        driven = {v.number: v for v in log.vehicles} if log else {}
        self._planned: list[tuple[str, FloatArray]] = []
        self._driven: list[tuple[str, FloatArray]] = []
        self._bodies: list[_Body] = []
        for index, number in enumerate(sorted(planned.keys() | driven.keys())):
            colour = vehicle_colour(index)
            if hypothesis and (participant := planned.get(number)):
                path = participant.trajectory
                before = path.time_s <= hypothesis.impact_time_s
                self._planned.append((colour, np.column_stack([path.x_m, path.y_m])[before]))
                size = participant.length_m, participant.width_m
                self._bodies.append(_Body(participant.initial_pose, *size, colour, 0.0))
                if contact is None:
                    self._bodies.append(_Body(participant.impact_pose, *size, colour, _ALPHA))
            if log and (vehicle := driven.get(number)):
                size = log.bodies[number].length_m, log.bodies[number].width_m
                self._driven.append((colour, np.column_stack([vehicle.x_m, vehicle.y_m])))
                self._bodies.append(_Body(_last_pose(vehicle), *size, colour, _AT_REST_ALPHA))
                if contact and number in (contact.number_1, contact.number_2):
                    pose = contact.pose_1 if number == contact.number_1 else contact.pose_2
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
        strokes = [stroke for body in self._bodies for stroke in _fronts(body)]
        panel.add(
            LineCollection(
                [line for line, _, _ in strokes],
                colors=[colour for _, colour, _ in strokes],
                linewidths=[width for _, _, width in strokes],
                zorder=31,
            )
        )
        if self._contact_m:
            x, y = self._contact_m
            star = Line2D([x], [y], marker="*", ms=13, color=CONTACT_COLOUR, mec="white", mew=0.7, zorder=40)
            panel.add(star)


def _fronts(body: _Body) -> Iterator[tuple[FloatArray, str, float]]:
    """What shows where a body's front is, its windscreen and a stroke ahead: line, colour, width (points)."""
    screen, half, front = 0.22 * body.length_m, 0.42 * body.width_m, 0.5 * body.length_m
    yield body.pose.to_world(np.array([[screen, half], [screen, -half]])), "white" if body.alpha else body.colour, 1.6
    yield body.pose.to_world(np.array([[front, 0.0], [front + _NOSE_M, 0.0]])), body.colour, 1.2


def _last_pose(vehicle: VehicleLog) -> Pose:
    return Pose(float(vehicle.x_m[-1]), float(vehicle.y_m[-1]), float(vehicle.heading_rad[-1]))


def draw_reported_point(panel: Panel, report: MapReport) -> None:
    """Where the report says it happened, and where that was placed on the road if elsewhere."""
    from matplotlib.lines import Line2D

    x, y = report.placement.x_m, report.placement.y_m
    panel.add(Line2D([0.0], [0.0], marker="+", ms=15, mew=2.4, color=REPORTED_COLOUR, zorder=41))
    if math.hypot(x, y) > 0.5:
        panel.add(Line2D([0.0, x], [0.0, y], color=REPORTED_COLOUR, lw=0.9, ls=":", zorder=39))
        panel.add(Line2D([x], [y], marker="x", ms=8, mew=1.6, color=REPORTED_COLOUR, zorder=41))
