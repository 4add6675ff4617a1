"""A crash in words, for people and for language models.

Written from codes alone, never from labels, so that the same facts give the same words for every source. Units are
those of US police reports (miles per hour); SI values are in the record.
"""

from __future__ import annotations

from calendar import month_name
from collections.abc import Set
from typing import Final

from trace_dag.common.units import mps_to_mph
from trace_dag.crash.classes import CollisionType, CrashKind, RoadTopology, VehicleTrajectory
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.bodies import BODY_TYP
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import (
    CrashRecord,
    EventRecord,
    ImpactArea,
    NonMotorist,
    PreCrashMovement,
    VehicleClass,
    VehicleRecord,
)

_CLASS_NAMES = {
    VehicleClass.SUV: "SUV",
    VehicleClass.LIGHT_TRUCK: "light truck",
    VehicleClass.TRACTOR_TRAILER: "tractor-trailer",
}
TOPOLOGIES = {
    RoadTopology.FOUR_WAY: "four-way intersection",
    RoadTopology.T: "T junction",
    RoadTopology.Y: "Y junction",
    RoadTopology.L: "L junction",
    RoadTopology.FIVE_POINT_OR_MORE: "intersection of five or more roads",
}
"""Coverage classes of intersections as people call them; the others are their names."""
_STANDING = (PreCrashMovement.NO_DRIVER, PreCrashMovement.STOPPED, PreCrashMovement.PARKED_IN_LANE)
"""Movements of vehicles that can stand: that they did so needs no speed."""
_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def summarise(record: CrashRecord) -> str:
    """Return a summary of the crash: scene, vehicles, events, implied values and contradictions.

    >>> print(summarise(pedestrian_record).splitlines()[3])
    Person 1: pedestrian, crossing the roadway, in a travel lane, struck by vehicle 1.
    """
    paragraphs = [
        _scene(record),
        *(_vehicle(vehicle) for vehicle in record.vehicles),
        _sequence(record),
        _non_motorists(record),
        _remarks(record),
    ]
    return "\n".join(paragraph for paragraph in paragraphs if paragraph)


def in_one_sentence(record: CrashRecord) -> str:
    """Return one sentence with time, place, parties and event.

    The event is the first contact of vehicles, or the first harmful event of another kind of crash.

    >>> in_one_sentence(pedestrian_record)
    'On June 14, 2023 at 15:20 on NE-411, Nebraska, a sedan that was going straight at 45 mph struck a pedestrian.'
    """
    streets = " and ".join(name for name in (record.trafficway_1, record.trafficway_2) if name)
    place = f" on {streets}" if streets else ""
    if record.state_name:
        place += f"{',' if streets else ' in'} {record.state_name}"
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    event = record.first_contact or next((each for each in record.events if codes.HARM_EV.meaning(each.code)), None)
    involved = [vehicles[party] for party in (event.party_1, event.party_2) if party in vehicles] if event else []
    who = " and ".join(_driving(vehicle) for vehicle in involved or record.vehicles)
    code = event.code if event else record.first_harmful_event_code
    if len(involved) > 1 or (len(record.vehicles) > 1 and code in codes.VEHICLE_CONTACTS):
        what = "collided"
    else:
        what = codes.HARM_EV.meaning(code) or "crashed"
        if len(involved or record.vehicles) > 1:  # nothing tells which of them it was
            who, what = f"{_count(len(record.vehicles), 'motor vehicle')} crashed", f"(one of them {what})"
    more = _others_involved(record, event, {vehicle.number for vehicle in involved}) if event and involved else ""
    sentence = f"{_when(record)}{place}, {who} {what}{more}.".strip(" ,")
    return sentence[0].upper() + sentence[1:]


def classes_in_words(record: CrashRecord) -> tuple[str, ...]:
    """Return the kind of crash, the kind of place and the directions of the vehicles, without unreported facts.

    >>> classes_in_words(pedestrian_record), classes_in_words(tree_record)
    (('pedestrian', 'not an intersection'), ('fixed object', 'not an intersection'))
    """
    struck = record.kind if record.collision_type is CollisionType.OTHERS else record.collision_type
    place, went = record.road_topology, record.vehicle_trajectory
    return (
        *((struck.replace("_", " "),) if struck is not CrashKind.OTHER else ()),
        *((TOPOLOGIES.get(place, place.replace("_", " ")),) if place is not RoadTopology.OTHERS else ()),
        *((went.replace("_", " "),) if went is not VehicleTrajectory.OTHERS else ()),
    )


def _driving(vehicle: VehicleRecord) -> str:
    """Return a vehicle with its movement, such as "a compact SUV that was going straight at 20 mph"."""
    kind = BODY_TYP.meaning(vehicle.body_type_code) or _CLASS_NAMES.get(vehicle.vehicle_class, vehicle.vehicle_class)
    article = "an" if kind[0] in "aeioAEIO" or kind.startswith("SUV") else "a"
    if not vehicle.in_transport:
        return f"a parked or working {kind}"
    movement = codes.P_CRASH1.meaning(vehicle.movement)
    speed = _speed(vehicle).split(" (")[0] if vehicle.travel_speed_mps is not None else ""
    if vehicle.travel_speed_mps == 0.0 and vehicle.movement in _STANDING:
        speed = " and stood still" if vehicle.movement is PreCrashMovement.NO_DRIVER else ""
    elif vehicle.travel_speed_mps == 0.0:
        return f"{article} {kind} that stood still"
    return f"{article} {kind}" + (f" that {movement}{speed}" if movement else speed)


def _others_involved(record: CrashRecord, event: EventRecord, involved: Set[int]) -> str:
    """Return a text on the vehicles that the event does not name.

    It has the number that struck the same person, and the number of the others.
    """
    others = {vehicle.number for vehicle in record.vehicles} - involved
    struck_too = {
        each.party_1
        for each in record.events
        if each.kind is EventKind.PERSON_STRUCK and each.party_2 is not None and each.party_2 == event.party_2
    } & others
    left = len(others - struck_too)
    said = f"; {_count(len(struck_too), 'more vehicle')} struck the same person" if struck_too else ""
    return said + (f"; {_count(left, 'more vehicle')} {'was' if left == 1 else 'were'} involved" if left else "")


def _scene(record: CrashRecord) -> str:
    weather = codes.WEATHER.meaning(record.weather_code)
    conditions = (codes.LGT_COND.meaning(record.light_code), weather and f"in {weather}")
    around = "".join(f", {each}" for each in conditions if each)
    junction = codes.TYP_INT.meaning(record.intersection_type_code)
    relation = codes.RELJCT2.meaning(record.junction_relation_code)
    manner = codes.MAN_COLL.meaning(record.manner_of_collision_code)
    sentences = [
        f"Crash {record.key}: {_count(record.moving_vehicles, 'motor vehicle')} in transport{_when(record)}"
        f"{_where(record)}{around}."
    ]
    if junction or relation:
        place = f"The place was {junction}" if junction else "The place was"
        sentences.append(f"{place}{',' if junction and relation else ''} {relation}".rstrip() + ".")
    if manner:
        sentences.append(f"Manner of collision of the first harmful event: {manner}.")
    first = codes.HARM_EV.meaning(record.first_harmful_event_code)
    if first and not any(event.is_harmful for event in record.events):
        sentences.append(f"First harmful event: a vehicle {first}.")
    return " ".join(sentences)


def _when(record: CrashRecord) -> str:
    if record.year is None or record.month is None:
        return f" in {record.case_year}"
    day = f" {record.day}" if record.day is not None else ""
    clock = (
        f" at {record.hour:02d}:{record.minute:02d}" if record.hour is not None and record.minute is not None else ""
    )
    return f" on {month_name[record.month]}{day}, {record.year}{clock}"


def _where(record: CrashRecord) -> str:
    streets = " and ".join(name for name in (record.trafficway_1, record.trafficway_2) if name)
    route = codes.ROUTE.meaning(record.route_code)
    land_use = {1: "rural ", 2: "urban "}.get(record.rural_urban_code or 0, "")
    road_class = codes.FUNC_SYS.meaning(record.function_class_code)
    kind = f"{route}, {land_use}{road_class}" if route and road_class else route or f"{land_use}{road_class}".strip()
    place = f", on {streets}" if streets else ""
    if kind:
        place += f" ({kind})"
    return place + (f", {record.state_name}" if record.state_name else "")


def _vehicle(vehicle: VehicleRecord) -> str:
    kind = (
        BODY_TYP.meaning(vehicle.body_type_code)
        or f"vehicle (taken for a {_CLASS_NAMES.get(vehicle.vehicle_class, vehicle.vehicle_class)})"
    )
    year = f"{vehicle.model_year} " if vehicle.model_year else ""
    trailers = f" with {codes.TOW_VEH.meaning(min(vehicle.trailers, 3))}" if vehicle.trailers else ""
    head = f"Vehicle {vehicle.number}, a {year}{kind}{trailers},"
    if not vehicle.in_transport:
        return f"{head} was not in transport{_impact(vehicle)}."
    movement = codes.P_CRASH1.meaning(vehicle.movement) or "was moving in an unknown way"
    if vehicle.movement is PreCrashMovement.UNKNOWN and vehicle.crash_type_code is None:
        movement = "moved in a way that is not reported"
    sentences = [f"{head} {movement}{_speed(vehicle)}{_road(vehicle)}{_impact(vehicle)}."]
    sentences += [
        f"{label}: {meaning}."
        for label, meaning in (
            ("Critical event", codes.P_CRASH2.meaning(vehicle.critical_event_code)),
            ("Avoidance", codes.P_CRASH3.meaning(vehicle.avoidance_code)),
            ("Stability", codes.PCRASH4.meaning(vehicle.stability_code)),
            ("Location before the impact", codes.PCRASH5.meaning(vehicle.location_code)),
            ("Crash type", codes.ACC_TYPE.meaning(vehicle.crash_type_code)),
            ("Traffic control", _control(vehicle)),
            ("Speeding", codes.SPEEDREL.meaning(5) if vehicle.speeding else ""),
            ("Rollover", "yes" if vehicle.rollover_code not in (None, *codes.NO_ROLLOVER) else ""),
            ("Hit and run", codes.HIT_RUN.meaning(1) if vehicle.hit_and_run else ""),
        )
        if meaning
    ]
    return " ".join(sentences)


def _speed(vehicle: VehicleRecord) -> str:
    if vehicle.travel_speed_mps is None:
        speed = " at an unknown speed"
    else:
        more_than = "more than " if vehicle.travel_speed_is_lower_bound else ""
        speed = f" at {more_than}{mps_to_mph(vehicle.travel_speed_mps):.0f} mph"
    limit = f" (limit {mps_to_mph(vehicle.speed_limit_mps):.0f} mph)" if vehicle.speed_limit_mps is not None else ""
    return speed + limit


def _road(vehicle: VehicleRecord) -> str:
    trafficway = codes.VTRAFWAY.meaning(vehicle.trafficway_code)
    lanes = codes.VNUM_LAN.meaning(vehicle.lanes)
    if not trafficway and not lanes:
        return ""
    road = f" on {trafficway}" if trafficway else " on a road"
    details = [
        part
        for part in (
            lanes,
            codes.VALIGN.meaning(vehicle.alignment_code),
            codes.VPROFILE.meaning(vehicle.profile_code),
            codes.VSURCOND.meaning(vehicle.surface_condition_code),
        )
        if part and vehicle.trafficway_code != codes.NON_TRAFFICWAY
    ]
    return road + (f" ({', '.join(details)})" if details else "")


def _impact(vehicle: VehicleRecord) -> str:
    if vehicle.impact is None:
        return ""
    how = " (implied)" if "impact" in vehicle.implied else ""
    return f", and was hit at {_area(vehicle.impact)}{how}"


def _area(area: ImpactArea) -> str:
    return codes.IMPACT1.meaning(area.code)


def _control(vehicle: VehicleRecord) -> str:
    control = codes.VTRAFCON.meaning(vehicle.traffic_control_code) if vehicle.traffic_control_code else ""
    return f"{control}, which it disobeyed" if control and vehicle.disobeyed_control else control


def _sequence(record: CrashRecord) -> str:
    if not record.events:
        return ""
    return "Sequence: " + "; ".join(f"({event.number}) {event_in_words(event)}" for event in record.events) + "."


def event_in_words(event: EventRecord) -> str:
    """Return an event as a clause with its parties and the areas of contact.

    >>> event_in_words(tree_record.events[1])
    "vehicle 1 struck a tree (at 12 o'clock (front))"
    """
    subject = f"vehicle {event.party_1}" if event.party_1 is not None else "a vehicle"
    at_1 = f" (at {_area(event.area_1)})" if event.area_1 else ""
    if event.code in codes.VEHICLE_EVENTS and event.party_2 is not None:
        at_2 = f" (at {_area(event.area_2)})" if event.area_2 else ""
        verb = (
            "was involved, by objects set in motion, with"
            if event.code == codes.SET_IN_MOTION_BY_VEHICLE
            else codes.SOE.meaning(event.code).split(" a ")[0]
        )
        return f"{subject}{at_1} {verb} vehicle {event.party_2}{at_2}"
    whom = " that is not named" if event.code in codes.VEHICLE_CONTACTS else ""
    if event.kind is EventKind.PERSON_STRUCK and event.party_2 is not None:
        whom = f", {party_in_words(event.party_2)}"
    return f"{subject} {codes.SOE.meaning(event.code) or 'had an event that is not reported'}{whom}{at_1}"


def event_named(number: int, code: int) -> str:
    """Return an event's name for sentences: its ``EVENTNUM``, ``SOE`` and the meaning of the code.

    >>> event_named(3, 24), event_named(4, 99)
    ('event 3, struck a guardrail (SOE 24)', 'event 4 (SOE 99)')
    """
    meaning = codes.SOE.meaning(code)
    return f"event {number}{', ' if meaning else ''}{meaning} (SOE {code})"


def _non_motorists(record: CrashRecord) -> str:
    return " ".join(
        f"Person {person.number}: {', '.join(part for part in _person(person) if part)}."
        for person in record.non_motorists
    )


def place_in_words(person: NonMotorist) -> str:
    """Return a person's place when struck, by the typing, else by ``LOCATION``; empty if not reported.

    >>> place_in_words(pedestrian_record.non_motorists[0])  # PEDPOS 3
    'in a travel lane'
    """
    return (
        codes.PEDPOS.meaning(person.pedestrian_position_code)
        or codes.BIKEPOS.meaning(person.cyclist_position_code)
        or codes.LOCATION.meaning(person.location_code)
    )


def _person(person: NonMotorist) -> tuple[str, ...]:
    return (
        codes.PER_TYP.meaning(person.person_type_code) or "non-motorist",
        *(codes.NMACTION.meaning(code) for code in person.actions),
        place_in_words(person),
        f"struck by vehicle {person.striking_vehicle}" if person.striking_vehicle else "",
    )


def _remarks(record: CrashRecord) -> str:
    implied = [
        f"vehicle {vehicle.number}: {', '.join(vehicle.implied)}" for vehicle in record.vehicles if vehicle.implied
    ]
    if record.implied:
        implied.insert(0, f"crash: {', '.join(record.implied)}")
    implied += [f"event {event.number}: {', '.join(event.implied)}" for event in record.events if event.implied]
    remarks = [f"Implied by other fields: {'; '.join(implied)}."] if implied else []
    if record.ambiguities:
        remarks.append("The report leaves open: " + "; ".join(record.ambiguities) + ".")
    if record.contradictions:
        remarks.append("The report contradicts itself: " + "; ".join(record.contradictions) + ".")
    return " ".join(remarks)


def _count(number: int, noun: str) -> str:
    word = _COUNTS[number] if number < len(_COUNTS) else str(number)
    return f"{word} {noun}" + ("" if number == 1 else "s")


# --- light and weather -----------------------------------------------------------------------------------------------
_DARK: Final = frozenset({2, 3, 6})  # LGT_COND: not lit, lit, dark without more


def is_dark(record: CrashRecord) -> bool:
    """Return whether it was dark, lit or not (``LGT_COND``).

    >>> is_dark(record), is_dark(pedestrian_record)  # LGT_COND 3, dark and lighted; 1, daylight
    (True, False)
    """
    return record.light_code in _DARK


def conditions_in_words(record: CrashRecord) -> str:
    """Return the reported light and weather, such as "in daylight, rain"; empty if neither is reported.

    >>> conditions_in_words(record)
    'in the dark on a lit road, clear weather'
    """
    return ", ".join(
        filter(None, (codes.LGT_COND.meaning(record.light_code), codes.WEATHER.meaning(record.weather_code)))
    )
