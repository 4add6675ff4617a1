"""Motorcycles with their riders, bicycles and other mounts, drawn within the body's dimensions.

Axes: x ahead, y left, z up, metres; for a motorcycle and a conveyance from the road, for a bicycle from the middle
between its hubs.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from trace_dag.pages.solid.gltf import Material
from trace_dag.pages.solid.shapes import Mesh, across, ball, bar, box, cylinder, join_shapes
from trace_dag.pages.solid.vehicle_shapes import TYRE, Parts, VehicleShape, Wheel
from trace_dag.simulation.fronts import driver_eye_m
from trace_dag.simulation.types import Body

_DRAWN_M: Final = 2.2  # length of the motorcycle as it is drawn; others are as much larger or smaller
_METAL: Final = Material("#4A4E54", roughness=0.5)
_LEATHER: Final = Material("#26282C")
_HELMET: Final = Material("#E8E8E8", roughness=0.4)
_DENIM: Final = Material("#39465C")


@lru_cache(maxsize=64)  # crashes have the same few vehicles
def motorcycle_shape(body: Body, colour: str) -> VehicleShape:
    """Return a motorcycle and its rider, who stays on it, since the log has one body for both.

    >>> len(motorcycle_shape(log.bodies[2], "#56B4E9").wheels)
    2
    """
    size = body.length_m / _DRAWN_M
    radius, hub = 0.31, _DRAWN_M / 2 - 0.31
    sides = (-1.0, 1.0)
    tank = ball(0.20).turned(np.diag([1.5, 0.8, 0.8])).moved((0.12, 0.0, 0.78))
    tail = box((-0.85, -0.12, 0.68), (-0.15, 0.12, 0.78))
    guard = box((0.62, -0.07, 0.60), (0.95, 0.07, 0.66))
    engine = box((-0.30, -0.17, 0.28), (0.30, 0.17, 0.62))
    fork = [bar((0.42, s * 0.10, 0.98), (hub, s * 0.10, radius), 0.03) for s in sides]
    handles = bar((0.40, -0.38, 1.02), (0.40, 0.38, 1.02), 0.02)
    swing = [bar((-0.2, s * 0.11, 0.38), (-hub, s * 0.11, radius), 0.03) for s in sides]
    torso = bar((-0.32, 0.0, 0.92), (0.0, 0.0, 1.34), 0.17, 9)
    arms = [bar((0.0, s * 0.20, 1.32), (0.38, s * 0.34, 1.05), 0.055) for s in sides]
    thighs = [bar((-0.32, s * 0.12, 0.86), (0.12, s * 0.24, 0.72), 0.08) for s in sides]
    shins = [bar((0.12, s * 0.24, 0.72), (-0.05, s * 0.22, 0.30), 0.06) for s in sides]
    parts: Parts = [
        (Material(colour, roughness=0.45), join_shapes([tank, tail, guard])),
        (_METAL, join_shapes([engine, *fork, handles, *swing])),
        (Material("#FFF6DD", glows=True), ball(0.09).moved((0.58, 0.0, 0.92))),
        (_LEATHER, join_shapes([torso, *arms])),
        (_DENIM, join_shapes([*thighs, *shins])),
        (_HELMET, ball(0.145).moved((0.06, 0.0, 1.52))),
    ]
    wheels = [Wheel((s * hub * size, 0.0, radius * size), radius * size, 0.13 * size, s > 0) for s in (1.0, -1.0)]
    brake = box((-0.88, -0.08, 0.68), (-0.84, 0.08, 0.78))
    sized = [(each, _sized(mesh, size)) for each, mesh in parts]
    return VehicleShape(sized, _sized(brake, size), tuple(wheels), driver_eye_m(body))


def _sized(mesh: Mesh, size: float) -> Mesh:
    return Mesh(mesh.points_m * size, mesh.triangles)


def bicycle_parts(hubs_m: float, top_m: tuple[float, float]) -> tuple[Parts, float]:
    """Return a bicycle without its wheels, and the radius of the wheels.

    ``hubs_m`` is the distance between the hubs; ``top_m`` the middle of the handlebar, ahead of and above the middle
    between the hubs.

    >>> parts, wheel_m = bicycle_parts(1.04, (0.35, 0.65))
    >>> wheel_m  # 28 inches across
    0.34
    """
    size = hubs_m / 1.04
    front, rear = (hubs_m / 2, 0.0), (-hubs_m / 2, 0.0)
    crank, saddle, neck = (-0.10 * size, -0.02), (-0.25 * size, 0.52 * size), (0.34 * size, 0.48 * size)

    def tube(a: tuple[float, float], b: tuple[float, float], radius: float = 0.018) -> Mesh:
        return bar((a[0], 0.0, a[1]), (b[0], 0.0, b[1]), radius)

    frame = [tube(rear, crank), tube(crank, saddle), tube(crank, neck), tube(saddle, neck), tube(rear, saddle)]
    frame += [tube(neck, front), tube(neck, top_m)]
    frame.append(bar((top_m[0], -0.26, top_m[1]), (top_m[0], 0.26, top_m[1]), 0.016))
    seat = box((saddle[0] - 0.12, -0.07, saddle[1]), (saddle[0] + 0.12, 0.07, saddle[1] + 0.05))
    return [(_METAL, join_shapes(frame)), (_LEATHER, seat)], 0.34 * size


def bicycle_wheel_parts(radius_m: float) -> Parts:
    """Return a wheel of a bicycle: a thin ring and some spokes.

    >>> round(max(float(mesh.points_m[:, 2].max()) for _, mesh in bicycle_wheel_parts(0.34)), 2)
    0.34
    """
    angles = np.arange(16) * np.pi / 8
    rim = np.column_stack([np.cos(angles), 0 * angles, np.sin(angles)]) * (radius_m - 0.02)
    ring = join_shapes(bar(a, b, 0.02, 5) for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True))
    spokes = join_shapes(bar(a, b, 0.005, 4) for a, b in zip(rim[:8:2], rim[8::2], strict=True))
    return [(TYRE, ring), (_METAL, spokes)]


def conveyance_parts(length_m: float) -> Parts:
    """Return a deck on small wheels, about the middle of the deck.

    >>> deck = conveyance_parts(0.8)[0][1]
    >>> float(np.ptp(deck.points_m[:, 0]))
    0.8
    """
    deck = box((-length_m / 2, -0.10, -0.02), (length_m / 2, 0.10, 0.03))
    wheels = join_shapes(
        across(cylinder(0.04, s * 0.08 - 0.02, s * 0.08 + 0.02, 8)).moved((x * length_m, 0.0, -0.04))
        for x in (-0.38, 0.38)
        for s in (-1.0, 1.0)
    )
    return [(_LEATHER, deck), (TYRE, wheels)]
