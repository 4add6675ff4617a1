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
from typing import Any, Final, TypeAlias

from lxml import etree
from lxml.builder import E  # type: ignore[import-not-found] # the stubs of lxml lack it

from trace_dag.agents.stored_cases import case_of
from trace_dag.agents.stored_traffic import traffic_of
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_of_body
from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.formats.lane_rules import LaneRules, place_of, turn_of
from trace_dag.flow.artefacts import RECORD
from trace_dag.flow.contract import CrashFiles
from trace_dag.roads.map.lane_shapes import LaneShape
from trace_dag.roads.map.model import LaneRef, SignalType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drives import GOAL_HEADING_RAD, GOAL_LENGTH_M, GOAL_WIDTH_M, STEP_S, Drive, drives_of, meets
from trace_dag.scenario.lights import LightCycle, Lights
from trace_dag.scenario.traffic.surrounding import SurroundingVehicle
from trace_dag.simulation.types import Body, BodyKind
from trace_dag.version import __version__

Made: TypeAlias = Any
"""An element, which the stubs of lxml.builder do not say."""
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
    root.append(_location(network.frame.latitude_deg, network.frame.longitude_deg))
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
        stops = [
            post for post in (*self._lights, *self._signs) if post.signal.type in (SignalType.LIGHT, SignalType.STOP)
        ]
        self._stops_at = {ref: post.signal.s_m for post in stops for ref in post.lanes}

    def write_into(self, root: etree._Element, tag: str) -> int:
        """Add the tags, and an element for each lanelet, sign, light and intersection; return the next unused id."""
        incomings = self._incomings()
        root.append(E.scenarioTags(*map(E, (tag, "intersection") if incomings else (tag,))))
        root.extend(map(self._lanelet, self._shapes))
        numbers = count(len(self._shapes) + 1)
        for limit in self._limits:
            place = place_of(self._network, limit.lanes[0].road_id, limit.sign) if limit.sign is not None else None
            root.append(_sign(next(numbers), SignalType.LIMIT.value, place, limit.speed_mps))
        for sign in self._signs:
            place = place_of(self._network, sign.lanes[0].road_id, sign.signal)
            root.append(_sign(next(numbers), sign.signal.type, place))
        for light in self._lights:
            place = place_of(self._network, light.lanes[0].road_id, light.signal)
            root.append(_light(next(numbers), place, self._cycle_of.get(light.signal.id)))
        for roads in incomings.values():
            intersection = E.intersection(id=str(next(numbers)))
            for lanes in roads.values():
                names = ("incomingLanelet", "successorsRight", "successorsStraight", "successorsLeft")
                refs = [E(name, ref=str(number)) for name in names for number in lanes[name]]
                intersection.append(E.incoming(*refs, id=str(next(numbers))))
            root.append(intersection)
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

    def _lanelet(self, shape: LaneShape) -> Made:
        lanelet = E.lanelet(
            E.leftBound(*map(_point, shape.left_m)),
            E.rightBound(*map(_point, shape.right_m)),
            id=str(self._ids[shape.ref]),
        )
        for name, others in (("predecessor", shape.predecessors), ("successor", shape.successors)):
            lanelet.extend([E(name, ref=str(other)) for other in self._known(others)])
        for name, beside, same_way in (
            ("adjacentLeft", shape.left, shape.left_same_way),
            ("adjacentRight", shape.right, shape.right_same_way),
        ):
            way = "same" if same_way else "opposite"
            lanelet.extend(
                [E(name, ref=str(other), drivingDir=way) for other in self._known([beside] if beside else [])]
            )
        if shape.ref in self._stops_at:
            line = self._rules.stop_line(shape.ref, self._stops_at[shape.ref])
            lanelet.append(E.stopLine(*map(_point, line), E.lineMarking("solid")))
        lanelet.append(E.laneletType("intersection" if shape.junction_id is not None else "urban"))
        lanelet.append(E.userOneWay("vehicle"))
        lanelet.extend([E.trafficSignRef(ref=str(sign)) for sign in self._signs_of[shape.ref]])
        lanelet.extend([E.trafficLightRef(ref=str(light)) for light in self._lights_of[shape.ref]])
        return lanelet

    def _known(self, refs: Iterable[LaneRef]) -> list[int]:
        return [self._ids[ref] for ref in refs if ref in self._ids]


def _sign(number: int, kind: str, place: FloatArray | None, limit_mps: float | None = None) -> Made:
    """Return a sign; without a place it represents an unsigned limit."""
    about = E.trafficSignElement(E.trafficSignID(kind))
    if limit_mps is not None:
        about.append(E.additionalValue(_number(limit_mps)))
    where = [] if place is None else [E.position(_point(place))]
    return E.trafficSign(about, *where, E.virtual("true" if place is None else "false"), id=str(number))


def _light(number: int, place: FloatArray, program: LightCycle | None) -> Made:
    """Return a light with its cycle from time 0 on; without a program it is off."""
    steps = ((STEP_S, "inactive"),) if program is None else program.steps
    return E.trafficLight(
        E.cycle(*(E.cycleElement(E.duration(str(round(s / STEP_S))), E.color(colour)) for s, colour in steps)),
        E.position(_point(place)),
        E.direction("all"),
        E.active("false" if program is None else "true"),
        id=str(number),
    )


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
    root.append(_location(record.latitude_deg, record.longitude_deg))
    ids = count(road.write_into(root, "critical"))
    for each in sorted(others, key=lambda each: not each.is_parked):  # those that stand come first
        obstacle = _parked if each.is_parked else _moving
        root.append(obstacle(next(ids), each.participant.body, each.course))
    for vehicle in around:
        begins, course = vehicle.course
        if len(course) > 1:
            root.append(_moving(next(ids), vehicle.body, course, begins))
    root.extend([_problem(next(ids), each) for each in tested])
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


def _location(latitude_deg: float, longitude_deg: float) -> Made:
    latitude, longitude = E.gpsLatitude(f"{latitude_deg:.7f}"), E.gpsLongitude(f"{longitude_deg:.7f}")
    return E.location(E.geoNameId(_UNKNOWN_PLACE), latitude, longitude)


def _parked(number: int, body: Body, states: FloatArray) -> Made:
    initial = E.initialState(E.position(_point(states[0])), _exact("orientation", states[0, 3]), _exact("time", 0))
    return E.staticObstacle(E.type("parkedVehicle"), E.shape(_rectangle(body)), initial, id=str(number))


def _moving(number: int, body: Body, states: FloatArray, begins: int = 0) -> Made:
    """Return an obstacle that moves, from a step on."""
    kind = _FIGURES[body.kind] if body.is_figure else _TYPES.get(body.vehicle_class, "car")
    first, *later = (_state(step, state) for step, state in enumerate(states, begins))
    first.tag = "initialState"
    return E.dynamicObstacle(E.type(kind), E.shape(_rectangle(body)), first, E.trajectory(*later), id=str(number))


def _state(step: int, state: FloatArray) -> Made:
    _, _, _, heading_rad, speed_mps = state
    exactly = {"orientation": heading_rad, "time": step, "velocity": speed_mps}
    return E.state(E.position(_point(state)), *(_exact(name, value) for name, value in exactly.items()))


def _problem(number: int, own: Drive) -> Made:
    initial = _state(0, own.course[0])
    initial.tag = "initialState"
    initial.extend([_exact("yawRate", 0.0), _exact("slipAngle", 0.0)])
    assert own.goal is not None, "a driver has a goal"
    pose, earliest, latest = own.goal.pose, max(round(own.goal.from_s / STEP_S), 1), round(own.goal.to_s / STEP_S)
    where = E.rectangle(
        E.length(_number(GOAL_LENGTH_M)),
        E.width(_number(GOAL_WIDTH_M)),
        E.orientation(_number(pose.heading_rad)),
        E.center(E.x(_number(pose.x_m)), E.y(_number(pose.y_m))),
    )
    goal = E.goalState(
        E.position(where),
        _interval("orientation", pose.heading_rad - GOAL_HEADING_RAD, pose.heading_rad + GOAL_HEADING_RAD),
        _interval("time", earliest, latest),
    )
    return E.planningProblem(initial, goal, id=str(number))


def _point(place: FloatArray) -> Made:
    return E.point(E.x(_number(place[0])), E.y(_number(place[1])))  # readers refuse borders that have heights


def _rectangle(body: Body) -> Made:
    return E.rectangle(E.length(_number(body.length_m)), E.width(_number(body.width_m)))


def _exact(name: str, value: float) -> Made:
    return E(name, E.exact(_number(value)))


def _interval(name: str, low: float, high: float) -> Made:
    return E(name, E.intervalStart(_number(low)), E.intervalEnd(_number(high)))


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{round(float(value), 4) + 0.0:.4f}"
