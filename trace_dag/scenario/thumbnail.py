"""A crash as a small moving picture: an SVG of a few kB that plays in a loop wherever images are shown.

It shows the seconds around the first contact, or the overturn, from above: roads as strokes of their width, bodies as
boxes and discs, and what OpenStreetMap has beside the roads. Units: metres, y downward as in SVG.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from trace_dag.geometry import FloatArray
from trace_dag.osm.types import OsmFeature
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.colours import OBJECT_COLOUR, body_colour
from trace_dag.scenario.object_shapes import outline
from trace_dag.scenario.scenery import Scenery
from trace_dag.scenario.sketch import path_data, road_strokes
from trace_dag.sim.types import Body, Moment, SimulationLog, VehicleLog, moment_of

_HALF_WIDTH_M, _HALF_HEIGHT_M = 32, 20
_BEFORE_S, _AFTER_S, _HELD_S = 2.5, 2.0, 1.0
_STEP_S = 0.1
_SIMPLIFIED_BY_M = 0.4
_PERSON_RADIUS_M = 1.1  # drawn larger than to scale, to be visible


def moving_thumbnail(network: RoadNetwork, log: SimulationLog, surroundings: Sequence[OsmFeature] = ()) -> str:
    """The SVG of a crash; ``surroundings`` lie behind the roads.

    Raises ValueError if there was neither a contact nor an overturn: there is no moment to show.

    >>> moving_thumbnail(network, log)[:4]
    '<svg'
    """
    moment = moment_of(log)
    if moment is None:
        raise ValueError("a log without a contact or an overturn has no moment to show")
    time_s = np.arange(moment.time_s - _BEFORE_S, moment.time_s + _AFTER_S, _STEP_S)
    centre = _centre(log, moment, float(time_s[-1]))
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='-{_HALF_WIDTH_M},-{_HALF_HEIGHT_M},"
        f"{2 * _HALF_WIDTH_M},{2 * _HALF_HEIGHT_M}' width='320' height='200'>"
    ]
    parts += _beside(network, surroundings, centre)
    parts.append("<g fill='none' stroke='#999'>")
    for width_m, line in road_strokes(network, centre):
        parts.append(f"<path d='{path_data([line], _SIMPLIFIED_BY_M, 1)}' stroke-width='{width_m:.1f}'/>")
    parts.append("</g>")
    for item in log.objects:
        parts.append(f"<path d='{path_data([outline(item) - centre], 0.0, 1)}z' fill='{OBJECT_COLOUR}'/>")
    for vehicle in log.vehicles:
        colour = body_colour(vehicle.number, log.bodies)
        parts.append(_moving(vehicle, log.bodies[vehicle.number], colour, time_s, centre))
    return "".join([*parts, "</svg>"])


def _beside(network: RoadNetwork, surroundings: Sequence[OsmFeature], centre: FloatArray) -> list[str]:
    """Surroundings of the roads, cut to the picture; fewer of them on dark pages."""
    x, y = centre.tolist()
    window = (x - _HALF_WIDTH_M, y - _HALF_HEIGHT_M, x + _HALF_WIDTH_M, y + _HALF_HEIGHT_M)
    parts = []
    for colour, width_m, points in Scenery(surroundings, network.frame, window).shapes(window):
        shape = shapely.LineString(points) if width_m else shapely.Polygon(points).buffer(0)
        for cut in shapely.get_parts(shapely.clip_by_rect(shape, *window)):
            if cut.is_empty:
                continue
            line = cut if width_m else cut.exterior
            data = path_data([shapely.get_coordinates(line) - centre], _SIMPLIFIED_BY_M, 0 if not width_m else 1)
            drawn = f"fill='none' stroke='{colour}' stroke-width='{width_m:g}'" if width_m else f"fill='{colour}'"
            parts.append(f"<path d='{data}' {drawn}/>")
    if not parts:
        return []
    dimmed = "<style>@media(prefers-color-scheme:dark){.b{opacity:.3}}</style>"
    return [dimmed, "<g class='b'>", *parts, "</g>"]


def _centre(log: SimulationLog, moment: Moment, end_s: float) -> FloatArray:
    """Halfway between the place of the moment and where those it concerns are in the end, shape (2,)."""
    both = [each for each in log.vehicles if each.number in moment.numbers]
    ends = [[np.interp(end_s, each.time_s, each.x_m), np.interp(end_s, each.time_s, each.y_m)] for each in both]
    return np.asarray((np.array([moment.x_m, moment.y_m]) + np.mean(ends, axis=0)) / 2)


def _moving(vehicle: VehicleLog, body: Body, colour: str, time_s: FloatArray, centre: FloatArray) -> str:
    heading_rad = np.unwrap(vehicle.heading_rad)
    x, y, heading = (np.interp(time_s, vehicle.time_s, each) for each in (vehicle.x_m, vehicle.y_m, heading_rad))
    places = [f"{east:.1f},{-north:.1f}" for east, north in zip(x - centre[0], y - centre[1], strict=True)]
    turns = [f"{-math.degrees(angle):.0f}" for angle in heading]
    if body.is_figure:
        shape = f"<circle r='{_PERSON_RADIUS_M:g}' fill='{colour}' stroke='#000' stroke-width='.2'/>"
    else:
        half_m = body.length_m / 2
        shape = (
            f"<rect x='{-half_m:.2f}' y='{-body.width_m / 2:.2f}' width='{body.length_m:.2f}' "
            f"height='{body.width_m:.2f}' rx='.4' fill='{colour}'/>"
        )
    return f"<g>{_animated('translate', places)}{_animated('rotate', turns)}{shape}</g>"


def _animated(kind: str, values: Sequence[str]) -> str:
    """A transformation through equally spaced values; the last one is held for a while."""
    held = [*values, *[values[-1]] * round(_HELD_S / _STEP_S)]
    return (
        f"<animateTransform attributeName='transform' type='{kind}' additive='sum' values='{';'.join(held)}' "
        f"dur='{len(held) * _STEP_S:g}s' repeatCount='indefinite'/>"
    )
