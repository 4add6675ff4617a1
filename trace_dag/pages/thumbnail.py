"""A crash as a small moving picture: an SVG that plays in a loop wherever images are shown.

It shows the seconds around the first contact, or the overturn, on the same map as the still picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import OsmFeature
from trace_dag.pages.canvas import Canvas
from trace_dag.pages.map_scene import Window
from trace_dag.pages.maps import MapDrawing
from trace_dag.pages.picture_motion import draw_objects
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drawn_shapes import body_colour
from trace_dag.simulation.types import Body, Moment, SimulationLog, VehicleLog, moment_of

_LEAST_M, _MOST_M = 11.0, 26.0  # half the height of what is seen
_WIDER = 1.6  # than high
_MARGIN_M = 4.0
_WIDTH_PT = 320.0
_BEFORE_S, _AFTER_S, _HELD_S = 1.2, 2.0, 1.0
_STEP_S = 0.1
_PERSON_RADIUS_M = 1.1  # drawn larger than to scale, to be visible


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
