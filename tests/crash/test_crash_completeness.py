"""Which records say enough, and what the others are rejected for."""

from __future__ import annotations

import pytest
from crash_reports import rejection, report, shortcomings

from trace_dag.common.errors import Reason, Rejection, UserError
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.completeness import OF_VERDICTS, RULES, Rule, check, filters_of
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parse import read_report
from trace_dag.crash.parties import EventKind

DEPARTED = {"SOE": 65, "VNUMBER1": 2, "VNUMBER2": 5555}
SILENT = {"P_CRASH1": 99, "P_CRASH2": 99, "ACC_TYPE": 98, "TRAV_SP": 998}
"""Codes of a vehicle that say nothing about how it moved."""


def test_every_mapped_report_is_complete(
    real_reports: dict[str, bytes], mapped_names: set[str], settings: CrashSettings
) -> None:
    assert len(mapped_names) == 35
    for name in mapped_names:
        record = read_report(real_reports[name], name=name, settings=settings)
        assert shortcomings(record, (*filters_of(settings), *RULES)) == []


def test_every_real_report_has_a_crash_that_can_be_simulated(
    real_reports: dict[str, bytes], settings: CrashSettings
) -> None:
    """Of 2023-510130, too: a motorcycle overturns, and what it sets in motion strikes a car, which is not modelled."""
    records = {
        name: read_report(data, name=name, settings=CrashSettings(repair_malformed=True))
        for name, data in real_reports.items()
    }
    assert [name for name, record in records.items() if rejection(record, settings)] == []
    sequence = sequence_of(records["crash_510130.xml"])
    assert sequence.first.kind is EventKind.OVERTURN
    assert [event.code for event in sequence.not_modelled] == [54]


OFF_RIGHT = {"SOE": 63, "VNUMBER2": 5555}
TREE = {"SOE": 42, "VNUMBER2": 9999, "AOI2": 77}


@pytest.mark.parametrize(
    ("crash", "events", "reason"),
    [
        ({"HARM_EV": 42, "MAN_COLL": 0}, [TREE], Reason.INCOMPLETE_TRAJECTORY),  # to which side did it leave the road?
        ({"HARM_EV": 42, "MAN_COLL": 0}, [OFF_RIGHT, TREE | {"EVENTNUM": 2}, {"EVENTNUM": 3}], None),
        ({"HARM_EV": 42}, [{}], None),
        ({"HARM_EV": 12}, [TREE, {"EVENTNUM": 2}], None),
        ({"HARM_EV": 42}, [], Reason.INCOMPLETE_SEQUENCE),
        ({"HARM_EV": 12}, [], None),
        ({"HARM_EV": 54}, [{"SOE": 54}], Reason.NOT_MODELLED),
        ({"HARM_EV": 12}, [{"SOE": 54}], Reason.INCOMPLETE_SEQUENCE),  # who met whom?
        ({"HARM_EV": 8}, [{}], Reason.INCOMPLETE_SEQUENCE),  # who struck the person?
        ({"HARM_EV": 99}, [], Reason.INCOMPLETE_SEQUENCE),
        ({"HARM_EV": None}, [{"SOE": 99, "VNUMBER2": 9999}], Reason.INCOMPLETE_SEQUENCE),
        ({"HARM_EV": 12}, [{"VNUMBER2": 7}, {"EVENTNUM": 2}], None),  # there is only one other vehicle
    ],
)
def test_a_crash_begins_with_an_event_that_the_report_gives(
    crash: dict[str, object], events: list[dict[str, object]], reason: Reason | None, settings: CrashSettings
) -> None:
    record = read_report(report(crash, events=events), name="report.xml", settings=settings)
    found = rejection(record, settings)
    assert (found and found.reason) is reason


def test_any_number_of_vehicles_if_the_cohort_does_not_ask(settings: CrashSettings) -> None:
    single = read_report(report({"VE_FORMS": 1}, vehicles=[{}]), name="report.xml", settings=settings)
    for wanted in (None, 1):
        assert shortcomings(single, filters_of(CrashSettings(vehicles=wanted))) == []
    with pytest.raises(Rejection, match="outside_cohort: 1 motor vehicle in transport; the cohort takes 2"):
        check(single, CrashSettings(vehicles=2))


def test_stated_facts_count_even_if_a_vehicle_is_not_listed(settings: CrashSettings) -> None:
    record = read_report(report({"VE_FORMS": 3}), name="report.xml", settings=settings)
    with pytest.raises(Rejection, match="3 motor vehicles in transport"):
        check(record, CrashSettings(vehicles=2))


@pytest.mark.parametrize(
    ("crash", "vehicles", "reason"),
    [
        ({"LATITUDE": "48.1", "LONGITUD": "11.6"}, None, Reason.INCOMPLETE_LOCATION),
        ({"LONGITUD": "77.5"}, None, Reason.INCOMPLETE_LOCATION),
        ({"TYP_INT": 99, "RELJCT2": 98}, None, Reason.INCOMPLETE_TOPOLOGY),
        ({"TYP_INT": None, "RELJCT2": None}, None, Reason.INCOMPLETE_TOPOLOGY),
        ({"MAN_COLL": 0}, [SILENT, SILENT | {"VEH_NO": 2}], Reason.INCOMPLETE_TRAJECTORY),
        (
            {"MAN_COLL": 0},
            [SILENT | {"P_CRASH1": 1}, SILENT | {"VEH_NO": 2, "P_CRASH1": 0}],
            Reason.INCOMPLETE_TRAJECTORY,
        ),
        ({"VE_FORMS": 2}, [], Reason.INCOMPLETE_SEQUENCE),
    ],
)
def test_incomplete(
    crash: dict[str, object], vehicles: list[dict[str, object]] | None, reason: Reason, settings: CrashSettings
) -> None:
    record = read_report(report(crash, vehicles), name="report.xml", settings=settings)
    with pytest.raises(Rejection) as caught:
        check(record, settings)
    assert caught.value.reason is reason


@pytest.mark.parametrize(
    ("crash", "first", "second", "events"),
    [
        ({}, {"P_CRASH1": 1}, {"P_CRASH1": 11}, []),
        ({}, {"ACC_TYPE": 13}, {"P_CRASH1": 14}, []),
        ({}, {"ACC_TYPE": 50}, {}, []),
        ({}, {"P_CRASH2": 54}, {"P_CRASH2": 62}, []),
        ({"MAN_COLL": 2}, {}, {}, [{}]),
        ({"MAN_COLL": 0}, {"P_CRASH1": 1}, {}, [DEPARTED, {"EVENTNUM": 2}]),
        ({"MAN_COLL": 0}, {"P_CRASH1": 1}, {"TRAV_SP": 0}, [{}]),
    ],
)
def test_any_field_that_gives_the_trajectory_will_do(
    crash: dict[str, object],
    first: dict[str, object],
    second: dict[str, object],
    events: list[dict[str, object]],
    settings: CrashSettings,
) -> None:
    vehicles = [SILENT | first, SILENT | {"VEH_NO": 2} | second]
    check(read_report(report(crash, vehicles, events), name="report.xml", settings=settings), settings)


UNTOLD = {"IMPACT1": 99, "ACC_TYPE": 98}


@pytest.mark.parametrize(
    ("first", "second", "areas", "lacks"),
    [
        (UNTOLD, UNTOLD, 99, "nothing tells on which side vehicle 1 and vehicle 2 were struck"),
        ({"IMPACT1": 12, "ACC_TYPE": 98}, UNTOLD, 99, None),
        (UNTOLD, UNTOLD, 6, None),
    ],
)
def test_one_area_of_impact_has_to_be_known(
    first: dict[str, object], second: dict[str, object], areas: int, lacks: str | None, settings: CrashSettings
) -> None:
    data = report({}, [first, {"VEH_NO": 2} | second], [{"AOI1": areas, "AOI2": 99}])
    found = shortcomings(read_report(data, name="report.xml", settings=settings), OF_VERDICTS)
    assert found == ([] if lacks is None else [lacks])


def test_a_relation_to_a_junction_is_enough_topology(settings: CrashSettings) -> None:
    check(read_report(report({"TYP_INT": 98, "RELJCT2": 2}), name="report.xml", settings=settings), settings)


def test_further_rules_reject_with_their_own_reason(settings: CrashSettings) -> None:
    record = read_report(report({"LGT_COND": 2}), name="report.xml", settings=settings)
    daylight = Rule(
        "daylight",
        Reason.OUTSIDE_COHORT,
        "in daylight",
        lambda crash: None if crash.light_code == 1 else f"light {crash.light_code}; the cohort takes daylight",
    )
    with pytest.raises(Rejection, match="the cohort takes daylight"):
        check(record, settings, further=[daylight])
    assert shortcomings(record, [daylight, *RULES]) == ["light 2; the cohort takes daylight"]


@pytest.mark.parametrize(
    ("filters", "lacks"),
    [
        ({"LGT_COND": (2, 3)}, None),
        ({"LGT_COND": (1,)}, "LGT_COND is 2; the cohort takes 1"),
        ({"WEATHER": (1, 10)}, "WEATHER is not reported; the cohort takes 1 or 10"),
        ({"VSURCOND": (1,)}, "VSURCOND of vehicle 2 is 2; the cohort takes 1"),
        ({"VSURCOND": (1, 2)}, None),
    ],
)
def test_filters_of_the_settings_take_only_codes_they_name(
    filters: dict[str, tuple[int, ...]], lacks: str | None
) -> None:
    taking = CrashSettings(filters=filters)
    record = read_report(
        report({"LGT_COND": 2, "WEATHER": 99}, [{"VSURCOND": 1}, {"VEH_NO": 2, "VSURCOND": 2}]),
        name="report.xml",
        settings=taking,
    )
    assert shortcomings(record, filters_of(taking)) == ([] if lacks is None else [lacks])


def test_a_filter_on_no_element_is_one_line() -> None:
    with pytest.raises(UserError, match=r"LIGHT_COND is not an element of a record; filters can be on .*LGT_COND"):
        filters_of(CrashSettings(filters={"LIGHT_COND": (1,)}))


def test_rules_are_the_papers() -> None:
    assert [rule.reason for rule in RULES] == [
        Reason.INCOMPLETE_LOCATION,
        Reason.INCOMPLETE_TOPOLOGY,
        Reason.INCOMPLETE_TRAJECTORY,
    ]
