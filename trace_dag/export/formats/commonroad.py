"""CommonRoad scenarios (format 2020a): the road as lanelets, and a planning problem for each driver.

A file per driver who has something to avoid. Its planning problem starts in that driver's initial state, and its goal
is the place that the vehicle would have reached without the crash (:class:`trace_dag.scenario.drives.Goal`). All others
are obstacles that drive as recorded, without the crash, as in the evaluation of agents. In ``<key>_all.xml`` all
parties are obstacles, because measures of criticality look for the driver among them. Times are steps of
:data:`trace_dag.scenario.drives.STEP_S`, places are in the crash's local frame, as in its OpenDRIVE map.

A junction is an intersection with an incoming element for each road that leads there. A limit is a sign of the lanelets
where it holds; stop signs and lights have a stop line. Lights have the cycles of the first reading of the report
(:func:`trace_dag.scenario.lights.crash_lights`); one without a program is off. Signs, and with them the benchmark's id,
are of Zamunda, the format's country for no country in particular: its schema lacks the American stop sign (R1-1), and
commonroad-io the American yield sign. The place is in ``location``.

Format: Althoff, Koschi, Manzinger, CommonRoad: Composable benchmarks for motion planning on roads, IV 2017, and the
documentation of the XML format 2020a.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from itertools import count
from typing import Final

from lxml import etree

from trace_dag.agents.stored_cases import case_of
from trace_dag.agents.stored_traffic import traffic_of
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_of_body
from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.formats.lane_rules import LIGHT, LIMIT, STOP, LaneRules, place_of, turn_of
from trace_dag.flow.artefacts import RECORD
from trace_dag.flow.contract import CrashFiles
from trace_dag.roads.map.lane_shapes import LaneShape
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drives import GOAL_HEADING_RAD, GOAL_LENGTH_M, GOAL_WIDTH_M, STEP_S, Drive, drives_of, meets
from trace_dag.scenario.lights import LightCycle, Lights
from trace_dag.scenario.traffic.surrounding import SurroundingVehicle
from trace_dag.simulation.types import Body, BodyKind
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
_COUNTRY: Final = "ZAM"
_UNKNOWN_PLACE: Final = "-999"  # what the format has for a place without a GeoNames entry


class CommonRoad(Exporter):
    """``<key>_V<number>.xml`` for each driver who would leave the road or meet another party without a reaction.

    A vehicle has nothing to avoid if it struck a party that the crash had thrown there, or a trailer, which a planning
    problem cannot have. ``<key>_all.xml`` has all parties and a problem for each driver, since the schema requires one.
    """

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.export.formats.exporter.Exporter`."""
        case, record = case_of(crash, crash.settings.sim), crash.load(RECORD)
        drives = drives_of(case)
        tested, drivers = {}, [each for each in drives if each.is_driven]
        for own in drivers:
            others = [each for each in drives if party_of_body(each.number) != own.number]  # not the own trailer
            if own.number == case.departed or any(meets(own, each) for each in others):
                tested[own] = others
        if not tested:
            raise UserError("no driver in it has a collision to avoid")
        road, traffic = _Lanelets(case.network, case.lights), traffic_of(crash)
        around = () if traffic is None else traffic.vehicles
        source = f"trace-dag {__version__}, crash {record.key}, {case.network.attribution}"
        files = {
            f"{crash.key}_V{own.number}.xml": _scenario(record, road, f"V{own.number}", others, source, [own], around)
            for own, others in tested.items()
        }
        return {**files, f"{crash.key}_all.xml": _scenario(record, road, "All", drives, source, drivers, around)}


def road_scenario(network: RoadNetwork) -> bytes:
    """Return a road map without traffic, as a scenario that has lanelets alone."""
    root = _root(f"{_COUNTRY}_Map-1_1_T-1", f"trace-dag {__version__}, {network.attribution}", date.today())
    _add_location(root, network.frame.latitude_deg, network.frame.longitude_deg)
    _Lanelets(network).write_into(root, "urban")
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


class _Lanelets:
    """The drivable lanes as lanelets, and the signs, limits and lights of their roads; ids from 1 on."""

    def __init__(self, network: RoadNetwork, lights: Lights | None = None) -> None:
        self._network, self._rules = network, LaneRules(network)
        self._cycle_of = {} if lights is None else lights.cycle_of
        self._shapes, self._limits = self._rules.shapes, self._rules.limits
        self._signs, self._lights = self._rules.signs, self._rules.lights
        self._ids = {shape.ref: number for number, shape in enumerate(self._shapes, 1)}
        self._signs_of: dict[LaneRef, list[int]] = defaultdict(list)
        self._lights_of: dict[LaneRef, list[int]] = defaultdict(list)
        numbers = count(len(self._shapes) + 1)
        for ids_of, rows in (
            (self._signs_of, [*(limit.lanes for limit in self._limits), *(sign.lanes for sign in self._signs)]),
            (self._lights_of, [light.lanes for light in self._lights]),
        ):
            for lanes, number in zip(rows, numbers, strict=False):
                for ref in lanes:
                    ids_of[ref].append(number)
        stops = [post for post in (*self._lights, *self._signs) if post.signal.type in (LIGHT, STOP)]
        self._stops_at = {ref: post.signal.s_m for post in stops for ref in post.lanes}

    def write_into(self, root: etree._Element, tag: str) -> int:
        """Add the tags, and an element for each lanelet, sign, light and intersection; return the next unused id."""
        incomings = self._incomings()
        tags = etree.SubElement(root, "scenarioTags")
        for name in (tag, "intersection") if incomings else (tag,):
            etree.SubElement(tags, name)
        for shape in self._shapes:
            self._write(root, shape)
        numbers = count(len(self._shapes) + 1)
        for limit in self._limits:
            place = place_of(self._network, limit.lanes[0].road_id, limit.sign) if limit.sign is not None else None
            _add_sign(root, next(numbers), LIMIT, place, _number(limit.speed_mps))
        for sign in self._signs:
            place = place_of(self._network, sign.lanes[0].road_id, sign.signal)
            _add_sign(root, next(numbers), sign.signal.type, place)
        for light in self._lights:
            place = place_of(self._network, light.lanes[0].road_id, light.signal)
            _add_light(root, next(numbers), place, self._cycle_of.get(light.signal.id))
        for roads in incomings.values():
            intersection = etree.SubElement(root, "intersection", id=str(next(numbers)))
            for lanes in roads.values():
                incoming = etree.SubElement(intersection, "incoming", id=str(next(numbers)))
                for name in ("incomingLanelet", "successorsRight", "successorsStraight", "successorsLeft"):
                    for number in lanes[name]:
                        etree.SubElement(incoming, name, ref=str(number))
        return next(numbers)

    def _incomings(self) -> dict[str, dict[str, dict[str, list[int]]]]:
        """Return, by junction and incoming road, the lanelets that end there and those that continue, by turn."""
        found: dict[str, dict[str, dict[str, list[int]]]] = defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
        for shape in self._shapes:
            before = [ref for ref in shape.predecessors if ref in self._ids]
            if shape.junction_id is None or not before:
                continue
            lanes = found[shape.junction_id][before[0].road_id]
            lanes["incomingLanelet"] = sorted({*lanes["incomingLanelet"], *self._known(before)})
            lanes[f"successors{turn_of(shape)}"].append(self._ids[shape.ref])
        return found

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
        if shape.ref in self._stops_at:
            self._add_stop_line(lanelet, shape.ref)
        _add(lanelet, "laneletType", "intersection" if shape.junction_id is not None else "urban")
        _add(lanelet, "userOneWay", "vehicle")
        for sign in self._signs_of[shape.ref]:
            etree.SubElement(lanelet, "trafficSignRef", ref=str(sign))
        for light in self._lights_of[shape.ref]:
            etree.SubElement(lanelet, "trafficLightRef", ref=str(light))

    def _add_stop_line(self, lanelet: etree._Element, ref: LaneRef) -> None:
        line = etree.SubElement(lanelet, "stopLine")
        for point in self._rules.stop_line(ref, self._stops_at[ref]):
            _add_point(line, point)
        _add(line, "lineMarking", "solid")

    def _known(self, refs: Iterable[LaneRef]) -> list[int]:
        return [self._ids[ref] for ref in refs if ref in self._ids]


def _add_sign(root: etree._Element, number: int, sign: str, place: FloatArray | None, value: str = "") -> None:
    """Add a sign; without a place it represents an unsigned limit."""
    element = etree.SubElement(root, "trafficSign", id=str(number))
    about = etree.SubElement(element, "trafficSignElement")
    _add(about, "trafficSignID", sign)
    if value:
        _add(about, "additionalValue", value)
    if place is not None:
        _add_point(etree.SubElement(element, "position"), place)
    _add(element, "virtual", "true" if place is None else "false")


def _add_light(root: etree._Element, number: int, place: FloatArray, program: LightCycle | None) -> None:
    """Add a light with its cycle from time 0 on; without a program it is off."""
    light = etree.SubElement(root, "trafficLight", id=str(number))
    cycle = etree.SubElement(light, "cycle")
    for duration_s, colour in ((STEP_S, "inactive"),) if program is None else program.steps:
        shows = etree.SubElement(cycle, "cycleElement")
        _add(shows, "duration", str(round(duration_s / STEP_S)))
        _add(shows, "color", colour)
    _add_point(etree.SubElement(light, "position"), place)
    _add(light, "direction", "all")
    _add(light, "active", "false" if program is None else "true")


def _scenario(
    record: CrashRecord,
    road: _Lanelets,
    name: str,
    others: Sequence[Drive],
    source: str,
    tested: Sequence[Drive],
    around: Sequence[SurroundingVehicle],
) -> bytes:
    year, _, number = record.key.partition("-")
    day = date(record.year or record.case_year, record.month or 1, record.day or 1)
    root = _root(f"{_COUNTRY}_Fars{year}x{number}{name}-1_1_T-1", source, day)
    _add_location(root, record.latitude_deg, record.longitude_deg)
    ids = count(road.write_into(root, "critical"))
    for each in sorted(others, key=lambda each: not each.is_parked):  # those that stand come first
        _add_obstacle(root, next(ids), each)
    for vehicle in around:
        begins, course = vehicle.course
        if len(course) > 1:
            _add_moving(root, next(ids), vehicle.body, course, begins)
    for each in tested:
        _add_problem(root, next(ids), each)
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
    body, states = drive.participant.body, drive.course
    if not drive.is_parked:
        _add_moving(root, number, body, states)
        return
    obstacle = etree.SubElement(root, "staticObstacle", id=str(number))
    _add(obstacle, "type", "parkedVehicle")
    _add_rectangle(etree.SubElement(obstacle, "shape"), body.length_m, body.width_m)
    initial = etree.SubElement(obstacle, "initialState")
    _add_position(initial, states[0])
    _add_exact(initial, "orientation", states[0, 3])
    _add_exact(initial, "time", 0)


def _add_moving(root: etree._Element, number: int, body: Body, states: FloatArray, begins: int = 0) -> None:
    """Add an obstacle that moves, from a step on."""
    obstacle = etree.SubElement(root, "dynamicObstacle", id=str(number))
    _add(obstacle, "type", _type_of(body))
    _add_rectangle(etree.SubElement(obstacle, "shape"), body.length_m, body.width_m)
    _add_state(etree.SubElement(obstacle, "initialState"), begins, states[0])
    trajectory = etree.SubElement(obstacle, "trajectory")
    for step, state in enumerate(states[1:], begins + 1):
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
    for name, value in zip("xy", place[:2], strict=True):  # readers refuse borders that have heights
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
