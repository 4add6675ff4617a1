"""The parts of a vehicle that strike a person: bumper, leading edge of the hood, hood, windscreen and roof, as boxes.

The shape decides the place of the strike, and so its effect: a front lower than the person's centre of gravity wraps
the person over the hood, a higher one throws the person forward. The dimensions are those of pedestrian research
(bumper lead, height of the hood's leading edge, length and angle of the hood, angle of the windscreen: Mizuno and
Kajzer, SAE 2000-01-0157; Mizuno, Summary of IHRA Pedestrian Safety WG Activities, ESV 2003), with values in the middle
of the published ranges for each class, there and, for vehicles of the United States, in Monfort, Hu and Mueller (IIHS
2023) and Hu, Monfort and Cicchino, Journal of Safety Research 2024: edges of cars below 0.76 m (30 in), of minivans and
most SUVs up to 1.02 m (40 in), of pickups above. Trucks are conventional ones with a hood higher than people's chests;
a bus is flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import Body

_SHELL_M = 0.30  # thickness of the boxes the outer faces are made of: nothing gets through it in a step
_INSIDE_M = 0.06  # the core's faces lie so far behind the outer ones, beyond what bodies press in
_WHEELS_ABOVE_M = 0.35  # vehicles whose body is so high off the road show their wheels to who lies on it
_TYRE_M = 0.5
_EYES_OF_STATURE = 0.936
_HIGHEST_EYES_M = 2.33


@dataclass(frozen=True)
class FrontShape:
    """Side view of a front: heights above the road and lengths in metres, angles from the horizontal."""

    clearance_m: float  # the lower edge of bumper and body
    bumper_m: float  # height of the bumper's top: below it the face is upright
    lead_m: float  # of the bumper ahead of the hood's leading edge
    edge_m: float  # height of the hood's leading edge
    hood_m: float  # length of the hood, along the vehicle
    hood_rad: float
    screen_rad: float


def _shape(
    clearance_m: float, bumper_m: float, lead_m: float, edge_m: float, hood_m: float, hood_deg: float, screen_deg: float
) -> FrontShape:
    return FrontShape(clearance_m, bumper_m, lead_m, edge_m, hood_m, math.radians(hood_deg), math.radians(screen_deg))


_SHAPES: dict[VehicleClass, FrontShape] = {
    VehicleClass.CAR: _shape(0.20, 0.53, 0.13, 0.72, 1.00, 11.0, 30.0),
    VehicleClass.SUV: _shape(0.25, 0.62, 0.14, 0.93, 0.95, 9.0, 38.0),
    VehicleClass.PICKUP: _shape(0.28, 0.72, 0.12, 1.06, 1.10, 5.0, 38.0),
    VehicleClass.VAN: _shape(0.22, 0.60, 0.15, 0.95, 0.65, 17.0, 40.0),
    VehicleClass.LIGHT_TRUCK: _shape(0.30, 0.75, 0.08, 1.25, 0.80, 10.0, 60.0),
    VehicleClass.TRUCK: _shape(0.38, 0.85, 0.08, 1.50, 1.20, 8.0, 65.0),
    VehicleClass.TRACTOR_TRAILER: _shape(0.38, 0.85, 0.08, 1.55, 1.60, 8.0, 65.0),
    VehicleClass.BUS: _shape(0.36, 0.80, 0.03, 2.50, 0.05, 60.0, 85.0),
    VehicleClass.MOTORCYCLE: _shape(0.20, 0.60, 0.20, 0.85, 0.30, 20.0, 55.0),
    VehicleClass.OTHER: _shape(0.25, 0.58, 0.13, 0.85, 0.90, 10.0, 38.0),
    VehicleClass.TRAILER: _shape(0.45, 1.20, 0.02, 1.40, 0.05, 60.0, 88.0),
}


@dataclass(frozen=True)
class ShellBox:
    """A box in the vehicle's own axes, from the middle of its body on the road.

    Centre (ahead, left, up), half sizes (ahead, left, up) and pitch, the angle about the left axis (rad, positive front
    down).
    """

    centre_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    pitch_rad: float = 0.0


def front_shape(body: Body) -> FrontShape:
    """Return the front of a vehicle, scaled down for a body lower or shorter than its class's front.

    >>> from trace_dag.simulation.types import BodyKind
    >>> car = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.8, 1.8, 1.45, 1500.0)
    >>> front_shape(car).edge_m
    0.72
    """
    shape = _SHAPES[body.vehicle_class]
    down = min(1.0, 0.9 * body.height_m / shape.edge_m)
    short = min(1.0, 0.4 * body.length_m / max(shape.hood_m + shape.lead_m, 1e-6))
    return FrontShape(
        shape.clearance_m * down,
        shape.bumper_m * down,
        shape.lead_m * short,
        shape.edge_m * down,
        shape.hood_m * short,
        shape.hood_rad,
        shape.screen_rad,
    )


def profile(body: Body) -> list[tuple[float, float]]:
    """Return the front's side view.

    Points (ahead of the body's middle, above the road; m) from the lower edge of the bumper over its top, the hood's
    leading edge and the hood's end to the roof.

    >>> from trace_dag.simulation.types import BodyKind
    >>> car = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.8, 1.8, 1.45, 1500.0)
    >>> profile(car)[0], profile(car)[-1][1]  # the bumper's lower edge at half the length; the roof
    ((2.4, 0.2), 1.45)
    """
    shape = front_shape(body)
    nose_m = body.length_m / 2
    roof_m = max(body.height_m, shape.edge_m)
    cowl_m = min(shape.edge_m + shape.hood_m * math.tan(shape.hood_rad), roof_m)
    cowl_at_m = nose_m - shape.lead_m - shape.hood_m
    roof_at_m = max(cowl_at_m - (roof_m - cowl_m) / math.tan(shape.screen_rad), -nose_m)
    return [
        (nose_m, shape.clearance_m),
        (nose_m, shape.bumper_m),
        (nose_m - shape.lead_m, shape.edge_m),
        (cowl_at_m, cowl_m),
        (roof_at_m, roof_m),
    ]


def driver_eye_m(body: Body) -> tuple[float, float, float]:
    """Return the position of the driver's eyes: ahead and left of the body's middle, and above the road (m).

    They are behind the windscreen and below the roof, but no higher than the 2.33 m of truck drivers (AASHTO, Green
    Book, 2018, section 3.2.6; its 1.08 m for cars is the result for a car). A person's are at 0.936 of the stature
    (Drillis and Contini, Body Segment Parameters, 1966).

    >>> from trace_dag.simulation.types import BodyKind
    >>> car = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.8, 1.8, 1.45, 1500.0)
    >>> round(driver_eye_m(car)[2], 2)
    1.11
    """
    if body.is_figure:
        return 0.0, 0.0, _EYES_OF_STATURE * body.height_m
    if body.vehicle_class is VehicleClass.MOTORCYCLE:
        return 0.05 * body.length_m, 0.0, 0.69 * body.length_m
    (nose_m, _), *_, (roof_at_m, roof_m) = profile(body)
    forward_m = 0.35 if front_shape(body).hood_m < 0.2 else -0.5
    ahead_m = max(min(roof_at_m + forward_m, nose_m - 0.6), -body.length_m / 2 + 0.5)
    return ahead_m, 0.18 * body.width_m, min(roof_m - 0.34, _HIGHEST_EYES_M)


def shell(body: Body) -> list[ShellBox]:
    """Return the vehicle's shape for strikes, as boxes of the body's width.

    There are boxes whose outer faces are the profile's lines, a core, the cabin, and the wheels of vehicles that can
    pass over a person.
    """
    points = profile(body)
    side_m, tail_m = body.width_m / 2, -body.length_m / 2
    boxes = [_behind(one, two, side_m) for one, two in pairwise(points) if math.dist(one, two) > 0]
    (_, low_m), _, (edge_at_m, edge_m), _, (roof_at_m, roof_m) = points
    core_at_m = max(edge_at_m - _INSIDE_M, tail_m + 0.1)
    boxes.append(_upright(tail_m, core_at_m, low_m, max(edge_m - _INSIDE_M, low_m + 0.05), side_m))
    if roof_at_m > tail_m + 0.1:
        boxes.append(_upright(tail_m, roof_at_m, low_m, roof_m, side_m))
    if shows_wheels(body):
        tyre_m = min(0.3, side_m / 2)
        for axle_at_m in (0.35 * body.length_m, -0.35 * body.length_m):
            for sign in (-1.0, 1.0):
                centre = (axle_at_m, sign * (side_m - tyre_m / 2), low_m / 2 + 0.03)
                boxes.append(ShellBox(centre, (_TYRE_M, tyre_m / 2, low_m / 2)))
    return boxes


def shows_wheels(body: Body) -> bool:
    """Return whether the body is so high that only its wheels touch a person on the ground.

    >>> from trace_dag.simulation.types import BodyKind
    >>> [shows_wheels(Body(BodyKind.MOTOR_VEHICLE, kind, 9.0, 2.5, 3.0, 9000.0)) for kind in ("car", "bus")]
    [False, True]
    """
    return front_shape(body).clearance_m > _WHEELS_ABOVE_M


def _behind(one: tuple[float, float], two: tuple[float, float], side_m: float) -> ShellBox:
    """Return a box whose outer face is a line of the profile, followed upward with the outside to its right."""
    along_x, along_z = two[0] - one[0], two[1] - one[1]
    length_m = math.hypot(along_x, along_z)
    inward_x, inward_z = -along_z / length_m, along_x / length_m
    middle_x, middle_z = (one[0] + two[0]) / 2, (one[1] + two[1]) / 2
    half_m = _SHELL_M / 2
    centre = (middle_x + inward_x * half_m, 0.0, middle_z + inward_z * half_m)
    # The box's own long axis points backward and up along the line: that of a level hood straight backward.
    return ShellBox(centre, (length_m / 2, side_m, half_m), math.atan2(along_z, -along_x))


def _upright(back_m: float, front_m: float, low_m: float, high_m: float, side_m: float) -> ShellBox:
    centre = ((back_m + front_m) / 2, 0.0, (low_m + high_m) / 2)
    return ShellBox(centre, ((front_m - back_m) / 2, side_m, (high_m - low_m) / 2))
