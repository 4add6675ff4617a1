"""What a report says of strikes of people, beside the simulated ones: by whom and where they were struck, who went how.

As of two vehicles (:mod:`trace_dag.verdict.course_facts`). Names of their own, since what a fact is worth is fitted to
crashes of its kind: that a car went straight tells less where nearly all who strike people do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from trace_dag.crash.codes.persons import MOTDIR, PBCWALK, PEDDIR
from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.parties import party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.strikes import Strike, order_is_told, strikes_of
from trace_dag.crash.zones import reported_zones
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.people import crosswalks, crosswalks_near
from trace_dag.roads.report import CrashPlacement
from trace_dag.states.courses import told_courses
from trace_dag.verdict.course_facts import impact_fact, movement_fact, speed_fact
from trace_dag.verdict.strikes import (
    STANDS_MPS,
    ObservedStrike,
    ObservedStrikes,
    compass_error_deg,
    course_error_deg,
    matched_strikes,
    zone_error_m,
)
from trace_dag.verdict.types import Agreement, ComparedWith, Fact

OF_STRIKES: Final = frozenset(
    {
        "striking vehicle",
        "impact of the strike",
        "movement before the strike",
        "speed before the strike",
        "course of the person",
        "zone of the person",
        "compass direction",
        "crosswalk",
    }
)
"""Names of the facts that crashes with people alone have."""
_COURSE_DEG: Final = 45.0
_IN_ZONE_M: Final = 1.0
_CROSSWALK_M: Final = 20.0  # a marked crosswalk of the intersection or block that the typing speaks of
_PRESENT, _NONE_NOTED = 1, 0


def strike_facts(record: CrashRecord, observed: ObservedStrikes) -> Iterator[Fact]:
    """Every fact about the strikes that the report says something of; none where nothing touched.

    >>> from trace_dag.verdict.strikes import observe_strikes
    >>> observed = observe_strikes(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> fact = next(strike_facts(pedestrian_record, observed))
    >>> fact.name, fact.reported, fact.agreement.value
    ('striking vehicle', 'vehicle 1 and person 1', 'agrees')
    """
    if not observed.contacts:
        return
    strikes = strikes_of(record)
    yield _first_pair(strikes, observed, told=order_is_told(record))
    matched = matched_strikes(observed, strikes, in_order=order_is_told(record))
    first_s = min((seen.contact.time_s for seen in matched if seen is not None), default=0.0)
    for strike, seen in zip(strikes, matched, strict=True):
        if seen is not None:
            yield from _of_vehicle(record, strike, seen)
            if seen.contact.time_s == first_s:  # afterwards it lies where it was thrown
                yield from _of_person(record, strike, seen)


def crosswalk_facts(record: CrashRecord, network: RoadNetwork, placement: CrashPlacement) -> Iterator[Fact]:
    """``PBCWALK`` beside the crosswalks of a map that has any: most towns have not drawn theirs.

    >>> [fact.reported for fact in crosswalk_facts(pedestrian_record, network, map_report.placement)]
    ['none noted']
    """
    if not crosswalks(network):
        return
    near = bool(crosswalks_near(network, placement.x_m, placement.y_m, _CROSSWALK_M))
    for strike in strikes_of(record):
        code = strike.person.crosswalk_code
        if code in (_PRESENT, _NONE_NOTED):
            agreement = Agreement.of((code == _PRESENT) is near)
            found = f"{'a' if near else 'no'} crosswalk within {_CROSSWALK_M:.0f} m"
            yield Fact("crosswalk", ComparedWith.MAP, agreement, PBCWALK.meaning(code), found)


def _first_pair(strikes: tuple[Strike, ...], observed: ObservedStrikes, *, told: bool) -> Fact:
    first = observed.contacts[0]
    expected = strikes[:1] if told else strikes
    agreement = Agreement.of((first.number_1, first.number_2) in {strike.pair for strike in expected})
    said = " or ".join(" and ".join(party_in_words(number) for number in strike.pair) for strike in expected)
    found = f"{party_in_words(first.number_1)} and {party_in_words(first.number_2)}"
    return Fact("striking vehicle", ComparedWith.COURSE, agreement, said, found, essential=True)


def _of_vehicle(record: CrashRecord, strike: Strike, seen: ObservedStrike) -> Iterator[Fact]:
    vehicle = replace(strike.vehicle, impact=strike.area)
    facts = (
        ("impact of the strike", impact_fact(vehicle, seen.vehicle)),
        ("movement before the strike", movement_fact(record, vehicle, seen.vehicle)),
        ("speed before the strike", speed_fact(vehicle, seen.vehicle)),
    )
    for name, found in facts:
        if found is not None:
            yield replace(found, name=name)


def _of_person(record: CrashRecord, strike: Strike, seen: ObservedStrike) -> Iterator[Fact]:
    person, turn = strike.person, turn_of(strike.vehicle)
    course = course_error_deg(seen, person, turn)
    if course is not None:
        told = ", ".join(sorted(each.value.replace("_", " ") for each in told_courses(person, turn)))
        found = f"{course:.0f} deg off"
        yield _fact("course of the person", Agreement.of(course <= _COURSE_DEG), told, found, person.party)
    zones = reported_zones(record, person)
    outside = zone_error_m(seen.outside_m, zones)
    if outside is not None:
        agreement = Agreement.of(outside <= _IN_ZONE_M)
        said = ", ".join(sorted(zones))
        where = f"{abs(seen.outside_m):.1f} m {'outside' if seen.outside_m > 0 else 'within'} the carriageway's edge"
        yield _fact("zone of the person", agreement, said, where, person.party)
    heading = seen.person_heading_rad if seen.person_speed_mps > STANDS_MPS else None
    for party, table, code, headed in (
        (strike.vehicle.number, MOTDIR, person.motorist_direction_code, seen.vehicle.approach_rad),
        (person.party, PEDDIR, person.pedestrian_direction_code, heading),
    ):
        error = None if headed is None else compass_error_deg(headed, code)
        if error is not None:
            found = f"{error:.0f} deg outside that quarter"
            yield _fact("compass direction", Agreement.of(error <= _COURSE_DEG), table.meaning(code), found, party)


def _fact(name: str, agreement: Agreement, reported: str, found: str, party: int) -> Fact:
    return Fact(name, ComparedWith.COURSE, agreement, reported, found, vehicle_number=party)
