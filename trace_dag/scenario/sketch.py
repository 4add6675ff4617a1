"""The crash as a few strokes: an SVG small enough to stand in a table, where no picture fits.

Dagster shows Markdown in place only up to 1,000 characters. Within that, percent-encoded, a sketch holds the roads near
the crash as strokes of their width, the driven paths, the bodies at first contact and the reported point; lines are
simplified until it fits. Units: metres, y downward as in SVG.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.colours import body_colour
from trace_dag.scenario.polylines import worth_keeping
from trace_dag.sim.types import SimulationLog, moment_of

MOST_CHARACTERS = 900
_HALF_WINDOW_M = 35
_WIDTH_PX = 320
_TOLERANCES_M = (0.7, 1.5, 3.0, 6.0, 12.0)
_ESCAPES = str.maketrans({'"': "'"} | {sign: f"%{ord(sign):02X}" for sign in "%<># \n&()"})


def draw_sketch(network: RoadNetwork, log: SimulationLog | None = None, *, most: int = MOST_CHARACTERS) -> str:
    """An SVG whose :func:`data_url` has at most ``most`` characters; the farthest roads go first where it must.

    >>> len(data_url(draw_sketch(network, log))) <= MOST_CHARACTERS
    True
    """
    moment = moment_of(log) if log else None
    centre = np.array([moment.x_m, moment.y_m]) if moment else np.zeros(2)
    strokes = road_strokes(network, centre)
    for tolerance_m in _TOLERANCES_M:
        svg = _svg(strokes, log, centre, tolerance_m)
        if len(data_url(svg)) <= most:
            return svg
    while strokes:
        strokes.pop()
        svg = _svg(strokes, log, centre, _TOLERANCES_M[-1])
        if len(data_url(svg)) <= most:
            return svg
    return _svg([], None, centre, _TOLERANCES_M[-1])


def data_url(svg: str) -> str:
    """An SVG as the address of an image, escaped no more than Markdown and browsers ask for.

    >>> data_url('<text x="1">50 %</text>')
    "data:image/svg+xml,%3Ctext%20x='1'%3E50%20%25%3C/text%3E"
    """
    return "data:image/svg+xml," + svg.translate(_ESCAPES)


def road_strokes(network: RoadNetwork, centre: FloatArray) -> list[tuple[float, FloatArray]]:
    """Width (m) and middle line of every drivable road within 35 m of ``centre``, shape (n, 2) from there, the nearest
    first.

    >>> width_m, line = road_strokes(network, np.zeros(2))[0]
    >>> bool(np.abs(line).min() < 35.0)
    True
    """
    found = []
    reach_m = 1.4 * _HALF_WINDOW_M  # to the corners
    for road in network.roads_within((*(centre - reach_m), *(centre + reach_m))):
        for section, lanes in enumerate(road.lane_sections):
            drivable = sorted(lane.id for lane in lanes.lanes if lane.type.drivable)
            if not drivable:
                continue
            refs = [LaneRef(road.id, section, lane) for lane in drivable]
            line = _middle(network, refs) - centre
            near = np.abs(line).max(axis=1) <= reach_m
            if near.any():
                width_m = sum(network.width_m(ref, sum(network.lane_span(ref)) / 2) for ref in refs)
                first, last = np.flatnonzero(near)[[0, -1]]
                piece = line[max(first - 1, 0) : last + 2]
                found.append((float(np.hypot(*piece.T).min()), width_m, piece))
    return [(width_m, line) for _, width_m, line in sorted(found, key=lambda each: each[0])]


def _middle(network: RoadNetwork, refs: Sequence[LaneRef]) -> FloatArray:
    """The line halfway between the outermost drivable lanes of a section, along the road, shape (n, 2)."""
    return np.asarray((network.geometry(refs[0]).search_line + network.geometry(refs[-1]).search_line) / 2)


def _svg(
    strokes: Sequence[tuple[float, FloatArray]], log: SimulationLog | None, centre: FloatArray, by_m: float
) -> str:
    half = _HALF_WINDOW_M
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='-{half},-{half},{2 * half},{2 * half}' width='{_WIDTH_PX}'>",
        "<g fill='none' stroke='#bbb'>",
    ]
    by_width: dict[int, list[FloatArray]] = {}
    for width_m, line in strokes:
        by_width.setdefault(max(3, round(width_m)), []).append(line)
    for width, lines in sorted(by_width.items()):
        parts.append(f"<path d='{path_data(lines, by_m)}' stroke-width='{width}'/>")
    parts.append("</g>")
    parts.extend(_motion(log, centre, by_m) if log else ())
    x, y = (round(float(value)) for value in -centre)
    parts.append(f"<path d='M{x - 2},{-y}h4m-2-2v4' stroke='#000'/></svg>")
    return "".join(parts)


def _motion(log: SimulationLog, centre: FloatArray, by_m: float) -> Iterable[str]:
    for vehicle in log.vehicles:
        colour = body_colour(vehicle.number, log.bodies).lower()
        path = np.stack([vehicle.x_m, vehicle.y_m], axis=1) - centre
        inside = path[np.abs(path).max(axis=1) <= _HALF_WINDOW_M]
        if len(inside) > 1:
            yield f"<path d='{path_data([inside], min(by_m, 3.0))}' fill='none' stroke='{colour}'/>"
        pose = _pose_at_contact(log, vehicle.number)
        if pose is not None:
            body = log.bodies[vehicle.number]
            if body.is_figure:
                x, y = (round(float(value), 1) for value in np.array(pose.xy_m) - centre)
                yield f"<circle cx='{x:g}' cy='{-y + 0.0:g}' r='1' fill='{colour}'/>"
                continue
            corners = rectangle_corners(pose, body.length_m, body.width_m) - centre
            yield f"<path d='{path_data([corners], 0.0, decimals=1)}z' fill='{colour}'/>"


def _pose_at_contact(log: SimulationLog, number: int) -> Pose | None:
    contacts = sorted(log.contacts, key=lambda each: each.time_s)
    return next((pose for each in contacts if (pose := log.pose_at_contact(each, number)) is not None), None)


def path_data(lines: Iterable[FloatArray], by_m: float, decimals: int = 0) -> str:
    """SVG path data, y turned downward, in as few characters as there can be.

    >>> path_data([np.array([[0.0, 0.0], [3.0, 4.0]])], 0.0)  # y downward
    'M0,0,3-4'
    """
    path, lines = "", list(lines)
    if by_m:
        kept = worth_keeping([[line] for line in lines], by_m)
        lines = [line[points] for line, points in zip(lines, kept, strict=True)]
    for points in lines:
        numbers: list[str] = []
        for x, y in points:
            pair = (_number(x, decimals), _number(-y, decimals))
            if tuple(numbers[-2:]) != pair:
                numbers.extend(pair)
        text = numbers[0]
        for number in numbers[1:]:
            text += number if number.startswith("-") else f",{number}"
        path += f"M{text}"
    return path


def _number(value: float, decimals: int) -> str:
    rounded = round(float(value), decimals)
    return f"{rounded:g}" if rounded else "0"
