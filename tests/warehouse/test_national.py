"""The share of a country's crashes that can be reconstructed, from national tables and stored crashes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from trace_dag.common.errors import UserError
from trace_dag.crash.classes import CrashKind
from trace_dag.warehouse.national import StoredKind, count_kinds, coverage_of_country

# Two cars (12), three cars, a tree (42), a pedestrian (8), a deer (11), a train (10).
TABLE = "ST_CASE,VE_FORMS,HARM_EV\n1,2,12\n2,3,12\n3,1,42\n4,1,8\n5,1,11\n6,1,10\n7,1,42\n"


def test_kinds_are_counted_in_a_table_and_in_an_archive_of_it(tmp_path: Path) -> None:
    plain, packed = tmp_path / "accident.csv", tmp_path / "FARS.zip"
    plain.write_text(TABLE.lower())
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("ACCIDENT.CSV", TABLE)
    counted = count_kinds([plain, packed])
    assert counted == {
        CrashKind.TWO_VEHICLES: 2,
        CrashKind.MULTI_VEHICLE: 2,
        CrashKind.FIXED_OBJECT: 4,
        CrashKind.PEDESTRIAN: 2,
        CrashKind.ANIMAL: 2,
        CrashKind.OTHER: 2,
    }


@pytest.mark.parametrize("content", ["", "A,B\n1,2\n", "VE_FORMS,HARM_EV\nx,y\n"])
def test_a_file_that_is_no_accident_table_is_named(tmp_path: Path, content: str) -> None:
    file = tmp_path / "other.csv"
    file.write_text(content)
    with pytest.raises(UserError, match=r"other\.csv.*HARM_EV"):
        count_kinds([file])


def test_each_kind_comes_through_as_the_stored_ones_do() -> None:
    national = {CrashKind.TWO_VEHICLES: 300, CrashKind.FIXED_OBJECT: 500, CrashKind.CYCLIST: 100, CrashKind.OTHER: 100}
    stored = {
        # 8 of 10 reports say enough; 6 of those have a map at hand, 3 of which are verified: 0.8 * 0.5 = 0.4.
        CrashKind.TWO_VEHICLES: StoredKind(10, 8, 6, 5, 3),
        CrashKind.FIXED_OBJECT: StoredKind(20, 20, 10, 10, 8),  # 1 * 0.8
        CrashKind.OTHER: StoredKind(5, 5, 5, 5, 5),  # not judged: counts for nothing
    }
    found = coverage_of_country(national, stored)
    assert found.two_vehicles == pytest.approx(0.3)
    assert found.judged == pytest.approx(0.9)
    assert found.verified == pytest.approx(0.3 * 0.4 + 0.5 * 0.8)  # no cyclist is stored
    low, high = found.verified_bounds
    assert low < found.verified < high


def test_more_crashes_give_narrower_bounds() -> None:
    national = {CrashKind.FIXED_OBJECT: 100}
    few, many = (
        coverage_of_country(national, {CrashKind.FIXED_OBJECT: StoredKind(n, n, n, n, n // 2)}).verified_bounds
        for n in (10, 1000)
    )
    assert many[1] - many[0] < (few[1] - few[0]) / 5
    # The normal approximation of a share of one half after 1000 crashes: 0.5 +- 1.645 sqrt(0.25 / 1000); that all were
    # complete takes 0.0003 off at most.
    assert many == pytest.approx((0.474, 0.526), abs=0.003)
