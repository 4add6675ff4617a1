"""Crashes in which vehicles had event data recorders: a file of NHTSA CIREN cases as plain, checked types.

The file is a JSON list of cases, coded much like FARS (NHTSA, CIREN coding manual; CDC: SAE J224; recorders: 49 CFR
563). Unknown codes (997 to 999, 888, 777, 9999) and whatever is missing or no number become None: cases are never
refused for it, what lacks is said where it is needed.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from trace_dag.crash.codes.bodies import BodyEvidence, body_of
from trace_dag.errors import UserError
from trace_dag.sim.types import Body, BodyKind
from trace_dag.units import kmh_to_mps

LOAD_KG: Final = 100.0
"""Of occupants and luggage, on top of the curb mass."""

_VEHICLE = re.compile(r"\s*vehicle\s+(\d+)", re.IGNORECASE)
_UNKNOWN_FROM: Final = 770.0  # 777, 888, 997 to 999, 9999: no length, speed or angle of these is as large
_UNKNOWN_MASSES: Final = (9997.0, 9998.0, 9999.0, 99999.0)
_CLOCKWISE_FROM_NORTH: Final = math.pi / 2


@dataclass(frozen=True)
class Damage:
    """A Collision Deformation Classification (SAE J224) and its measures; metres, radians counter-clockwise from the
    vehicle's front. ``offset_m`` is of the middle of the direct damage: on a front or rear from the centre line to the
    left, on a side from the middle between the axles forward."""

    event: int
    side: str  # F, B, L, R, or another letter
    zone: str
    force_from_rad: float | None
    crush_m: float | None
    offset_m: float | None


@dataclass(frozen=True)
class Recording:
    """What a recorder says of one event: delta-v (m/s, ahead and to the left), speed at or just before the impact."""

    event: int | None
    ahead_mps: float
    left_mps: float | None
    speed_mps: float | None

    @property
    def delta_v_mps(self) -> float:
        """The whole change where both parts were recorded, else of the part along the vehicle."""
        return math.hypot(self.ahead_mps, self.left_mps or 0.0)


@dataclass(frozen=True)
class RecordedVehicle:
    """A vehicle of a case. ``body`` is None without a known mass; ``heading_rad`` as everywhere, east is 0.
    ``axles_middle_m`` is how far the middle between the axles is ahead of the body's."""

    number: int
    body: Body | None
    axles_middle_m: float
    heading_rad: float | None
    damages: tuple[Damage, ...]
    recordings: tuple[Recording, ...]
    reconstructed_mps: Mapping[int, float]  # delta-v by event

    def recording(self, event: int) -> Recording | None:
        """Of an event the largest change: modules of one vehicle record the same impact, and lesser ones with it."""
        of_event = [recording for recording in self.recordings if recording.event == event]
        return max(of_event, key=lambda recording: recording.delta_v_mps, default=None)

    def damage(self, event: int) -> Damage | None:
        """The first damage of an event."""
        return next((damage for damage in self.damages if damage.event == event), None)


@dataclass(frozen=True)
class RecordedEvent:
    """An event: a vehicle, its area, and the vehicle that it met (with its area) or the code of an object."""

    number: int
    vehicle: int
    area: str
    other_vehicle: int | None
    other_area: str
    object_code: int | None
    object_name: str


@dataclass(frozen=True)
class RecordedCrash:
    """A case of the file."""

    case: str
    events: tuple[RecordedEvent, ...]
    vehicles: Mapping[int, RecordedVehicle]


def read_recorded_crashes(path: Path) -> list[RecordedCrash]:
    """All cases of a file; :class:`UserError` for what is no such file."""
    wanted = "a JSON list of CIREN cases, each an object with the keys ciren, ev and V"
    try:
        cases = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path}: cannot be read as JSON ({error}); expected {wanted}") from None
    if not isinstance(cases, list) or not cases:
        raise UserError(f"{path}: found {_kind(cases)}; expected {wanted}")
    for k, case in enumerate(cases):
        if not isinstance(case, dict) or not isinstance(case.get("V"), dict):
            found = f"the keys {', '.join(map(str, case))}" if isinstance(case, dict) else _kind(case)
            raise UserError(f"{path}: case {k} has {found or 'no keys'}; expected {wanted}")
    return [_crash(case, k) for k, case in enumerate(cases)]


def _kind(value: object) -> str:
    if value == []:
        return "an empty list"
    return {dict: "an object", list: "a list", str: "a text", bool: "a truth value"}.get(type(value), "a number")


def _crash(case: Mapping[str, Any], k: int) -> RecordedCrash:
    events = tuple(event for row in _rows(case.get("ev")) if (event := _event(row)) is not None)
    vehicles = {}
    for name, values in case["V"].items():
        if str(name).isdigit() and isinstance(values, dict):
            vehicles[int(name)] = _vehicle(int(name), values)
    name = case.get("ciren") or case.get("case") or f"#{k}"
    return RecordedCrash(str(name), events, vehicles)


def _event(row: object) -> RecordedEvent | None:
    if not isinstance(row, list) or len(row) < 7:
        return None
    number, vehicle, area, _, code, name, other_area = row[:7]
    if not isinstance(number, int) or not isinstance(vehicle, int):
        return None
    met = _VEHICLE.match(str(name))
    return RecordedEvent(
        number=number,
        vehicle=vehicle,
        area=str(area),
        other_vehicle=int(met.group(1)) if met else None,
        other_area=str(other_area),
        object_code=None if met or not isinstance(code, int) else code,
        object_name=str(name),
    )


def _vehicle(number: int, values: Mapping[str, Any]) -> RecordedVehicle:
    heading_deg = _number(values.get("angthis"), low=0.0, high=360.0)
    damages = tuple(_damage(row) for row in _rows(values.get("cdc")) if isinstance(row, dict))
    return RecordedVehicle(
        number=number,
        body=_body(values),
        axles_middle_m=_axles_middle_m(values),
        heading_rad=None if heading_deg is None else _CLOCKWISE_FROM_NORTH - math.radians(heading_deg),
        damages=damages,
        recordings=_recordings(values),
        reconstructed_mps={
            int(row["ev"]): kmh_to_mps(delta_v)
            for row in _rows(values.get("cdc"))
            if isinstance(row, dict) and _number(row.get("ev")) and (delta_v := _number(row.get("dvt"))) is not None
        },
    )


def _body(values: Mapping[str, Any]) -> Body | None:
    mass_kg = _number(values.get("curb"), low=100.0, high=60_000.0, unknown_from=math.inf)
    if mass_kg is None or mass_kg in _UNKNOWN_MASSES:
        return None
    code = _number(values.get("body"))
    kind, _ = body_of(BodyEvidence(body_type=None if code is None else int(code)))
    length_cm, width_cm = _number(values.get("oal"), low=150.0), _number(values.get("wid"), low=50.0)
    return Body(
        kind=BodyKind.MOTOR_VEHICLE,
        vehicle_class=kind.vehicle_class,
        length_m=kind.length_m if length_cm is None else length_cm / 100,
        width_m=kind.width_m if width_cm is None else width_cm / 100,
        height_m=kind.height_m,
        mass_kg=mass_kg + LOAD_KG,
    )


def _axles_middle_m(values: Mapping[str, Any]) -> float:
    length, base, overhang = (_number(values.get(key), low=10.0) for key in ("oal", "wb_cm", "foh"))
    return 0.0 if length is None or base is None or overhang is None else (length / 2 - overhang - base / 2) / 100


def _damage(row: Mapping[str, Any]) -> Damage:
    code = str(row.get("cdc") or "").ljust(8)
    side = code[2]
    force_deg = _number(row.get("pdof"), low=0.0, high=360.0)
    crush_cm, offset_cm = _number(row.get("cmax"), low=0.0), _number(row.get("dd"), low=-700.0)
    sign = -1.0 if side in "FB" else 1.0  # the file counts offsets of fronts to the right
    return Damage(
        event=int(_number(row.get("ev")) or 0),
        side=side,
        zone=code[3],
        force_from_rad=None if force_deg is None else math.remainder(-math.radians(force_deg), math.tau),
        crush_m=None if crush_cm is None else crush_cm / 100,
        offset_m=None if offset_cm is None else sign * offset_cm / 100,
    )


def _recordings(values: Mapping[str, Any]) -> tuple[Recording, ...]:
    speeds = values.get("sp")
    speeds = speeds if isinstance(speeds, dict) else {}
    found = []
    for row in _rows(values.get("edr")):
        if not isinstance(row, dict):
            continue
        ahead, left = _number(row.get("dvl"), low=-300.0), _number(row.get("dvla"), low=-300.0)
        event = _number(row.get("cdcev"))
        if ahead is None:
            continue
        found.append(
            Recording(
                event=None if event is None else int(event),
                ahead_mps=kmh_to_mps(ahead),
                left_mps=None if left is None else -kmh_to_mps(left),  # recorders count to the right (SAE J211)
                speed_mps=_last_speed_mps(speeds.get(str(row.get("no")))),
            )
        )
    return tuple(found)


def _last_speed_mps(samples: object) -> float | None:
    """The sample nearest to the impact that is known."""
    known = [
        (time_s, speed)
        for sample in _rows(samples)
        if isinstance(sample, list) and len(sample) == 2
        if (time_s := _number(sample[0], low=-60.0)) is not None
        if (speed := _number(sample[1], low=0.0, high=300.0)) is not None
    ]
    return kmh_to_mps(max(known)[1]) if known else None


def _rows(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _number(
    value: object, *, low: float = -math.inf, high: float = math.inf, unknown_from: float = _UNKNOWN_FROM
) -> float | None:
    """A known number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value) if low <= value <= high and abs(value) < unknown_from else None
