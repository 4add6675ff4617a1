"""Events put together from the vehicles' own sequences, blank codes, parked vehicles, and events of nobody."""

from __future__ import annotations

import csv
import io
import zipfile
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from crash_reports import own_events, parties, report

from trace_dag.common.settings import CrashSettings
from trace_dag.crash.derive import impact_area
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.meetings import VehicleEvent, merge_sequences
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord, VehicleClass, VehicleRecord


def read(crash: dict[str, object], *vehicles: dict[str, object], settings: CrashSettings) -> CrashRecord:
    numbered = [{"VEH_NO": number, **vehicle} for number, vehicle in enumerate(vehicles, start=1)]
    counts = {"VE_FORMS": len(vehicles), "VE_TOTAL": len(vehicles)}
    return read_report(report(counts | crash, numbered, events=[]), name="report.xml", settings=settings)


# --- who met whom --------------------------------------------------------------------------------------------------


def test_the_vehicle_with_two_contacts_is_in_the_middle(settings: CrashSettings) -> None:
    """3 ran into 2, which was pushed into 1: crash types and a front-to-rear first contact say who was first."""
    record = read(
        {"MAN_COLL": 1},
        {"ACC_TYPE": 98, "Vsoes": own_events((12, 6))},
        {"ACC_TYPE": 21, "IMPACT1": 6, "Vsoes": own_events((12, 6), (12, 12))},
        {"ACC_TYPE": 20, "Vsoes": own_events((12, 12))},
        settings=settings,
    )
    assert parties(record) == [(12, 2, 3), (12, 1, 2)]
    assert record.implied == ("events",)


def test_in_a_queue_each_ran_into_its_neighbour(settings: CrashSettings) -> None:
    """Front to rear throughout: who was behind whom could be any order, and it is that of the numbers."""
    middle = {"ACC_TYPE": 98, "Vsoes": own_events((12, 6), (12, 12))}
    record = read(
        {"MAN_COLL": 1, "VE_FORMS": 5, "VE_TOTAL": 5},
        {"ACC_TYPE": 24, "Vsoes": own_events((12, 12))},
        {"ACC_TYPE": 25, "Vsoes": own_events((12, 6), (12, 12))},
        middle,
        middle,
        {"ACC_TYPE": 98, "Vsoes": own_events((12, 6))},
        settings=settings,
    )
    assert parties(record) == [(12, 1, 2), (12, 2, 3), (12, 3, 4), (12, 4, 5)]


def test_the_manner_gives_the_first_contact_where_crash_types_do_not(settings: CrashSettings) -> None:
    record = read(
        {"MAN_COLL": 1},
        {"ACC_TYPE": 98, "Vsoes": own_events((12, 6))},
        {"ACC_TYPE": 98, "Vsoes": own_events((12, 6), (12, 12))},
        {"ACC_TYPE": 98, "Vsoes": own_events((12, 12))},
        settings=settings,
    )
    assert parties(record) == [(12, 2, 3), (12, 1, 2)]


def test_an_order_that_nothing_gives_is_marked(settings: CrashSettings) -> None:
    record = read(
        {"MAN_COLL": 99},
        *({"ACC_TYPE": 98, "Vsoes": own_events(*rows)} for rows in ([(12, 98)], [(12, 98), (12, 98)], [(12, 98)])),
        settings=settings,
    )
    assert parties(record) == [(12, 1, 2), (12, 2, 3)]
    assert record.implied == ("events", "order_of_contacts")


def test_parties_that_nothing_gives_stay_unknown(settings: CrashSettings) -> None:
    """1-2 and 3-4, 1-3 and 2-4, or 1-4 and 2-3."""
    record = read(
        {"MAN_COLL": 99}, *({"ACC_TYPE": 98, "Vsoes": own_events((12, 98))} for _ in range(4)), settings=settings
    )
    assert parties(record) == [(12, number, None) for number in (1, 2, 3, 4)]
    assert record.colliding_vehicles is None
    assert "collided with a motor vehicle in transport that is not named" in record.summary


def test_the_partner_of_two_vehicles_is_certain_even_without_its_row(settings: CrashSettings) -> None:
    record = read({}, {"Vsoes": own_events((12, 12), (12, 3))}, {"Vsoes": own_events((12, 9))}, settings=settings)
    assert parties(record) == [(12, 1, 2), (12, 1, 2)]


def test_pairings_of_a_national_year(shared_data: Path) -> None:
    """Of three vehicles and two contacts the rows of VSOE alone give the pairs that CEvent reports."""
    path = shared_data / "fars-national" / "FARS2016-events-and-persons.zip"
    if not path.is_file():
        pytest.skip(f"national tables not present at {path}")
    with zipfile.ZipFile(path) as archive:
        tables = {
            name: list(csv.DictReader(io.TextIOWrapper(archive.open(f"{name}.csv"), "utf-8")))
            for name in ("cevent", "vsoe", "parkwork")
        }
    reported: dict[str, list[frozenset[int]]] = defaultdict(list)
    for row in sorted(tables["cevent"], key=lambda row: int(row["EVENTNUM"])):
        if row["SOE"] in ("12", "14", "45", "55"):
            reported[row["ST_CASE"]].append(frozenset((int(row["VNUMBER1"]), int(row["VNUMBER2"]))))
    chosen = {case for case, pairs in reported.items() if len(pairs) == 2 and len(frozenset.union(*pairs)) == 3}
    assert len(chosen) == 1712
    rows: dict[str, dict[int, list[dict[str, str]]]] = defaultdict(lambda: defaultdict(list))
    for row in tables["vsoe"]:
        if row["ST_CASE"] in chosen:
            rows[row["ST_CASE"]][int(row["VEH_NO"])].append(row)
    standing = {(row["ST_CASE"], int(row["VEH_NO"])) for row in tables["parkwork"]}
    right = Counter[bool]()
    for case in sorted(chosen)[::10]:
        vehicles = [
            VehicleRecord(number, VehicleClass.CAR, 4.5, 1.8, 1.5, 1500.0, in_transport=(case, number) not in standing)
            for number in rows[case]
        ]
        sequences = {
            number: [
                VehicleEvent(number, int(row["SOE"]), impact_area(int(row["AOI"])))
                for row in sorted(own_rows, key=lambda row: int(row["VEVENTNUM"]))
            ]
            for number, own_rows in rows[case].items()
        }
        events, _ = merge_sequences(sequences, vehicles, contact_first=True, man_coll=None)
        found = [frozenset((event.party_1, event.party_2)) for event in events if event.is_vehicle_contact]
        right[Counter(found) == Counter(reported[case])] += 1
    assert right == {True: 172}


# --- blank codes of 2015 -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("crash_type", "code"), [(1, 63), (5, 63), (6, 64), (10, 64), (13, 79), (86, 79)])
def test_a_blank_first_event_without_harm_is_a_departure_to_the_side_of_the_crash_type(
    crash_type: int, code: int, settings: CrashSettings
) -> None:
    vehicle = {"ACC_TYPE": crash_type, "Vsoes": own_events((None, 55), (42, 12), (None, 55))}
    record = read({"HARM_EV": 42, "MAN_COLL": 0}, vehicle, settings=settings)
    assert [event.code for event in record.events] == [code, 42, 99]
    assert "had an event that is not reported" in record.summary


def test_a_blank_first_harmful_event_is_the_crashs(settings: CrashSettings) -> None:
    record = read(
        {"HARM_EV": 8, "MAN_COLL": 0},
        {"Vsoes": own_events((None, 12))},
        {"Vsoes": own_events((42, 12))},
        settings=settings,
    )
    assert parties(record) == [(8, 1, None), (42, 2, 2002)]
    assert [event.implied for event in record.events] == [("code",), ()]


def test_a_blank_event_of_either_of_two_stays_unknown(settings: CrashSettings) -> None:
    record = read(
        {"HARM_EV": 8, "MAN_COLL": 0},
        {"Vsoes": own_events((None, 12))},
        {"Vsoes": own_events((None, 12))},
        settings=settings,
    )
    assert [event.code for event in record.events] == [99, 99]


def test_a_report_without_events_has_the_contact_its_first_harmful_event_states(settings: CrashSettings) -> None:
    record = read({"HARM_EV": 12}, {}, {}, settings=settings)
    assert parties(record) == [(12, 1, 2)]
    assert record.implied == ("events",)
    assert parties(read({"HARM_EV": 12}, {}, {}, {}, settings=settings)) == [(12, None, None)]
    assert parties(read({"HARM_EV": 8, "MAN_COLL": 0}, {}, {}, settings=settings)) == []


# --- vehicles that only events tell of -----------------------------------------------------------------------------


def test_parked_vehicles_of_real_crashes_are_not_in_transport(shared_data: Path, settings: CrashSettings) -> None:
    folder = shared_data / "fars-csv" / "2015"
    if not folder.is_dir():
        pytest.skip(f"national tables not present at {folder}")
    # VE_FORMS 1 and VE_TOTAL 3 and 2; VSOE of the others is SOE 14 alone.
    expected = {"2015-390976": {1: True, 2: False, 3: False}, "2015-390121": {1: False, 2: True}}
    reports = dict(FarsCsvSource.open(folder).reports(expected))
    assert reports.keys() == expected.keys()
    for key, data in reports.items():
        record = read_report(data, name=key, settings=settings)
        assert {vehicle.number: vehicle.in_transport for vehicle in record.vehicles} == expected[key]
        struck = [event for event in record.events if event.code == 14]
        assert {event.party_2 for event in struck} == {n for n, moving in expected[key].items() if not moving}
        assert record.contradictions == ()


def test_events_of_a_vehicle_that_is_not_there_are_a_contradiction(tmp_path: Path, settings: CrashSettings) -> None:
    (tmp_path / "accident.csv").write_text(
        "ST_CASE,YEAR,VE_FORMS,VE_TOTAL,LATITUDE,LONGITUD,HARM_EV\n510001,2015,2,2,37,-77,12\n"
    )
    (tmp_path / "vehicle.csv").write_text("ST_CASE,VEH_NO,BODY_TYP\n510001,1,4\n510001,2,4\n")
    (tmp_path / "vsoe.csv").write_text(
        "ST_CASE,VEH_NO,VEVENTNUM,SOE,AOI\n510001,1,1,12,12\n510001,2,1,12,6\n510001,5,1,12,6\n"
    )
    ((key, data),) = FarsCsvSource.open(tmp_path).reports()
    record = read_report(data, name=key, settings=settings)
    assert [vehicle.number for vehicle in record.vehicles] == [1, 2]
    assert parties(record) == [(12, 1, 2)]
    assert "VSOE has events of vehicle 5, which the report does not list" in record.contradictions


def test_an_event_with_a_vehicle_that_is_not_there_is_a_contradiction(settings: CrashSettings) -> None:
    record = read_report(report(events=[{"VNUMBER2": 7}]), name="report.xml", settings=settings)
    assert "event 1: VNUMBER2 says vehicle 7, which the report does not list" in record.contradictions
    assert record.colliding_vehicles is None


# --- contradictions ------------------------------------------------------------------------------------------------


def test_a_first_harmful_event_that_the_sequence_does_not_begin_with(settings: CrashSettings) -> None:
    record = read_report(report({"HARM_EV": 42, "MAN_COLL": 0}), name="report.xml", settings=settings)
    (sentence,) = record.contradictions
    assert sentence.startswith("HARM_EV 42 says that the first harmful event is that a vehicle struck a tree, but the")
    assert record.colliding_vehicles is not None


def test_a_contact_of_a_vehicles_own_sequence_that_the_crashs_lacks(settings: CrashSettings) -> None:
    vehicles = [{"Vsoes": own_events((12, 12))}, {"VEH_NO": 2, "Vsoes": own_events((12, 3))}]
    tree = {"SOE": 42, "VNUMBER2": 9999}
    data = report({"HARM_EV": 42, "MAN_COLL": 0}, vehicles, events=[tree])
    record = read_report(data, name="report.xml", settings=settings)
    assert record.contradictions == tuple(
        f"vehicle {number}: VSOE says that it met another vehicle (SOE 12), but CEvent does not" for number in (1, 2)
    )


def test_the_vehicle_pushed_into_another_parked_one_was_struck_before(settings: CrashSettings) -> None:
    """As national events have it (2016-10381: 14 1 12 2 2, then 14 1 19 3 2). A parked vehicle has no events itself."""
    standing = [{"VEH_NO": number, "PTYPE": 1, "PBODYTYP": 4} for number in (2, 3, 4)]
    rows = [
        {"EVENTNUM": 1, "SOE": 63, "VNUMBER1": 1, "AOI1": 55, "VNUMBER2": 5555, "AOI2": 55},
        {"EVENTNUM": 2, "SOE": 14, "VNUMBER1": 1, "AOI1": 12, "VNUMBER2": 2, "AOI2": 6},
        {"EVENTNUM": 3, "SOE": 14, "VNUMBER1": 1, "AOI1": 19, "VNUMBER2": 3, "AOI2": 6},
        {"EVENTNUM": 4, "SOE": 14, "VNUMBER1": 1, "AOI1": 19, "VNUMBER2": 4, "AOI2": 9},
        {"EVENTNUM": 5, "SOE": 42, "VNUMBER1": 1, "AOI1": 12, "VNUMBER2": 9999, "AOI2": 77},
    ]
    crash = {
        "VE_FORMS": 1,
        "VE_TOTAL": 4,
        "HARM_EV": 14,
        "MAN_COLL": 0,
        "ParkWorks": [("ParkWork", row) for row in standing],
    }
    record = read_report(report(crash, [{"VEH_NO": 1}], events=rows), name="report.xml", settings=settings)
    contacts = [event for event in record.events if event.code == 14]
    assert [(event.party_1, event.party_2) for event in contacts] == [(1, 2), (2, 3), (3, 4)]
    assert [event.implied for event in contacts[1:]] == [("party_1",)] * 2
    assert contacts[1].area_2 is not None
    assert contacts[1].area_2.clock_h == 6
