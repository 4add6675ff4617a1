"""CommonRoad scenarios (format 2020a): the road as lanelets, and a planning problem for each driver.

A file per driver. Its planning problem starts as that driver did and has to reach where the vehicle would have been
without the crash (:class:`trace_dag.evaluation.drives.Goal`); everybody else is an obstacle that drives as recorded,
without the crash: what agents are evaluated in. Times are steps of :data:`trace_dag.evaluation.drives.STEP_S`, places
are in the crash's local frame, as in its OpenDRIVE map.

Format: Althoff, Koschi, Manzinger, CommonRoad: Composable benchmarks for motion planning on roads, IV 2017, and the
documentation of the XML format 2020a.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from typing import Final

from lxml import etree

from trace_dag.crash.parties import party_of_body
from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.errors import UserError
from trace_dag.evaluation.drives import (
    GOAL_HEADING_RAD,
    GOAL_LENGTH_M,
    GOAL_WIDTH_M,
    STEP_S,
    Drive,
    drives_of,
)
from trace_dag.flow.artefacts import RECORD
from trace_dag.flow.contract import CrashFiles
from trace_dag.formats.exporter import as_driven
from trace_dag.geometry import FloatArray
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.sim.types import Body, BodyKind
from trace_dag.version import __version__

_TYPES: Final[Mapping[VehicleClass, str]] = {
    VehicleClass.MOTORCYCLE: "motorcycle",
    VehicleClass.BUS: "bus",
    VehicleClass.TRUCK: "truck",
    VehicleClass.LIGHT_TRUCK: "truck",
    VehicleClass.TRACTOR_TRAILER: "truck",
    VehicleClass.TRAILER: "truck",
}
_FIGURES: Final = {
    BodyKind.PEDESTRIAN: "pedestrian",
    BodyKind.CYCLIST: "bicycle",
    BodyKind.CONVEYANCE: "pedestrian",
    BodyKind.ANIMAL: "unknown",  # the format has no animals
}
_UNKNOWN_PLACE: Final = "-999"  # what the format has for a place without a GeoNames entry


class CommonRoad:
    """``<key>_V<number>.xml`` for each driver of a crash."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Nothing to prepare."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.formats.exporter.Exporter`."""
        case, record = as_driven(crash), crash.load(RECORD)
        drives = drives_of(case)
        drivers = [each for each in drives if each.is_driven]
        if not drivers:
            raise UserError("nobody drives in it")
        road = _Lanelets(case.network)
        source = f"trace-dag {__version__}, crash {record.key}, {case.network.attribution}"
        return {f"{crash.key}_V{own.number}.xml": _scenario(record, road, own, drives, source) for own in drivers}

    def beside(self) -> Mapping[str, bytes]:
        """Each file explains itself."""
        return {}


def road_scenario(network: RoadNetwork) -> bytes:
    """A road map without traffic, as a scenario that has lanelets alone."""
    root = _root("ZAM_Map-1_1_T-1", f"trace-dag {__version__}, {network.attribution}", date.today())
    _add_location(root, network.frame.latitude_deg, network.frame.longitude_deg)
    etree.SubElement(etree.SubElement(root, "scenarioTags"), "urban")
    _Lanelets(network).write_into(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


class _Lanelets:
    """The drivable lanes as lanelets; ids from 1 on."""

    def __init__(self, network: RoadNetwork) -> None:
        self._shapes = [shape for shape in lane_shapes(network, drivable_only=True) if shape.length_m > 0.0]
        self._ids = {shape.ref: number for number, shape in enumerate(self._shapes, 1)}
        self.next_id = len(self._shapes) + 1

    def write_into(self, root: etree._Element) -> None:
        """Add an element for each lanelet."""
        for shape in self._shapes:
            self._write(root, shape)

    def _write(self, root: etree._Element, shape: LaneShape) -> None:
        lanelet = etree.SubElement(root, "lanelet", id=str(self._ids[shape.ref]))
        for side, border in (("leftBound", shape.left_m), ("rightBound", shape.right_m)):
            bound = etree.SubElement(lanelet, side)
            for point in border:
                _add_point(bound, point)
        for name, others in (("predecessor", shape.predecessors), ("successor", shape.successors)):
            for other in self._known(others):
                etree.SubElement(lanelet, name, ref=str(other))
        for name, beside, same_way in (
            ("adjacentLeft", shape.left, shape.left_same_way),
            ("adjacentRight", shape.right, shape.right_same_way),
        ):
            for other in self._known([beside] if beside else []):
                etree.SubElement(lanelet, name, ref=str(other), drivingDir="same" if same_way else "opposite")
        _add(lanelet, "laneletType", "intersection" if shape.junction_id is not None else "urban")
        _add(lanelet, "userOneWay", "vehicle")

    def _known(self, refs: Iterable[LaneRef]) -> list[int]:
        return [self._ids[ref] for ref in refs if ref in self._ids]


def _scenario(record: CrashRecord, road: _Lanelets, own: Drive, drives: Sequence[Drive], source: str) -> bytes:
    year, _, number = record.key.partition("-")
    day = date(record.year or record.case_year, record.month or 1, record.day or 1)
    root = _root(f"USA_Fars{year}x{number}V{own.number}-1_1_T-1", source, day)
    _add_location(root, record.latitude_deg, record.longitude_deg)
    etree.SubElement(etree.SubElement(root, "scenarioTags"), "critical")
    road.write_into(root)
    next_id = road.next_id
    others = [each for each in drives if party_of_body(each.number) != own.number]  # it pulls its own trailer
    for each in sorted(others, key=lambda each: not each.is_parked):  # those that stand come first
        _add_obstacle(root, next_id, each)
        next_id += 1
    _add_problem(root, next_id, own)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _root(benchmark: str, source: str, day: date) -> etree._Element:
    return etree.Element(
        "commonRoad",
        timeStepSize=f"{STEP_S:g}",
        commonRoadVersion="2020a",
        author="trace-dag",
        affiliation="",
        source=source,
        benchmarkID=benchmark,
        date=day.isoformat(),
    )


def _add_location(root: etree._Element, latitude_deg: float, longitude_deg: float) -> None:
    location = etree.SubElement(root, "location")
    _add(location, "geoNameId", _UNKNOWN_PLACE)
    _add(location, "gpsLatitude", f"{latitude_deg:.7f}")
    _add(location, "gpsLongitude", f"{longitude_deg:.7f}")


def _add_obstacle(root: etree._Element, number: int, drive: Drive) -> None:
    stands, body, states = drive.is_parked, drive.participant.body, drive.course
    obstacle = etree.SubElement(root, "staticObstacle" if stands else "dynamicObstacle", id=str(number))
    _add(obstacle, "type", "parkedVehicle" if stands else _type_of(body))
    _add_rectangle(etree.SubElement(obstacle, "shape"), body.length_m, body.width_m)
    initial = etree.SubElement(obstacle, "initialState")
    if stands:
        _add_position(initial, states[0])
        _add_exact(initial, "orientation", states[0, 3])
        _add_exact(initial, "time", 0)
        return
    _add_state(initial, 0, states[0])
    trajectory = etree.SubElement(obstacle, "trajectory")
    for step, state in enumerate(states[1:], 1):
        _add_state(etree.SubElement(trajectory, "state"), step, state)


def _type_of(body: Body) -> str:
    return _FIGURES[body.kind] if body.is_figure else _TYPES.get(body.vehicle_class, "car")


def _add_problem(root: etree._Element, number: int, own: Drive) -> None:
    problem = etree.SubElement(root, "planningProblem", id=str(number))
    initial, first = etree.SubElement(problem, "initialState"), own.course[0]
    _add_position(initial, first)
    for name, value in (("orientation", first[3]), ("time", 0), ("velocity", first[4])):
        _add_exact(initial, name, value)
    for name in ("yawRate", "slipAngle"):
        _add_exact(initial, name, 0.0)
    assert own.goal is not None, "a driver has a goal"
    pose = own.goal.pose
    goal = etree.SubElement(problem, "goalState")
    where = etree.SubElement(etree.SubElement(goal, "position"), "rectangle")
    _add(where, "length", _number(GOAL_LENGTH_M))
    _add(where, "width", _number(GOAL_WIDTH_M))
    _add(where, "orientation", _number(pose.heading_rad))
    centre = etree.SubElement(where, "center")
    _add(centre, "x", _number(pose.x_m))
    _add(centre, "y", _number(pose.y_m))
    _add_interval(goal, "orientation", pose.heading_rad - GOAL_HEADING_RAD, pose.heading_rad + GOAL_HEADING_RAD)
    time = etree.SubElement(goal, "time")
    _add(time, "intervalStart", str(max(round(own.goal.from_s / STEP_S), 1)))
    _add(time, "intervalEnd", str(round(own.goal.to_s / STEP_S)))


def _add_state(element: etree._Element, step: int, state: FloatArray) -> None:
    _add_position(element, state)
    _add_exact(element, "orientation", state[3])
    _add_exact(element, "time", step)
    _add_exact(element, "velocity", state[4])


def _add_position(element: etree._Element, state: FloatArray) -> None:
    _add_point(etree.SubElement(element, "position"), state[:2])


def _add_point(element: etree._Element, place: FloatArray) -> None:
    point = etree.SubElement(element, "point")
    for name, value in zip("xyz", place, strict=False):
        _add(point, name, _number(value))


def _add_rectangle(element: etree._Element, length_m: float, width_m: float) -> None:
    rectangle = etree.SubElement(element, "rectangle")
    _add(rectangle, "length", _number(length_m))
    _add(rectangle, "width", _number(width_m))


def _add_exact(element: etree._Element, name: str, value: float) -> None:
    _add(etree.SubElement(element, name), "exact", _number(value))


def _add_interval(element: etree._Element, name: str, low: float, high: float) -> None:
    interval = etree.SubElement(element, name)
    _add(interval, "intervalStart", _number(low))
    _add(interval, "intervalEnd", _number(high))


def _add(element: etree._Element, name: str, text: str) -> None:
    etree.SubElement(element, name).text = text


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{round(float(value), 4) + 0.0:.4f}"
