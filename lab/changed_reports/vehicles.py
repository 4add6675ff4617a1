"""Changes to a report's values of the two vehicles: impact areas, movements, speeds and bodies.

Each function changes the report in place and returns the change in words; None where it does not apply.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from lab.changed_reports.report import ChangedReport, code_in, exchange, put, remove
from lab.changed_reports.scene import PerturbedScene
from trace_dag.crash.codes.bodies import BODY_TYP
from trace_dag.crash.codes.elements import ACC_TYPE, IMPACT1, P_CRASH1, P_CRASH2
from trace_dag.crash.fields import Row
from trace_dag.crash.record import PreCrashMovement

_HOUR_OF_SIDE: Final = {61: 9, 62: 10, 63: 8, 81: 3, 82: 2, 83: 4}
_MIRRORED_SIDE: Final = {61: 81, 62: 82, 63: 83, 81: 61, 82: 62, 83: 63}
_CRITICAL_EVENT_OF: Final = {
    PreCrashMovement.TURNING_RIGHT: 16,
    PreCrashMovement.TURNING_LEFT: 15,
    PreCrashMovement.BACKING: 20,
    PreCrashMovement.U_TURN: 21,
}
"""``P_CRASH2`` values that repeat the vehicle's own movement (``P_CRASH1``)."""
_PASSING_THROUGH: Final = 17
_OTHER_EVENT: Final = 98
_FASTEST_MPH: Final = 151
_BODY_EVIDENCE: Final = (
    *("MODEL", "MODELNAME", "MAK_MOD", "MAK_MODNAME", "VPICBODYCLASS", "GVWR", "GVWR_FROM", "GVWR_TO"),
)


# --- clocks ----------------------------------------------------------------------------------------------------------
def turned(area: int, hours: int) -> int:
    """Return an area of the body so many hours further round, clockwise; sides by their middle; others (top) stay.

    >>> turned(11, 2), turned(13, 2)
    (1, 13)
    """
    hour = _HOUR_OF_SIDE.get(area, area)
    return (hour + hours - 1) % 12 + 1 if 1 <= hour <= 12 else area


def turn_clocks(report: ChangedReport, scene: PerturbedScene, *, hours: int, both: bool) -> str | None:
    """Return ``IMPACT1``, the areas of all events and the damage of vehicle 1 of the pair (or of both), turned alike.

    >>> report = ChangedReport(report_xml)  # vehicle 1 struck at 3 o'clock
    >>> turn_clocks(report, perturbed_scene, hours=4, both=False), code_in(report.vehicle(1), "IMPACT1")
    ('areas of vehicle 1 turned by 4 h', 7)
    """
    numbers = scene.vehicles if both else scene.vehicles[:1]
    for number in numbers:
        report.change_areas(number, lambda area: turned(area, hours))
    return f"areas of vehicle {' and '.join(map(str, numbers))} turned by {hours} h"


def random_clocks(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the areas of each vehicle, turned together by hours drawn from 0 to 11, so that any clock is as likely.

    >>> random_clocks(ChangedReport(report_xml), perturbed_scene).count(" h")  # drawn for each vehicle
    2
    """
    words = []
    for number in scene.pair:
        hours = int(scene.rng.integers(12))
        report.change_areas(number, lambda area, by=hours: turned(area, by))  # type: ignore[misc]
        words.append(f"vehicle {number} by {hours} h")
    return "areas turned: " + ", ".join(words)


def swap_clocks(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the areas of the one vehicle reported of the other: initial impacts, those of their collisions, damage.

    >>> report = ChangedReport(report_xml)  # vehicle 1 struck at 3 o'clock, vehicle 2 at 1 o'clock
    >>> swap_clocks(report, perturbed_scene), [code_in(vehicle, "IMPACT1") for vehicle in report.vehicles()]
    ('areas of the two vehicles exchanged', [1, 3])
    """
    report.swap_areas(*scene.pair)
    return "areas of the two vehicles exchanged"


def mirror_clocks(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the left for right in all areas of both vehicles.

    >>> report = ChangedReport(report_xml)  # vehicle 1 struck at 3 o'clock, vehicle 2 at 1 o'clock
    >>> mirror_clocks(report, perturbed_scene), [code_in(vehicle, "IMPACT1") for vehicle in report.vehicles()]
    ('areas of both vehicles mirrored', [9, 11])
    """
    for number in scene.pair:
        report.change_areas(number, _mirrored)
    return "areas of both vehicles mirrored"


def _mirrored(area: int) -> int:
    return (12 - area) or 12 if 1 <= area <= 12 else _MIRRORED_SIDE.get(area, area)


# --- movements -------------------------------------------------------------------------------------------------------
def change_movements(
    report: ChangedReport, scene: PerturbedScene, *, to: Mapping[PreCrashMovement, PreCrashMovement]
) -> str | None:
    """Return ``P_CRASH1`` of both vehicles by a table, and ``P_CRASH2`` where it repeats the vehicle's own turn.

    ``ACC_TYPE``, which speaks of both vehicles, stays.

    >>> right_for_left = {PreCrashMovement.TURNING_LEFT: PreCrashMovement.TURNING_RIGHT}
    >>> change_movements(ChangedReport(report_xml), perturbed_scene, to=right_for_left)
    'vehicle 1 was turning right'
    """
    words = []
    for number in scene.vehicles:
        vehicle = report.vehicle(number)
        code = code_in(vehicle, "P_CRASH1") if vehicle is not None else None
        if vehicle is None or code is None or code not in P_CRASH1.meanings or PreCrashMovement(code) not in to:
            continue
        movement = to[PreCrashMovement(code)]
        put(vehicle, "P_CRASH1", int(movement))
        if code_in(vehicle, "P_CRASH2") in _CRITICAL_EVENT_OF.values():
            event = _CRITICAL_EVENT_OF.get(movement, _PASSING_THROUGH)
            put(vehicle, "P_CRASH2", event if P_CRASH2.holds(event, scene.record.case_year) else _OTHER_EVENT)
        words.append(f"vehicle {number} {P_CRASH1.meaning(int(movement))}")
    return ", ".join(words) or None


# --- speeds ----------------------------------------------------------------------------------------------------------
def swap_speeds(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``TRAV_SP`` of the two vehicles exchanged, where both are reported.

    >>> report = ChangedReport(report_xml)  # 14 and 30 mph
    >>> swap_speeds(report, perturbed_scene), [code_in(vehicle, "TRAV_SP") for vehicle in report.vehicles()]
    ('speeds of the two vehicles exchanged', [30, 14])
    """
    one, two = (report.vehicle(number) for number in scene.pair)
    if one is None or two is None or any(not _has_speed(each) for each in (one, two)):
        return None
    exchange(one, two, "TRAV_SP")
    return "speeds of the two vehicles exchanged"


def set_speeds(report: ChangedReport, scene: PerturbedScene, *, mph: int) -> str | None:
    """Return ``TRAV_SP`` of both vehicles, where it is reported.

    >>> set_speeds(ChangedReport(report_xml), perturbed_scene, mph=150)
    'vehicle 1 and 2 at 150 mph'
    """
    numbers = []
    for number in scene.vehicles:
        vehicle = report.vehicle(number)
        if vehicle is not None and _has_speed(vehicle):
            put(vehicle, "TRAV_SP", mph)
            numbers.append(number)
    return f"vehicle {' and '.join(map(str, numbers))} at {mph} mph" if numbers else None


def _has_speed(vehicle: Row) -> bool:
    speed = code_in(vehicle, "TRAV_SP")
    return speed is not None and 0 <= speed <= _FASTEST_MPH


# --- crash types -----------------------------------------------------------------------------------------------------
def set_crash_types(report: ChangedReport, scene: PerturbedScene, *, codes: tuple[int, int]) -> str | None:
    """Return ``ACC_TYPE`` of the two vehicles, in the order of their numbers.

    >>> set_crash_types(ChangedReport(report_xml), perturbed_scene, codes=(50, 51))  # head-on
    'ACC_TYPE 50 and 51'
    """
    done = [
        put(vehicle, "ACC_TYPE", code)
        for number, code in zip(scene.pair, codes, strict=True)
        if (vehicle := report.vehicle(number)) is not None
    ]
    return f"ACC_TYPE {codes[0]} and {codes[1]}" if len(done) == 2 and all(done) else None


def swap_crash_types(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``ACC_TYPE`` of the one vehicle reported of the other.

    >>> report = ChangedReport(report_xml)  # 68 and 69: one turns left across the other's way
    >>> swap_crash_types(report, perturbed_scene), [code_in(vehicle, "ACC_TYPE") for vehicle in report.vehicles()]
    ('crash types of the two vehicles exchanged', [69, 68])
    """
    one, two = (report.vehicle(number) for number in scene.pair)
    if one is None or two is None:
        return None
    exchange(one, two, "ACC_TYPE")
    return "crash types of the two vehicles exchanged"


# --- bodies and the rest ---------------------------------------------------------------------------------------------
def set_bodies(report: ChangedReport, scene: PerturbedScene, *, codes: tuple[int, int]) -> str | None:
    """Return ``BODY_TYP`` of the two vehicles; model, weight rating and the VIN's values of the old bodies are removed.

    >>> set_bodies(ChangedReport(report_xml), perturbed_scene, codes=(52, 80))
    'transit bus and motorcycle'
    """
    for number, code in zip(scene.pair, codes, strict=True):
        vehicle = report.vehicle(number)
        if vehicle is None or not put(vehicle, "BODY_TYP", code):
            return None
        remove(vehicle, *_BODY_EVIDENCE)
        for row in report.rows_of_vehicle("vpicdecode", number):
            row.clear()
    return " and ".join(BODY_TYP.meaning(code) for code in codes)


def random_vehicles(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return all that is said of both vehicles' course drawn at random: movement, critical event, crash type, areas,
    speed (5 to 80 mph, where one is reported).

    >>> report = ChangedReport(report_xml)
    >>> random_vehicles(report, perturbed_scene).count("ACC_TYPE")
    2
    >>> all(20 <= code_in(vehicle, "ACC_TYPE") <= 93 for vehicle in report.vehicles())
    True
    """
    rng, year, words = scene.rng, scene.record.case_year, []
    random_clocks(report, scene)

    def draw(codes: Callable[[], list[int]]) -> int:
        return int(rng.choice(codes()))

    for number in scene.pair:
        vehicle = report.vehicle(number)
        if vehicle is None:
            return None
        movement = draw(lambda: [1, 2, 3, 4, 5, 6, 10, 11, 12, 13, 14, 15, 16])
        event = draw(lambda: [code for code in range(10, 79) if P_CRASH2.holds(code, year)])
        crash_type = draw(lambda: [code for code in ACC_TYPE.meanings if 20 <= code <= 93])
        put(vehicle, "P_CRASH1", movement)
        put(vehicle, "P_CRASH2", event)
        put(vehicle, "ACC_TYPE", crash_type)
        if _has_speed(vehicle):
            put(vehicle, "TRAV_SP", int(rng.integers(5, 81)))
        area = code_in(vehicle, "IMPACT1")
        words.append(
            f"vehicle {number}: P_CRASH1 {movement}, P_CRASH2 {event}, ACC_TYPE {crash_type}, "
            f"{IMPACT1.meaning(area) or 'impact unknown'}"
        )
    return "; ".join(words)
