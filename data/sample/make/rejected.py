"""Reports that must end in a rejection, one or more for every reason, and why each of them does.

All are reports as they occur: made from a coded crash by changing what the coder, the officer or the map got wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from make import broken_map
from make.crashapi import crashapi_xml, not_released
from make.plane import plane_point
from make.report import CASE_BASE, Report, reported_place

_RIDDEN_ANIMAL = 49  # SOE: a ridden animal or an animal-drawn conveyance


@dataclass(frozen=True)
class Rejected:
    """A report and what becomes of it."""

    number: int
    title: str
    reason: str
    xml: bytes

    @property
    def case(self) -> int:
        """``ST_CASE``."""
        return CASE_BASE + self.number


def rejected(reports: dict[int, Report]) -> list[Rejected]:
    """All of them, from the coded reports by number."""
    return [*_unreadable(reports), *_incomplete(reports), *_misplaced(reports), *_contradictory(reports)]


def _of(report: Report, number: int, title: str, reason: str) -> Rejected:
    return Rejected(number, title, reason, crashapi_xml(replace(report, number=number)))


def _unreadable(reports: dict[int, Report]) -> list[Rejected]:
    ampersand = replace(reports[36], ways=("E MAIN ST & FERN LN", ""), bare_ampersand=True)
    return [
        Rejected(61, "Not yet released by the service", "not_released", not_released(CASE_BASE + 61)),
        _of(ampersand, 62, "A bare ampersand in a street name", "malformed_report"),
    ]


def _incomplete(reports: dict[int, Report]) -> list[Rejected]:
    unlocated = replace(reports[22], latitude_deg=77.7777, longitude_deg=777.7777)
    no_topology = replace(reports[16], intersection=99, junction=99)
    silent = tuple(
        replace(v, movement=99, event=99, crash_type=99, stability=9, location=9, travel_speed=999, impact=99)
        for v in reports[24].vehicles
    )
    unseen = tuple(replace(e, area_1=99, area_2=99) for e in reports[24].events)
    unwitnessed = replace(reports[24], vehicles=silent, manner=99, events=unseen)
    alone = reports[30]
    departed = replace(alone.vehicles[0], crash_type=1, location=4)
    left, struck = alone.events[:2]
    alone = replace(
        alone, vehicles=(departed,), events=(left, replace(struck, code=_RIDDEN_ANIMAL)), harmful=_RIDDEN_ANIMAL
    )
    return [
        _of(unlocated, 63, "Position not reported", "incomplete_location"),
        _of(no_topology, 64, "Neither intersection type nor junction known", "incomplete_topology"),
        _of(unwitnessed, 65, "Nothing known of how the vehicles moved", "incomplete_trajectory"),
        _of(alone, 66, "A single vehicle against a horse and its rider", "not_modelled"),
    ]


def _misplaced(reports: dict[int, Report]) -> list[Rejected]:
    far = replace(reports[23], latitude_deg=41.20361111, longitude_deg=-100.90222222)
    scattered = replace(_at(reports[22], broken_map.U_M, broken_map.V_M), ways=("QUILL RD", ""))
    # The highway's name and a point in the field beside it: on the road the crash is 20 m from where it was reported.
    beside = _at(reports[22], -850, -24)
    return [
        _of(far, 67, "Where no map reaches", "no_map_coverage"),
        _of(scattered, 68, "On a road that is a raw GPS trace", "map_distorted"),
        _of(_at(reports[28], -640, -520), 69, "In a field, 200 m from any road", "crash_off_road"),
        _of(beside, 70, "Beside the highway, not on it", "wrong_location"),
    ]


def _contradictory(reports: dict[int, Report]) -> list[Rejected]:
    """Codes that contradict each other, or the physics."""
    both_right = _changed(reports[1], {"movement": 10, "event": 16})
    icy = replace(_changed(reports[8], {"surface": 4}), weather=4, when=(1, 19, 6, 48))
    fronts = _changed(reports[36], {}, {"impact": 12})
    fronts = replace(fronts, events=tuple(replace(e, area_2=12) for e in fronts.events))
    around = _changed(reports[36], {"movement": 12, "event": 21}, {})
    return [
        _of(both_right, 71, "Both turn right, yet their straight paths are said to cross", "no_feasible_state"),
        _of(icy, 72, "A left turn at 16 mph on ice: the car slides past the place of the crash", "no_collision"),
        _of(fronts, 73, "A rear-end crash with both impacts coded at the front", "wrong_impact"),
        _of(around, 74, "A rear-end crash whose striking driver is said to have made a U-turn", "wrong_direction"),
    ]


def _at(report: Report, u_m: float, v_m: float) -> Report:
    latitude, longitude = reported_place(plane_point(u_m, v_m))
    return replace(report, latitude_deg=latitude, longitude_deg=longitude)


def _changed(report: Report, first: dict[str, int], second: dict[str, int] | None = None) -> Report:
    """The report with codes of its vehicles changed; ``first`` for both unless ``second`` is given."""
    changes = (first, first if second is None else second)
    vehicles = tuple(replace(v, **change) for v, change in zip(report.vehicles, changes, strict=True))
    return replace(report, vehicles=vehicles)
