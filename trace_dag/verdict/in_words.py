"""Sentences of a verdict for the page, ``show`` and the package."""

from __future__ import annotations

from trace_dag.common.units import METRES_PER_FOOT, mps_to_mph
from trace_dag.crash.parties import party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.report import CrashPlacement
from trace_dag.verdict.types import EventResult, SightLine, Verdict

_MOVED_M = 0.05  # a point moved by less prints as not moved


def numbers_of(verdict: Verdict, record: CrashRecord, placement: CrashPlacement | None) -> list[tuple[str, str]]:
    """Return the main figures that were measured, as value and name.

    >>> numbers_of(verdict, record, map_report.placement)[0][1]
    'from the reported point to the first contact'
    """
    numbers = []
    distance = _first(verdict, "reported_distance")
    what = "overturn" if _first(verdict, "overturn") is not None else "first contact"
    if distance is not None:
        numbers.append((length_in_words(distance), f"from the reported point to the {what}"))
    throw_m, speed_mps, delta_v_mps = (
        _largest(verdict, name) for name in ("throw_distance", "impact_speed", "delta_v")
    )
    if throw_m is not None and speed_mps is not None:
        numbers.append((speed_in_words(speed_mps), "speed of the vehicle at the impact"))
        numbers.append((length_in_words(throw_m), "throw of the person"))
    elif delta_v_mps is not None:
        numbers.append((speed_in_words(delta_v_mps), "change of velocity, of the vehicle with the larger"))
    if distance is not None:
        judged = _first(verdict, "station_distance", "contact_distance")
        if judged is not None and abs(judged - distance) > _MOVED_M:
            numbers.append((length_in_words(judged), "of it along the road, by which it is judged"))
    if placement is not None and placement.moved_m > _MOVED_M:
        by = placement.matched_by
        numbers.append((length_in_words(placement.moved_m), f"that the reported point was moved onto a road (by {by})"))
    reported = find_reported_impacts(record)
    clock_errors = [c.value for c in verdict.criteria if c.name == "clock_error" and c.vehicle_number in reported]
    if (clock_error := max((each for each in clock_errors if each is not None), default=None)) is not None:
        numbers.append((f"{clock_error:.1f}", "clock positions at most between reported and simulated impact"))
    closing_mps = _first(verdict, "closing_speed")
    if closing_mps is not None and throw_m is None:
        numbers.append((speed_in_words(closing_mps), "closing speed at the first contact"))
    if verdict.support:
        numbers.append((str(verdict.support.independent_facts), "independent facts of the report agree"))
    return numbers


def find_reported_impacts(record: CrashRecord) -> set[int | None]:
    """Return the numbers of the vehicles with a reported area of impact.

    >>> find_reported_impacts(record)
    {1, 2}
    """
    return {each.number for each in record.vehicles if each.impact is not None and "impact" not in each.implied}


def length_in_words(length_m: float) -> str:
    """Return a length in feet and metres.

    >>> length_in_words(1.5)
    '4.9 ft (1.5 m)'
    """
    return f"{length_m / METRES_PER_FOOT:.1f} ft ({length_m:.1f} m)"


def speed_in_words(speed_mps: float) -> str:
    """Return a speed in miles and kilometres per hour.

    >>> speed_in_words(20.0)
    '45 mph (72 km/h)'
    """
    return f"{mps_to_mph(speed_mps):.0f} mph ({speed_mps * 3.6:.0f} km/h)"


def _first(verdict: Verdict, *names: str) -> float | None:
    """Return the value of the first criterion of these names that was measured."""
    return next((c.value for c in verdict.criteria if c.name in names and c.value is not None), None)


def _largest(verdict: Verdict, name: str) -> float | None:
    """Return the largest value of the criteria of a name."""
    return max((c.value for c in verdict.criteria if c.name == name and c.value is not None), default=None)


def label_in_words(verdict: Verdict) -> str:
    """Return the label, with the reason of a rejected crash.

    >>> label_in_words(verdict)
    'verified'
    """
    label = verdict.label.replace("_", " ")
    return label if verdict.accepted else f"{label}: {(verdict.reason or '').replace('_', ' ')}"


def events_in_words(verdict: Verdict) -> str:
    """Return a text on the number of reported harmful events that happen; empty if none is reported.

    >>> events_in_words(verdict)
    '1 of 1 reported event happens'
    """
    if not verdict.events:
        return ""
    happened = sum(each.outcome is EventResult.HAPPENED for each in verdict.events)
    beyond = sum(each.outcome is EventResult.NOT_MODELLED for each in verdict.events)
    reported = len(verdict.events)
    said = f"{happened} of {reported} reported event{'s' if reported > 1 else ''} happen{'s' if reported == 1 else ''}"
    return f"{said} ({beyond} cannot be simulated)" if beyond else said


def sight_in_words(verdict: Verdict) -> str:
    """Return a text on how long before the contact each party could see the other; empty if unknown.

    >>> from dataclasses import replace
    >>> seen, late = SightLine(1, 2, 5.9, 0.0), SightLine(2, 1, 1.8, 0.64, ((0.0, 4.1),), "building", "way/12")
    >>> sight_in_words(replace(verdict, sight_lines=(late,)))
    'vehicle 1 could be seen from vehicle 2 for 1.8 s before the contact, hidden until then (building)'
    >>> sight_in_words(replace(verdict, sight_lines=(seen,)))
    'vehicle 2 could be seen from vehicle 1 all the time'
    """
    return "; ".join(map(_line_in_words, verdict.sight_lines))


def _line_in_words(line: SightLine) -> str:
    seen = f"{party_in_words(line.other)} could be seen from {party_in_words(line.driver)}"
    if not line.hidden_s:
        return f"{seen} all the time"
    return f"{seen} for {line.seen_for_s:.1f} s before the contact, hidden until then ({line.hidden_by})"
