"""Judging what was measured: criteria with thresholds, and what they add up to.

Three rule sets. "trace-dag": the paper's three criteria (first contact near the reported location, each impact within
two clock positions, each direction as reported), with the impact measured where the bodies touch, and thresholds
from settings. "strict": those, and every reported travel speed kept, which the paper does not ask for. "published": the
published pipeline's procedure as it is, contact within 10 m and the impact as the direction to the other body's
centre, for comparison.

A crash is accepted if no criterion that can reject it fails and each of the paper's three kinds was evaluated at least
once: what the report leaves open is "not evaluated", and a crash about which nothing was evaluated has not been shown
to be right. A report need not give speeds.
"""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.crash.parties import party_in_words
from trace_dag.crash.summary import event_named
from trace_dag.errors import Reason
from trace_dag.settings import RuleSetName, VerdictSettings
from trace_dag.sim.types import SimulationLog
from trace_dag.verdict.metrics import CrashMeasures, VehicleMeasures
from trace_dag.verdict.types import Criterion
from trace_dag.wording import beside_limit

REQUIRED = (Reason.NO_COLLISION, Reason.WRONG_LOCATION, Reason.WRONG_IMPACT, Reason.WRONG_DIRECTION)
REQUIRED_OF_SEQUENCES = (Reason.NO_COLLISION, Reason.WRONG_LOCATION, Reason.WRONG_IMPACT)
"""Of several strikes or contacts: a person's direction is coded near intersections only, and who stood or left a
parking place made no turn."""
REQUIRED_OF_DEPARTURES = (Reason.NO_COLLISION, Reason.NO_DEPARTURE, Reason.WRONG_SIDE, Reason.WRONG_LOCATION)
"""The area of impact of an object is not known in 15 % of such crashes (2016)."""
REQUIRED_OF_OVERTURNS = (Reason.NO_OVERTURN, Reason.WRONG_LOCATION)
"""Who overturned on the roadway left it to no side."""
UNITS_IN_WORDS = {"h": "clock positions", "deg": "degrees", "mps": "m/s"}
_INCOMPLETE = {
    Reason.WRONG_DIRECTION: Reason.INCOMPLETE_TRAJECTORY,
    Reason.WRONG_SIDE: Reason.INCOMPLETE_TRAJECTORY,
    Reason.WRONG_IMPACT: Reason.INCOMPLETE_IMPACT,
}
"""What a crash is rejected for where the report says nothing that the reason could be judged by."""
_REJECTING = (
    Reason.NO_COLLISION,
    Reason.WRONG_PARTY,
    Reason.NO_DEPARTURE,
    Reason.WRONG_SIDE,
    Reason.NO_OVERTURN,
    Reason.WRONG_LOCATION,
    Reason.WRONG_IMPACT,
    Reason.WRONG_SEQUENCE,
    Reason.WRONG_ZONE,
    Reason.WRONG_DIRECTION,
    Reason.WRONG_SPEED,
)


@dataclass(frozen=True)
class RuleSet:
    """What a set of rules judges by: whether the impact is the direction to the other body's centre instead of where
    they touch, thresholds of its own or None for those of the settings, and whether a reported speed that is not kept
    rejects."""

    by_bearing: bool = False
    limits: VerdictSettings | None = None
    speeds_reject: bool = False

    def clock_error(self, vehicle: VehicleMeasures) -> float | None:
        """The clock error (hours) that counts."""
        return vehicle.bearing_clock_error_h if self.by_bearing else vehicle.clock_error_h


RULE_SETS: dict[RuleSetName, RuleSet] = {
    "trace-dag": RuleSet(),
    "strict": RuleSet(speeds_reject=True),
    "published": RuleSet(
        by_bearing=True,
        limits=VerdictSettings(rule_set="published", max_contact_distance_m=10.0),
    ),
}


@dataclass(frozen=True)
class Judgement:
    """What criteria add up to: ``reason`` and ``detail`` say why a crash is not accepted."""

    accepted: bool
    reason: Reason | None
    detail: str


def criteria(measures: CrashMeasures | None, log: SimulationLog, settings: VerdictSettings) -> tuple[Criterion, ...]:
    """Every criterion of the rule set, those that reject first, then those that are only reported.

    >>> (criterion,) = criteria(None, log, VerdictSettings())  # nothing touched
    >>> criterion.reason.value, criterion.passed
    ('no_collision', False)
    """
    if measures is None:
        detail = log.reason
        return (Criterion("contact", 0.0, 1.0, "contacts", False, Reason.NO_COLLISION, detail),)
    rules = RULE_SETS[settings.rule_set]
    limits = rules.limits or settings
    rejecting = [
        Criterion("contact", 1.0, 1.0, "contacts", True, Reason.NO_COLLISION),
        at_most(
            "contact_distance", measures.contact_distance_m, limits.max_contact_distance_m, "m", Reason.WRONG_LOCATION
        ),
    ]
    if not measures.right_pair:
        numbers = " and ".join(str(vehicle.number) for vehicle in measures.vehicles)
        detail = f"the first contact is between vehicles {numbers}, which no event of the report has touch first"
        rejecting.append(Criterion("right_pair", 0.0, 1.0, "", False, Reason.WRONG_IMPACT, detail))
    for vehicle in measures.vehicles:
        error = rules.clock_error(vehicle)
        rejecting.append(clock_criterion(error, limits, vehicle.number))
    for vehicle in measures.vehicles:
        rejecting.append(direction_criterion(vehicle.turn_error_deg, limits, vehicle.number))
    relation = measures.relation_error_deg
    rejecting.append(at_most("relation_error", relation, limits.max_direction_error_deg, "deg", Reason.WRONG_DIRECTION))
    speeds = [
        speed_criterion(vehicle.initial_speed_error_rel, rules, limits, vehicle.number) for vehicle in measures.vehicles
    ]
    return (*rejecting, *speeds, *_reported(measures, limits))


def at_most(
    name: str,
    value: float | None,
    threshold: float,
    unit: str,
    reason: Reason | None,
    number: int | None = None,
    event: int | None = None,
) -> Criterion:
    """A criterion on the size of a value, not evaluated where there is none.

    >>> [at_most("contact_distance", each, 5.0, "m", Reason.WRONG_LOCATION).passed for each in (5.0, -6.0, None)]
    [True, False, None]
    """
    if value is None:
        return Criterion(name, None, threshold, unit, None, reason, "not reported", number, event)
    return Criterion(name, value, threshold, unit, abs(value) <= threshold, reason, "", number, event)


def clock_criterion(error_h: float | None, limits: VerdictSettings, number: int, event: int | None = None) -> Criterion:
    """The criterion on where a body was struck, against the reported clock position.

    >>> [clock_criterion(error_h, VerdictSettings(), 1).passed for error_h in (2.0, 2.1, None)]
    [True, False, None]
    """
    return at_most("clock_error", error_h, limits.max_clock_error_h, "h", Reason.WRONG_IMPACT, number, event)


def direction_criterion(
    error_deg: float | None, limits: VerdictSettings, number: int, event: int | None = None
) -> Criterion:
    """The criterion on how far a vehicle turned, against the reported turn.

    >>> [direction_criterion(error_deg, VerdictSettings(), 1).passed for error_deg in (10.0, 170.0, None)]
    [True, False, None]
    """
    wrong, most = Reason.WRONG_DIRECTION, limits.max_direction_error_deg
    return at_most("direction_error", error_deg, most, "deg", wrong, number, event)


def speed_criterion(
    error_rel: float | None, rules: RuleSet, limits: VerdictSettings, number: int, event: int | None = None
) -> Criterion:
    """The criterion on the initial speed against the reported one, which rejects where the rule set says so.

    >>> [speed_criterion(0.5, rules, VerdictSettings(), 1).reason for rules in (RuleSet(), RULE_SETS["strict"])]
    [None, <Reason.WRONG_SPEED: 'wrong_speed'>]
    """
    wrong = Reason.WRONG_SPEED if rules.speeds_reject else None
    return at_most("initial_speed_error", error_rel, limits.max_speed_error_rel, "rel", wrong, number, event)


def _reported(measures: CrashMeasures, limits: VerdictSettings) -> list[Criterion]:
    found = [
        shown("approach_angle", measures.approach_angle_deg, "deg"),
        shown("closing_speed", measures.closing_speed_mps, "mps"),
    ]
    for vehicle in measures.vehicles:
        found += reported_of(vehicle, limits)
    for event in measures.later_events:
        value = None if event.occurred is None else float(event.occurred)
        detail = event_named(event.number, event.code) + ("" if value is not None else ": not simulated")
        found.append(Criterion("later_event", value, 1.0, "", event.occurred, None, detail, None, event.number))
    return found


def reported_of(vehicle: VehicleMeasures, limits: VerdictSettings, event: int | None = None) -> list[Criterion]:
    """What is shown of one vehicle of a contact.

    >>> from trace_dag.verdict.metrics import compare
    >>> shown_of_first = reported_of(compare(first_contact, record).vehicles[0], VerdictSettings())
    >>> [(each.name, each.value) for each in shown_of_first if each.name == "reported_clock"]
    [('reported_clock', 3.0)]
    """
    number = vehicle.number
    return [
        at_most(
            "impact_speed_error", vehicle.impact_speed_error_rel, limits.max_speed_error_rel, "rel", None, number, event
        ),
        shown("clock", vehicle.clock_h, "h", number, event),
        shown("reported_clock", vehicle.reported_clock_h, "h", number, event),
        shown("bearing_clock", vehicle.bearing_clock_h, "h", number, event),
        shown("turn", vehicle.turn_deg, "deg", number, event),
        shown("initial_speed", vehicle.initial_speed_mps, "mps", number, event),
        shown("impact_speed", vehicle.impact_speed_mps, "mps", number, event),
        shown("delta_v", vehicle.delta_v_mps, "mps", number, event),
        shown("pdof", vehicle.pdof_deg, "deg", number, event),
        shown("arrival_error", vehicle.arrival_error_m, "m", number, event),
        shown("path_error_p99", vehicle.path_error_p99_m, "m", number, event),
        shown("tracked_speed_error_p99", vehicle.tracked_speed_error_p99_rel, "rel", number, event),
    ]


def shown(name: str, value: float | None, unit: str, number: int | None = None, event: int | None = None) -> Criterion:
    """A measure that is shown and judges nothing."""
    return Criterion(name, value, None, unit, None, None, "", number, event)


def judgement(judged: tuple[Criterion, ...], required: tuple[Reason, ...] = REQUIRED) -> Judgement:
    """Whether the crash is accepted; if not, the first reason in the order of the flow, and the sentence for it.

    Of each ``required`` reason something has to have been evaluated.

    >>> found = judgement((at_most("contact_distance", 6.0, 5.0, "m", Reason.WRONG_LOCATION),), ())
    >>> found.reason.value, found.detail
    ('wrong_location', 'contact distance 6.0 m, at most 5 allowed')
    """
    for reason in _REJECTING:
        of_kind = [criterion for criterion in judged if criterion.reason is reason]
        failed = next((criterion for criterion in of_kind if criterion.passed is False), None)
        if failed is not None:
            return Judgement(False, reason, _sentence(failed))
        if reason in required and not any(criterion.passed for criterion in of_kind):
            names = ", ".join(sorted({criterion.name for criterion in of_kind}))
            detail = f"the report gives nothing to judge it by: {names} not evaluated"
            return Judgement(False, _INCOMPLETE.get(reason, reason), detail)
    skipped = [criterion for criterion in judged if criterion.reason is not None and criterion.passed is None]
    named = ", ".join(_name(criterion) for criterion in skipped)
    return Judgement(True, None, f"not evaluated, since not reported: {named}" if skipped else "")


def _name(criterion: Criterion) -> str:
    name = criterion.name.replace("_", " ")
    who = "" if criterion.vehicle_number is None else f" of {party_in_words(criterion.vehicle_number)}"
    return f"{name}{who}" if criterion.event_number is None else f"{name}{who} in event {criterion.event_number}"


def _sentence(criterion: Criterion) -> str:
    if criterion.detail:
        return criterion.detail
    assert criterion.value is not None
    assert criterion.threshold is not None
    size = abs(criterion.value)
    if criterion.unit == "rel":
        sign, value = "-" if criterion.value < 0 else "+", beside_limit(100 * size, 100 * criterion.threshold, 0)
        return f"{_name(criterion)} {sign}{value}%, at most {100 * criterion.threshold:g}% either way allowed"
    value, unit = beside_limit(size, criterion.threshold), UNITS_IN_WORDS.get(criterion.unit, criterion.unit)
    return f"{_name(criterion)} {value} {unit}, at most {criterion.threshold:g} allowed"
