"""Entities of OpenSCENARIO: vehicles with bounding box, axles, limits and category; people, animals, fixed objects.

There are two conventions for an entity's position. OpenSCENARIO's own reference point is the middle of the rear axle,
on the road; the bounding box and the front axle are relative to it. CARLA's ScenarioRunner reads no boxes and places an
actor's origin, the middle of its body, at the file's position. It reads no axles either, and other players (esmini)
shift a box by the distance of the rear axle from the reference point; so the rear axle is at the origin for both.

A fixed object is a ``MiscObject`` (ASAM OpenSCENARIO 1.2): its box is given from its reference point, the middle of its
base; a ditch lies below that. A property marks objects that the program placed.

A person is a pedestrian, or a bicycle with its rider. An animal is a pedestrian of the category ``animal``, as in the
standard. CARLA's library has no animals, so its flavour has a walker instead.

A pedestrian's reference point is the middle of its box on the road, that of a bicycle, a vehicle, the middle of its
rear axle. Players have no jointed bodies. From the strike on an entity is on the road below the middle of the thrown
body and keeps the heading at the strike. A bicycle represents bicycle and rider until then, and the rider afterwards.
The motion of the body's parts is in the package's trajectories.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trace_dag.crash.record import HEAVY_VEHICLES, VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.scenario.carla_blueprints import BLUEPRINTS, choose_bicycle, choose_blueprint, choose_walker
from trace_dag.scenario.drawn_shapes import object_category
from trace_dag.scenario.openscenario_elements import (
    Element,
    bounding_box,
    box_of,
    element,
    properties,
    round_m,
    teleport_action,
)
from trace_dag.simulation.body_sizes import BICYCLE_LENGTH_M
from trace_dag.simulation.objects import FixedObject, base_m
from trace_dag.simulation.types import Body, BodyKind
from trace_dag.simulation.vehicles import trailer_model, vehicle_model

_TRACK_SHARE = 0.85  # of the body's width, between the middles of the wheels
_WHEEL_DIAMETER_M = 0.65
_TRUCK_WHEEL_DIAMETER_M = 1.0
_MAX_SPEED_MPS = 70.0  # a report can state no more than 151 mph
_MAX_DECELERATION_MPS2 = 8.0  # braking on dry asphalt; the crash itself may be harder
_CATEGORIES: Final = {
    VehicleClass.MOTORCYCLE: "motorbike",
    VehicleClass.BUS: "bus",
    VehicleClass.VAN: "van",
    VehicleClass.LIGHT_TRUCK: "truck",
    VehicleClass.TRUCK: "truck",
    VehicleClass.TRACTOR_TRAILER: "truck",
}
"""By class; any other one is a car."""
_MASS_KG: Final = 1e5  # the standard wants one; nothing moves it
_HUB = 0.52 / BICYCLE_LENGTH_M  # share of the length: how far each hub is from the middle
_BICYCLE_WHEEL_M = 0.68
_MAX_STEER_RAD = 0.8
_CYCLIST_SPEED_MPS, _MAX_ACCELERATION_MPS2, _CYCLIST_DECELERATION_MPS2 = 15.0, 2.0, 5.0  # of a bicycle


def rear_axle_ahead_m(body: Body, trailer: Trailer | None = None) -> float:
    """Return the distance of the rear axle ahead of the body's centre (negative).

    ``trailer`` is given if the body is a trailer.
    """
    model = vehicle_model(body) if trailer is None else trailer_model(body, trailer)
    return model.cg_ahead_m - model.rear_axle_m


def vehicle(
    number: int,
    body: Body,
    said: Mapping[str, str],
    *,
    reference_ahead_m: float,
    carla: bool,
    trailer: Trailer | None = None,
) -> Element:
    """Return the vehicle with its reference point ``reference_ahead_m`` ahead of the body's centre.

    ``said`` are its properties; ``trailer`` marks a trailer, whose front axle is then at its coupling.

    ``carla`` names it by the most similar blueprint of CARLA's library, by which ScenarioRunner chooses.

    >>> vehicle(1, log.bodies[1], {}, reference_ahead_m=-1.4, carla=False).get("name")
    'car_1'
    """
    model = vehicle_model(body) if trailer is None else trailer_model(body, trailer)
    track_m = 0.0 if body.vehicle_class is VehicleClass.MOTORCYCLE else _TRACK_SHARE * body.width_m
    heavy = body.vehicle_class in HEAVY_VEHICLES or (trailer is not None and trailer.is_semitrailer)
    wheel_m = _TRUCK_WHEEL_DIAMETER_M if heavy else _WHEEL_DIAMETER_M
    name = choose_blueprint(body, (each.id for each in BLUEPRINTS)).id if carla else f"{body.vehicle_class}_{number}"
    return element(
        "Vehicle",
        box_of(body, reference_ahead_m),
        performance(_MAX_SPEED_MPS, model.max_acceleration_mps2, _MAX_DECELERATION_MPS2),
        axles(wheel_m, track_m, model.wheelbase_m, max_steer_rad=model.max_steer_rad),
        properties(said),
        name=name,
        vehicleCategory=_category(body.vehicle_class, trailer),
        mass=None if carla else round(body.mass_kg, 1),  # revision 1.0 has none
    )


def performance(speed_mps: float, acceleration_mps2: float, deceleration_mps2: float) -> Element:
    """Return a vehicle's limits of performance.

    >>> performance(70.0, 5.0, 8.0).get("maxSpeed")
    '70.0'
    """
    return element(
        "Performance", maxSpeed=speed_mps, maxDeceleration=deceleration_mps2, maxAcceleration=acceleration_mps2
    )


def axles(wheel_m: float, track_m: float, wheelbase_m: float, *, max_steer_rad: float) -> Element:
    """Return the axles of a vehicle, the rear one at its origin; ``wheel_m`` is the diameter of a wheel.

    >>> axles(0.65, 1.5, 2.7, max_steer_rad=0.6)[1].get("positionX")
    '0.0'
    """

    def axle(name: str, ahead_m: float, steer_rad: float) -> Element:
        return element(
            name,
            maxSteering=steer_rad,
            wheelDiameter=wheel_m,
            trackWidth=round_m(track_m),
            positionX=round_m(ahead_m),
            positionZ=wheel_m / 2,
        )

    return element("Axles", axle("FrontAxle", wheelbase_m, max_steer_rad), axle("RearAxle", 0.0, 0.0))


def _category(vehicle_class: VehicleClass, trailer: Trailer | None) -> str:
    if trailer is not None:
        return "semitrailer" if trailer.is_semitrailer else "trailer"
    return _CATEGORIES.get(vehicle_class, "car")


# --- fixed objects ---------------------------------------------------------------------------------------------------
def misc_object(item: FixedObject) -> Element:
    """Return an object as an entity.

    >>> made = misc_object(tree)
    >>> made.get("name"), made.get("miscObjectCategory")
    ('tree_2', 'tree')
    """
    said = {
        "fars_event_number": str(item.event_number),
        "fars_soe": str(item.code),
        "placed_by": str(item.placed_by),
        **({"osm_id": item.osm_id} if item.osm_id else {}),
    }
    middle_m = base_m(item) + item.height_m / 2
    return element(
        "MiscObject",
        bounding_box(item.width_m, item.length_m, item.height_m, ahead_m=0.0, up_m=middle_m),
        properties(said),
        name=f"{item.name} {item.event_number}".replace(" ", "_"),
        miscObjectCategory=object_category(item),
        mass=_MASS_KG,
    )


def standing_at(item: FixedObject) -> Element:
    """Return the action that puts an object in its place."""
    pose = item.pose
    return teleport_action(*(round(value, 6) + 0.0 for value in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)))


# --- people and animals ----------------------------------------------------------------------------------------------
def person_reference_ahead_m(body: Body) -> float:
    """Return the distance of OpenSCENARIO 1.2's reference point ahead of the body's middle; negative for a bicycle.

    >>> from trace_dag.crash.record import VehicleClass
    >>> person_reference_ahead_m(Body(BodyKind.CYCLIST, VehicleClass.OTHER, 1.75, 0.6, 1.75, 90.0))  # the rear hub
    -0.52
    """
    return -_HUB * body.length_m if body.kind is BodyKind.CYCLIST else 0.0


def person(number: int, body: Body, said: Mapping[str, str], *, reference_ahead_m: float, carla: bool) -> Element:
    """Return a person or an animal as an entity with the properties ``said``.

    The box includes the mount.

    ``carla`` names it by a blueprint of CARLA's library, by which ScenarioRunner chooses.

    >>> from trace_dag.simulation.body_sizes import person_body
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
        performance(_CYCLIST_SPEED_MPS, _MAX_ACCELERATION_MPS2, _CYCLIST_DECELERATION_MPS2),
        axles(_BICYCLE_WHEEL_M, 0.0, 2 * _HUB * body.length_m, max_steer_rad=_MAX_STEER_RAD),
        properties(said),
        name=choose_bicycle() if carla else f"bicycle_{number}",
        vehicleCategory="bicycle",
        mass=None if carla else round(body.mass_kg, 1),
    )
