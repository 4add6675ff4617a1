"""The harmful events of a crash in order, and what of them a report leaves open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from crash_reports import Children, read, rejection, report

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.event_sequence import CrashEvent, EventSequence, sequence_of
from trace_dag.crash.parties import EventKind, PartyKind
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import DepartureManner, departure_of

THREE = {"VE_FORMS": 3, "VE_TOTAL": 3}
VEHICLES: list[Children] = [{}, {"VEH_NO": 2}, {"VEH_NO": 3}]
FIRST = {"VNUMBER1": 1, "VNUMBER2": 2, "AOI1": 12, "AOI2": 6}
SECOND = {"EVENTNUM": 2, "VNUMBER1": 2, "VNUMBER2": 3, "AOI1": 12, "AOI2": 6}
NOBODY = {"VNUMBER2": 9999, "AOI2": 77}
OVERTURN = NOBODY | {"SOE": 1, "AOI1": 0}
PERSON_STRUCK, ANIMAL_STRUCK, TREE = ({"SOE": code} | NOBODY for code in (8, 11, 42))
OFF_RIGHT, OFF_LEFT, OFF_AT_END = ({"SOE": code, "VNUMBER2": 5555, "AOI1": 55, "AOI2": 55} for code in (63, 64, 71))
ONE = {"VE_FORMS": 1, "VE_TOTAL": 1, "MAN_COLL": 0}
PARKED = ONE | {"VE_TOTAL": 2, "HARM_EV": 14, "REL_ROAD": 7}
STANDING = {"VEH_NO": 2, "PTYPE": 2, "PIMPACT1": 6}
PERSON = {"VEH_NO": 0, "PER_NO": 1, "PER_TYP": 5, "STR_VEH": 1, "AGE": 40, "LOCATION": 11}


def numbered(*events: Children) -> list[Children]:
    """Events with the numbers of their order."""
    return [event | {"EVENTNUM": number} for number, event in enumerate(events, start=1)]


def of_one(*events: Children, harm: int, vehicle: Children | None = None, **lists: list[Children]) -> CrashRecord:
    """A crash of one vehicle in transport, which takes part in every event."""
    rows = {name: [("Row", row) for row in entries] for name, entries in lists.items()}
    return read(report(ONE | {"HARM_EV": harm}, [vehicle or {}], numbered(*events), rows))


def told(sequence: EventSequence) -> list[tuple[int, EventKind, tuple[int, int]]]:
    return [(event.number, event.kind, event.pair) for event in sequence.events]


def clocks(event: CrashEvent) -> list[float | None]:
    return [vehicle.impact and vehicle.impact.clock_h for vehicle in event.vehicles]


def missing(record: CrashRecord) -> Rejection:
    with pytest.raises(Rejection) as found:
        sequence_of(record)
    assert rejection(record, CrashSettings()) is not None
    return found.value


# --- events, their order and their parties ---------------------------------------------------------------------------
def test_every_harmful_event_counts_in_its_order() -> None:
    record = read(report(THREE, VEHICLES, numbered(FIRST, OVERTURN, SECOND)))
    sequence = sequence_of(record)
    assert told(sequence) == [
        (1, EventKind.VEHICLE_CONTACT, (1, 2)),
        (2, EventKind.OVERTURN, (1, 1)),
        (3, EventKind.VEHICLE_CONTACT, (2, 3)),
    ]
    assert [event.number for event in sequence.contacts] == [1, 3]
    assert [clocks(event) for event in sequence.contacts] == [[12, 6], [12, 6]]
    assert sequence.order_known
    assert rejection(record, CrashSettings()) is None


def test_events_in_succession_between_the_same_two_are_one() -> None:
    third = {"VNUMBER1": 1, "VNUMBER2": 3, "AOI1": 12, "AOI2": 3}
    events = numbered(FIRST, FIRST | {"AOI1": 99, "AOI2": 99}, third, FIRST)
    sequence = sequence_of(read(report(THREE, VEHICLES, events)))
    assert [(event.number, event.pair, event.going_on) for event in sequence.events] == [
        (1, (1, 2), (2,)),
        (3, (1, 3), ()),
        (4, (1, 2), ()),
    ]
    assert sequence.goes_on_with(2) is sequence.first
    assert sequence.goes_on_with(3) is None


def test_running_over_whom_one_has_struck_is_the_same_event() -> None:
    sequence = sequence_of(of_one(PERSON_STRUCK, PERSON_STRUCK | {"AOI1": 14}, harm=8, NPersons=[PERSON]))
    assert [(event.pair, event.going_on) for event in sequence.events] == [((1, 1001), (2,))]


@pytest.mark.parametrize(("people", "parties"), [(2, [1001, 1002]), (1, [1001]), (None, [1001])])
def test_each_event_has_its_own_unlisted_person_where_the_report_counts_so_many(
    people: int | None, parties: list[int]
) -> None:
    events = numbered(PERSON_STRUCK, PERSON_STRUCK)
    sequence = sequence_of(read(report(ONE | {"HARM_EV": 8, "PEDS": people}, [{}], events)))
    assert [event.party for event in sequence.events] == parties


def test_people_whom_no_event_strikes_are_not_simulated_and_counted() -> None:
    record = read(report(ONE | {"HARM_EV": 8, "PEDS": 3}, [{}], numbered(PERSON_STRUCK)))
    assert "not simulated: 2 of 3 people outside vehicles, whom no event strikes" in record.ambiguities


def test_a_vehicle_is_first_struck_at_its_initial_impact_where_the_event_does_not_say_it() -> None:
    vehicles = [{"IMPACT1": 12}, {"VEH_NO": 2, "IMPACT1": 6}, {"VEH_NO": 3, "IMPACT1": 9}]
    unknown = {"AOI1": 99, "AOI2": 99}
    one, two = sequence_of(read(report(THREE, vehicles, [FIRST | unknown, SECOND | unknown]))).events
    assert clocks(one) == [12, 6]
    assert clocks(two) == [None, 9]  # vehicle 2 had been struck before
    struck = two.as_struck(3).impact
    assert struck is not None
    assert struck.clock_h == 9
    with pytest.raises(KeyError):
        two.as_struck(1)


def test_the_second_vehicle_is_the_only_other_one_where_the_event_does_not_name_it() -> None:
    assert told(sequence_of(read(report(events=[{"VNUMBER2": 9999}])))) == [(1, EventKind.VEHICLE_CONTACT, (1, 2))]


def test_a_crash_begins_with_its_first_harmful_event() -> None:
    """HARM_EV: a tree that is struck before the two collide is the first event; one listed before HARM_EV is not."""
    struck = numbered(OFF_RIGHT, TREE, FIRST)
    tree_first = sequence_of(read(report({"HARM_EV": 42, "MAN_COLL": 0}, events=struck)))
    assert told(tree_first) == [(2, EventKind.OBJECT_STRUCK, (1, 2002)), (3, EventKind.VEHICLE_CONTACT, (1, 2))]
    assert told(sequence_of(read(report({"HARM_EV": 12}, events=struck)))) == told(tree_first)[1:]
    assert told(sequence_of(read(report({"HARM_EV": None}, events=struck)))) == told(tree_first)


def test_kinds_of_events_are_mixed_as_the_report_has_them() -> None:
    """A collision that also strikes a person, and then one of the two a tree."""
    events = numbered(FIRST, PERSON_STRUCK | {"VNUMBER1": 2}, TREE)
    record = read(report(events=events, lists={"NPersons": [("Person", PERSON | {"STR_VEH": 2})]}))
    sequence = sequence_of(record)
    assert told(sequence) == [
        (1, EventKind.VEHICLE_CONTACT, (1, 2)),
        (2, EventKind.PERSON_STRUCK, (2, 1001)),
        (3, EventKind.OBJECT_STRUCK, (1, 2003)),
    ]
    assert sequence.events[1].person.age_years == 40
    assert [event.is_contact for event in sequence.events] == [True, True, False]
    assert rejection(record, CrashSettings()) is None
    with pytest.raises(TypeError, match="event 3 is no strike"):
        _ = sequence.events[2].person


def test_a_vehicle_strikes_an_animal_a_person_and_a_tree_in_turn() -> None:
    record = of_one(ANIMAL_STRUCK, PERSON_STRUCK, TREE, harm=11)
    sequence = sequence_of(record)
    assert [event.pair for event in sequence.events] == [(1, 2001), (1, 1001), (1, 2003)]
    assert sequence.first.person.kind is PartyKind.ANIMAL
    assert rejection(record, CrashSettings()) is None


def test_an_animal_struck_twice_is_one_animal() -> None:
    sequence = sequence_of(
        read(report({"HARM_EV": 11}, VEHICLES[:2], numbered(*(ANIMAL_STRUCK | {"VNUMBER1": n} for n in (1, 2)))))
    )
    assert [event.pair for event in sequence.events] == [(1, 2001), (2, 2001)]


def test_a_parked_vehicle_that_is_struck_takes_part() -> None:
    event = {"SOE": 14, "VNUMBER1": 1, "VNUMBER2": 2, "AOI1": 1, "AOI2": 6}
    record = read(report(PARKED, [{"IMPACT1": 1}], [event], {"ParkWorks": [("ParkWork", STANDING)]}))
    first = sequence_of(record).first
    assert [(vehicle.number, vehicle.in_transport) for vehicle in first.vehicles] == [(1, True), (2, False)]
    assert first.parked == first.partner
    assert rejection(record, CrashSettings()) is None


def test_a_parked_vehicle_may_be_struck_after_two_in_transport_collide() -> None:
    lists: dict[str, Any] = {"ParkWorks": [("ParkWork", STANDING | {"VEH_NO": 3})]}
    events = numbered(FIRST, {"SOE": 14, "VNUMBER1": 1, "VNUMBER2": 3})
    sequence = sequence_of(read(report({"VE_TOTAL": 3}, VEHICLES[:2], events, lists)))
    assert [(event.pair, event.parked is None) for event in sequence.events] == [((1, 2), True), ((1, 3), False)]


def test_an_order_that_nothing_gives_is_not_known() -> None:
    record = read(report(THREE, VEHICLES, [FIRST, SECOND]))
    for implied in ("order_of_contacts", "order_of_strikes"):
        assert not sequence_of(replace(record, implied=(implied,))).order_known


# --- thin reports ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("harm", "kind", "party"),
    [
        (8, EventKind.PERSON_STRUCK, 1001),
        (9, EventKind.PERSON_STRUCK, 1001),
        (11, EventKind.ANIMAL_STRUCK, 2001),
        (33, EventKind.OBJECT_STRUCK, 2001),
        (1, EventKind.OVERTURN, 1),
    ],
)
def test_the_first_harmful_event_names_the_object_of_the_only_vehicle(harm: int, kind: EventKind, party: int) -> None:
    sequence = sequence_of(of_one(harm=harm, vehicle={"IMPACT1": 1}))
    assert told(sequence) == [(1, kind, (1, party))]
    assert clocks(sequence.first) == [None if kind is EventKind.OVERTURN else 1]


@pytest.mark.parametrize(
    ("harm", "rollover", "events", "overturned"),
    [
        (42, 3, (), [(2, EventKind.OVERTURN, (1, 1))]),
        (42, 0, (), []),
        (1, 3, (), []),  # it is the first event
        (42, 3, (TREE,), []),  # a report with events has it among them
    ],
)
def test_a_vehicle_that_rolled_over_overturns_at_the_end_where_no_events_are_listed(
    harm: int, rollover: int, events: tuple[Children, ...], overturned: list[tuple[int, EventKind, tuple[int, int]]]
) -> None:
    sequence = sequence_of(of_one(*events, harm=harm, vehicle={"ROLLOVER": rollover}))
    assert told(sequence)[1:] == overturned


@pytest.mark.parametrize("person_type", [6, 19])
def test_the_only_person_was_struck_even_without_a_kind(person_type: int) -> None:
    """Of an older release without events: HARM_EV 9 is a cyclist, PER_TYP 19 a non-motorist of unknown kind."""
    first = sequence_of(of_one(harm=9, NPersons=[PERSON | {"PER_TYP": person_type}])).first
    assert (first.pair, first.person.kind, first.person.age_years) == ((1, 1001), PartyKind.CYCLIST, 40)


def test_a_parked_vehicle_may_be_reported_by_a_count_alone() -> None:
    """No table lists it: VE_TOTAL is one more than VE_FORMS, and the first harmful event was with a parked one."""
    first = sequence_of(read(report(PARKED, [{"IMPACT1": 12, "ACC_TYPE": 11}], []))).first
    assert (first.pair, clocks(first)) == ((1, 2), [12, None])
    assert "vehicle_class" in first.as_struck(2).implied
    assert len(read(report(PARKED | {"VE_TOTAL": 1}, [{}], [])).vehicles) == 1
    assert len(read(report(PARKED | {"HARM_EV": 42}, [{}], [])).vehicles) == 1


@pytest.mark.parametrize(
    ("crash", "vehicles", "says"),
    [
        ({}, [], "the report lists 0 of 2 vehicles in transport"),
        (ONE | {"HARM_EV": 8}, [], "the report lists 0 of 1 vehicles in transport"),
        (ONE | {"HARM_EV": 33}, [], "the report lists 0 of 1 vehicles in transport"),
        (THREE, VEHICLES, "event 1 (SOE 12) does not say of which vehicle it is"),
        (
            {"HARM_EV": 99},
            VEHICLES[:2],
            "nothing tells what happened: HARM_EV not known, and the report lists no events",
        ),
        ({"HARM_EV": 8}, VEHICLES[:2], "nothing tells which of 2 vehicles in transport struck a pedestrian"),
        ({"HARM_EV": 42}, VEHICLES[:2], "nothing tells which of 2 vehicles in transport struck a tree"),
    ],
)
def test_gaps_of_a_report_without_events_are_not_guessed(crash: Children, vehicles: list[Children], says: str) -> None:
    found = missing(read(report(crash, vehicles, [])))
    assert found.reason is Reason.INCOMPLETE_SEQUENCE
    assert found.detail.startswith(says)


# --- who took part ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("crash", "events", "says"),
    [
        ({}, [FIRST, SECOND | {"VNUMBER2": 9999}], "event 2 (SOE 12) does not say whom vehicle 2 met"),
        ({}, [FIRST], "nothing tells what part vehicle 3 had: no event that is known"),
        (THREE | {"VE_FORMS": 4, "VE_TOTAL": 4}, [FIRST, SECOND], "the report lists 3 of 4 vehicles in transport"),
        ({}, [PERSON_STRUCK | {"VNUMBER1": 7}], "event 1 (SOE 8) does not say of which vehicle it is"),
        ({}, [TREE | {"VNUMBER1": 7}], "event 1 (SOE 42) does not say of which vehicle it is"),
    ],
)
def test_unknown_parties_are_named(crash: Children, events: list[Children], says: str) -> None:
    harm = events[0].get("SOE", 12)
    found = missing(read(report(THREE | {"HARM_EV": harm} | crash, VEHICLES, events)))
    assert (found.reason, found.detail) == (Reason.INCOMPLETE_SEQUENCE, says)


def test_one_that_only_overturned_has_its_part() -> None:
    events = numbered(FIRST, SECOND | {"VNUMBER2": 1}, OVERTURN | {"VNUMBER1": 3})
    assert [event.pair for event in sequence_of(read(report(THREE, VEHICLES, events))).events] == [(1, 2), (3, 3)]


def test_the_struck_one_of_several_persons_has_to_be_reported() -> None:
    """Three strikes of two pedestrians, of whom nothing says which vehicle struck them."""
    persons = [("Person", PERSON | {"PER_NO": number, "STR_VEH": None}) for number in (1, 2)]
    strikes = numbered(*(PERSON_STRUCK | {"VNUMBER1": number} for number in (1, 2, 3)))
    record = read(report(THREE | {"HARM_EV": 8}, VEHICLES, strikes, {"NPersons": persons}))
    assert missing(record).detail == "event 1 does not say which of 2 persons was struck"


def test_a_later_event_off_the_road_whose_vehicle_is_open_refuses_nothing() -> None:
    sequence = sequence_of(read(report(events=numbered(FIRST, TREE | {"VNUMBER1": 7}))))
    assert [event.number for event in sequence.events] == [1]
    assert sequence.unclear == {2: "event 2 (SOE 42) does not say of which vehicle it is"}


# --- what cannot be simulated ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("code", "says"),
    [
        (10, "struck a railway vehicle"),
        (49, "struck a ridden animal"),
        (2, "fire"),
        (3, "water"),
        (5, "fell"),
        (54, "set in motion"),
    ],
)
def test_a_crash_is_not_modelled_where_its_first_harmful_event_is_not(code: int, says: str) -> None:
    harm = NOBODY | {"SOE": code}
    found = missing(of_one(harm, TREE, harm=code))
    assert found.reason is Reason.NOT_MODELLED
    assert says in found.detail.lower()
    assert f"(SOE {code})" in found.detail
    assert "(SOE 42)" in found.detail  # and what came after
    later = sequence_of(of_one(OFF_RIGHT, TREE, harm, harm=42))
    assert [event.number for event in later.events] == [2]
    assert [event.code for event in later.not_modelled] == [code]


# --- how the road was left -------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("events", "side", "departure"),
    [
        ([OFF_RIGHT, TREE], DepartureSide.RIGHT, 1),
        ([OFF_RIGHT, OFF_LEFT, TREE], DepartureSide.LEFT, 2),  # the last one before it
        ([OFF_AT_END, TREE], DepartureSide.AHEAD, 1),
        ([OFF_LEFT, {"SOE": 69, "VNUMBER2": 5555}, TREE], DepartureSide.LEFT, 1),  # came back onto the road
        ([TREE, OFF_RIGHT], None, None),
        ([{"SOE": 79, "VNUMBER2": 5555}, TREE], None, None),  # ran off to a side that is not known
    ],
)
def test_a_side_is_that_of_the_vehicles_last_departure(
    events: list[Children], side: DepartureSide | None, departure: int | None
) -> None:
    first = sequence_of(of_one(*events, harm=42)).first
    assert (first.side, first.departure) == (side, departure)


def test_another_vehicles_departure_gives_no_side() -> None:
    events = numbered(OFF_RIGHT | {"VNUMBER1": 2}, TREE)
    assert sequence_of(read(report({"HARM_EV": 42}, events=events))).first.side is None


@pytest.mark.parametrize(
    ("crash_type", "side", "manner"),
    [
        (1, DepartureSide.RIGHT, DepartureManner.DRIFT),
        (2, DepartureSide.RIGHT, DepartureManner.CONTROL_LOST),
        (3, DepartureSide.RIGHT, DepartureManner.AVOIDANCE),
        (6, DepartureSide.LEFT, DepartureManner.DRIFT),
        (7, DepartureSide.LEFT, DepartureManner.CONTROL_LOST),
        (12, DepartureSide.AHEAD, DepartureManner.DRIFT),
        (14, DepartureSide.AHEAD, DepartureManner.END_OF_ROAD),
        (98, None, DepartureManner.DRIFT),
    ],
)
def test_a_report_without_departures_gives_the_side_by_the_crash_type(
    crash_type: int, side: DepartureSide | None, manner: DepartureManner
) -> None:
    """FARS/CRSS Coding and Validation Manual, crash types A (right), B (left) and C (forward)."""
    record = of_one(harm=42, vehicle={"ACC_TYPE": crash_type})
    departure = departure_of(record, sequence_of(record))
    assert (departure.side, departure.manner) == (side, manner)
    assert [(each.number, each.code) for each in departure.objects] == [(1, 42)]
    untold = rejection(record, CrashSettings())
    assert (untold and untold.reason) is (Reason.INCOMPLETE_TRAJECTORY if side is None else None)


def test_objects_of_a_departure_end_where_something_else_happens() -> None:
    record = of_one(OFF_RIGHT, TREE | {"SOE": 33}, TREE, OVERTURN, TREE, harm=33)
    assert [each.number for each in departure_of(record, sequence_of(record)).objects] == [2, 3]


@pytest.mark.parametrize(("zone", "side"), [(1, None), (4, DepartureSide.RIGHT)])
def test_an_overturn_on_the_roadway_has_no_side(zone: int, side: DepartureSide | None) -> None:
    record = read(report(ONE | {"HARM_EV": 1, "REL_ROAD": zone}, [{}], numbered(OFF_RIGHT, OVERTURN)))
    departure = departure_of(record, sequence_of(record))
    assert (departure.side, departure.objects) == (side, ())
