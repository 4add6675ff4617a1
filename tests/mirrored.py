"""Crashes in a mirror: as they would be reported where traffic keeps the other side."""

from __future__ import annotations

from dataclasses import replace

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.derive import impact_area
from trace_dag.crash.record import (
    CrashRecord,
    EventRecord,
    ImpactArea,
    NonMotorist,
    PreCrashMovement,
    VehicleRecord,
)


def _pairs(*pairs: tuple[int, int]) -> dict[int, int]:
    return {one: other for pair in pairs for one, other in (pair, pair[::-1])}


_TYPES = _pairs(
    *((right, right + 5) for right in range(1, 6)),  # off the right, the left edge
    *((first + 2, first + 3) for first in (20, 24, 28)),  # struck from behind turning left, right
    (46, 47), (70, 72), (71, 73), (76, 78), (77, 79), (80, 82), (81, 83), (86, 88), (87, 89),
)  # fmt: skip
_MOVEMENTS = {
    PreCrashMovement.TURNING_LEFT: PreCrashMovement.TURNING_RIGHT,
    PreCrashMovement.TURNING_RIGHT: PreCrashMovement.TURNING_LEFT,
}
_CRITICAL = _pairs((10, 11), (12, 13), (15, 16), (60, 61), (65, 67), (70, 72))  # P_CRASH2
_EVENTS = _pairs((codes.RAN_OFF_RIGHT, codes.RAN_OFF_LEFT))
_CLOCK = _pairs((1, 11), (2, 10), (3, 9), (4, 8), (5, 7), (61, 81), (62, 82), (63, 83))
_COMPASS = _pairs((2, 4))  # east, west
_CURVES = _pairs((2, 3))  # VALIGN
_AVOIDANCE = _pairs((6, 7), (8, 9), (11, 12))  # P_CRASH3: steered left, right
_SKIDS = _pairs((4, 5))  # PCRASH4: clockwise, counter-clockwise


def mirror_record(record: CrashRecord, axis_deg: float) -> CrashRecord:
    """Return a report of the same crash in a mirror along a meridian, with traffic on the left."""
    return replace(
        record,
        longitude_deg=2 * axis_deg - record.longitude_deg,
        vehicles=tuple(map(_vehicle, record.vehicles)),
        events=tuple(map(_event, record.events)),
        non_motorists=tuple(map(_person, record.non_motorists)),
    )


def _area(area: ImpactArea | None) -> ImpactArea | None:
    return None if area is None else impact_area(_CLOCK.get(area.code, area.code))


def _vehicle(vehicle: VehicleRecord) -> VehicleRecord:
    return replace(
        vehicle,
        keeps_left=not vehicle.keeps_left,
        crash_type_code=_TYPES.get(vehicle.crash_type_code, vehicle.crash_type_code),
        movement=_MOVEMENTS.get(vehicle.movement, vehicle.movement),
        critical_event_code=_CRITICAL.get(vehicle.critical_event_code, vehicle.critical_event_code),
        avoidance_code=_AVOIDANCE.get(vehicle.avoidance_code, vehicle.avoidance_code),
        stability_code=_SKIDS.get(vehicle.stability_code, vehicle.stability_code),
        alignment_code=_CURVES.get(vehicle.alignment_code, vehicle.alignment_code),
        impact=_area(vehicle.impact),
        initial_impact_code=_CLOCK.get(vehicle.initial_impact_code, vehicle.initial_impact_code),
        damaged_areas=tuple(_CLOCK.get(code, code) for code in vehicle.damaged_areas),
    )


def _event(event: EventRecord) -> EventRecord:
    code = _EVENTS.get(event.code, event.code)
    return replace(event, code=code, area_1=_area(event.area_1), area_2=_area(event.area_2))


def _person(person: NonMotorist) -> NonMotorist:
    scenario = person.scenario[:-1] + {"a": "b", "b": "a"}.get(person.scenario[-1:], person.scenario[-1:])
    directions = ("pedestrian_direction_code", "motorist_direction_code")
    turned = {name: _COMPASS.get(code := getattr(person, name), code) for name in directions}
    return replace(person, scenario=scenario, **turned)
