"""Vehicles by class: a body with the simulated profile of its front, glass, lamps and wheels.

Axes: x ahead, y left, z up from the road, the origin in the middle of the length. Outside dimensions are those of the
log's body; details within (belt, windows, cargo box) are typical of the class and only for display.

Motorcycles with their riders, bicycles and other mounts stay within the body's dimensions. The axes of a bicycle start
in the middle between its hubs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.crash.record import VehicleClass
from trace_dag.pages.solid.gltf import Material
from trace_dag.pages.solid.shapes import Mesh, across, ball, bar, box, cylinder, join_shapes, loft
from trace_dag.simulation.fronts import driver_eye_m, profile
from trace_dag.simulation.types import Body

GLASS: Final = Material("#20262C", roughness=0.25)
TYRE: Final = Material("#17181A")
_RIM: Final = Material("#A9AEB3", roughness=0.4)
_TRIM: Final = Material("#2B2E32")
_CARGO: Final = Material("#D9DADB")
_HEADLAMP: Final = Material("#FFF6DD", glows=True)
_TAIL_LAMP: Final = Material("#6E1116")
BRAKE_LAMP: Final = Material("#FF2A1A", glows=True)
_SEMITRAILER_FROM_M: Final = 9.0
_STATION_M: Final = 0.22  # spacing of a body's rings: close enough for a dent to be visible

Parts = list[tuple[Material, Mesh]]
_DRAWN_M: Final = 2.2  # length of the motorcycle as it is drawn; others are as much larger or smaller
_METAL: Final = Material("#4A4E54", roughness=0.5)
_LEATHER: Final = Material("#26282C")
_HELMET: Final = Material("#E8E8E8", roughness=0.4)
_DENIM: Final = Material("#39465C")


@dataclass(frozen=True)
class Wheel:
    """A wheel: the position of its middle, its radius (m) and whether it is steered."""

    at_m: tuple[float, float, float]
    radius_m: float
    width_m: float
    steered: bool


@dataclass(frozen=True, eq=False)
class VehicleShape:
    """A vehicle: its rigid and its dentable parts, its lit brake lamps, and its wheels.

    ``eye_m`` is the position of the driver's eyes.
    """

    parts: Parts
    brake_lamps: Mesh
    wheels: tuple[Wheel, ...]
    eye_m: tuple[float, float, float]


@dataclass(frozen=True)
class _Plan:
    """The shape of a class behind its front; lengths as shares of the body's, from its tail (0) to its nose (1)."""

    roof_to: float  # where the roof ends
    rear_to: float  # where the rear window has come down
    deck: float  # height of what is behind, as a share of the belt's
    wheel_m: float  # radius
    axles: tuple[float, ...]
    box_to: float = 0.0  # a cargo box from the tail up to here


_PLANS: Final = {
    VehicleClass.CAR: _Plan(0.27, 0.13, 1.0, 0.32, (0.20, 0.80)),
    VehicleClass.SUV: _Plan(0.08, 0.01, 1.0, 0.37, (0.20, 0.80)),
    VehicleClass.PICKUP: _Plan(0.43, 0.41, 0.92, 0.39, (0.21, 0.80)),
    VehicleClass.VAN: _Plan(0.03, 0.005, 1.0, 0.35, (0.20, 0.81)),
    VehicleClass.LIGHT_TRUCK: _Plan(0.60, 0.595, 0.6, 0.40, (0.22, 0.82), 0.57),
    VehicleClass.TRUCK: _Plan(0.68, 0.675, 0.5, 0.50, (0.20, 0.84), 0.65),
    VehicleClass.TRACTOR_TRAILER: _Plan(0.46, 0.455, 0.42, 0.51, (0.035, 0.215, 0.825)),
    VehicleClass.BUS: _Plan(0.0, 0.0, 1.0, 0.48, (0.27, 0.80)),
    VehicleClass.OTHER: _Plan(0.55, 0.545, 0.6, 0.42, (0.22, 0.80), 0.52),
}


@lru_cache(maxsize=64)  # crashes have the same few vehicles
def vehicle_shape(body: Body, colour: str) -> VehicleShape:
    """Return a vehicle of that class and size, in one colour of paint.

    Motorcycles come from :func:`trace_dag.pages.solid.vehicle_shapes.motorcycle_shape`.

    >>> len(vehicle_shape(log.bodies[1], "#E69F00").wheels)
    4
    """
    if body.is_trailer:
        return _trailer_shape(body, colour)
    plan = _PLANS[body.vehicle_class]
    paint = Material(colour, roughness=0.45)
    (nose, low), (_, bumper), (edge_at, edge), (cowl_at, cowl), (roof_at, roof) = profile(body)
    length, half = body.length_m, body.width_m / 2
    tail = -length / 2
    belt = min(cowl, roof - 0.25)
    if body.vehicle_class is VehicleClass.BUS:
        belt = 0.42 * roof
    roof_to, rear_to = tail + plan.roof_to * length, tail + plan.rear_to * length
    deck = plan.deck * belt if plan.rear_to > 0.05 else belt

    # The lower body, seen from the side: from the tail over the deck and the belt down the hood to the bumper.
    side = np.array(
        [(tail, deck * 0.94), (tail + 0.06, deck), (rear_to - 0.01, deck), (max(rear_to, tail + 0.07), belt),
         (min(cowl_at, edge_at - 0.05), belt), (edge_at, min(edge, belt)), (nose - 0.02, bumper), (nose, bumper * 0.9)]
    )  # fmt: skip
    parts: Parts = [(paint, _tub(side, low, half))]
    parts.append((GLASS, _cabin(rear_to, roof_to, min(roof_at, nose - 0.05), cowl_at, belt, roof - 0.05, half)))
    parts.append((paint, _roof(roof_to, roof_at, roof, half, rear_to, cowl_at, belt)))
    if plan.box_to:
        cargo = box((tail, -half, 0.32 * roof), (tail + plan.box_to * length, half, roof))
        parts.append((_CARGO, _subdivided(cargo)))
    lamps, trim = _lamps(body, nose, tail, bumper, deck, half)
    parts += lamps
    parts.append((_TRIM, trim))
    brake = join_shapes(
        box((tail - 0.02, s * 0.80 * half - 0.13, 0.70 * deck), (tail + 0.03, s * 0.80 * half + 0.13, 0.84 * deck))
        for s in (-1, 1)
    )
    return VehicleShape(parts, brake, _wheels(body, plan), driver_eye_m(body))


def _trailer_shape(body: Body, colour: str) -> VehicleShape:
    """Return a box on wheels: with landing gear if it is as long as a semitrailer, else with a drawbar."""
    length, half, top = body.length_m, body.width_m / 2, body.height_m
    nose, tail = length / 2, -length / 2
    semi = length > _SEMITRAILER_FROM_M
    axles = (0.13, 0.21) if semi else (0.34, 0.50)
    floor = 1.15 if semi else min(0.55, 0.4 * top)
    paint, low = Material(colour, roughness=0.45), 0.08
    parts: Parts = [
        (_CARGO, _subdivided(box((tail, -half, floor), (nose, half, top)))),
        (paint, box((tail + 0.01, -half - 0.01, floor - 0.02), (nose - 0.01, half + 0.01, floor + low))),
    ]
    if semi:
        legs = [box((nose - 3.1, s * 0.6 - 0.08, 0.35), (nose - 2.9, s * 0.6 + 0.08, floor)) for s in (-1, 1)]
        guard = box((tail + 0.02, -0.8 * half, 0.5), (tail + 0.12, 0.8 * half, 0.62))  # 49 CFR 571.223
        beams = box((tail + 0.3, -0.5, 0.75), (tail + 0.3 * length, 0.5, floor))
        parts.append((_TRIM, join_shapes([*legs, guard, beams])))
    else:
        parts.append((_TRIM, box((nose, -0.06, floor - 0.12), (nose + 1.2, 0.06, floor))))
    lamps = [(s * 0.8 * half - 0.1, s * 0.8 * half + 0.1) for s in (-1, 1)]
    brake = join_shapes(box((tail - 0.02, right, floor), (tail + 0.02, left, floor + 0.1)) for right, left in lamps)
    plan = _Plan(0.0, 0.0, 1.0, 0.51 if semi else min(0.37, 0.2 * top), axles)
    return VehicleShape(parts, brake, _wheels(body, plan, steered=False), (nose, 0.0, top))


def _wheels(body: Body, plan: _Plan, *, steered: bool = True) -> tuple[Wheel, ...]:
    radius = min(plan.wheel_m, 0.3 * body.height_m)
    width = 0.62 * radius
    made = []
    for axle in plan.axles:
        x = -body.length_m / 2 + axle * body.length_m
        for s in (-1.0, 1.0):
            y = s * (body.width_m / 2 - width / 2 + 0.02)
            made.append(Wheel((x, y, radius), radius, width, steered=steered and axle == plan.axles[-1]))
    return tuple(made)


@lru_cache(maxsize=64)  # crashes have the same few vehicles
def wheel_parts(radius_m: float, width_m: float) -> Parts:
    """Return a wheel about the axis to its left: tyre, and a rim with spokes that show its rotation.

    >>> tyre = wheel_parts(0.3, 0.2)[0][1]
    >>> np.ptp(tyre.points_m, axis=0).round(6).tolist()  # as long and high as twice the radius
    [0.6, 0.2, 0.6]
    """
    tyre = across(cylinder(radius_m, -width_m / 2, width_m / 2, 20))
    face = width_m / 2 + 0.006
    spoke = box((-0.62 * radius_m, -face, -0.09 * radius_m), (0.62 * radius_m, face, 0.09 * radius_m))
    rims = [across(cylinder(0.24 * radius_m, -face - 0.004, face + 0.004, 10))]
    for angle in np.arange(3) * np.pi / 3:
        c, s = np.cos(angle), np.sin(angle)
        rims.append(spoke.turned(np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])))
    return [(TYRE, tyre), (_RIM, join_shapes(rims))]


def _tub(side: FloatArray, low: float, half: float) -> Mesh:
    """Return the lower body below a side view, shape (n, 2) of (x, top).

    It is rounded at its edges, and at both ends seen from above.
    """
    tail, nose = side[0, 0], side[-1, 0]
    stations = np.unique(np.concatenate([np.arange(tail, nose, _STATION_M), side[:, 0]]).round(4))
    top = np.interp(stations, side[:, 0], side[:, 1])
    from_end = np.minimum(stations - tail, nose - stations)
    half_here = half * (1.0 - 0.10 * np.clip(1.0 - from_end / 0.35, 0.0, 1.0) ** 2)
    return loft(stations, np.stack([_ring(y, low, z) for y, z in zip(half_here, top, strict=True)]))


def _ring(half: float, low: float, top: float) -> FloatArray:
    """Return a section seen from the front, y to its left, counter-clockwise, with slightly convex flanks."""
    z = np.array([0.0, 0.12, 0.45, 0.72, 0.93, 1.0]) * (top - low) + low
    y = np.array([0.90, 0.97, 1.0, 1.0, 0.97, 0.90]) * half
    middle = np.linspace(-0.9, 0.9, 5)[1:-1] * half  # so that ends and hoods can be dented in their middle
    right = np.column_stack([-y, z])
    left = np.column_stack([y, z])
    above = np.column_stack([middle[::-1], np.full(3, top + 0.012)])
    below = np.column_stack([middle, np.full(3, low)])
    return np.concatenate([right[:1], below, left, above, right[:0:-1]])


def _cabin(rear: float, roof_from: float, roof_to: float, front: float, belt: float, roof: float, half: float) -> Mesh:
    """Return the windows, from the belt line up to the narrower roof."""
    roof_from = min(roof_from, roof_to - 0.2)
    stations = np.unique(np.concatenate([np.linspace(rear, front, 12), [roof_from, roof_to]]).clip(rear, front))
    xs, zs = [rear, roof_from, roof_to, front], [belt, roof, roof, belt]
    if front - roof_to < 0.02:
        xs, zs = [rear, roof_from, front - 0.02, front], [belt, roof, roof, belt]
    top = np.interp(stations, xs, zs)
    rings = []
    for z in top:
        share = (z - belt) / max(roof - belt, 1e-6)
        low_y, top_y = 0.93 * half, (0.93 - 0.17 * share) * half
        z = max(z, belt + 0.01)
        rings.append([(-low_y, belt - 0.02), (low_y, belt - 0.02), (top_y, z), (-top_y, z)])
    return loft(stations, np.array(rings))


def _roof(begin: float, end: float, top: float, half: float, rear: float, front: float, belt: float) -> Mesh:
    """Return the roof and the pillars that carry it."""
    begin = min(begin, end - 0.2)
    y, low_y = 0.775 * half, 0.94 * half
    stations = np.linspace(begin - 0.03, end + 0.03, 6)
    ring = np.array(
        [(-y, top - 0.08), (y, top - 0.08), (y, top - 0.02), (0.9 * y, top), (-0.9 * y, top), (-y, top - 0.02)]
    )
    made = [loft(stations, np.repeat(ring[None], 6, axis=0))]
    posts = [(rear, begin), (front, end)]
    middle = (begin + end) / 2
    if end - begin > 1.2:
        posts.append((middle, middle))
    if end - begin > 3.5:
        posts += [(at, at) for at in np.arange(begin + 1.4, end - 1.0, 1.4)]
    for below, above in posts:
        for s in (-1.0, 1.0):
            made.append(_post((below, s * low_y, belt - 0.02), (above, s * y, top - 0.04)))
    return join_shapes(made)


def _post(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """Return a pillar: a leaning bar of rectangular section."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    a, b = 0.05, 0.025
    bottom = [(x0 - a, y0 - b, z0), (x0 + a, y0 - b, z0), (x0 + a, y0 + b, z0), (x0 - a, y0 + b, z0)]
    upper = [(x1 - a, y1 - b, z1), (x1 + a, y1 - b, z1), (x1 + a, y1 + b, z1), (x1 - a, y1 + b, z1)]
    n = np.arange(4)
    m = (n + 1) % 4
    return Mesh(np.array(bottom + upper), np.concatenate([np.stack([n, m, m + 4], 1), np.stack([n, m + 4, n + 4], 1)]))


def _lamps(body: Body, nose: float, tail: float, bumper: float, deck: float, half: float) -> tuple[Parts, Mesh]:
    """Return the head and tail lamps, and the dark parts: bumpers and number plates."""

    def pair(x0: float, x1: float, z0: float, z1: float, width: float) -> Mesh:
        return join_shapes(box((x0, s * 0.70 * half - width, z0), (x1, s * 0.70 * half + width, z1)) for s in (-1, 1))

    head = pair(nose - 0.10, nose - 0.005, 0.84 * bumper, 1.02 * bumper, 0.17 * half)
    rear = pair(tail - 0.012, tail + 0.05, 0.68 * deck, 0.86 * deck, 0.20 * half)
    trim = join_shapes(
        [
            box((nose - 0.05, -0.45 * half, 0.55 * bumper), (nose + 0.012, 0.45 * half, 0.80 * bumper)),
            box((tail - 0.012, -0.8 * half, 0.36 * deck), (tail + 0.05, 0.8 * half, 0.50 * deck)),
        ]
    )
    return [(_HEADLAMP, head), (_TAIL_LAMP, rear)], trim


def _subdivided(mesh: Mesh, longest_m: float = 0.6) -> Mesh:
    """Return triangles halved along their longest edges until none is longer, so that large faces can be dented."""
    points, triangles = mesh
    for _ in range(12):
        corners = points[triangles]
        lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = lengths.max(axis=1) > longest_m
        if not long.any():
            break
        split, rest = triangles[long], triangles[~long]
        k = lengths[long].argmax(axis=1)
        rows = np.arange(len(split))
        a, b, c = split[rows, k], split[rows, (k + 1) % 3], split[rows, (k + 2) % 3]
        pairs, numbers = np.unique(np.sort(np.stack([a, b], 1), axis=1), axis=0, return_inverse=True)
        middle = len(points) + numbers.reshape(-1)
        points = np.concatenate([points, points[pairs].mean(axis=1)])
        triangles = np.concatenate([rest, np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return Mesh(points, triangles)


# --- two-wheelers ----------------------------------------------------------------------------------------------------
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
