"""What reports say, as codes and in words: held to the reports' own elements, read without the program."""

from __future__ import annotations

import sample_runs
from lxml import etree

from trace_dag.warehouse.query import query, rows


def reported(key: str) -> etree._Element:
    """The report of a crash of the sample as it is."""
    return etree.parse(sample_runs.SAMPLE / "reports" / f"crash_{key.partition('-')[2]}.xml").getroot()


def texts(report: etree._Element, element: str) -> list[str]:
    return [each.text for each in report.iter(element)]


def read_crashes() -> list[dict]:
    """The crashes whose report was read."""
    return [row for row in rows(sample_runs.finished() / "warehouse.duckdb", "crashes") if row["summary"]]


def test_codes_of_crashes_are_those_of_their_reports():
    crashes = read_crashes()
    assert crashes
    elements = {
        "light_code": "LGT_COND",
        "weather_code": "WEATHER",
        "manner_of_collision_code": "MAN_COLL",
        "intersection_type_code": "TYP_INT",
        "minute": "MINUTE",
    }
    for row in crashes:
        report = reported(row["key"])
        for column, element in elements.items():
            if row[column] is not None:
                assert str(row[column]) == texts(report, element)[0], (row["key"], column)
        assert (row["light"] == "in daylight") is (texts(report, "LGT_COND")[0] == "1")


def test_codes_of_vehicles_are_those_of_their_reports():
    vehicles = rows(sample_runs.finished() / "warehouse.duckdb", "vehicles")
    assert vehicles
    for row in vehicles:
        report = reported(row["key"])
        (vehicle,) = (
            parent
            for each in report.iter("VTRAFWAY")
            if (parent := each.getparent()).findtext("VEH_NO") == str(row["vehicle_number"])
        )
        assert str(row["trafficway_code"]) == vehicle.findtext("VTRAFWAY")
        assert (row["trafficway"] == "a two-way undivided road") is (row["trafficway_code"] == 1)
        if vehicle.findtext("DR_DRINK") is not None:
            assert row["driver_drinking"] is (vehicle.findtext("DR_DRINK") == "1")


def test_head_on_and_undivided_in_the_dark_is_one_query():
    """The query of the tutorial; the count is taken from the reports."""
    expected = 0
    for row in read_crashes():
        report = reported(row["key"])
        expected += (
            texts(report, "MAN_COLL")[0] == "2"
            and texts(report, "LGT_COND")[0] in ("2", "3", "6")
            and set(texts(report, "VTRAFWAY")) <= {"1", "5"}
        )
    found = query(
        sample_runs.finished() / "warehouse.duckdb",
        "SELECT count(*) FROM crashes WHERE manner_of_collision_code = 2 AND light_code IN (2, 3, 6) AND key IN"
        " (SELECT key FROM vehicles GROUP BY key HAVING bool_and(trafficway_code IN (1, 5)))",
    )
    assert found[1] == [(expected,)]
