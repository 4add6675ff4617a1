"""The dynamic properties of each vehicle class (a trailer is one): axles, centre of gravity, tyres, limits.

Dimensions and mass come from the report; the proportions below are those of typical vehicles of the class (wheelbase
and axle positions from manufacturers' drawings, cornering stiffness per load after Pacejka, Tyre and Vehicle Dynamics,
3rd ed., and Winkler, Simplified Analysis of the Steady-State Turning of Complex Vehicles, for trucks). The tractor of a
semitrailer has a front overhang of 4 ft, as AASHTO's design vehicles WB-62 and WB-67; the hitch load of a trailer is on
the axles of the pulling vehicle. Tyres of trucks, which are made to last, have some 0.7 of the friction of a car's on
dry pavement (Reed and Keskin, SAE 870502); those of light trucks are taken to lie between.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

from trace_dag.common.units import GRAVITY_MPS2, KG_PER_LB, METRES_PER_FOOT
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.simulation.types import Body


@dataclass(frozen=True)
class _Proportions:
    wheelbase: float  # of the length
    rear_load: float  # share of the weight on the rear axle
    front_overhang: float  # of the length, front bumper to front axle
    cornering_stiffness: float  # 1/rad, per load of the axle
    max_steer_rad: float
    max_acceleration_mps2: float
    tyre_grip: float = 1.0  # friction of its tyres, of a car's on the same road


_PROPORTIONS: dict[VehicleClass, _Proportions] = {
    VehicleClass.CAR: _Proportions(0.58, 0.42, 0.19, 14.0, 0.62, 5.0),
    VehicleClass.SUV: _Proportions(0.58, 0.44, 0.19, 13.0, 0.62, 4.5),
    VehicleClass.PICKUP: _Proportions(0.61, 0.42, 0.17, 12.0, 0.62, 4.5),
    VehicleClass.VAN: _Proportions(0.59, 0.45, 0.18, 12.0, 0.65, 4.0),
    VehicleClass.LIGHT_TRUCK: _Proportions(0.58, 0.55, 0.16, 9.0, 0.70, 3.0, 0.85),
    VehicleClass.TRUCK: _Proportions(0.55, 0.62, 0.15, 7.0, 0.75, 2.5, 0.7),
    VehicleClass.TRACTOR_TRAILER: _Proportions(0.70, 0.42, 0.175, 7.0, 0.80, 2.0, 0.7),
    VehicleClass.BUS: _Proportions(0.50, 0.62, 0.23, 7.0, 0.80, 2.5, 0.7),
    VehicleClass.MOTORCYCLE: _Proportions(0.66, 0.52, 0.16, 14.0, 0.70, 6.0),
    VehicleClass.OTHER: _Proportions(0.58, 0.45, 0.19, 12.0, 0.62, 4.0),
}

_HEAVY_TRAILER, _LIGHT_TRAILER = _PROPORTIONS[VehicleClass.TRACTOR_TRAILER], _PROPORTIONS[VehicleClass.PICKUP]
_HEAVY_FROM_KG = 3500.0  # with truck tyres from this mass on


_MEASURED_INERTIA = frozenset({VehicleClass.CAR, VehicleClass.SUV, VehicleClass.PICKUP, VehicleClass.VAN})
_KGM2_PER_SLUG_FT2 = KG_PER_LB * GRAVITY_MPS2 * METRES_PER_FOOT  # pound-force, second and foot


@dataclass(frozen=True)
class VehicleModel:
    """A single-track model: distances from the centre of gravity along the body, loads and stiffness of both axles."""

    body: Body
    cg_ahead_m: float  # centre of gravity ahead of the body's centre
    front_axle_m: float  # ahead of the centre of gravity
    rear_axle_m: float  # behind the centre of gravity
    yaw_inertia_kgm2: float
    front_load_n: float
    rear_load_n: float
    front_stiffness_npr: float
    rear_stiffness_npr: float
    max_steer_rad: float
    max_acceleration_mps2: float
    tyre_grip: float
    front_share: float  # of what its wheels carry, on the front axle
    pulled_kg: float = 0.0  # of its trailer
    carried_n: float = 0.0  # of that trailer's weight, on its own wheels

    @property
    def wheelbase_m(self) -> float:
        """Return the distance between the axles."""
        return self.front_axle_m + self.rear_axle_m


@lru_cache(maxsize=256)
def vehicle_model(body: Body, trailer: Trailer | None = None) -> VehicleModel:
    """Return the single-track model of a body; with a trailer, that of its pulling vehicle.

    >>> model = vehicle_model(log.bodies[1])
    >>> round(model.front_load_n + model.rear_load_n)  # 1600 kg at 9.80665 m/s2
    15691
    """
    p = _PROPORTIONS[body.vehicle_class]
    wheelbase = p.wheelbase * body.length_m
    front_axle_ahead = body.length_m * (0.5 - p.front_overhang)
    front_axle = p.rear_load * wheelbase
    weight = body.mass_kg * GRAVITY_MPS2
    alone = VehicleModel(
        body=body,
        cg_ahead_m=front_axle_ahead - front_axle,
        front_axle_m=front_axle,
        rear_axle_m=wheelbase - front_axle,
        yaw_inertia_kgm2=yaw_inertia_kgm2(body),
        front_load_n=weight * (1 - p.rear_load),
        rear_load_n=weight * p.rear_load,
        front_stiffness_npr=weight * (1 - p.rear_load) * p.cornering_stiffness,
        rear_stiffness_npr=weight * p.rear_load * p.cornering_stiffness,
        max_steer_rad=p.max_steer_rad,
        max_acceleration_mps2=p.max_acceleration_mps2,
        tyre_grip=p.tyre_grip,
        front_share=(wheelbase - front_axle) / (front_axle + (wheelbase - front_axle)),
    )
    return alone if trailer is None else _pulling(alone, trailer, p)


def _pulling(alone: VehicleModel, trailer: Trailer, p: _Proportions) -> VehicleModel:
    """Return a vehicle with the load of a trailer on its hitch, shared by its axles as on a beam."""
    carried_n = trailer.hitch_load_share * trailer.mass_kg * GRAVITY_MPS2
    behind_front_m = trailer.hitch_m - alone.body.length_m / 2 + alone.cg_ahead_m + alone.front_axle_m
    on_rear_n = carried_n * behind_front_m / alone.wheelbase_m
    front_n = max(alone.front_load_n + carried_n - on_rear_n, 0.2 * alone.front_load_n)
    rear_n = alone.front_load_n + alone.rear_load_n + carried_n - front_n
    return replace(
        alone,
        front_load_n=front_n,
        rear_load_n=rear_n,
        front_stiffness_npr=front_n * p.cornering_stiffness,
        rear_stiffness_npr=rear_n * p.cornering_stiffness,
        front_share=front_n / (front_n + rear_n),
        pulled_kg=trailer.mass_kg,
        carried_n=carried_n,
    )


@lru_cache(maxsize=256)
def trailer_model(body: Body, trailer: Trailer) -> VehicleModel:
    """Return a trailer's model.

    Its front axle is the hitch, which has no wheels.

    >>> from trace_dag.crash.codes.bodies import BODIES
    >>> from trace_dag.crash.vehicles import trailer_of
    >>> from trace_dag.simulation.types import BodyKind
    >>> trailer = trailer_of(BODIES["pickup"], 1)  # TOW_VEH 1: one trailer
    >>> body = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.OTHER, trailer.length_m, 2.0, 2.0, trailer.mass_kg)
    >>> model = trailer_model(body, trailer)
    >>> model.front_stiffness_npr, model.max_acceleration_mps2  # no wheels in front, no engine
    (0.0, 0.0)
    """
    p = _HEAVY_TRAILER if trailer.mass_kg > _HEAVY_FROM_KG else _LIGHT_TRAILER
    rear_n = (1.0 - trailer.hitch_load_share) * trailer.mass_kg * GRAVITY_MPS2
    return VehicleModel(
        body=body,
        cg_ahead_m=trailer.length_m / 2 - trailer.cg_m,
        front_axle_m=trailer.cg_m - trailer.coupling_m,
        rear_axle_m=trailer.axle_m - trailer.cg_m,
        yaw_inertia_kgm2=yaw_inertia_kgm2(body),
        front_load_n=0.0,
        rear_load_n=rear_n,
        front_stiffness_npr=0.0,
        rear_stiffness_npr=rear_n * p.cornering_stiffness,
        max_steer_rad=0.0,
        max_acceleration_mps2=0.0,
        tyre_grip=p.tyre_grip,
        front_share=0.0,
        carried_n=rear_n - trailer.mass_kg * GRAVITY_MPS2,
    )


def yaw_inertia_kgm2(body: Body) -> float:
    """Return the yaw inertia about the vertical through the centre of gravity.

    Light vehicles follow NHTSA's measurements: 1.03 W - 1206 slug ft2 at a weight W in lb (Garrott, SAE 930897),
    limited to between two thirds of a uniform box's and the whole of it, outside the range of the regression. All
    others have that of a uniform box.

    >>> from trace_dag.simulation.types import BodyKind
    >>> round(yaw_inertia_kgm2(Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.76, 1.78, 1.40, 3260 * KG_PER_LB)))
    2917
    """
    box = body.mass_kg * (body.length_m**2 + body.width_m**2) / 12
    if body.vehicle_class not in _MEASURED_INERTIA:
        return box
    measured = (1.03 * body.mass_kg / KG_PER_LB - 1206.0) * _KGM2_PER_SLUG_FT2
    return min(max(measured, 2 / 3 * box), box)
