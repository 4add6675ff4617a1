"""FARS national CSV files as a source: the same crashes, whatever the release's layout."""

from __future__ import annotations

import csv
import json
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from crash_reports import rejection
from fars_tables import csv_of, tables_of, write

from trace_dag.common.errors import Reason, Rejection, UserError
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.derive import UNSAID_MOVEMENTS
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.listing import list_report
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord

BROKEN = {"crash_510030.xml", "crash_510108.xml", "crash_510150.xml"}


@pytest.fixture(scope="module")
def national(shared_data: Path) -> Path:
    folder = shared_data / "fars-csv"
    if not folder.is_dir():
        pytest.skip(f"FARS CSV files not present at {folder}")
    return folder


@pytest.fixture(scope="module")
def well_formed(real_reports: dict[str, bytes]) -> dict[str, bytes]:
    return {name: data for name, data in real_reports.items() if name not in BROKEN}


def records(source: FarsCsvSource, settings: CrashSettings) -> dict[str, CrashRecord]:
    return {key: read_report(data, name=key, settings=settings, expected_key=key) for key, data in source.reports()}


# --- the real files of five years ----------------------------------------------------------------------------------


def test_all_crashes_are_listed_and_read(national: Path, settings: CrashSettings) -> None:
    source = FarsCsvSource.open(national)
    listings = source.listings()
    assert len(listings) == 210
    assert Counter(listing.vehicles for listing in listings)[2] == 66
    assert set(records(source, settings)) == {listing.key for listing in listings}


def test_listings_agree_with_the_accident_table(national: Path) -> None:
    rows = {}
    for path in national.glob("*/accident.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            rows.update({f"{row['YEAR']}-{row['ST_CASE']}": row for row in csv.DictReader(file)})
    listings = FarsCsvSource.open(national).listings()
    assert listings
    for listing in listings:
        row = rows[listing.key]
        assert (listing.latitude_deg, listing.longitude_deg) == (float(row["LATITUDE"]), float(row["LONGITUD"]))
        assert (listing.manner_of_collision_code, listing.intersection_type_code) == (
            int(row["MAN_COLL"]), int(row["TYP_INT"]),
        )  # fmt: skip


def test_two_vehicle_crashes_are_rejected_only_where_no_table_gives_enough(
    national: Path, settings: CrashSettings, capsys: pytest.CaptureFixture[str]
) -> None:
    two = [
        record
        for record in records(FarsCsvSource.open(national), settings).values()
        if record.vehicles_in_transport == 2
    ]
    rejected = {record.key: found.reason for record in two if (found := rejection(record, settings))}
    shares = {
        "complete": len(two) - len(rejected),
        "impact of both vehicles": sum(all(vehicle.impact for vehicle in record.vehicles) for record in two),
        "movement of both vehicles": sum(
            all(vehicle.movement not in UNSAID_MOVEMENTS for vehicle in record.vehicles) for record in two
        ),
        "topology": sum(record.road_topology != "others" for record in two),
    }
    with capsys.disabled():
        print(f"\n{len(two)} two-vehicle crashes of the CSV files: {shares}")  # noqa: T201
    assert len(two) == 66
    # Looked up by hand in all tables: it lacks the row of a vehicle altogether, and both areas of impact.
    assert rejected == {
        "2015-391007": Reason.INCOMPLETE_TRAJECTORY,
        # HARM_EV 1: the vehicle that overturned on the roadway lacks its row.
        "2015-40238": Reason.INCOMPLETE_TRAJECTORY,
        # HARM_EV 8, a pedestrian, of two vehicles without events: which of them struck it?
        "2013-40022": Reason.INCOMPLETE_SEQUENCE,
        # AOI 13 and 14: the top of one, the undercarriage of the other, and no IMPACT1.
        "2015-390746": Reason.INCOMPLETE_IMPACT,
    }


def test_impacts_come_from_vsoe_where_the_vehicle_table_has_none(national: Path, settings: CrashSettings) -> None:
    with (national / "2015" / "vsoe.csv").open(encoding="utf-8", newline="") as file:
        areas = {
            (row["ST_CASE"], row["VEH_NO"]): int(row["AOI"])
            for row in csv.DictReader(file)
            if row["SOE"] == "12" and row["VEVENTNUM"] == "1" and 1 <= int(row["AOI"]) <= 12
        }
    compared = 0
    for record in records(FarsCsvSource.open(national / "2015"), settings).values():
        for vehicle in record.vehicles:
            code = areas.get((str(record.state_case), str(vehicle.number)))
            if vehicle.initial_impact_code is None and code is not None:
                compared += 1
                assert vehicle.impact is not None
                assert vehicle.impact.code == code
                assert "impact" in vehicle.implied
    assert compared > 50


# --- the same facts in both layouts --------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["folder", "upper case", "byte order mark", "latin-1", "zip", "zip with a folder"])
def test_a_record_from_csv_equals_the_one_from_xml(
    layout: str, well_formed: dict[str, bytes], settings: CrashSettings, tmp_path: Path
) -> None:
    chosen = well_formed if layout == "folder" else dict(list(well_formed.items())[:6])
    path = tmp_path / "FARS2023NationalCSV"
    encoding = {"byte order mark": "utf-8-sig", "latin-1": "cp1252"}.get(layout, "utf-8")
    write(tables_of(chosen.values()), path, encoding=encoding, upper=layout == "upper case")
    if layout.startswith("zip"):
        path = _zipped(path, "FARS2023NationalCSV/" if layout == "zip with a folder" else "")
    from_csv = records(FarsCsvSource.open(path), settings)
    from_xml = {
        record.key: record
        for name, data in chosen.items()
        for record in [read_report(data, name=name, settings=settings)]
    }
    assert from_csv == from_xml


def test_older_column_names(well_formed: dict[str, bytes], settings: CrashSettings, tmp_path: Path) -> None:
    tables = tables_of(well_formed.values())
    for row in tables["damage"]:
        row.pop("DAMAGE", None)  # MDAREAS until 2019
    for row in tables["maneuver"]:
        row.pop("MANEUVER", None)  # MDRMANAV until 2019
    write(tables, tmp_path)
    found = records(FarsCsvSource.open(tmp_path), settings)
    assert len(found) == len(well_formed)
    for key, record in found.items():
        original = read_report(well_formed[f"crash_{key.removeprefix('2023-')}.xml"], name=key, settings=settings)
        assert record == original


def test_events_are_put_together_without_cevent(
    well_formed: dict[str, bytes], settings: CrashSettings, tmp_path: Path
) -> None:
    """From VSOE alone the collision of two vehicles comes out as CEvent has it, but for which party is the first."""
    tables = tables_of(well_formed.values())
    tables["cevent"], tables["vevent"] = [], []
    write(tables, tmp_path)
    found = records(FarsCsvSource.open(tmp_path), settings)
    assert len(found) == len(well_formed)
    for key, record in found.items():
        original = read_report(well_formed[f"crash_{key.removeprefix('2023-')}.xml"], name=key, settings=settings)
        assert "events" in record.implied
        if any(not vehicle.in_transport for vehicle in original.vehicles):
            continue  # these reports have no VSOE rows of parked vehicles, and CEvent tells two of them apart
        collided = [_parties(event) for event in record.events if event.code == 12]
        assert collided == [_parties(event) for event in original.events if event.code == 12]
        assert [replace(vehicle, implied=()).impact for vehicle in record.vehicles] == [
            vehicle.impact for vehicle in original.vehicles
        ]


def test_listings_from_csv_and_xml_agree(well_formed: dict[str, bytes], tmp_path: Path) -> None:
    write(tables_of(well_formed.values()), tmp_path)
    from_xml = [list_report(data, name=name) for name, data in well_formed.items()]
    assert FarsCsvSource.open(tmp_path).listings() == sorted(from_xml, key=lambda listing: listing.key)


def test_only_the_crashes_asked_for_are_read(well_formed: dict[str, bytes], tmp_path: Path) -> None:
    write(tables_of(well_formed.values()), tmp_path)
    source = FarsCsvSource.open(tmp_path)
    keys = [key for key, _ in source.reports(["2023-510425", "2023-510002", "2023-999999"])]
    assert keys == ["2023-510002", "2023-510425"]


def test_a_crash_in_two_releases_is_read_once(well_formed: dict[str, bytes], tmp_path: Path) -> None:
    chosen = list(well_formed.values())[:3]
    write(tables_of(chosen), tmp_path / "first")
    write(tables_of(chosen[:2]), tmp_path / "second")
    source = FarsCsvSource.open(tmp_path)
    assert len(source.listings()) == 3
    assert len(list(source.reports())) == 3


# --- bad input -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({}, "no accident.csv found"),
        ({"vehicle.csv": "ST_CASE,VEH_NO\n510001,1\n"}, "no accident.csv found"),
        ({"vsoe.csv": "ST_CASE,VEH_NO,SOE\n510001,1,12\n"}, "no accident.csv, and its path names no year"),
        ({"accident.csv": "A,B\n1,2\n", "vehicle.csv": "ST_CASE,VEH_NO\n1,1\n"}, "no ST_CASE .* with commas between"),
        ({"accident.csv": "ST_CASE,YEAR\n1,2,3\n", "vehicle.csv": "ST_CASE,VEH_NO\n1,1\n"}, "is not a readable CSV"),
        (
            {"accident.csv": "ST_CASE,YEAR\n510001,2022\n510002,2023\n", "vehicle.csv": "ST_CASE,VEH_NO\n510001,1\n"},
            "case years 2022, 2023; expected one year",
        ),
        (
            {"accident.csv": "ST_CASE,YEAR\n510001,2023\n510001,2023\n", "vehicle.csv": "ST_CASE,VEH_NO\n510001,1\n"},
            "ST_CASE 510001 has several rows",
        ),
        (
            {"accident.csv": "ST_CASE,YEAR\nabc,2023\n", "vehicle.csv": "ST_CASE,VEH_NO\n510001,1\n"},
            "a value of ST_CASE is not a number",
        ),
        (
            {"accident.csv": "ST_CASE,YEAR\n12,2023\n510001,2023\n", "vehicle.csv": "ST_CASE,VEH_NO\n510001,1\n"},
            "state case 12 make no key",
        ),
        ({"FARS.zip": "no zip"}, "is not a readable zip"),
    ],
)
def test_a_folder_that_is_no_release_gives_the_reason(files: dict[str, str], says: str, tmp_path: Path) -> None:
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=says) as caught:
        FarsCsvSource.open(tmp_path).listings()
    assert str(tmp_path) in str(caught.value)


def test_accidents_alone_are_counted_and_refused_where_they_are_to_be_reconstructed(
    settings: CrashSettings, tmp_path: Path
) -> None:
    (tmp_path / "accident.csv").write_text(
        "ST_CASE,YEAR,VE_FORMS,HARM_EV,LATITUDE,LONGITUD\n510001,2015,1,8,37,-77\n510002,2015,2,12,37,-77\n"
    )
    source = FarsCsvSource.open(tmp_path)
    assert [(listing.kind, listing.vehicles) for listing in source.listings()] == [
        ("pedestrian", 1),
        ("two_vehicles", 2),
    ]
    with pytest.raises(UserError, match=r"without vehicle\.csv \(bodies, speeds.*There are accident$"):
        source.notes()
    for listing, (key, data) in zip(source.listings(), source.reports(), strict=True):
        record = read_report(data, name=key, settings=settings)
        assert (record.kind, record.vehicles) == (listing.kind, ())


def test_events_alone_are_counted_without_parked_vehicles(tmp_path: Path) -> None:
    """Two vehicles of three were in transport; the year is that of the folder."""
    folder = tmp_path / "FARS2016"
    folder.mkdir()
    (folder / "vsoe.csv").write_text(
        "ST_CASE,VEH_NO,VEVENTNUM,SOE,AOI\n510001,1,1,12,12\n510001,2,1,12,6\n510001,1,2,14,12\n510001,3,1,14,6\n"
    )
    (folder / "parkwork.csv").write_text("ST_CASE,VEH_NO,PTYPE\n510001,3,2\n")
    (listing,) = FarsCsvSource.open(tmp_path).listings()
    assert (listing.key, listing.vehicles, listing.kind) == ("2016-510001", 2, "two_vehicles")
    assert (listing.latitude_deg, listing.state_code) == (None, 51)


TWO_TABLES = {
    "accident.csv": "ST_CASE,YEAR,VE_FORMS,HARM_EV,LATITUDE,LONGITUD\n510001,2015,1,8,37.5,-77\n",
    "vehicle.csv": "ST_CASE,VEH_NO,TRAV_SP\n510001,1,45\n",
}


def test_tables_that_are_missing_are_named_with_what_that_costs(tmp_path: Path) -> None:
    for name, content in TWO_TABLES.items():
        (tmp_path / name).write_text(content)
    (note,) = FarsCsvSource.open(tmp_path).notes()
    assert note.startswith("FARS 2015: accident, vehicle; no cevent: ")
    assert "; no pbtype: directions and positions of pedestrians and cyclists are unknown" in note


def as_pandas(text: str) -> str:
    """With an index, and whole numbers of columns with gaps as numbers with a fraction."""
    header, *rows = text.splitlines()
    written = (",".join(f"{value}.0" if value.isdigit() else value for value in row.split(",")) for row in rows)
    return "\n".join([f",{header}", *(f"{number},{row}" for number, row in enumerate(written))])


def as_r(text: str) -> str:
    """With row names in quotes, and NA for what is not there."""
    header, *rows = text.splitlines()
    return "\n".join([f'"",{header},ROAD_FNC', *(f'"{number}",{row},NA' for number, row in enumerate(rows, 1))])


@pytest.mark.parametrize("saved", [as_pandas, as_r])
def test_tables_saved_by_pandas_and_r_are_read_as_nhtsas(
    settings: CrashSettings, tmp_path: Path, saved: Callable[[str], str]
) -> None:
    for folder in ("nhtsa", "saved"):
        (tmp_path / folder).mkdir()
    for name, content in TWO_TABLES.items():
        (tmp_path / "nhtsa" / name).write_text(content)
        (tmp_path / "saved" / name).write_text(saved(content))
    plain, other = (FarsCsvSource.open(tmp_path / folder) for folder in ("nhtsa", "saved"))
    assert plain.listings() == other.listings()
    assert records(plain, settings) == records(other, settings)


def test_stacked_years_are_named_before_the_case_they_both_have(tmp_path: Path) -> None:
    accidents = "ST_CASE,YEAR\n510001,2015\n510001,2016\n"
    for name, content in {**TWO_TABLES, "accident.csv": accidents}.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match="case years 2015, 2016; expected one year, each in a folder"):
        FarsCsvSource.open(tmp_path).listings()


def test_a_missing_path(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        FarsCsvSource.open(tmp_path / "nowhere")


def test_hostile_column_names_and_values_stay_text(settings: CrashSettings, tmp_path: Path) -> None:
    row = {"ST_CASE": "510001", "YEAR": "2023", "LATITUDE": "37", "LONGITUD": "-77", "TWAY_ID": "A<&>\x07B"}
    row |= {"X><EVIL/>": "1"}
    (tmp_path / "accident.csv").write_text(csv_of([row]))
    (tmp_path / "vehicle.csv").write_text(csv_of([{"ST_CASE": "510001", "VEH_NO": "1"}]))
    record = records(FarsCsvSource.open(tmp_path), settings)["2023-510001"]
    assert record.trafficway_1 == "A<&>B"


def test_a_report_is_the_rows_as_they_stand(tmp_path: Path) -> None:
    vehicles = [{"ST_CASE": "510001", "VEH_NO": number, "TRAV_SP": "NA" if number == "2" else "55"} for number in "12"]
    (tmp_path / "accident.csv").write_text(csv_of([{"ST_CASE": "510001", "YEAR": "2023", "TWAY_ID": "A  <B>"}]))
    (tmp_path / "vehicle.csv").write_text(csv_of(vehicles))
    ((_, data),) = FarsCsvSource.open(tmp_path).reports()
    assert json.loads(data) == {
        "case_year": 2023,
        "state_case": 510001,
        "tables": {
            "accident": [{"ST_CASE": "510001", "YEAR": "2023", "TWAY_ID": "A  <B>"}],
            "vehicle": [{"ST_CASE": "510001", "VEH_NO": "1", "TRAV_SP": "55"}, {"ST_CASE": "510001", "VEH_NO": "2"}],
        },
    }


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        (3, "tables: Input should be"),
        ({"accident": [{"YEAR": None}]}, "Input should be a valid string"),
        ({"accident": [{"ST_CASE": "many"}]}, "ST_CASE holds 'many'; expected a whole number"),
    ],
)
def test_rows_that_are_no_tables_are_malformed(tables: object, says: str, settings: CrashSettings) -> None:
    data = json.dumps({"case_year": 2023, "state_case": 510001, "tables": tables}).encode()
    with pytest.raises(Rejection, match=says) as raised:
        read_report(data, name="2023-510001.json", settings=settings)
    assert raised.value.reason is Reason.MALFORMED_REPORT


def _zipped(folder: Path, prefix: str) -> Path:
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in folder.iterdir():
            archive.write(file, prefix + file.name)
    return path


def _parties(event: object) -> set[tuple[object, object]]:
    return {
        (getattr(event, f"party_{side}"), area.code if (area := getattr(event, f"area_{side}")) else None)
        for side in (1, 2)
    }
