"""Trailers in a reconstruction: typical dimensions, masses, and couplings.

Which vehicles pull one is ``TOW_VEH``; of what kind follows from what pulls: a truck tractor (``BODY_TYP`` 66) a
semitrailer on its fifth wheel, a truck or bus a trailer on a drawbar, a lighter vehicle a utility or travel trailer.
The first of two and three trailers stands for all.

* Semitrailer: the 53 ft van that most of them are (23 CFR 658.13), 102 in wide and 13 ft 6 in high, kingpin 36 in
  behind its front (SAE J700), 41 ft from there to the middle of its axles, as states limit it; half way between empty
  and full, so that with its tractor it weighs 25 t, about the mean of five-axle combinations on the road (FHWA,
  Comprehensive Truck Size and Weight Study). Both are 21 m long, between AASHTO's design vehicles WB-62 (20.9 m) and
  WB-67 (22.4 m).
* Trailers on a drawbar: after manufacturers' data of tandem equipment and utility trailers; 10 to 15 % of the mass
  rests on the hitch, as their makers advise. A towed vehicle (``TOW_VEH`` 5, 6) is a car.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trace_dag.common.units import KG_PER_LB
from trace_dag.crash.codes.bodies import GVWR_LIMIT_LB, LOADED_SHARE, SEDAN, ReportedBody
from trace_dag.crash.codes.vehicle import TOWED_VEHICLES, TRAILERS_OF_TOW_VEH
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.trailer import Trailer

_FIFTH_WHEEL_FROM_REAR_M: Final = 1.1  # some 0.2 m ahead of the middle of the tractor's rear axles
_HITCH_BEHIND_M: Final = 0.15

_SEMITRAILER: Final = Trailer(16.15, 2.59, 4.11, 16700, coupling_m=0.91, axle_m=13.41, cg_m=8.0, hitch_m=0.0)
_OF_TRUCK: Final = Trailer(6.50, 2.45, 2.60, 6000, coupling_m=-1.50, axle_m=3.60, cg_m=3.05, hitch_m=0.0)
_LIGHT: Final = Trailer(5.00, 2.10, 1.90, 1500, coupling_m=-1.20, axle_m=2.90, cg_m=2.40, hitch_m=0.0)
_SMALL: Final = Trailer(1.60, 1.00, 0.80, 120, coupling_m=-0.90, axle_m=0.85, cg_m=0.65, hitch_m=0.0)
_TOWED_CAR: Final = Trailer(
    SEDAN.length_m, SEDAN.width_m, SEDAN.height_m, SEDAN.mass_kg, coupling_m=-0.60, axle_m=3.70, cg_m=3.20, hitch_m=0.0
)
_HEAVY: Final = frozenset({VehicleClass.TRUCK, VehicleClass.LIGHT_TRUCK, VehicleClass.BUS})


def trailer_of(body: ReportedBody, tow_code: int | None, gvwr_class: int | None = None) -> Trailer | None:
    """Return the trailer of a vehicle by its ``TOW_VEH``, or None without one.

    From 2020 on, the trailer's weight rating (``TRLR1GVWR``, 11 to 18) counts as well.

    >>> from trace_dag.crash.codes.bodies import PICKUP, TRACTOR_OF_TRAILER
    >>> trailer_of(PICKUP, 0)
    >>> round(trailer_of(TRACTOR_OF_TRAILER, 1).combination_length_m, 2)
    21.14
    """
    if not TRAILERS_OF_TOW_VEH.get(tow_code or 0, 0):
        return None
    kind, hitch_m = _LIGHT, body.length_m + _HITCH_BEHIND_M
    if tow_code in TOWED_VEHICLES:
        kind = _TOWED_CAR
    elif body.vehicle_class is VehicleClass.TRACTOR_TRAILER:
        kind, hitch_m = _SEMITRAILER, body.length_m - _FIFTH_WHEEL_FROM_REAR_M
    elif body.vehicle_class is VehicleClass.MOTORCYCLE:
        kind = _SMALL
    elif body.vehicle_class in _HEAVY:
        kind = _OF_TRUCK
    limit_lb = GVWR_LIMIT_LB.get(gvwr_class or 0)
    mass_kg = kind.mass_kg if limit_lb is None else round(limit_lb * KG_PER_LB * LOADED_SHARE)
    return replace(kind, mass_kg=mass_kg, hitch_m=round(hitch_m, 2))
