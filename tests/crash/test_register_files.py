"""Times and files of crash tables in the forms that agencies publish: what is read, and what is refused in a line."""

from __future__ import annotations

import bz2
import gzip
from pathlib import Path

import pytest

from trace_dag.common.errors import UserError
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.registers.table import RegisterTable
from trace_dag.crash.registers.table_check import check_table

HEAD = """
register = "mine"
name = "Crashes"
source = "https://example.org"
licence = "CC0"
attribution = "Nobody"
point_accuracy_m = 10
"""
CHICAGO = ', zone = "America/Chicago" }'
CRASH = """
[crash]
id = "id"
latitude_deg = "lat"
longitude_deg = "lon"
MAN_COLL = { column = "manner" }
"""
OF_ONE_ROW = f'{HEAD}rows = "crash"\nunits = ["1", "2"]\n'


def opened(folder: Path, mapping: str, text: str | bytes, name: str = "crashes.csv") -> RegisterTable:
    (folder / "mine.toml").write_text(mapping)
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return RegisterTable.open(str(folder / "mine.toml"), folder / name)


def read_times(folder: Path, time: str, columns: str, *rows: str) -> tuple[RegisterTable, list[CrashRecord]]:
    lines = [f"id,lat,lon,manner,{columns}", *(f"{number},41.5,-100,1,{row}" for number, row in enumerate(rows))]
    table = opened(folder, f"{OF_ONE_ROW}{CRASH}time = {time}\n[unit]\n", "\n".join(lines))
    return table, list(table.records())


@pytest.mark.parametrize(
    ("time", "columns", "row", "moment"),
    [
        ('{ column = "d", format = "%m/%d/%Y %I:%M %p" }', "d", "05/03/2022 04:20 PM", (2022, 5, 3, 16, 20)),
        ('{ column = ["d", "t"], format = "%m/%d/%Y %H:%M" }', "d,t", "5/3/2022,8:05", (2022, 5, 3, 8, 5)),
        ('{ column = ["d", "t"], format = "%m/%d/%Y %H:%M" }', "d,t", "5/3/2022,", (2022, 5, 3, None, None)),
        ('{ column = ["d", "t"], format = ["%m/%d/%Y", "%I:%M %p"] }', "d,t", "5/3/2022,12:05 AM", (2022, 5, 3, 0, 5)),
        ('{ column = ["y", "m", "t"], format = "%Y %m %H%M" }', "y,m,t", "2022,05,0905", (2022, 5, None, 9, 5)),
        ('{ column = ["y", "m", "t"], format = "%Y %m %H%M" }', "y,m,t", "2022,05,105", (2022, 5, None, 1, 5)),
        ('{ column = ["y", "m", "t"], format = "%Y %m %H%M" }', "y,m,t", "2022,05,9999", (2022, 5, None, None, None)),
        ('{ column = "d", format = "%Y-%m-%d" }', "d", "2022-05-03", (2022, 5, 3, None, None)),
        ('{ column = "d", format = "%Y-%m" }', "d", "2022-05", (2022, 5, None, None, None)),
        ('{ column = "d", format = "%Y" }', "d", "2022", (2022, None, None, None, None)),
        ('{ column = ["d", "t"], format = "%Y-%m-%d %H" }', "d,t", "2022-05-03,14", (2022, 5, 3, 14, None)),
        ('{ column = "d", format = "%Y-%m-%dT00:00" }', "d", "2022-05-03T00:00", (2022, 5, 3, None, None)),
        ('{ column = "d", format = "ISO8601" }', "d", "2022-05-03", (2022, 5, 3, None, None)),
        ('{ column = "d", format = "ISO8601" }', "d", "2022-05-03T16:20:00.000", (2022, 5, 3, 16, 20)),
        # 1651594800 is 2022-05-03 16:20 UTC, when clocks in Chicago are five hours behind, in winter six
        ('{ column = "d", format = "epoch s"' + CHICAGO, "d", "1651594800", (2022, 5, 3, 11, 20)),
        ('{ column = "d", format = "epoch ms"' + CHICAGO, "d", "1651594800000", (2022, 5, 3, 11, 20)),
        ('{ column = "d", format = "epoch ms", zone = "UTC" }', "d", "1651594800000", (2022, 5, 3, 16, 20)),
        ('{ column = "d", format = "ISO8601"' + CHICAGO, "d", "2022-01-03T01:20:00.000Z", (2022, 1, 2, 19, 20)),
        ('{ column = "d", format = "ISO8601"' + CHICAGO, "d", "2022-05-03T16:20:00", (2022, 5, 3, 16, 20)),
        ('{ column = "d", format = "%Y/%m/%d %H:%M%z"' + CHICAGO, "d", "2022/05/03 16:20+00", (2022, 5, 3, 11, 20)),
        ('{ column = "d", format = "%Y-%m-%dT%H:%MZ"' + CHICAGO, "d", "2022-05-03T16:20Z", (2022, 5, 3, 11, 20)),
    ],
)  # fmt: skip
def test_parts_of_a_time_that_no_column_holds_are_not_reported(tmp_path, time, columns, row, moment):
    _, (record,) = read_times(tmp_path, time, columns, row)
    assert (record.year, record.month, record.day, record.hour, record.minute) == moment


def test_a_text_that_is_no_time_is_counted_with_its_format(tmp_path):
    time = '{ column = ["d", "t"], format = "%Y-%m-%d %H:%M" }'
    table, records = read_times(tmp_path, time, "d,t", "2022-05-03,24:60", "3 May 2022,16:20", "2022-05-04,")
    assert [record.hour for record in records] == [None, None]
    assert table.notes()[1:4] == [
        "1 crash left out: no year in the column of the time, as the mapping has its format; "
        "first at id '1': 3 May 2022 16:20",
        "not mapped, so not known: d as %Y-%m-%d: 3 May 2022 (1); first at id '1': 3 May 2022",
        "not mapped, so not known: t as %H:%M: 24:60 (1); first at id '0': 24:60",
    ]


def test_an_offset_without_a_zone_is_no_local_time(tmp_path):
    table, records = read_times(tmp_path, '{ column = "d", format = "ISO8601" }', "d", "2022-05-03T16:20:00Z")
    assert records == []
    assert (
        "not mapped, so not known: d as ISO8601 (with an offset: name a zone): 2022-05-03T16:20:00Z (1); "
        "first at id '0': 2022-05-03T16:20:00Z" in table.notes()
    )


def test_check_counts_the_hours_that_are_not_reported(tmp_path):
    table, _ = read_times(tmp_path, '{ column = "d", format = "%Y-%m-%d" }', "d", "2022-05-03", "2022-05-04")
    said = list(check_table(table, CrashSettings()))
    assert "time of 2 crashes: year 2, month 2, day 2, hour 0, minute 0; the rest is not reported" in said
    assert any(line.startswith("fields implied by others, ") and "implied" in line for line in said)


@pytest.mark.parametrize(
    ("time", "said"),
    [
        ('{ column = "d", format = "%s" }', "crash.time: %s in '%s' is not known; expected %Y"),
        ('{ column = "d", format = "%Y-%m-%d %H:%M%" }', "crash.time: % in '%Y-%m-%d %H:%M%' is not known"),
        ('{ column = "d", format = "%Y%Y" }', "crash.time: the year is in it more than once"),
        ('{ column = ["d", "t"], format = ["%Y", "%d %Y"] }', "crash.time: the year is in it more than once"),
        ('{ column = "d", format = "YYYY-MM-DD" }', "crash.time: no year in 'YYYY-MM-DD'; expected %Y"),
        ('{ column = "d", format = "" }', "crash.time: no year in ''"),
        ('{ column = "d", format = "%Y %I:%M" }', "crash.time: '%Y %I:%M': %I, the hour of twelve, needs %p"),
        ('{ column = ["d", "t"], format = ["%Y"] }', "crash.time: 1 formats of 2 columns"),
        ('{ column = "d", format = "epoch s" }', "crash.time: a time with an offset from UTC stands in one column"),
        ('{ column = "d", format = "epoch s", zone = "Middle/Earth" }', "crash.time: zone 'Middle/Earth' is not known"),
    ],
)
def test_a_format_that_cannot_be_read_is_refused_in_a_line(tmp_path, time, said):
    with pytest.raises(UserError) as refused:
        read_times(tmp_path, time, "d,t", "2022,5")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


PLAIN = f'{OF_ONE_ROW}{CRASH}time = {{ column = "when", format = "%Y-%m-%d" }}\ntrafficway_1 = "street"\n[unit]\n'
LINES = ("id;lat;lon;manner;when;street", '7;41.5;-100.25;1;2022-05-03;"Café St; north"')


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("crashes.csv", "\n".join(LINES).encode()),
        ("crashes.csv", "\r\n".join(LINES).encode("utf-8-sig")),
        ("crashes.csv", "\n".join(LINES).encode("utf-16")),
        ("crashes.csv", ("\ufeff" + "\n".join(LINES)).encode("utf-16")),
        ("crashes.csv", "\n".join(LINES).encode("cp1252")),
        ("crashes.tsv", "\n".join(LINES).replace("; ", "\0").replace(";", "\t").replace("\0", "; ").encode()),
        ("crashes.csv", "\n".join(LINES).replace("41.5", "41,5").replace("100.25", "100,25").encode()),
        ("crashes.csv.gz", gzip.compress("\n".join(LINES).encode(), mtime=0)),
        ("crashes.csv.bz2", bz2.compress("\n".join(LINES).encode())),
    ],
)
def test_a_table_is_read_as_programs_save_it(tmp_path, name, data):
    (record,) = opened(tmp_path, PLAIN, data, name).records()
    assert (record.key, record.latitude_deg, record.longitude_deg) == ("mine-7", 41.5, -100.25)
    assert record.trafficway_1 == "Café St; north"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"PK\x03\x04...", r"is not a CSV table; it is an Excel workbook or a zip archive: save the sheet as CSV"),
        (b'{"type": "FeatureCollection"}', r"is not a CSV table; it is JSON: save it as CSV"),
        (b"", r"begins with a blank line; expected its columns"),
        ("\n".join([*LINES, "8;41.5;-100;1;2022-05-03;Elm;more"]).encode(), r"Line: 3.*Columns: 6.*mend that row"),
        ("\n".join([LINES[0], "8;41.5;-100;1;2022-05-03;Elm;more"]).encode(), r"Line: 2.*Columns: 6.*mend that row"),
        ("\n".join([*LINES, "8;41.5"]).encode(), r"Line: 3.*mend that row"),
        ("\n".join([*LINES, LINES[1]]).encode(), r"id '7' stands in rows 2 and 3; the mapping says that a row is"),
    ],
)
def test_a_file_that_is_no_such_table_is_refused_in_a_line(tmp_path, data, said):
    with pytest.raises(UserError, match=said) as refused:
        opened(tmp_path, PLAIN, data).notes()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("second", "said"),
    [
        ("7;41.5;-100.25;1;2021-05-03;Elm", "year 2021 in row 3 and 2022 in row 2"),
        ("7;41.5;-101.25;1;2022-05-03;Elm", r"lon -101\.25 in row 3 and -100\.25 in row 2"),
    ],
)
def test_an_id_of_two_crashes_is_an_error_with_both_rows(tmp_path, second, said):
    of_units = PLAIN.replace('rows = "crash"\nunits = ["1", "2"]', 'rows = "unit"')
    assert len(list(opened(tmp_path, of_units, "\n".join([*LINES, LINES[1]])).records())) == 1
    with pytest.raises(UserError, match=f"id '7' stands for two crashes: {said}"):
        opened(tmp_path, of_units, "\n".join([*LINES, second])).notes()


FILES = f"""{HEAD}rows = "unit"
table = "*crash*.csv"
[[files]]
name = "*vehicle*.csv"
on = {{ crash = "id" }}
units = true
[[files]]
name = "*person*.csv"
on = {{ crash = "id" }}
where = {{ role = ["on foot"] }}
units = true
[[files]]
name = "*person*.csv"
on = {{ crash = "id", unit = "number" }}
where = {{ role = ["driver"] }}
{CRASH}
time = {{ column = "when", format = "%Y-%m-%d" }}
[unit]
kind = {{ column = "role", values = {{ "driver" = "vehicle", "on foot" = 5 }} }}
P_CRASH1 = {{ column = "move" }}
INJ_SEV = {{ column = "hurt" }}
AGE = {{ column = "age" }}
"""


def test_several_files_are_joined_by_their_keys(tmp_path):
    """Vehicles are units, persons on foot too; drivers add what they are to their vehicles."""
    (tmp_path / "mine.toml").write_text(FILES)
    for name, text in {
        "Crash_2022.csv": "id,lat,lon,manner,when\nA,41.5,-99,0,2022-05-03\nB,41.5,-99,1,2022-05-04\nC,0,0,0,2022-05-4",
        "Vehicle_2022.csv": "crash,number,move\nB,1,1\nA,1,11\nB,2,5",
        "Person_2022.csv": "crash,unit,role,hurt,age\nA,1,driver,0,40\nA,1,rider,3,9\nA,,on foot,4,70\nB,2,driver,2,",
    }.items():
        (tmp_path / name).write_text(text)
    table = RegisterTable.open(str(tmp_path / "mine.toml"), tmp_path)
    first, second = table.records()
    assert first.kind is CrashKind.PEDESTRIAN
    assert [(each.movement.value, each.occupants[0].age_years) for each in first.vehicles] == [(11, 40)]
    assert [(each.injury_code, each.age_years) for each in first.non_motorists] == [(4, 70)]
    assert [[person.injury_code for person in each.occupants] for each in second.vehicles] == [[], [2]]
    assert table.notes()[0].startswith("Nobody, Crashes: 2 crashes in 4 rows")
    same = RegisterTable.open(str(tmp_path / "mine.toml"), tmp_path / "Crash_2022.csv")  # or its crashes
    assert list(same.records()) == [first, second]
    (tmp_path / "Person_2022.csv").unlink()
    with pytest.raises(UserError, match=r"no file \*person\*\.csv, which the mapping of mine names; it has Crash_2022"):
        RegisterTable.open(str(tmp_path / "mine.toml"), tmp_path).notes()


@pytest.mark.parametrize(
    ("keys", "point", "keeps_left"),
    [
        ("", "52.5,-1.5", True),  # the English Midlands
        ("", "50.95,1.86", False),  # Calais
        ('traffic = "right"\n', "52.5,-1.5", False),
        ('traffic = "left"\n', "41.5,-100", True),
        ("state = 52\n", "17.72,-64.8", True),  # the US Virgin Islands
        ("state = 31\n", "41.5,-100", False),
    ],
)
def test_traffic_keeps_the_side_of_the_mapping_or_else_of_the_country(tmp_path, keys, point, keeps_left):
    text = "id,lat,lon,manner,when,street\n" + f"1,{point},1,2022-05-03,Elm"
    table = opened(tmp_path, PLAIN.replace("units =", f"{keys}units ="), text)
    (record,) = table.records()
    assert [vehicle.keeps_left for vehicle in record.vehicles] == [keeps_left] * 2
    said = "traffic keeps left in 1 of 1 crashes, by the mapping or the point's country"
    assert (said in check_table(table, CrashSettings())) == keeps_left
