"""A state and a year: which files they need, and where those are found."""

from __future__ import annotations

import os

import pytest
import sample_runs

from trace_dag.common.errors import UserError
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.public_files import files_of, map_of, tables_of


def test_a_state_with_two_words_is_called_as_geofabrik_calls_it():
    assert map_of(36).url == "https://download.geofabrik.de/north-america/us/new-york-latest.osm.pbf"


def test_states_and_years_need_one_file_each():
    choice = Choice(CohortFilter(states=frozenset({4, 51}), years=frozenset({2015, 2016})))
    assert [each.name for each in files_of(choice)] == [
        "FARS2015NationalCSV.zip",
        "FARS2016NationalCSV.zip",
        "arizona-latest.osm.pbf",
        "virginia-latest.osm.pbf",
    ]
    with pytest.raises(UserError, match="which state and year"):
        files_of(Choice(CohortFilter(states=frozenset({4}))))


def test_files_are_found_under_the_names_that_browsers_and_dates_give_them(tmp_path):
    first, second = tmp_path / "here", tmp_path / "downloads"
    first.mkdir()
    second.mkdir()
    (second / "fars2015nationalcsv (1).zip").touch()
    (second / "virginia-240101.osm.pbf").touch()
    (first / "west-virginia-latest.osm.pbf").touch()
    older = first / "virginia-230101.osm.pbf"
    older.touch()
    os.utime(older, (1, 1))
    (first / "virginia-latest.osm.pbf").touch()
    assert tables_of(2015).found([first, second]) == second / "fars2015nationalcsv (1).zip"
    assert map_of(51).found([first, second]) == first / "virginia-latest.osm.pbf"
    assert map_of(54).found([second]) is None


def test_missing_files_are_named_with_their_source(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    said = sample_runs.trace_dag(tmp_path / "root", "ingest", "--cases", "2023-510179")
    assert said.returncode == 2
    assert "static.nhtsa.gov/nhtsa/downloads/FARS/2023/National/FARS2023NationalCSV.zip" in said.stderr
    assert "download.geofabrik.de/north-america/us/virginia-latest.osm.pbf" in said.stderr
    assert "--download" in said.stderr
