"""Crashes in which vehicles had event data recorders: a file of NHTSA CIREN cases as plain, checked types.

The file is a JSON list of cases, coded much like FARS (NHTSA, CIREN coding manual; CDC: SAE J224; recorders: 49 CFR
563). Numbers may be written as text. Unknown codes (997 to 999, 888, 777, 9999) and whatever is missing or no number
become None: cases are never refused for it, what lacks is said where it is needed. An entry that is no case is kept
with the reason, as long as the file has cases."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from trace_dag.common.errors import UserError
from trace_dag.common.units import GRAVITY_MPS2, kmh_to_mps, mps_to_kmh
from trace_dag.crash.codes.bodies import BodyEvidence, body_of
from trace_dag.simulation.types import Body, BodyKind

LOAD_KG: Final = 100.0
"""Mass of occupants and luggage, on top of the curb mass and of the cargo that is known."""

_VEHICLE = re.compile(r"\s*vehicle\s+(\d+)", re.IGNORECASE)
_MOST_VEHICLES: Final = 30  # codes of what was struck: up to this a vehicle of the crash, beyond it a kind of object
_FASTEST_KMH: Final = 300.0
_STALE_S: Final = 0.4  # a last sample that is said to be so long before the impact was taken at no fixed time before it
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
    heading_rad: float | None  # of the vehicle at this event


@dataclass(frozen=True)
class Recording:
    """A recorder's record of one event: delta-v (m/s, ahead and to the left; at least one is known), speed at or just
    before the impact.
    """

    event: int | None
    ahead_mps: float | None
    left_mps: float | None
    speed_mps: float | None

    @property
    def delta_v_mps(self) -> float:
        """Return the whole change where both parts were recorded, else the one that was."""
        return math.hypot(self.ahead_mps or 0.0, self.left_mps or 0.0)

    @property
    def whole(self) -> bool:
        """Return whether both parts were recorded."""
        return self.ahead_mps is not None and self.left_mps is not None


@dataclass(frozen=True)
class RecordedVehicle:
    """A vehicle of a case. ``body`` is None without a known mass; ``heading_rad`` as everywhere, east is 0.
    ``seen_heading_rad`` is what is noted with it of the other vehicle's heading, ``axles_middle_m`` how far the middle
    between the axles is ahead of the body's."""

    number: int
    body: Body | None
    axles_middle_m: float
    heading_rad: float | None
    seen_heading_rad: float | None
    damages: tuple[Damage, ...]
    recordings: tuple[Recording, ...]
    speeds_mps: Mapping[int, float]  # at or just before the impact by event, also where the change was not recorded
    braked: Mapping[int, bool]  # whether the brake was on then, by event
    reconstructed_mps: Mapping[int, float]  # delta-v by event

    def recording(self, event: int) -> Recording | None:
        """Return the largest change of an event: modules of one vehicle record the same impact, and lesser ones with
        it.
        """
        of_event = [recording for recording in self.recordings if recording.event == event]
        return max(of_event, key=lambda recording: recording.delta_v_mps, default=None)

    def locked_wheels(self, event: int) -> float | None:
        """Return the share of its weight on braked wheels at the impact: all of it with the brake on, None where it was
        not.

        A vehicle whose brake was on goes on braking as the pulse lasts, and the recorder counts it: 0.1 s of it are
        2 km/h."""
        return 1.0 if self.braked.get(event) else None

    def damage(self, event: int) -> Damage | None:
        """Return the first damage of an event."""
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
    """A case of the file; ``unreadable`` is the reason if it has no vehicles."""

    case: str
    events: tuple[RecordedEvent, ...]
    vehicles: Mapping[int, RecordedVehicle]
    unreadable: str | None = None


def read_recorded_crashes(path: Path) -> list[RecordedCrash]:
    """Return all cases of a file; :class:`UserError` for what is no such file."""
    wanted = "a JSON list of CIREN cases, each an object with the keys ciren, ev and V"
    try:
        cases = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path}: cannot be read as JSON ({error}); expected {wanted}") from None
    if not isinstance(cases, list) or not cases:
        raise UserError(f"{path}: found {_kind(cases)}; expected {wanted}")
    if not any(isinstance(case, dict) and "V" in case for case in cases):
        raise UserError(f"{path}: case 0 has {_found(cases[0])}; expected {wanted}")
    return [_crash(case, k) for k, case in enumerate(cases)]


def _kind(value: object) -> str:
    if value == []:
        return "an empty list"
    kinds = {dict: "an object", list: "a list", str: "a text", bool: "a truth value", type(None): "nothing"}
    return kinds.get(type(value), "a number")


def _found(case: object) -> str:
    return f"the keys {', '.join(map(str, case)) or '(none)'}" if isinstance(case, dict) else _kind(case)


def _crash(case: object, k: int) -> RecordedCrash:
    values = case if isinstance(case, dict) else {}
    names = (values.get(key) for key in ("ciren", "case", "number"))
    name = next((str(name) for name in names if isinstance(name, str | int | float) and str(name).strip()), f"#{k}")
    listed = values.get("V")
    if not isinstance(listed, dict) or not listed:
        lacks = "its vehicles, V, are not known" if "V" in values else f"not a case: it has {_found(case)}"
        return RecordedCrash(name, (), {}, lacks)
    vehicles = {}
    for key, of_vehicle in listed.items():
        number = _whole(key)
        if number is None:
            return RecordedCrash(name, (), {}, f"one of its vehicles has {key!r} for a number")
        vehicles[number] = _vehicle(number, of_vehicle if isinstance(of_vehicle, dict) else {})
    events = (_event(row) for row in _rows(values.get("ev")))
    return RecordedCrash(name, tuple(event for event in events if event is not None), vehicles)


def _event(row: object) -> RecordedEvent | None:
    if not isinstance(row, list) or len(row) < 5:
        return None
    number, vehicle, area, _, code, name, other_area = [*row, None, None][:7]
    event, by = _whole(number), _whole(vehicle)
    if event is None or by is None:
        return None
    met, what = _VEHICLE.match(str(name)), _whole(code)
    other = int(met.group(1)) if met else what if what is not None and 1 <= what <= _MOST_VEHICLES else None
    return RecordedEvent(
        number=event,
        vehicle=by,
        area=_area(area),
        other_vehicle=other,
        other_area=_area(other_area),
        object_code=None if other is not None else what,
        object_name=str(name or "an object that is not named"),
    )


def _area(value: object) -> str:
    return value.strip().upper() if isinstance(value, str) else ""


def _vehicle(number: int, values: Mapping[str, Any]) -> RecordedVehicle:
    damages = tuple(_damage(row) for row in _rows(values.get("cdc")) if isinstance(row, dict))
    recordings, speeds_mps = _recordings(values)
    braked: dict[int, bool] = {}
    for row in _rows(values.get("edr")):
        event = _whole(row.get("cdcev")) if isinstance(row, dict) else None
        on = None if event is None else _brake_on(_samples_by_number(values.get("br")).get(_whole(row.get("no"))))
        if event is not None and on is not None:
            braked[event] = braked.get(event, False) or on
    return RecordedVehicle(
        number=number,
        body=_body(values),
        axles_middle_m=_axles_middle_m(values),
        heading_rad=_heading_rad(values.get("angthis")),
        seen_heading_rad=_heading_rad(values.get("angoth")),
        damages=damages,
        recordings=recordings,
        speeds_mps=speeds_mps,
        braked=braked,
        reconstructed_mps={
            event: kmh_to_mps(delta_v)
            for row in _rows(values.get("cdc"))
            if isinstance(row, dict) and (event := _whole(row.get("ev"))) is not None
            if (delta_v := _number(row.get("dvt"), low=0.0)) is not None
        },
    )


def _heading_rad(value: object) -> float | None:
    clockwise_deg = _number(value, low=-360.0, high=360.0)
    return None if clockwise_deg is None else _CLOCKWISE_FROM_NORTH - math.radians(clockwise_deg)


def _body(values: Mapping[str, Any]) -> Body | None:
    mass_kg = _number(values.get("curb"), low=100.0, high=60_000.0, unknown_from=math.inf)
    if mass_kg is None or mass_kg in _UNKNOWN_MASSES:
        return None
    cargo_kg = _number(values.get("cargo"), low=0.0, high=60_000.0, unknown_from=math.inf)
    if cargo_kg is None or cargo_kg in _UNKNOWN_MASSES:
        cargo_kg = 0.0
    kind, _ = body_of(BodyEvidence(body_type=_whole(values.get("body"))))
    length_cm, width_cm = _number(values.get("oal"), low=150.0), _number(values.get("wid"), low=50.0)
    return Body(
        kind=BodyKind.MOTOR_VEHICLE,
        vehicle_class=kind.vehicle_class,
        length_m=kind.length_m if length_cm is None else length_cm / 100,
        width_m=kind.width_m if width_cm is None else width_cm / 100,
        height_m=kind.height_m,
        mass_kg=mass_kg + cargo_kg + LOAD_KG,
    )


def _axles_middle_m(values: Mapping[str, Any]) -> float:
    length, base, overhang = (_number(values.get(key), low=10.0) for key in ("oal", "wb_cm", "foh"))
    return 0.0 if length is None or base is None or overhang is None else (length / 2 - overhang - base / 2) / 100


def _damage(row: Mapping[str, Any]) -> Damage:
    code = str(row.get("cdc") or "").strip().upper().ljust(8)
    side = code[2]
    force_deg = _number(row.get("pdof"), low=-360.0, high=360.0)
    crush_cm, offset_cm = _number(row.get("cmax"), low=0.0), _number(row.get("dd"), low=-700.0)
    sign = -1.0 if side in "FB" else 1.0  # the file counts offsets of fronts to the right
    return Damage(
        event=_whole(row.get("ev")) or 0,
        side=side,
        zone=code[3],
        force_from_rad=None if force_deg is None else math.remainder(-math.radians(force_deg), math.tau),
        crush_m=None if crush_cm is None else crush_cm / 100,
        offset_m=None if offset_cm is None else sign * offset_cm / 100,
        heading_rad=_heading_rad(row.get("head")),
    )


def _recordings(values: Mapping[str, Any]) -> tuple[tuple[Recording, ...], dict[int, float]]:
    """Return the recorded changes of velocity, and the speed at each event (m/s) that a recorder has one of.

    The modules of a vehicle, and the pages of one, share the impact: where the one with the change has no speed,
    another's of the same event is its.
    """
    samples = _samples_by_number(values.get("sp"))
    rows = [row for row in _rows(values.get("edr")) if isinstance(row, dict)]
    numbers = [_whole(row.get("no")) for row in rows]
    speeds = [None if number is None else _speed_at_impact_mps(samples.get(number)) for number in numbers]
    at_event: dict[int, float] = {}
    for row, speed in zip(rows, speeds, strict=True):
        event = _whole(row.get("cdcev"))
        if event is not None and speed is not None:
            at_event.setdefault(event, speed)
    found = []
    for row, speed in zip(rows, speeds, strict=True):
        ahead, right = (_number(row.get(key), low=-_FASTEST_KMH, high=_FASTEST_KMH) for key in ("dvl", "dvla"))
        if ahead is None and right is None:
            continue
        event = _whole(row.get("cdcev"))
        found.append(
            Recording(
                event=event,
                ahead_mps=None if ahead is None else kmh_to_mps(ahead),
                left_mps=None if right is None else -kmh_to_mps(right),  # recorders count to the right (SAE J211)
                speed_mps=speed if speed is not None or event is None else at_event.get(event),
            )
        )
    return tuple(found), at_event


def _samples_by_number(listed: object) -> dict[int | None, object]:
    """Return the samples of each recording."""
    by_key = listed if isinstance(listed, dict) else {}
    return {number: each for key, each in by_key.items() if (number := _whole(key)) is not None}


def _brake_on(samples: object) -> bool | None:
    """Return the last sample of the brake's switch before the impact; None where none is known."""
    known = [(time_s, on) for time_s, on in _before_impact(samples, high=1.0) if on in (0.0, 1.0)]
    return bool(known[-1][1]) if known else None


def _before_impact(samples: object, *, high: float) -> list[tuple[float, float]]:
    """Return the known samples from 0 to a value, with their times (s, negative), in the order of time."""
    found = [
        (time_s, value)
        for sample in _rows(samples)
        if isinstance(sample, list) and len(sample) >= 2
        if (time_s := _number(sample[0], low=-60.0, high=60.0)) is not None
        if (value := _number(sample[1], low=0.0, high=high)) is not None
    ]
    counts_back = all(time_s >= 0.0 for time_s, _ in found)
    return sorted((-abs(time_s), value) for time_s, value in found if counts_back or time_s <= 0.0)


def _speed_at_impact_mps(samples: object) -> float | None:
    """Return the sample nearest to the impact that is known; where it is said to be half a second before it or more,
    who slowed down goes on doing so for half of that time.

    Recorders of one maker sample every half or whole second whatever happens, and count the last sample as a whole
    interval before the impact: it is anything between that and none (Wilkinson et al., SAE 2006-01-1397), half of it
    on average. In the 180 recorders of the public cases with a sample at the impact, this errs by 0 km/h on average for
    vehicles that slow down. The last sample errs by +6 (every second) and +4 (every half), and slowing for the whole
    interval by -4 and -3."""
    known = _before_impact(samples, high=_FASTEST_KMH)
    if not known:
        return None
    (before_s, before_kmh), (last_s, last_kmh) = known[-2:] if len(known) > 1 else (known[0], known[0])
    if last_s > -_STALE_S or last_kmh >= before_kmh:
        return kmh_to_mps(last_kmh)
    slows_kmhps = (before_kmh - last_kmh) / (last_s - before_s)
    if slows_kmhps > mps_to_kmh(GRAVITY_MPS2):  # no brakes do that: something was struck before
        return kmh_to_mps(last_kmh)
    return kmh_to_mps(max(last_kmh + slows_kmhps * max(last_s, -1.0) / 2, 0.0))


def _rows(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _number(
    value: object, *, low: float = -math.inf, high: float = math.inf, unknown_from: float = _UNKNOWN_FROM
) -> float | None:
    """Return a known number within bounds, also one that is written as text."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) and low <= number <= high and abs(number) < unknown_from else None


def _whole(value: object) -> int | None:
    """Return a known number that counts something."""
    number = _number(value, low=0.0)
    return None if number is None or number != int(number) else int(number)
