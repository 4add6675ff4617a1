"""People and animals as OpenSCENARIO entities: pedestrians, and bicycles with who rides them.

An animal is a pedestrian of the category ``animal``, as the standard has it. CARLA's library has no animals: its
flavour has a walker in the place of one.

A pedestrian's reference point is the middle of its box on the road, that of a bicycle, a vehicle, the middle of its
rear axle. Players have no jointed bodies. From the strike on an entity is on the road below the middle of the thrown
body and keeps the heading at the strike. A bicycle stands for bicycle and rider until then, and for the rider after it.
The motion of the body's parts is in the package's trajectories.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.scenario.openscenario_vehicles import rounded_m
from trace_dag.sim.carla_blueprints import choose_bicycle, choose_walker
from trace_dag.sim.types import Body, BodyKind
from trace_dag.states.anthropometry import BICYCLE_LENGTH_M

if TYPE_CHECKING:
    from scenariogeneration import xosc

_HUB = 0.52 / BICYCLE_LENGTH_M  # share of the length: how far each hub is from the middle
_WHEEL_DIAMETER_M = 0.68
_MAX_STEER_RAD = 0.8
_MAX_SPEED_MPS, _MAX_ACCELERATION_MPS2, _MAX_DECELERATION_MPS2 = 15.0, 2.0, 5.0  # of a bicycle


def person_reference_ahead_m(body: Body) -> float:
    """The reference point of OpenSCENARIO 1.2 ahead of the body's middle: of a bicycle negative.

    >>> from trace_dag.crash.record import VehicleClass
    >>> person_reference_ahead_m(Body(BodyKind.CYCLIST, VehicleClass.OTHER, 1.75, 0.6, 1.75, 90.0))  # the rear hub
    -0.52
    """
    return -_HUB * body.length_m if body.kind is BodyKind.CYCLIST else 0.0


def person(number: int, body: Body, *, reference_ahead_m: float, carla: bool) -> xosc.Vehicle | xosc.Pedestrian:
    """A person or an animal as an entity; the box is of the person with what the person rides.

    ``carla`` names it by the blueprint of CARLA's library, which is how ScenarioRunner chooses.

    >>> from trace_dag.sim.anthropometry import person_body
    >>> person(101, person_body(BodyKind.PEDESTRIAN, 40), reference_ahead_m=0.0, carla=False).name
    'pedestrian_101'
    """
    from scenariogeneration import xosc

    box = xosc.BoundingBox(
        rounded_m(body.width_m),
        rounded_m(body.length_m),
        rounded_m(body.height_m),
        rounded_m(-reference_ahead_m),
        0.0,
        rounded_m(body.height_m / 2),
    )
    if body.kind is not BodyKind.CYCLIST:
        model = choose_walker(body) if carla else str(body.kind)
        name = model if carla else f"{body.kind}_{number}"
        categories = xosc.PedestrianCategory
        category = categories.animal if body.kind is BodyKind.ANIMAL else categories.pedestrian
        return xosc.Pedestrian(name, round(body.mass_kg, 1), category, box, model)
    wheelbase_m = rounded_m(2 * _HUB * body.length_m)
    return xosc.Vehicle(
        choose_bicycle() if carla else f"bicycle_{number}",
        xosc.VehicleCategory.bicycle,
        box,
        xosc.Axle(_MAX_STEER_RAD, _WHEEL_DIAMETER_M, 0.0, wheelbase_m, _WHEEL_DIAMETER_M / 2),
        xosc.Axle(0.0, _WHEEL_DIAMETER_M, 0.0, 0.0, _WHEEL_DIAMETER_M / 2),
        _MAX_SPEED_MPS,
        _MAX_ACCELERATION_MPS2,
        _MAX_DECELERATION_MPS2,
        mass=None if carla else round(body.mass_kg, 1),
    )
