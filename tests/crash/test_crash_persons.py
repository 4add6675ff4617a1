"""Persons outside motor vehicles, from every table that tells of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from crash_reports import report

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.tables import record_from_parquet, record_to_parquet

PERSON = {"VEH_NO": 0, "PER_NO": 1, "PER_TYP": 5, "STR_VEH": 1}


def read(settings: CrashSettings, **lists: list[dict[str, Any]]) -> CrashRecord:
    rows = {name: [("Row", row) for row in entries] for name, entries in lists.items()}
    return read_report(report(lists=rows), name="report.xml", settings=settings)


def test_a_real_pedestrian(real_reports: dict[str, bytes], settings: CrashSettings) -> None:
    """Case 510174, read by hand in the report: at an intersection, outside the crosswalk, from the motorist's right."""
    record = read_report(real_reports["crash_510174.xml"], name="crash_510174.xml", settings=settings)
    (person,) = record.non_motorists
    assert (person.person_type_code, person.striking_vehicle, person.age_years, person.sex_code) == (5, 1, 38, 2)
    assert (person.pedestrian_position_code, person.pedestrian_direction_code) == (1, 2)
    assert (person.motorist_direction_code, person.motorist_manoeuvre_code, person.intersection_leg_code) == (3, 3, 1)
    assert (person.scenario, person.pedestrian_group_code, person.pedestrian_type_code) == ("2b", 750, 760)
    assert (person.cyclist_position_code, person.cyclist_direction_code, person.cyclist_group_code) == (None,) * 3
    assert (person.actions, person.circumstances, person.equipment) == ((3,), (2, 12), ())
    assert person.helmet_code is None
    assert "pedestrian, crossing the roadway, in an intersection, struck by vehicle 1" in record.summary
    assert record_from_parquet(record_to_parquet(record)) == record


def test_cyclists_of_national_files_without_a_person_table(shared_data: Path, settings: CrashSettings) -> None:
    """2016-40076 as it stands in pbtype, nmprior, nmcrash and safetyeq (not reported), column names of their year."""
    folder = shared_data / "fars-csv" / "2016"
    if not (folder / "pbtype.csv").is_file():
        pytest.skip(f"event tables not present at {folder}")
    ((_, data),) = FarsCsvSource.open(folder).reports(["2016-40076"])
    record = read_report(data, name="2016-40076", settings=settings)
    (person,) = record.non_motorists
    assert (person.person_type_code, person.age_years, person.sex_code, person.striking_vehicle) == (6, 63, 1, None)
    assert (person.sidewalk_code, person.intersection_code, person.cyclist_position_code) == (1, 3, 3)
    assert (person.cyclist_direction_code, person.cyclist_group_code, person.cyclist_type_code) == (1, 230, 239)
    assert (person.actions, person.circumstances, person.equipment) == ((5,), (0,), ())


def test_all_event_tables_of_national_files_are_read(shared_data: Path, settings: CrashSettings) -> None:
    folder = shared_data / "fars-csv" / "2016"
    if not (folder / "cevent.csv").is_file():
        pytest.skip(f"event tables not present at {folder}")
    records = {
        key: read_report(data, name=key, settings=settings) for key, data in FarsCsvSource.open(folder).reports()
    }
    assert len(records) == 18
    assert not any("events" in record.implied for record in records.values())
    # cevent.csv of 2016-40250: 1 into 2 twice, 1 into 3, then 1 over the centre line, off to the left, over a curb.
    parties = [(event.code, event.party_1, event.party_2) for event in records["2016-40250"].events]
    assert parties == [(12, 1, 2), (12, 1, 2), (12, 1, 3), (68, 1, None), (64, 1, None), (33, 1, 2006)]
    vehicles = [vehicle for record in records.values() for vehicle in record.vehicles]
    assert sum(bool(vehicle.damaged_areas) for vehicle in vehicles) > 20
    assert any(vehicle.avoidance_manoeuvres for vehicle in vehicles)


def test_older_names_and_newer_ones_say_the_same(settings: CrashSettings) -> None:
    old = read(settings, NPersons=[PERSON], NmPriors=[PERSON | {"MPR_ACT": 3}], NmCrashes=[PERSON | {"MTM_CRSH": 2}])
    new = read(settings, NPersons=[PERSON], NmPriors=[PERSON | {"NMACTION": 3}], NmCrashes=[PERSON | {"NMCC": 2}])
    assert old.non_motorists == new.non_motorists


def test_equipment_of_both_codings(settings: CrashSettings) -> None:
    old = read(settings, NPersons=[PERSON], SafetyEQs=[PERSON | {"MSAFEQMT": 2}, PERSON | {"MSAFEQMT": 5}])
    assert old.non_motorists[0].equipment == (2, 5)
    new = read(settings, NPersons=[PERSON], SafetyEQs=[PERSON | {"MSAFEQMT": -1, "NMHELMET": 1, "NMLIGHT": 8}])
    person = new.non_motorists[0]
    assert (person.equipment, person.helmet_code, person.lights_code) == ((), 1, None)


def test_a_person_struck_by_a_vehicle_that_is_not_there_is_a_contradiction(settings: CrashSettings) -> None:
    record = read(settings, NPersons=[PERSON | {"STR_VEH": 4}])
    assert record.contradictions == ("person 1: STR_VEH says that vehicle 4 struck it, which the report does not list",)


@pytest.mark.parametrize(
    ("element", "value"), [("PEDPOS", 44), ("PEDSNR", "13a"), ("BIKEDIR", 5), ("PEDCGP", 333), ("LOCATION", 12)]
)
def test_an_unknown_code_is_named_with_its_year(element: str, value: object, settings: CrashSettings) -> None:
    table = "NPersons" if element == "LOCATION" else "PbTypes"
    with pytest.raises(Rejection, match=rf"{element} holds '{value}', which is not a code of case year 2023") as caught:
        read(settings, **{table: [PERSON | {element: value}]})
    assert caught.value.reason is Reason.MALFORMED_REPORT
