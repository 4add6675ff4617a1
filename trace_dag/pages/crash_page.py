"""The page of one crash: events and verdict at a glance, then all details, folded.

At a glance it has the replay, one sentence, a few numbers, the number of reported events that happen, other likely
courses, the reported and simulated impact areas of each vehicle, and the evidence for and against. Everything shown
comes from the warehouse's row and the artefacts. All text is escaped by the templates: reports and maps are not
trusted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from trace_dag.common.messages.wording import beside_limit
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.codes.elements import ACC_TYPE
from trace_dag.crash.keys import FARS
from trace_dag.crash.parties import party_in_words, party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import event_named, in_one_sentence
from trace_dag.osm.types import Rights
from trace_dag.pages.page_templates import render, words
from trace_dag.reconstruction.samples.simulated import Interval, SampledRuns
from trace_dag.roads.report import MapReport, RejectedMapReport
from trace_dag.scenario.drawn_shapes import describe_object, vehicle_colour
from trace_dag.simulation.states import StateEstimate
from trace_dag.verdict.in_words import (
    events_in_words,
    find_reported_impacts,
    label_in_words,
    length_in_words,
    numbers_of,
    sight_in_words,
)
from trace_dag.verdict.types import Agreement, Criterion, EventResult, Fact, Grade, Label, Verdict

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Download:
    """A file offered on a crash's page; ``href`` is relative to that page."""

    label: str
    href: str
    size_bytes: int


@dataclass(frozen=True, eq=False)
class CrashPage:
    """The content of one crash's page: ``crash`` is its row of the ``crashes`` table, ``rights`` those of its map.

    Paths are relative to the page.
    """

    crash: Row
    outcomes: Sequence[Row]
    rights: Rights
    record: CrashRecord | None = None
    map_report: MapReport | None = None
    rejected_map: RejectedMapReport | None = None
    estimate: StateEstimate | None = None
    verdict: Verdict | None = None
    sampled: SampledRuns | None = None
    picture: str | None = None
    replay: str | None = None
    downloads: Sequence[Download] = ()


def write_crash_page(page: CrashPage) -> bytes:
    """Return the page of one crash, ``crashes/<key>.html`` of the site."""
    accepted = page.verdict if page.verdict and page.verdict.accepted else None
    return render(
        "site_crash.html.jinja",
        page=page,
        rights=page.rights,
        reports=[report_rights(page.crash)],
        sentence=in_one_sentence(page.record) if page.record else "",
        grade=accepted.grade if accepted else None,
        numbers=numbers_of(page.verdict, page.record, page.map_report.placement if page.map_report else None)
        if page.verdict and page.record
        else [],
        happens=_happens(accepted) if accepted else [],
        label=label_in_words(accepted) if accepted else "",
        label_means=LABEL_MEANINGS[accepted.label] if accepted else "",
        grade_means=_GRADES[accepted.grade] if accepted and accepted.grade else "",
        outcomes={each.event_number: words(each.outcome) for each in page.verdict.events} if page.verdict else {},
        events=events_in_words(accepted) if accepted else "",
        alternatives=accepted.alternatives if accepted else "",
        sight=sight_in_words(accepted) if accepted else "",
        clocks=_clocks(page.verdict, page.record) if page.verdict and page.record else [],
        hours=[(hour, *_on_dial(hour, _HOURS_RADIUS)) for hour in (3, 6, 9, 12)],
        on_dial=_on_dial,
        reasons=_reasons(page),
        facts=_facts(page.crash),
        links=[] if page.rights.fictional else _elsewhere(page.crash),
        crash_types=_crash_types(page.record),
        streets=_streets(page),
        picture_alt=_picture_alt(page),
        objects=_objects(page),
        bands=_bands(page.sampled.intervals) if page.sampled and page.sampled.effective >= _LEAST_DRAWS else [],
    )


LABEL_MEANINGS: Mapping[str, str] = {
    Label.VERIFIED: "every reported event that can be simulated happens in one motion on this road",
    Label.FIRST_EVENT_ONLY: "the first reported event happens, but not everything that was reported after it",
}
_GRADES = {
    Grade.CORROBORATED: "enough facts of the report agree with it, and nothing essential speaks against it",
    Grade.CONSISTENT: "it agrees with the report, with no more support than that",
}


def _happens(verdict: Verdict) -> list[tuple[bool, str]]:
    """Return each reported harmful event: whether it happens in the simulation, and its name with the reason if not."""
    return [
        (
            each.outcome is EventResult.HAPPENED,
            _SOE.sub("", event_named(each.event_number, each.code)) + (f" ({each.why})" if each.why else ""),
        )
        for each in verdict.events
    ]


_SOE = re.compile(r" \(SOE \d+\)")
_CRASH_TYPE = re.compile(r"ACC_TYPE (\d+)")


def _without_codes(sentence: str) -> str:
    """Return a sentence with each crash type's meaning in place of its number."""
    return _CRASH_TYPE.sub(lambda found: ACC_TYPE.meaning(int(found[1])) or "the crash type", sentence)


def _facts(crash: Row) -> list[tuple[str, str]]:
    """Return the reported facts of the crash as a whole."""
    date = "-".join(f"{crash[part]:02d}" for part in ("year", "month", "day") if crash.get(part) is not None)
    time = ""
    if crash.get("hour") is not None:
        minute = f":{crash['minute']:02d}" if crash.get("minute") is not None else " h"
        time = f", {crash['hour']:02d}{minute} local time"
    position = ""
    if crash.get("latitude_deg") is not None:
        position = f"{crash['latitude_deg']:.6f}, {crash['longitude_deg']:.6f}"
    facts = {
        "Place": crash.get("place") or crash.get("state_name"),
        "Date": date + time,
        "Reported position (WGS84)": position,
        "Roads": " and ".join(name for column in ("trafficway_1", "trafficway_2") if (name := crash.get(column))),
        "Kind of crash": words(crash.get("kind")),
        "Collision type": words(crash.get("collision_type")),
        "Road topology": words(crash.get("road_topology")),
        "Vehicle trajectory": words(crash.get("vehicle_trajectory")),
        "Vehicles": crash.get("vehicles"),
        "Persons killed": crash.get("fatalities"),
        "Severity (KABCO)": crash.get("severity"),
        "Same crash as": crash.get("same_as"),
        "Cohort": crash.get("cohort"),
    }
    return [(label, str(value)) for label, value in facts.items() if value not in (None, "")]


def _picture_alt(page: CrashPage) -> str:
    drawn = "The road with its lanes seen from above, with the reported point"
    if page.rejected_map:
        return f"{drawn} and how far from it the streets around are."
    if page.estimate is None:
        return f"{drawn}."
    vehicles = ", ".join(
        f"{party_in_words(each.vehicle_number)} ({words(each.manoeuvre)})"
        for each in page.estimate.hypotheses[0].participants
    )
    return f"{drawn}, and the paths and bodies at contact and at rest of {vehicles}."


def _objects(page: CrashPage) -> list[str]:
    """Return the fixed objects of the judged hypothesis, and the source of their places."""
    if page.estimate is None:
        return []
    chosen = page.verdict.hypothesis if page.verdict else 0
    return [f"event {item.event_number}: {describe_object(item)}" for item in page.estimate.hypotheses[chosen].objects]


_QUANTITIES = {
    "impact_speed": ("Impact speed", " mph"),
    "delta_v": ("Change of velocity at first contact", " mph"),
    "contact_x": ("Contact east of the reported point", " m"),
    "contact_y": ("Contact north of it", " m"),
    "heading_angle": ("Angle of headings", "°"),
}
_SHARED_SCALE = {"contact_x": "place", "contact_y": "place"}
_MARGIN = 0.04  # of a band's width


@dataclass(frozen=True)
class Band:
    """An interval in words, with its position on a scale of 0 to 100 common to all intervals of the quantity."""

    what: str
    best: str
    interval: str
    begin: float
    width: float
    middle: float
    best_at: float
    ends: tuple[str, str]


_LEAST_DRAWS = 2.0  # of equal weight: a band of fewer is the value of one draw


def _bands(intervals: Sequence[Interval]) -> list[Band]:
    """Return a band for each interval."""
    scales: dict[str, list[float]] = {}
    for each in intervals:
        quantity = _SHARED_SCALE.get(each.quantity, each.quantity)
        from_zero = [] if quantity == "place" else [0.0]
        scales.setdefault(quantity, from_zero).extend([each.low, each.high, each.best])
    return [_band(each, scales[_SHARED_SCALE.get(each.quantity, each.quantity)]) for each in intervals]


def _band(found: Interval, scale: Sequence[float]) -> Band:
    what, unit = _QUANTITIES[found.quantity]
    whose = "" if found.party is None else f", {party_label(found.party)}"
    digits = 1 if unit == " m" else 0
    least, most = min(scale), max(scale)
    best, low, high, *ends = (
        f"{round(mps_to_mph(value) if unit == ' mph' else value, digits) + 0.0:.{digits}f}"
        for value in (found.best, found.low, found.high, least, most)
    )
    span = (most - least) or 1.0
    begin, middle, end, best_at = (
        round(100 * (_MARGIN + (1 - 2 * _MARGIN) * (value - least) / span), 1)
        for value in (found.low, found.middle, found.high, found.best)
    )
    interval, scale_ends = f"{low} to {high}{unit}", (ends[0], ends[1] + unit)
    return Band(what + whose, best + unit, interval, begin, round(end - begin, 1), middle, best_at, scale_ends)


def report_rights(crash: Row) -> str:
    """Return the source of a crash's report, by its row of ``crashes``, and the rights in it.

    >>> report_rights({"register": "fars"}), report_rights({"register": "tempe", "attribution": None})
    ('NHTSA FARS, public domain', 'register tempe')
    """
    register = crash.get("register") or FARS
    return crash.get("attribution") or ("NHTSA FARS, public domain" if register == FARS else f"register {register}")


def _elsewhere(crash: Row) -> list[tuple[str, str]]:
    """Return links to other sites that show the place: label and address.

    The page makes no request to them by itself.
    """
    latitude_deg, longitude_deg = crash.get("latitude_deg"), crash.get("longitude_deg")
    if latitude_deg is None or longitude_deg is None:
        return []
    place = f"{latitude_deg:.6f}", f"{longitude_deg:.6f}"
    return [
        ("OpenStreetMap", "https://www.openstreetmap.org/?mlat={0}&mlon={1}#map=19/{0}/{1}".format(*place)),
        ("street-level pictures", "https://www.mapillary.com/app/?lat={}&lng={}&z=18".format(*place)),
    ]


def _crash_types(record: CrashRecord | None) -> dict[int, str]:
    """Return the meaning of each vehicle's crash type, by the number of the vehicle."""
    vehicles = record.vehicles if record else ()
    return {vehicle.number: ACC_TYPE.meaning(vehicle.crash_type_code) for vehicle in vehicles}


_BEARS = {True: "the reported name", False: "another name", None: "no name to compare"}


def _streets(page: CrashPage) -> list[tuple[str, str, str, str]]:
    """Return the streets around the point of a rejected map: name, class, distance, agreement with the report."""
    rows = []
    for street in page.rejected_map.streets if page.rejected_map else ():
        said = _BEARS[street.bears_reported_name]
        rows.append((street.name or "no name", words(street.highway), f"{street.distance_m:.1f}", said))
    return rows


_CLOCK_RADIUS, _HOURS_RADIUS = 44.0, 56.0  # of the dials and of the hours around them, in units of their drawing


@dataclass(frozen=True)
class Dial:
    """The struck position on a vehicle, in clock hours with 12 at its front."""

    vehicle_number: int
    event_number: int | None
    colour: str
    reported_h: float | None
    simulated_h: float


def _on_dial(clock_h: float, radius: float = _CLOCK_RADIUS) -> tuple[float, float]:
    """Return a position on the dial, x to the right and y down."""
    angle_rad = clock_h * math.tau / 12.0
    return round(radius * math.sin(angle_rad), 1), round(-radius * math.cos(angle_rad), 1)


def _clocks(verdict: Verdict, record: CrashRecord) -> list[Dial]:
    """Return a dial for every vehicle whose impact was measured, in each contact."""
    clocks = [each for each in verdict.criteria if each.name == "clock" and each.value is not None]
    reported = {
        (each.vehicle_number, each.event_number): each.value
        for each in verdict.criteria
        if each.name == "reported_clock" and each.vehicle_number in find_reported_impacts(record)
    }
    numbers = sorted({each.vehicle_number for each in clocks if each.vehicle_number is not None})
    several = len({each.event_number for each in clocks}) > 1
    dials: list[Dial] = []
    for clock in clocks:
        number, event, simulated_h = clock.vehicle_number, clock.event_number, clock.value
        if number is not None and simulated_h is not None:
            colour = vehicle_colour(numbers.index(number))
            dials.append(Dial(number, event if several else None, colour, reported.get((number, event)), simulated_h))
    return dials


_UNFOLDED = 6


@dataclass(frozen=True)
class Reasons:
    """Evidence for a crash, evidence against it, and facts not reported, as sentences."""

    for_it: Sequence[str]
    against: Sequence[str]
    untold: Sequence[str]
    unfolded: int  # of each; the others are a click away. Doubts come first, and all of them are shown


def _reasons(page: CrashPage) -> Reasons:
    verdict = page.verdict
    deciding = [each for each in verdict.criteria if each.reason] if verdict else []
    several = len({each.event_number for each in deciding}) > 1

    def in_words(criterion: Criterion) -> str:
        return _criterion_in_words(criterion, criterion.event_number if several else None)

    facts = sorted(verdict.support.facts, key=lambda fact: -abs(fact.weight)) if verdict and verdict.support else []
    contradictions = page.record.contradictions if page.record else ()
    detail = verdict.support.detail if verdict and verdict.support and verdict.grade is not Grade.CORROBORATED else ""
    doubts = [f"{each.detail[0].upper()}{each.detail[1:]}" for each in (verdict.reservations if verdict else ())]
    for_it = [in_words(each) for each in deciding if each.passed]
    for_it += [_fact_in_words(fact) for fact in facts if fact.weight > 0.0]
    against = (
        doubts
        # The page begins with what rejects a crash.
        + [in_words(each) for each in deciding if each.passed is False and verdict and each.reason != verdict.reason]
        + ([f"Not corroborated: {detail}"] if detail else [])
        + [
            _fact_in_words(fact)
            for fact in facts
            if (fact.agreement is not Agreement.AGREES and fact.weight < 0.0) or fact.refutes
        ]
        + [f"The report contradicts itself: {line}" for line in contradictions]
    )
    untold = [in_words(each) for each in deciding if each.passed is None]
    for_it, against, untold = ([*map(_without_codes, each)] for each in (for_it, against, untold))
    return Reasons(for_it, against, untold, max(len(doubts), _UNFOLDED))


_CRITERIA = {
    "contact": "the reported parties touch",
    "contact_distance": "distance of the first contact from the reported place",
    "clock_error": "struck where the report says",
    "next_contact": "the next contact of the report comes in its turn",
    "unreported_contact": "nobody touches whom no event has touch by then",
    "direction_error": "course as reported",
    "relation_error": "angle between the courses as reported",
    "departure": "left the carriageway",
    "departure_side": "left the road where the report says",
    "departed_street": "left a street that the report names",
    "station_distance": "distance from the reported place, along the road",
    "object_order": "objects struck in the reported order",
    "contact of one vehicle": "struck an object of the report",
    "overturn": "overturned",
    "strike": "struck whom the report says, in its turn",
    "zone_error": "in the part of the road that the report says",
    "course_error": "way across or along the road as reported",
    "compass_error": "heading by the compass as reported",
    "initial_speed_error": "speed as reported",
}
_UNITS = {"h": " clock positions off", "deg": "° off", "rel": " of it off"}


def _criterion_in_words(criterion: Criterion, event: int | None) -> str:
    whose = f"{party_in_words(criterion.vehicle_number)} " if criterion.vehicle_number is not None else ""
    of_one = f"{criterion.name} of one vehicle"
    known = of_one if criterion.vehicle_number is not None and of_one in _CRITERIA else criterion.name
    what = _CRITERIA.get(known, words(criterion.name))
    where = "" if event is None else f" (event {event})"
    sentence = f"{whose}{what}{where}"
    if criterion.unit == "m" and criterion.value is not None and criterion.threshold is not None:
        sentence += f": {length_in_words(abs(criterion.value))}, {length_in_words(criterion.threshold)} allowed"
    elif criterion.unit in _UNITS and criterion.value is not None and criterion.threshold is not None:
        sentence += f": {beside_limit(abs(criterion.value), criterion.threshold)}{_UNITS[criterion.unit]}"
        sentence += f", {criterion.threshold:g} allowed"
    elif criterion.detail and criterion.passed is False:
        sentence = f"{criterion.detail}{where}"  # what happened: the words above say what should have
    elif criterion.detail and criterion.passed is None:
        sentence += f": {criterion.detail}"
    return sentence[0].upper() + sentence[1:]


def _fact_in_words(fact: Fact) -> str:
    name = fact.name
    if fact.vehicle_number is not None:
        name = f"{name.removesuffix(' of the person')} of {party_in_words(fact.vehicle_number)}"
    how = {Agreement.AGREES: "agrees", Agreement.NEAR: "nearly agrees", Agreement.DIFFERS: "differs"}[fact.agreement]
    sentence = f"{name} {how} with the {fact.against}: {fact.reported} – {fact.found}"
    return sentence[0].upper() + sentence[1:]
