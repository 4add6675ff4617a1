"""Changed reports: every perturbation changes the elements it says, and no others."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator

import numpy as np
import pytest
from cases import SAMPLE, SETTINGS

from lab.changed_reports.kinds import KINDS, NOTHING, Needs, perturb
from lab.changed_reports.places import is_same_street, random_point
from lab.changed_reports.rows import has_same_map
from lab.changed_reports.scene import PerturbedScene, Point
from lab.changed_reports.vehicles import turned
from trace_dag.common.geometry import LocalFrame
from trace_dag.crash.fars.rows import FarsRows
from trace_dag.crash.parse import open_report, read_report
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import PreCrashMovement
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmNode, OsmWay, Site
from trace_dag.roads.build import build_road_map

REPORT = b"""<ResponseOfListOfCaseDetail><Count>1</Count><Results><ArrayOfCaseDetail><CaseDetail><CrashResultSet>
<CaseYear>2023</CaseYear><State>51</State><ST_CASE>510002</ST_CASE><VE_FORMS>2</VE_FORMS>
<FUNC_SYS>5</FUNC_SYS><ROUTE>3</ROUTE><TWAY_ID>OAK ST</TWAY_ID><TWAY_ID2>ELM ST</TWAY_ID2>
<LATITUDE>37.5</LATITUDE><LONGITUD>-77.5</LONGITUD>
<HARM_EV>12</HARM_EV><HARM_EVNAME>Motor Vehicle In-Transport</HARM_EVNAME><MAN_COLL>6</MAN_COLL>
<RELJCT2>3</RELJCT2><TYP_INT>3</TYP_INT>
<Vehicles><Vehicle><VEH_NO>1</VEH_NO><HARM_EV>12</HARM_EV><MAN_COLL>6</MAN_COLL><BODY_TYP>4</BODY_TYP><MODEL>31</MODEL>
<TRAV_SP>30</TRAV_SP><IMPACT1>1</IMPACT1><IMPACT1NAME>1 Clock Point</IMPACT1NAME><VNUM_LAN>2</VNUM_LAN>
<VSPD_LIM>45</VSPD_LIM><VALIGN>2</VALIGN><P_CRASH1>11</P_CRASH1><P_CRASH2>15</P_CRASH2><ACC_TYPE>68</ACC_TYPE>
<Damages><Damage><VEH_NO>1</VEH_NO><DAMAGE>1</DAMAGE></Damage></Damages>
<VEvents><VEvent><EVENTNUM>1</EVENTNUM><SOE>12</SOE><VNUMBER1>2</VNUMBER1><AOI1>61</AOI1><VNUMBER2>1</VNUMBER2>
<AOI2>1</AOI2></VEvent></VEvents><Vsoes><VSOEs><VEVENTNUM>1</VEVENTNUM><SOE>12</SOE><AOI>1</AOI></VSOEs></Vsoes>
</Vehicle><Vehicle><VEH_NO>2</VEH_NO><HARM_EV>12</HARM_EV><MAN_COLL>6</MAN_COLL><BODY_TYP>14</BODY_TYP>
<TRAV_SP>50</TRAV_SP><IMPACT1>61</IMPACT1><VNUM_LAN>2</VNUM_LAN><VSPD_LIM>45</VSPD_LIM><VALIGN>1</VALIGN>
<P_CRASH1>1</P_CRASH1><P_CRASH2>54</P_CRASH2><ACC_TYPE>69</ACC_TYPE>
<Damages><Damage><VEH_NO>2</VEH_NO><DAMAGE>9</DAMAGE></Damage><Damage><VEH_NO>2</VEH_NO><DAMAGE>13</DAMAGE></Damage>
</Damages><Vsoes><VSOEs><VEVENTNUM>1</VEVENTNUM><SOE>12</SOE><AOI>61</AOI></VSOEs></Vsoes></Vehicle></Vehicles>
<CEvents><CEvent><EVENTNUM>1</EVENTNUM><SOE>12</SOE><VNUMBER1>2</VNUMBER1><AOI1>61</AOI1><VNUMBER2>1</VNUMBER2>
<AOI2>1</AOI2></CEvent></CEvents></CrashResultSet></CaseDetail></ArrayOfCaseDetail></Results>
</ResponseOfListOfCaseDetail>"""

STRUCK = b"""<ResponseOfListOfCaseDetail><Count>1</Count><Results><ArrayOfCaseDetail><CaseDetail><CrashResultSet>
<CaseYear>2023</CaseYear><State>51</State><ST_CASE>510003</ST_CASE><VE_FORMS>2</VE_FORMS><PEDS>1</PEDS>
<LATITUDE>37.5</LATITUDE><LONGITUD>-77.5</LONGITUD><HARM_EV>8</HARM_EV><TYP_INT>2</TYP_INT>
<Vehicles><Vehicle><VEH_NO>1</VEH_NO><BODY_TYP>4</BODY_TYP><IMPACT1>12</IMPACT1><P_CRASH1>1</P_CRASH1></Vehicle>
<Vehicle><VEH_NO>2</VEH_NO><BODY_TYP>4</BODY_TYP><IMPACT1>1</IMPACT1><P_CRASH1>1</P_CRASH1></Vehicle></Vehicles>
<NPersons><Person><VEH_NO>0</VEH_NO><PER_NO>1</PER_NO><PER_TYP>5</PER_TYP><STR_VEH>1</STR_VEH><LOCATION>3</LOCATION>
</Person></NPersons><PbTypes><PBType><Veh_No>0</Veh_No><PER_NO>1</PER_NO><PBPTYPE>5</PBPTYPE><PEDCTYPE>760</PEDCTYPE>
<BIKECTYPE>0</BIKECTYPE><PEDPOS>1</PEDPOS><BIKEPOS>7</BIKEPOS><PEDDIR>2</PEDDIR><MOTDIR>3</MOTDIR><PEDSNR>2b</PEDSNR>
<PEDSNRNAME>From the right.</PEDSNRNAME><PEDCGP>750</PEDCGP><BIKECGP>0</BIKECGP></PBType></PbTypes>
<CEvents><CEvent><EVENTNUM>1</EVENTNUM><SOE>8</SOE><VNUMBER1>1</VNUMBER1><AOI1>12</AOI1></CEvent>
<CEvent><EVENTNUM>2</EVENTNUM><SOE>8</SOE><VNUMBER1>2</VNUMBER1><AOI1>1</AOI1></CEvent></CEvents>
</CrashResultSet></CaseDetail></ArrayOfCaseDetail></Results></ResponseOfListOfCaseDetail>"""

CHANGED_OF_PEOPLE = {
    "nothing": [],
    "clock_2h": ["IMPACT1 12 2", "AOI1 12 2"],
    "left_for_straight": ["P_CRASH1 1 11", "P_CRASH1 1 11"],
    "person_mirrored": ["PEDDIR 2 4", "PEDSNR 2b 2a"],
    "person_on_sidewalk": ["LOCATION 3 21", "PEDPOS 1 5"],
    "strikes_swapped": ["VNUMBER1 1 2", "VNUMBER1 2 1"],
}
CHANGED = {
    "nothing": [],
    # Vehicle 1: the initial impact, its damage, its party of the event (in the vehicle's copy too) and its own event.
    "clock_2h": ["IMPACT1 1 3", "DAMAGE 1 3", "AOI2 1 3", "AOI 1 3", "AOI2 1 3"],
    "left_for_right": ["P_CRASH1 11 10", "P_CRASH2 15 16"],
    "straight_for_left": ["P_CRASH1 11 1", "P_CRASH2 15 17"],
    "left_for_straight": ["P_CRASH1 1 11"],
    "both_backing": ["P_CRASH1 11 13", "P_CRASH2 15 20", "P_CRASH1 1 13"],
    "speeds_swapped": ["TRAV_SP 30 50", "TRAV_SP 50 30"],
    "speeds_150": ["TRAV_SP 30 150", "TRAV_SP 50 150"],
    "type_single": ["ACC_TYPE 68 1", "ACC_TYPE 69 1"],
    "types_swapped": ["ACC_TYPE 68 69", "ACC_TYPE 69 68"],
    "manner_front_to_front": ["MAN_COLL 6 2", "MAN_COLL 6 2", "MAN_COLL 6 2"],
    "tree_harm": ["HARM_EV 12 42", "HARM_EV 12 42", "HARM_EV 12 42"],
    "tree_event": [
        *("SOE 12 42", "VNUMBER2 1 9999", "AOI2 1 77", "SOE 12 42", "SOE 12 42", "SOE 12 42", "VNUMBER2 1 9999"),
        "AOI2 1 77",
    ],
    "tree_event_code": ["SOE 12 42", "SOE 12 42", "SOE 12 42", "SOE 12 42"],
    "name_i999": ["TWAY_ID OAK ST I-999"],
    "intersection_four_way": ["RELJCT2 3 2", "TYP_INT 3 2"],
    "intersection_none": ["RELJCT2 3 1", "TYP_INT 3 1"],
    "road_interstate": [
        *("FUNC_SYS 5 1", "ROUTE 3 1", "VNUM_LAN 2 6", "VSPD_LIM 45 70", "VNUM_LAN 2 6", "VSPD_LIM 45 70"),
    ],
    "alignment_mirrored": ["VALIGN 2 3"],
    "alignment_other": ["VALIGN 2 1", "VALIGN 1 2"],
    "bodies": ["BODY_TYP 4 52", "BODY_TYP 14 80"],
}
AREAS = {"IMPACT1", "DAMAGE", "AOI", "AOI1", "AOI2"}
COURSE = {"P_CRASH1", "P_CRASH2"}
PLACE = {"LATITUDE", "LONGITUD"}
ELEMENTS_OF = {
    **dict.fromkeys(("clock", "clocks"), AREAS),
    **dict.fromkeys(("left", "straight", "both"), COURSE),
    "speeds": {"TRAV_SP"},
    **dict.fromkeys(("moved", "random"), PLACE),
    "type": {"ACC_TYPE"},
    "types": {"ACC_TYPE"},
    "manner": {"MAN_COLL"},
    "tree": {"HARM_EV", "SOE", "VNUMBER2", "AOI2"},
    "name": {"TWAY_ID"},
    "names": {"TWAY_ID", "TWAY_ID2"},
    "intersection": {"RELJCT2", "TYP_INT"},
    "road": {"FUNC_SYS", "ROUTE", "VNUM_LAN", "VSPD_LIM"},
    "class": {"FUNC_SYS", "ROUTE"},
    "lanes": {"VNUM_LAN"},
    "limit": {"VSPD_LIM"},
    "alignment": {"VALIGN"},
    "bodies": {"BODY_TYP"},
    "vehicles": {*AREAS, *COURSE, "ACC_TYPE", "TRAV_SP"},
}
"""What a perturbation may change, by the first word of its name; others put together whole reports."""
GONE = {"MODEL"}  # tells of another body; as the labels (...NAME) of codes that were changed


def scene(data: bytes = REPORT, seed: int = 1) -> PerturbedScene:
    record = read_report(data, name="report", settings=SETTINGS.crash)
    return PerturbedScene(record, np.random.default_rng(seed), Point(37.51, -77.5, 1110.0, ("Elm Street",), True))


def elements(data: bytes) -> list[tuple[str, str]]:
    report, _ = open_report(data, name="report", repair=True)
    assert isinstance(report, FarsRows)
    values = [value for rows in report.tables.values() for row in rows for value in row.items()]
    return [(name, text) for name, text in values if not (name in GONE or name.endswith("NAME"))]


def differences(before: bytes, after: bytes) -> Iterator[str]:
    one, two = elements(before), elements(after)
    assert [name for name, _ in one] == [name for name, _ in two]
    for (name, was), (_, now) in zip(one, two, strict=True):
        if was != now:
            yield f"{name} {was} {now}"


@pytest.mark.parametrize("name", CHANGED)
def test_a_perturbation_changes_what_it_states_and_nothing_else(name: str) -> None:
    changed = perturb(KINDS[name], REPORT, scene())
    assert changed is not None
    assert list(differences(REPORT, changed.report)) == CHANGED[name]


@pytest.mark.parametrize(
    "name", [name for name in KINDS if name.partition("_")[0] in ELEMENTS_OF and name != "clocks_swapped"]
)
def test_a_perturbation_changes_elements_of_its_subject_alone(name: str) -> None:
    changed = perturb(KINDS[name], REPORT, scene())
    if changed is None:
        pytest.skip("does not apply to this report")
    names = {each.partition(" ")[0] for each in differences(REPORT, changed.report)}
    assert names
    assert names <= ELEMENTS_OF[name.partition("_")[0]]


@pytest.mark.parametrize(
    ("name", "subject"), [("clocks_random", AREAS - {"AOI1"}), ("vehicles_random", ELEMENTS_OF["vehicles"])]
)
def test_random_changes_are_drawn_for_every_element(name: str, subject: set[str]) -> None:
    """Of twenty draws one at least differs in each; areas lie in five elements."""
    names: set[str] = set()
    for seed in range(20):
        changed = perturb(KINDS[name], REPORT, scene(seed=seed))
        assert changed is not None
        names |= {each.partition(" ")[0] for each in differences(REPORT, changed.report)}
    assert names >= subject


@pytest.mark.parametrize("name", CHANGED_OF_PEOPLE)
def test_so_it_is_with_reports_of_people(name: str) -> None:
    changed = perturb(KINDS[name], STRUCK, scene(STRUCK))
    assert changed is not None
    assert list(differences(STRUCK, changed.report)) == CHANGED_OF_PEOPLE[name]
    read_report(changed.report, name=name, settings=SETTINGS.crash)


def test_a_person_typed_along_the_road_comes_from_no_side() -> None:
    changed = perturb(KINDS["person_along"], STRUCK, scene(STRUCK))
    assert changed is not None
    (person,) = read_report(changed.report, name="report", settings=SETTINGS.crash).non_motorists
    assert (person.pedestrian_type_code, person.pedestrian_group_code, person.scenario) == (410, 400, "")


def test_changes_apply_to_reports_of_their_own_kind() -> None:
    assert perturb(KINDS["clocks_swapped"], STRUCK, scene(STRUCK)) is None
    assert perturb(KINDS["person_mirrored"], REPORT, scene()) is None


def test_a_label_of_the_old_value_goes() -> None:
    changed = perturb(KINDS["clock_1h"], REPORT, scene())
    assert changed is not None
    assert b"1 Clock Point" not in changed.report
    assert b"Motor Vehicle In-Transport" in changed.report


def test_swapped_clocks_are_swapped_wherever_the_record_has_them() -> None:
    changed = perturb(KINDS["clocks_swapped"], REPORT, scene())
    assert changed is not None
    one, two = read_report(changed.report, name="report", settings=SETTINGS.crash).vehicles
    assert (one.initial_impact_code, two.initial_impact_code) == (61, 1)
    assert (one.damaged_areas, two.damaged_areas) == ((9, 13), (1,))
    (event,) = read_report(changed.report, name="report", settings=SETTINGS.crash).events
    assert event.area_1 is not None
    assert event.area_2 is not None
    assert (event.party_1, event.area_1.code, event.party_2, event.area_2.code) == (2, 1, 1, 61)
    assert perturb(KINDS["clocks_swapped"], changed.report, scene()) is not None


@pytest.mark.parametrize(("area", "hours", "expected"), [(12, 1, 1), (11, 3, 2), (61, 6, 3), (13, 4, 13), (0, 6, 0)])
def test_areas_turn_on_the_clock(area: int, hours: int, expected: int) -> None:
    assert turned(area, hours) == expected


def test_a_change_that_does_not_apply_gives_no_report() -> None:
    already = REPORT.replace(b"<ACC_TYPE>68<", b"<ACC_TYPE>50<").replace(b"<ACC_TYPE>69<", b"<ACC_TYPE>51<")
    assert perturb(KINDS["type_head_on"], already, scene(already)) is None
    slow = re.sub(rb"<TRAV_SP>\d+<", b"<TRAV_SP>998<", REPORT)
    for kind in ("speeds_swapped", "speeds_150", "speeds_0"):
        assert perturb(KINDS[kind], slow, scene(slow)) is None
    nameless = REPORT.replace(b"ELM ST", b"")
    assert perturb(KINDS["names_made_up"], nameless, scene(nameless)) is None
    assert perturb(KINDS["name_made_up"], nameless, scene(nameless)) is not None


def test_a_made_up_street_is_no_street() -> None:
    made = perturb(KINDS["names_made_up"], REPORT, scene())
    assert made is not None
    record = read_report(made.report, name="report", settings=SETTINGS.crash)
    assert record.trafficway_1 != record.trafficway_2
    assert not is_same_street((record.trafficway_1, record.trafficway_2), ("Oak Street", "Elm Street", "Main Street"))


def test_a_moved_report_is_as_far_away_as_it_states() -> None:
    # A degree of latitude at 37.5 degrees north is 110.99 km, of longitude 88.42 km (WGS84).
    for kind, expected in (
        ("moved_1000m_n", (37.5 + 1 / 110.99, -77.5)),
        ("moved_300m_w", (37.5, -77.5 - 0.3 / 88.42)),
    ):
        changed = perturb(KINDS[kind], REPORT, scene())
        assert changed is not None
        record = read_report(changed.report, name="report", settings=SETTINGS.crash)
        assert (record.latitude_deg, record.longitude_deg) == pytest.approx(expected, abs=2e-6)


def test_a_foreign_report_keeps_its_own_streets_by_default() -> None:
    foreign = REPORT.replace(b"OAK ST", b"BAY AVE").replace(b"37.5<", b"38.5<")
    for kind, street in (("foreign_site", "BAY AVE"), ("foreign_site_named_here", "OAK ST")):
        changed = perturb(KINDS[kind], foreign, scene())
        assert changed is not None
        record = read_report(changed.report, name="report", settings=SETTINGS.crash)
        assert (record.latitude_deg, record.longitude_deg, record.trafficway_1) == (37.5, -77.5, street)


def test_a_blank_report_states_nothing_of_the_vehicles() -> None:
    changed = perturb(KINDS["blank_head_on"], REPORT, scene())
    assert changed is not None
    record = read_report(changed.report, name="report", settings=SETTINGS.crash)
    assert record.trafficway_1 == ""
    assert [vehicle.crash_type_code for vehicle in record.vehicles] == [50, 51]
    assert all(v.travel_speed_mps is None and v.lanes is None and v.body_type_code is None for v in record.vehicles)
    (event,) = record.events
    assert event.area_1 is None


@pytest.mark.parametrize("name", KINDS)
def test_every_perturbation_of_a_whole_report_can_be_read_and_is_drawn_alike(name: str) -> None:
    report = (SAMPLE / "reports" / "crash_319003.xml").read_bytes()
    kind = KINDS[name]
    taken = (SAMPLE / "reports" / "crash_319022.xml").read_bytes() if kind.needs is Needs.OTHER_REPORT else report
    changed = perturb(kind, taken, scene(report))
    if changed is None:
        return
    read_report(changed.report, name=name, settings=SETTINGS.crash)
    assert changed == perturb(kind, taken, scene(report))
    if kind is not NOTHING:
        assert difflib.SequenceMatcher(None, elements(taken), elements(changed.report), autojunk=False).ratio() < 1


def test_real_reports_take_the_perturbations_their_fields_allow(shared_data) -> None:
    report = (shared_data / "va-2023" / "reports" / "crash_510002.xml").read_bytes()
    here = scene(report)
    of_collisions = {name: kind for name, kind in KINDS.items() if EventKind.VEHICLE_CONTACT in kind.of}
    applied = {name for name, kind in of_collisions.items() if perturb(kind, report, here) is not None}
    # Vehicle 1 turned left at a T-intersection on a straight road; both speeds and both streets are reported.
    assert of_collisions.keys() - applied <= {"alignment_mirrored", "type_left_across"}
    changed = perturb(KINDS["left_for_right"], report, here)
    assert changed is not None
    record = read_report(changed.report, name="report", settings=SETTINGS.crash)
    assert record.vehicles[0].movement is PreCrashMovement.TURNING_RIGHT
    assert list(differences(report, changed.report)) == ["P_CRASH1 11 10", "P_CRASH2 15 16"]


def test_random_points_lie_far_away_on_the_street_asked_for() -> None:
    # A street through the crash 2.2 km to either side, and one that crosses it 500 m further east.
    frame = LocalFrame(37.5, -77.5)

    def node(number: int, x_m: float, y_m: float) -> OsmNode:
        return OsmNode(number, *frame.to_geographic(np.array([x_m, y_m])).tolist())

    nodes = {
        each.id: each
        for each in (node(1, -2200, 0), node(2, 500, 0), node(3, 2200, 0), node(4, 500, -900), node(5, 500, 900))
    }
    ways = (
        OsmWay(1, (1, 2, 3), {"highway": "secondary", "name": "Oak Street"}),
        OsmWay(2, (4, 2, 5), {"highway": "residential", "name": "Elm Street"}),
        OsmWay(3, (4, 5), {"highway": "footway", "name": "Elm Path"}),
    )
    around = OsmExtract(BoundingBox(37.4, -77.6, 37.6, -77.4), nodes, ways)
    for same, street in ((True, "Oak Street"), (False, "Elm Street")):
        for seed in range(20):
            rng = np.random.default_rng(seed)
            point = random_point(around, frame, ("OAK ST",), rng, on_same_street=same, most_m=1000.0)
            assert point is not None
            x_m, y_m = frame.to_local(point.latitude_deg, point.longitude_deg).tolist()
            assert 300.0 <= math.hypot(x_m, y_m) == pytest.approx(point.distance_m, abs=0.01)
            assert max(abs(x_m), abs(y_m)) <= 1000.0
            assert (abs(y_m) if same else abs(x_m - 500.0)) < 0.2
            assert point.names == (street,)
    only_own = OsmExtract(around.box, nodes, ways[:1])
    nowhere = random_point(only_own, frame, ("OAK ST",), np.random.default_rng(1), on_same_street=False, most_m=1000.0)
    assert nowhere is None


def test_a_map_that_is_kept_is_the_one_that_would_be_made() -> None:
    """Of every change after which the map is not made again it would be the same file."""
    name = "crash_319003.xml"
    report = (SAMPLE / "reports" / name).read_bytes()
    here, kept = scene(report), {}
    for kind in KINDS.values():
        changed = perturb(kind, report, here) if kind.needs is Needs.NOTHING else None
        record = read_report(changed.report, name=name, settings=SETTINGS.crash) if changed else None
        if record is not None and has_same_map(here.record, record):
            kept[kind.name] = record
    assert {"clocks_6h", "type_single", "speeds_150", "vehicles_random"} <= kept.keys()
    assert not {"moved_10m_n", "name_made_up", "lanes_6", "intersection_none"} & kept.keys()
    site = Site(here.record.key, here.record.latitude_deg, here.record.longitude_deg)
    extract = MapCatalog.open([SAMPLE / "osm"]).extract([site], SETTINGS.osm)[site.key]
    assert isinstance(extract, OsmExtract)
    wanted = build_road_map(extract, here.record, SETTINGS.roads)
    built = build_road_map(extract, kept["vehicles_random"], SETTINGS.roads)
    assert (built.stored.xodr, built.report) == (wanted.stored.xodr, wanted.report)
