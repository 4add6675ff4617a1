"""The readers of each form, as judges: run by ``lab/formats.py``, each in an environment with its reader alone.

    python -m lab format_judges JUDGES FOLDER

Prints a line of JSON per judge: name, version, numbers of files and of accepted files, and its remarks. Nothing of
trace-dag is imported: what these say rests on the files alone.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

_CAR_M = (4.5, 1.8)
_VALIDATOR = "gltf-validator@2.0.0-dev.3.10"
_VALIDATE = """
import { readFileSync } from "node:fs";
import validator from "gltf-validator";
const files = process.argv.slice(2).map((name) => new Uint8Array(readFileSync(name)));
console.log(JSON.stringify(await Promise.all(files.map((each) => validator.validateBytes(each)))));
"""


class Verdict(NamedTuple):
    """A judge's verdict on a form: ``taken`` of ``files`` had nothing wrong; ``says`` holds its remarks."""

    judge: str
    files: int
    taken: int
    says: str = ""


def commonroad(folder: Path) -> Iterator[Verdict]:
    """Yield the reader of commonroad-io, what it finds in the networks, and the schema that comes with it."""
    import logging

    import commonroad.common.file_reader as reading
    from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
    from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter
    from lxml import etree

    logging.disable(logging.CRITICAL)  # it names each element of an intersection whose name the next format changed
    files = sorted(folder.glob("*.xml"))
    lanelets = problems = read = on_a_lanelet = signs = lights = stop_lines = limits = 0
    for file in files:
        scenario, planning = reading.CommonRoadFileReader(str(file)).open()
        network = scenario.lanelet_network
        lanelets, signs = lanelets + len(network.lanelets), signs + len(network.traffic_signs)
        lights += len(network.traffic_lights)
        stop_lines += sum(each.stop_line is not None for each in network.lanelets)
        limit_of = TrafficSignInterpreter(SupportedTrafficSignCountry.ZAMUNDA, network).speed_limit
        limits += sum(limit_of(frozenset([each.lanelet_id])) is not None for each in network.lanelets)
        found = list(planning.planning_problem_dict.values())
        problems, read = problems + len(found), read + bool(found)
        on_a_lanelet += all(network.find_lanelet_by_position([each.initial_state.position])[0] for each in found)
    who = f"commonroad-io {version('commonroad-io')}"
    says = (
        f"{lanelets} lanelets, {limits} of them with a limit; {signs} signs, {lights} lights, {stop_lines} stop lines, "
        f"{problems} planning problems"
    )
    yield Verdict(f"{who}, reader", len(files), read, says)
    yield Verdict(f"{who}, drivers begin on a lanelet", len(files), on_a_lanelet)
    (path,) = Path(reading.__file__).parents[1].rglob("XML_commonRoad_XSD.xsd")
    schema = etree.XMLSchema(etree.parse(str(path)))
    valid = sum(schema.validate(etree.parse(str(file))) for file in files)
    yield Verdict(f"{who}, schema 2020a", len(files), valid)


def lanelet2(folder: Path) -> Iterator[Verdict]:
    """Yield the loader of Lanelet2, and its graph: where one lanelet ends and another begins, the way leads on."""
    from xml.etree import ElementTree

    from lanelet2 import io, projection, routing, traffic_rules

    rules = traffic_rules.create(traffic_rules.Locations.Germany, traffic_rules.Participants.Vehicle)  # it has no other
    files = sorted(folder.glob("*.osm"))
    clean = linked = lanelets = ways_on = elements = limits = 0
    for file in files:
        node = next(ElementTree.parse(file).iter("node"))
        origin = io.Origin(float(node.get("lat", "")), float(node.get("lon", "")))
        network, errors = io.loadRobust(str(file), projection.LocalCartesianProjector(origin))
        graph = routing.RoutingGraph(network, rules)
        clean += not len(errors) and not len(graph.checkValidity(False))
        open_to_all = [each for each in network.laneletLayer if rules.canPass(each)]
        begins: dict[tuple[float, ...], list[int]] = {}
        for each in open_to_all:
            begins.setdefault(_corners(each, 0), []).append(each.id)
        pairs = {(each.id, after) for each in open_to_all for after in begins.get(_corners(each, 1), ())}
        linked += pairs == {(each.id, after.id) for each in open_to_all for after in graph.following(each)}
        lanelets, ways_on = lanelets + len(network.laneletLayer), ways_on + len(pairs)
        elements += len(network.regulatoryElementLayer)
        limited = [each for each in open_to_all if "speed_limit" in each.attributes]
        limits += sum(
            abs(rules.speedLimit(each).speedLimit - float(each.attributes["speed_limit"])) < 0.1 for each in limited
        )
    who = f"lanelet2 {version('lanelet2')}"
    says = f"{lanelets} lanelets, {limits} of them with a limit; {elements} regulatory elements"
    yield Verdict(f"{who}, loader", len(files), clean, says)
    yield Verdict(f"{who}, routing graph", len(files), linked, f"{ways_on} connections from lanelet to lanelet")


def _corners(lanelet: Any, end: int) -> tuple[float, ...]:
    """Return the places of both borders at the begin (0) or the end (1) of a lanelet, to the millimetre."""
    points = [border[end * (len(border) - 1)] for border in (lanelet.leftBound, lanelet.rightBound)]
    return tuple(round(value, 3) for point in points for value in (point.x, point.y))


def scenarionet(folder: Path) -> Iterator[Verdict]:
    """Yield MetaDrive's check, and its engine replaying everybody."""
    import logging

    import metadrive

    # The engine fetches its pictures and shapes at its first start. Without a window it shows none: an empty folder
    # with the version it looks for stands in for them.
    assets = Path(metadrive.__file__).parent / "assets"
    if not assets.exists():
        (assets / "textures" / "grass1").mkdir(parents=True)
        (assets / "version.txt").write_text(version("metadrive-simulator"))
        (assets / "textures" / "grass1" / "GroundGrassGreen002_COL_1K.jpg").touch()
    from metadrive.envs.scenario_env import ScenarioEnv
    from metadrive.policy.replay_policy import ReplayEgoCarPolicy
    from metadrive.scenario.scenario_description import ScenarioDescription
    from metadrive.scenario.utils import read_dataset_summary, read_scenario_data

    _, names, where = read_dataset_summary(folder)
    for name in names:
        ScenarioDescription.sanity_check(read_scenario_data(folder / where[name] / name))
    who = f"metadrive-simulator {version('metadrive-simulator')}"
    yield Verdict(f"{who}, sanity_check", len(names), len(names))
    env = ScenarioEnv(
        {
            "data_directory": str(folder),
            "num_scenarios": len(names),
            "agent_policy": ReplayEgoCarPolicy,
            "use_render": False,
            "log_level": logging.ERROR,
            "store_map": False,
            "store_data": False,
            "crash_vehicle_done": False,
            "use_bounding_box": True,  # otherwise vehicles have the size of one of its models
            "force_destroy": True,  # a box that another scenario left behind has no lane
        }
    )
    ended = steps = contacts = 0
    farthest_m = 0.0
    for number in range(len(names)):
        env.reset(seed=number)
        scenario = env.engine.data_manager.current_scenario  # the engine moves it to where the ego starts
        track = scenario["tracks"][scenario["metadata"]["sdc_id"]]["state"]["position"]
        over, step, met = False, 0, False
        while not over and step < scenario["length"]:
            _, _, terminated, truncated, said = env.step([0, 0])
            met |= said["crash"]
            over, step = terminated or truncated, step + 1
            x_m, y_m = env.agent.position
            near = track[max(step - 1, 0) : step + 2, :2] - (x_m, y_m)
            farthest_m = max(farthest_m, float((near**2).sum(axis=1).min() ** 0.5))
        ended, steps, contacts = ended + 1, steps + step, contacts + met
    env.close()
    yield Verdict(
        f"{who}, engine, all replayed",
        len(names),
        ended,
        f"{steps} steps; ego at most {farthest_m:.2f} m off its track; contact reported in {contacts}",
    )


def sumo(folder: Path) -> Iterator[Verdict]:
    """Yield SUMO itself, its schema, and sumolib."""
    import sumo as home
    import sumolib
    import xmlschema

    who, nets = f"eclipse-sumo {version('eclipse-sumo')}", sorted(folder.glob("*.net.xml"))
    ran = 0
    for net in nets:
        command = [str(Path(home.SUMO_HOME) / "bin" / "sumo"), "--net-file", str(net), "--end", "1", "--no-step-log"]
        done = subprocess.run([*command, "--xml-validation.net", "never"], capture_output=True, check=False)
        ran += done.returncode == 0
    yield Verdict(f"{who}, sumo runs the network", len(nets), ran)
    traces = sorted(folder.glob("*.fcd.xml"))
    schema = xmlschema.XMLSchema(str(Path(home.SUMO_HOME) / "data" / "xsd" / "fcd_file.xsd"))
    yield Verdict(f"{who}, fcd_file.xsd", len(traces), sum(schema.is_valid(str(trace)) for trace in traces))
    on_a_lane = vehicles = edges = 0
    for net, trace in zip(nets, traces, strict=True):
        network = sumolib.net.readNet(str(net))
        edges += len(network.getEdges())
        first = next(iter(sumolib.xml.parse(str(trace), "timestep")))
        for vehicle in first.vehicle or []:
            vehicles += 1
            on_a_lane += bool(network.getNeighboringLanes(float(vehicle.x), float(vehicle.y), 3.0))
    says = f"{edges} edges; {on_a_lane} of {vehicles} vehicles begin within 3 m of a lane's centre"
    yield Verdict(f"sumolib {version('sumolib')}", len(nets), len(nets), says)


def osi(folder: Path) -> Iterator[Verdict]:
    """Yield two readers of traces; the second has its own reading of the messages."""
    import betterosi
    from osi_utilities import ChannelSpecification, MessageType, open_channel

    files = sorted(folder.glob("*.osi"))
    messages = 0
    for file in files:
        with open_channel(ChannelSpecification(path=file, message_type=MessageType.GROUND_TRUTH)) as channel:
            messages += sum(1 for _ in channel)
    yield Verdict(f"asam-osi-utilities {version('asam-osi-utilities')}", len(files), len(files), f"{messages} messages")
    good = lanes = moments = 0
    for file in files:
        truth = list(betterosi.read(str(file)))
        times = [each.timestamp.seconds + each.timestamp.nanos / 1e9 for each in truth]
        ids = {lane.id.value for lane in truth[0].lane}
        linked = {
            pairing.successor_lane_id.value
            for lane in truth[0].lane
            for pairing in lane.classification.lane_pairing
            if pairing.successor_lane_id is not None
        }
        good += times == sorted(times) and bool(ids) and linked <= ids and all(each.moving_object for each in truth)
        lanes, moments = lanes + len(ids), moments + len(truth)
    says = f"{moments} moments in order, {lanes} lanes whose links hold"
    yield Verdict(f"betterosi {version('betterosi')}", len(files), good, says)


def omega(folder: Path) -> Iterator[Verdict]:
    """Yield omega-prime, which reads everybody's motion and the lanes of traces of OSI."""
    import warnings

    import omega_prime

    warnings.simplefilter("ignore")  # traces are in the frame of their map already
    files = sorted(folder.glob("*.osi"))
    opened = valid = rows = lanes = 0
    for file in files:
        recording = omega_prime.Recording.from_file(str(file), parse_map=True)
        opened += len(recording.df) > 0 and len(recording.map.lanes) > 0
        rows, lanes = rows + len(recording.df), lanes + len(recording.map.lanes)
        try:
            omega_prime.Recording.from_file(str(file), validate=True)
            valid += 1
        except Exception as error:
            print(f"{file.name}: {' '.join(str(error).split())[:500]}", file=sys.stderr)
    says = f"{rows} states, {lanes} lanes; {valid} valid by its own schema too"
    yield Verdict(f"omega-prime {version('omega-prime')}", len(files), opened, says)


def designer(folder: Path) -> Iterator[Verdict]:
    """Yield CommonRoad's designer, which makes lanelets of OpenDRIVE."""
    import logging
    import warnings

    from crdesigner.map_conversion.map_conversion_interface import opendrive_to_commonroad

    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    files = sorted(folder.rglob("map.xodr"))
    made = lanelets = 0
    for file in files:
        try:
            found = len(opendrive_to_commonroad(file).lanelet_network.lanelets)
        except Exception as error:
            print(f"{file}: {type(error).__name__}: {error}", file=sys.stderr)
            continue
        made, lanelets = made + (found > 0), lanelets + found
    who = f"commonroad-scenario-designer {version('commonroad-scenario-designer')}, opendrive_to_commonroad"
    yield Verdict(who, len(files), made, f"{lanelets} lanelets")


def drivability(folder: Path) -> Iterator[Verdict]:
    """Yield the drivability checker: each driver begins within its road boundary, and free of the obstacles."""
    import logging

    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad_dc import pycrcc
    from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_checker

    logging.disable(logging.CRITICAL)
    files = sorted(folder.glob("*_V*.xml"))
    free = segments = 0
    for file in files:
        scenario, planning = CommonRoadFileReader(str(file)).open()
        boundary = create_road_boundary_obstacle(scenario, return_scenario_obstacle=False)
        (problem,) = planning.planning_problem_dict.values()
        begin = problem.initial_state
        body = pycrcc.TimeVariantCollisionObject(0)
        body.append_obstacle(pycrcc.RectOBB(_CAR_M[0] / 2, _CAR_M[1] / 2, begin.orientation, *begin.position))
        on_boundary = pycrcc.CollisionChecker()
        on_boundary.add_collision_object(boundary)
        free += not create_collision_checker(scenario).collide(body) and not on_boundary.collide(body)
        segments += len(boundary.unpack())
    who = f"commonroad-drivability-checker {version('commonroad-drivability-checker')}"
    says = f"{segments} segments of road boundary; drivers begin free of it and of the obstacles"
    yield Verdict(who, len(files), free, says)


def crime(folder: Path) -> Iterator[Verdict]:
    """Yield commonroad-crime: measures of all parties in pairs, each computed at the first step."""
    import logging
    import warnings
    from itertools import permutations

    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad_crime import measure
    from commonroad_crime.data_structure.configuration import CriMeConfiguration

    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    files = sorted(folder.glob("*_all.xml"))
    names = ("DCE", "TTCE", "WTTC", "HW", "TTC", "PET")
    failed: Counter[str] = Counter()
    pairs = taken = 0
    for file in files:
        scenario, _ = CommonRoadFileReader(str(file)).open(lanelet_assignment=True)
        before = failed.total()
        for ego, other in permutations([each.obstacle_id for each in scenario.dynamic_obstacles], 2):
            configuration = CriMeConfiguration()
            configuration.update(ego_id=ego, sce=scenario)
            pairs += 1
            for name in names:
                try:
                    getattr(measure, name)(configuration).compute(vehicle_id=other, time_step=0, verbose=False)
                except Exception as error:
                    print(f"{file.name}: {name}: {type(error).__name__}: {error}", file=sys.stderr)
                    failed[name] += 1
        taken += failed.total() == before
    says = f"{', '.join(names)} of {pairs} pairs"
    if failed:
        says += f"; an exception in {', '.join(f'{name} of {count}' for name, count in failed.items())}"
    yield Verdict(f"commonroad-crime {version('commonroad-crime')}", len(files), taken, says)


def esmini(folder: Path) -> Iterator[Verdict]:
    """Yield esmini, which is on no registry: that of ``ESMINI``, or the one on the path."""
    program = os.environ.get("ESMINI") or shutil.which("esmini")
    if program is None:
        yield Verdict("esmini", 0, 0, "not here: set ESMINI to the program")
        return
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=False).stdout
    number = re.search(r"\d+\.\d+\.\d+", said)
    files = sorted(folder.resolve().rglob("scenario.xosc"))
    ended = collided = wrong = 0
    for file in files:
        command = [program, "--osc", str(file), "--headless", "--collision", "--fixed_timestep", "0.01"]
        with tempfile.TemporaryDirectory() as temporary:  # it writes its log where it runs
            done = subprocess.run(command, cwd=temporary, capture_output=True, text=True, check=False)
        ended += done.returncode == 0
        collided += "Collision between" in done.stdout
        wrong += "[error]" in done.stdout
    says = f"{collided} with a collision of parties; {wrong} with an error"
    yield Verdict(f"esmini {number.group() if number else 'without a version number'}", len(files), ended, says)


def gltf(folder: Path) -> Iterator[Verdict]:
    """Yield the Khronos validator, which needs node and npm."""
    if shutil.which("npm") is None:
        yield Verdict(_VALIDATOR.replace("@", " "), 0, 0, "not here: needs npm")
        return
    files = sorted(folder.glob("*.glb"))
    with tempfile.TemporaryDirectory() as temporary:
        script = Path(temporary) / "validate.mjs"
        script.write_text(_VALIDATE)
        subprocess.run(["npm", "install", "--silent", "--no-audit", _VALIDATOR], cwd=temporary, check=True)
        command = ["node", str(script), *map(str, files)]
        reports = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    clean = sum(not each["issues"]["numErrors"] + each["issues"]["numWarnings"] for each in reports)
    moving = sum(each["info"]["animationCount"] for each in reports)
    triangles = sum(each["info"]["totalTriangleCount"] for each in reports)
    says = f"{triangles} triangles, {moving} animations, no error or warning in {clean}"
    yield Verdict(_VALIDATOR.replace("@", " "), len(files), clean, says)


def openlabel(folder: Path) -> Iterator[Verdict]:
    """Yield ASAM's schema and the checks of openlabel-checker."""
    files = sorted(folder.glob("*.json"))
    program = str(Path(sys.executable).with_name("openlabel-check"))
    clean = tags = 0
    for file in files:
        done = subprocess.run([program, str(file), "--json"], capture_output=True, text=True, check=False)
        summary = json.loads(done.stdout)["summary"]
        clean += not any(summary.values())
        tags += len(json.loads(file.read_text())["openlabel"]["tags"])
    who = f"openlabel-checker {version('openlabel-checker')}, schema 1.0.0"
    yield Verdict(who, len(files), clean, f"{tags} tags, no error, warning or note")


def points(folder: Path) -> Iterator[Verdict]:
    """Yield geopandas, DuckDB, GDAL by way of GeoPackage, and gpxpy."""
    import duckdb
    import geopandas
    import gpxpy
    import pyogrio

    frame = geopandas.read_parquet(folder / "crashes.parquet")
    in_place = (frame.geometry.x == frame.longitude_deg) & (frame.geometry.y == frame.latitude_deg)
    says = f"{frame.crs.name}, geometry {frame.geometry.geom_type.unique()[0]}, at the reported places"
    yield Verdict(f"geopandas {version('geopandas')}", len(frame), int(in_place.sum()), says)
    table = duckdb.connect().read_parquet(str(folder / "crashes.parquet"))
    kind = str(table.types[table.columns.index("geometry")])
    says = f"geometry is {kind}; functions of places need its extension spatial"
    yield Verdict(f"duckdb {version('duckdb')}", len(frame), len(table), says)
    with tempfile.TemporaryDirectory() as temporary:
        frame.to_file(Path(temporary) / "crashes.gpkg", driver="GPKG")
        again = pyogrio.read_dataframe(Path(temporary) / "crashes.gpkg")
    same = int((again == frame).all(axis=1).sum())
    gdal = ".".join(map(str, pyogrio.__gdal_version__))
    says = "GeoPackage written by geopandas, the same rows and types"
    yield Verdict(f"pyogrio {version('pyogrio')} with GDAL {gdal}", len(frame), same, says)
    waypoints = gpxpy.parse((folder / "crashes.gpx").read_text()).waypoints
    yield Verdict(f"gpxpy {version('gpxpy')}", len(frame), sum(point.name in set(frame.key) for point in waypoints))


def main() -> None:
    """Print what the judges of one form say of a folder."""
    all_judges = (
        *(commonroad, drivability, crime, lanelet2, scenarionet, sumo, osi, omega, openlabel, points),
        *(designer, esmini, gltf),
    )
    judges: dict[str, Any] = {each.__name__: each for each in all_judges}
    for verdict in judges[sys.argv[1]](Path(sys.argv[2])):
        print(json.dumps(verdict._asdict()), flush=True)


if __name__ == "__main__":
    main()
