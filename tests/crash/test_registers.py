"""Tables of other registers than FARS, read by mappings: small ones of our own making, in each layout."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from trace_dag.common.errors import Rejection, UserError
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.completeness import RULES, check
from trace_dag.crash.keys import parse_key, register_key
from trace_dag.crash.parse import read_report, report_from_json, report_to_json
from trace_dag.crash.record import Heading, Moment, Octant, Origin, PreCrashMovement, Severity, origins
from trace_dag.crash.registers.mapping import list_shipped_mappings, read_mapping
from trace_dag.crash.registers.table import RegisterTable
from trace_dag.crash.reported_place import FromCrossing, Place

TEMPE = {
    "Incidentid": "1001", "DateTime": "3/4/15 17:05 ", "Year": "2015", "StreetName": "First St",
    "CrossStreet": "Oak Ave", "Distance": "-20.0", "JunctionRelation": "Intersection Non Interchange",
    "Totalinjuries": "1", "Totalfatalities": "0", "Injuryseverity": "Possible Injury", "Collisionmanner": "Left Turn",
    "Lightcondition": "Daylight", "Weather": "Clear", "SurfaceCondition": "Dry",
    "Unittype_One": "Driver", "Traveldirection_One": "East", "Unitaction_One": "Making Left Turn",
    "Unittype_Two": "Driver", "Traveldirection_Two": "West", "Unitaction_Two": "Going Straight Ahead",
    "Latitude": "33.4", "Longitude": "-111.9",
}  # fmt: skip
"""A crash in the layout of Tempe's table; it never happened."""
MONTGOMERY = {
    "Report Number": "XX100", "Crash Date/Time": "05/27/2021 07:40:00 PM", "Route Type": "County",
    "Road Name": "ELM ST", "Cross-Street Name": "OAK ST", "Municipality": "N/A", "Related Non-Motorist": "",
    "Collision Type": "SAME DIR REAR END", "Weather": "CLEAR", "Surface Condition": "DRY", "Light": "DAYLIGHT",
    "Traffic Control": "STOP SIGN", "Injury Severity": "SUSPECTED MINOR INJURY",
    "Vehicle First Impact Location": "TWELVE OCLOCK", "Vehicle Body Type": "PICKUP TRUCK",
    "Vehicle Movement": "MOVING CONSTANT SPEED", "Vehicle Going Dir": "North", "Speed Limit": "35",
    "Parked Vehicle": "No", "Vehicle Year": "2015", "Vehicle Make": "FORD", "Vehicle Model": "F150",
    "Latitude": "39.1", "Longitude": "-77.2", "Driver Home": "SOMEWHERE",
}  # fmt: skip
"""A driver in the layout of Montgomery County's table; it never happened."""


def table(folder: Path, register: str, *rows: dict[str, str]) -> RegisterTable:
    path = folder / f"{Path(register).stem}.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return RegisterTable.open(register, path)


def test_a_row_of_tempe_is_a_crash_with_headings(tmp_path):
    (record,) = table(tmp_path, "tempe", TEMPE).records()
    assert (record.key, record.register, record.year, record.hour, record.minute) == (
        "tempe-1001",
        "tempe",
        2015,
        17,
        5,
    )
    assert record.kind is CrashKind.TWO_VEHICLES
    assert (record.manner_of_collision_code, record.junction_relation_code) == (6, 2)  # angle, in an intersection
    turner, other = record.vehicles
    assert turner.movement is PreCrashMovement.TURNING_LEFT
    assert turner.heading == Heading(Octant.EAST, Moment.UNKNOWN)  # it turned: before or after is not said
    assert other.heading == Heading(Octant.WEST, Moment.BEFORE)
    assert record.severity is Severity.POSSIBLE
    assert record.fatalities == 0


def test_rows_of_montgomery_with_one_id_are_a_crash(tmp_path):
    stopped = {**MONTGOMERY, "Vehicle Movement": "STOPPED IN TRAFFIC LANE",
               "Vehicle First Impact Location": "SIX OCLOCK",
               "Injury Severity": "NO APPARENT INJURY", "Vehicle Body Type": "PASSENGER CAR"}  # fmt: skip
    (record,) = table(tmp_path, "montgomery", MONTGOMERY, stopped).records()
    record = complete_record(record)
    striking, struck = record.vehicles
    assert [vehicle.impact.code for vehicle in record.vehicles] == [12, 6]
    assert (striking.body_type_code, struck.body_type_code) == (39, 9)
    assert math.isclose(striking.speed_limit_mps, 35 * 0.44704)
    assert striking.traffic_control_code == 20
    assert [person.injury_code for person in striking.occupants] == [2]
    assert record.severity is Severity.MINOR
    assert record.city_name == ""  # N/A is a word for not known


def test_a_driver_alone_shows_that_another_is_missing(tmp_path):
    (record,) = table(tmp_path, "montgomery", MONTGOMERY).records()
    assert record.moving_vehicles == 2
    assert origins(record)["vehicles_in_transport"] is Origin.IMPLIED


@pytest.mark.parametrize(
    ("unit", "action", "kind", "code"),
    [
        ("Pedestrian", "Crossing Road", CrashKind.PEDESTRIAN, 8),
        ("Pedalcyclist", "Crossing Road", CrashKind.CYCLIST, 9),
        ("Driver", "Properly Parked", CrashKind.PARKED, 14),
    ],
)
def test_the_second_unit_decides_the_first_event(tmp_path, unit, action, kind, code):
    row = {**TEMPE, "Collisionmanner": "Other", "Unittype_Two": unit, "Unitaction_Two": action}
    (record,) = table(tmp_path, "tempe", row).records()
    assert record.kind is kind
    assert [event.code for event in record.events] == [code]
    assert origins(record)["first_harmful_event_code"] is Origin.IMPLIED
    assert origins(record)["light_code"] is Origin.REPORTED


def test_a_person_may_be_the_first_unit(tmp_path):
    manner = {"Collisionmanner": "ANGLE (Front To Side)(Other Than Left Turn)"}  # of the two units
    row = {**TEMPE, **manner, "Unittype_One": "Pedestrian", "Unitaction_One": "Crossing Road"}
    (record,) = table(tmp_path, "tempe", row).records()
    (event,) = record.events
    assert (event.party_1, event.party_2) == (2, 1001)  # the vehicle strikes the person
    assert record.moving_vehicles == 1
    assert record.non_motorists[0].heading == Heading(Octant.EAST)
    check(record, CrashSettings())  # where it went tells enough, though not where on the road it was


def test_values_that_are_not_mapped_are_counted_and_not_known(tmp_path):
    rows = [{**TEMPE, "Incidentid": str(number), "Weather": "Locusts"} for number in (1, 2)]
    read = table(tmp_path, "tempe", *rows)
    assert "not mapped, so not known: Weather as WEATHER: Locusts (2); first at id '1': Locusts" in read.notes()
    assert {record.weather_code for record in read.records()} == {None}


def test_columns_that_are_not_mapped_are_named_and_not_stored(tmp_path):
    read = table(tmp_path, "montgomery", MONTGOMERY)
    assert any(note.endswith("not stored: Driver Home") for note in read.notes())
    assert b"SOMEWHERE" not in report_to_json(next(read.records()))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"Latitude": ""}, "no latitude and longitude; first at id '7'"),
        ({"Latitude": "0", "Longitude": "0"}, "no latitude and longitude; first at id '7'"),
        (
            {"Latitude": "33 24:00.0"},
            "Latitude is no number of degrees, such as 41.5, but '33 24:00.0' or the like; first at id '7'",
        ),
        (
            {"DateTime": "yesterday"},
            "no year in the column of the time, as the mapping has its format; first at id '7': yesterday",
        ),
        ({"Incidentid": ""}, "no id, or one that is too long; first at a row without id"),
    ],
)
def test_rows_that_make_no_crash_are_counted(tmp_path, change, why):
    read = table(tmp_path, "tempe", {**TEMPE, "Incidentid": "7", **change}, {**TEMPE, "Incidentid": "2"})
    assert f"1 crash left out: {why}" in read.notes()
    assert [record.key for record in read.records()] == ["tempe-2"]


def test_rows_of_a_crash_that_lie_far_apart_are_one_crash(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE)
    row = {"id": "A", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36"}
    between = [{**row, "id": f"B{number}"} for number in range(30_000)]
    records = list(table(tmp_path, str(tmp_path / "mine.toml"), row, *between, {**row, "kmh": "72"}).records())
    assert [len(record.vehicles) for record in records] == [2, *[1] * 30_000]
    assert [vehicle.travel_speed_mps for vehicle in records[0].vehicles] == pytest.approx([10.0, 20.0])
    assert [record.key for record in records[1:]] == [f"mine-{each['id']}" for each in between]


def test_rows_without_number_of_one_crash_are_refused(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE)
    row = {"id": "A", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36"}
    with pytest.raises(UserError, match=r"mine\.csv: id 'A' has more than 1000 rows"):
        list(table(tmp_path, str(tmp_path / "mine.toml"), *[row] * 1_001).records())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ELM\x1b[31m ST", "a control character"),
        ("ELM\x00ST", "a control character"),
        ("ELM \u202eTS", "a control character"),
        ("E" * 1_000_000, "more than 2,000 characters"),
    ],
)
def test_a_value_that_is_no_text_is_refused_with_row_and_column(tmp_path, text, said):
    rows = [{**TEMPE, "Incidentid": str(number)} for number in range(3)]
    rows[1]["StreetName"] = text
    with pytest.raises(UserError, match=rf"tempe\.csv: row 3, column 'StreetName': {said}") as refused:
        table(tmp_path, "tempe", *rows).notes()
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 400


def test_ages_and_years_that_nobody_has_are_counted_and_not_known(tmp_path):
    mapping = 'AGE = { column = "age" }\nMOD_YEAR = "built"\n'
    (tmp_path / "mine.toml").write_text(MINE + mapping)
    row = {"id": "1", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36"}
    rows = [{**row, "age": age, "built": built} for age, built in (("44", "2019"), ("-5", "1066"), ("121", "20155"))]
    read = table(tmp_path, str(tmp_path / "mine.toml"), *rows, {**rows[0], "id": "2", "when": "1815-06-18 11:00"})
    (record,) = read.records()
    assert [[each.age_years for each in vehicle.occupants] for vehicle in record.vehicles] == [[44], [], []]
    assert [vehicle.model_year for vehicle in record.vehicles] == [2019, None, None]
    assert read.notes()[1:] == [
        "1 crash left out: a year that is not from 1900 to 2100; first at id '2': 1815",
        "not mapped, so not known: age as AGE: -5 (1), 121 (1); first at id '1': -5",
        "not mapped, so not known: built as MOD_YEAR: 1066 (1), 20155 (1); first at id '1': 1066",
    ]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("vehicles", 0, "occupants", 0, "age_years"), -5),
        (("vehicles", 0, "occupants", 0, "age_years"), 121),
        (("vehicles", 0, "model_year"), 1),
        (("year",), 9999),
        (("case_year",), 0),
        (("position_accuracy_m",), 1e6),
    ],
)
def test_a_document_with_what_nothing_can_have_is_malformed(tmp_path, place, value):
    (record,) = table(tmp_path, "montgomery", MONTGOMERY).records()
    part = document = json.loads(report_to_json(record))
    for step in place[:-1]:
        part = part[step]
    part[place[-1]] = value
    with pytest.raises(Rejection, match=rf"malformed_report.*{'.'.join(map(str, place))}"):
        report_from_json(json.dumps(document).encode(), name="a report")


def test_an_id_twice_is_an_error_where_a_row_is_a_crash(tmp_path):
    with pytest.raises(UserError, match="id '1001' stands in rows 2 and 3"):
        list(table(tmp_path, "tempe", TEMPE, TEMPE).records())


def test_a_column_that_is_not_there_is_an_error(tmp_path):
    row = {name: value for name, value in TEMPE.items() if name != "Weather"}
    with pytest.raises(UserError, match="no column 'Weather'"):
        table(tmp_path, "tempe", row).notes()


def test_a_reported_record_comes_back_from_its_document(tmp_path):
    for register, row in (("tempe", TEMPE), ("montgomery", MONTGOMERY)):
        (record,) = table(tmp_path, register, row).records()
        assert report_from_json(report_to_json(record), name="a report") == record


def test_the_document_of_another_crash_is_malformed(tmp_path):
    (record,) = table(tmp_path, "tempe", TEMPE).records()
    with pytest.raises(Rejection, match="expected crash tempe-7"):
        read_report(report_to_json(record), name="a report", settings=CrashSettings(), expected_key="tempe-7")
    with pytest.raises(Rejection, match="malformed_report"):
        report_from_json(b'{"key": 3}', name="a report")


MINE = """
register = "mine"
name = "Crashes"
source = "https://example.org"
licence = "CC0"
attribution = "Nobody"
rows = "unit"
point_accuracy_m = 10
[crash]
id = "id"
time = { column = "when", format = "%Y-%m-%d %H:%M" }
latitude_deg = "lat"
longitude_deg = "lon"
MAN_COLL = { column = "manner" }
[unit]
TRAV_SP = { column = "kmh", unit = "km/h" }
"""


def test_a_mapping_of_ones_own_reads_codes_and_units(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE)
    row = {"id": "A-1", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36"}
    (record,) = table(tmp_path, str(tmp_path / "mine.toml"), row, row).records()
    assert record.key == "mine-A-1"
    assert record.manner_of_collision_code == 2
    assert [vehicle.travel_speed_mps for vehicle in record.vehicles] == pytest.approx([10.0, 10.0])
    assert record.register_lacks == ("impact", "crash_type_code")


def test_a_register_that_names_a_state_is_of_the_united_states_and_no_other(tmp_path):
    row = {"id": "1", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36"}
    (location,) = [rule for rule in RULES if rule.name == "location"]
    found = []
    for name, state in (("anywhere.toml", ""), ("nebraska.toml", "state = 31\n")):
        (tmp_path / name).write_text(state + MINE)
        (record,) = table(tmp_path, str(tmp_path / name), row, row).records()
        found.append(location.shortcoming(record))
    assert found[0] is None
    assert "lies outside the United States" in found[1]


FROM_CROSSING = """
trafficway_1 = "street"
trafficway_2 = "cross"
[crash.from_crossing]
distance = { column = "feet", unit = "ft" }
direction = { column = "way", values = { N = "north", W = "west" } }
"""


def test_without_a_point_a_crash_is_looked_up_by_its_streets(tmp_path):
    points = 'latitude_deg = "lat"\nlongitude_deg = "lon"\n'
    text = MINE.replace(points, "").replace("[unit]", f"{FROM_CROSSING}[unit]")
    (tmp_path / "mine.toml").write_text(text)
    row = {"id": "1", "when": "2020-01-02 03:04", "manner": "2", "kmh": "36", "street": "Oak St", "cross": "Elm St"}
    rows = [
        row | {"feet": "", "way": ""},
        row | {"id": "2", "feet": "66", "way": "N"},
        row | {"id": "3", "feet": "66", "way": ""},
        row | {"id": "4", "feet": "0", "way": "W", "cross": ""},
        row | {"id": "5", "feet": "0", "way": "W", "cross": "Ash St"},
        row | {"id": "6", "feet": "far", "way": "W"},
    ]
    asked = []

    def find(wanted):
        asked.extend(wanted)
        return {FromCrossing("Oak St", "Elm St"): [Place(40.0, -100.0)],
                FromCrossing("Oak St", "Elm St", 66 * 0.3048, Octant.NORTH): [Place(40.1, -100.0)]}  # fmt: skip

    path = table(tmp_path, str(tmp_path / "mine.toml"), *rows)._path
    read = RegisterTable.open(str(tmp_path / "mine.toml"), path, find)
    records = list(read.records())
    assert [(each.key, each.latitude_deg, each.longitude_deg) for each in records] == [
        ("mine-1", 40.0, -100.0),
        ("mine-2", 40.1, -100.0),
    ]
    assert origins(records[0])["latitude_deg"] is Origin.IMPLIED
    assert FromCrossing("Oak St", "Ash St") in asked
    left_out = [note for note in read.notes() if "left out" in note]
    assert left_out == [
        "3 crashes left out: no latitude and longitude, and no two streets, or no direction of a distance; "
        "first at id '3'",
        "1 crash left out: no latitude and longitude, and its streets lead to nowhere on the maps given; "
        "first at id '5'",
    ]


def test_a_point_goes_before_the_streets(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE.replace("[unit]", f"{FROM_CROSSING}[unit]"))
    row = {"id": "1", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36",
           "street": "Oak St", "cross": "Elm St", "feet": "10", "way": "N"}  # fmt: skip
    (record,) = table(tmp_path, str(tmp_path / "mine.toml"), row).records()
    assert (record.latitude_deg, record.longitude_deg) == (52.0, 0.1)
    assert origins(record)["latitude_deg"] is Origin.REPORTED


def test_elements_without_a_table_of_codes_are_taken_as_they_stand(tmp_path):
    columns = 'DEATHS = { column = "killed" }\nREST_USE = { column = "belt" }\n'
    (tmp_path / "mine.toml").write_text(MINE + columns)
    row = {"id": "1", "when": "2020-01-02 03:04", "lat": "52.0", "lon": "0.1", "manner": "2", "kmh": "36",
           "killed": "1", "belt": "3"}  # fmt: skip
    (record,) = table(tmp_path, str(tmp_path / "mine.toml"), row).records()
    assert record.vehicles[0].occupants_killed == 1
    assert record.vehicles[0].occupants[0].restraint_code == 3


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('latitude_deg = "lat"', "", "latitude_deg and longitude_deg are named, or from_crossing"),
        (
            "MAN_COLL =",
            "from_crossing = { distance = { column = 'a', unit = 'ft' }, "
            "direction = { column = 'b', values = {} } }\nMAN_COLL =",
            "name both",
        ),
        ('"mine"', '"fars"', "fars is taken"),
        ('"mine"', '"My State"', "expected lower-case letters"),
        ('unit = "km/h"', 'unit = "knots"', "expected one of"),
        ("MAN_COLL =", "MAN_CALL =", "MAN_CALL is not an element of a record"),
        (
            '{ column = "manner" }',
            '{ column = "manner", values = { x = 3 } }',
            "MAN_COLL has no code 3; expected 0-2, 6-11, 98-99",
        ),
        ('rows = "unit"', 'rows = "crash"', "units are named where"),
        ("point_accuracy_m = 10", "", "point_accuracy_m: Field required"),
        ("point_accuracy_m = 10", "point_accuracy_m = 100000", "point_accuracy_m: Input should be less than"),
        ("point_accuracy_m = 10", "point_accuracy_m = 10\nexpression = 'a + b'", "Extra inputs are not permitted"),
        ("[crash]", "[crash", "cannot be read as TOML"),
    ],
)
def test_errors_of_a_mapping_are_named(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(MINE.replace(old, new, 1))
    with pytest.raises(UserError, match=said):
        read_mapping(str(path))


def test_a_mapping_that_is_not_there_names_those_that_are():
    with pytest.raises(UserError, match="montgomery, nyc, penndot, stats19, tempe"):
        read_mapping("atlantis")


def test_shipped_mappings_say_where_their_tables_are_from():
    shipped = list_shipped_mappings()
    assert shipped
    for name in shipped:
        mapping = read_mapping(name)
        assert mapping.register_name == name
        assert mapping.source.startswith("https://")
        assert mapping.licence
        assert mapping.attribution


def test_keys_of_registers_are_safe_and_sort_after_those_of_fars():
    assert register_key("tempe", "42") == "tempe-42"
    ids = {
        "a/b": "a_2Fb",
        "a.b": "a_2Eb",
        "a b": "a_20b",
        "é": "_C3_A9",
        "-a": "_2Da",
        "a_2Fb": "a_5F2Fb",
        "a_b": "a_b",
    }
    assert {crash_id: register_key("tempe", crash_id) for crash_id in ids} == {
        crash_id: f"tempe-{encoded}" for crash_id, encoded in ids.items()
    }
    for crash_id in ("", "x" * 151):
        with pytest.raises(ValueError, match="make no key"):
            register_key("tempe", crash_id)
    for key in ("tempe", "Tempe-1", "fars-1", "tempe-../x", "tempe-1\n", "2023-5101790"):
        with pytest.raises(UserError, match="is not a crash key"):
            parse_key(key)
    keys = ["tempe-10", "montgomery-A1", "2023-510179", "tempe-9", "2016-40002"]
    in_order = sorted(keys, key=lambda key: parse_key(key).order)
    assert in_order == ["2016-40002", "2023-510179", "montgomery-A1", "tempe-9", "tempe-10"]


def test_the_whole_of_the_real_tables_is_read(shared_data):
    folder = shared_data / "registers"
    tempe = RegisterTable.open("tempe", folder / "tempe-2012-2016.csv.gz")
    severities = [record.severity for record in tempe.records()]
    assert (len(severities), severities.count(Severity.KILLED)) == (21_912, 47)
    montgomery = RegisterTable.open("montgomery", folder / "montgomery-md.csv.gz")
    assert sum(len(record.vehicles) for record in montgomery.records()) == 1_348
