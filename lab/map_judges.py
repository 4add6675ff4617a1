"""Readers of OpenDRIVE maps, as judges: run by ``lab/formats.py``, each in an environment with its reader alone.

    python -m lab map_judges READER FOLDER

Prints one line of JSON: the reader and its version, the files, those it opened, and for each fact the amount that it
reads beside the amount that the files hold. Nothing of trace-dag is imported: the amounts held are counted in the XML.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

FACTS = (
    "driving lanes, km",
    "heights, m",
    "lanes with a limit, km",
    "signals and signs",
    "crosswalks",
    "sidewalks, km",
)
_SHAPE_POINTS_M = 1.0

Amounts = dict[str, float]
"""Amounts by fact; a fact that a reader's interface does not offer is missing."""


def held(path: Path) -> Amounts:
    """Return the amounts that a file holds."""
    found: Counter[str] = Counter()
    z_m = [0.0]
    for road in ElementTree.parse(path).iter("road"):
        z_m += [float(each.get("a", "0")) for each in road.iter("elevation")]
        found["signals and signs"] += len(list(road.iter("signal")))
        found["crosswalks"] += sum(each.get("type") == "crosswalk" for each in road.iter("object"))
        limited = road.find("type/speed") is not None
        sections = list(road.iter("laneSection"))
        ends = [*(float(each.get("s", "0")) for each in sections[1:]), float(road.get("length", "0"))]
        for section, end_m in zip(sections, ends, strict=True):
            length_km = (end_m - float(section.get("s", "0"))) / 1000.0
            for lane in section.iter("lane"):
                if lane.get("type") == "driving":
                    found["driving lanes, km"] += length_km
                    found["lanes with a limit, km"] += length_km * (limited or lane.find("speed") is not None)
                elif lane.get("type") == "sidewalk":
                    found["sidewalks, km"] += length_km
    return {**found, "heights, m": max(z_m) - min(z_m)}


def carla(path: Path) -> Amounts:
    """Return the amounts that ``carla.Map`` reads; limits are signs there, and waypoints are of driving lanes."""
    import carla as library

    network = library.Map(path.stem, path.read_text())
    points = network.generate_waypoints(_SHAPE_POINTS_M)
    heights = [each.transform.location.z for each in points]
    return {
        "driving lanes, km": len(points) * _SHAPE_POINTS_M / 1000.0,
        "heights, m": max(heights) - min(heights),
        "signals and signs": len({each.id for each in network.get_all_landmarks()}),
        "crosswalks": len(network.get_crosswalks()) / 4,  # it lists their corners; ours have four
    }


def netconvert(path: Path) -> Amounts:
    """Return the amounts of the network that netconvert makes; every lane has a speed there, reported or not."""
    import sumo
    import sumolib

    with tempfile.TemporaryDirectory() as folder:
        net = str(Path(folder) / "map.net.xml")
        command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "--opendrive-files", str(path), "-o", net]
        subprocess.run([*command, "--opendrive.import-all-lanes"], check=True, capture_output=True)
        network = sumolib.net.readNet(net, withInternal=True)
    lanes = [lane for edge in network.getEdges() for lane in edge.getLanes()]
    driven = [lane for lane in lanes if lane.allows("passenger")]
    walked = [lane for lane in lanes if lane.allows("pedestrian") and lane not in driven]
    heights = [point[2] for lane in lanes for point in lane.getShape3D()]
    return {
        "driving lanes, km": sum(lane.getLength() for lane in driven) / 1000.0,
        "heights, m": max(heights) - min(heights),
        "sidewalks, km": sum(lane.getLength() for lane in walked) / 1000.0,
    }


def scenic(path: Path) -> Amounts:
    """Return the amounts of Scenic's driving domain."""
    from scenic.domains.driving.roads import Network

    network = Network.fromFile(str(path), useCache=False)
    lanes = [section for lane in network.lanes for section in lane.sections]
    heights = [point[2] if len(point) > 2 else 0.0 for lane in lanes for point in lane.centerline.lineString.coords]
    return {
        "driving lanes, km": sum(lane.centerline.length for lane in lanes) / 1000.0,
        "heights, m": max(heights) - min(heights),
        "lanes with a limit, km": sum(lane.centerline.length for lane in lanes if lane.speedLimit) / 1000.0,
        "signals and signs": sum(len(road.signals) for road in network.allRoads),
        "crosswalks": len(network.crossings),
        "sidewalks, km": sum(each.centerline.length for each in network.sidewalks) / 1000.0,
    }


def pyxodr(path: Path) -> Amounts:
    """Return the amounts of pyxodr; its lanes have points of the middle, and types."""
    from pyxodr.road_objects.network import RoadNetwork

    roads = RoadNetwork(str(path)).get_roads()
    lengths: Counter[str] = Counter()
    for road in roads:
        for lane in (lane for section in road.lane_sections for lane in section.lanes):
            middle = np.asarray(lane.centre_line)[:, :2]
            lengths[lane.type] += float(np.hypot(*np.diff(middle, axis=0).T).sum()) / 1000.0
    heights = [float(z_m) for road in roads for z_m in road.z_coordinates]
    return {
        "driving lanes, km": lengths["driving"],
        "heights, m": max(heights) - min(heights),
        "sidewalks, km": lengths["sidewalk"],
    }


def ad_map(path: Path) -> Amounts:
    """Return the amounts of ad-map-access, whose lanes are those of a navigation map."""
    import ad_map_access as library

    kinds = library.map.intersection.IntersectionType, library.map.landmark.TrafficLightType
    access, text = library.map.access, path.read_text()
    try:
        if not access.initFromOpenDriveContent(text, 0.2, kinds[0].TrafficLight, kinds[1].SOLID_RED_YELLOW_GREEN):
            raise ValueError("not read")
        lanes = [library.map.lane.getLane(each) for each in library.map.lane.getLanes()]
        driven = [each for each in lanes if str(each.type) in ("NORMAL", "INTERSECTION")]
        points = [point for each in driven for point in each.edge_left.ecef_points]
        heights = [float(library.map.point.toENU(point).z.mENUCoordinate) for point in points]
        return {
            "driving lanes, km": sum(each.length.mDistance for each in driven) / 1000.0,
            "heights, m": max(heights) - min(heights),
            "lanes with a limit, km": sum(each.length.mDistance for each in driven if len(each.speed_limits)) / 1000.0,
            "signals and signs": len(library.map.landmark.getLandmarks()),
            "sidewalks, km": sum(each.length.mDistance for each in lanes if str(each.type) == "PEDESTRIAN") / 1000.0,
        }
    finally:
        access.cleanup()


def tactics2d(path: Path) -> Amounts:
    """Return the amounts of tactics2d."""
    import logging

    from tactics2d.map.parser import XODRParser

    logging.disable(logging.CRITICAL)
    network = XODRParser().parse(str(path))
    lanes = list(network.lanes.values())
    driven = [each for each in lanes if each.subtype == "driving"]
    heights = [point[2] if len(point) > 2 else 0.0 for each in driven for point in each.centerline().coords]
    return {
        "driving lanes, km": sum(each.centerline().length for each in driven) / 1000.0,
        "heights, m": max(heights) - min(heights),
        "lanes with a limit, km": sum(each.centerline().length for each in driven if each.speed_limit) / 1000.0,
        "signals and signs": len(network.regulations),
        "crosswalks": sum(each.subtype == "crosswalk" for each in network.areas.values()),
        "sidewalks, km": sum(each.centerline().length for each in lanes if each.subtype == "sidewalk") / 1000.0,
    }


READERS: dict[str, tuple[Callable[[Path], Amounts], str]] = {
    "carla": (carla, "carla"),
    "netconvert": (netconvert, "eclipse-sumo"),
    "scenic": (scenic, "scenic"),
    "pyxodr": (pyxodr, "pyxodr"),
    "ad_map": (ad_map, "ad-map-access"),
    "tactics2d": (tactics2d, "tactics2d"),
}


def main() -> None:
    """Print the amounts that one reader reads of the maps below a folder, and those that they hold."""
    read, package = READERS[sys.argv[1]]
    files = sorted(Path(sys.argv[2]).rglob("map.xodr"))
    opened, reads, holds = 0, Counter[str](), Counter[str]()
    offered: set[str] = set()
    for path in files:
        try:
            found = read(path)
        except Exception as error:
            print(f"{path}: {type(error).__name__}: {error}", file=sys.stderr)
            continue
        opened += 1
        offered |= found.keys()
        reads.update(found)
        holds.update(held(path))
    facts: dict[str, Any] = {fact: [reads[fact], holds[fact]] if fact in offered else None for fact in FACTS}
    print(
        json.dumps({"reader": f"{package} {version(package)}", "files": len(files), "opened": opened, "facts": facts})
    )


if __name__ == "__main__":
    main()
