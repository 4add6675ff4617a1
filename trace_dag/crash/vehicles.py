"""One vehicle of a report to a :class:`VehicleRecord`: in transport (``Vehicle``), parked or at work (``ParkWork``).

``TOW_VEH`` says which vehicles pull a trailer, and the pulling vehicle says of what kind it is: a truck tractor
(``BODY_TYP`` 66) pulls a semitrailer on its fifth wheel, a truck or bus a trailer on a drawbar, a lighter vehicle a
utility or travel trailer. A vehicle with two or three trailers has the first one alone. Trailers have typical
dimensions, masses and couplings:

* Semitrailer: the 53 ft van, the most frequent one (23 CFR 658.13). It is 102 in wide and 13 ft 6 in high. Its
  kingpin is 36 in behind its front (SAE J700), and the middle of its axles 41 ft behind the kingpin, which is the
  states' limit. It is half loaded, so that it weighs 25 t with its tractor, about the mean of five-axle combinations
  on the road (FHWA, Comprehensive Truck Size and Weight Study). Both are 21 m long, between AASHTO's design vehicles
  WB-62 (20.9 m) and WB-67 (22.4 m).
* Trailers on a drawbar: sizes and masses of makers' tandem equipment and utility trailers. 10 to 15 % of the mass
  rests on the hitch, as their makers advise. A towed vehicle (``TOW_VEH`` 5, 6) is a car.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from trace_dag.common.units import KG_PER_LB, mph_to_mps
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.bodies import BODY_TYP, GVWR_LIMIT_LB, LOADED_SHARE, BodyEvidence, ReportedBody, body_of
from trace_dag.crash.codes.table import UnknownCodeError, code_table
from trace_dag.crash.derive import impact_area
from trace_dag.crash.fields import Fields, known_codes, malformed
from trace_dag.crash.record import Occupant, PreCrashMovement, VehicleClass, VehicleRecord
from trace_dag.crash.trailer import Trailer

HIGHEST_REPORTED_MPH: Final = 151
_ABOVE_HIGHEST: Final = 997
_SPEED_UNKNOWN: Final = frozenset({998, 999})
_LIMIT_NONE: Final = 0
_LIMIT_UNKNOWN: Final = frozenset({98, 99})
_HIGHEST_LIMIT_MPH: Final = 95
_WORKING: Final = 4
_DRIVER: Final = 1  # PER_TYP
_MOST_KILLED: Final = 98  # DEATHS: 99 is unknown
_BELTED: Final = frozenset({1, 2, 3, 8})  # REST_USE: shoulder, lap, both, some kind of belt
_RESTRAINT_UNKNOWN: Final = frozenset({98, 99})  # REST_USE: not reported, unknown
_UNBELTED: Final = frozenset({0, 7, 20})  # none used: until 2009, until 2018, since
_FIFTH_WHEEL_FROM_REAR_M: Final = 1.1  # some 0.2 m ahead of the middle of the tractor's rear axles
_HITCH_BEHIND_M: Final = 0.15

_SEMITRAILER: Final = Trailer(16.15, 2.59, 4.11, 16700, coupling_m=0.91, axle_m=13.41, cg_m=8.0, hitch_m=0.0)
_OF_TRUCK: Final = Trailer(6.50, 2.45, 2.60, 6000, coupling_m=-1.50, axle_m=3.60, cg_m=3.05, hitch_m=0.0)
_LIGHT: Final = Trailer(5.00, 2.10, 1.90, 1500, coupling_m=-1.20, axle_m=2.90, cg_m=2.40, hitch_m=0.0)
_SMALL: Final = Trailer(1.60, 1.00, 0.80, 120, coupling_m=-0.90, axle_m=0.85, cg_m=0.65, hitch_m=0.0)
_TOWED_CAR: Final = Trailer(4.85, 1.84, 1.46, 1600, coupling_m=-0.60, axle_m=3.70, cg_m=3.20, hitch_m=0.0)  # a sedan
_HEAVY: Final = frozenset({VehicleClass.TRUCK, VehicleClass.LIGHT_TRUCK, VehicleClass.BUS})


def read_vehicle(fields: Fields) -> VehicleRecord:
    """Return a motor vehicle in transport, of its row in a report.

    >>> row = {"VEH_NO": "1", "BODY_TYP": "4", "TRAV_SP": "45"}
    >>> round(read_vehicle(Fields(row, "a report", 2023)).travel_speed_mps, 2)  # 45 mph of 0.44704 m/s
    20.12
    """
    body = _read_body(fields)
    speed_mps, above_highest = _travel_speed(fields)
    movement = fields.code("P_CRASH1")
    occupants = _occupants(fields)
    driver = next((each for each in occupants if each.role_code == _DRIVER), None)
    return VehicleRecord(
        **body,
        jackknife_code=fields.known_code("J_KNIFE"),
        in_transport=fields.code("UNITTYPE") in (None, codes.IN_TRANSPORT),
        travel_speed_mps=speed_mps,
        travel_speed_is_lower_bound=above_highest,
        speed_limit_mps=_speed_limit(fields),
        speeding=_is_said(fields, "SPEEDREL"),
        driver_drinking=_is_said(fields, "DR_DRINK"),
        driver_age_years=None if driver is None else driver.age_years,
        driver_belted=_belted(driver),
        occupants_killed=fields.within(0, _MOST_KILLED, "DEATHS"),
        lanes=fields.known_code("VNUM_LAN") or None,
        trafficway_code=fields.known_code("VTRAFWAY"),
        alignment_code=fields.known_code("VALIGN"),
        profile_code=fields.known_code("VPROFILE"),
        surface_condition_code=fields.known_code("VSURCOND"),
        traffic_control_code=fields.known_code("VTRAFCON"),
        disobeyed_control=_disobeyed_control(fields),
        movement=PreCrashMovement.UNKNOWN if movement is None else PreCrashMovement(movement),
        critical_event_code=fields.known_code("P_CRASH2"),
        avoidance_code=fields.known_code("P_CRASH3"),
        stability_code=_stability(fields),
        location_code=fields.known_code("PCRASH5"),
        crash_type_code=fields.code("ACC_TYPE"),
        initial_impact_code=fields.code("IMPACT1"),
        damaged_areas=known_codes(fields.own_rows("damage"), "DAMAGE", "DAMAGE", "MDAREAS"),
        avoidance_manoeuvres=known_codes(fields.own_rows("maneuver"), "MANEUVER", "MANEUVER", "MDRMANAV"),
        rollover_code=fields.code("ROLLOVER"),
        hit_and_run=_is_said(fields, "HIT_RUN"),
        occupants=occupants,
    )


def read_parked_vehicle(fields: Fields) -> VehicleRecord:
    """Return a motor vehicle that was parked, or at work on the road, from its row in a report.

    The column names are those of moving vehicles with a leading P.

    >>> read_parked_vehicle(Fields({"VEH_NO": "2", "PBODYTYP": "4", "PTYPE": "2"}, "a report", 2023)).travel_speed_mps
    0.0
    """
    body = _read_body(fields, "P")
    initial = fields.code("IMPACT1", "PIMPACT1")
    stands = fields.code("UNITTYPE", "PTYPE") != _WORKING
    return VehicleRecord(
        **body | {"implied": (*body["implied"], *(("travel_speed_mps",) if stands else ()))},
        in_transport=False,
        travel_speed_mps=0.0 if stands else None,
        initial_impact_code=initial,
        impact=impact_area(initial),
    )


def _read_body(fields: Fields, p: str = "") -> dict[str, Any]:
    """Return the number of a vehicle and the fields on its body; ``p`` leads the columns of parked ones."""
    number = _number(fields)
    tow_code = fields.known_code("TOW_VEH", *(("PTRAILER", "PTOW_VEH") if p else ()))
    trailers = None if tow_code is None else codes.TRAILERS_OF_TOW_VEH[tow_code]
    body_type = fields.code("BODY_TYP", "PBODYTYP" if p else "BODY_TYP")
    derived = None if p else next(fields.own_rows("vpicdecode"), None)
    body, is_implied = body_of(
        BodyEvidence(
            body_type=body_type,
            model=fields.integer(f"{p}MODEL"),
            vpic_body_class=fields.integer(f"{p}VPICBODYCLASS"),
            gvwr_class=fields.integer(f"{p}GVWR_TO", f"{p}GVWR_FROM"),
            gvwr_old=fields.integer(f"{p}GVWR"),
            trailers=trailers or 0,
            curb_weight_lb=derived.decimal("CURBWEIGHTLB") if derived else None,
            wheelbase_in=derived.decimal("WHEELBASEIN_FROM", "WHEELBASEIN") if derived else None,
        )
    )
    make_model = " ".join((fields.text(f"{p}MAKENAME"), fields.text(f"{p}MODELNAME"))).strip()
    return {
        "number": number,
        **body.as_fields(),
        "body_type_code": BODY_TYP.known(body_type),
        "make_model": fields.text(f"{p}MAK_MODNAME") or make_model,
        "model_year": fields.within(1900, fields.year + 2, "PMODYEAR" if p else "MOD_YEAR"),
        "trailers": trailers,
        "trailer": trailer_of(body, tow_code, fields.integer(f"{p}TRLR1GVWR")),
        "implied": ("vehicle_class",) if is_implied else (),
    }


def _number(fields: Fields) -> int:
    """Return ``VEH_NO``, and add it to the vehicle's name in messages."""
    report, fields.where = fields.where, f"{fields.where}: vehicle"
    number = fields.integer("VEH_NO", low=1, high=999)
    if number is None:
        raise malformed(f"{fields.where} without VEH_NO; expected a number from 1 on")
    fields.where = f"{report}: vehicle {number}"
    return number


def _occupants(fields: Fields) -> tuple[Occupant, ...]:
    """Return the persons in a vehicle, in order of their numbers."""
    found = {}
    for person in fields.own_rows("person"):
        number, role = person.integer("PER_NO"), person.integer("PER_TYP")
        if number is None or role not in codes.VEHICLE_OCCUPANTS:
            continue
        restraint = person.integer("REST_USE")
        found[number] = Occupant(
            number,
            role,
            injury_code=code_table("INJ_SEV").known(person.integer("INJ_SEV")),
            age_years=person.within(0, codes.HIGHEST_AGE, "AGE"),
            restraint_code=None if restraint in _RESTRAINT_UNKNOWN else restraint,
        )
    return tuple(found[number] for number in sorted(found))


def _belted(driver: Occupant | None) -> bool | None:
    code = None if driver is None else driver.restraint_code
    return True if code in _BELTED else False if code in _UNBELTED else None


def _disobeyed_control(fields: Fields) -> bool | None:
    """Return whether the driver was charged with, or noted for, disobeying a signal or sign; None if nothing is known.

    >>> _disobeyed_control(Fields({"VEH_NO": "1", "DR_SF1": "0", "DR_SF2": "39"}, "a report", 2015))
    True
    """
    charges = {row.integer("VIOLATION", "MVIOLATN") for row in fields.own_rows("violatn")}
    factors = {fields.integer(f"DR_SF{number}") for number in (1, 2, 3, 4)}
    factors |= {row.integer("DRIVERRF") for row in fields.own_rows("driverrf")}
    if charges & codes.CHARGES_OF_CONTROL or codes.FACTOR_OF_CONTROL in factors:
        return True
    return False if (charges | factors) - codes.UNKNOWN_FACTORS else None


def _is_said(fields: Fields, element: str) -> bool | None:
    """Return whether the code of an element is not 0, "no"; None if it is not known."""
    code = fields.known_code(element)
    return None if code is None else code != 0


def _travel_speed(fields: Fields) -> tuple[float | None, bool]:
    """Return ``TRAV_SP`` in m/s, and whether it is only a lower bound."""
    speed_mph = fields.integer("TRAV_SP")
    if speed_mph is None or speed_mph in _SPEED_UNKNOWN:
        return None, False
    if speed_mph == _ABOVE_HIGHEST:
        return mph_to_mps(HIGHEST_REPORTED_MPH), True
    if not 0 <= speed_mph <= HIGHEST_REPORTED_MPH:
        raise UnknownCodeError("TRAV_SP", str(speed_mph), fields.year, f"0-{HIGHEST_REPORTED_MPH} mph, 997-999")
    return mph_to_mps(speed_mph), False


def _speed_limit(fields: Fields) -> float | None:
    limit_mph = fields.integer("VSPD_LIM")
    if limit_mph is None or limit_mph == _LIMIT_NONE or limit_mph in _LIMIT_UNKNOWN:
        return None
    if not 0 < limit_mph <= _HIGHEST_LIMIT_MPH:
        raise UnknownCodeError("VSPD_LIM", str(limit_mph), fields.year, f"0-{_HIGHEST_LIMIT_MPH} mph, 98, 99")
    return mph_to_mps(limit_mph)


def _stability(fields: Fields) -> int | None:
    """Return ``PCRASH4``, which CrashAPI serves as a label only."""
    code = fields.code("PCRASH4")
    if code is None:
        label = fields.text("PCRASH4NAME").lower()
        code = next((code for words, code in codes.PCRASH4_OF_LABEL if words in label), None) if label else None
        if label and code is None:
            expected = ", ".join(repr(words) for words, _ in codes.PCRASH4_OF_LABEL)
            raise UnknownCodeError("PCRASH4NAME", label, fields.year, f"a label with one of {expected}")
    return codes.PCRASH4.known(code)


# --- trailers --------------------------------------------------------------------------------------------------------
def trailer_of(body: ReportedBody, tow_code: int | None, gvwr_class: int | None = None) -> Trailer | None:
    """Return the trailer of a vehicle by its ``TOW_VEH``, or None without one.

    From 2020 on, the trailer's weight rating (``TRLR1GVWR``, 11 to 18) counts as well.

    >>> from trace_dag.crash.codes.bodies import BODIES
    >>> trailer_of(BODIES["pickup"], 0)
    >>> round(trailer_of(BODIES["tractor_of_trailer"], 1).combination_length_m, 2)
    21.14
    """
    if not codes.TRAILERS_OF_TOW_VEH.get(tow_code or 0, 0):
        return None
    kind, hitch_m = _LIGHT, body.length_m + _HITCH_BEHIND_M
    if tow_code in codes.TOWED_VEHICLES:
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
