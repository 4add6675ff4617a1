"""What examples in docstrings may use without making it: crashes of the bundled sample, and what the program makes of
them, by the names of :data:`NAMES`. Each is made when an example first asks for it.

``record`` and everything without another crash's name is of 2023-319003, the crash that the README shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import count
from typing import NamedTuple

import numpy as np
from cases import SAMPLE, SETTINGS

from lab.changed_reports.scene import PerturbedScene
from trace_dag.crash.event_sequence import EventSequence, sequence_of
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import departure_of
from trace_dag.export.package import PackageInput
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, OsmWay, Site
from trace_dag.reconstruction.analytic_hypotheses import build_scene, parties, solve_all
from trace_dag.reconstruction.candidates import candidates
from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.solver import Solution
from trace_dag.reconstruction.planners.impact_plans import ImpactPlan, impact_plans
from trace_dag.reconstruction.pre_crash_scenarios import party, pre_crash_scenarios
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.roads.build import build_road_map
from trace_dag.roads.from_osm.junction_areas import lay_out
from trace_dag.roads.from_osm.lanes import Stretch, build_sections
from trace_dag.roads.from_osm.movements import JunctionArm, make_arm
from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.from_osm.street_graph import StreetGraph, build_street_graph
from trace_dag.roads.from_osm.street_roads import StreetRoads, build_street_roads
from trace_dag.roads.from_osm.tags import read_profile
from trace_dag.roads.map.curves import PlanPose, PlanView, connect
from trace_dag.roads.map.model import ContactPoint
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import MapReport
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.people import Person
from trace_dag.simulation.plan import resample
from trace_dag.simulation.run import backend, participants, simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.simulation.types import SimulationLog
from trace_dag.simulation.vehicles import vehicle_model
from trace_dag.verdict.controls import JudgedCrash
from trace_dag.verdict.judge import judge
from trace_dag.verdict.observation import ObservedCrash, observe_crash
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Verdict

REPORTS = {
    "record": "reports/crash_319003.xml",  # a car turns left across a motorcycle
    "queue_record": "chains/reports/crash_319101.xml",  # a car runs into one that stands and pushes it into the next
    "pedestrian_record": "people/reports/crash_319081.xml",  # a car strikes a man who crosses the road
    "tree_record": "roadside/reports/crash_319111.xml",  # a car runs off the road to the right into a tree
}
JUDGED = {f"judged_{name.removesuffix('_record').replace('record', 'collision')}": name for name in REPORTS}
SCENES = {"scene": "record", "pedestrian_scene": "pedestrian_record", "tree_scene": "tree_record"}


class Made(NamedTuple):
    """What the program makes of one crash of the sample."""

    extract: OsmExtract
    xodr: bytes
    network: RoadNetwork
    map_report: MapReport
    state_estimate: StateEstimate
    logs: tuple[SimulationLog, ...]


@cache
def report_of(name: str) -> bytes:
    return (SAMPLE / REPORTS[name]).read_bytes()


@cache
def record_of(name: str) -> CrashRecord:
    return read_report(report_of(name), name=name, settings=SETTINGS.crash)


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
def scene_of(name: str) -> Scene:
    made = made_of(name)
    return build_scene(record_of(name), made.network, made.map_report, lead_time_s=SETTINGS.states.lead_time_s)


def judged(name: str) -> JudgedCrash:
    made = made_of(name)
    return JudgedCrash(record_of(name), made.network, made.state_estimate.hypotheses[0], made.logs[0])


@cache
def solution() -> Solution:
    """The likeliest way in which the two of the first crash met."""
    scene = scene_of("record")
    reading = pre_crash_scenarios(scene.record, *parties(scene.record, sequence_of(scene.record).first))[0]
    return solve_all(scene, candidates(scene, reading))[0]


@cache
def strike_plan() -> ImpactPlan:
    """The likeliest way in which the pedestrian was struck."""
    return impact_plans(scene_of("pedestrian_record"), sequence_of(record_of("pedestrian_record")).first)[0]


@cache
def way_past_the_tree() -> Option:
    """The likeliest way of the car that struck the tree, as if it had stayed on the road."""
    scene = scene_of("tree_record")
    ways = approaches_of(scene, party(scene.record, scene.record.vehicles[0]))
    return max(ways, key=lambda way: sum(way[2].values()))[0]


@cache
def verdict() -> Verdict:
    made = made_of("record")
    return judge(record_of("record"), made.network, made.map_report, made.state_estimate, made.logs, SETTINGS.verdict)


def simulated_bodies(name: str) -> tuple[Vehicle | Person, ...]:
    """The parties of a crash as its simulation begins, vehicles first."""
    made, settings, bodies = made_of(name), SETTINGS.sim, []
    for each in participants(made.state_estimate.hypotheses[0]):
        ahead_m = 0.0 if each.body.is_figure else vehicle_model(each.body).cg_ahead_m
        plan = resample(each.trajectory, settings.step_s, settings.time_limit_s, ahead_m)
        if each.body.is_figure:
            bodies.append(Person(each, plan, settings.step_s))
        else:
            bodies.append(Vehicle(each, vehicle_model(each.body), plan, friction=0.75, locked_wheels=0.0))
    return tuple(bodies)


def package_input() -> PackageInput:
    made = made_of("record")
    return PackageInput(
        record=record_of("record"),
        report=("report.xml", report_of("record")),
        osm_xml=b"<osm/>",
        map_xodr=made.xodr,
        provenance={},
        network=made.network,
        map_report=made.map_report,
        estimate=made.state_estimate,
        log=made.logs[0],
        verdict=verdict(),
        drives=(),
    )


@cache
def street_graph() -> StreetGraph:
    made = made_of("record")
    return build_street_graph(made.extract, made.network.frame, read_profile)


@cache
def plans() -> list[PlanView]:
    return [fit_plan(street.points, 10.0) for street in street_graph().streets]


@cache
def street_roads() -> dict[int, StreetRoads]:
    layout, ids = lay_out(street_graph().streets, plans()), count()
    return {
        index: build_street_roads(street, plans()[index], layout.trims[index], lambda: str(next(ids)))
        for index, street in enumerate(street_graph().streets)
    }


def tee_arms() -> list[JunctionArm]:
    """Three roads of one lane each way that end 10 m from the node of a T, from the west, the east and the south."""
    profile = read_profile(OsmWay(1, (1, 2), {"highway": "residential"}))
    lanes = build_sections([Stretch(profile, 0.0, 50.0)])[0].end
    poses = [PlanPose(-10.0, 0.0, 0.0), PlanPose(10.0, 0.0, math.pi), PlanPose(0.0, -10.0, math.pi / 2)]
    arms = []
    for name, pose in zip(("west", "east", "south"), poses, strict=True):
        rest = connect(pose, PlanPose(0.0, 0.0, pose.heading_rad))
        arms.append(make_arm(name, ContactPoint.END, 1, profile, pose, rest, lanes))
    return arms


@cache
def observed_crash(name: str) -> ObservedCrash:
    made = made_of(name)
    return observe_crash(made.network, made.state_estimate.hypotheses[0], made.logs[0])


def sequence(name: str) -> EventSequence:
    return sequence_of(record_of(name))


def comparison(name: str) -> Comparison:
    return Comparison.of(record_of(name), sequence(name), observed_crash(name), SETTINGS.verdict)


MAKERS: dict[str, Callable[[], object]] = {
    **{name: partial(record_of, name) for name in REPORTS},
    **{name: partial(scene_of, of) for name, of in SCENES.items()},
    **{name: partial(judged, of) for name, of in JUDGED.items()},
    # What is read and made of the first crash, stage by stage
    "report_xml": lambda: report_of("record"),
    "pedestrian_xml": lambda: report_of("pedestrian_record"),
    "extract": lambda: made_of("record").extract,
    "xodr": lambda: made_of("record").xodr,
    "network": lambda: made_of("record").network,
    "map_report": lambda: made_of("record").map_report,
    "state_estimate": lambda: made_of("record").state_estimate,
    "hypothesis": lambda: made_of("record").state_estimate.hypotheses[0],
    "log": lambda: made_of("record").logs[0],
    "verdict": verdict,
    "observed_crash": lambda: observed_crash("record"),
    "first_contact": lambda: observed_crash("record").first,
    # The reported events, and beside them the observed ones
    **{f"{prefix}sequence": partial(sequence, f"{prefix}record") for prefix in ("", "pedestrian_", "tree_")},
    **{f"{prefix}comparison": partial(comparison, f"{prefix}record") for prefix in ("", "pedestrian_", "tree_")},
    "simulated_pair": lambda: simulated_bodies("record"),
    "simulated_person": lambda: simulated_bodies("pedestrian_record")[1],
    "perturbed_scene": lambda: PerturbedScene(record_of("record"), np.random.default_rng(0)),
    "package_input": package_input,
    # What the estimators make on the way
    "solution": solution,
    "strike_plan": strike_plan,
    "departure": lambda: departure_of(record_of("tree_record"), sequence_of(record_of("tree_record"))),
    "way_past_the_tree": way_past_the_tree,
    "tree": lambda: made_of("tree_record").state_estimate.hypotheses[0].objects[0],
    # How its roads are made
    "street_graph": street_graph,
    "plans": plans,
    "street_roads": street_roads,
    "bare_roads": lambda: tuple(road for each in street_roads().values() for road in each.roads),
    "tee_arms": tee_arms,
}
NAMES = frozenset(MAKERS)


@cache
def example_object(name: str) -> object:
    """What an example calls by this name."""
    return MAKERS[name]()
