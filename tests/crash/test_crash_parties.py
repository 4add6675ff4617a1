"""Parties: numbers that cannot collide, whom and what each event was with, and what nothing tells."""

from __future__ import annotations

from pathlib import Path

import pytest
from crash_reports import parties, report

from trace_dag.common.settings import CrashSettings
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.parse import read_report
from trace_dag.crash.parties import EventKind, PartyKind
from trace_dag.crash.record import CrashRecord

ONE = {"VE_FORMS": 1, "VE_TOTAL": 1, "HARM_EV": 8, "MAN_COLL": 0}


def strike(number: int, soe: int = 8, vehicle: int = 1) -> dict[str, int]:
    return {"EVENTNUM": number, "SOE": soe, "VNUMBER1": vehicle, "VNUMBER2": 9999, "AOI2": 77}


def person(number: int, *, kind: int = 5, struck_by: int | None = 1, **more: object) -> tuple[str, dict[str, object]]:
    row = {"VEH_NO": 0, "PER_NO": number, "PER_TYP": kind, "STR_VEH": struck_by, "AGE": 40, **more}
    return "Person", row


def read(
    events: list[dict[str, int]],
    *persons: tuple[str, dict[str, object]],
    crash: dict[str, object] | None = None,
    vehicles: int = 1,
    **lists: list[tuple[str, dict[str, object]]],
) -> CrashRecord:
    listed = [{"VEH_NO": number} for number in range(1, vehicles + 1)]
    counts = {"VE_FORMS": vehicles, "VE_TOTAL": vehicles}
    data = report(ONE | counts | (crash or {}), listed, events, {"NPersons": list(persons), **lists})
    return read_report(data, name="report.xml", settings=CrashSettings())


def test_every_party_has_a_number_of_its_own() -> None:
    events = [
        strike(1, 63) | {"VNUMBER2": 5555, "AOI2": 55},
        strike(2, 42),
        strike(3, 11),
        strike(4, 10),
        strike(5, 14) | {"VNUMBER2": 2, "AOI2": 6},
        strike(6, 9),
        strike(7, 1) | {"VNUMBER2": 5555},
    ]
    parked = [("ParkWork", {"VEH_NO": 2, "PTYPE": 2, "PBODYTYP": 4, "PIMPACT1": 6})]
    record = read(events, person(1, kind=6), crash={"VE_TOTAL": 2}, ParkWorks=parked)
    assert parties(record) == [
        (63, 1, None), (42, 1, 2002), (11, 1, 2003), (10, 1, 2004), (14, 1, 2), (9, 1, 1001), (1, 1, None),
    ]  # fmt: skip
    assert [event.kind for event in record.events] == [
        EventKind.DEPARTURE,
        EventKind.OBJECT_STRUCK,
        EventKind.ANIMAL_STRUCK,
        EventKind.TRAIN_STRUCK,
        EventKind.VEHICLE_CONTACT,
        EventKind.PERSON_STRUCK,
        EventKind.OVERTURN,
    ]
    assert record.parties == {
        1: PartyKind.MOTOR_VEHICLE,
        2: PartyKind.PARKED_VEHICLE,
        1001: PartyKind.CYCLIST,
        2002: PartyKind.OBJECT,
        2003: PartyKind.ANIMAL,
        2004: PartyKind.TRAIN,
    }
    assert record.first_contact is record.events[4]


def test_two_vehicles_strike_the_same_person_one_after_the_other() -> None:
    record = read([strike(1), strike(2, vehicle=2)], person(1), vehicles=2)
    assert parties(record) == [(8, 1, 1001), (8, 2, 1001)]
    assert record.first_contact is record.events[0]
    assert record.colliding_vehicles is None
    assert record.ambiguities == ()


def test_the_four_of_virginia(real_reports: dict[str, bytes]) -> None:
    """Two vehicles, one pedestrian each: CEvent has SOE 8 of one vehicle, then of the other."""
    for case in ("510174", "510200", "510221", "510304"):
        name = f"crash_{case}.xml"
        record = read_report(real_reports[name], name=name, settings=CrashSettings())
        strikes = [event for event in record.events if event.kind is EventKind.PERSON_STRUCK]
        assert {event.party_1 for event in strikes} == {1, 2}
        assert {event.party_2 for event in strikes} == {1001}


def test_str_veh_distinguishes_persons() -> None:
    record = read([strike(1, vehicle=2), strike(2)], person(1), person(2, struck_by=2), vehicles=2)
    assert parties(record) == [(8, 2, 1002), (8, 1, 1001)]
    assert record.ambiguities == ()


def test_kinds_tell_persons_apart() -> None:
    record = read([strike(1, 15), strike(2, 8), strike(3, 9)], person(1, kind=7), person(2, kind=8), person(3))
    assert parties(record) == [(15, 1, 1002), (8, 1, 1003), (9, 1, 1001)]


def test_strikes_of_as_many_persons_are_taken_in_order_and_marked() -> None:
    record = read([strike(1), strike(2)], person(1), person(2))
    assert parties(record) == [(8, 1, 1001), (8, 1, 1002)]
    assert "order_of_strikes" in record.implied
    assert record.ambiguities[0] == (
        "event 1: vehicle 1 struck a pedestrian (SOE 8), and nothing tells which of persons 1 and 2; taken in the "
        "order of their numbers"
    )
    assert "The report leaves open: event 1: vehicle 1 struck a pedestrian" in record.summary


def test_one_strike_of_two_persons_names_nobody() -> None:
    record = read([strike(1)], person(1), person(2))
    assert parties(record) == [(8, 1, None)]
    assert record.ambiguities == (
        "event 1: vehicle 1 struck a pedestrian (SOE 8), and nothing tells which of persons 1 and 2",
    )
    assert record.first_contact is None


def test_a_person_missing_in_every_table() -> None:
    record = read([strike(1)])
    assert parties(record) == [(8, 1, None)]
    assert record.ambiguities == (
        "event 1: vehicle 1 struck a pedestrian (SOE 8), but the report lists no such person",
    )


def test_vehicles_own_sequences_leave_open_who_struck_first() -> None:
    rows = [("VSOEs", {"VEVENTNUM": 1, "SOE": 8, "AOI": 12})]
    vehicles = [{"VEH_NO": number, "Vsoes": rows} for number in (1, 2)]
    data = report(ONE | {"VE_FORMS": 2, "VE_TOTAL": 2}, vehicles, [], {"NPersons": [person(1)]})
    record = read_report(data, name="report.xml", settings=CrashSettings())
    assert parties(record) == [(8, 1, 1001), (8, 2, 1001)]
    assert record.implied == ("events", "order_of_strikes")
    assert record.ambiguities == ("nothing tells in which order the vehicles struck those they struck",)


def test_parked_and_working_vehicles_of_national_files_are_parties(tmp_path: Path) -> None:
    (tmp_path / "accident.csv").write_text(
        "ST_CASE,YEAR,VE_FORMS,VE_TOTAL,LATITUDE,LONGITUD,HARM_EV\n510001,2016,1,3,37,-77,14\n"
    )
    (tmp_path / "vehicle.csv").write_text("ST_CASE,VEH_NO,BODY_TYP,P_CRASH1\n510001,1,4,1\n")
    (tmp_path / "parkwork.csv").write_text("ST_CASE,VEH_NO,PTYPE,PBODYTYP,PIMPACT1\n510001,2,2,4,6\n510001,3,4,66,9\n")
    (tmp_path / "cevent.csv").write_text(
        "ST_CASE,EVENTNUM,VNUMBER1,AOI1,SOE,VNUMBER2,AOI2\n510001,1,1,12,14,2,6\n510001,2,1,3,45,3,9\n"
    )
    ((key, data),) = FarsCsvSource.open(tmp_path).reports()
    record = read_report(data, name=key, settings=CrashSettings())
    assert parties(record) == [(14, 1, 2), (45, 1, 3)]
    assert record.parties == {1: "motor_vehicle", 2: "parked_vehicle", 3: "parked_vehicle"}
    assert (record.vehicles[1].travel_speed_mps, record.vehicles[2].travel_speed_mps) == (0.0, None)
    assert record.kind == "parked"


# --- contradictions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("persons", "lists", "says"),
    [
        (
            [person(1, struck_by=4)],
            {},
            "person 1: STR_VEH says that vehicle 4 struck it, which the report does not list",
        ),
        (
            [person(1, struck_by=2)],
            {},
            "person 1: STR_VEH says that vehicle 2 struck it, but no event says that it struck a person",
        ),
        (
            [person(1, kind=6)],
            {},
            "event 1: vehicle 1 struck a pedestrian (SOE 8), but the report lists no such person",
        ),
        (
            [person(1)],
            {"PbTypes": [("PBType", {"VEH_NO": 0, "PER_NO": 3, "PBPTYPE": 5})]},
            "person 3: PbTypes tell of it, but NPersons does not list it",
        ),
        (
            [person(1)],
            {"PbTypes": [("PBType", {"VEH_NO": 0, "PBPTYPE": 5})]},
            "PbTypes has a row of nobody (PER_NO is missing), which is not a person outside the vehicles",
        ),
        (
            [person(1)],
            {"PbTypes": [("PBType", {"VEH_NO": 2, "PER_NO": 1, "PBPTYPE": 5})]},
            "PbTypes has a row of person 1 of vehicle 2, which is not a person outside the vehicles",
        ),
        ([person(1, AGE=450)], {}, "person 1: 450 is not an age in years; expected 0 to 120, 998 or 999"),
        (
            [person(1)],
            {"PbTypes": [("PBType", {"VEH_NO": 0, "PER_NO": 1, "PBPTYPE": 5, "PBAGE": 7})]},
            "person 1: its age is given as 7 and 40",
        ),
        (
            [person(1, LOCATION=21), person(1, LOCATION=11)],
            {},
            "person 1: LOCATION says on a sidewalk (21) and on the roadway away from an intersection, outside a "
            "crosswalk (11); the first is taken",
        ),
        (
            [person(1, LOCATION=21)],
            {"PbTypes": [("PBType", {"VEH_NO": 0, "PER_NO": 1, "PBPTYPE": 5, "PEDPOS": 3})]},
            "person 1: LOCATION says on a sidewalk (21), but PEDPOS in a travel lane (3)",
        ),
    ],
)
def test_impossible_values_are_named(
    persons: list[tuple[str, dict[str, object]]], lists: dict[str, list[tuple[str, dict[str, object]]]], says: str
) -> None:
    record = read([strike(1)], *persons, vehicles=2, **lists)
    assert says in record.contradictions


def test_an_age_that_is_not_known_stays_open() -> None:
    record = read([strike(1)], person(1, AGE=998))
    assert record.non_motorists[0].age_years is None
    assert record.ambiguities == ("person 1: its age is not known (998)",)
    assert record.contradictions == ()


def test_the_real_reports_contradict_themselves_in_no_person(real_reports: dict[str, bytes]) -> None:
    settings = CrashSettings(repair_malformed=True)
    for name, data in real_reports.items():
        record = read_report(data, name=name, settings=settings)
        assert not any("person" in sentence for sentence in record.contradictions), record.contradictions
