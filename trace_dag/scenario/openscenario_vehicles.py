"""Bodies as OpenSCENARIO vehicles: bounding box, axles, limits, category.

There are two conventions for an entity's position. OpenSCENARIO's own reference point is the middle of the rear axle,
on the road; the bounding box and the front axle are relative to it. CARLA's ScenarioRunner reads no boxes and places an
actor's origin, the middle of its body, at the file's position. It reads no axles either, and other players (esmini)
shift a box by the distance of the rear axle from the reference point; so the rear axle is at the origin for both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trace_dag.crash.record import HEAVY_VEHICLES, VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.scenario.carla_blueprints import BLUEPRINTS, choose_blueprint
from trace_dag.scenario.openscenario_elements import Element, box_of, element, properties, round_m
from trace_dag.simulation.types import Body
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


def rear_axle_ahead_m(body: Body, trailer: Trailer | None = None) -> float:
    """Return how far the rear axle is ahead of the body's centre (negative).

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
