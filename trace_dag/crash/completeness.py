"""Rules that a record must satisfy to be reconstructed: one table, each rule with its reason to reject.

The rules are the paper's (TRACE, FSE Companion '26): a report is usable if it has the place of the crash, the topology
of the road there and the trajectories of the vehicles. It does not matter which field reports a fact, and a fact that
follows from other fields counts too. A report without a position is rejected earlier, while it is read. Cohorts add the
filters of the settings, and :func:`check` takes further rules from its caller.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from trace_dag.common.errors import Reason, Rejection, UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.schemas import Column, ColumnType
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.codes.elements import DEPARTURES, MOTOR_VEHICLE_IN_TRANSPORT, REL_ROAD, TYP_INT
from trace_dag.crash.crash_types import crash_type_of
from trace_dag.crash.derive import UNSAID_MOVEMENTS, is_near
from trace_dag.crash.event_sequence import OFF_THE_ROAD, CrashEvent, sequence_of
from trace_dag.crash.parties import EventKind, PartyKind
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.crash.road_departure import overturns_on_road, side_of_first
from trace_dag.crash.tables import CRASH_RECORD

US_LATITUDE_DEG: Final = (17.5, 71.6)
US_LONGITUDE_DEG: Final = (-180.0, -64.4)
"""The fifty states, Puerto Rico and the Virgin Islands; the Aleutians beyond 180 degrees have no road FARS covers."""

_TELLING_EVENTS: Final = frozenset({*range(10, 19), 20, 21, *range(50, 79)})
"""``P_CRASH2`` values that say how this vehicle moved, or how the other one did relative to it."""

_FRONT_H: Final = 12.0
_REAR_H: Final = 6.0
_SQUARELY_H: Final = 0.5
"""Half an hour to either side: a corner may be struck by one that turns or crosses."""

_OF_PEOPLE: Final = frozenset({EventKind.PERSON_STRUCK, EventKind.ANIMAL_STRUCK})
_ANGLE: Final = 6
_DIRECTED_MANNERS: Final = frozenset({1, 2, 7, 8, 10})
"""``MAN_COLL`` values that say how the two vehicles were headed relative to each other."""


@dataclass(frozen=True)
class Rule:
    """One rule: ``shortcoming`` returns the sentence of the rejection if the record breaks it, else None."""

    name: str
    reason: Reason
    meaning: str
    shortcoming: Callable[[CrashRecord], str | None]


def check(record: CrashRecord, settings: CrashSettings, *, further: Sequence[Rule] = ()) -> None:
    """Raise :class:`Rejection` with the first rule that a record breaks.

    The cohort's filters come first, then the kind of crash, then completeness, so that an unwanted crash, or a kind
    that is not modelled, is named as such whether complete or not.

    >>> check(record, CrashSettings())
    >>> check(record, CrashSettings(vehicles=3))
    Traceback (most recent call last):
    trace_dag.common.errors.Rejection: outside_cohort: 2 motor vehicles in transport; the cohort takes 3
    """
    for rule in (*filters_of(settings), *further, *KINDS, *RULES, *OF_VERDICTS):
        detail = rule.shortcoming(record)
        if detail is not None:
            raise Rejection(rule.reason, detail)


def filters_of(settings: CrashSettings) -> tuple[Rule, ...]:
    """Return the cohort filters of the settings.

    Raises :class:`UserError` for an unknown kind of crash, and for an element that records do not have.

    >>> [rule.shortcoming(record) for rule in filters_of(CrashSettings(filters={"LGT_COND": (1,)}))]
    ['LGT_COND is 3; the cohort takes 1']
    """
    kinds = () if settings.kinds is None else (_of_kinds(settings.kinds),)
    vehicles = () if settings.vehicles is None else (_number_of_vehicles(settings.vehicles),)
    return (*kinds, *vehicles, *(_element_among(element, codes) for element, codes in settings.filters.items()))


def _element_among(element: str, codes: Collection[int]) -> Rule:
    """Return the rule that a FARS element, such as ``LGT_COND``, has one of these codes.

    The element is that of the crash or of every vehicle in transport. The rule leaves out a crash that does not report
    it. Raises :class:`UserError` for an element that records do not have.
    """
    of_crash, of_vehicle = _coded_columns(CRASH_RECORD.columns), _coded_columns(CRASH_RECORD["vehicles"].fields)
    if element not in of_crash and element not in of_vehicle:
        known = ", ".join(sorted({*of_crash, *of_vehicle}))
        raise UserError(f"setting crash.filters: {element} is not an element of a record; filters can be on {known}")
    wanted = " or ".join(str(code) for code in codes)

    def shortcoming(record: CrashRecord) -> str | None:
        if element in of_crash:
            found = [("", getattr(record, of_crash[element]))]
        else:
            moving = [vehicle for vehicle in record.vehicles if vehicle.in_transport]
            found = [(f" of vehicle {vehicle.number}", getattr(vehicle, of_vehicle[element])) for vehicle in moving]
        others = [f"{element}{where} is {_said(code)}" for where, code in found if code not in codes]
        return f"{'; '.join(others)}; the cohort takes {wanted}" if others else None

    return Rule(f"element_{element.lower()}", Reason.OUTSIDE_COHORT, f"{element} is {wanted}", shortcoming)


def _coded_columns(columns: Iterable[Column]) -> dict[str, str]:
    """Return the names of columns that hold a code, by the FARS elements from which they come."""
    coded = [column for column in columns if column.type is ColumnType.INTEGER and not column.repeated]
    return {element: column.name for column in coded for element in column.source.split(", ") if element}


def _of_kinds(names: Collection[str]) -> Rule:
    """Return the rule that a crash is one of these kinds.

    Raises :class:`UserError` for an unknown name.
    """
    strange = [name for name in names if name not in set(CrashKind)]
    if strange:
        raise UserError(f"setting crash.kinds: {strange[0]} is not a kind of crash; kinds are {', '.join(CrashKind)}")
    wanted = " or ".join(names)

    def shortcoming(record: CrashRecord) -> str | None:
        return None if record.kind in names else f"the kind of crash is {record.kind}; the cohort takes {wanted}"

    return Rule("kinds", Reason.OUTSIDE_COHORT, f"kind of crash is {wanted}", shortcoming)


def _number_of_vehicles(wanted: int) -> Rule:
    """Return the rule that a crash involves that many motor vehicles in transport."""

    def shortcoming(record: CrashRecord) -> str | None:
        found = record.moving_vehicles
        if found == wanted:
            return None
        parked = sum(not vehicle.in_transport for vehicle in record.vehicles)
        beside = f" (and {parked} parked or working)" if parked else ""
        return f"{count_of(found, 'motor vehicle')} in transport{beside}; the cohort takes {wanted}"

    return Rule("number_of_vehicles", Reason.OUTSIDE_COHORT, f"{wanted} motor vehicles in transport", shortcoming)


def _trajectory_known(record: CrashRecord, vehicle: VehicleRecord, partner: VehicleRecord | None) -> bool:
    """Return whether a field of the vehicle, its partner or the crash gives the vehicle's course.

    A vehicle that stood or was struck from behind needs no field of its own: it stood, or was ahead of its partner.
    """
    return (
        vehicle.movement not in (*UNSAID_MOVEMENTS, PreCrashMovement.NO_DRIVER)
        or not vehicle.in_transport
        or vehicle.travel_speed_mps == 0
        or _struck_from_behind(vehicle, partner)
        or crash_type_of(vehicle).of_two
        or crash_type_of(vehicle).single_driver
        or vehicle.critical_event_code in _TELLING_EVENTS
        or (partner is not None and crash_type_of(partner).of_two)
        or any(event.party_1 == vehicle.number and event.code in DEPARTURES for event in record.events)
        or (
            partner is not None
            and record.first_harmful_event_code == MOTOR_VEHICLE_IN_TRANSPORT
            and (record.manner_of_collision_code in _DIRECTED_MANNERS or _front_into_side(record, vehicle, partner))
        )
    )


def _front_into_side(record: CrashRecord, vehicle: VehicleRecord, partner: VehicleRecord) -> bool:
    """Return whether an angle crash (``MAN_COLL`` 6) joins a front and a side: paths crossed, or one vehicle turned."""
    areas = (vehicle.impact, partner.impact)
    fronts = [area is not None and is_near(area, _FRONT_H) for area in areas]
    return record.manner_of_collision_code == _ANGLE and None not in areas and any(fronts)


def _struck_from_behind(vehicle: VehicleRecord, partner: VehicleRecord | None) -> bool:
    if partner is None or vehicle.impact is None or partner.impact is None:
        return False
    return is_near(vehicle.impact, _REAR_H, _SQUARELY_H) and is_near(partner.impact, _FRONT_H, _SQUARELY_H)


def _location(record: CrashRecord) -> str | None:
    """Check that a report of a US state lies in the US; a register without a state may lie anywhere."""
    low, high = US_LATITUDE_DEG
    west, east = US_LONGITUDE_DEG
    if record.state_code is None or (low <= record.latitude_deg <= high and west <= record.longitude_deg <= east):
        return None
    return (
        f"the reported position ({record.latitude_deg:g}, {record.longitude_deg:g}) lies outside the United States "
        f"(latitude {low:g} to {high:g}, longitude {west:g} to {east:g})"
    )


def _topology(record: CrashRecord) -> str | None:
    reported = TYP_INT.known(record.intersection_type_code), record.junction_relation_code
    if "road_topology" in record.implied or reported != (None, None):
        return None
    return (
        f"neither TYP_INT ({_said(record.intersection_type_code)}) nor RELJCT2 (not known) tells whether and what "
        "intersection the crash was at"
    )


def _trajectory(record: CrashRecord) -> str | None:
    """Check the courses of the vehicles before the first event, and the person struck in it."""
    try:
        sequence = sequence_of(record)
    except Rejection:
        return _course_of(record, [vehicle for vehicle in record.vehicles if vehicle.in_transport])
    first = sequence.first
    if first.kind in OFF_THE_ROAD:
        if overturns_on_road(record, sequence):
            return _course_of(record, [first.vehicle])
        if side_of_first(record, first) is not None:
            return None
        return (
            f"nothing tells to which side vehicle {first.vehicle.number} left the road: no departure to a side among "
            f"its events, ACC_TYPE {_said(first.vehicle.crash_type_code)}, "
            f"P_CRASH2 {_said(first.vehicle.critical_event_code)}"
        )
    struck = [event for event in sequence.events if event.kind in _OF_PEOPLE]
    begun = {vehicle.number for vehicle in first.vehicles}
    drove = [event.vehicle for event in struck if event.vehicle.number not in begun]
    courses = (_course_of(record, first.vehicles), *(_course_of(record, [vehicle]) for vehicle in drove))
    untold = next((sentence for sentence in courses if sentence is not None), None)
    return untold or (_place_of_person(record, struck[0]) if struck and struck[0] is first else None)


def _place_of_person(record: CrashRecord, strike: CrashEvent) -> str | None:
    person = strike.person
    if person.place_code is not None or REL_ROAD.known(record.road_relation_code) is not None:
        return None
    if person.heading is not None:
        return None  # where it went, beside where the vehicle went, tells more than where it was
    if person.kind is PartyKind.ANIMAL:
        return "nothing tells where the animal was: REL_ROAD is not known"
    return (
        f"nothing tells where person {person.number} was: neither LOCATION nor PEDPOS nor BIKEPOS nor REL_ROAD is known"
    )


def _course_of(record: CrashRecord, vehicles: Sequence[VehicleRecord]) -> str | None:
    """Check that every vehicle's course is reported, by its own fields or those of its partner."""
    for index, vehicle in enumerate(vehicles):
        partner = vehicles[1 - index] if len(vehicles) == 2 else None
        if not _trajectory_known(record, vehicle, partner):
            said = "unknown" if vehicle.movement is PreCrashMovement.UNKNOWN else int(vehicle.movement)
            return (
                f"nothing tells how vehicle {vehicle.number} moved: P_CRASH1 {said}, ACC_TYPE "
                f"{_said(vehicle.crash_type_code)}, P_CRASH2 {_said(vehicle.critical_event_code)}; nor is there a "
                "departure among its events, the manoeuvre before a person it strikes (MOTMAN, PEDCGP, BIKECGP), a "
                "speed above 25 mph (TRAV_SP), a centreline crossed by the other one (SOE 68), or MAN_COLL with both "
                "areas of impact"
            )
    return None


def _said(code: int | None) -> str:
    return "not reported" if code is None else str(code)


def _impact(record: CrashRecord) -> str | None:
    """Check that there is an area of impact on a side of a body (not the top or undercarriage).

    Without one, any simulation would agree with the report. A departure from the road is also judged by its place. A
    crash of a register without areas is judged without them, and is never corroborated.
    """
    if "impact" in record.register_lacks:
        return None
    try:
        sequence = sequence_of(record)
    except Rejection:
        return None
    first = sequence.first
    if first.kind in OFF_THE_ROAD:
        return None
    judged = [event for event in sequence.events if event.kind in _OF_PEOPLE] if first.kind in _OF_PEOPLE else [first]
    struck = [vehicle for event in judged for vehicle in event.vehicles]
    if any(vehicle.impact is not None for vehicle in struck):
        return None
    numbers = sorted({vehicle.number for vehicle in struck})
    said = " and ".join(f"vehicle {number}" for number in numbers)
    return f"nothing tells on which side {said} {'was' if len(numbers) == 1 else 'were'} struck"


def _missing(reason: Reason) -> Callable[[CrashRecord], str | None]:
    def sentence(record: CrashRecord) -> str | None:
        try:
            sequence_of(record)
        except Rejection as missing:
            return missing.detail if missing.reason is reason else None
        return None

    return sentence


KINDS: Final[tuple[Rule, ...]] = tuple(
    Rule(name, reason, meaning, _missing(reason))
    for name, reason, meaning in (
        ("sequence", Reason.INCOMPLETE_SEQUENCE, "which parties met first is known, and who met whom in its contacts"),
        ("modelled", Reason.NOT_MODELLED, "the first harmful event is one that can be simulated"),
    )
)
"""Rules about the kind of crash."""

RULES: Final[tuple[Rule, ...]] = (
    Rule("location", Reason.INCOMPLETE_LOCATION, "the place of the crash is known", _location),
    Rule("topology", Reason.INCOMPLETE_TOPOLOGY, "the topology of the road is known", _topology),
    Rule("trajectory", Reason.INCOMPLETE_TRAJECTORY, "how each vehicle moved can be told", _trajectory),
)
"""The paper's rules, in the order they are applied."""

OF_VERDICTS: Final[tuple[Rule, ...]] = (
    Rule("impact", Reason.INCOMPLETE_IMPACT, "on which side a vehicle was struck is known of one at least", _impact),
)
"""Rules that a verdict needs beyond the paper's."""
