"""Body types and the bodies they amount to in a reconstruction.

``BODY_TYP`` names the kind of body; where it is missing or unknown, vPIC's body class, the FARS model code's range and
the weight rating say what they can. Dimensions and masses are typical of the US fleet: lengths, widths and heights
after manufacturers' data of best sellers of each kind, curb masses after EPA's Automotive Trends Report for light
vehicles and FHWA's vehicle types for trucks and buses, all in running order with a driver.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from trace_dag.common.data_files import read_csv
from trace_dag.common.units import KG_PER_LB, METRES_PER_FOOT
from trace_dag.crash.codes.table import code_table
from trace_dag.crash.record import VehicleClass

DRIVER_KG: Final = 80.0
_METRES_PER_INCH: Final = METRES_PER_FOOT / 12
_MAX_PLAUSIBLE_CURB_LB: Final = 30_000
_PLAUSIBLE_WHEELBASE_IN: Final = (40.0, 300.0)
BODY_TYP = code_table("BODY_TYP")


@dataclass(frozen=True)
class ReportedBody:
    """A body to simulate: its class, dimensions (m) and mass (kg); ``wheelbase_ratio`` is length over wheelbase."""

    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    wheelbase_ratio: float | None = None

    def as_fields(self) -> dict[str, Any]:
        """Return the fields that it gives a :class:`~trace_dag.crash.record.VehicleRecord`."""
        return {name: value for name, value in vars(self).items() if name != "wheelbase_ratio"}


_ROWS: Final = read_csv("trace_dag.crash.codes", "bodies.csv")
BODIES: Final[Mapping[str, ReportedBody]] = {
    row["name"]: ReportedBody(
        vehicle_class=VehicleClass(row["class"]),
        length_m=float(row["length_m"]),
        width_m=float(row["width_m"]),
        height_m=float(row["height_m"]),
        mass_kg=int(row["mass_kg"]),
        wheelbase_ratio=float(row["wheelbase_ratio"]) if row["wheelbase_ratio"] else None,
    )
    for row in _ROWS
}
"""Bodies by name, as in ``bodies.csv``, which also has the codes of each."""


def _by_code(column: str) -> dict[int, ReportedBody]:
    """Return bodies by the codes in a column, which has single ones and ranges (``421-430``)."""
    found: dict[int, ReportedBody] = {}
    for row in _ROWS:
        for codes in row[column].split():
            first, _, last = codes.partition("-")
            found |= dict.fromkeys(range(int(first), int(last or first) + 1), BODIES[row["name"]])
    return found


_OF_BODY_TYP: Final = _by_code("body_types")
_OF_VPIC_BODY_CLASS: Final = _by_code("vpic_body_classes")  # those that a reconstruction tells apart
_OF_MODEL: Final = _by_code("models")  # cars below 400, light trucks in the 400s, cycles in the 700s, ...
_TRACTOR: Final = BODIES["tractor"]
_MEDIUM_TRUCK, _LARGE_TRUCK, _HEAVY_TRUCK = (BODIES[f"{size}_truck"] for size in ("medium", "large", "heavy"))
_MOST_FREQUENT: Final = BODIES["sedan"]  # a vehicle of unknown kind is taken for one, and its record marks that

GVWR_LIMIT_LB: Final = {11: 6_000, 12: 10_000, 13: 14_000, 14: 16_000, 15: 19_500, 16: 26_000, 17: 33_000, 18: 60_000}
"""Upper bound of the classes of ``GVWR_FROM`` and ``GVWR_TO`` (2020 on)."""
LOADED_SHARE: Final = 0.75
"""Typical mass of a medium or heavy single-unit truck on the road, as a share of its weight rating."""
_RATED: Final = (_MEDIUM_TRUCK, _LARGE_TRUCK, _HEAVY_TRUCK)


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
    body = _OF_BODY_TYP[known] if known in _OF_BODY_TYP else _implied_kind(evidence)
    if body is _TRACTOR and evidence.trailers:
        return BODIES["tractor_of_trailer"], known is None
    return _refined(body, evidence), known is None


def _implied_kind(evidence: BodyEvidence) -> ReportedBody:
    if evidence.vpic_body_class in _OF_VPIC_BODY_CLASS:
        return _OF_VPIC_BODY_CLASS[evidence.vpic_body_class]
    if evidence.model in _OF_MODEL:
        body = _OF_MODEL[evidence.model]
        # Tractors and straight trucks share their model codes; only the heaviest tow a trailer.
        return _TRACTOR if body is _HEAVY_TRUCK and evidence.trailers else body
    gvwr_class = evidence.gvwr_class if evidence.gvwr_class in GVWR_LIMIT_LB else 0  # 98 and 99: not known
    if evidence.gvwr_old == 3 or gvwr_class >= 17:
        return _HEAVY_TRUCK
    if evidence.gvwr_old == 2 or gvwr_class >= 13:
        return _MEDIUM_TRUCK
    return _MOST_FREQUENT


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
