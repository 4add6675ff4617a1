"""A simulated crash as OpenSCENARIO: replayed as a whole, or with one participant free.

There are two dialects. In OpenSCENARIO 1.2, for players in general, positions are those of the middle of the rear axle
on the road, as in the standard. In the 1.0 form of CARLA's ScenarioRunner (0.9.16), positions are those of the body's
middle, where it places an actor. Both are in the map's own frame (metres, radians counter-clockwise from east) with
times in seconds from the start of the reconstruction.

If a participant is free, a controller drives it from its initial state. The others follow their motion up to the
contact with it, since their motion after that was caused by the contact. From there they continue as the standard
defines for entities without an action.

Sources: ASAM OpenSCENARIO XML 1.0.0 and 1.2.0; ScenarioRunner's ``openscenario_parser.py`` for the 1.0 files that it
reads: ``FollowTrajectoryAction`` in the Story only, polylines only, a ``time`` on every vertex, no negative initial
speed. It mirrors y and heading into CARLA's frame by itself, unless the header's description begins with ``CARLA:``.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from lxml import etree

from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import SURROUNDING, party_label, party_of_body
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.trailer import Trailer
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.lights import LightCycle, crash_lights
from trace_dag.scenario.openscenario_conflict import KeptConflict
from trace_dag.scenario.openscenario_elements import Element, element, properties, teleport_action
from trace_dag.scenario.openscenario_entities import (
    misc_object,
    person,
    person_reference_ahead_m,
    rear_axle_ahead_m,
    standing_at,
    vehicle,
)
from trace_dag.scenario.openscenario_environment import environment
from trace_dag.scenario.openscenario_motion import SAME_TIME_S, PlayedMotion, TimedPoses
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.surface import NetworkSurface
from trace_dag.simulation.types import Body, SimulationLog, VehicleLog

AUTHOR = "trace-dag"
CONTROLLER = "free_vehicle_controller"

_AFTER_CONTACT_S = 5.0  # how long a scenario with a free participant goes on after the recorded contact
_MOST_TIMES = 2.0  # the recorded time to the contact, that a slow one may take
_MOVES_S = (
    0.1  # from then on a player knows how fast the free vehicle is; whoever synchronizes with one who stands stops
)
_ENDS_S, _GOES_ON_S = 0.1, 1.0
_BEFORE_END_S = 0.0005
_TRAJECTORY = "_trajectory"  # end of the names of trajectories
_AFTER_COLLISION_S = 1.0  # and after one it gets into
_LICENCE = {"name": "CC0 1.0", "resource": "https://creativecommons.org/publicdomain/zero/1.0/", "spdxId": "CC0-1.0"}
_XSI = "http://www.w3.org/2001/XMLSchema-instance"


@dataclass(frozen=True)
class Flavour:
    """The form of OpenSCENARIO: 1.2 or that of CARLA's ScenarioRunner, and which vehicle (``VEH_NO``) is free.

    ``keeps_conflict``, of 1.2 with a free vehicle: the party that it met arrives together with it
    (:mod:`trace_dag.scenario.openscenario_conflict`). ``lights``: which reading of :func:`crash_lights` it has, of 1.2.
    """

    carla: bool = False
    free: int | None = None
    keeps_conflict: bool = False
    lights: int = 0


class OpenScenarios:
    """A simulated crash as OpenSCENARIO, in any flavour. Values that all flavours share are computed once."""

    def __init__(self, record: CrashRecord, network: RoadNetwork, log: SimulationLog) -> None:
        self._record = record
        self._log = log
        self.lights = crash_lights(record, network, log)
        paths = np.concatenate([np.stack([each.x_m, each.y_m], axis=-1) for each in log.vehicles])
        self._surface = NetworkSurface(network).around(paths)
        self._motions: dict[int, PlayedMotion] = {}
        self._driven: dict[tuple[int, float], _Driven] = {}  # by vehicle and reference point

    def write(self, flavour: Flavour | None = None, *, map_file: str = "map.xodr") -> bytes:
        """Return one scenario as XML.

        ``map_file`` is the map's path relative to the scenario. Equal input gives equal bytes.

        Raises :class:`ValueError` if the free vehicle is not in the log, or is a person.
        """
        flavour, record, log = flavour or Flavour(), self._record, self._log
        if flavour.free is not None and flavour.free not in log.bodies:
            raise ValueError(f"vehicle {flavour.free} is not among those simulated, {sorted(log.bodies)}")
        if flavour.free is not None and log.bodies[flavour.free].is_figure:
            raise ValueError(f"{party_label(flavour.free)} is a person; only vehicles can be left to a controller")
        shown = _shown_bodies(log, flavour)
        driven = {
            party_label(each.number): self._followed(each, flavour) for each in log.vehicles if each.number in shown
        }
        root = etree.Element(
            "OpenSCENARIO", {f"{{{_XSI}}}noNamespaceSchemaLocation": "OpenScenario.xsd"}, {"xsi": _XSI}
        )
        root.extend(
            [
                _header(record, flavour),
                element("CatalogLocations"),
                element("RoadNetwork", element("LogicFile", filepath=map_file), self._signals(flavour)),
                _entities(log, flavour),
                _storyboard(record, log, flavour, driven),
            ]
        )
        etree.indent(root, " ")
        text = etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode()
        for polyline in root.iter("Polyline"):
            name, depth = polyline.text or "", sum(1 for _ in polyline.iterancestors())
            text = text.replace(f">{name}</Polyline>", _polyline(driven[name], depth=depth))
        return text.encode() + b"\n"

    def _signals(self, flavour: Flavour) -> Element | None:
        """Return the programs of the traffic lights; none without lights, nor for CARLA, whose lights are its own."""
        if flavour.carla or not self.lights:
            return None
        return element("TrafficSignals", *map(_controller_of_lights, self.lights[flavour.lights].cycles))

    def _followed(self, vehicle: VehicleLog, flavour: Flavour) -> _Driven:
        """Return a vehicle's motion.

        If another vehicle is free, it ends where the vehicle would first touch that one.
        """
        place = vehicle.number, _reference_ahead_m(self._log, vehicle.number, flavour)
        if place not in self._driven:
            if vehicle.number not in self._motions:
                self._motions[vehicle.number] = PlayedMotion.of(self._log, vehicle, self._surface)
            driven = self._motions[vehicle.number].of_point(place[1])
            self._driven[place] = _Driven([round(time_s, 6) for time_s in driven.time_s.tolist()], _poses(driven))
        whole = self._driven[place]
        until_s = _followed_until_s(self._log, vehicle.number, flavour.free)
        count = sum(time_s <= until_s + SAME_TIME_S for time_s in whole.time_s)
        if count == len(whole.time_s):
            return whole
        cut = _Driven(whole.time_s[:count], whole.poses[:count])
        if until_s - cut.time_s[-1] > SAME_TIME_S:
            cut = cut.then(round(until_s, 6), whole.pose_at(until_s))
        return cut.straight_on() if flavour.keeps_conflict else cut


_Pose = tuple[float, ...]  # x, y, z (m), heading, pitch, roll (rad), as they are written


class _Driven(NamedTuple):
    """A motion as written in a scenario: times in seconds and places of the reference point."""

    time_s: list[float]
    poses: list[_Pose]

    def pose_at(self, time_s: float) -> _Pose:
        """Return the pose at a time; headings are continuous."""
        columns = np.array(self.poses).T
        return tuple(round(float(np.interp(time_s, self.time_s, values)), 6) + 0.0 for values in columns)

    def then(self, time_s: float, pose: _Pose) -> _Driven:
        """Return the motion, and a pose after it."""
        return _Driven([*self.time_s, time_s], [*self.poses, pose])

    def straight_on(self) -> _Driven:
        """Extend the motion by one second at its final velocity, so that a player one frame late keeps its heading."""
        end_s, last = self.time_s[-1], self.poses[-1]
        before = self.pose_at(end_s - _ENDS_S)
        place = (round(v + (v - u) / _ENDS_S * _GOES_ON_S, 6) for u, v in zip(before[:3], last[:3], strict=True))
        return self.then(round(end_s + _GOES_ON_S, 6), (*place, *last[3:]))


def _header(record: CrashRecord, flavour: Flavour) -> Element:
    day = datetime.datetime(record.year or record.case_year, record.month or 1, record.day or 1)
    free = f", V{flavour.free} free" if flavour.free else ""
    return element(
        "FileHeader",
        None if flavour.carla else element("License", **_LICENCE),  # which 1.0 does not have
        description=f"Crash {record.key}, reconstructed{free}",
        author=AUTHOR,
        revMajor=1,
        revMinor=0 if flavour.carla else 2,
        date=day.isoformat(),
    )


def _polyline(driven: _Driven, *, depth: int) -> str:
    """Return the vertices of a polyline as text, with the polyline's end tag.

    Thousands of vertices are nine tenths of a scenario, and as single elements they took nine tenths of the time.
    """
    start = "\n" + " " * (depth + 1)
    vertices = [
        f'{start}<Vertex time="{time_s}">{start} <Position>'
        f'{start}  <WorldPosition x="{x}" y="{y}" z="{z}" h="{h}" p="{p}" r="{r}"/>{start} </Position>{start}</Vertex>'
        for time_s, (x, y, z, h, p, r) in zip(driven.time_s, driven.poses, strict=True)
    ]
    return f">{''.join(vertices)}\n{' ' * depth}</Polyline>"


def _reference_ahead_m(log: SimulationLog, number: int, flavour: Flavour) -> float:
    body = log.bodies[number]
    if flavour.carla:
        return 0.0
    if body.is_figure:
        return person_reference_ahead_m(body)
    return rear_axle_ahead_m(body, _trailer(log, number))


def _trailer(log: SimulationLog, number: int) -> Trailer | None:
    """Return the trailer that a body is."""
    return log.trailers[party_of_body(number)] if log.bodies[number].is_trailer else None


def _shown_bodies(log: SimulationLog, flavour: Flavour) -> dict[int, Body]:
    """Return the bodies of a scenario, by number.

    A trailer is a separate object with a trajectory of its own, because revision 1.2 cannot couple two. There is none
    behind a vehicle that is left to a controller, which it would not follow. There is none for CARLA, which spawns no
    overlapping vehicles such as tractor and semitrailer.
    """
    free = () if flavour.free is None else (flavour.free,)
    return {
        number: body
        for number, body in sorted(log.bodies.items())
        if not (body.is_trailer and (flavour.carla or party_of_body(number) in free))
    }


def _followed_until_s(log: SimulationLog, number: int, free: int | None) -> float:
    """Return the time until which a vehicle follows its motion.

    If another vehicle is free, it is the first touch with that one.
    """
    pair = {party_of_body(number), free}
    touching = [contact.time_s for contact in log.contacts if {contact.number_1, contact.number_2} == pair]
    return min(touching, default=math.inf)


def _entities(log: SimulationLog, flavour: Flavour) -> Element:
    entities = element("Entities")
    first = min(log.bodies) if flavour.free is None else flavour.free
    for number, body in _shown_bodies(log, flavour).items():
        reference_m = _reference_ahead_m(log, number, flavour)
        said = {"type": "ego_vehicle" if number == first else "simulation"} if flavour.carla else {}
        what = "trailer_of_fars_vehicle_number" if body.is_trailer else "fars_vehicle_number"
        if number > SURROUNDING:
            what = "surrounding_vehicle_number"
        said["fars_party_number" if body.is_figure else what] = str(party_of_body(number))
        if body.is_figure:
            made = person(number, body, said, reference_ahead_m=reference_m, carla=flavour.carla)
        else:
            pulled = _trailer(log, number)
            made = vehicle(number, body, said, reference_ahead_m=reference_m, carla=flavour.carla, trailer=pulled)
        left_free = number == flavour.free and not flavour.carla
        controller = element("ObjectController", _controller()) if left_free else None
        entities.append(element("ScenarioObject", made, controller, name=party_label(number)))
    for item in _shown_objects(log, flavour):
        entities.append(element("ScenarioObject", misc_object(item), name=party_label(item.number)))
    return entities


def _shown_objects(log: SimulationLog, flavour: Flavour) -> tuple[FixedObject, ...]:
    """Return the fixed objects of a scenario; none for CARLA, whose ScenarioRunner only takes props of its library."""
    return () if flavour.carla else log.objects


def _controller_of_lights(cycle: LightCycle) -> Element:
    """Return a controller of the map by its id, with phases that follow each other from the start, over and over."""
    phases = [
        element(
            "Phase",
            *(element("TrafficSignalState", trafficSignalId=each, state=colour) for each in cycle.signal_ids),
            name=f"{colour}_{number}",  # a phase has a name of its own
            duration=duration_s,
        )
        for number, (duration_s, colour) in enumerate(cycle.steps, 1)
    ]
    return element("TrafficSignalController", *phases, name=cycle.controller_id)


def _controller() -> Element:
    # The first is ScenarioRunner's for an ego driven from outside.
    said = {"module": "external_control", "esminiController": "ExternalController"}
    return element("Controller", properties(said), name=CONTROLLER)


def _storyboard(record: CrashRecord, log: SimulationLog, flavour: Flavour, driven: Mapping[str, _Driven]) -> Element:
    actions = element("Actions", environment(record, carla=flavour.carla))
    act = element("Act", name="reconstruction")
    logged = {party_label(each.number): each for each in log.vehicles}
    for name, motion in driven.items():
        free = logged[name].number == flavour.free
        met = flavour.free if flavour.keeps_conflict and not free else None
        kept = None if met is None else KeptConflict.of(log, met, logged[name].number, driven)
        waits = kept is not None and kept.walks  # with a speed it would walk before it sets out
        begins = [teleport_action(*motion.poses[0]), _speed(0.0 if waits else logged[name].speed_mps[0], flavour)]
        actions.append(element("Private", *begins, _handing_over(flavour) if free else None, entityRef=name))
        if not free:
            act.append(_follow(name, motion, flavour, kept))
    for item in _shown_objects(log, flavour):
        actions.append(element("Private", standing_at(item), entityRef=party_label(item.number)))
    act.extend([element("StartTrigger", _group(_at_start("start_act", flavour))), element("StopTrigger")])
    story = element("Story", act, name="crash")
    return element("Storyboard", element("Init", actions), story, _stop(log, flavour))


def _speed(first_mps: float, flavour: Flavour) -> Element:
    """Return the speed that an entity begins with."""
    speed_mps = round(float(first_mps), 3) + 0.0
    at_once = element("SpeedActionDynamics", dynamicsShape="step", value=0.0, dynamicsDimension="time")
    value = element("AbsoluteTargetSpeed", value=max(speed_mps, 0.0) if flavour.carla else speed_mps)
    action = element("SpeedAction", at_once, element("SpeedActionTarget", value))
    return element("PrivateAction", element("LongitudinalAction", action))


def _handing_over(flavour: Flavour) -> Element:
    """Return the action that gives a vehicle to its controller.

    Revision 1.0 also needs its assignment and every override.
    """
    if not flavour.carla:
        activated = element("ActivateControllerAction", lateral=True, longitudinal=True)
        return element("PrivateAction", element("ControllerAction", activated))
    override = element("OverrideControllerValueAction")
    for pedal in ("Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel"):
        override.append(element(pedal, active=False, value=0.0))
    override.append(element("Gear", active=False, number=0.0))
    assigned = element("AssignControllerAction", _controller())
    return element("PrivateAction", element("ControllerAction", override, assigned))


def _follow(name: str, driven: _Driven, flavour: Flavour, kept: KeptConflict | None = None) -> Element:
    """Return the manoeuvre of a vehicle that follows its motion: by the clock, or so that it keeps a conflict."""
    polyline = element("Polyline")
    polyline.text = name  # in the place of its vertices, which are written as text
    trajectory = element("Trajectory", element("Shape", polyline), name=f"{name}{_TRAJECTORY}", closed=False)
    timing = element("Timing", domainAbsoluteRelative="absolute", scale=1.0, offset=0.0)
    sets_out = _at_start(f"{name}_start", flavour)
    if kept is not None:
        timing = kept.timing()
        sets_out = kept.sets_out(f"{name}_start", sets_out)
    following = element(
        "FollowTrajectoryAction",
        trajectory if flavour.carla else element("TrajectoryRef", trajectory),  # of 1.1
        element("TimeReference", timing),
        element("TrajectoryFollowingMode", followingMode="position"),
    )
    action = element("PrivateAction", element("RoutingAction", following))
    event = element(
        "Event",
        element("Action", action, name=f"{name}{_TRAJECTORY}"),
        element("StartTrigger", _group(sets_out)),
        name=f"{name}_follow",
        priority="overwrite" if flavour.carla else "override",  # 1.1 renamed it
        maximumExecutionCount=1,
    )
    return element(
        "ManeuverGroup",
        element("Actors", element("EntityRef", entityRef=name), selectTriggeringEntities=False),
        element("Maneuver", event, name=f"{name}_maneuver"),
        _arriving(name, kept),
        name=f"{name}_group",
        maximumExecutionCount=1,
    )


def _arriving(name: str, kept: KeptConflict | None) -> Element | None:
    """Return the manoeuvre in which a vehicle arrives together with the free one; None if it needs none.

    It ends when the vehicle would have to be too fast.
    """
    action = None if kept is None else kept.synchronized()
    if kept is None or action is None:
        return None
    conditions, goes_on = kept.keeps_speed(name)
    arrives = element(
        "Event",
        element("Action", action, name=f"{name}_arrives"),
        element("StartTrigger", _group(_when(f"{name}_arrives_start", _MOVES_S, "greaterThan"))),
        name=f"{name}_arrives_together",
        priority="parallel",
        maximumExecutionCount=1,
    )
    gives_up = element(
        "Event",
        element("Action", goes_on, name=f"{name}_goes_on"),
        element("StartTrigger", *map(_group, conditions)),
        name=f"{name}_keeps_speed",
        priority="override",
        maximumExecutionCount=1,
    )
    return element("Maneuver", arrives, gives_up, name=f"{name}_adapting")


def _poses(motion: TimedPoses) -> list[_Pose]:
    places = (_rounded(values, 5) for values in (motion.x_m, motion.y_m, motion.z_m))
    angles = (_rounded(values, 6) for values in (motion.heading_rad, motion.pitch_rad, motion.roll_rad))
    return list(zip(*places, *angles, strict=True))


def _rounded(values: FloatArray, digits: int) -> list[float]:
    whole: list[float] = (values.round(digits) + 0.0).tolist()  # no minus before a zero
    return whole


def _group(condition: Element) -> Element:
    return element("ConditionGroup", condition)


def _when(name: str, time_s: float, rule: str) -> Element:
    """Return a condition on the time since the start."""
    time = element("SimulationTimeCondition", value=time_s, rule=rule)
    return element("Condition", element("ByValueCondition", time), name=name, delay=0.0, conditionEdge="none")


def _at_start(name: str, flavour: Flavour) -> Element:
    return _when(name, 0.0, "greaterThan" if flavour.carla else "greaterOrEqual")  # which 1.0 does not have


def _stop(log: SimulationLog, flavour: Flavour) -> Element:
    """Return the stop at the end of the motion.

    With a free vehicle it is some time after the recorded contact or a collision of that vehicle.
    """
    contact, end_s = log.first_contact, log.duration_s
    if flavour.free is not None:
        times = _MOST_TIMES if flavour.keeps_conflict else 1.0
        end_s = times * (contact.time_s if contact else log.duration_s) + _AFTER_CONTACT_S
    # A little before the last vertex, else a player goes one frame beyond it: the sum of its steps is not exactly the
    # time.
    conditions = [_when("stop_time", round(end_s - _BEFORE_END_S, 4), "greaterThan")]
    if flavour.free is not None:
        others = {*_shown_bodies(log, flavour), *(item.number for item in _shown_objects(log, flavour))}
        free = party_label(flavour.free)
        conditions += [_struck(free, party_label(number)) for number in sorted(others - {flavour.free})]
    return element("StopTrigger", *map(_group, conditions))


def _struck(free: str, other: str) -> Element:
    """Return the condition that the free vehicle has touched another entity some time ago."""
    by = element("TriggeringEntities", element("EntityRef", entityRef=free), triggeringEntitiesRule="any")
    touches = element("EntityCondition", element("CollisionCondition", element("EntityRef", entityRef=other)))
    return element(
        "Condition",
        element("ByEntityCondition", by, touches),
        name=f"stop_collision_{other}",
        delay=_AFTER_COLLISION_S,
        conditionEdge="none",
    )
