"""People and animals as OpenSCENARIO entities: pedestrians, and bicycles with their riders.

An animal is a pedestrian of the category ``animal``, as in the standard. CARLA's library has no animals, so its flavour
has a walker instead.

A pedestrian's reference point is the middle of its box on the road, that of a bicycle, a vehicle, the middle of its
rear axle. Players have no jointed bodies. From the strike on an entity is on the road below the middle of the thrown
body and keeps the heading at the strike. A bicycle represents bicycle and rider until then, and the rider afterwards.
The motion of the body's parts is in the package's trajectories.
"""

from __future__ import annotations

from collections.abc import Mapping

from trace_dag.scenario.carla_blueprints import choose_bicycle, choose_walker
from trace_dag.scenario.openscenario_elements import Element, box_of, element, properties
from trace_dag.scenario.openscenario_vehicles import axles, performance
from trace_dag.simulation.body_sizes import BICYCLE_LENGTH_M
from trace_dag.simulation.types import Body, BodyKind

_HUB = 0.52 / BICYCLE_LENGTH_M  # share of the length: how far each hub is from the middle
_WHEEL_DIAMETER_M = 0.68
_MAX_STEER_RAD = 0.8
_MAX_SPEED_MPS, _MAX_ACCELERATION_MPS2, _MAX_DECELERATION_MPS2 = 15.0, 2.0, 5.0  # of a bicycle


def person_reference_ahead_m(body: Body) -> float:
    """Return how far the reference point of OpenSCENARIO 1.2 is ahead of the body's middle; negative for a bicycle.

    >>> from trace_dag.crash.record import VehicleClass
    >>> person_reference_ahead_m(Body(BodyKind.CYCLIST, VehicleClass.OTHER, 1.75, 0.6, 1.75, 90.0))  # the rear hub
    -0.52
    """
    return -_HUB * body.length_m if body.kind is BodyKind.CYCLIST else 0.0


def person(number: int, body: Body, said: Mapping[str, str], *, reference_ahead_m: float, carla: bool) -> Element:
    """Return a person or an animal as an entity with the properties ``said``.

    The box includes the mount.

    ``carla`` names it by a blueprint of CARLA's library, by which ScenarioRunner chooses.

    >>> from trace_dag.simulation.anthropometry import person_body
    >>> person(101, person_body(BodyKind.PEDESTRIAN, 40), {}, reference_ahead_m=0.0, carla=False).get("name")
    'pedestrian_101'
    """
    box = box_of(body, reference_ahead_m)
    if body.kind is not BodyKind.CYCLIST:
        model = choose_walker(body) if carla else str(body.kind)
        return element(
            "Pedestrian",
            box,
            properties(said),
            name=model if carla else f"{body.kind}_{number}",
            pedestrianCategory="animal" if body.kind is BodyKind.ANIMAL else "pedestrian",
            **{"model" if carla else "model3d": model},  # 1.1 renamed it
            mass=round(body.mass_kg, 1),
        )
    return element(
        "Vehicle",
        box,
        performance(_MAX_SPEED_MPS, _MAX_ACCELERATION_MPS2, _MAX_DECELERATION_MPS2),
        axles(_WHEEL_DIAMETER_M, 0.0, 2 * _HUB * body.length_m, max_steer_rad=_MAX_STEER_RAD),
        properties(said),
        name=choose_bicycle() if carla else f"bicycle_{number}",
        vehicleCategory="bicycle",
        mass=None if carla else round(body.mass_kg, 1),
    )
