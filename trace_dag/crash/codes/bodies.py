"""Body types and the bodies they amount to in a reconstruction.

``BODY_TYP`` names the kind of body; where it is missing or unknown, vPIC's body class, the FARS model code's range and
the weight rating say what they can. Dimensions and masses are typical of the US fleet: lengths, widths and heights
after manufacturers' data of best sellers of each kind, curb masses after EPA's Automotive Trends Report for light
vehicles and FHWA's vehicle types for trucks and buses, all in running order with a driver.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trace_dag.common.units import KG_PER_LB, METRES_PER_FOOT
from trace_dag.crash.codes.table import code_table
from trace_dag.crash.record import VehicleClass

DRIVER_KG: Final = 80.0
_METRES_PER_INCH: Final = METRES_PER_FOOT / 12
_MAX_PLAUSIBLE_CURB_LB: Final = 30_000
_PLAUSIBLE_WHEELBASE_IN: Final = (40.0, 300.0)


@dataclass(frozen=True)
class ReportedBody:
    """A body to simulate: its class, dimensions (m) and mass (kg); ``wheelbase_ratio`` is length over wheelbase."""

    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    wheelbase_ratio: float | None = None


_CAR, _SUV, _VAN, _PICKUP = VehicleClass.CAR, VehicleClass.SUV, VehicleClass.VAN, VehicleClass.PICKUP
_TRUCK, _BUS, _CYCLE = VehicleClass.TRUCK, VehicleClass.BUS, VehicleClass.MOTORCYCLE

SEDAN = ReportedBody(_CAR, 4.85, 1.84, 1.46, 1600, 1.73)
COUPE = ReportedBody(_CAR, 4.70, 1.87, 1.38, 1600, 1.72)
HATCHBACK = ReportedBody(_CAR, 4.30, 1.79, 1.50, 1350, 1.66)
WAGON = ReportedBody(_CAR, 4.75, 1.83, 1.55, 1650, 1.73)
LIMOUSINE = ReportedBody(_CAR, 7.00, 1.90, 1.60, 2500)
SUV = ReportedBody(_SUV, 4.70, 1.89, 1.71, 1800, 1.73)
LARGE_SUV = ReportedBody(_SUV, 5.30, 2.04, 1.92, 2600, 1.74)
MINIVAN = ReportedBody(_VAN, 5.15, 1.99, 1.77, 2100, 1.71)
LARGE_VAN = ReportedBody(_VAN, 5.70, 2.03, 2.20, 2500, 1.65)
STEP_VAN = ReportedBody(_VAN, 6.50, 2.20, 2.80, 4000)
COMPACT_PICKUP = ReportedBody(_PICKUP, 5.20, 1.85, 1.76, 1850, 1.63)
PICKUP = ReportedBody(_PICKUP, 5.75, 2.03, 1.93, 2350, 1.59)
HEAVY_PICKUP = ReportedBody(_PICKUP, 6.35, 2.05, 2.03, 3400, 1.58)
LIGHT_TRUCK = ReportedBody(VehicleClass.LIGHT_TRUCK, 6.50, 2.20, 2.40, 4000)
MEDIUM_TRUCK = ReportedBody(_TRUCK, 7.30, 2.35, 2.90, 6500)
LARGE_TRUCK = ReportedBody(_TRUCK, 8.20, 2.45, 3.30, 9500)
HEAVY_TRUCK = ReportedBody(_TRUCK, 9.00, 2.50, 3.50, 17000)
TRACTOR = ReportedBody(_TRUCK, 7.00, 2.50, 3.80, 8300)
TRACTOR_OF_TRAILER = replace(TRACTOR, vehicle_class=VehicleClass.TRACTOR_TRAILER)
SMALL_BUS = ReportedBody(_BUS, 7.50, 2.35, 2.90, 5800)
SCHOOL_BUS = ReportedBody(_BUS, 11.00, 2.44, 3.20, 12000)
TRANSIT_BUS = ReportedBody(_BUS, 12.20, 2.59, 3.10, 14000)
COACH = ReportedBody(_BUS, 13.70, 2.59, 3.60, 18000)
MOTOR_HOME = ReportedBody(_TRUCK, 9.50, 2.50, 3.60, 8500)
MOTORCYCLE = ReportedBody(_CYCLE, 2.20, 0.85, 1.20, 320)
MOPED = ReportedBody(_CYCLE, 1.85, 0.70, 1.15, 190)
THREE_WHEELER = ReportedBody(_CYCLE, 2.60, 1.40, 1.30, 520)
ALL_TERRAIN = ReportedBody(VehicleClass.OTHER, 2.20, 1.20, 1.20, 400)
SIDE_BY_SIDE = ReportedBody(VehicleClass.OTHER, 3.00, 1.60, 1.90, 750)
GOLF_CART = ReportedBody(VehicleClass.OTHER, 2.40, 1.25, 1.80, 500)
MACHINE = ReportedBody(VehicleClass.OTHER, 5.50, 2.50, 3.00, 7000)
UNKNOWN_LIGHT = SEDAN
"""A vehicle of unknown kind is taken for the most frequent one, and the record marks that as implied."""

_BODY_OF: Final[dict[int, ReportedBody]] = {
    1: COUPE, 2: COUPE, 3: HATCHBACK, 4: SEDAN, 5: HATCHBACK, 6: WAGON, 7: HATCHBACK, 8: SEDAN, 9: SEDAN,
    10: COMPACT_PICKUP, 11: WAGON, 12: LIMOUSINE, 13: THREE_WHEELER, 14: SUV, 15: LARGE_SUV, 16: LARGE_SUV, 17: COUPE,
    19: SUV, 20: MINIVAN, 21: LARGE_VAN, 22: STEP_VAN, 28: LARGE_VAN, 29: LARGE_VAN, 30: COMPACT_PICKUP, 31: PICKUP,
    32: PICKUP, 33: COMPACT_PICKUP, 34: PICKUP, 39: PICKUP, 40: LIGHT_TRUCK, 41: LIGHT_TRUCK, 42: MOTOR_HOME,
    45: LIGHT_TRUCK, 48: LIGHT_TRUCK, 49: UNKNOWN_LIGHT, 50: SCHOOL_BUS, 51: COACH, 52: TRANSIT_BUS, 55: SMALL_BUS,
    58: TRANSIT_BUS, 59: TRANSIT_BUS, 60: MEDIUM_TRUCK, 61: MEDIUM_TRUCK, 62: LARGE_TRUCK, 63: HEAVY_TRUCK,
    64: LARGE_TRUCK, 65: MOTOR_HOME, 66: TRACTOR, 67: HEAVY_PICKUP, 71: MEDIUM_TRUCK, 72: HEAVY_TRUCK, 73: MOTOR_HOME,
    78: LARGE_TRUCK, 79: LARGE_TRUCK, 80: MOTORCYCLE, 81: MOPED, 82: THREE_WHEELER, 83: MOTORCYCLE, 84: MOPED,
    85: THREE_WHEELER, 86: THREE_WHEELER, 87: THREE_WHEELER, 88: MOPED, 89: MOTORCYCLE, 90: ALL_TERRAIN,
    91: ALL_TERRAIN, 92: MACHINE, 93: MACHINE, 94: GOLF_CART, 95: GOLF_CART, 96: SIDE_BY_SIDE, 97: SIDE_BY_SIDE,
}  # fmt: skip
"""By ``BODY_TYP``."""

BODY_TYP = code_table("BODY_TYP")

_VPIC_BODY_CLASS: Final[dict[int, ReportedBody]] = {
    1: COUPE, 2: MINIVAN, 3: COUPE, 5: HATCHBACK, 7: SUV, 8: SUV, 9: LARGE_VAN, 10: COUPE, 11: LARGE_TRUCK,
    12: MOTORCYCLE, 13: SEDAN, 15: WAGON, 16: TRANSIT_BUS, 60: PICKUP, 66: TRACTOR, 73: SCHOOL_BUS, 80: MOTORCYCLE,
}  # fmt: skip
"""``VPICBODYCLASS``, the classes a reconstruction tells apart."""

_MODEL_RANGES: Final[tuple[tuple[int, int, ReportedBody], ...]] = (
    (1, 399, SEDAN),
    (401, 419, SUV),
    (421, 430, LARGE_SUV),
    (431, 439, LARGE_SUV),
    (441, 449, MINIVAN),
    (461, 470, LARGE_VAN),
    (471, 480, COMPACT_PICKUP),
    (481, 489, PICKUP),
    (498, 499, LIGHT_TRUCK),
    (701, 709, MOTORCYCLE),
    (731, 739, ALL_TERRAIN),
    (870, 898, HEAVY_TRUCK),
    (981, 989, TRANSIT_BUS),
)
"""Ranges of ``MODEL``, first and last code: cars below 400, light trucks in the 400s, cycles in the 700s, ..."""

GVWR_LIMIT_LB: Final = {11: 6_000, 12: 10_000, 13: 14_000, 14: 16_000, 15: 19_500, 16: 26_000, 17: 33_000, 18: 60_000}
"""Upper bound of the classes of ``GVWR_FROM`` and ``GVWR_TO`` (2020 on)."""
LOADED_SHARE: Final = 0.75
"""Typical mass of a medium or heavy single-unit truck on the road, as a share of its weight rating."""
_RATED: Final = (MEDIUM_TRUCK, LARGE_TRUCK, HEAVY_TRUCK)


@dataclass(frozen=True)
class BodyEvidence:
    """A report's statements about one vehicle's body; None where there are none."""

    body_type: int | None = None  # BODY_TYP
    model: int | None = None  # MODEL
    vpic_body_class: int | None = None  # VPICBODYCLASS
    gvwr_class: int | None = None  # GVWR_TO, else GVWR_FROM: 11 to 18
    gvwr_old: int | None = None  # GVWR (before 2020): 1 to 10,000 lb, 2 to 26,000 lb, 3 above
    trailers: int = 0
    curb_weight_lb: float | None = None  # vPIC CurbWeightLB
    wheelbase_in: float | None = None  # vPIC WheelBaseIN_from


def body_of(evidence: BodyEvidence) -> tuple[ReportedBody, bool]:
    """Return the simulated body of a vehicle, and whether its kind is implied (not given by ``BODY_TYP``).

    >>> body, implied = body_of(BodyEvidence(body_type=4))  # BODY_TYP 4: four-door sedan
    >>> body.vehicle_class.value, implied
    ('car', False)
    """
    known = BODY_TYP.known(evidence.body_type)
    body = _BODY_OF[known] if known in _BODY_OF else _implied_kind(evidence)
    if body is TRACTOR and evidence.trailers:
        return TRACTOR_OF_TRAILER, known is None
    return _refined(body, evidence), known is None


def _implied_kind(evidence: BodyEvidence) -> ReportedBody:
    if evidence.vpic_body_class in _VPIC_BODY_CLASS:
        return _VPIC_BODY_CLASS[evidence.vpic_body_class]
    for first, last, body in _MODEL_RANGES:
        if evidence.model is not None and first <= evidence.model <= last:
            # Tractors and straight trucks share their model codes; only the heaviest tow a trailer.
            return TRACTOR if body is HEAVY_TRUCK and evidence.trailers else body
    gvwr_class = evidence.gvwr_class if evidence.gvwr_class in GVWR_LIMIT_LB else 0  # 98 and 99: not known
    if evidence.gvwr_old == 3 or gvwr_class >= 17:
        return HEAVY_TRUCK
    if evidence.gvwr_old == 2 or gvwr_class >= 13:
        return MEDIUM_TRUCK
    return UNKNOWN_LIGHT


def _refined(body: ReportedBody, evidence: BodyEvidence) -> ReportedBody:
    """Return the kind's typical body, refined by the dimensions and mass from the VIN."""
    if evidence.wheelbase_in is not None and body.wheelbase_ratio is not None:
        low, high = _PLAUSIBLE_WHEELBASE_IN
        if low <= evidence.wheelbase_in <= high:
            length_m = evidence.wheelbase_in * _METRES_PER_INCH * body.wheelbase_ratio
            body = replace(body, length_m=round(length_m, 2))
    if evidence.curb_weight_lb is not None and 0 < evidence.curb_weight_lb < _MAX_PLAUSIBLE_CURB_LB:
        return replace(body, mass_kg=round(evidence.curb_weight_lb * KG_PER_LB + DRIVER_KG))
    limit_lb = GVWR_LIMIT_LB.get(evidence.gvwr_class or 0)
    if limit_lb is not None and body in _RATED:
        return replace(body, mass_kg=round(limit_lb * KG_PER_LB * LOADED_SHARE))
    return body
