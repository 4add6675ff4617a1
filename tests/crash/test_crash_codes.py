"""The code tables against NHTSA's own list of codes by year."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import pytest

from trace_dag.common.data_files import read_csv
from trace_dag.crash.codes import elements
from trace_dag.crash.codes.table import UnknownCodeError, code_table

TABLES = {row["variable"]: code_table(row["variable"]) for row in read_csv("trace_dag.crash.codes", "codes.csv")}
OLDER_NAMES = {"MDRMANAV": "MANEUVER"}
WITHOUT_WORDS = ("PEDCTYPE", "BIKECTYPE")  # types of crashes, of which rules take the codes alone
YEARS = range(2014, 2024)


def _nhtsa_codes(shared_data: Path) -> Iterator[tuple[str, int, set[int]]]:
    path = shared_data / "fars-codes.csv"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    with path.open(encoding="utf-8-sig", newline="") as file:
        for row in csv.DictReader(file):
            if row["value"].strip().isdigit():
                years = {year for year in YEARS if row[str(year)]}
                yield OLDER_NAMES.get(row["name_ncsa"], row["name_ncsa"]), int(row["value"]), years


def test_every_code_of_nhtsa_is_held_in_its_years(shared_data: Path) -> None:
    missing = [
        (element, code, year)
        for element, code, years in _nhtsa_codes(shared_data)
        if element in TABLES
        for year in years
        if not TABLES[element].holds(code, year)
    ]
    assert missing == []


def test_no_code_is_held_that_nhtsa_does_not_list_for_the_year(shared_data: Path) -> None:
    listed: dict[str, dict[int, set[int]]] = {}
    for element, code, years in _nhtsa_codes(shared_data):
        listed.setdefault(element, {}).setdefault(code, set()).update(years)
    surplus = [
        (element, code, year)
        for element, table in TABLES.items()
        if element in listed
        for year in YEARS
        # Elements that NHTSA lists from a later year on hold in earlier ones only what other sources carry over.
        if any(year in years for years in listed[element].values())
        for code in table.meanings
        if table.holds(code, year) and year not in listed[element].get(code, set())
    ]
    assert surplus == []


def test_every_code_by_which_nhtsa_types_persons_is_held(shared_data: Path) -> None:
    """``PBTYPE`` of all years. "Not a pedestrian" of a cyclist, and the other way round, says nothing of the person."""
    path = shared_data / "fars-pbtype-codes.csv"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    with path.open(encoding="utf-8", newline="") as file:
        listed = [
            (TABLES[row["element"]], int(row["code"]), row["label"])
            for row in csv.DictReader(file)
            if row["element"] in TABLES
        ]
    assert len({table.element for table, _, _ in listed}) == 15
    assert [(table.element, code) for table, code, _ in listed if not table.holds(code, 2023)] == []
    assert [table.element for table, code, label in listed if "Not a" in label and table.known(code) is not None] == []


def test_every_known_code_is_reported_in_words() -> None:
    silent = [
        (table.element, code)
        for table in TABLES.values()
        if table.element not in WITHOUT_WORDS
        for code in table.meanings
        if code not in table.unknown and not table.meaning(code)
    ]
    assert silent == []


def test_unknown_codes_are_errors_that_name_element_code_and_year() -> None:
    with pytest.raises(UnknownCodeError, match=r"TYP_INT holds '8'.*case year 2023.*1-7, 10-11, 98-99"):
        elements.TYP_INT.check(8, 2023)
    with pytest.raises(UnknownCodeError, match="2019"):
        elements.TYP_INT.check(11, 2019)
    assert elements.TYP_INT.check(11, 2020) == 11


def test_years_beyond_the_tables_are_read_with_the_last_known_codes() -> None:
    assert elements.TYP_INT.holds(11, 2026)
    assert not elements.TYP_INT.holds(12, 2026)


def test_no_code_stands_twice_in_the_table() -> None:
    text = resources.files("trace_dag.crash.codes").joinpath("codes.csv").read_text(encoding="utf-8")
    rows = [(row["variable"], row["code"]) for row in csv.DictReader(text.splitlines())]
    assert len(rows) == len(set(rows)) > 1000
