"""The catalogue: scenarios by the codes of the reports, and crashes found by words."""

from __future__ import annotations

import json

import sample_runs
from lxml import etree
from sample_runs import trace_dag

from trace_dag.warehouse.query import rows

_SIGNALS = {"1", "2", "3", "4", "8", "9"}  # VTRAFCON
_DARK = {"2", "3", "6"}  # LGT_COND


def _catalogue() -> dict[str, dict]:
    return {row["key"]: row for row in rows(sample_runs.finished() / "warehouse.duckdb", "catalogue")}


def _report(key: str) -> etree._Element:
    return etree.parse(sample_runs.SAMPLE / "reports" / f"crash_{key.partition('-')[2]}.xml").getroot()


def test_scenarios_are_those_of_the_typology() -> None:
    """A left turn across oncoming traffic at lights (ACC_TYPE 68, 69); two that meet head on (50, 51)."""
    found = _catalogue()
    turn, head_on = found["2023-319003"], found["2023-319022"]
    assert turn["pre_crash_scenario"] == "left turn across path from opposite directions at signalised junctions"
    assert head_on["pre_crash_scenario"] == "not making a manoeuvre, opposite direction"
    assert "illumination: night, streetlights" in turn["odd"].split("; ")
    for row in found.values():
        controls = {each.text for each in _report(row["key"]).iter("VTRAFCON")}
        assert row["signalised"] is bool(controls & _SIGNALS), row["key"]


def test_words_find_crashes_whose_reports_have_them_all() -> None:
    done = trace_dag(sample_runs.finished(), "find", "Night", "signalised", "--json")
    assert done.returncode == 0, done.stderr
    wanted = {
        key
        for key in _catalogue()
        if (report := _report(key)).findtext(".//LGT_COND") in _DARK
        and {each.text for each in report.iter("VTRAFCON")} & _SIGNALS
    }
    assert "2023-319003" in wanted
    assert "2023-319012" not in wanted, "at a non-signalised junction"
    assert {row["key"] for row in json.loads(done.stdout)} == wanted


def test_words_that_no_crash_has_are_an_error_in_a_line() -> None:
    done = trace_dag(sample_runs.finished(), "find", "zeppelin's")
    assert done.returncode == 2
    assert done.stderr.strip() == "trace-dag: find zeppelin's: no crash has all of these words; leave one out"
