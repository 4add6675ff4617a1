"""Agents are ranked over the same cases."""

from __future__ import annotations

import duckdb
import pytest

from trace_dag.warehouse.outcomes import execute_sql

OUTCOMES = {
    "careful": "conflict_avoided collision_avoided unchanged unchanged",
    "trial": "conflict_avoided",
    "blind": "unchanged did_not_arrive worse mitigated",
}


@pytest.fixture
def connection() -> duckdb.DuckDBPyConnection:
    """Two agents took both places in two crashes, one of them avoiding half; the third tried one, and avoided it."""
    connection = duckdb.connect()
    connection.execute(
        "CREATE TABLE evaluations (agent TEXT, key TEXT, case_id TEXT, vehicle_number INTEGER, role TEXT, outcome TEXT,"
        " off_road_s DOUBLE, wrong_way_s DOUBLE, recorded_delta_v_mps DOUBLE, delta_v_mps DOUBLE,"
        " max_deceleration_mps2 DOUBLE, max_jerk_mps3 DOUBLE, traffic TEXT, split TEXT,"
        " min_ttc_s DOUBLE, post_encroachment_time_s DOUBLE, required_deceleration_mps2 DOUBLE,"
        " handed_in BOOLEAN, collided BOOLEAN, finished BOOLEAN,"
        " recorded_serious_injury_risk DOUBLE, serious_injury_risk DOUBLE)"
    )
    for agent, outcomes in OUTCOMES.items():
        for number, outcome in enumerate(outcomes.split()):
            key = f"2023-{1 + number // 2}"
            connection.execute(
                "INSERT INTO evaluations VALUES (?, ?, ?, ?, NULL, ?, 0, 0, 10, 5, 4, 9, 'recorded', NULL, 1, 2, 3,"
                " FALSE, FALSE, TRUE, 0.5, 0.25)",
                [agent, key, key, 1 + number % 2, outcome],
            )
    execute_sql(connection, "leaderboard")
    return connection


def test_an_agent_that_tried_one_case_stands_below_those_that_drove_in_all(connection):
    ranked = connection.sql("SELECT agent, runs, cases FROM leaderboard").fetchall()
    assert ranked == [("careful", 4, 4), ("blind", 4, 4), ("trial", 1, 4)]


def test_agents_are_compared_by_their_margins_too(connection):
    columns = "min_ttc_median_s, post_encroachment_median_s, required_deceleration_median_mps2"
    assert connection.sql(f"SELECT DISTINCT {columns} FROM leaderboard").fetchall() == [(1.0, 2.0, 3.0)]


def test_a_lone_departure_is_no_case(connection):
    connection.execute(
        "INSERT INTO evaluations SELECT * REPLACE ('2023-9' AS key, '2023-9' AS case_id, 'departing' AS role)"
        " FROM evaluations"
    )
    assert connection.sql("SELECT max(runs), max(cases) FROM leaderboard").fetchall() == [(4, 4)]


def test_variations_are_no_cases(connection):
    connection.execute("INSERT INTO evaluations SELECT * REPLACE ('2023-1-v001' AS case_id) FROM evaluations")
    assert connection.sql("SELECT max(runs), max(cases) FROM leaderboard").fetchall() == [(4, 4)]
