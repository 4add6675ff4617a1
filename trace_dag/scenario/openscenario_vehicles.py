"""Bodies as OpenSCENARIO vehicles: bounding box, axles, limits, category.

Two conventions for where an entity is. OpenSCENARIO's own reference point is the middle of the rear axle, on the road;
the bounding box and the front axle are given from there. CARLA's ScenarioRunner reads no boxes and puts an actor's
origin, the middle of its body, where the file says. It reads no axles either, and other players (esmini) move a box by
as much as the rear axle is not at the reference point; so the rear axle is at the origin for both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.crash.record import HEAVY_VEHICLES, VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.sim.carla_blueprints import BLUEPRINTS, choose_blueprint
from trace_dag.sim.types import Body
from trace_dag.sim.vehicles import trailer_model, vehicle_model

if TYPE_CHECKING:
    from scenariogeneration import xosc

_TRACK_SHARE = 0.85  # of the body's width, between the middles of the wheels
_WHEEL_DIAMETER_M = 0.65
_TRUCK_WHEEL_DIAMETER_M = 1.0
_MAX_SPEED_MPS = 70.0  # a report can state no more than 151 mph
_MAX_DECELERATION_MPS2 = 8.0  # braking on dry asphalt; the crash itself may be harder


def rear_axle_ahead_m(body: Body, trailer: Trailer | None = None) -> float:
    """The rear axle ahead of the body's centre: negative. ``trailer`` is the trailer that it is.

    >>> -log.bodies[1].length_m / 2 < rear_axle_ahead_m(log.bodies[1]) < 0.0  # behind the middle, within the body
    True
    """
    model = vehicle_model(body) if trailer is None else trailer_model(body, trailer)
    return model.cg_ahead_m - model.rear_axle_m


def vehicle(
    number: int, body: Body, *, reference_ahead_m: float, carla: bool, trailer: Trailer | None = None
) -> xosc.Vehicle:
    """The vehicle with its reference point ``reference_ahead_m`` ahead of the body's centre; ``trailer`` where it is a
    trailer, whose front axle is then where it is coupled.

    ``carla`` names it by the blueprint of CARLA's library nearest to the body, which is how ScenarioRunner chooses.

    >>> vehicle(1, log.bodies[1], reference_ahead_m=-1.4, carla=False).name
    'car_1'
    """
    from scenariogeneration import xosc

    model = vehicle_model(body) if trailer is None else trailer_model(body, trailer)
    track_m = 0.0 if body.vehicle_class is VehicleClass.MOTORCYCLE else _TRACK_SHARE * body.width_m
    heavy = body.vehicle_class in HEAVY_VEHICLES or (trailer is not None and trailer.is_semitrailer)
    wheel_m = _TRUCK_WHEEL_DIAMETER_M if heavy else _WHEEL_DIAMETER_M
    name = choose_blueprint(body, (each.id for each in BLUEPRINTS)).id if carla else f"{body.vehicle_class}_{number}"
    return xosc.Vehicle(
        name,
        _category(body.vehicle_class, trailer),
        xosc.BoundingBox(
            rounded_m(body.width_m),
            rounded_m(body.length_m),
            rounded_m(body.height_m),
            rounded_m(-reference_ahead_m),
            0.0,
            rounded_m(body.height_m / 2),
        ),
        xosc.Axle(model.max_steer_rad, wheel_m, rounded_m(track_m), rounded_m(model.wheelbase_m), wheel_m / 2),
        xosc.Axle(0.0, wheel_m, rounded_m(track_m), 0.0, wheel_m / 2),
        _MAX_SPEED_MPS,
        model.max_acceleration_mps2,
        _MAX_DECELERATION_MPS2,
        mass=None if carla else round(body.mass_kg, 1),  # revision 1.0 has none
    )


def _category(vehicle_class: VehicleClass, trailer: Trailer | None) -> xosc.VehicleCategory:
    from scenariogeneration import xosc

    if trailer is not None:
        return xosc.VehicleCategory.semitrailer if trailer.is_semitrailer else xosc.VehicleCategory.trailer
    categories = {
        VehicleClass.MOTORCYCLE: xosc.VehicleCategory.motorbike,
        VehicleClass.BUS: xosc.VehicleCategory.bus,
        VehicleClass.VAN: xosc.VehicleCategory.van,
        VehicleClass.LIGHT_TRUCK: xosc.VehicleCategory.truck,
        VehicleClass.TRUCK: xosc.VehicleCategory.truck,
        VehicleClass.TRACTOR_TRAILER: xosc.VehicleCategory.truck,
    }
    return categories.get(vehicle_class, xosc.VehicleCategory.car)


def rounded_m(value_m: float) -> float:
    """To a tenth of a millimetre, without a negative zero.

    >>> rounded_m(1.23456), rounded_m(-0.00001)
    (1.2346, 0.0)
    """
    return round(value_m, 4) + 0.0
