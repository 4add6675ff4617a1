"""The verdict of a crash in which vehicles strike people or animals: each reported strike against what occurred.

The log's contacts are matched to the reported strikes; each criterion carries the number of the event it is about.
Where, on the vehicle, in which zone of the road, which way both went, who was first: what the report does not say is
not evaluated. Throw, speeds and the time for which a person was on the carriageway are shown, they judge nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.crash.aftermath import aftermath_of
from trace_dag.crash.crash_types import Turn, turn_of
from trace_dag.crash.parties import PartyKind, party_in_words
from trace_dag.crash.record import CrashRecord, NonMotorist
from trace_dag.crash.strikes import Strike, order_is_told, strikes_of
from trace_dag.crash.summary import event_named
from trace_dag.crash.zones import Zone, reported_zones
from trace_dag.errors import Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import Contact, SimulationLog, VehicleLog
from trace_dag.states.courses import COMPASS_DEG, RELATIVE_DEG, Course, told_courses
from trace_dag.states.types import Hypothesis
from trace_dag.units import wrap_angle
from trace_dag.verdict.metrics import (
    LEAST_RECORDED_MPS,
    ObservedVehicle,
    VehicleMeasures,
    compared_vehicle,
    observed_vehicle,
    outside_m,
    sides_of,
)
from trace_dag.verdict.rules import (
    RULE_SETS,
    at_most,
    clock_criterion,
    direction_criterion,
    reported_of,
    shown,
    speed_criterion,
)
from trace_dag.verdict.types import Criterion

_COMPASS_DEG: Final = 45.0  # a coded direction is a quarter of the compass
STANDS_MPS: Final = 0.2
_LANE_BESIDE_M: Final = 0.5  # the edge of a carriageway is drawn no better than so
_BESIDE_M: Final = 4.0  # a full shoulder (AASHTO: 3.0 to 3.6 m) and its edge
_BEYOND_M: Final = 12.0


@dataclass(frozen=True)
class ObservedStrike:
    """One contact of a vehicle with a person or an animal, before it is set beside any report.

    ``outside_m``: how far the person was outside the carriageway, negative within it. ``exposed_s``: for how long it
    had been on the carriageway. ``thrown_m``: from where it was struck to where it came to rest or was struck again.
    """

    contact: Contact
    vehicle: ObservedVehicle
    person_heading_rad: float
    person_speed_mps: float
    outside_m: float
    exposed_s: float
    thrown_m: float


@dataclass(frozen=True)
class ObservedStrikes:
    """Everything that touched in a simulation, in order: strikes by contact, and contacts of two vehicles."""

    contacts: tuple[Contact, ...]
    strikes: tuple[ObservedStrike, ...]

    def of(self, pair: tuple[int, int], after_s: float) -> ObservedStrike | None:
        """The first strike between two parties after a time."""
        return next(
            (
                each
                for each in self.strikes
                if (each.contact.number_1, each.contact.number_2) == pair and each.contact.time_s > after_s
            ),
            None,
        )


def observe_strikes(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> ObservedStrikes:
    """What happened between the parties of a simulated hypothesis.

    >>> observed = observe_strikes(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> [(strike.contact.number_1, strike.contact.number_2, strike.outside_m < 0.0) for strike in observed.strikes]
    [(1, 1001, True)]
    """
    contacts = log.meetings
    strikes = [contact for contact in contacts if log.is_figure(contact.number_2)]
    states = {state.vehicle_number: state for state in hypothesis.participants}
    logs = {each.number: each for each in log.vehicles}
    found = []
    for contact in strikes:
        side, person = sides_of(contact)
        vehicle = observed_vehicle(network, side, states[side.number], logs[side.number], log, contact)
        again = next((c.time_s for c in strikes if c.number_2 == contact.number_2 and c.time_s > contact.time_s), None)
        driven = logs[person.number]
        speed = math.hypot(*person.velocity_mps)
        heading = math.atan2(person.velocity_mps[1], person.velocity_mps[0])
        found.append(
            ObservedStrike(
                contact,
                vehicle,
                heading if speed > STANDS_MPS else person.pose.heading_rad,
                speed,
                outside_m(network, person.pose.x_m, person.pose.y_m),
                _exposed_s(network, driven, contact.time_s),
                _thrown_m(driven, person.pose.x_m, person.pose.y_m, again),
            )
        )
    return ObservedStrikes(contacts, tuple(found))


def _exposed_s(network: RoadNetwork, person: VehicleLog, until_s: float) -> float:
    before = person.time_s <= until_s
    inside = network.drivable_area.contains(person.x_m[before], person.y_m[before])
    if not len(inside) or not inside[-1]:
        return 0.0
    outside = np.flatnonzero(~inside)
    entered_s = float(person.time_s[before][outside[-1]]) if len(outside) else float(person.time_s[0])
    return until_s - entered_s


def _thrown_m(person: VehicleLog, x_m: float, y_m: float, until_s: float | None) -> float:
    at = -1 if until_s is None else max(int(np.searchsorted(person.time_s, until_s)) - 1, 0)
    return math.hypot(float(person.x_m[at]) - x_m, float(person.y_m[at]) - y_m)


# --- criteria ---------------------------------------------------------------------------------------------------------
def strike_criteria(
    observed: ObservedStrikes, record: CrashRecord, log: SimulationLog, settings: VerdictSettings
) -> tuple[Criterion, ...]:
    """Every criterion of the rule set, those that reject first, then those that are only shown.

    >>> observed = observe_strikes(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> found = strike_criteria(observed, pedestrian_record, judged_pedestrian.log, VerdictSettings())
    >>> [criterion.name for criterion in found if criterion.reason and criterion.passed]
    ['contact', 'contact_distance', 'zone_error', 'clock_error', 'direction_error', 'course_error']
    """
    strikes = strikes_of(record)
    if not observed.contacts:
        detail = log.reason
        event = strikes[0].event_number
        return (Criterion("contact", 0.0, 1.0, "contacts", False, Reason.NO_COLLISION, detail, None, event),)
    limits = RULE_SETS[settings.rule_set].limits or settings
    first = observed.contacts[0]
    matched = matched_strikes(observed, strikes, in_order=order_is_told(record))
    rejecting = [
        Criterion("contact", 1.0, 1.0, "contacts", True, Reason.NO_COLLISION, "", None, strikes[0].event_number)
    ]
    expected = [strikes[0].pair] if order_is_told(record) else [strike.pair for strike in strikes]
    if (first.number_1, first.number_2) not in expected:
        parties = f"{party_in_words(first.number_1)} and {party_in_words(first.number_2)}"
        detail = f"the first contact is between {parties}, which by the report do not touch first"
        rejecting.append(
            Criterion("right_party", 0.0, 1.0, "", False, Reason.WRONG_PARTY, detail, None, strikes[0].event_number)
        )
    rejecting += _sequence(observed, strikes, matched, told=order_is_told(record))
    rejecting += _collisions_afterwards(observed, record, strikes, matched)
    reported: list[Criterion] = []
    for strike, seen in zip(strikes, matched, strict=True):
        if seen is not None:
            own = replace(strike.vehicle, impact=strike.area)
            measures = compared_vehicle(seen.vehicle, own, record)
            happened_first = seen.contact.time_s == min(each.contact.time_s for each in matched if each is not None)
            rejecting += _of_strike(strike, seen, measures, record, limits, settings, first=happened_first)
            reported += _shown(strike, seen, measures, limits)
    return (*rejecting, *reported, *_other_events(record, strikes), *_afterwards(observed, strikes, matched))


def matched_strikes(
    observed: ObservedStrikes, strikes: Sequence[Strike], *, in_order: bool
) -> tuple[ObservedStrike | None, ...]:
    """The contact that each reported strike is, None where it does not happen after the one before."""
    found: list[ObservedStrike | None] = []
    after_s = -math.inf
    for strike in strikes:
        seen = observed.of(strike.pair, after_s if in_order else -math.inf)
        found.append(seen)
        if seen is not None:
            after_s = seen.contact.time_s
    return tuple(found)


def _sequence(
    observed: ObservedStrikes, strikes: Sequence[Strike], matched: Sequence[ObservedStrike | None], *, told: bool
) -> list[Criterion]:
    """Every strike happens, in the reported order, and up to the last one nobody touches whom no event has touch."""
    found = []
    first = 1 if told else 0  # of strikes in order the first one is what the first contact is judged by
    for strike, seen in zip(strikes[first:], matched[first:], strict=True):
        parties = " and ".join(party_in_words(number) for number in strike.pair)
        when = "after the strike before it" if told else "at all"
        detail = "" if seen is not None else f"{parties} do not touch {when}, which event {strike.event_number} says"
        occurred = seen is not None
        found.append(
            Criterion(
                "strike",
                float(occurred),
                1.0,
                "",
                occurred,
                Reason.WRONG_SEQUENCE,
                detail,
                strike.vehicle.number,
                strike.event_number,
            )
        )
    last_s = _last_s(matched)
    pairs = {strike.pair for strike in strikes}
    strange = next((c for c in observed.contacts if c.time_s < last_s and (c.number_1, c.number_2) not in pairs), None)
    if strange is not None:
        parties = f"{party_in_words(strange.number_1)} and {party_in_words(strange.number_2)}"
        detail = f"{parties} touch before the last strike, which no event says"
        found.append(Criterion("unreported_contact", 1.0, 0.0, "contacts", False, Reason.WRONG_SEQUENCE, detail))
    return found


def _collisions_afterwards(
    observed: ObservedStrikes,
    record: CrashRecord,
    strikes: Sequence[Strike],
    matched: Sequence[ObservedStrike | None],
) -> list[Criterion]:
    """Two vehicles that collide after the last strike, as hard as an event data recorder records: no report leaves
    that out."""
    last_s = _last_s(matched)
    said = {frozenset((event.party_1, event.party_2)) for event in record.events}
    found = []
    for contact in observed.contacts:
        pair = frozenset((contact.number_1, contact.number_2))
        strike = pair in {frozenset(each.pair) for each in strikes}
        delta_v_mps = max(math.hypot(*contact.delta_v_1_mps), math.hypot(*contact.delta_v_2_mps))
        of_vehicles = all(any(vehicle.number == number for vehicle in record.vehicles) for number in pair)
        if (
            of_vehicles
            and contact.time_s > last_s
            and not strike
            and pair not in said
            and delta_v_mps >= LEAST_RECORDED_MPS
        ):
            parties = f"{party_in_words(contact.number_1)} and {party_in_words(contact.number_2)}"
            detail = f"{parties} collide after the last strike, which no event says"
            found.append(
                Criterion(
                    "unreported_collision", delta_v_mps, LEAST_RECORDED_MPS, "mps", False, Reason.WRONG_SEQUENCE, detail
                )
            )
    return found[:1]


def _last_s(matched: Sequence[ObservedStrike | None]) -> float:
    return max((seen.contact.time_s for seen in matched if seen is not None), default=0.0)


def _afterwards(
    observed: ObservedStrikes, strikes: Sequence[Strike], matched: Sequence[ObservedStrike | None]
) -> list[Criterion]:
    """Contacts after the last strike that no event of the report mentions: shown, not judged."""
    last_s = _last_s(matched)
    pairs = {strike.pair for strike in strikes}
    strange = {
        (c.number_1, c.number_2): None
        for c in observed.contacts
        if c.time_s > last_s and (c.number_1, c.number_2) not in pairs
    }
    return [
        Criterion(
            "contact_afterwards",
            1.0,
            None,
            "contacts",
            None,
            None,
            f"{party_in_words(one)} and {party_in_words(two)} touch after the last strike, which no event says",
        )
        for one, two in strange
    ]


def _of_strike(
    strike: Strike,
    seen: ObservedStrike,
    measures: VehicleMeasures,
    record: CrashRecord,
    limits: VerdictSettings,
    settings: VerdictSettings,
    *,
    first: bool,
) -> list[Criterion]:
    event, number, person = strike.event_number, strike.vehicle.number, strike.person
    rules = RULE_SETS[settings.rule_set]
    zones = reported_zones(record, person)
    turn = turn_of(strike.vehicle)
    found = []
    if first:
        distance = _contact_distance_m(seen, zones)
        found.append(
            at_most(
                "contact_distance", distance, limits.max_contact_distance_m, "m", Reason.WRONG_LOCATION, None, event
            )
        )
        zone_error = zone_error_m(seen.outside_m, zones)
        found.append(
            at_most("zone_error", zone_error, settings.max_zone_error_m, "m", Reason.WRONG_ZONE, person.party, event)
        )
    found += [
        clock_criterion(rules.clock_error(measures), limits, number, event),
        direction_criterion(measures.turn_error_deg, limits, number, event),
    ]
    if first and person.kind is not PartyKind.ANIMAL:  # of those no report tells which way they went
        course = course_error_deg(seen, person, turn)
        compass = {
            number: compass_error_deg(seen.vehicle.approach_rad, person.motorist_direction_code),
            person.party: compass_error_deg(seen.person_heading_rad, person.pedestrian_direction_code)
            if seen.person_speed_mps > STANDS_MPS
            else None,
        }
        wrong, most = Reason.WRONG_DIRECTION, limits.max_direction_error_deg
        found.append(at_most("course_error", course, most, "deg", wrong, person.party, event))
        found += [at_most("compass_error", error, most, "deg", wrong, party, event) for party, error in compass.items()]
    found.append(speed_criterion(measures.initial_speed_error_rel, rules, limits, number, event))
    return found


def _contact_distance_m(seen: ObservedStrike, zones: Iterable[Zone]) -> float:
    """From the reported point to the contact; along the road only where the person was off the carriageway, since the
    reported point lies on the road then."""
    zones = frozenset(zones)
    if not zones or Zone.CARRIAGEWAY in zones:
        return math.hypot(seen.contact.x_m, seen.contact.y_m)
    return abs(seen.contact.along_m(seen.vehicle.approach_rad))


def zone_error_m(outside_m: float, zones: frozenset[Zone]) -> float | None:
    """How far a person was from the nearest reported zone; None if none is reported.

    ``outside_m``: from the carriageway's edge, negative within it.

    >>> zone_error_m(5.0, frozenset({Zone.BESIDE})), zone_error_m(5.0, frozenset({Zone.OUTSIDE}))
    (1.0, 0.0)
    """
    inside_m = -outside_m
    errors = {
        Zone.CARRIAGEWAY: outside_m,
        Zone.BESIDE: max(inside_m - _LANE_BESIDE_M, outside_m - _BESIDE_M),
        Zone.WALKED: max(inside_m, outside_m - _BEYOND_M),
        Zone.OUTSIDE: inside_m,
    }
    return min((max(errors[zone], 0.0) for zone in zones), default=None)


def course_error_deg(seen: ObservedStrike, person: NonMotorist, turn: Turn | None) -> float | None:
    """Least angle between the person's course, seen from the vehicle, and one that the report allows; None if it
    allows any, or that the person stood.

    Across is across the road that a turning vehicle came along or turned into, whichever the report says (``PEDSNR``).

    >>> observed = observe_strikes(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> (seen,) = observed.strikes
    >>> round(course_error_deg(seen, pedestrian_record.non_motorists[0], None))  # he walks straight across
    0
    """
    allowed = told_courses(person, turn)
    if not allowed or (Course.STANDING in allowed and seen.person_speed_mps <= STANDS_MPS):
        return None
    if seen.person_speed_mps <= STANDS_MPS:
        return 180.0
    came = seen.vehicle.approach_rad
    roads = [came] if turn is None else [came, came + math.radians(seen.vehicle.turn_deg)]
    if turn is not None and person.at_near_side is not None:
        roads = roads[:1] if person.at_near_side else roads[1:]
    angles = [
        abs(math.degrees(wrap_angle(seen.person_heading_rad - road)) - RELATIVE_DEG[course]) % 360.0
        for road in roads
        for course in allowed
        if course in RELATIVE_DEG
    ]
    return min((min(angle, 360.0 - angle) for angle in angles), default=180.0)


def compass_error_deg(heading_rad: float, code: int | None) -> float | None:
    """How far a heading is outside the quarter of the compass that is coded; None if none is.

    >>> round(compass_error_deg(math.radians(90), 1), 6)  # north, as coded
    0.0
    """
    if code is None or code not in COMPASS_DEG:
        return None
    apart = abs(math.degrees(wrap_angle(heading_rad - math.radians(COMPASS_DEG[code]))))
    return max(apart - _COMPASS_DEG, 0.0)


def _shown(strike: Strike, seen: ObservedStrike, measures: VehicleMeasures, limits: VerdictSettings) -> list[Criterion]:
    event, person = strike.event_number, strike.person.party
    return [
        shown("closing_speed", seen.contact.closing_speed_mps, "mps", None, event),
        *reported_of(measures, limits, event),
        shown("strike_time", seen.contact.time_s, "s", strike.vehicle.number, event),
        shown("throw_distance", seen.thrown_m, "m", person, event),
        shown("person_speed", seen.person_speed_mps, "mps", person, event),
        shown("time_on_carriageway", seen.exposed_s, "s", person, event),
        shown("outside_carriageway", seen.outside_m, "m", person, event),
    ]


def _other_events(record: CrashRecord, strikes: Sequence[Strike]) -> list[Criterion]:
    """Events of the report that are neither planned strikes nor of the aftermath: a vehicle that ran over whom it had
    struck, or met a thing after it struck a person."""
    planned = {strike.event_number for strike in strikes}
    elsewhere = planned | {each.event_number for each in aftermath_of(record)}
    going_on = {number for strike in strikes for number in strike.going_on}
    found = []
    for event in record.events:
        if event.number in elsewhere or event.number < min(planned):
            continue
        detail = event_named(event.number, event.code)
        what = "part of the strike before it" if event.number in going_on else "not simulated"
        found.append(Criterion("later_event", None, 1.0, "", None, None, f"{detail}: {what}", None, event.number))
    return found
