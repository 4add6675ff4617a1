"""What exporters write says what the crash says, by the standards of each form."""

from __future__ import annotations

import io
import json
import math
import pickle
import struct
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import sample_runs
import shapely
from lxml import etree

import trace_dag
from tests.roads import judges
from tests.roads.towns import Town
from trace_dag.common.errors import UserError
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.record import VehicleClass
from trace_dag.export.export import export
from trace_dag.export.formats import commonroad as commonroad_form
from trace_dag.export.formats import scenarionet
from trace_dag.export.formats.osi import trace
from trace_dag.export.formats.sumo import floating_car_data
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.roads.from_osm.left_hand import mirror_network
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.drives import STEP_S
from trace_dag.scenario.lights import Colour, crash_lights
from trace_dag.scenario.traffic.sumo_network import network_xml, origin_of
from trace_dag.scenario.traffic.surrounding import SurroundingTraffic, SurroundingVehicle, body_of_class
from trace_dag.simulation.states import Trajectory

KEY = "2023-319003"
GPX = "{http://www.topografix.com/GPX/1/1}"


@pytest.fixture(scope="module")
def home():
    return trace_dag.open(sample_runs.finished())


@pytest.fixture(scope="module")
def commonroad(home, tmp_path_factory):
    """The CommonRoad files of one crash, parsed, by name."""
    folder = tmp_path_factory.mktemp("commonroad")
    assert export(home.workspace, [KEY], folder, "commonroad") == 3
    return {file.stem: etree.parse(file).getroot() for file in folder.iterdir()}


def points(element):
    return np.array([[float(point.findtext(axis)) for axis in "xy"] for point in element.iterfind("point")])


def number(element, path):
    return float(element.findtext(path))


def test_there_is_a_planning_problem_for_each_driver_and_the_others_are_obstacles(commonroad, home):
    log = home[KEY].log
    assert sorted(commonroad) == [f"{KEY}_V1", f"{KEY}_V2", f"{KEY}_all"]
    for name, root in commonroad.items():
        if name.endswith("_all"):
            assert len(root.findall("dynamicObstacle")) == 2, "measures look for every driver among the obstacles"
            assert len(root.findall("planningProblem")) == 2, "the schema of 2020a asks for one at least"
            continue
        ego = int(name[-1])
        (problem,), (obstacle,) = root.findall("planningProblem"), root.findall("dynamicObstacle")
        own, other = (next(v for v in log.vehicles if (v.number == ego) is mine) for mine in (True, False))
        for element, vehicle in ((problem, own), (obstacle, other)):
            initial = element.find("initialState")
            np.testing.assert_allclose(points(initial.find("position"))[0], (vehicle.x_m[0], vehicle.y_m[0]), atol=0.01)
            assert number(initial, "velocity/exact") == pytest.approx(vehicle.speed_mps[0], abs=0.01)
        assert number(obstacle, "shape/rectangle/length") == pytest.approx(log.bodies[other.number].length_m, abs=1e-3)


def test_obstacles_drive_as_recorded_until_the_crash_and_on_as_if_there_were_none(commonroad, home):
    crash = home[KEY]
    contact_s = crash.log.first_contact.time_s
    obstacle = commonroad[f"{KEY}_V1"].find("dynamicObstacle")
    states = obstacle.findall("trajectory/state")
    assert [int(state.findtext("time/exact")) for state in states] == list(range(1, len(states) + 1))
    other = next(vehicle for vehicle in crash.log.vehicles if vehicle.number == 2)
    places = np.array([points(state.find("position"))[0] for state in states])
    before = np.arange(1, len(states) + 1) * STEP_S < contact_s
    times = np.arange(1, len(states) + 1)[before] * STEP_S
    logged = np.column_stack([np.interp(times, other.time_s, values) for values in (other.x_m, other.y_m)])
    assert np.hypot(*(places[before] - logged).T).max() < 0.5, "what a driver plans and what the wheels do"
    assert len(states) * STEP_S > contact_s + 4.0


def test_a_driver_has_a_file_where_its_course_meets_an_obstacle(home, monkeypatch):
    """The second vehicle drives far from the first, as one does that only a thrown vehicle would have struck."""
    stored = home[KEY].stored
    case = commonroad_form.case_of(stored, stored.settings.sim)
    away = case.participants[1]
    moved = replace(away, trajectory=replace(away.trajectory, y_m=away.trajectory.y_m + 500.0))
    monkeypatch.setattr(
        commonroad_form, "case_of", lambda *_: replace(case, participants=(case.participants[0], moved))
    )
    with pytest.raises(UserError, match="no driver in it has a collision to avoid"):
        commonroad_form.CommonRoad([KEY]).of_crash(stored)


def test_places_have_no_heights_which_the_drivability_checkers_borders_refuse(commonroad):
    assert not [z for root in commonroad.values() for z in root.iter("z")]


def test_lanelets_meet_and_refer_to_what_is_there(commonroad):
    root = commonroad[f"{KEY}_V1"]
    lanelets = {element.get("id"): element for element in root.iterfind("lanelet")}
    everything = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(everything) == len(set(everything))
    links = 0
    for lanelet in lanelets.values():
        left, right = points(lanelet.find("leftBound")), points(lanelet.find("rightBound"))
        assert left.shape == right.shape
        along, across = left[1] - left[0], left[0] - right[0]
        assert along[0] * across[1] - along[1] * across[0] > 0, "the left border is on the left"
        for successor in lanelet.iterfind("successor"):
            after = lanelets[successor.get("ref")]
            assert lanelet.get("id") in [each.get("ref") for each in after.iterfind("predecessor")]
            assert np.hypot(*(points(after.find("leftBound"))[0] - left[-1])) < 0.6
            links += 1
    assert links > len(lanelets) / 2


def test_every_way_through_a_junction_is_listed_by_the_turn_that_its_ends_make(commonroad):
    root = commonroad[f"{KEY}_V1"]
    assert root.find("scenarioTags/intersection") is not None
    lanelets = {element.get("id"): element for element in root.iterfind("lanelet")}
    turns = defaultdict(set)
    for incoming in root.iterfind("intersection/incoming"):
        entered = {each.get("ref") for each in incoming.iterfind("incomingLanelet")}
        for turn in ("Right", "Straight", "Left"):
            for each in incoming.iterfind(f"successors{turn}"):
                within = lanelets[each.get("ref")]
                assert within.findtext("laneletType") == "intersection"
                assert {before.get("ref") for before in within.iterfind("predecessor")} <= entered
                steps = np.diff(points(within.find("leftBound")), axis=0)
                headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
                turns[turn].add(round(np.degrees(headings[-1] - headings[0])))
    assert max(turns["Right"]) <= -25
    assert max(abs(turn) for turn in turns["Straight"]) < 35
    assert min(turns["Left"]) >= 25
    inside = [each for each in lanelets.values() if each.findtext("laneletType") == "intersection"]
    entered_from = [each for each in inside if each.find("predecessor") is not None]
    assert sum(1 for each in root.iter() if each.tag.startswith("successors")) == len(entered_from)


def test_lanelets_have_the_limits_signs_and_lights_of_the_map(commonroad, home):
    root, network = commonroad[f"{KEY}_V1"], home[KEY].stored.load(ROAD_MAP)
    signs = {each.get("id"): each.findtext("trafficSignElement/trafficSignID") for each in root.iterfind("trafficSign")}
    limits = {
        each.get("id"): number(each, "trafficSignElement/additionalValue")
        for each in root.iterfind("trafficSign")
        if signs[each.get("id")] == "274"
    }
    said = [limits[ref.get("ref")] for ref in root.iterfind("lanelet/trafficSignRef") if ref.get("ref") in limits]
    posted = [shape.speed_mps for shape in lane_shapes(network, drivable_only=True) if shape.speed_mps is not None]
    assert sorted(said) == pytest.approx(sorted(posted), abs=1e-3), "metres a second, as CommonRoad has limits"
    on_the_map = [signal for road in network.roads for signal in road.signals]
    for sign in ("205", "206"):  # to yield, to stop: of Zamunda as on the map
        assert list(signs.values()).count(sign) == sum(signal.type == sign for signal in on_the_map)
    assert "206" in signs.values()
    assert len(root.findall("trafficLight")) == sum(signal.type == "1000001" for signal in on_the_map) > 0
    referred = {ref.get("ref") for name in ("Sign", "Light") for ref in root.iterfind(f"lanelet/traffic{name}Ref")}
    assert referred == {each.get("id") for name in ("Sign", "Light") for each in root.iterfind(f"traffic{name}")}


def test_lights_and_stop_signs_have_a_stop_line_across_the_lane(commonroad):
    root = commonroad[f"{KEY}_V1"]
    stops = {each.get("id") for each in root.iterfind("trafficSign") if each.findtext(".//trafficSignID") == "206"}
    lines = 0
    for lanelet in root.iterfind("lanelet"):
        held = lanelet.find("trafficLightRef") is not None
        held |= any(ref.get("ref") in stops for ref in lanelet.iterfind("trafficSignRef"))
        line = lanelet.find("stopLine")
        assert (line is not None) == held
        if line is not None:
            lane = shapely.Polygon(
                np.concatenate([points(lanelet.find("leftBound")), points(lanelet.find("rightBound"))[::-1]])
            )
            across = shapely.LineString(points(line))
            assert lane.buffer(0.05).contains(across)
            assert across.length > 2.0
            lines += 1
    assert lines


def test_a_scenario_description_has_everybody_and_the_lanes_they_drive_on(home, tmp_path):
    assert export(home.workspace, [KEY], tmp_path, "scenarionet") == 3
    (name,) = pickle.loads((tmp_path / "dataset_summary.pkl").read_bytes())
    data = (tmp_path / name).read_bytes()
    assert b"numpy._core" not in data  # NumPy before 1.26 has no module of this name
    scenario = pickle.loads(data)
    assert scenario["tracks"]["V1"]["state"]["position"].flags.writeable  # MetaDrive moves the origin in place
    log, length = home[KEY].log, scenario["length"]
    assert scenario["metadata"]["sdc_id"] in scenario["tracks"]
    for vehicle in log.vehicles:
        state = scenario["tracks"][f"V{vehicle.number}"]["state"]
        assert {len(values) for values in state.values()} == {length}
        np.testing.assert_allclose(state["position"][0, :2], (vehicle.x_m[0], vehicle.y_m[0]), atol=0.01)
        np.testing.assert_allclose(np.diff(state["position"][:, :2], axis=0) / STEP_S, state["velocity"][1:], atol=1.0)
    lanes = {name: each for name, each in scenario["map_features"].items() if each["type"].startswith("LANE")}
    for lane in lanes.values():
        for after in lane["exit_lanes"]:
            assert np.hypot(*(lanes[after]["polyline"][0] - lane["polyline"][-1])[:2]) < 0.6


def test_lights_show_in_each_form_what_the_parties_met(home, tmp_path, commonroad):
    """A car turns left across a motorcycle, at the same light: both had green, and who crosses them has red."""
    crash = home[KEY]
    (lights,) = crash_lights(crash.record, crash.stored.load(ROAD_MAP), crash.log)
    assert [each.shown for each in lights.met] == [Colour.GREEN, Colour.GREEN]
    export(home.workspace, [KEY], tmp_path, "scenarionet")
    scenario = pickle.loads(next(tmp_path.glob("sd_*")).read_bytes())
    shown = [each["state"]["object_state"] for each in scenario["dynamic_map_states"].values()]
    assert {len(each) for each in shown} == {scenario["length"]}
    root = commonroad[f"{KEY}_V1"]
    cycles = [
        [(int(each.findtext("duration")), each.findtext("color")) for each in light.iterfind("cycle/cycleElement")]
        for light in root.iterfind("trafficLight")
    ]
    assert all(sum(steps for steps, _ in cycle) == round(90.0 / STEP_S) for cycle in cycles)
    for met in lights.met:
        now = {signal_id: cycle.at(met.time_s) for signal_id, cycle in lights.cycle_of.items()}
        step = round(met.time_s / STEP_S)
        in_cycles = [
            next(c for k, (_, c) in enumerate(one) if step < sum(s for s, _ in one[: k + 1])) for one in cycles
        ]
        assert sorted(in_cycles) == sorted(now.values())
        assert {each[step] for each in shown} == {f"TRAFFIC_LIGHT_{colour.upper()}" for colour in now.values()}
        assert set(now.values()) == {Colour.GREEN, Colour.RED}


def test_vehicles_around_the_crash_are_there_from_when_they_come_until_they_leave(home, tmp_path, monkeypatch):
    """A bus goes east at 10 m/s from 1.0 to 2.0 s."""
    times = np.arange(10, 21) * 0.1
    still = np.zeros(11)
    way = Trajectory(times, 200.0 + 10.0 * (times - 1.0), still + 50.0, still, still, still + 10.0)
    bus = SurroundingVehicle(4001, body_of_class(VehicleClass.BUS), way)
    for form in (commonroad_form, scenarionet):
        monkeypatch.setattr(form, "traffic_of", lambda _: SurroundingTraffic((bus,), 0, ()))
    export(home.workspace, [KEY], tmp_path / "commonroad", "commonroad")
    root = etree.parse(tmp_path / "commonroad" / f"{KEY}_V1.xml").getroot()
    (obstacle,) = (each for each in root.iterfind("dynamicObstacle") if each.findtext("type") == "bus")
    moments = [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]
    assert [int(each.findtext("time/exact")) for each in moments] == list(range(10, 21))
    assert [number(each, "position/point/x") for each in moments] == pytest.approx(np.linspace(200.0, 210.0, 11))
    export(home.workspace, [KEY], tmp_path / "scenarionet", "scenarionet")
    track = pickle.loads(next((tmp_path / "scenarionet").glob("sd_*")).read_bytes())["tracks"]["S1"]
    assert np.flatnonzero(track["state"]["valid"]).tolist() == list(range(10, 21))
    assert track["state"]["position"][15, 0] == pytest.approx(205.0)
    assert track["metadata"]["track_length"] == len(track["state"]["valid"])


def test_a_lone_vehicle_is_the_ego_of_the_description(home, monkeypatch):
    stored = home[KEY].stored
    case = scenarionet.case_of(stored, stored.settings.sim)
    alone = replace(case, participants=case.participants[1:], recorded=replace(case.recorded, contacts=()))
    monkeypatch.setattr(scenarionet, "case_of", lambda *_: alone)
    (data,) = scenarionet.ScenarioNet([KEY]).of_crash(stored).values()
    description = pickle.loads(data)
    assert description["metadata"]["sdc_id"] == "V2"
    assert list(description["tracks"]) == ["V2"]


def test_floating_cars_are_where_the_log_has_their_fronts(home):
    log = home[KEY].log
    root = etree.fromstring(floating_car_data(log))
    for number, vehicle in enumerate(log.vehicles, 1):
        first = root.find("timestep").findall("vehicle")[number - 1]
        ahead_m = log.bodies[vehicle.number].length_m / 2
        heading = vehicle.heading_rad[0]
        assert float(first.get("x")) == pytest.approx(vehicle.x_m[0] + ahead_m * math.cos(heading), abs=1e-3)
        assert float(first.get("y")) == pytest.approx(vehicle.y_m[0] + ahead_m * math.sin(heading), abs=1e-3)
        clockwise = math.radians(float(first.get("angle")))  # from north
        assert (math.sin(clockwise), math.cos(clockwise)) == pytest.approx(
            (math.cos(heading), math.sin(heading)), abs=1e-3
        )


def test_a_network_for_sumo_keeps_its_places_and_the_same_map_gives_the_same_bytes(home, tmp_path, monkeypatch):
    monkeypatch.setenv("SUMO_HOME", str(judges.sumo_home()))
    assert export(home.workspace, [KEY], tmp_path, "sumo") == 2
    assert export(home.workspace, [KEY], tmp_path, "sumo") == 0
    location = etree.parse(tmp_path / f"{KEY}.net.xml").find("location")
    assert location.get("netOffset") == "0.00,0.00"
    assert "+proj=tmerc" in location.get("projParameter")


def test_in_sumo_the_higher_road_has_priority_and_a_lane_without_limit_its_classs_usual_speed():
    """A primary road of one lane meets a wider side street, which a stop sign does not help; netconvert's own numbers
    are priority 1, 13.89 m/s, and 1.39 m/s on a centre turn lane.
    """
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="primary", lanes="3", turn__lanes__both_ways="left")
    town.street([(0, -200), (0, 0), (0, 200)], highway="residential", lanes="4")
    town.street([(200, 0), (400, 0)], highway="primary", lanes="2", maxspeed="30 mph")
    town.street([(200, -200), (200, 0)], highway="secondary", lanes="2")
    town.sign(200, 0, highway="stop")
    network = town.network()
    program = judges.judges_environment() / "netconvert"
    root = etree.fromstring(network_xml(str(program), "town", network, write_opendrive(network)))
    speeds_mph = defaultdict(set)
    for lane in root.iterfind("edge[@priority]/lane"):
        assumed = lane.find("param[@key='assumedSpeed']") is not None
        speeds_mph[int(lane.getparent().get("priority"))].add((round(mps_to_mph(float(lane.get("speed")))), assumed))
    # 45 and 25 mph are usual on primary roads and residential streets; priority 0 is the stop sign's.
    assert speeds_mph == {6: {(45, True), (30, False)}, 2: {(25, True)}, 5: {(45, True)}, 0: {(45, True)}}
    names = {edge.get("id"): edge.get("priority") for edge in root.iterfind("edge[@priority]")}
    ahead = {
        (names[c.get("from")], c.get("state")) for c in root.iterfind("connection[@dir='s']") if c.get("from") in names
    }
    assert ahead == {("6", "M"), ("2", "m")}


def test_in_sumo_traffic_keeps_left_where_the_map_does():
    """The eastbound lane lies north of a street to the east, the side street's southbound one east of it."""
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="primary", lanes="2", maxspeed="45 mph")
    town.street([(0, -200), (0, 0)], highway="residential", lanes="2", maxspeed="25 mph")
    network = mirror_network(town.network())
    program = judges.judges_environment() / "netconvert"
    root = etree.fromstring(network_xml(str(program), "town", network, write_opendrive(network)))
    lanes = root.findall("edge[@priority]/lane")
    assert len(lanes) == 6
    for lane in lanes:
        points = [[float(value) for value in point.split(",")] for point in lane.get("shape").split()]
        (x0, y0), (x1, y1) = points[0], points[-1]
        left_of_street = (x1 > x0 and y0 > 0) or (x1 < x0 and y0 < 0)
        assert left_of_street if abs(y1 - y0) < 1 else (x0 > 0) == (y1 < y0)
        road_id, lane_id = origin_of(lane)
        there = network.nearest_lanes((x0 + x1) / 2, (y0 + y1) / 2, 1.0)[0].lane
        assert (there.road_id, there.lane_id) == (road_id, int(lane_id))


def test_a_trace_has_a_message_for_every_moment(home, tmp_path):
    groundtruth = pytest.importorskip("osi3.osi_groundtruth_pb2")
    assert export(home.workspace, [KEY], tmp_path, "osi") == 1
    data, messages = (tmp_path / f"{KEY}_gt.osi").read_bytes(), []
    while data:
        (size,) = struct.unpack_from("<I", data)
        messages.append(groundtruth.GroundTruth.FromString(data[4 : 4 + size]))
        data = data[4 + size :]
    log = home[KEY].log
    assert len(messages) == pytest.approx(log.duration_s / 0.05, abs=1.5)
    for message in (messages[0], messages[40]):
        time_s = message.timestamp.seconds + message.timestamp.nanos / 1e9
        for moving, vehicle in zip(message.moving_object, log.vehicles, strict=True):
            for axis in "xy":
                logged = np.interp(time_s, vehicle.time_s, getattr(vehicle, f"{axis}_m"))
                assert getattr(moving.base.position, axis) == pytest.approx(logged, abs=1e-6)
    assert messages[0].lane
    assert not messages[1].lane, "what does not move is said once"


def test_a_trace_has_the_lights_signs_lines_and_conditions_of_map_and_report(home):
    groundtruth = pytest.importorskip("osi3.osi_groundtruth_pb2")
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="primary", name="Avenue", lanes="4", maxspeed="45 mph")
    town.street([(0, -200), (0, 0), (0, 200)], highway="secondary", name="Cross", lanes="2")
    town.street([(200, -200), (200, -20), (200, 0)], highway="residential", name="Side", lanes="2")
    town.street([(200, 0), (400, 0)], highway="primary", name="Avenue", lanes="4", maxspeed="45 mph")
    town.sign(0, 0, highway="traffic_signals")
    town.sign(200, -20, highway="stop", direction="forward")
    network = town.network()
    record = replace(home[KEY].record, light_code=3, weather_code=2, hour=21, minute=30)
    data = trace(network, home[KEY].log, record)
    (size,) = struct.unpack_from("<I", data)
    first = groundtruth.GroundTruth.FromString(data[4 : 4 + size])
    lanes = {lane.id.value: lane for lane in first.lane}
    lamps = defaultdict(dict)
    for lamp in first.traffic_light:
        lamps[lamp.base.position.x, lamp.base.position.y][lamp.classification.color] = lamp
    kind = first.traffic_light[0].classification
    for one in lamps.values():  # three above each other, one of them lit
        red, yellow, green = (one[kind.Color.Value(f"COLOR_{name}")] for name in ("RED", "YELLOW", "GREEN"))
        assert red.base.position.z > yellow.base.position.z > green.base.position.z
        assert sorted(lamp.classification.mode for lamp in one.values()) == [kind.MODE_OFF] * 2 + [kind.MODE_CONSTANT]
    assert sorted(len(one[kind.COLOR_RED].classification.assigned_lane_id) for one in lamps.values()) == [1, 1, 2, 2]
    for light in first.traffic_light:  # stands right of its lanes and looks at who comes
        line = lanes[light.classification.assigned_lane_id[0].value].classification.centerline
        way = math.atan2(line[-1].y - line[-2].y, line[-1].x - line[-2].x)
        assert math.cos(light.base.orientation.yaw - way) == pytest.approx(-1.0, abs=1e-3)
    about = [sign.main_sign.classification for sign in first.traffic_sign]
    kinds = about[0].Type
    assert {kinds.Name(each.type) for each in about} == {"TYPE_STOP", "TYPE_SPEED_LIMIT_BEGIN"}
    assert {each.value.value for each in about if each.type == kinds.Value("TYPE_SPEED_LIMIT_BEGIN")} == {45.0}
    lines = {(each.classification.type, each.classification.color) for each in first.lane_boundary}
    kind = first.lane_boundary[0].classification
    assert (kind.TYPE_SOLID_LINE, kind.COLOR_YELLOW) in lines, "the centre line of a four-lane road"
    assert (kind.TYPE_DASHED_LINE, kind.COLOR_WHITE) in lines, "between lanes of one direction"
    told = first.environmental_conditions
    assert told.time_of_day.seconds_since_midnight == 21 * 3600 + 30 * 60
    assert told.AmbientIllumination.Name(told.ambient_illumination) == "AMBIENT_ILLUMINATION_LEVEL4"
    assert told.Precipitation.Name(told.precipitation) == "PRECIPITATION_MODERATE"
    assert told.sun.elevation < 0.0


def test_tags_agree_with_the_report(home, tmp_path):
    assert export(home.workspace, [KEY], tmp_path, "openlabel") == 1
    document = json.loads((tmp_path / f"{KEY}.json").read_text())["openlabel"]
    tags = {tag["type"]: tag for tag in document["tags"].values()}
    record = home[KEY].record
    assert tags["scenarioDescription"]["tag_data"]["text"][0]["val"] == record.summary
    assert ("IlluminationDay" in tags) == (record.light_code == 1)
    assert ("IntersectionCrossroad" in tags) == (record.intersection_type_code == 2)
    assert any(name.startswith("Vehicle") for name in tags)


def test_points_lie_where_the_reports_say(home, tmp_path):
    keys = sorted(home.crashes.query("final_state == 'verified'").index)
    assert export(home.workspace, keys, tmp_path, "points") == 2
    data = (tmp_path / "crashes.parquet").read_bytes()
    table = pq.read_table(io.BytesIO(data))
    about = json.loads(table.schema.metadata[b"geo"])
    assert (about["version"], about["primary_column"]) == ("1.1.0", "geometry")
    assert about["columns"]["geometry"]["encoding"] == "WKB"
    waypoints = etree.parse(tmp_path / "crashes.gpx").getroot().findall(f"{GPX}wpt")
    assert table.column("key").to_pylist() == keys == [point.findtext(f"{GPX}name") for point in waypoints]
    for key, wkb, point in zip(keys, table.column("geometry").to_pylist(), waypoints, strict=True):
        record = home[key].record
        place = shapely.from_wkb(wkb)
        assert (place.x, place.y) == (record.longitude_deg, record.latitude_deg)
        assert float(point.get("lat")) == pytest.approx(record.latitude_deg, abs=1e-7)


def test_an_unknown_format_is_named(home, tmp_path):
    with pytest.raises(UserError, match="no exporter 'nonsense' is installed; expected one of commonroad"):
        export(home.workspace, [KEY], tmp_path, "nonsense")
