"""A crash report to a :class:`CrashRecord`, whatever its source serves: CrashAPI's XML, a table's rows, a record.

Every code is checked against the codes of its year. Missing values are filled from what other fields imply, and
marked. Fields that disagree are listed. The completeness of the record is decided in
:mod:`trace_dag.crash.completeness`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

from lxml import etree
from pydantic import ValidationError

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.table import FIRST_YEAR, UnknownCodeError
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.event_parties import add_event_parties
from trace_dag.crash.fars.rows import FarsRows, tables_of
from trace_dag.crash.fields import Fields, malformed
from trace_dag.crash.keys import crash_key, state_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.persons import read_non_motorists
from trace_dag.crash.record import LATEST_YEAR, CrashRecord, EventRecord, VehicleRecord
from trace_dag.crash.reported_place import LEFT_HAND_STATES
from trace_dag.crash.sequence import has_struck_standing_only, known_by_events_alone, read_sequence
from trace_dag.crash.vehicles import read_parked_vehicle, read_vehicle
from trace_dag.crash.xml_input import local_name, parse_untrusted, values_of

_MIDNIGHT_AS_24: Final = 24
_NOT_REPORTED_DEG: Final = ((77, 777), (88, 888), (99, 999))
"""Whole degrees of latitude and longitude that say: not reported, not available, unknown."""
_COUNTY_CODE: Final = re.compile(r"\s*\([0-9]+\)$")
_NO_NAME: Final = frozenset({"NOT APPLICABLE", "NOT REPORTED", "UNKNOWN", "OTHER"})


def read_report(data: bytes, *, name: str, settings: CrashSettings, expected_key: str | None = None) -> CrashRecord:
    """Return the record of the crash in a report.

    Args: data: the report as its source serves it: a CrashAPI ``GetCaseDetails`` response (XML), the rows of FARS
    tables (:class:`~trace_dag.crash.fars.rows.FarsRows`) or a record of a register's table
    (:mod:`trace_dag.crash.parse`), both as JSON. name: a file name or URL for messages. settings:
    ``repair_malformed`` allows badly escaped characters to be repaired; the record is then marked. expected_key: the
    key of the requested crash, if any; the report of another crash is malformed.

    Raises: Rejection: ``not_released`` for a response without a case, ``malformed_report`` for anything that cannot be
    read or holds a code its element does not have in that year, ``incomplete_location`` where no position is reported,
    since a record without a place cannot exist.

    >>> read_report(report_xml, name="crash_319003.xml", settings=CrashSettings()).key
    '2023-319003'
    """
    report, repaired = open_report(data, name=name, repair=settings.repair_malformed)
    if isinstance(report, CrashRecord):
        record = report
    else:
        try:
            record = replace(_read_crash(report.fields(name)), repaired=repaired)
        except UnknownCodeError as error:
            raise malformed(
                f"{name}: {error}; correct the code, or read it with a newer version of the code tables"
            ) from error
    if expected_key is not None and record.key != expected_key:
        raise malformed(f"{name} is the report of crash {record.key}; expected crash {expected_key}")
    return complete_record(record)


def open_report(data: bytes, *, name: str, repair: bool = False) -> tuple[CrashRecord | FarsRows, bool]:
    """Return a report's record or its FARS rows, and whether its text had to be repaired.

    Raises :class:`~trace_dag.common.errors.Rejection` as :func:`read_report`.

    >>> open_report(report_xml, name="crash_319003.xml")[0].tables["accident"][0]["STATENAME"]
    'Nebraska'
    """
    if is_json(data):
        return report_from_json(data, name=name), False
    root, repaired = parse_untrusted(data, name=name, repair=repair)
    tables = tables_of(crash_element(root, name=name), name=name)
    year, state_case, _ = case_of(Fields(tables["accident"][0], name))
    return FarsRows(year, state_case, tables), repaired


def crash_element(root: etree._Element, *, name: str) -> etree._Element:
    """Return the one ``CrashResultSet`` of a response.

    Raises ``not_released`` if there is none, ``malformed_report`` if it is no response or has several.

    >>> crash_element(etree.fromstring(report_xml), name="crash_319003.xml").findtext("STATENAME")
    'Nebraska'
    """
    found = list(root.iter("{*}CrashResultSet"))
    if len(found) == 1:
        return found[0]
    if found:
        raise malformed(f"{name} holds {len(found)} crashes; expected one CrashResultSet per file")
    head = Fields(values_of(root), name)
    if local_name(root).startswith("ResponseOf") and head.integer("COUNT") == 0:
        message = head.text("MESSAGE") or "no message"
        raise Rejection(
            Reason.NOT_RELEASED, f"{name} holds no case (Count 0, {message!r}): the case is not released, or not there"
        )
    raise malformed(
        f"{name} is not a crash report: its root element is <{local_name(root)}> and it holds no CrashResultSet; "
        "expected a CrashAPI GetCaseDetails response"
    )


def _not_struck(people_outside: int | None, events: Iterable[EventRecord]) -> Iterator[str]:
    """Yield a sentence if people outside vehicles are struck in no event and are not simulated."""
    strikes = [event for event in events if event.kind is EventKind.PERSON_STRUCK]
    bodies = len({each.party_2 for each in strikes if each.party_2 is not None} or strikes)
    if people_outside is not None and 0 < bodies < people_outside:
        left_out = f"{people_outside - bodies} of {people_outside}"
        yield f"not simulated: {left_out} people outside vehicles, whom no event strikes"


def _read_crash(fields: Fields) -> CrashRecord:
    case_year, state_case, key = case_of(fields)
    fields.year = case_year
    latitude_deg, longitude_deg = reported_position(fields.decimal("LATITUDE"), fields.decimal("LONGITUD", "LONGITUDE"))

    vehicles = _vehicles(fields)
    sequence = read_sequence(fields, vehicles)
    persons = read_non_motorists(fields, vehicles)
    struck = add_event_parties(sequence.events, persons.non_motorists, order_known=sequence.order_known)
    function_class, land_use, class_implied = _function_class(fields)
    return CrashRecord(
        key=key,
        case_year=case_year,
        state_case=state_case,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        vehicles=vehicles,
        events=struck.events,
        state_code=state_of(state_case),
        state_name=codes.STATES.get(state_of(state_case), ""),
        county_name=_place_name(fields.text("COUNTYNAME")),
        city_name=_place_name(fields.text("CITYNAME")),
        year=fields.integer("YEAR", "CASEYEAR"),
        month=fields.within(1, 12, "MONTH"),
        day=fields.within(1, 31, "DAY"),
        hour=0 if fields.integer("HOUR") == _MIDNIGHT_AS_24 else fields.within(0, 23, "HOUR"),
        minute=fields.within(0, 59, "MINUTE"),
        trafficway_1=fields.text("TWAY_ID"),
        trafficway_2=fields.text("TWAY_ID2"),
        route_code=fields.known_code("ROUTE"),
        function_class_code=function_class,
        rural_urban_code=land_use,
        manner_of_collision_code=fields.code("MAN_COLL"),
        first_harmful_event_code=fields.known_code("HARM_EV"),
        intersection_type_code=fields.code("TYP_INT"),
        junction_relation_code=fields.known_code("RELJCT2"),
        road_relation_code=fields.known_code("REL_ROAD"),
        light_code=fields.known_code("LGT_COND"),
        weather_code=_weather(fields),
        fatalities=fields.integer("FATALS", low=0),
        vehicles_in_transport=fields.integer("VE_FORMS", low=0),
        people_outside=fields.integer("PEDS", low=0),
        non_motorists=persons.non_motorists,
        ambiguities=(*struck.ambiguities, *persons.ambiguities, *_not_struck(fields.integer("PEDS"), struck.events)),
        implied=(
            *sequence.implied,
            *struck.implied,
            *(("function_class_code",) if class_implied else ()),
        ),
        contradictions=(*sequence.contradictions, *persons.contradictions, *struck.contradictions),
    )


def case_of(crash: Fields) -> tuple[int, int, str]:
    """Return the case year, state case and key of a crash.

    Raises ``malformed_report`` if they cannot be read.

    >>> case_of(Fields({"CASEYEAR": "2023", "ST_CASE": "319003"}, "crash_319003.xml"))
    (2023, 319003, '2023-319003')
    """
    case_year = crash.integer("CASEYEAR", "YEAR", low=FIRST_YEAR, high=LATEST_YEAR)
    state_case = crash.integer("ST_CASE")
    if case_year is None or state_case is None:
        raise malformed(
            f"{crash.where}: {'CaseYear' if case_year is None else 'ST_CASE'} is missing; expected a number"
        )
    try:
        key = crash_key(case_year, state_case)
    except ValueError as error:
        raise malformed(f"{crash.where}: {error}") from error
    state = crash.integer("STATE")
    if state is not None and state != state_of(state_case):
        raise malformed(
            f"{crash.where}: State {state} does not agree with ST_CASE {state_case} (state {state_of(state_case)})"
        )
    return case_year, state_case, key


def reported_position(latitude: float | None, longitude: float | None) -> tuple[float, float]:
    """Return the reported latitude and longitude in degrees.

    Raises :class:`Rejection` for missing values and those that mean "unknown".

    >>> reported_position(38.5, -77.4)
    (38.5, -77.4)
    """
    if latitude is None or longitude is None:
        raise Rejection(Reason.INCOMPLETE_LOCATION, "the report gives no latitude and longitude")
    sentinel = any(int(latitude) == lat and int(abs(longitude)) == lon for lat, lon in _NOT_REPORTED_DEG)
    if sentinel or (latitude, longitude) == (0, 0):
        raise Rejection(
            Reason.INCOMPLETE_LOCATION,
            f"the report's position ({latitude:g}, {longitude:g}) stands for an unknown one",
        )
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise Rejection(
            Reason.INCOMPLETE_LOCATION,
            f"the report's position ({latitude:g}, {longitude:g}) is not a place on Earth; expected degrees, longitude "
            "negative west of Greenwich",
        )
    return latitude, longitude


def _vehicles(fields: Fields) -> tuple[VehicleRecord, ...]:
    reported: list[VehicleRecord] = []
    unreported: list[Fields] = []
    for row in fields.rows("vehicle"):
        if known_by_events_alone(row):
            unreported.append(row)
        else:
            reported.append(read_vehicle(row))
    reported += map(read_parked_vehicle, fields.rows("parkwork"))
    vehicles = [*reported, *_unreported_vehicles(unreported, reported, fields)]
    vehicles += _counted_as_parked(vehicles, fields)
    numbers = [vehicle.number for vehicle in vehicles]
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    if twice:
        raise malformed(f"{fields.where}: vehicle number {twice[0]} is given {numbers.count(twice[0])} times")
    if fields.integer("STATE") in LEFT_HAND_STATES:
        vehicles = [replace(vehicle, keeps_left=True) for vehicle in vehicles]
    return tuple(sorted(vehicles, key=lambda vehicle: vehicle.number))


def _unreported_vehicles(
    rows: Iterable[Fields], reported: Sequence[VehicleRecord], crash: Fields
) -> Iterator[VehicleRecord]:
    """Yield the vehicles that only other tables name, up to the number that the crash counts.

    If the crash counts more vehicles (``VE_TOTAL``) than vehicles in transport (``VE_FORMS``), such a vehicle was
    parked if its events are those of a standing one. A vehicle beyond these counts is left out; its events are a
    contradiction.
    """
    in_transport, total = crash.integer("VE_FORMS"), crash.integer("VE_TOTAL")
    moving = sum(vehicle.in_transport for vehicle in reported)
    standing = len(reported) - moving
    for row in rows:
        parked = has_struck_standing_only(row)
        if parked and (in_transport is None or total is None or standing < total - in_transport):
            standing += 1
            yield read_parked_vehicle(row)
        elif in_transport is None or moving < in_transport:
            moving += 1
            yield read_vehicle(row)


def _counted_as_parked(listed: Sequence[VehicleRecord], crash: Fields) -> Iterator[VehicleRecord]:
    """Yield the standing vehicle that the only moving vehicle struck first, if no table lists it.

    The crash counts one vehicle more (``VE_TOTAL``) than it has in transport (``VE_FORMS``).
    """
    counted = crash.integer("VE_FORMS") == 1 and crash.integer("VE_TOTAL") == 2 and len(listed) == 1
    if counted and crash.known_code("HARM_EV") in codes.STRUCK_STANDING:
        row = {"VEH_NO": str(next(n for n in (1, 2) if n != listed[0].number))}
        yield read_parked_vehicle(Fields(row, crash.where, crash.year))


def _function_class(fields: Fields) -> tuple[int | None, int | None, bool]:
    """Return ``FUNC_SYS`` and ``RUR_URB``, from ``ROAD_FNC`` in a report of an older year."""
    function_class, land_use = fields.known_code("FUNC_SYS"), fields.known_code("RUR_URB")
    older = fields.known_code("ROAD_FNC")
    if older is None or (function_class is not None and land_use is not None):
        return function_class, land_use, False
    rural, urban = 1, 2
    return (
        codes.FUNC_SYS_OF_ROAD_FNC.get(older) if function_class is None else function_class,
        (rural if older < 10 else urban) if land_use is None else land_use,
        True,
    )


def _weather(fields: Fields) -> int | None:
    """Return the first known weather code: the crash's own, else one of the list."""
    listed = (row.known_code("WEATHER") for row in fields.rows("weather"))
    own = (fields.known_code("WEATHER", name) for name in ("WEATHER", "WEATHER1", "WEATHER2"))
    return next((code for code in (*own, *listed) if code), None)


def _place_name(label: str) -> str:
    name = _COUNTY_CODE.sub("", label)
    return "" if name.upper() in _NO_NAME else name


# --- reports from tables, as JSON ------------------------------------------------------------------------------------
def is_json(data: bytes) -> bool:
    """Return whether a report is such a JSON document rather than XML.

    >>> is_json(report_xml), is_json(b'{"key": "tempe-1"}')
    (False, True)
    """
    return data.lstrip()[:1] == b"{"


def report_to_json(report: FarsRows | CrashRecord) -> bytes:
    """Return the document of a table's report."""
    kind: type[FarsRows | CrashRecord] = type(report)
    return json_adapter(kind).dump_json(report, exclude_defaults=True, indent=1) + b"\n"


def report_from_json(data: bytes, *, name: str) -> FarsRows | CrashRecord:
    """Return the rows or the record in a document.

    Raises :class:`trace_dag.common.errors.Rejection` (``malformed_report``) for any other document.

    >>> report_from_json(report_to_json(record), name="a report").key
    '2023-319003'
    """
    try:
        kind: type[FarsRows | CrashRecord] = FarsRows if "tables" in json.loads(data) else CrashRecord
        found = json_adapter(kind).validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise malformed(f"{name}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except (ValueError, RecursionError) as error:
        raise malformed(f"{name} is not JSON: {error}") from error
    return found
