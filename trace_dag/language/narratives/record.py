"""Crash records from the supported facts of a narrative, each field with its quotation."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass, fields, replace
from typing import Final, TypeVar

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.derive import impact_area
from trace_dag.crash.parties import party_in_words, thing_party, thing_struck
from trace_dag.crash.record import CrashRecord, EventRecord, NonMotorist, Origin, Quotation, VehicleRecord, origins
from trace_dag.crash.registers.rows import TIME, ReportedTime
from trace_dag.crash.registers.table import RowReader
from trace_dag.crash.reported_place import Place
from trace_dag.language.narratives.reading import Fact, NarrativeEvent, Reading
from trace_dag.language.narratives.vocabulary import CRASH, Vocabulary, parse_measure

_TIME: Final = re.compile(r"(?P<year>\d{4})(?:-(?P<month>\d\d)-(?P<day>\d\d)(?:[ T](?P<hour>\d\d):(?P<minute>\d\d))?)?")
_BODY: Final = frozenset({"vehicle_class", "length_m", "width_m", "height_m", "mass_kg"})
"""Fields that follow from the kind of body, in one go with it."""
Part = CrashRecord | VehicleRecord | NonMotorist
P = TypeVar("P", CrashRecord, VehicleRecord, NonMotorist)


@dataclass(frozen=True)
class Narrative:
    """A narrative, with the known time and place of the crash.

    The time is 2023, 2023-05-03 or 2023-05-03 16:20.
    """

    id: str
    text: str
    time: str = ""
    place: Place | None = None


def record_of(narrative: Narrative, found: Place | None, reading: Reading, known: Vocabulary) -> CrashRecord | str:
    """Return the record of a crash, or a sentence on why there is none.

    ``found`` is its place, if the narrative comes without one.
    """
    time = _TIME.fullmatch(narrative.time.strip())
    at = {name: int(value) for name, value in time.groupdict().items() if value is not None} if time else {}
    try:
        datetime.date(at["year"], at.get("month", 1), at.get("day", 1))
    except (KeyError, ValueError):
        return "no time: expected 2023, 2023-05-03 or 2023-05-03 16:20"
    moment = ReportedTime(**at)
    reading, units = _without_gaps(reading)
    crash = dict.fromkeys(known.mapping.columns(), "")
    if narrative.place is not None:
        columns = (known.mapping.crash.latitude_deg, known.mapping.crash.longitude_deg)
        crash.update(zip(map(str, columns), map(str, narrative.place), strict=True))
    rows = []
    for number in range(1, units + 1):
        facts = [each for each in reading.facts if each.unit in (CRASH, number)]
        values = {each.field: _cell(each, known) for each in facts if each.field in crash}
        rows.append({**crash, **values, TIME: moment})
    if not rows:
        return "it names no vehicle"
    reader = RowReader(known.mapping)
    key = reader.key_of(narrative.id)
    record = key and reader.record(key, rows, found)
    if not record:
        return next(iter(reader.left_out))
    record = replace(
        record,
        contradictions=tuple(f"the narrative: {each}" for each in reading.contradictions),
        ambiguities=tuple(f"not taken from the narrative: {each}" for each in reading.not_taken),
    )
    return _with_quotations(_with_events(record, reading.events, known), reading, known)


def _without_gaps(reading: Reading) -> tuple[Reading, int]:
    """Renumber the units that still have facts from 1; return the reading and their count."""
    found = {each.unit for each in reading.facts if each.unit != CRASH} | {each.unit for each in reading.events}
    found |= {each.other_unit for each in reading.events if each.other_unit is not None}
    number: dict[int | None, int | None] = {CRASH: CRASH, None: None}
    number |= {unit: place for place, unit in enumerate(sorted(found), 1)}
    facts = tuple(each.model_copy(update={"unit": number[each.unit]}) for each in reading.facts)
    events = tuple(
        each.model_copy(update={"unit": number[each.unit], "other_unit": number[each.other_unit]})
        for each in reading.events
    )
    return replace(reading, facts=facts, events=events), len(found)


def _cell(fact: Fact, known: Vocabulary) -> str:
    field = known.field(fact.unit, fact.field)
    return str(parse_measure(fact.value)) if field is not None and field.units else fact.value


def _with_events(record: CrashRecord, happened: tuple[NarrativeEvent, ...], known: Vocabulary) -> CrashRecord:
    """Return the record with the events of the narrative in place of the one implied by its units."""
    if not happened:
        return record
    moving = {vehicle.number for vehicle in record.vehicles if vehicle.in_transport}
    standing = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    parties = {vehicle.number: vehicle.number for vehicle in record.vehicles}
    parties |= {person.number: person.party for person in record.non_motorists}
    events = []
    for number, each in enumerate(happened, 1):
        code, sides = known.events[each.event], [(each.unit, each.area), (each.other_unit, each.other_area)]
        if sides[0][0] not in moving and sides[1][0] in moving:
            sides.reverse()  # the first party is a vehicle in transport
        (one, area_1), (other, area_2) = sides
        party_2 = parties.get(other or 0)
        if party_2 is None and thing_struck(code):
            party_2 = thing_party(number)
        if code == codes.MOTOR_VEHICLE_IN_TRANSPORT and other in standing:
            code = codes.PARKED_MOTOR_VEHICLE
        areas = [impact_area(known.areas[area]) if area else None for area in (area_1, area_2)]
        events.append(EventRecord(number, code, parties.get(one or 0), areas[0], party_2, areas[1]))
    first = next((event.code for event in events if event.is_harmful), record.first_harmful_event_code)
    implied = {*record.implied, "first_harmful_event_code"} - {"events"}
    return replace(record, events=tuple(events), first_harmful_event_code=first, implied=tuple(sorted(implied)))


def _with_quotations(record: CrashRecord, reading: Reading, known: Vocabulary) -> CrashRecord:
    parts: dict[int, tuple[str, Part]] = {CRASH: ("crash", record)}
    parts |= {vehicle.number: (party_in_words(vehicle.number), vehicle) for vehicle in record.vehicles}
    parts |= {person.number: (party_in_words(person.party), person) for person in record.non_motorists}
    quotations = []
    for fact in reading.facts:
        field = known.field(fact.unit, fact.field)
        if field is not None and fact.unit in parts:
            of, part = parts[fact.unit]
            names = (field.name, *_ELSEWHERE.get(field.name, ()))
            own = next((name for name in names if name in {each.name for each in fields(part)}), None)
            if own is not None:  # else it is of a vehicle what only people have, or the other way round
                quotations.append(Quotation(of, own, fact.words))
    quotations += [Quotation(f"event {n}", "code", each.words) for n, each in enumerate(reading.events, 1)]
    return replace(record, quotations=tuple(dict.fromkeys(quotations)))


_ELSEWHERE: Final = {
    "kind": ("in_transport", "person_type_code"),
    "place": ("latitude_deg",),
    "injury_code": ("occupants",),
    "age_years": ("occupants",),
}
"""Places in the record of fields without such a name: of a vehicle, a person or the crash."""


def merge_records(coded: CrashRecord, narrated: CrashRecord) -> CrashRecord:
    """Return a register's record, completed from its narrative.

    If both give a value, the register's is kept and the contradiction is named.
    """
    merger = _Merger(narrated)
    record = merger.taken(coded, narrated, "crash")
    by_number = {each.number: each for each in narrated.vehicles}
    persons = {each.number: each for each in narrated.non_motorists}
    vehicles = [
        merger.taken(each, by_number[each.number], party_in_words(each.number)) if each.number in by_number else each
        for each in coded.vehicles
    ]
    others = [
        merger.taken(each, persons[each.number], party_in_words(each.party)) if each.number in persons else each
        for each in coded.non_motorists
    ]
    listed, told = (len(each.vehicles) + len(each.non_motorists) for each in (coded, narrated))
    if listed != told:
        merger.contradictions.append(f"the register has {listed} units, the narrative {told}")
    elif not _has_events(coded) and _has_events(narrated):
        reported = origins(coded)["first_harmful_event_code"] is Origin.REPORTED
        first = coded.first_harmful_event_code if reported else narrated.first_harmful_event_code
        implied = {*record.implied, *(() if reported else ("first_harmful_event_code",))} - {"events"}
        record = replace(record, events=narrated.events, first_harmful_event_code=first, implied=tuple(sorted(implied)))
        merger.quotations += [each for each in narrated.quotations if each.of.startswith("event ")]
    return replace(
        record,
        vehicles=tuple(vehicles),
        non_motorists=tuple(others),
        contradictions=(*coded.contradictions, *narrated.contradictions, *merger.contradictions),
        ambiguities=(*coded.ambiguities, *narrated.ambiguities),
        quotations=tuple(merger.quotations),
    )


def _has_events(record: CrashRecord) -> bool:
    return bool(record.events) and "events" not in record.implied


class _Merger:
    """Completes one record from another, and keeps the quotations and the contradictions."""

    def __init__(self, narrated: CrashRecord) -> None:
        self._quoted = narrated.quotations
        self.quotations: list[Quotation] = []
        self.contradictions: list[str] = []

    def taken(self, coded: P, narrated: P, of: str) -> P:
        """Return a part with the fields that only the narrative has."""
        said, found = origins(coded), {}
        for quotation in self._quoted:
            name = quotation.field
            if quotation.of != of or name not in said:
                continue
            value = getattr(narrated, name)
            if said[name] is not Origin.REPORTED:
                found[name] = value
                if name == "body_type_code":
                    found |= {each: getattr(narrated, each) for each in _BODY}
            elif value != getattr(coded, name):
                stands = f"the register has {getattr(coded, name)}, the narrative {value} ({quotation.words!r})"
                self.contradictions.append(f"{of}: {name}: {stands}")
                continue
            self.quotations.append(quotation)
        implied = getattr(coded, "implied", ())
        if found and implied:
            found["implied"] = tuple(name for name in implied if name not in found)
        return replace(coded, **found)
