"""Which vehicle met which, of three and more and of parked ones: the contacts a crash is made from, or what is open."""

from __future__ import annotations

from typing import Any

import pytest
from crash_reports import read, report

from trace_dag.crash.completeness import check
from trace_dag.crash.contacts import contacts_of, untold_contact
from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Reason, Rejection
from trace_dag.settings import CrashSettings

THREE = {"VE_FORMS": 3, "VE_TOTAL": 3}
VEHICLES: list[dict[str, Any]] = [{}, {"VEH_NO": 2}, {"VEH_NO": 3}]
FIRST = {"VNUMBER1": 1, "VNUMBER2": 2, "AOI1": 12, "AOI2": 6}
SECOND = {"EVENTNUM": 2, "VNUMBER1": 2, "VNUMBER2": 3, "AOI1": 12, "AOI2": 6}
PARKED = {"VE_FORMS": 1, "VE_TOTAL": 2, "HARM_EV": 14, "MAN_COLL": 0, "REL_ROAD": 7}


def rejection(record: CrashRecord) -> Rejection:
    with pytest.raises(Rejection) as caught:
        check(record, CrashSettings())
    return caught.value


def test_every_contact_counts_in_the_order_of_its_event() -> None:
    record = read(
        report(THREE, VEHICLES, [FIRST, {"EVENTNUM": 2, "SOE": 1, "VNUMBER2": 5555}, SECOND | {"EVENTNUM": 3}])
    )
    contacts = contacts_of(record)
    assert reconstruction_of(record) is Reconstruction.CONTACTS
    assert [(contact.event_number, contact.pair) for contact in contacts] == [(1, (1, 2)), (3, (2, 3))]
    assert [[area and area.clock_h for _, area in contact.sides] for contact in contacts] == [[12, 6], [12, 6]]
    check(record, CrashSettings())


def test_what_follows_at_once_between_the_same_two_is_one_contact() -> None:
    again = FIRST | {"EVENTNUM": 2, "AOI1": 99, "AOI2": 99}
    later = FIRST | {"EVENTNUM": 4}
    third = {"EVENTNUM": 3, "VNUMBER1": 1, "VNUMBER2": 3, "AOI1": 12, "AOI2": 3}
    contacts = contacts_of(read(report(THREE, VEHICLES, [FIRST, again, third, later])))
    assert [(contact.event_number, contact.pair, contact.going_on) for contact in contacts] == [
        (1, (1, 2), (2,)),
        (3, (1, 3), ()),
        (4, (1, 2), ()),
    ]


def test_the_area_of_a_vehicles_first_contact_may_come_from_its_initial_impact() -> None:
    vehicles = [{"IMPACT1": 12}, {"VEH_NO": 2, "IMPACT1": 6}, {"VEH_NO": 3, "IMPACT1": 9}]
    unknown = {"AOI1": 99, "AOI2": 99}
    one, two = contacts_of(read(report(THREE, vehicles, [FIRST | unknown, SECOND | unknown])))
    assert [area and area.clock_h for _, area in one.sides] == [12, 6]
    assert [area and area.clock_h for _, area in two.sides] == [None, 9]  # vehicle 2 had been struck before


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ([FIRST, SECOND | {"VNUMBER2": 9999}], "event 2 (SOE 12) does not say whom vehicle 2 met"),
        ([FIRST], "nothing tells what part vehicle 3 had: no event that is known"),
    ],
)
def test_what_is_open_of_who_met_whom_is_said(events: list[dict[str, int]], says: str) -> None:
    record = read(report(THREE, VEHICLES, events))
    assert contacts_of(record) == ()
    found = rejection(record)
    assert found.reason is Reason.INCOMPLETE_SEQUENCE
    assert found.detail == says


def test_a_vehicle_that_is_not_listed_is_missed() -> None:
    record = read(report(THREE | {"VE_FORMS": 4, "VE_TOTAL": 4}, VEHICLES, [FIRST, SECOND]))
    assert untold_contact(record) == "the report lists 3 of 4 vehicles in transport"


def test_one_that_only_overturned_met_nobody() -> None:
    overturned = {"EVENTNUM": 3, "SOE": 1, "VNUMBER1": 3, "VNUMBER2": 5555}
    record = read(report(THREE, VEHICLES, [FIRST, SECOND | {"VNUMBER2": 1}, overturned]))
    assert untold_contact(record) is None


def test_persons_among_the_contacts_are_not_modelled_yet() -> None:
    struck = {"EVENTNUM": 3, "SOE": 8, "VNUMBER1": 3, "VNUMBER2": 9999, "AOI2": 77}
    found = rejection(read(report(THREE, VEHICLES, [FIRST, SECOND, struck])))
    assert found.reason is Reason.NOT_MODELLED
    assert found.detail.startswith("vehicles that met also struck persons: event 1 vehicle 1")


def test_two_in_transport_stay_a_collision_whatever_they_met() -> None:
    parked = {"VEH_NO": 3, "PTYPE": 2, "PIMPACT1": 6}
    events = [FIRST, {"EVENTNUM": 2, "SOE": 14, "VNUMBER1": 1, "VNUMBER2": 3}]
    data = report({"VE_TOTAL": 3}, VEHICLES[:2], events, {"ParkWorks": [("ParkWork", parked)]})
    assert reconstruction_of(read(data)) is Reconstruction.COLLISION


def test_a_parked_vehicle_that_was_struck_is_a_contact() -> None:
    parked = {"VEH_NO": 2, "PTYPE": 2, "PIMPACT1": 6}
    event = {"SOE": 14, "VNUMBER1": 1, "VNUMBER2": 2, "AOI1": 1, "AOI2": 6}
    record = read(report(PARKED, [{"IMPACT1": 1}], [event], {"ParkWorks": [("ParkWork", parked)]}))
    (contact,) = contacts_of(record)
    assert [(vehicle.number, vehicle.in_transport) for vehicle, _ in contact.sides] == [(1, True), (2, False)]
    check(record, CrashSettings())


def test_a_parked_vehicle_may_be_told_of_by_a_count_alone() -> None:
    """No table lists it: VE_TOTAL is one more than VE_FORMS, and the first harmful event was with a parked one."""
    record = read(report(PARKED, [{"IMPACT1": 12, "ACC_TYPE": 11}], []))
    (contact,) = contacts_of(record)
    assert contact.pair == (1, 2)
    assert [area and area.clock_h for _, area in contact.sides] == [12, None]
    assert "vehicle_class" in contact.vehicle(2).implied
    assert len(read(report(PARKED | {"VE_TOTAL": 1}, [{}], [])).vehicles) == 1
    assert len(read(report(PARKED | {"HARM_EV": 42}, [{}], [])).vehicles) == 1
