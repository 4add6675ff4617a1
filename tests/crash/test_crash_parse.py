"""Reports in CrashAPI XML to records: what is read, implied, listed as contradictory, and refused."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import pytest
from crash_reports import not_released, own_events, report
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.derive import impact_area, implied_impact_of_damage
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord, Occupant, PreCrashMovement, VehicleClass
from trace_dag.crash.tables import record_from_parquet, record_to_parquet

BROKEN = {"crash_510030.xml": (599, 201), "crash_510108.xml": (970, 47), "crash_510150.xml": (634, 114)}
"""The files that are not well-formed, and where (line, column) xmllint says so."""


def read(data: bytes, settings: CrashSettings, **more: str) -> CrashRecord:
    return read_report(data, name="report.xml", settings=settings, **more)


# --- real reports --------------------------------------------------------------------------------------------------


def test_every_well_formed_report_is_read(real_reports: dict[str, bytes], settings: CrashSettings) -> None:
    records = [
        read_report(data, name=name, settings=settings) for name, data in real_reports.items() if name not in BROKEN
    ]
    assert len(records) == len(real_reports) - len(BROKEN) == 59
    assert not any(record.repaired for record in records)


@pytest.mark.parametrize("name", BROKEN)
def test_malformed_reports_say_where(name: str, real_reports: dict[str, bytes], settings: CrashSettings) -> None:
    line, column = BROKEN[name]
    with pytest.raises(Rejection, match=f"{name}.*line {line}, column {column}") as caught:
        read_report(real_reports[name], name=name, settings=settings)
    assert caught.value.reason is Reason.MALFORMED_REPORT


@pytest.mark.parametrize("name", BROKEN)
def test_malformed_reports_are_repaired_if_allowed_and_marked(name: str, real_reports: dict[str, bytes]) -> None:
    record = read_report(real_reports[name], name=name, settings=CrashSettings(repair_malformed=True))
    assert record.repaired
    assert len(record.vehicles) == 2


def test_published_coverage_of_the_mapped_reports(
    real_reports: dict[str, bytes], mapped_names: set[str], settings: CrashSettings
) -> None:
    """Counted by hand from MAN_COLL, TYP_INT and ACC_TYPE of the 35 files, and never more than the paper's 52."""
    records = [read_report(real_reports[name], name=name, settings=settings) for name in mapped_names]
    assert Counter(record.collision_type.value for record in records) == {
        "angle": 12, "front_to_rear": 3, "front_to_front": 15, "others": 5,
    }  # fmt: skip
    assert Counter(record.road_topology.value for record in records) == {
        "t": 7, "not_an_intersection": 25, "four_way": 3,
    }  # fmt: skip
    trajectories = Counter(record.vehicle_trajectory.value for record in records)
    published = {"same_direction": 4, "opposite_direction": 27, "turning": 9, "intersecting": 7, "others": 5}
    assert trajectories == {"same_direction": 4, "opposite_direction": 16, "turning": 6, "intersecting": 4, "others": 5}
    assert all(trajectories[name] <= count for name, count in published.items())


def test_reading_a_real_report(real_reports: dict[str, bytes], settings: CrashSettings) -> None:
    record = read_report(real_reports["crash_510179.xml"], name="crash_510179.xml", settings=settings)
    assert (record.key, record.state_name, record.county_name) == ("2023-510179", "Virginia", "PETERSBURG (CITY)")
    assert (record.latitude_deg, record.longitude_deg) == pytest.approx((37.22810833, -77.40179167))
    assert (record.trafficway_1, record.trafficway_2) == ("US-301", "WASHINGTON ST")
    assert (record.hour, record.minute, record.weather_code) == (22, 20, None)
    pickup, sedan = record.vehicles
    assert pickup.vehicle_class is VehicleClass.PICKUP
    assert pickup.travel_speed_mps == pytest.approx(77 * 1609.344 / 3600)
    assert pickup.speed_limit_mps == pytest.approx(25 * 1609.344 / 3600)
    assert pickup.speeding is True
    assert pickup.stability_code == 1
    assert (pickup.driver_age_years, pickup.driver_belted, pickup.occupants_killed) == (38, True, 0)
    assert (sedan.driver_age_years, sedan.driver_belted, sedan.occupants_killed) == (28, False, 1)
    assert sedan.occupants == (Occupant(1, 1, 3, 28, 20), Occupant(2, 2, 4, 28, 3))
    assert sedan.impact is not None
    assert sedan.impact.centre_rad == pytest.approx(-math.pi / 2)
    assert (sedan.lanes, sedan.trafficway_code, sedan.crash_type_code) == (4, 4, 87)
    assert [(event.party_1, event.code, event.party_2) for event in record.events] == [(1, 12, 2)]


def test_occupants_are_read_in_order_of_their_numbers(settings: CrashSettings) -> None:
    """FARS Analytical User's Manual: INJ_SEV 9, AGE 998 and REST_USE 99 stand for unknown; PER_TYP 5 is no occupant."""
    passenger = {"PER_NO": 2, "PER_TYP": 2, "INJ_SEV": 4, "AGE": 9, "REST_USE": 12}
    driver = {"PER_NO": 1, "PER_TYP": 1, "INJ_SEV": 0, "AGE": 44, "REST_USE": 3}
    unknown = {"PER_NO": 3, "PER_TYP": 9, "INJ_SEV": 9, "AGE": 998, "REST_USE": 99}
    persons = [("Person", each) for each in (passenger, driver, unknown, {"PER_NO": 4, "PER_TYP": 5})]
    record = read_report(report(vehicles=[{"Persons": persons}, {"VEH_NO": 2}]), name="a report", settings=settings)
    assert record.vehicles[0].occupants == (
        Occupant(1, 1, injury_code=0, age_years=44, restraint_code=3),
        Occupant(2, 2, injury_code=4, age_years=9, restraint_code=12),
        Occupant(3, 9),
    )
    assert (record.vehicles[0].driver_age_years, record.vehicles[0].driver_belted) == (44, True)
    assert record.vehicles[1].occupants == ()


def test_parked_vehicles_are_in_the_record_but_not_in_transport(
    real_reports: dict[str, bytes], settings: CrashSettings
) -> None:
    record = read_report(real_reports["crash_510006.xml"], name="crash_510006.xml", settings=settings)
    assert [(vehicle.number, vehicle.in_transport) for vehicle in record.vehicles] == [(1, True), (2, False)]
    assert record.vehicles[1].impact is not None
    assert record.vehicles[1].impact.code == 11


def test_pedestrians_are_in_the_record(real_reports: dict[str, bytes], settings: CrashSettings) -> None:
    record = read_report(real_reports["crash_510174.xml"], name="crash_510174.xml", settings=settings)
    assert [(person.person_type_code) for person in record.non_motorists] == [5]


# --- values that are not values ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "speed_mph", "lower_bound"),
    [("0", 0, False), ("35", 35, False), ("151", 151, False), ("997", 151, True), ("998", None, False),
     ("999", None, False), ("", None, False), ("Not_Reported", None, False)],
)  # fmt: skip
def test_travel_speed(text: str, speed_mph: float | None, lower_bound: bool, settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[{"TRAV_SP": text}]), settings).vehicles[0]
    expected = None if speed_mph is None else pytest.approx(speed_mph * 0.44704)
    assert vehicle.travel_speed_mps == expected
    assert vehicle.travel_speed_is_lower_bound is lower_bound


@pytest.mark.parametrize(
    ("text", "limit_mph"), [("0", None), ("55", 55), ("98", None), ("99", None), ("Unknown", None)]
)
def test_speed_limit(text: str, limit_mph: float | None, settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[{"VSPD_LIM": text}]), settings).vehicles[0]
    assert vehicle.speed_limit_mps == (None if limit_mph is None else pytest.approx(limit_mph * 0.44704))


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [("77.7777", "777.7777"), ("88.88880000", "888.888800000"), ("99.9999", "999.9999"), ("0", "0"), (None, None),
     ("", ""), ("37.5", "200")],
)  # fmt: skip
def test_unknown_places(latitude: str | None, longitude: str | None, settings: CrashSettings) -> None:
    with pytest.raises(Rejection) as caught:
        read(report({"LATITUDE": latitude, "LONGITUD": longitude}), settings)
    assert caught.value.reason is Reason.INCOMPLETE_LOCATION


def test_unknown_codes_are_none(settings: CrashSettings) -> None:
    record = read(report({"LGT_COND": 9, "RELJCT2": 98, "WEATHER": 99, "HOUR": 99, "MINUTE": 99}), settings)
    assert (record.light_code, record.junction_relation_code, record.weather_code) == (None, None, None)
    assert (record.hour, record.minute) == (None, None)


@pytest.mark.parametrize(
    ("code", "clock_h", "half_width_h"), [(12, 12, 0.5), (3, 3, 0.5), (61, 9, 1.5), (82, 2.25, 0.75), (63, 8.25, 0.75)]
)
def test_impact_areas_are_intervals_of_angles(code: int, clock_h: float, half_width_h: float) -> None:
    area = impact_area(code)
    assert area is not None
    assert area.clock_h == clock_h
    assert math.cos(area.centre_rad) == pytest.approx(math.cos(clock_h * math.pi / 6))
    assert math.sin(area.centre_rad) == pytest.approx(-math.sin(clock_h * math.pi / 6))
    assert area.half_width_rad == pytest.approx(half_width_h * math.pi / 6)


@pytest.mark.parametrize("code", [0, 13, 14, 18, 19, 20, 55, 77, 98, 99, None])
def test_areas_that_are_no_side_of_the_body(code: int | None) -> None:
    assert impact_area(code) is None


# --- what fields imply ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("acc_type", "movement"),
    [(68, PreCrashMovement.TURNING_LEFT),
     (78, PreCrashMovement.TURNING_RIGHT),
     (21, PreCrashMovement.STOPPED),
     (46, PreCrashMovement.CHANGING_LANES),
     (86, PreCrashMovement.GOING_STRAIGHT), (13, PreCrashMovement.GOING_STRAIGHT)],
)  # fmt: skip
def test_movement_from_the_crash_type(acc_type: int, movement: PreCrashMovement, settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[{"P_CRASH1": 99, "ACC_TYPE": acc_type}]), settings).vehicles[0]
    assert vehicle.movement is movement
    assert "movement" in vehicle.implied


def test_going_straight_on_a_curve_is_following_it(settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[{"P_CRASH1": None, "ACC_TYPE": 50, "VALIGN": 3}]), settings).vehicles[0]
    assert vehicle.movement is PreCrashMovement.NEGOTIATING_CURVE


def test_reported_movements_are_kept(settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[{"P_CRASH1": 3, "ACC_TYPE": 68}]), settings).vehicles[0]
    assert vehicle.movement is PreCrashMovement.ACCELERATING
    assert vehicle.implied == ()


def test_crash_type_from_the_partner(settings: CrashSettings) -> None:
    first, second = read(
        report(vehicles=[{"ACC_TYPE": 88}, {"VEH_NO": 2, "ACC_TYPE": None, "IMPACT1": None}], events=[]), settings
    ).vehicles
    assert first.crash_type_code == 88
    assert second.crash_type_code == 89
    assert second.impact is not None
    assert second.impact.clock_h == 9
    assert {"crash_type_code", "impact"} <= set(second.implied)


def test_impact_from_the_collision_where_the_vehicle_hit_something_else_before(settings: CrashSettings) -> None:
    events = [
        {"EVENTNUM": 1, "SOE": 33, "VNUMBER1": 1, "AOI1": 2, "VNUMBER2": 9999, "AOI2": 77},
        {"EVENTNUM": 2, "SOE": 12, "AOI1": 12},
    ]
    vehicle = read(report(vehicles=[{"IMPACT1": 2}, {"VEH_NO": 2}], events=events), settings).vehicles[0]
    assert vehicle.initial_impact_code == 2
    assert vehicle.impact is not None
    assert vehicle.impact.code == 12
    assert "impact" in vehicle.implied


def test_impact_from_the_manner_of_collision(settings: CrashSettings) -> None:
    vehicles = [{"IMPACT1": 12, "ACC_TYPE": 98}, {"VEH_NO": 2, "IMPACT1": 98, "ACC_TYPE": 98}]
    second = read(report({"MAN_COLL": 1}, vehicles, events=[]), settings).vehicles[1]
    assert second.impact is not None
    assert second.impact.clock_h == 6


def test_impact_from_damage_lying_together() -> None:
    area = implied_impact_of_damage((2, 3, 4))
    assert area is not None
    assert area.clock_h == pytest.approx(3)
    assert area.half_width_rad == pytest.approx(1.5 * math.pi / 6)
    assert implied_impact_of_damage((12, 6)) is None
    assert implied_impact_of_damage((15,)) is None


@given(st.sets(st.integers(1, 12), min_size=1, max_size=4))
def test_damage_implies_an_area_that_covers_it(codes: set[int]) -> None:
    area = implied_impact_of_damage(tuple(codes))
    if area is not None:
        for code in codes:
            position = -code * math.pi / 6
            assert abs(math.remainder(position - area.centre_rad, math.tau)) <= area.half_width_rad + 1e-9


def test_events_from_the_vehicles_own_sequences(settings: CrashSettings) -> None:
    vehicles = [
        {"Vsoes": own_events((68, 55), (12, 12), (42, 1))},
        {"VEH_NO": 2, "Vsoes": own_events((12, 9), (1, 0))},
    ]
    record = read(report(vehicles=vehicles, events=[]), settings)
    assert "events" in record.implied
    seen = [
        (
            event.party_1,
            event.code,
            event.area_1 and event.area_1.code,
            event.party_2,
            event.area_2 and event.area_2.code,
        )
        for event in record.events
    ]
    assert seen == [(1, 68, None, None, None), (1, 12, 12, 2, 9), (1, 42, 1, 2003, None), (2, 1, None, None, None)]


def test_topology_from_the_relation_to_a_junction(settings: CrashSettings) -> None:
    record = read(report({"TYP_INT": 99, "RELJCT2": 1}), settings)
    assert record.road_topology == "not_an_intersection"
    assert "road_topology" in record.implied


def test_functional_class_of_older_years(settings: CrashSettings) -> None:
    record = read(report({"FUNC_SYS": None, "RUR_URB": None, "ROAD_FNC": 14}), settings)
    assert (record.function_class_code, record.rural_urban_code) == (4, 2)


@pytest.mark.parametrize(
    ("elements", "expected"),
    [({"BODY_TYP": 66, "TOW_VEH": 1}, VehicleClass.TRACTOR_TRAILER), ({"BODY_TYP": 66}, VehicleClass.TRUCK),
     ({"BODY_TYP": 99, "GVWR_TO": 18}, VehicleClass.TRUCK), ({"BODY_TYP": 99, "GVWR_TO": 99}, VehicleClass.CAR),
     ({"BODY_TYP": 80}, VehicleClass.MOTORCYCLE), ({"BODY_TYP": None, "MODEL": 471}, VehicleClass.PICKUP),
     ({"BODY_TYP": 99, "VPICBODYCLASS": 7}, VehicleClass.SUV), ({"BODY_TYP": None, "GVWR": 3}, VehicleClass.TRUCK),
     ({"BODY_TYP": 99}, VehicleClass.CAR)],
)  # fmt: skip
def test_vehicle_class(elements: dict[str, int | None], expected: VehicleClass, settings: CrashSettings) -> None:
    vehicle = read(report(vehicles=[elements]), settings).vehicles[0]
    assert vehicle.vehicle_class is expected
    assert ("vehicle_class" in vehicle.implied) == (elements.get("BODY_TYP") in (None, 99))


@pytest.mark.parametrize(
    ("elements", "length_m", "whole_m", "mass_kg"),
    [({"BODY_TYP": 66, "TOW_VEH": 1}, 16.15, 21.14, 16700),  # 53 ft, 7.0 m of tractor that it overlaps by 2.01 m
     ({"BODY_TYP": 66, "TOW_VEH": 2}, 16.15, 21.14, 16700), ({"BODY_TYP": 34, "TOW_VEH": 1}, 5.0, 12.1, 1500),
     ({"BODY_TYP": 63, "TOW_VEH": 1, "TRLR1GVWR": 12}, 6.5, 17.15, 3402),  # three quarters of 10,000 lb
     ({"BODY_TYP": 4, "TOW_VEH": 5}, 4.85, None, 1600), ({"BODY_TYP": 66, "TOW_VEH": 0}, None, None, None)],
)  # fmt: skip
def test_trailers_of_a_vehicle(
    elements: dict[str, int | None],
    length_m: float | None,
    whole_m: float | None,
    mass_kg: float | None,
    settings: CrashSettings,
) -> None:
    """Lengths by 23 CFR 658.13 and makers' data, the hitch 0.15 m behind the bumper and drawbars of 1.2 and 1.5 m."""
    record = read(report(vehicles=[elements | {"J_KNIFE": 2}]), settings)
    stored = record_from_parquet(record_to_parquet(record))
    vehicle = stored.vehicles[0]
    assert vehicle.jackknife_code == 2
    if length_m is None:
        assert vehicle.trailer is None
        return
    assert vehicle.trailer is not None
    assert (vehicle.trailer.length_m, vehicle.trailer.mass_kg) == (length_m, mass_kg)
    if whole_m is not None:
        assert vehicle.trailer.combination_length_m == pytest.approx(whole_m, abs=0.01)


def test_bodies_follow_the_vin(settings: CrashSettings) -> None:
    derived = [("VINDerived", {"CurbWeightLB": "3485", "WheelBaseIN_from": "111"})]
    vehicle = read(report(vehicles=[{"VinDeriveds": derived}]), settings).vehicles[0]
    assert vehicle.mass_kg == pytest.approx(3485 * 0.4536 + 80, abs=1)
    assert 4.6 < vehicle.length_m < 5.1


# --- contradictions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("crash", "vehicles", "says"),
    [
        ({}, [{"ACC_TYPE": 21}, {"VEH_NO": 2, "ACC_TYPE": 20}], "vehicle 1: IMPACT1 says 12, but ACC_TYPE 21"),
        ({"MAN_COLL": 1}, [{}, {"VEH_NO": 2, "IMPACT1": 12}], "MAN_COLL 1"),
        (
            {},
            [{"ACC_TYPE": 68}, {"VEH_NO": 2, "ACC_TYPE": 51}],
            "ACC_TYPE puts vehicles 1 and 2 into different classes",
        ),
        ({}, [{"P_CRASH1": 5, "TRAV_SP": 40}, {"VEH_NO": 2}], "TRAV_SP 40 mph"),
        ({}, [{"P_CRASH1": 10, "ACC_TYPE": 68}, {"VEH_NO": 2}], "turning right"),
        ({"TYP_INT": 1, "RELJCT2": 2}, [{}, {"VEH_NO": 2}], "TYP_INT says not an intersection"),
        ({"MAN_COLL": 0}, [{}, {"VEH_NO": 2}], "does not agree with HARM_EV 12"),
        ({"VE_FORMS": 3}, [{}, {"VEH_NO": 2}], "VE_FORMS says 3"),
        ({}, [{"ACC_TYPE": 86}, {"VEH_NO": 2, "ACC_TYPE": 89}], "ACC_TYPE 86 and 89 are not a pair"),
        ({}, [{"ACC_TYPE": 1}, {"VEH_NO": 2, "ACC_TYPE": 6}], "is that of a single vehicle"),
        (
            {"TYP_INT": 1, "RELJCT2": 1, "TWAY_ID": "A ST", "TWAY_ID2": "B ST"},
            [{}, {"VEH_NO": 2}],
            "TWAY_ID2 names one",
        ),
        (
            {"TYP_INT": 2, "RELJCT2": 2, "TWAY_ID": "A ST", "TWAY_ID2": ""},
            [{}, {"VEH_NO": 2}],
            "names no second street",
        ),
        ({"FUNC_SYS": 1, "TWAY_ID": "A ST"}, [{}, {"VEH_NO": 2}], "FUNC_SYS says an interstate, but TWAY_ID is A ST"),
        ({"FUNC_SYS": 3, "TWAY_ID": "I-95"}, [{}, {"VEH_NO": 2}], "TWAY_ID is I-95, but FUNC_SYS"),
        ({"ROUTE": 6, "FUNC_SYS": 3, "TWAY_ID": "US-1"}, [{}, {"VEH_NO": 2}], "TWAY_ID is US-1, but ROUTE says"),
        ({}, [{"VTRAFWAY": 1, "VNUM_LAN": 1}, {"VEH_NO": 2}], "one lane for both ways"),
        (
            {"TYP_INT": 1, "RELJCT2": 1, "TWAY_ID2": ""},
            [{"ACC_TYPE": 68}, {"VEH_NO": 2, "ACC_TYPE": 69}],
            "needs a junction or driveway",
        ),
        (
            {},
            [{"ACC_TYPE": 69, "IMPACT1": 4}, {"VEH_NO": 2, "ACC_TYPE": 68, "IMPACT1": 2}],
            "has the other on its left or ahead",
        ),
        (
            {},
            [{"ACC_TYPE": 83, "IMPACT1": 4}, {"VEH_NO": 2, "ACC_TYPE": 82, "IMPACT1": 9}],
            "both vehicles struck on a side",
        ),
    ],
)
def test_contradictions_are_listed(
    crash: dict[str, object], vehicles: list[dict[str, object]], says: str, settings: CrashSettings
) -> None:
    record = read(report(crash, vehicles), settings)
    assert any(says in sentence for sentence in record.contradictions), record.contradictions
    assert record.contradictions[0] in record.summary


def test_a_consistent_report_contradicts_nothing(settings: CrashSettings) -> None:
    record = read(report(), settings)
    assert record.contradictions == ()
    assert record.implied == ()


# --- refused -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "reason", "says"),
    [
        (not_released(), Reason.NOT_RELEASED, "Count 0"),
        (b"", Reason.MALFORMED_REPORT, "line 1"),
        (b"<html><body>Service unavailable</body></html>", Reason.MALFORMED_REPORT, "<html>"),
        (report()[:-200], Reason.MALFORMED_REPORT, "line"),
        (report({"TYP_INT": 8}), Reason.MALFORMED_REPORT, r"TYP_INT holds '8'.*2023"),
        (report(vehicles=[{"P_CRASH1": 42}]), Reason.MALFORMED_REPORT, r"P_CRASH1 holds '42'.*2023"),
        (report(vehicles=[{"TRAV_SP": 152}]), Reason.MALFORMED_REPORT, r"TRAV_SP holds '152'.*2023"),
        (report(vehicles=[{"PCRASH4NAME": "Flying"}]), Reason.MALFORMED_REPORT, "flying"),
        (report(vehicles=[{"VEH_NO": "one"}]), Reason.MALFORMED_REPORT, "'one'; expected a whole number"),
        (report(vehicles=[{}, {}]), Reason.MALFORMED_REPORT, "vehicle number 1 is given 2 times"),
        (report({"ST_CASE": None}), Reason.MALFORMED_REPORT, "ST_CASE is missing"),
        (report({"ST_CASE": "../../etc"}), Reason.MALFORMED_REPORT, "whole number"),
        (report({"ST_CASE": 12}), Reason.MALFORMED_REPORT, "five or six digit"),
        (report({"CaseYear": 1995}), Reason.MALFORMED_REPORT, "2010"),
        (report({"State": 6}), Reason.MALFORMED_REPORT, "does not agree with ST_CASE"),
    ],
)  # fmt: skip
def test_unreadable_files_give_the_reason(data: bytes, reason: Reason, says: str, settings: CrashSettings) -> None:
    with pytest.raises(Rejection, match=says) as caught:
        read(data, settings)
    assert caught.value.reason is reason


def test_another_crashs_report_is_refused(settings: CrashSettings) -> None:
    with pytest.raises(Rejection, match="is the report of crash 2023-519001; expected crash 2023-510002"):
        read(report(), settings, expected_key="2023-510002")


def test_codes_are_those_of_the_year(settings: CrashSettings) -> None:
    data = report(vehicles=[{"VTRAFWAY": 7}])
    assert read(data, settings).vehicles[0].trafficway_code == 7
    with pytest.raises(Rejection, match=r"VTRAFWAY holds '7'.*2016"):
        read(report({"CaseYear": 2016, "YEAR": 2016}, vehicles=[{"VTRAFWAY": 7}]), settings)


@pytest.mark.parametrize(
    "prologue",
    [
        b'<!DOCTYPE lolz [<!ENTITY lol "lol"><!ENTITY lol2 "&lol;&lol;&lol;">]>',
        b'<!DOCTYPE r SYSTEM "http://127.0.0.1:9/evil.dtd">',
        b'<!doctype r [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
def test_document_types_are_refused_unread(prologue: bytes, encoding: str, settings: CrashSettings) -> None:
    body = report().decode().split("?>", 1)[1]
    text = f"<?xml version='1.0' encoding='{encoding}'?>{prologue.decode()}{body}"
    with pytest.raises(Rejection, match="document type") as caught:
        read(text.encode(encoding), settings)
    assert caught.value.reason is Reason.MALFORMED_REPORT


def test_other_encodings_are_read(settings: CrashSettings) -> None:
    text = report({"TWAY_ID": "PEÑA BLVD"}).decode().replace("UTF-8", "ISO-8859-1")
    assert read(text.encode("latin-1"), settings).trafficway_1 == "PEÑA BLVD"


def test_namespaces_do_not_matter(settings: CrashSettings) -> None:
    data = report().replace(b"<ResponseOfListOfCaseDetail>", b'<ResponseOfListOfCaseDetail xmlns="http://x/y">')
    assert read(data, settings).key == "2023-519001"


def test_the_summary_gives_the_crash(settings: CrashSettings) -> None:
    summary = read(report(), settings).summary
    for words in (
        "two motor vehicles in transport on January 5, 2023 at 14:40",
        "US-1 and MAIN ST",
        "a four-way intersection",
        "35 mph (limit 35 mph)",
        "vehicle 1 (at 12 o'clock (front)) collided with vehicle 2 (at 3 o'clock (right))",
    ):
        assert words in summary


def test_summaries_hold_no_codes_or_blanks(real_reports: dict[str, bytes]) -> None:
    settings = CrashSettings(repair_malformed=True)
    for name, data in real_reports.items():
        summary = read_report(data, name=name, settings=settings).summary
        assert "None" not in summary
        assert "  " not in summary
        assert " ." not in summary


def test_names_of_files_never_reach_the_key(settings: CrashSettings, tmp_path: Path) -> None:
    record = read_report(report(), name=str(tmp_path / ".." / "x"), settings=settings)
    assert record.key == "2023-519001"


@pytest.mark.parametrize(("code", "trailers"), [(0, 0), (2, 2), (9, None), (None, None)])
def test_trailers_are_not_counted_where_the_report_does_not_say(
    code: int | None, trailers: int | None, settings: CrashSettings
) -> None:
    record = read(report(vehicles=[{"TOW_VEH": code}, {"VEH_NO": 2}]), settings)
    assert record.vehicles[0].trailers == trailers


@pytest.mark.parametrize(
    ("charge", "factor", "disobeyed"),
    [(31, 0, True), (0, 39, True), (0, 0, False), (36, 28, False), (99, 99, None), (None, None, None)],
)
def test_a_driver_disobeyed_its_light_or_sign_if_charged_or_noted(
    charge: int | None, factor: int | None, disobeyed: bool | None, settings: CrashSettings
) -> None:
    """31 is a red light, 39 a factor of signs and signals, 36 a railway crossing, 28 the use of lanes."""
    tables = {
        "Violations": f"<Violation><VEH_NO>1</VEH_NO><VIOLATION>{charge}</VIOLATION></Violation>",
        "DrierRFs": f"<DriverRF><VEH_NO>1</VEH_NO><DRIVERRF>{factor}</DRIVERRF></DriverRF>",
    }
    lists = "".join(f"<{name}>{row}</{name}>" for name, row in tables.items() if "None" not in row)
    data = report().replace(b"</Vehicle>", f"{lists}</Vehicle>".encode(), 1)
    assert [each.disobeyed_control for each in read(data, settings).vehicles] == [disobeyed, None]
