"""SUMO: the road as a network, and the crash as floating-car data, in one system of coordinates.

``<key>.net.xml`` is made of the OpenDRIVE map by SUMO's own netconvert; ``<key>.fcd.xml`` has the simulated motion of
all parties through the crash, every :data:`STEP_S`. Both are in the crash's local frame, which is the projection that
the network names. A vehicle's place is the middle of its front, angles are clockwise from north, as in SUMO's own
output.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from lxml import etree

from trace_dag.agents.stored_traffic import traffic_of
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.flow.artefacts import ROAD_MAP, XODR
from trace_dag.flow.contract import CrashFiles
from trace_dag.scenario.traffic.sumo_network import network_xml, sumo_program
from trace_dag.scenario.traffic.surrounding import add_traffic
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


class Sumo(Exporter):
    """``<key>.net.xml`` and ``<key>.fcd.xml`` for each crash. Needs netconvert, which the extra ``sumo`` brings."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._netconvert = sumo_program("netconvert")

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        log = crash.shown_log()
        assert log is not None, "a verified crash was simulated"
        return {
            f"{crash.key}.net.xml": network_xml(self._netconvert, crash.key, crash.load(ROAD_MAP), crash.load(XODR)),
            f"{crash.key}.fcd.xml": floating_car_data(add_traffic(log, traffic_of(crash))),
        }


def floating_car_data(log: SimulationLog) -> bytes:
    """Return the motion of a log as SUMO's floating-car data (``fcd_file.xsd``)."""
    root = etree.Element("fcd-export")
    times = np.arange(0.0, log.duration_s + STEP_S / 2, STEP_S)
    steps = {each.number: _rows(each, log.bodies[each.number], times) for each in log.vehicles}
    there = {each.number: (each.time_s[0] - 1e-6, each.time_s[-1] + STEP_S / 2) for each in log.vehicles}
    people = [each.number for each in log.vehicles if log.bodies[each.number].kind in _ON_FOOT]
    order = sorted(steps, key=lambda number: number in people)  # the schema has vehicles first
    for step, time_s in enumerate(times):
        moment = etree.SubElement(root, "timestep", time=f"{time_s:.2f}")
        for number in (each for each in order if there[each][0] <= time_s <= there[each][1]):
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


def _rows(moved: VehicleLog, body: Body, times: FloatArray) -> FloatArray:
    """Return x, y, z of the front's middle (m), angle (degrees clockwise from north) and speed (m/s).

    There is one row for each time.
    """
    heading = np.interp(times, moved.time_s, np.unwrap(moved.heading_rad))
    x, y, z = (np.interp(times, moved.time_s, values) for values in (moved.x_m, moved.y_m, moved.z_m))
    ahead_m = 0.0 if body.kind in _ON_FOOT else body.length_m / 2
    speed = np.hypot(*(np.interp(times, moved.time_s, each) for each in (moved.velocity_x_mps, moved.velocity_y_mps)))
    angle_deg = np.remainder(np.degrees(math.pi / 2 - heading), 360.0)
    return np.column_stack([x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading), z, angle_deg, speed])
