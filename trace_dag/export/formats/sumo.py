"""SUMO: the road as a network, and the crash as floating-car data, in one system of coordinates.

``<key>.net.xml`` is made of the OpenDRIVE map by SUMO's own netconvert; ``<key>.fcd.xml`` has everybody's simulated
motion through the crash, every :data:`STEP_S`. Both are in the crash's local frame, which is the projection that the
network names. A vehicle's place is the middle of its front, angles are clockwise from north, as in what SUMO writes.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np
from lxml import etree

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import VehicleClass
from trace_dag.flow.artefacts import ROAD_MAP, XODR
from trace_dag.flow.contract import CrashFiles
from trace_dag.osm.road_classes import ROAD_CLASSES, road_class
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, VehicleLog

STEP_S: Final = 0.1
_ON_FOOT: Final = (BodyKind.PEDESTRIAN, BodyKind.ANIMAL)
_CLASSES: Final = {
    VehicleClass.MOTORCYCLE: "motorcycle",
    VehicleClass.BUS: "bus",
    VehicleClass.TRUCK: "truck",
    VehicleClass.LIGHT_TRUCK: "delivery",
    VehicleClass.TRACTOR_TRAILER: "truck",
    VehicleClass.TRAILER: "trailer",
}
_TIME_LIMIT_S: Final = 300.0
_YIELDING: Final = ("205", "206")  # signs of the map: yield, stop
_LOWEST_RANK: Final = max(each.rank for each in ROAD_CLASSES.values())


class Sumo:
    """``<key>.net.xml`` and ``<key>.fcd.xml`` for each crash. Needs netconvert, which the extra ``sumo`` brings."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._netconvert = netconvert()

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.export.formats.exporter.Exporter`."""
        log = crash.shown_log()
        assert log is not None, "a verified crash was simulated"
        return {
            f"{crash.key}.net.xml": network_xml(self._netconvert, crash.key, crash.load(ROAD_MAP), crash.load(XODR)),
            f"{crash.key}.fcd.xml": floating_car_data(log),
        }

    def beside(self) -> Mapping[str, bytes]:
        """Return nothing: a network and a trace belong together by their names."""
        return {}


def netconvert() -> str:
    """Return sUMO's netconvert: of the extra ``sumo``, of ``SUMO_HOME``, or on the path.

    Raises :class:`UserError`.
    """
    package = find_spec("sumo")
    homes = [Path(each) for each in (package.submodule_search_locations or [])] if package else []
    if "SUMO_HOME" in os.environ:
        homes.append(Path(os.environ["SUMO_HOME"]))
    found = next(filter(None, (shutil.which("netconvert", path=str(home / "bin")) for home in homes)), None)
    found = found or shutil.which("netconvert")
    if found is None:
        raise UserError("networks for SUMO are made by its netconvert: pip install 'trace-dag[sumo]', or set SUMO_HOME")
    return found


def floating_car_data(log: SimulationLog) -> bytes:
    """Return the motion of a log as SUMO's floating-car data (``fcd_file.xsd``)."""
    root = etree.Element("fcd-export")
    steps = {each.number: _rows(each, log.bodies[each.number]) for each in log.vehicles}
    times = np.arange(0.0, log.duration_s + STEP_S / 2, STEP_S)
    people = [each.number for each in log.vehicles if log.bodies[each.number].kind in _ON_FOOT]
    order = sorted(steps, key=lambda number: number in people)  # the schema has vehicles first
    for step, time_s in enumerate(times):
        moment = etree.SubElement(root, "timestep", time=f"{time_s:.2f}")
        for number in order:
            x, y, z, angle_deg, speed = steps[number][step]
            place = {"x": f"{x:.3f}", "y": f"{y:.3f}", "z": f"{z:.3f}", "angle": f"{angle_deg:.2f}"}
            etree.SubElement(
                moment,
                "person" if number in people else "vehicle",
                {"id": party_label(number), **place, "type": _type(log.bodies[number]), "speed": f"{speed:.3f}"},
            )
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _type(body: Body) -> str:
    if body.kind in _ON_FOOT:
        return str(body.kind)
    return "bicycle" if body.is_figure else _CLASSES.get(body.vehicle_class, "passenger")


def _rows(moved: VehicleLog, body: Body) -> FloatArray:
    """Return x, y, z of the front's middle (m), angle (degrees clockwise from north) and speed (m/s).

    There is a row for every step.
    """
    last_s = float(moved.time_s[-1])
    times = np.arange(0.0, last_s + STEP_S / 2, STEP_S)
    heading = np.interp(times, moved.time_s, np.unwrap(moved.heading_rad))
    x, y, z = (np.interp(times, moved.time_s, values) for values in (moved.x_m, moved.y_m, moved.z_m))
    ahead_m = 0.0 if body.kind in _ON_FOOT else body.length_m / 2
    speed = np.hypot(*(np.interp(times, moved.time_s, each) for each in (moved.velocity_x_mps, moved.velocity_y_mps)))
    angle_deg = np.remainder(np.degrees(math.pi / 2 - heading), 360.0)
    return np.column_stack([x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading), z, angle_deg, speed])


def network_xml(program: str, key: str, network: RoadNetwork, xodr: bytes) -> bytes:
    """Return the map as netconvert writes it, its places left where they are, with :func:`edge_patch` on it.

    Raises :class:`Failure` if netconvert cannot.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "map.xodr").write_bytes(xodr)
        read = _converted(program, key, folder, "--output.original-names", "true")
        Path(folder, "map.edg.xml").write_bytes(edge_patch(network, read))
        return etree.tostring(
            _converted(program, key, folder, "--edge-files", "map.edg.xml"), xml_declaration=True, encoding="UTF-8"
        )


def edge_patch(network: RoadNetwork, read: etree._Element) -> bytes:
    """Return what netconvert does not take from OpenDRIVE, for the edges of the network it has read with their names.

    Every edge that it reads has priority 1, so at a crossing a through road may yield to a side street: here priorities
    are by road class, 0 where a stop or yield sign stands. A lane without a limit gets 13.89 m/s from it, a centre turn
    lane 1.39 m/s: they get what is usual for the road's class, marked ``assumedSpeed``.
    """
    patch = etree.Element("edges")
    for edge in read.iterfind("edge[@priority]"):
        changed = etree.SubElement(patch, "edge", id=edge.get("id", ""))
        for lane in edge.iterfind("lane"):
            road_id, lane_id = str(lane.xpath("string(param[@key='origId']/@value)")).split()[0].rsplit("_", 1)
            road = network.road_by_id[road_id]
            usual = road_class(road.highway)
            yields = any(sign.type in _YIELDING and int(lane_id) in road.lanes_under(sign) for sign in road.signals)
            changed.set("priority", "0" if yields else changed.get("priority", str(_LOWEST_RANK + 1 - usual.rank)))
            limits = [each.speed_mps for part in road.lane_sections for each in part.lanes if each.id == int(lane_id)]
            if None in limits:
                limit_mps = next(filter(None, (*limits, road.speed_mps)), None)
                speed = f"{limit_mps or usual.speed_mps:.2f}"
                made = etree.SubElement(changed, "lane", index=lane.get("index", ""), speed=speed)
                if limit_mps is None:
                    etree.SubElement(made, "param", key="assumedSpeed", value="true")
    return etree.tostring(patch)


def _converted(program: str, key: str, folder: str, *options: str) -> etree._Element:
    """Run netconvert on ``map.xodr`` of a folder.

    It begins its file with the time and its command: without them the same map gives the same bytes.
    """
    command = [program, "--opendrive-files", "map.xodr", "--output-file", "map.net.xml", *options]
    command += ["--offset.disable-normalization", "true", "--no-warnings", "true"]
    made = Path(folder, "map.net.xml")
    made.unlink(missing_ok=True)
    try:
        done = subprocess.run(  # noqa: S603 - SUMO's own program
            command, cwd=folder, capture_output=True, text=True, timeout=_TIME_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise Failure(f"{key}: netconvert took longer than {_TIME_LIMIT_S:g} s") from error
    if done.returncode or not made.exists():
        raise Failure(f"{key}: netconvert made no network: {' '.join(done.stderr.split())[-300:]}")
    parser = etree.XMLParser(remove_comments=True, resolve_entities=False, no_network=True, huge_tree=True)
    return etree.fromstring(made.read_bytes(), parser)
