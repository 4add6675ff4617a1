"""The risks of the view against the points of the published curves."""

from __future__ import annotations

import duckdb
import pytest

from trace_dag.common.units import mph_to_mps
from trace_dag.warehouse.outcomes import execute_sql


def risks(
    age_years: int | None,
    struck_mph: float,
    delta_v_mph: float,
    clock_h: float | None,
    *,
    driver_years: int | None = None,
    belted: bool | None = True,
) -> dict[int, tuple[float, ...]]:
    """The rows of one crash by party: a car (1) struck a person (1001) and another car (2)."""
    with duckdb.connect() as connection:
        connection.execute("CREATE TABLE verdicts AS SELECT 'a' AS key, 0 AS hypothesis, 'verified' AS label")
        connection.execute(
            "CREATE TABLE contacts AS SELECT * FROM (VALUES "
            "('a', 0, 1, 1001, $struck, 0.5, 10.0), ('a', 0, 1, 2, 20.0, $delta_v, 1.0)) "
            "AS t(key, hypothesis, party_1, party_2, closing_speed_mps, delta_v_1_mps, delta_v_2_mps)",
            {"struck": mph_to_mps(struck_mph), "delta_v": mph_to_mps(delta_v_mph)},
        )
        connection.execute(
            "CREATE TABLE non_motorists AS SELECT 'a' AS key, 1001 AS party, $age::INTEGER AS age_years WHERE $age > 0",
            {"age": age_years},
        )
        connection.execute(
            "CREATE TABLE vehicles AS SELECT 'a' AS key, unnest([1, 2]) AS vehicle_number, true AS in_transport, "
            "'car' AS vehicle_class, $clock::DOUBLE AS impact_clock_h, $years::INTEGER AS driver_age_years, "
            "$belted::BOOLEAN AS driver_belted, 0 AS occupants_killed",
            {"clock": clock_h, "years": driver_years, "belted": belted},
        )
        execute_sql(connection, "injury_risk")
        rows = connection.execute(
            "SELECT party, severe_risk, fatality_risk, driver_fatality_risk, serious_risk FROM injury_risk"
        ).fetchall()
    return {party: tuple(values) for party, *values in rows}


@pytest.mark.parametrize(("mph", "severe", "death"), [(17.1, 0.10, None), (48.1, 0.90, None), (24.1, None, 0.10)])
def test_a_person_struck_has_the_published_risk(mph: float, severe: float | None, death: float | None) -> None:
    """Tefft 2013: severe injury 10 % at 17.1 mph and 90 % at 48.1, death 10 % at 24.1."""
    found = risks(45, mph, 10.0, 12.0)[1001]
    for value, published in zip(found[:2], (severe, death), strict=True):
        assert published is None or value == pytest.approx(published, abs=0.01)


def test_forty_years_more_are_as_bad_as_twelve_mph_more() -> None:
    """Tefft 2013: at 70 the risk of death is that at 30 of 11.8 mph more."""
    assert risks(70, 30.0, 10.0, 12.0)[1001][1] == pytest.approx(risks(30, 41.8, 10.0, 12.0)[1001][1], abs=1e-6)
    unlisted = risks(None, 30.0, 10.0, 12.0)
    assert unlisted[1001] == risks(45, 30.0, 10.0, 12.0)[1001]


def test_occupants_have_the_published_risks() -> None:
    """Joksch 1993: certain death from 71 mph on, a sixteenth of it at half of that. Richards and Cuerden 2009: belted,
    3 % at 30 mph and 92 % at 60 mph from the front, 90 % at 40 mph from the side."""
    assert risks(45, 10.0, 35.5, 12.0)[1][1] == pytest.approx(1 / 16)
    assert risks(45, 10.0, 80.0, 12.0)[1][1] == 1.0
    assert risks(45, 10.0, 30.0, 12.0)[1][2] == pytest.approx(0.03, abs=0.005)
    assert risks(45, 10.0, 60.0, 1.0)[1][2] == pytest.approx(0.92, abs=0.005)
    assert risks(45, 10.0, 40.0, 9.0)[1][2] == pytest.approx(0.90, abs=0.005)
    assert risks(45, 10.0, 40.0, 6.0)[1][2] is None


def test_belts_and_age_count_as_published() -> None:
    """Kahane 2000: belts take 45 % of the risk of death in cars. Evans 2001: it grows by 2.34 % a year."""
    base = risks(45, 10.0, 30.0, 12.0, driver_years=40)[1][2]
    assert risks(45, 10.0, 30.0, 12.0, driver_years=40, belted=False)[1][2] == pytest.approx(base / 0.55)
    assert risks(45, 10.0, 30.0, 12.0, driver_years=70)[1][2] == pytest.approx(base * 1.0234**30)
    assert risks(45, 10.0, 30.0, 12.0, belted=None)[1][2] == pytest.approx(base)
    assert risks(45, 10.0, 80.0, 9.0, driver_years=90, belted=False)[1][2] == 1.0


def test_occupants_are_seriously_injured_as_published() -> None:
    """Malliaris, Digges and DeBlois 1997: log odds -5.820 + 0.202 per mph, a side 0.556 more, the rear 2.170 less; by
    hand at 30 mph 0.240, 0.796 and -1.930. A direction that is not told: -5.450 + 0.178 x 30 = -0.110."""
    for clock_h, expected in ((12.0, 0.560), (9.0, 0.689), (6.0, 0.127), (None, 0.473)):
        assert risks(45, 10.0, 30.0, clock_h)[1][3] == pytest.approx(expected, abs=0.001)
    assert risks(45, 10.0, 30.0, 12.0)[1001][3] is None
