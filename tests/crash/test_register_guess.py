"""Mappings to start from: what names and values suggest, marked as guesses, and readable as it stands."""

from __future__ import annotations

import pytest

from trace_dag.common.errors import UserError
from trace_dag.crash.record import Octant
from trace_dag.crash.registers.guess import guess_mapping
from trace_dag.crash.registers.table import RegisterTable

UNITS = """report,when,lat,lon,street,cross,manner,junction,hurt,move,heading,driver
A17,2022-05-03 16:20,41.83,-101.54,MAIN ST,ELDER ST,ANGLE,AT INTERSECTION,MINOR,LEFT TURN,E,somebody
A17,2022-05-03 16:20,41.83,-101.54,MAIN ST,ELDER ST,ANGLE,AT INTERSECTION,NONE,STRAIGHT,W,somebody else
A18,2022-05-04 08:05,41.83,-101.54,MAIN ST,ELDER ST,REAR END,AT INTERSECTION,NONE,STOPPED,E,a third
A18,2022-05-04 08:05,41.83,-101.54,MAIN ST,ELDER ST,REAR END,AT INTERSECTION,NONE,WHIRLING,E,a fourth
"""


def test_a_guessed_mapping_reads_its_table(tmp_path):
    table = tmp_path / "crashes.csv"
    table.write_text(UNITS)
    text = guess_mapping(table)
    (tmp_path / "crashes.toml").write_text(text)
    first, second = RegisterTable.open(str(tmp_path / "crashes.toml"), table).records()
    assert (first.key, first.hour) == ("crashes-A17", 16)
    assert (first.manner_of_collision_code, first.junction_relation_code) == (6, 2)
    assert [each.movement.value for each in first.vehicles] == [11, 1]  # P_CRASH1: turning left, going straight
    assert [each.heading.octant for each in first.vehicles] == [Octant.EAST, Octant.WEST]
    assert [person.injury_code for each in first.vehicles for person in each.occupants] == [2, 0]
    assert second.manner_of_collision_code == 1
    assert '# values."WHIRLING" = ?' in text
    assert "driver" not in text
    said = [line for line in text.splitlines() if line.startswith(("values", "column", "time", "rows"))]
    assert [line for line in said if "# guess" not in line] == []


@pytest.mark.parametrize(
    ("columns", "rows", "time"),
    [
        ("CRASH ID,DATE,TIME", "1,05/23/2022,16:20", 'column = ["DATE", "TIME"], format = ["%m/%d/%Y", "%H:%M"]'),
        ("crash_id,date", "1,23/05/2022", 'column = ["date"], format = ["%d/%m/%Y"]'),
        ("crn,at", "1,2022-05-23T16:20:00", 'column = ["at"], format = ["%Y-%m-%dT%H:%M:%S"]'),
    ],
)  # fmt: skip
def test_columns_of_time_are_guessed_by_their_values(tmp_path, columns, rows, time):
    (tmp_path / "t.csv").write_text(f"{columns}\n{rows}\n")
    text = guess_mapping(tmp_path / "t.csv")
    assert f"time = {{ {time} }}" in text
    assert 'rows = "crash"   # guess' in text


def test_a_table_without_id_or_time_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("crash_id,colour\n1,red\n")
    with pytest.raises(UserError, match="no column of dates in a known format among crash_id, colour"):
        guess_mapping(tmp_path / "t.csv")
