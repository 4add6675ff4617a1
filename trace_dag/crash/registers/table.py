"""A register's table, read by its mapping into crash records.

Only mapped columns are read. Values that the mapping does not know count as not reported, and are listed with their
numbers. Nothing is guessed: the parties of each event follow from the manner of collision and the units in the table.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Final

from trace_dag.common.dataclass_tools import replace
from trace_dag.common.errors import Rejection, UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.schemas import Column, ColumnType
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.bodies import BodyEvidence, body_of
from trace_dag.crash.codes.table import code_table, has_codes
from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.derive import impact_area
from trace_dag.crash.keys import register_key
from trace_dag.crash.listing import CrashListing, list_record
from trace_dag.crash.parse import report_to_json, reported_position
from trace_dag.crash.record import (
    FIRST_YEAR,
    LATEST_YEAR,
    CrashRecord,
    EventRecord,
    Heading,
    Moment,
    NonMotorist,
    Occupant,
    PreCrashMovement,
    VehicleRecord,
)
from trace_dag.crash.registers.mapping import (
    CRASH_FIELDS,
    ISO8601,
    NUMBERS,
    OCCUPANT_FIELDS,
    PARKED,
    PERSON_FIELDS,
    VEHICLE_FIELDS,
    CodedColumn,
    DirectionColumn,
    NumberColumn,
    RegisterMapping,
    parts_of,
    read_mapping,
)
from trace_dag.crash.registers.rows import KIND, TIME, RegisterRows, Row
from trace_dag.crash.reported_place import LEFT_HAND_STATES, FromCrossing, Place, PlaceFinder, keeps_left_at, look_up

_OF_TWO_VEHICLES: Final = frozenset({1, 2, 6, 7, 8, 9, 10})  # MAN_COLL
_STRUCK: Final = {5: codes.PEDESTRIAN, 6: codes.CYCLIST, 7: codes.CYCLIST}
_CROSSING: Final = 3  # NMACTION
_ON_ROADWAY: Final = 1  # REL_ROAD
_DRIVER: Final = 1  # PER_TYP
_SHOWN: Final = 12
_ID_SHOWN: Final = 40  # characters
_MOST_ROWS: Final = 1_000  # of one crash; the largest ever had some 200 vehicles


class RegisterTable:
    """The crashes of a register's table: a source of reports (:class:`trace_dag.flow.cohorts.sources.ReportTables`)."""

    def __init__(self, mapping: RegisterMapping, path: Path, find: PlaceFinder | None = None) -> None:
        self.mapping = mapping
        self._path, self._find = path, find
        self._rows = RegisterRows(mapping, path)
        self._reader: RowReader | None = None  # what has read the whole table

    @classmethod
    def open(cls, register: str, path: Path, find: PlaceFinder | None = None) -> RegisterTable:
        """Return a table, read by the mapping of that name or file.

        ``find`` looks up crossings of streets if the table has no points.

        Raises UserError for a mapping or table that cannot be read.
        """
        return cls(read_mapping(register), path, find)

    def notes(self) -> list[str]:
        """Return notes on the crashes and values that are read, and on those that are not."""
        reader = self._whole
        notes = [
            f"{self.mapping.attribution}, {self.mapping.name}: {count_of(reader.made, 'crash', 'crashes')} in "
            f"{count_of(len(self._rows), 'row')}; licence: {self.mapping.licence}"
        ]
        notes += [
            f"{count_of(count, 'crash', 'crashes')} left out: {why}; first at {reader.first[why]}"
            for why, count in reader.left_out.items()
        ]
        notes += [
            f"not mapped, so not known: {column}: {_listed(values)}; first at {reader.first[column]}"
            for column, values in sorted(reader.not_mapped.items())
        ]
        if ignored := [name for name in self._rows.columns if name not in self._rows.wanted]:
            notes.append(f"columns that are not mapped, and not stored: {', '.join(ignored)}")
        return notes

    def records(self, keys: Collection[str] | None = None) -> Iterator[CrashRecord]:
        """Yield every crash as read, or those of ``keys``, one at a time in the table's order."""
        reader = RowReader(self.mapping)
        for crash_id, group in self._rows.crashes():
            key = reader.key_of(crash_id)
            if key is None or (keys is not None and key not in keys):
                continue
            rows = list(islice(group, _MOST_ROWS + 1))
            if len(rows) > _MOST_ROWS:
                raise UserError(
                    f"{self._path}: id {crash_id!r} has more than {_MOST_ROWS} rows; expected one per vehicle or person"
                )
            place = None
            if reader.lacks_point(rows[0]):
                places, unknown = look_up({crash_id: reader.place_in_words(rows[0])}, self._found)
                for why in unknown.values():
                    reader.leave_out(why, crash_id)
                place = places.get(crash_id)
                if place is None:
                    continue
            if record := reader.record(key, rows, place):
                yield record
        if keys is None:
            self._reader = reader

    @property
    def _whole(self) -> RowReader:
        while self._reader is None:
            for _ in self.records():
                pass
        return self._reader

    @cached_property
    def _found(self) -> PlaceFinder | None:
        """Locate all places given in words together, since one pass over a map serves all."""
        if self._find is None:
            return None
        reader = RowReader(self.mapping)
        firsts = (next(rows) for _, rows in self._rows.crashes())
        wanted = {reader.place_in_words(row) for row in firsts if reader.lacks_point(row)}
        found = self._find({each for each in wanted if each is not None})
        return lambda wanted: {each: found.get(each, ()) for each in wanted}

    def listings(self) -> Iterator[CrashListing]:
        """Yield one line per crash; the records are kept on disk for later requests of their reports."""
        with self._rows.spool() as spool:
            for record in self.records():
                spool(record.key, report_to_json(record))
                yield list_record(record)

    def reports(self, keys: Collection[str]) -> Iterator[tuple[str, bytes]]:
        """Return the key and record, as JSON, of the crashes asked for."""
        if self._rows.spooled.is_file():
            return (each for each in self._rows.read_spooled() if each[0] in keys)
        return ((record.key, report_to_json(record)) for record in self.records(keys))

    def narratives(self) -> dict[str, str]:
        """Return the narratives by key, if the register has a column for them."""
        return self._whole.narratives


def _listed(values: Counter[str]) -> str:
    said = [f"{value or '(blank)'} ({count})" for value, count in values.most_common(_SHOWN)]
    return ", ".join(said) + (f" and {len(values) - _SHOWN} more values" if len(values) > _SHOWN else "")


def _row_named(crash_id: str, value: str) -> str:
    named = f"id {crash_id[:_ID_SHOWN]!r}" if crash_id else "a row without id"
    return f"{named}: {value}" if value else named


@dataclass
class RowReader:
    """Makes records of rows, and counts unmapped values and omitted crashes."""

    mapping: RegisterMapping
    made: int = 0
    narratives: dict[str, str] = field(default_factory=dict)
    not_mapped: dict[str, Counter[str]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)  # by reason or column: the id, and the value, of its first row
    _id: str = ""  # of the rows that are read

    def lacks_point(self, row: Row) -> bool:
        """Return whether a crash has to be looked up by its streets."""
        return self.mapping.crash.from_crossing is not None and self._point(row) is None

    def place_in_words(self, row: Row) -> FromCrossing | None:
        """Return the place of a crash by its streets, or None if the table lacks them."""
        crash = self.mapping.crash
        self._id = row[crash.id]
        assert crash.from_crossing is not None
        distance, direction = crash.from_crossing.distance, crash.from_crossing.direction
        distance_m = 0.0 if self._is_unknown(row[distance.column]) else self._measured(row, distance, "")
        if distance_m is None:
            return None
        octant = self._looked_up(direction.column, row[direction.column], direction)
        return FromCrossing.said(
            self._text(row, crash.trafficway_1), self._text(row, crash.trafficway_2), distance_m, octant
        )

    def _point(self, row: Row) -> Place | None:
        crash = self.mapping.crash
        if crash.latitude_deg is None or crash.longitude_deg is None:
            return None
        try:
            here = (_number(row[name].replace(",", ".")) for name in (crash.latitude_deg, crash.longitude_deg))
            return Place(*reported_position(*here))
        except Rejection:
            return None

    def _why_no_point(self, row: Row) -> str:
        names = (self.mapping.crash.latitude_deg, self.mapping.crash.longitude_deg)
        for name in names:
            if name and not self._is_unknown(row[name]) and _number(row[name].replace(",", ".")) is None:
                return f"{name} is no number of degrees, such as 41.5, but {row[name]!r} or the like"
        return "no latitude and longitude"

    def _count_unread_times(self, row: Row) -> None:
        """Count texts of a time that do not fit their format."""
        for column, form in zip(self.mapping.crash.time.column, self.mapping.crash.time.format, strict=True):
            if not self._is_unknown(row[column]) and getattr(row[TIME], parts_of(form)[0]) is None:
                needs_zone = form == ISO8601 and self.mapping.crash.time.zone is None and ":" in row[column]
                hint = " (with an offset: name a zone)" if needs_zone else ""
                self._count(f"{column} as {form}{hint}", row[column])

    def key_of(self, crash_id: str) -> str | None:
        """Return the key of a crash; for an unusable id, count it and return None."""
        try:
            return register_key(self.mapping.register_name, crash_id)
        except ValueError:
            self.leave_out("no id, or one that is too long", crash_id)
            return None

    def leave_out(self, why: str, crash_id: str, value: object = "") -> None:
        """Count a crash that is left out, and keep the id and value of the first for each reason."""
        self.left_out[why] += 1
        self.first.setdefault(why, _row_named(crash_id, str(value)))

    def record(self, key: str, rows: Sequence[Row], found: Place | None = None) -> CrashRecord | None:
        """Return the record of one crash, or None if it is left out.

        ``found`` is its place if the table has no point.
        """
        mapping, row = self.mapping, rows[0]
        moment = row[TIME]
        self._id = row[mapping.crash.id]
        place = found or self._point(row)
        if place is None:
            self.leave_out(self._why_no_point(row), self._id)
            return None
        self._count_unread_times(row)
        if moment.year is None:
            texts = " ".join(row[column] for column in mapping.crash.time.column)
            self.leave_out("no year in the column of the time, as the mapping has its format", self._id, texts)
            return None
        if not FIRST_YEAR <= moment.year <= LATEST_YEAR:
            self.leave_out(f"a year that is not from {FIRST_YEAR} to {LATEST_YEAR}", self._id, moment.year)
            return None
        coded = {name: self._code(row, name, column) for name, column in mapping.crash.coded.items()}
        vehicles, persons = self._units(rows, keeps_left=self._keeps_left(place))
        if isinstance(further := coded.pop("PER_TYP", None), int):
            persons.append(NonMotorist(len(persons) + 1, further))
        record = CrashRecord(
            key=key,
            case_year=moment.year,
            state_case=None,
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            vehicles=tuple(vehicles),
            events=(),
            register=mapping.register_name,
            register_lacks=mapping.lacks,
            position_accuracy_m=mapping.point_accuracy_m,
            attribution=mapping.credit,
            state_code=mapping.state,
            state_name=codes.STATES.get(mapping.state or 0, ""),
            county_name=self._text(row, mapping.crash.county_name),
            city_name=self._text(row, mapping.crash.city_name),
            **moment._asdict(),
            trafficway_1=self._text(row, mapping.crash.trafficway_1),
            trafficway_2=self._text(row, mapping.crash.trafficway_2),
            non_motorists=tuple(persons),
            implied=() if found is None else ("latitude_deg", "longitude_deg"),
            **_fields(CRASH_FIELDS, coded),
        )
        self.made += 1
        if narrative := self._text(row, mapping.crash.narrative):
            self.narratives[key] = narrative
        return _with_first_event(record)

    def _keeps_left(self, place: Place) -> bool:
        """Return whether traffic keeps left, by the mapping, or else by the state or country of the place."""
        if self.mapping.traffic is not None:
            return self.mapping.traffic == "left"
        return self.mapping.state in LEFT_HAND_STATES if self.mapping.state is not None else keeps_left_at(*place)

    def _units(self, rows: Sequence[Row], *, keeps_left: bool) -> tuple[list[VehicleRecord], list[NonMotorist]]:
        vehicles: list[VehicleRecord] = []
        persons: list[NonMotorist] = []
        units = (
            [(row, "") for row in rows] if self.mapping.rows == "unit" else [(rows[0], u) for u in self.mapping.units]
        )
        for number, (row, unit) in enumerate(units, 1):
            kind = self._kind(row, unit)
            if kind in ("vehicle", PARKED):
                vehicles.append(self._vehicle(row, unit, number, parked=kind == PARKED, keeps_left=keeps_left))
            elif isinstance(kind, int):
                persons.append(self._person(row, unit, number, kind))
        return vehicles, persons

    def _kind(self, row: Row, unit: str) -> int | str:
        """Return ``vehicle``, ``parked``, ``none`` or a ``PER_TYP``; a blank beside other units means none."""
        column = self.mapping.unit.kind
        of_file: int | str | None = row.get(KIND)
        if of_file is not None:
            return of_file
        if column is None:
            return "vehicle"
        name = self.mapping.column_of(column.column, unit)
        if unit and not row[name]:
            return "none"
        kind = self._looked_up(name, row[name], column)
        return "vehicle" if kind is None else kind

    def _vehicle(self, row: Row, unit: str, number: int, *, parked: bool, keeps_left: bool) -> VehicleRecord:
        columns = self.mapping.unit
        coded = self._codes_of_unit(row, unit, {*VEHICLE_FIELDS, *OCCUPANT_FIELDS})
        movement = coded.pop("P_CRASH1", None)
        moves = not parked and movement != PARKED
        initial, body_type = coded.get("IMPACT1"), coded.get("BODY_TYP")
        body, body_implied = body_of(BodyEvidence(body_type=body_type))
        named = (self._text(row, columns.make, unit), self._text(row, columns.model, unit))
        driver = {name: code for name, code in coded.items() if name in OCCUPANT_FIELDS and moves}
        vehicle = VehicleRecord(
            number=number,
            **body.as_fields(),
            make_model=" ".join(filter(None, named)),
            model_year=self._year(row, unit),
            in_transport=moves,
            keeps_left=keeps_left,
            travel_speed_mps=self._measured(row, columns.TRAV_SP, unit) if moves else 0.0,
            speed_limit_mps=self._measured(row, columns.VSPD_LIM, unit) or None,  # 0 stands for none
            movement=PreCrashMovement(movement) if isinstance(movement, int) else PreCrashMovement.UNKNOWN,
            impact=None if moves else impact_area(initial),
            occupants=(Occupant(1, _DRIVER, **{OCCUPANT_FIELDS[name]: code for name, code in driver.items()}),)
            if any(code is not None for code in driver.values())
            else (),
            implied=(*(("vehicle_class",) if body_implied else ()), *(() if moves else ("travel_speed_mps",))),
            **_fields(VEHICLE_FIELDS, coded),
        )
        heading = self._heading(row, unit, turns=turn_of(vehicle) is not None) if moves else None
        return vehicle if heading is None else replace(vehicle, heading=heading)

    def _person(self, row: Row, unit: str, number: int, person_type: int) -> NonMotorist:
        coded = self._codes_of_unit(row, unit, PERSON_FIELDS)
        heading = self._heading(row, unit, turns=False)
        return NonMotorist(number, person_type, heading=heading, **_fields(PERSON_FIELDS, coded))

    def _codes_of_unit(self, row: Row, unit: str, wanted: Collection[str]) -> dict[str, Any]:
        return {
            name: self._code(row, name, column, unit)
            for name, column in self.mapping.unit.coded.items()
            if name in wanted
        }

    def _heading(self, row: Row, unit: str, *, turns: bool) -> Heading | None:
        column = self.mapping.unit.heading
        if column is None:
            return None
        name = self.mapping.column_of(column.column, unit)
        octant = self._looked_up(name, row[name], column)
        return None if octant is None else Heading(octant, column.turning if turns else Moment.BEFORE)

    def _code(self, row: Row, element: str, column: CodedColumn, unit: str = "") -> Any:
        """Return a code, None if unknown; a number is a code itself if the mapping lists no values."""
        name = self.mapping.column_of(column.column, unit)
        value, label = row[name], f"{name} as {element}"
        if column.values or column.other is not None:
            found = self._looked_up(label, value, column)
        elif self._is_unknown(value):
            found = None
        else:
            found = self._whole(label, value, NUMBERS.get(element))
            if found is not None and element in _CODED and found not in code_table(element).meanings:
                found = self._count(label, value)
        return code_table(element).known(found) if isinstance(found, int) and element in _CODED else found

    def _measured(self, row: Row, column: NumberColumn | None, unit: str) -> float | None:
        if column is None:
            return None
        name = self.mapping.column_of(column.column, unit)
        if self._is_unknown(row[name]):
            return None
        number = _number(row[name].replace(",", ".") if self.mapping.decimal == "," else row[name])
        return self._count(name, row[name]) if number is None or number < 0 else number * column.factor

    def _year(self, row: Row, unit: str) -> int | None:
        text = self._text(row, column := self.mapping.unit.MOD_YEAR, unit)
        return self._whole(f"{column} as MOD_YEAR", text, range(FIRST_YEAR, LATEST_YEAR + 1)) if text else None

    def _text(self, row: Row, column: str | None, unit: str = "") -> str:
        value = "" if column is None else str(row[self.mapping.column_of(column, unit)])
        return "" if self._is_unknown(value) else value

    def _is_unknown(self, value: str) -> bool:
        return not value or value.casefold() in self._unknown

    @cached_property
    def _unknown(self) -> frozenset[str]:
        return frozenset(word.casefold() for word in self.mapping.unknown)

    def _looked_up(self, name: str, value: str, column: CodedColumn | DirectionColumn) -> Any:
        if self._is_unknown(value):
            return None
        values: Mapping[str, Any] = column.values
        found = values.get(value)
        if found is None:
            found = next((code for known, code in values.items() if known.casefold() == value.casefold()), column.other)
        if found == "unknown":
            return None
        return self._count(name, value) if found is None else found

    def _whole(self, name: str, value: str, within: range | None = None) -> int | None:
        number = _number(value)
        if number is None or number != int(number) or (within is not None and int(number) not in within):
            self._count(name, value)
            return None
        return int(number)

    def _count(self, name: str, value: str) -> Any:
        """Count a value that the mapping does not know; return None in its place."""
        self.not_mapped.setdefault(name, Counter())[value] += 1
        self.first.setdefault(name, _row_named(self._id, value))
        return None


_CODED: Final = (
    frozenset(filter(has_codes, (*CRASH_FIELDS, *VEHICLE_FIELDS, *PERSON_FIELDS, "PER_TYP"))) - NUMBERS.keys()
)


def _fields(columns: Mapping[str, Column], coded: Mapping[str, Any]) -> dict[str, Any]:
    """Return codes by element as fields of a record; of several elements of one field, the first known one counts."""
    found: dict[str, Any] = {}
    for element, code in coded.items():
        if code is None or element not in columns:
            continue
        column = columns[element]
        value = bool(code) if column.type is ColumnType.BOOLEAN else code
        found.setdefault(column.name, (value,) if column.repeated else value)
    return found


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if abs(number) < 1e9 else None


# --- what the units and the manner of collision say of the first harmful event ---------------------------------------
def _with_first_event(record: CrashRecord) -> CrashRecord:
    """Return the record with the event it implies, if the first harmful event is not reported."""
    moving = [vehicle.number for vehicle in record.vehicles if vehicle.in_transport]
    standing = [vehicle.number for vehicle in record.vehicles if not vehicle.in_transport]
    of_two = record.manner_of_collision_code in _OF_TWO_VEHICLES
    if of_two and len(moving) + len(standing) == 1 and not record.non_motorists:  # the table has not all of them
        record = replace(
            record, vehicles_in_transport=len(moving) + 1, implied=(*record.implied, "vehicles_in_transport")
        )
    code, second = record.first_harmful_event_code, None
    if record.non_motorists:
        code = code or _STRUCK.get(record.non_motorists[0].person_type_code)
        second = record.non_motorists[0].party if len(record.non_motorists) == 1 else None
    elif len(moving) > 1 or (of_two and not standing):
        code = code or codes.MOTOR_VEHICLE_IN_TRANSPORT
        second = moving[1] if len(moving) == 2 else None
    elif moving and standing:
        code = code or codes.PARKED_MOTOR_VEHICLE
        second = standing[0] if len(standing) == 1 else None
    if code is None:
        return record
    first = moving[0] if moving and (len(moving) == 1 or second in moving) else None
    event = EventRecord(1, code, first, None, second, None, ("code", "party_1", "party_2"))
    implied = [*record.implied, "events"]
    if record.first_harmful_event_code is None:
        implied.append("first_harmful_event_code")
    crosses = any(_CROSSING in person.actions for person in record.non_motorists)
    if crosses and record.road_relation_code is None:
        record = replace(record, road_relation_code=_ON_ROADWAY)
        implied.append("road_relation_code")
    return replace(record, events=(event,), first_harmful_event_code=code, implied=tuple(implied))
