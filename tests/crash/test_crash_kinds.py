"""The kind of a crash: from codes, from records, and over whole national years; which kinds are judged."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from crash_reports import read, rejection, report, shortcomings

from trace_dag.common.errors import Reason, UserError
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.classes import CrashKind, kind_of_codes
from trace_dag.crash.completeness import RULES, check
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.listing import list_report
from trace_dag.crash.parse import read_report

PERSON = {"VEH_NO": 0, "PER_NO": 1, "PER_TYP": 5, "STR_VEH": 1, "AGE": 40, "LOCATION": 11}
STRUCK = {"SOE": 8, "VNUMBER2": 9999, "AOI2": 77}
ONE = {"VE_FORMS": 1, "VE_TOTAL": 1, "HARM_EV": 8, "MAN_COLL": 0}
SILENT = {"P_CRASH1": 99, "P_CRASH2": 99, "ACC_TYPE": 98, "TRAV_SP": 998}


@pytest.mark.parametrize(
    ("harm_ev", "vehicles", "events", "kind"),
    [
        (8, 1, [8], "pedestrian"),
        (15, 1, [15], "pedestrian"),
        (8, 2, [8, 12], "pedestrian"),
        (9, 3, [9], "cyclist"),
        (14, 1, [63, 14], "parked"),
        (45, 2, [45, 12], "parked"),
        (11, 1, [11], "animal"),
        (49, 2, [49, 12], "animal"),
        (42, 1, [63, 42, 1], "fixed_object"),
        (33, 1, [], "fixed_object"),
        (58, 1, [58], "fixed_object"),
        (1, 1, [64, 1], "overturn"),
        (10, 2, [10, 12], "other"),  # a train
        (18, 1, [18], "lying_object"),  # not fixed
        (54, 2, [54], "other"),  # what the other one lost
        (12, 2, [12], "two_vehicles"),
        (42, 2, [42, 12], "two_vehicles"),
        (42, 2, [63, 42], "fixed_object"),
        (42, 2, [], "two_vehicles"),  # accidents alone do not tell whether the two touched
        (12, 3, [], "multi_vehicle"),
        (1, 4, [1, 12], "multi_vehicle"),
        (None, 2, [63, 1], "overturn"),
        (99, 1, [63], "other"),
        (None, None, [], None),
    ],
)
def test_kinds_of_codes(harm_ev: int | None, vehicles: int | None, events: list[int], kind: str | None) -> None:
    assert kind_of_codes(harm_ev, vehicles, events) == kind


SHARES_PCT = {
    2013: (32.4, 32.0, 15.1, 8.2, 6.2, 2.5, 1.8, 1.2, 0.7),
    2014: (32.9, 31.1, 15.6, 8.1, 6.2, 2.4, 1.9, 1.1, 0.5),
    2015: (34.1, 29.6, 15.9, 7.8, 6.5, 2.5, 1.9, 1.1, 0.6),
}
"""Of all fatal crashes, counted on the national tables by hand: two vehicles (touching first and not), fixed object,
pedestrian, overturn, three and more, cyclist, other (trains and lying objects too), parked, animal."""
ORDER = (
    "two_vehicles",
    "fixed_object",
    "pedestrian",
    "overturn",
    "multi_vehicle",
    "cyclist",
    "other",
    "parked",
    "animal",
)


@pytest.mark.parametrize("year", SHARES_PCT)
def test_shares_of_a_national_year(year: int, shared_data: Path) -> None:
    path = shared_data / "fars-national" / f"FARS{year}-accident.zip"
    if not path.is_file():
        pytest.skip(f"national tables not present at {path}")
    listings = FarsCsvSource.open(path).listings()
    counted = (str(listing.kind) for listing in listings)
    kinds = Counter("other" if kind == "lying_object" else kind for kind in counted)
    shares = [100 * kinds[kind] / len(listings) for kind in ORDER]
    assert shares == pytest.approx(SHARES_PCT[year], abs=0.15)  # both are rounded
    assert kinds.total() == sum(kinds[kind] for kind in ORDER)


def test_kinds_of_a_national_year_by_its_events(shared_data: Path) -> None:
    """Events and persons alone, no accident table: 265 of the 11,933 crashes of two vehicles never had them touch."""
    path = shared_data / "fars-national" / "FARS2016-events-and-persons.zip"
    if not path.is_file():
        pytest.skip(f"national tables not present at {path}")
    listings = FarsCsvSource.open(path).listings()
    assert len(listings) == 34_439
    assert sum(listing.vehicles == 2 for listing in listings) == 11_933
    assert {listing.key.split("-")[0] for listing in listings} == {"2016"}
    assert sum(listing.kind is None for listing in listings) == 0


@pytest.mark.parametrize(
    ("crash", "events"),
    [
        ({}, [{}]),
        (ONE, [STRUCK]),
        ({"HARM_EV": 42, "MAN_COLL": 0}, [STRUCK | {"SOE": 42}, {"EVENTNUM": 2}]),
        ({"HARM_EV": None}, [STRUCK | {"SOE": 1}]),
    ],
)
def test_a_listing_has_the_kind_its_record_has(crash: dict[str, object], events: list[dict[str, object]]) -> None:
    data = report(crash, events=events)
    assert list_report(data, name="report.xml").kind == read(data).kind


def test_real_reports_have_the_kind_of_their_listing(real_reports: dict[str, bytes]) -> None:
    settings = CrashSettings(repair_malformed=True)
    kinds = Counter(
        (read_report(data, name=name, settings=settings).kind, list_report(data, name=name).kind)
        for name, data in real_reports.items()
    )
    assert all(one is other for one, other in kinds)
    # By hand from HARM_EV and SOE of the files.
    assert kinds[CrashKind.PEDESTRIAN, CrashKind.PEDESTRIAN] >= 6


# --- which are judged ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("code", "kind"), [(8, "pedestrian"), (15, "pedestrian"), (9, "cyclist"), (11, "animal")])
def test_a_strike_is_judged(code: int, kind: str) -> None:
    record = read(report(ONE | {"HARM_EV": code}, [{}], [STRUCK | {"SOE": code}]))
    assert record.kind == kind
    assert rejection(record, CrashSettings()) is None


def test_kinds_are_a_filter_of_the_user() -> None:
    record = read(report())
    assert rejection(record, CrashSettings(kinds=("two_vehicles", "pedestrian"))) is None
    found = rejection(record, CrashSettings(kinds=("multi_vehicle",)))
    assert found is not None
    assert found.reason is Reason.OUTSIDE_COHORT
    assert found.detail == "the kind of crash is two_vehicles; the cohort takes multi_vehicle"
    with pytest.raises(UserError, match=r"crash\.kinds: trees is not a kind of crash; kinds are two_vehicles, "):
        check(record, CrashSettings(kinds=("trees",)))


# --- completeness by role ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("own", [{"TRAV_SP": 0}, {"IMPACT1": 6}])
def test_standing_and_rear_struck_vehicles_need_no_course(own: dict[str, int]) -> None:
    crash = {"HARM_EV": 42, "MAN_COLL": 0}
    silent = SILENT | {"VEH_NO": 2}
    events = [{"AOI2": own.get("IMPACT1", 3)}]
    assert shortcomings(read(report(crash, [{"ACC_TYPE": 98}, silent | own], events)), RULES) == []
    assert shortcomings(read(report(crash, [{"ACC_TYPE": 98}, silent | {"IMPACT1": 3}], [{}])), RULES) != []


def test_fields_needed_by_a_crash_with_a_person() -> None:
    def of(vehicle: dict[str, object], person: dict[str, object], zone: int = 1) -> list[str]:
        data = report(ONE | {"REL_ROAD": zone}, [vehicle], [STRUCK], {"NPersons": [("Person", PERSON | person)]})
        return shortcomings(read(data), RULES)

    assert of({}, {}) == []
    (course,) = of(SILENT, {})
    assert course.startswith("nothing tells how vehicle 1 moved")
    assert of({}, {"LOCATION": 99}) == []  # on the roadway, by REL_ROAD
    (place,) = of({}, {"LOCATION": 99}, zone=99)
    assert place == "nothing tells where person 1 was: neither LOCATION nor PEDPOS nor BIKEPOS nor REL_ROAD is known"
