"""The examples in docstrings are what the functions give.

An example may use what it does not make itself, by the names of :func:`sample_object`.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import math
import re
from collections.abc import Iterator
from functools import cache
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from cases import SAMPLE, SETTINGS

import trace_dag
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, OsmWay, Site
from trace_dag.roads.build import build_road_map
from trace_dag.roads.from_osm.junction_areas import lay_out
from trace_dag.roads.from_osm.lanes import Stretch, build_sections
from trace_dag.roads.from_osm.movements import make_arm
from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.from_osm.street_graph import build_street_graph
from trace_dag.roads.from_osm.street_roads import build_street_roads
from trace_dag.roads.from_osm.tags import read_profile
from trace_dag.roads.map.curves import PlanPose, connect
from trace_dag.roads.map.model import ContactPoint
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import MapReport
from trace_dag.sim.backends import backend
from trace_dag.sim.run import simulate
from trace_dag.sim.types import SimulationLog
from trace_dag.states.analytic import build_scene
from trace_dag.states.estimate import estimate
from trace_dag.states.types import StateEstimate
from trace_dag.verdict.controls import JudgedCrash
from trace_dag.verdict.judge import judge
from trace_dag.verdict.metrics import observe
from trace_dag.verdict.perturbed.scene import PerturbedScene

PACKAGE = Path(trace_dag.__file__).parent
REPORTS = {
    "record": "reports/crash_319003.xml",  # a car turns left across a motorcycle: the crash that the README shows
    "queue_record": "chains/reports/crash_319101.xml",  # a car runs into one that stands and pushes it into the next
    "pedestrian_record": "people/reports/crash_319081.xml",  # a car strikes a man who crosses the road
    "tree_record": "roadside/reports/crash_319111.xml",  # a car runs off the road to the right into a tree
}
OF_THE_FIRST = (
    *("report_xml", "pedestrian_xml", "extract", "xodr", "network", "map_report"),
    *("scene", "state_estimate", "hypothesis", "log", "verdict", "first_contact", "perturbed_scene"),
)
JUDGED = {f"judged_{name.removesuffix('_record').replace('record', 'collision')}": name for name in REPORTS}
OF_THE_MAP = ("street_graph", "plans", "street_roads", "bare_roads", "tee_arms")
NAMES = (*REPORTS, *OF_THE_FIRST, *OF_THE_MAP, *JUDGED)


class Made(NamedTuple):
    """What the program makes of one crash of the sample."""

    extract: OsmExtract
    xodr: bytes
    network: RoadNetwork
    map_report: MapReport
    state_estimate: StateEstimate
    logs: tuple[SimulationLog, ...]


@cache
def record_of(name: str) -> CrashRecord:
    return read_report((SAMPLE / REPORTS[name]).read_bytes(), name=name, settings=SETTINGS.crash)


@cache
def made_of(name: str) -> Made:
    record = record_of(name)
    site = Site(record.key, record.latitude_deg, record.longitude_deg)
    extract = MapCatalog.open([SAMPLE / "osm"]).extract([site], SETTINGS.osm)[record.key]
    assert isinstance(extract, OsmExtract)
    built = build_road_map(extract, record, SETTINGS.roads)
    xodr = write_opendrive(built.network)
    network = read_opendrive(xodr, name="map.xodr")
    estimated = estimate(record, network, built.report, SETTINGS.states)
    logs = simulate(backend(SETTINGS.sim), network, xodr, estimated, SETTINGS.sim, record=record)
    return Made(extract, xodr, network, built.report, estimated, tuple(logs))


@cache
def first_names() -> dict[str, object]:
    """What the examples call by the names of ``OF_THE_FIRST``."""
    record, made = record_of("record"), made_of("record")
    hypothesis, log = made.state_estimate.hypotheses[0], made.logs[0]
    verdict = judge(record, made.network, made.map_report, made.state_estimate, made.logs, SETTINGS.verdict)
    return {
        "report_xml": (SAMPLE / REPORTS["record"]).read_bytes(),
        "pedestrian_xml": (SAMPLE / REPORTS["pedestrian_record"]).read_bytes(),
        **{name: value for name, value in made._asdict().items() if name in OF_THE_FIRST},
        "scene": build_scene(record, made.network, made.map_report, lead_time_s=SETTINGS.states.lead_time_s),
        "hypothesis": hypothesis,
        "log": log,
        "verdict": verdict,
        "first_contact": observe(made.network, hypothesis, log),
        "perturbed_scene": PerturbedScene(record, np.random.default_rng(0)),
    }


@cache
def map_names() -> dict[str, object]:
    """What the conversion of the first crash's map goes through, by the names of ``OF_THE_MAP``; and a T by hand: three
    roads of one lane each way that end 10 m from its node, from the west, the east and the south."""
    made = made_of("record")
    graph = build_street_graph(made.extract, made.network.frame, read_profile)
    plans = [fit_plan(street.points, 10.0) for street in graph.streets]
    layout, ids = lay_out(graph.streets, plans), count()
    built = {
        index: build_street_roads(street, plans[index], layout.trims[index], lambda: str(next(ids)))
        for index, street in enumerate(graph.streets)
    }
    profile = read_profile(OsmWay(1, (1, 2), {"highway": "residential"}))
    lanes = build_sections([Stretch(profile, 0.0, 50.0)])[0].end
    poses = [PlanPose(-10.0, 0.0, 0.0), PlanPose(10.0, 0.0, math.pi), PlanPose(0.0, -10.0, math.pi / 2)]
    arms = []
    for name, pose in zip(("west", "east", "south"), poses, strict=True):
        rest = connect(pose, PlanPose(0.0, 0.0, pose.heading_rad))
        arms.append(make_arm(name, ContactPoint.END, 1, profile, pose, rest, lanes))
    roads = tuple(road for each in built.values() for road in each.roads)
    return dict(zip(OF_THE_MAP, (graph, plans, built, roads, arms), strict=True))


@cache
def sample_object(name: str) -> object:
    """What an example calls by this name: a crash of the bundled sample as read, as judged, or what the program makes
    of the first of them."""
    if name in REPORTS:
        return record_of(name)
    if name in JUDGED:
        made = made_of(JUDGED[name])
        return JudgedCrash(record_of(JUDGED[name]), made.network, made.state_estimate.hypotheses[0], made.logs[0])
    return map_names()[name] if name in OF_THE_MAP else first_names()[name]


DOMAIN = ("crash", "osm", "roads", "states", "sim", "scenario", "verdict", "units.py", "geometry.py", "markdown.py")
PLAIN = {"int", "float", "str", "bool", "bytes", "None", "object", "tuple", "list", "dict", "set", "frozenset"}
PLAIN |= {"Sequence", "Iterable", "Mapping", "Collection"}


def modules_with_examples() -> list[str]:
    found = [path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8")]
    return sorted(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in found)


@pytest.mark.parametrize("name", modules_with_examples())
def test_the_examples_of_a_module_hold(name):
    module = importlib.import_module(name)
    examples = re.findall(r"(?:>>>|\.\.\.) (.*)", Path(str(module.__file__)).read_text(encoding="utf-8"))
    used = set(re.findall(r"\w+", " ".join(examples))) & set(NAMES)
    result = doctest.testmod(module, extraglobs={each: sample_object(each) for each in used})
    assert result.attempted > 0
    assert result.failed == 0


def public_functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Those of the domain, with the name of their module."""
    for part in DOMAIN:
        for path in sorted((PACKAGE / part).rglob("*.py")) or [PACKAGE / part]:
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    yield path.relative_to(PACKAGE).as_posix(), node


def takes_plain_values(function: ast.FunctionDef) -> bool:
    """Whether it has arguments, all of them numbers, text or collections of these."""
    given = function.args
    annotations = [each.annotation for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    names = [
        {node.id for node in ast.walk(each) if isinstance(node, ast.Name)} if each else set() for each in annotations
    ]
    return bool(names) and all(each and each <= PLAIN for each in names)


def test_functions_of_numbers_and_text_show_an_example():
    functions = [(where, each) for where, each in public_functions() if takes_plain_values(each)]
    without = [f"{where}: {each.name}" for where, each in functions if ">>> " not in (ast.get_docstring(each) or "")]
    assert len(functions) > 100
    assert without == []
