"""The page of a crash: what it says first, that it says it in words, and where its links lead."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lxml import html

from tests.scenario.page_rows import crash
from tests.verdict.crashes import record, vehicle
from trace_dag.common.errors import Reason
from trace_dag.common.units import mph_to_mps
from trace_dag.crash.record import CrashRecord, EventRecord, NonMotorist, PreCrashMovement
from trace_dag.crash.summary import in_one_sentence
from trace_dag.osm.types import OSM_ATTRIBUTION, Rights
from trace_dag.pages.crash_page import CrashPage, write_crash_page
from trace_dag.reconstruction.samples.simulated import Interval, SampledRuns
from trace_dag.verdict.in_words import numbers_of
from trace_dag.verdict.types import (
    Agreement,
    ComparedWith,
    Criterion,
    Doubt,
    EventOutcome,
    EventResult,
    Fact,
    Grade,
    Label,
    Reservation,
    Support,
    Verdict,
)

RIGHTS = Rights.of([OSM_ATTRIBUTION])
SUPPORT = Support(
    (
        Fact("first street", ComparedWith.MAP, Agreement.AGREES, "MAIN ST", "Main Street", True, weight=3.6),
        Fact("lanes", ComparedWith.MAP, Agreement.DIFFERS, "4", "2", weight=-0.7),
    ),
    2.9,
    1,
)
VERDICT = Verdict(
    "2023-510001",
    "trace-dag",
    Label.VERIFIED,
    0,
    1,
    (
        Criterion("contact", 1.0, 1.0, "contacts", True, Reason.NO_COLLISION),
        Criterion("contact_distance", 1.23, 5.0, "m", True, Reason.WRONG_LOCATION),
        Criterion("reported_distance", 18.54, None, "m", None),
        Criterion("clock_error", 1.5, 2.0, "h", True, Reason.WRONG_IMPACT, "", 1),
        Criterion("clock_error", None, 2.0, "h", None, Reason.WRONG_IMPACT, "not reported", 2),
        Criterion("zone_error", 0.0, 1.0, "m", True, Reason.WRONG_ZONE, "", 1001),
        Criterion("closing_speed", 20.0, None, "mps", None),
        Criterion("clock", 4.5, None, "h", None, None, "", 1),
        Criterion("reported_clock", 3.0, None, "h", None, None, "", 1),
        Criterion("clock", 12.0, None, "h", None, None, "", 2),
        Criterion("reported_clock", None, None, "h", None, None, "", 2),
    ),
    grade=Grade.CORROBORATED,
    support=SUPPORT,
)


SAMPLED = SampledRuns(
    8,
    6.5,
    (),
    (
        Interval("impact_speed", "m/s", 1, mph_to_mps(30.0), mph_to_mps(20.0), mph_to_mps(25.0), mph_to_mps(40.0)),
        Interval("contact_x", "m", None, -0.01, -2.0, 0.5, 1.0),
    ),
)


def test_bands_lie_on_a_scale_from_zero_for_speeds_and_from_the_least_for_places() -> None:
    page = shown(CrashPage(crash(0), [], RIGHTS, sampled=SAMPLED))
    speed, place = page.xpath("//table[@class='bands']/tbody/tr")
    assert seen(speed) == "Impact speed, V1 30 mph 20 to 40 mph 0 40 mph"
    assert seen(place) == "Contact east of the reported point 0.0 m -2.0 to 1.0 m -2.0 1.0 m"
    # 4 % margin at either end: 20 of 40 mph is the middle, 30 three quarters of the 92 % between
    ends = [f"left:{50.0}%;width:{46.0}%", f"left:{4.0}%;width:{92.0}%"]
    assert [row.xpath(".//i/@style")[0] for row in (speed, place)] == ends
    assert speed.xpath(".//b/@style") == ["left:73.0%"]


def test_draws_of_which_one_has_nearly_all_the_weight_make_no_bands() -> None:
    page = shown(CrashPage(crash(0), [], RIGHTS, sampled=replace(SAMPLED, effective=1.4)))
    assert not page.xpath("//table[@class='bands']")
    assert "too few for intervals" in seen(page.get_element_by_id("sure").getparent())


def shown(page: CrashPage) -> html.HtmlElement:
    return html.fromstring(write_crash_page(page))


def seen(element: html.HtmlElement) -> str:
    return " ".join(" ".join(element.itertext()).split())


def on_main_street(**changes: object) -> CrashRecord:
    """Two cars on Main Street of Virginia on 15 January 2023, one of them reported at 55 mph."""
    turning = replace(vehicle(2, 9), movement=PreCrashMovement.TURNING_LEFT)
    crashed = record(vehicle(1, 12, speed_mps=mph_to_mps(55)), turning)
    return replace(crashed, state_name="Virginia", trafficway_1="MAIN ST", year=2023, month=1, day=15, **changes)


def test_a_crash_in_one_sentence():
    assert in_one_sentence(on_main_street()) == (
        "On January 15, 2023 on MAIN ST, Virginia, a car that was going straight at 55 mph and a car that was turning"
        " left collided."
    )
    walker = NonMotorist(1, 5, striking_vehicle=1)
    struck = on_main_street(events=(EventRecord(1, 8, 1, None, walker.party, None),), non_motorists=(walker,))
    assert in_one_sentence(struck) == (
        "On January 15, 2023 on MAIN ST, Virginia, a car that was going straight at 55 mph struck a pedestrian"
        "; one more vehicle was involved."
    )
    both = (EventRecord(1, 8, 1, None, walker.party, None), EventRecord(2, 8, 2, None, walker.party, None))
    assert in_one_sentence(on_main_street(events=both, non_motorists=(walker,))).endswith(
        "struck a pedestrian; one more vehicle struck the same person."
    )


def test_a_place_without_a_street_is_named_by_its_state():
    at_five_past_nine = {"hour": 9, "minute": 5, "trafficway_1": "", "trafficway_2": ""}
    assert in_one_sentence(replace(on_main_street(), **at_five_past_nine)).startswith(
        "On January 15, 2023 at 09:05 in Virginia, a car"
    )


def test_a_standing_vehicle_has_no_speed_in_the_sentence():
    crashed = on_main_street()
    for movement, words in (
        (PreCrashMovement.STOPPED, "a car that was stopped on the roadway and a car"),
        (PreCrashMovement.NO_DRIVER, "a car that had no driver and stood still and a car"),
        (PreCrashMovement.GOING_STRAIGHT, "a car that stood still and a car"),
    ):
        first = replace(crashed.vehicles[0], movement=movement, travel_speed_mps=0.0)
        assert words in in_one_sentence(replace(crashed, vehicles=(first, crashed.vehicles[1])))


def test_the_striking_vehicle_is_left_open_without_an_event():
    assert in_one_sentence(on_main_street(events=(), first_harmful_event_code=8)) == (
        "On January 15, 2023 on MAIN ST, Virginia, two motor vehicles crashed (one of them struck a pedestrian)."
    )
    assert in_one_sentence(on_main_street(events=(), first_harmful_event_code=12)).endswith("collided.")


def test_events_that_did_not_happen_are_not_shown_as_if_they_had():
    stays = Criterion("overturn", 0.0, 1.0, "", False, Reason.NO_OVERTURN, "vehicle 1 does not overturn", 1, 2)
    verdict = replace(VERDICT, label=Label.REJECTED, criteria=(stays,), reason=Reason.NO_OVERTURN)
    row = crash(0) | {"final_state": "rejected", "detail": stays.detail}
    page = seen(shown(CrashPage(row, (), RIGHTS, record=on_main_street(), verdict=verdict)))
    assert page.lower().partition("criteria")[0].count("vehicle 1 does not overturn") == 1, "not again as a reason"
    assert "Vehicle 1 overturned" not in page


def test_unreported_values_of_a_vehicle_are_marked_and_an_unknown_make_is_no_name():
    seen_once = replace(
        vehicle(1, 12), make_model="Unknown Make Unknown (as to automobile, ...)", implied=("vehicle_class", "movement")
    )
    struck = EventRecord(1, 12, 1, None, 2, None)
    page = shown(
        CrashPage(crash(0), (), RIGHTS, record=on_main_street(vehicles=(seen_once, vehicle(2, 9)), events=(struck,)))
    )
    rows = [seen(row) for row in page.xpath("//div[@aria-label='Vehicles']//tbody/tr")]
    assert rows[0].startswith("V1 car (implied) going straight (implied)")
    assert rows[1].startswith("V2 car going straight")
    (event,) = page.xpath("//div[@aria-label='Events']//tbody/tr")
    assert seen(event).startswith("1 collided with a motor vehicle in transport 12")


def test_the_time_is_reported_to_the_minute_and_persons_are_not_called_vehicles():
    facts = (
        Fact("course of the person", ComparedWith.COURSE, Agreement.AGREES, "left", "0 deg off", False, 1001, 0.8),
    )
    verdict = replace(VERDICT, support=replace(SUPPORT, facts=facts))
    row = crash(0) | {"hour": 19, "minute": 5}
    page = seen(shown(CrashPage(row, (), RIGHTS, record=on_main_street(), verdict=verdict)))
    assert ", 19:05 local time" in page
    assert "Course of person 1 agrees with the course: left – 0 deg off" in page
    assert ", 19 h local time" in seen(shown(CrashPage(row | {"minute": None}, (), RIGHTS)))


def test_result_and_certainty_come_first_then_replay_numbers_and_reasons():
    page = shown(CrashPage(crash(0), (), RIGHTS, record=on_main_street(), verdict=VERDICT, replay="../replay.html?1"))
    main = page.get_element_by_id("main")
    text = html.tostring(main, encoding="unicode")
    order = [
        'class="lead"',
        'class="top"',
        "<iframe",
        'class="glance"',
        "Speaks for it",
        "Speaks against it",
        "Not reported",
        "<details",
    ]
    assert [text.index(part) for part in order] == sorted(text.index(part) for part in order)
    assert all(section.get("open") is None for section in main.iter("details"))
    assert "verified, corroborated" in seen(page)


def test_numbers_and_reasons_are_reported_in_words():
    page = shown(CrashPage(crash(0), (), RIGHTS, record=on_main_street(contradictions=("a, not b",)), verdict=VERDICT))
    glance = seen(page.find_class("glance")[0])
    assert "60.8 ft (18.5 m) from the reported point to the first contact" in glance
    assert "4.0 ft (1.2 m) of it along the road" in glance
    assert "45 mph (72 km/h) closing speed" in glance  # 20 m/s
    for_it, against, untold = (seen(page.get_element_by_id(each).getparent()) for each in ("for", "against", "untold"))
    assert "The reported parties touch" in for_it
    assert "First street agrees with the map: MAIN ST – Main Street" in for_it
    assert "Vehicle 1 struck where the report says: 1.5 clock positions off, 2 allowed" in for_it
    assert "Person 1 in the part of the road that the report says: 0.0 ft (0.0 m), 3.3 ft (1.0 m) allowed" in for_it
    assert "Lanes differs with the map: 4 – 2" in against
    assert "The report contradicts itself: a, not b" in against
    assert "Vehicle 2 struck where the report says" in untold


def test_the_first_figures_of_a_person_struck_are_the_speed_of_the_impact_and_the_throw():
    struck = (
        Criterion("impact_speed", 16.0, None, "mps", None, None, "", 1, 1),
        Criterion("impact_speed", 1.5, None, "mps", None, None, "", 101, 1),
        Criterion("delta_v", 0.4, None, "mps", None, None, "", 1, 1),
        Criterion("throw_distance", 15.24, None, "m", None, None, "", 101, 1),
    )
    numbers = numbers_of(replace(VERDICT, criteria=struck), on_main_street(), None)
    assert numbers[:2] == [
        ("36 mph (58 km/h)", "speed of the vehicle at the impact"),
        ("50.0 ft (15.2 m)", "throw of the person"),
    ]
    assert not any("change of velocity" in what for _, what in numbers)


def test_no_error_is_counted_from_an_impact_that_nobody_reported():
    for implied, said in (((), True), (("impact",), False)):
        record = on_main_street(vehicles=(replace(vehicle(1, 12), implied=implied), vehicle(2, 9)))
        numbers = numbers_of(VERDICT, record, None)
        assert (("1.5", "clock positions at most between reported and simulated impact") in numbers) is said
        glance = seen(shown(CrashPage(crash(0), (), RIGHTS, record=record, verdict=VERDICT)).find_class("glance")[0])
        assert ("between reported and simulated impact" in glance) is said


def test_doubts_and_events_that_do_not_happen_are_reported_without_unfolding():
    doubts = tuple(Reservation(Doubt.EVENT_MISSED, f"event {number}: does not happen") for number in range(2, 10))
    events = (
        EventOutcome(1, 12, EventResult.HAPPENED),
        EventOutcome(2, 1, EventResult.MISSED, "not simulated"),
        EventOutcome(3, 2, EventResult.NOT_MODELLED),
    )
    unsure = "vehicle 1 from the west (50 %) or from the east (45 %): the report does not say"
    verdict = replace(VERDICT, reservations=doubts, events=events, alternatives=unsure)
    page = shown(CrashPage(crash(0), (), RIGHTS, record=on_main_street(), verdict=verdict))
    against = page.get_element_by_id("against").getparent()
    shown_at_once = seen(against.find("ul"))
    assert all(f"Event {number}: does not happen" in shown_at_once for number in range(2, 10))
    head = seen(page.get_element_by_id("main")).partition("Speaks for it")[0]
    assert "1 of 3 reported events happen (1 cannot be simulated)" in head
    assert "not event 2, " in head
    assert "(not simulated)" in head
    assert "SOE" not in head
    assert f"As likely : {unsure}" in head
    without_events = shown(CrashPage(crash(0), (), RIGHTS, verdict=replace(verdict, events=())))
    assert f"As likely : {unsure}" in seen(without_events)


@pytest.mark.parametrize(("number", "reported", "simulated"), [(0, (44.0, 0.0), (31.1, 31.1)), (1, None, (0.0, -44.0))])
def test_dials_show_twelve_at_the_front_and_three_on_the_right(number, reported, simulated):
    """On a dial of radius 44, y down: 3 h at (44, 0), 4.5 h at 45 degrees to the right and rear, 12 h at the top."""
    page = shown(CrashPage(crash(0), (), RIGHTS, record=on_main_street(), verdict=VERDICT))
    dial = page.find_class("dial")[number]

    def drawn(name: str) -> tuple[float, float] | None:
        return next(((float(each.get("cx")), float(each.get("cy"))) for each in dial.find_class(name)), None)

    assert drawn("reported") == reported
    assert drawn("simulated") == simulated


def test_the_place_can_be_looked_at_elsewhere_unless_it_is_fictional():
    """Positions to 6 decimals, which are a decimetre."""

    def links(rights: Rights) -> list[str]:
        page = shown(CrashPage(crash(0), (), rights))
        return [link for link in page.xpath("//a/@href") if link.startswith("http")]

    assert any("mlat=37.000000&mlon=-78.000000" in link for link in links(RIGHTS) if "openstreetmap.org" in link)
    assert not any("mlat" in link for link in links(Rights.of(["fictional, CC0"])))


def test_a_page_names_the_parties_of_every_event():
    """A pedestrian in a crosswalk (PEDPOS 2), then a tree (SOE 42)."""
    walker = NonMotorist(1, 5, striking_vehicle=1, age_years=38, pedestrian_position_code=2)
    events = (EventRecord(1, 8, 1, None, walker.party, None), EventRecord(2, 42, 1, None, 2002, None))
    crashed = replace(
        record(vehicle(1, 12), vehicle(2, 9)), events=events, non_motorists=(walker,), ambiguities=("who came first",)
    )
    page = html.fromstring(write_crash_page(CrashPage(crash(0), (), RIGHTS, record=crashed)))
    text = " ".join(page.itertext())
    seen = " ".join(text.split())
    assert "P1 pedestrian in a crosswalk V1 38" in seen
    assert "1 struck a pedestrian 8 V1 P1" in seen
    assert "2 struck a tree 42 V1 what event 2 struck" in seen
    assert "What the report leaves open who came first" in seen
