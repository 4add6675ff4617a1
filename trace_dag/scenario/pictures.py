"""The picture of a crash: the road with its lanes, the paths, the bodies at contact and at rest, the reported point.

Two views of the same thing side by side: the approach (everything from the start of the reconstruction on) and the
impact (close up). What is not known yet is left out, so a picture can be drawn after any stage from ``road_map`` on.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from trace_dag.crash.record import CrashRecord
from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.scenario.maps import draw_network
from trace_dag.sim.types import SimulationLog, VehicleLog
from trace_dag.states.types import Hypothesis, StateEstimate
from trace_dag.units import mps_to_mph
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette: told apart with every common kind of colour vision. Vehicle 1 is blue, vehicle 2 vermilion.
VEHICLE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#F0E442", "#56B4E9")
REPORTED_COLOUR = "#000000"
CONTACT_COLOUR = "#B00020"

_IMPACT_HALF_WINDOW_M = 16.0
_APPROACH_MARGIN_M = 20.0
_LEAST_APPROACH_HALF_WINDOW_M = 45.0

_FIGURE_SIZE_IN = (13.0, 7.2)
_PANELS = ((0.03, 0.04, 0.46, 0.8306), (0.53, 0.04, 0.46, 0.8306))
"""Left, bottom, width and height of the two square panels, as shares; a layout engine takes a third of the drawing."""


def draw_crash(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate | None = None,
    log: SimulationLog | None = None,
    verdict: Verdict | None = None,
    *,
    dpi: int = 90,
) -> bytes:
    """The picture as PNG. ``log`` is of the hypothesis that ``verdict`` names (else of the estimate's best)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    hypothesis = _shown_hypothesis(estimate, verdict)
    figure = Figure(figsize=_FIGURE_SIZE_IN, dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    approach, impact = (figure.add_axes(panel) for panel in _PANELS)
    centre, half_window_m = _approach_window(hypothesis, log)
    for axes, (x_m, y_m), half_m in (
        (approach, centre, half_window_m),
        (impact, _impact_centre(hypothesis, log), _IMPACT_HALF_WINDOW_M),
    ):
        draw_network(axes, network, window_m=(x_m - half_m, y_m - half_m, x_m + half_m, y_m + half_m))
        _draw_motion(axes, hypothesis, log)
        _draw_reported_point(axes, report)
        axes.set_xlim(x_m - half_m, x_m + half_m)
        axes.set_ylim(y_m - half_m, y_m + half_m)
        axes.set_aspect("equal")
        axes.tick_params(labelsize=7)
    approach.set_title("Approach (m east and north of the reported point)", fontsize=9)
    impact.set_title("Impact", fontsize=9)
    impact.legend(
        handles=_legend(record, hypothesis, log), loc="upper right", fontsize=7, framealpha=0.92, borderpad=0.6
    ).set_zorder(50)
    figure.suptitle(_headline(record, verdict), fontsize=11, x=0.01, y=0.99, ha="left")
    stream = io.BytesIO()
    canvas.print_png(stream)  # type: ignore[no-untyped-call]
    return stream.getvalue()


def _shown_hypothesis(estimate: StateEstimate | None, verdict: Verdict | None) -> Hypothesis | None:
    if estimate is None:
        return None
    return estimate.hypotheses[verdict.hypothesis] if verdict else estimate.best


def _approach_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> tuple[tuple[float, float], float]:
    """Centre and half side (m) of a square that holds the reported point, all starts and all places of rest."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    if hypothesis:
        points += [(p.initial_pose.x_m, p.initial_pose.y_m) for p in hypothesis.participants]
    if log:
        for vehicle in log.vehicles:
            points += [(float(vehicle.x_m[i]), float(vehicle.y_m[i])) for i in (0, -1)]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    half_m = float(np.max(high - low)) / 2 + _APPROACH_MARGIN_M
    middle = (low + high) / 2
    return (float(middle[0]), float(middle[1])), max(half_m, _LEAST_APPROACH_HALF_WINDOW_M)


def _impact_centre(hypothesis: Hypothesis | None, log: SimulationLog | None) -> tuple[float, float]:
    if log and log.first_contact:
        return log.first_contact.x_m, log.first_contact.y_m
    return hypothesis.impact_point_xy_m if hypothesis else (0.0, 0.0)


def _draw_motion(axes: Axes, hypothesis: Hypothesis | None, log: SimulationLog | None) -> None:
    contact = log.first_contact if log else None
    planned = {p.vehicle_number: p for p in hypothesis.participants} if hypothesis else {}
    driven = {v.number: v for v in log.vehicles} if log else {}
    for index, number in enumerate(sorted(planned.keys() | driven.keys())):
        colour = VEHICLE_COLOURS[index % len(VEHICLE_COLOURS)]
        if participant := planned.get(number):
            before = participant.trajectory.time_s <= (hypothesis.impact_time_s if hypothesis else 0.0)
            axes.plot(
                participant.trajectory.x_m[before],
                participant.trajectory.y_m[before],
                color=colour,
                lw=1.0,
                ls=(0, (4, 3)),
                zorder=20,
            )
            size = participant.length_m, participant.width_m
            _draw_body(axes, participant.initial_pose, *size, colour, filled=False)
            if contact is None:
                _draw_body(axes, participant.impact_pose, *size, colour)
        if log and (vehicle := driven.get(number)):
            body = log.bodies[number]
            size = body.length_m, body.width_m
            axes.plot(vehicle.x_m, vehicle.y_m, color=colour, lw=1.6, alpha=0.9, zorder=21)
            _draw_body(axes, _pose_at(vehicle, -1), *size, colour, alpha=0.35)
            if contact and number in (contact.number_1, contact.number_2):
                pose = contact.pose_1 if number == contact.number_1 else contact.pose_2
                _draw_body(axes, pose, *size, colour)
    if contact:
        axes.plot(contact.x_m, contact.y_m, marker="*", ms=13, color=CONTACT_COLOUR, mec="white", mew=0.7, zorder=40)


def _pose_at(vehicle: VehicleLog, index: int) -> Pose:
    return Pose(float(vehicle.x_m[index]), float(vehicle.y_m[index]), float(vehicle.heading_rad[index]))


def _draw_body(
    axes: Axes,
    pose: Pose,
    length_m: float,
    width_m: float,
    colour: str,
    *,
    alpha: float = 0.85,
    filled: bool = True,
) -> None:
    """A body from above; the light bar marks its front."""
    from matplotlib.patches import Polygon

    face = (*_rgb(colour), alpha) if filled else "none"
    corners = rectangle_corners(pose, length_m, width_m)
    axes.add_patch(Polygon(corners, closed=True, facecolor=face, edgecolor=colour, lw=1.2, zorder=30))
    windscreen: FloatArray = pose.to_world(
        np.array([[0.22 * length_m, 0.42 * width_m], [0.22 * length_m, -0.42 * width_m]])
    )
    axes.plot(windscreen[:, 0], windscreen[:, 1], color="white" if filled else colour, lw=1.6, zorder=31)
    nose = pose.to_world(np.array([[0.5 * length_m, 0.0], [0.5 * length_m + 1.2, 0.0]]))
    axes.plot(nose[:, 0], nose[:, 1], color=colour, lw=1.2, zorder=31)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _draw_reported_point(axes: Axes, report: MapReport) -> None:
    axes.plot(0.0, 0.0, marker="+", ms=15, mew=2.4, color=REPORTED_COLOUR, zorder=41)
    placement = report.placement
    if math.hypot(placement.x_m, placement.y_m) > 0.5:
        axes.plot([0.0, placement.x_m], [0.0, placement.y_m], color=REPORTED_COLOUR, lw=0.9, ls=":", zorder=39)
        axes.plot(placement.x_m, placement.y_m, marker="x", ms=8, mew=1.6, color=REPORTED_COLOUR, zorder=41)


def _legend(record: CrashRecord, hypothesis: Hypothesis | None, log: SimulationLog | None) -> Sequence[object]:
    from matplotlib.lines import Line2D

    planned = {p.vehicle_number: p for p in hypothesis.participants} if hypothesis else {}
    handles: list[Line2D] = []
    for index, number in enumerate(sorted(planned)):
        participant = planned[number]
        reported = next((v.travel_speed_mps for v in record.vehicles if v.number == number), None)
        speed = f"{mps_to_mph(participant.initial_speed_mps):.0f} mph" + (
            " as reported" if reported is not None else " inferred"
        )
        words = [participant.vehicle_class.replace("_", " "), participant.manoeuvre.replace("_", " "), speed]
        label = f"V{number} " + ", ".join(words)
        handles.append(Line2D([], [], color=VEHICLE_COLOURS[index % len(VEHICLE_COLOURS)], lw=5, label=label))
    if planned:
        handles.append(Line2D([], [], color="#555555", lw=1, ls=(0, (4, 3)), label="planned path"))
    if log:
        handles.append(Line2D([], [], color="#555555", lw=1.6, label="driven path, pale body at rest"))
    if log and log.first_contact:
        handles.append(Line2D([], [], color=CONTACT_COLOUR, marker="*", ms=11, ls="", label="first contact"))
    handles.append(Line2D([], [], color=REPORTED_COLOUR, marker="+", ms=10, mew=2, ls="", label="reported point"))
    return handles


def _headline(record: CrashRecord, verdict: Verdict | None) -> str:
    place = ", ".join(
        filter(None, (" / ".join(filter(None, (record.trafficway_1, record.trafficway_2))), record.state_name))
    )
    classes = ", ".join(
        value.replace("_", " ") for value in (record.collision_type, record.road_topology, record.vehicle_trajectory)
    )
    lines = [f"{record.key}   {place}   ({classes})"]
    if verdict:
        outcome = "verified" if verdict.accepted else f"not verified: {verdict.reason}"
        lines.append(f"{outcome}   {verdict.detail}")
    return "\n".join(lines)
