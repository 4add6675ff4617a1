"""The sample's files: the same on every run, everything covered, laid out as the real ones are."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from decimal import Decimal
from pathlib import Path

import pytest

from lab.truth.vehicles import SampleTruth
from trace_dag.common.errors import Reason
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.crash.parse import read_report

# The coverage table of the published paper, by code (FARS Analytical User's Manual); everything else is "others".
MANNERS = {
    1: "front_to_rear",
    2: "front_to_front",
    6: "angle",
    7: "sideswipe_same_direction",
    8: "sideswipe_opposite_direction",
    9: "rear_to_side",
    10: "rear_to_rear",
}
TOPOLOGIES = {
    1: "not_an_intersection",
    2: "four_way",
    3: "t",
    4: "y",
    5: "roundabout",
    6: "roundabout",
    7: "five_point_or_more",
    10: "l",
}
TRAJECTORIES = {
    **dict.fromkeys(range(20, 50), "same_direction"),
    **dict.fromkeys(range(50, 68), "opposite_direction"),
    **dict.fromkeys(range(68, 86), "turning"),
    **dict.fromkeys(range(86, 92), "intersecting"),
}


def _reconstructable(truth: SampleTruth) -> list[str]:
    return [crash.key for crash in truth.crashes if crash.expected.final_state in ("verified", "first_event_only")]


def _crash_of(sample: Path, key: str) -> ElementTree.Element:
    root = ElementTree.parse(sample / "reports" / f"crash_{key[-6:]}.xml").getroot()
    crash = root.find(".//CrashResultSet")
    assert crash is not None
    return crash


def _code(element: ElementTree.Element, tag: str) -> int:
    return int(element.findtext(tag, ""))


def test_making_it_again_gives_the_same(sample: Path) -> None:
    """Maps and reports byte for byte; the truth but for the last digit, where processors round differently."""
    import make_sample

    made = make_sample.files()
    stored = {
        str(path.relative_to(sample)): path.read_bytes()
        for pattern in ("osm/*.osm", "**/reports/*.xml", "**/truth.json")
        for path in sample.glob(pattern)
    }
    assert sorted(made) == sorted(stored)
    names = ("truth.json", "people/truth.json")
    truth = [numbers_apart("".join(each.pop(name).decode() for name in names)) for each in (made, stored)]
    assert [name for name in made if made[name] != stored[name]] == []
    assert truth[0][0] == truth[1][0]
    for again, kept in zip(truth[0][1], truth[1][1], strict=True):
        assert abs(again - kept) <= Decimal(1).scaleb(kept.as_tuple().exponent)


def numbers_apart(text: str) -> tuple[str, list[Decimal]]:
    """A JSON text with its decimal numbers blanked, and those numbers."""
    decimal = re.compile(r"-?\d+\.\d+")
    return decimal.sub("#", text), [Decimal(number) for number in decimal.findall(text)]


def test_the_generator_does_not_use_the_code_it_judges(sample: Path) -> None:
    sources = [sample / "make_sample.py", *(sample / "make").glob("*.py")]
    assert len(sources) > 10
    for source in sources:
        assert "import trace_dag" not in source.read_text()
        assert "from trace_dag" not in source.read_text()


def test_every_coverage_class_occurs(sample: Path, truth: SampleTruth) -> None:
    crashes = [_crash_of(sample, key) for key in _reconstructable(truth)]
    assert len(crashes) >= 36
    manners = {MANNERS.get(_code(crash, "MAN_COLL"), "others") for crash in crashes}
    topologies = {TOPOLOGIES.get(_code(crash, "TYP_INT"), "others") for crash in crashes}
    trajectories = {
        TRAJECTORIES.get(_code(vehicle, "ACC_TYPE"), "others")
        for crash in crashes
        for vehicle in crash.findall("Vehicles/Vehicle")
    }
    assert manners == set(CollisionType)
    assert topologies == set(RoadTopology)
    assert trajectories == set(VehicleTrajectory)


def test_every_reason_occurs_that_default_settings_can_give(truth: SampleTruth) -> None:
    reasons = {crash.expected.reason for crash in truth.crashes if crash.expected.final_state == "rejected"}
    by_other_settings = {Reason.VERTICAL_GEOMETRY, Reason.WRONG_SPEED, Reason.OUTSIDE_COHORT}
    of_real_reports = {Reason.INCOMPLETE_SEQUENCE, Reason.INCOMPLETE_IMPACT}  # in the town, every two met, somewhere
    of_people = {Reason.WRONG_PARTY, Reason.WRONG_SEQUENCE, Reason.WRONG_ZONE}
    of_maps = {Reason.MAP_TOO_SMALL}  # the town's roads go on, see tests/reconstruction/test_mapped_ground.py
    of_departures = {Reason.NO_DEPARTURE, Reason.WRONG_SIDE, Reason.NO_OVERTURN}
    assert reasons == set(Reason) - by_other_settings - of_real_reports - of_people - of_departures - of_maps


def test_reports_of_reconstructable_crashes_agree_with_themselves(sample: Path, truth: SampleTruth) -> None:
    for key in _reconstructable(truth):
        path = sample / "reports" / f"crash_{key[-6:]}.xml"
        record = read_report(path.read_bytes(), name=path.name, settings=CrashSettings())
        assert record.key == key
        assert record.contradictions == ()
        assert record.fatalities == 1


def test_impact_areas_are_where_the_truth_has_the_contact(sample: Path, truth: SampleTruth) -> None:
    for crash in truth.crashes:
        if not crash.vehicles:
            continue
        for vehicle, report in zip(
            crash.vehicles, _crash_of(sample, crash.key).findall("Vehicles/Vehicle"), strict=True
        ):
            if any(int(e.findtext("SOE", "")) == 53 for e in report.findall("VEvents/VEvent")):
                continue  # its first impact was with the mailbox
            assert int(report.findtext("IMPACT1", "")) == vehicle.impact_clock_h, crash.title


def test_layout_is_that_of_real_answers(sample: Path, shared_data: Path) -> None:
    def paths(file: Path) -> list[str]:
        found: dict[str, None] = {}

        def walk(element: ElementTree.Element, above: str) -> None:
            here = f"{above}/{element.tag}"
            found[here] = None
            for child in element:
                walk(child, here)

        walk(ElementTree.parse(file).getroot(), "")
        return list(found)

    ours = paths(sample / "reports" / "crash_319022.xml")
    theirs: set[str] = set()
    for file in sorted((shared_data / "va-2023" / "reports").glob("*.xml")):
        try:
            theirs |= set(paths(file))
        except ElementTree.ParseError:
            continue  # some real answers are not well-formed
    assert set(ours) <= theirs
    # Codes and labels of the crash and of its vehicles, all of them, in the service's order.
    real = paths(shared_data / "va-2023" / "reports" / "crash_510011.xml")
    for level in ("CrashResultSet", "Vehicle", "Person"):
        named = [p for p in real if p.split("/")[-2] == level]
        assert [p for p in ours if p.split("/")[-2] == level] == named


@pytest.mark.parametrize("name", ["merrow.osm", "quill.osm"])
def test_maps_are_osm_files_others_can_read(sample: Path, name: str) -> None:
    import osmium

    class Reader(osmium.SimpleHandler):
        def __init__(self) -> None:
            super().__init__()
            self.highways: set[str] = set()
            self.keys: set[str] = set()
            self.restrictions = 0
            self.unlocated = 0

        def way(self, way: osmium.osm.Way) -> None:
            self.keys |= {tag.k for tag in way.tags}
            if "highway" in way.tags:
                self.highways.add(way.tags["highway"])
            self.unlocated += sum(not node.location.valid() for node in way.nodes)

        def relation(self, relation: osmium.osm.Relation) -> None:
            self.restrictions += relation.tags.get("type") == "restriction"

    reader = Reader()
    reader.apply_file(str(sample / "osm" / name), locations=True)
    assert reader.unlocated == 0
    if name == "merrow.osm":
        assert reader.restrictions == 3
        assert {
            "motorway",
            "motorway_link",
            "primary",
            "secondary",
            "tertiary",
            "residential",
            "service",
        } <= reader.highways
        assert {
            "lanes",
            "lanes:forward",
            "turn:lanes",
            "oneway",
            "maxspeed",
            "bridge",
            "tunnel",
            "layer",
        } <= reader.keys
