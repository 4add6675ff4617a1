"""A crash as glTF: read by a reader of the standard and by trimesh, it says what the log and the map say."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
import sample_runs
import shapely
import trimesh
from scipy.spatial.transform import Rotation

from tests.scenario.solid.glb import Glb
from tests.scenario.test_people import simulated as person_struck
from tests.simulation.motions import straight
from tests.verdict.crashes import FRAME, STREET, simulated, two_way
from trace_dag.common.geometry import Pose
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.flow.stored_crashes import stored_crash
from trace_dag.flow.workspace import Workspace
from trace_dag.pages.solid.scene import crash_glb
from trace_dag.roads.map.model import Cubic
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.figures import LANDMARKS, RIDDEN_LANDMARKS
from trace_dag.simulation.objects import KINDS, FixedObject
from trace_dag.simulation.types import SimulationLog, overturned_at


@pytest.fixture(scope="module")
def log() -> SimulationLog:
    """Two cars that meet head on, each a little to its left: both are dented and turn."""
    _, log = simulated(straight(-62.35, -1.75, 0.0, 20.0), straight(47.35, -1.2, math.pi, 15.0))
    return log


@pytest.fixture(scope="module")
def sample() -> list[tuple[SimulationLog, RoadNetwork]]:
    """Crashes of the sample."""
    workspace = Workspace.open(sample_runs.finished())
    crashes = [stored_crash(workspace, key) for key in sample_runs.KEYS]
    found = [(log, each.load(ROAD_MAP)) for each in crashes if (log := each.shown_log()) is not None]
    assert found
    return found


def placed(log: SimulationLog, codes: list[int]) -> SimulationLog:
    """The same with an object of each code in a row beside the road."""
    objects = []
    for k, code in enumerate(codes):
        kind = KINDS[code]
        sizes = (kind.length_m, kind.width_m, kind.height_m)
        pose = Pose(-50.0 + 3.0 * k, 12.0, 0.3)
        objects.append(FixedObject(2000 + k, k, code, kind.name, pose, *sizes, kind.resistance))
    return replace(log, objects=tuple(objects))


def test_the_poses_are_the_logs(log) -> None:
    glb = Glb(crash_glb("2023-1", STREET, log))
    for vehicle in log.vehicles:
        name = f"V{vehicle.number}"
        places = glb.at(name, "translation", vehicle.time_s)
        expected = np.column_stack([vehicle.x_m, vehicle.y_m, vehicle.z_m + vehicle.above_road_m])
        assert np.abs(places - expected).max() < 0.005
        ahead = Rotation.from_quat(glb.at(name, "rotation", vehicle.time_s)).apply([1.0, 0.0, 0.0])
        assert np.abs(ahead[:, 0] - np.cos(vehicle.heading_rad)).max() < 0.004
        assert np.abs(ahead[:, 1] - np.sin(vehicle.heading_rad)).max() < 0.004


def test_every_body_and_object_of_the_sample_is_there_and_moves_as_in_its_log(sample) -> None:
    for log, network in sample:
        glb = Glb(crash_glb("2023-1", network, log))
        said = {each["extras"]["trace_dag"]["number"] for each in glb.of_kind("body")}
        assert said == {each.number for each in log.vehicles}
        assert len(glb.of_kind("object")) == len(log.objects)
        for vehicle in log.vehicles:
            places = glb.at(f"V{vehicle.number}", "translation", vehicle.time_s)
            assert np.abs(places[:, :2] - np.column_stack([vehicle.x_m, vehicle.y_m])).max() < 0.005


@pytest.mark.parametrize("name", ["adult before a car", "cyclist crossing"])
def test_a_person_moves_as_the_logs_landmarks(name: str) -> None:
    log = person_struck(name)
    glb = Glb(crash_glb("2023-1", STREET, log))
    person = next(each for each in log.vehicles if each.number == 1001)
    place = np.column_stack([person.x_m, person.y_m, person.z_m])
    points = dict(
        zip(
            (*LANDMARKS, *RIDDEN_LANDMARKS),
            np.split(person.landmarks_m, person.landmarks_m.shape[1] // 3, axis=1),
            strict=False,
        )
    )
    for part in ("head", "torso"):
        expected = place + points["pelvis" if part == "torso" else part]
        assert np.abs(glb.at(f"P1 {part}", "translation", person.time_s) - expected).max() < 0.005
    # A shank reaches from knee to foot: its middle is there, and its z axis along it.
    knee, foot = place + points["knee_l"], place + points["foot_l"]
    assert np.abs(glb.at("P1 shank l", "translation", person.time_s) - (knee + foot) / 2).max() < 0.005
    along = Rotation.from_quat(glb.at("P1 shank l", "rotation", person.time_s)).apply([0.0, 0.0, 1.0])
    assert np.abs(along - (foot - knee) / np.linalg.norm(foot - knee, axis=1)[:, None]).max() < 0.02
    if name == "cyclist crossing":
        hubs = place + (points["front"] + points["rear"]) / 2
        assert np.abs(glb.at("P1 bicycle", "translation", person.time_s) - hubs).max() < 0.005


def test_a_person_without_landmarks_walks_upright(log) -> None:
    struck = person_struck("adult before a car")
    vehicles = [replace(v, landmarks_m=np.zeros((len(v.time_s), 0))) for v in struck.vehicles]
    glb = Glb(crash_glb("2023-1", STREET, replace(struck, vehicles=tuple(vehicles))))
    walker = next(each for each in vehicles if each.number == 1001)
    walks = walker.time_s < struck.first_contact.time_s
    head = glb.at("P1 head", "translation", walker.time_s[walks])
    stature_m = struck.bodies[1001].height_m
    assert np.all((head[:, 2] > 0.85 * stature_m) & (head[:, 2] < stature_m)), "upright"
    feet = [glb.at(f"P1 shank {side}", "translation", walker.time_s[walks]) for side in "lr"]
    apart = np.linalg.norm(feet[0] - feet[1], axis=1)
    assert np.ptp(apart) > 0.1, "legs swing"


def test_an_overturned_vehicle_lies_on_the_side_or_the_roof(log) -> None:
    first = log.vehicles[0]
    roll = np.linspace(0.0, math.pi, len(first.time_s))
    body = log.bodies[first.number]
    rolled = replace(log, vehicles=(replace(first, roll_rad=roll), log.vehicles[1]))
    assert overturned_at(rolled.vehicles[0]) is not None
    turns = Rotation.from_quat(Glb(crash_glb("2023-1", STREET, rolled)).at("V1", "rotation", first.time_s))
    up = turns.apply([0.0, 0.0, 1.0])
    assert up[-1] == pytest.approx([0.0, 0.0, -1.0], abs=0.01)
    halfway = np.argmin(np.abs(roll - math.pi / 2))
    right = np.array([math.sin(first.heading_rad[halfway]), -math.cos(first.heading_rad[halfway]), 0.0])
    assert up[halfway] == pytest.approx(right, abs=0.02), "a positive roll is to the right"
    assert body.height_m < 2.0


def test_wheels_roll_as_far_as_the_vehicle_drives(log) -> None:
    glb = Glb(crash_glb("2023-1", STREET, log))
    first = log.vehicles[0]
    begun = first.time_s <= 1.0
    turned = Rotation.from_quat(glb.at("V1 wheel 1", "rotation", first.time_s[begun]))
    angles = np.linalg.norm((turned[:-1].inv() * turned[1:]).as_rotvec(), axis=1)
    radius_m = glb.nodes["V1 hub 1"][1]["translation"][2] + log.bodies[1].height_m / 2
    assert angles.sum() * radius_m == pytest.approx(20.0, rel=0.02), "20 m/s for a second"


def test_a_body_is_dented_as_deep_as_the_log_states(log) -> None:
    contact = log.first_contact
    glb = Glb(crash_glb("2023-1", STREET, log))
    before, after = contact.time_s - 0.01, contact.time_s + max(contact.duration_s, 0.05) + 0.01
    for number, crush_m in ((contact.number_1, contact.crush_1_m), (contact.number_2, contact.crush_2_m)):
        assert crush_m > 0.05
        _, node = glb.nodes[f"V{number} body"]
        weights = glb.at(f"V{number} body", "weights", np.array([before, after]))
        assert weights[:, 0] == pytest.approx([0.0, 1.0])
        primitives = glb.json["meshes"][node["mesh"]]["primitives"]
        moved = np.concatenate([glb.values(each["targets"][0]["POSITION"]) for each in primitives])
        assert np.linalg.norm(moved, axis=1).max() == pytest.approx(crush_m, abs=0.02)


def test_a_contact_flashes_at_its_moment(log) -> None:
    contact = log.first_contact
    glb = Glb(crash_glb("2023-1", STREET, log))
    sizes = glb.at("contact 1", "scale", np.array([0.0, contact.time_s - 0.01, contact.time_s + 0.01, 60.0]))
    assert sizes[:, 0].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert glb.nodes["contact 1"][1]["translation"] == pytest.approx([contact.x_m, contact.y_m, contact.z_m])


def test_trimesh_finds_cars_of_their_size_on_the_road(log) -> None:
    scene = trimesh.load_scene(io.BytesIO(crash_glb("2023-1", STREET, log)), file_type="glb")
    body = log.bodies[1]
    west, east = math.inf, -math.inf
    for name in scene.graph.nodes_geometry:
        if name.startswith("V1 body"):
            matrix, geometry = scene.graph[name]
            corners = trimesh.transform_points(scene.geometry[geometry].bounds, matrix)
            west, east = min(west, corners[:, 0].min()), max(east, corners[:, 0].max())
            # y is up in glTF, and the road is at height 0
            assert corners[:, 1].min() > 0.05
            assert corners[:, 1].max() < body.height_m + 0.02
    assert east - west == pytest.approx(body.length_m, abs=0.05)
    assert (east + west) / 2 == pytest.approx(log.vehicles[0].x_m[0], abs=0.03)


def test_the_road_has_the_maps_heights() -> None:
    hill = replace(two_way("1", -300.0, 0.0, 0.0, 600.0), elevation=(Cubic(0.0, 10.0, 0.05),))  # 5 % up to the east
    _, log = simulated(straight(-40.0, -1.75, 0.0, 10.0, until_s=3.0), straight(40.0, 1.75, math.pi, 10.0, until_s=3.0))
    glb = Glb(crash_glb("2023-1", RoadNetwork(FRAME, (hill,)), log))
    _, node = glb.nodes["roads and ground"]
    points = np.concatenate(
        [glb.values(each["attributes"]["POSITION"]) for each in glb.json["meshes"][node["mesh"]]["primitives"]]
    )
    on_road = np.abs(points[:, 1]) <= 3.5
    assert on_road.sum() > 50
    assert points[on_road, 2] == pytest.approx(10.0 + 0.05 * (points[on_road, 0] + 300.0), abs=0.06)


@pytest.mark.parametrize("bridge", [False, True])
@pytest.mark.parametrize("grade", [0.0, 0.05])
def test_one_surface_is_seen_where_the_road_is(log, bridge: bool, grade: float) -> None:
    elevation = (Cubic(0.0, 0.0, grade),)
    street = replace(STREET.roads[0], bridge=bridge, layer=int(bridge), elevation=elevation)
    glb = Glb(crash_glb("2023-1", RoadNetwork(FRAME, (street,)), log))
    _, node = glb.nodes["roads and ground"]
    found = []
    for each in glb.json["meshes"][node["mesh"]]["primitives"]:
        if "extras" in glb.json["materials"][each["material"]]:
            continue  # paint
        corners = glb.values(each["attributes"]["POSITION"])[glb.values(each["indices"]).astype(int).reshape(-1, 3)]
        under = shapely.intersects_xy(shapely.polygons(corners[:, :, :2]), 10.3, -1.6)
        found += corners[under].mean(axis=1)[:, 2].tolist()
    road_m = grade * 310.3
    near = [z for z in found if abs(z - road_m) < 0.5]
    assert near, "there is the road"
    assert np.ptp(near) < 0.05, "and no ground through it"


def test_every_kind_of_object_stands_where_it_is(log) -> None:
    with_objects = placed(log, sorted(KINDS))
    glb = Glb(crash_glb("2023-1", STREET, with_objects))
    nodes = glb.of_kind("object")
    assert [node["translation"][:2] for node in nodes] == [[o.pose.x_m, o.pose.y_m] for o in with_objects.objects]
    for node, item in zip(nodes, with_objects.objects, strict=True):
        primitives = glb.json["meshes"][node["mesh"]]["primitives"]
        points = np.concatenate([glb.values(each["attributes"]["POSITION"]) for each in primitives])
        assert np.ptp(points[:, 0]) >= 0.8 * item.length_m, item.name
        assert points[:, 2].max() <= item.height_m + 0.6, item.name


def test_the_same_crash_gives_the_same_bytes(log) -> None:
    assert crash_glb("2023-1", STREET, log) == crash_glb("2023-1", STREET, log)
    assert Glb(crash_glb("2023-1", STREET, log)).json["asset"]["copyright"] == STREET.attribution
