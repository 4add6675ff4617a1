"""A simulated crash as OpenSCENARIO: replayed by everyone, or with one participant free.

Two dialects. OpenSCENARIO 1.2 for players in general: positions are of the middle of the rear axle on the road, as the
standard has it. The 1.0 form that CARLA's ScenarioRunner (0.9.16) accepts: positions are of the body's middle, since
that is where it puts an actor. Both are in the map's own frame (metres, radians counter-clockwise from east) with
times in seconds from the start of the reconstruction.

If a participant is free, a controller drives it from its initial state. The others follow their motion up to the
contact with it, since their motion after that was caused by the contact. From there they continue as the standard
defines for entities without an action.

Sources: ASAM OpenSCENARIO XML 1.0.0 and 1.2.0; ScenarioRunner ``openscenario_parser.py`` for what 1.0 files it reads:
``FollowTrajectoryAction`` in the Story only, polylines only, a ``time`` on every vertex, no negative initial speed. It
mirrors y and heading into CARLA's frame by itself, unless the header's description begins with ``CARLA:``.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from lxml import etree

from trace_dag.crash.parties import party_label, party_of_body
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.trailer import Trailer
from trace_dag.geometry import FloatArray
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.openscenario_environment import environment, use_version
from trace_dag.scenario.openscenario_motion import SAME_TIME_S, PlayedMotion, TimedPoses
from trace_dag.scenario.openscenario_objects import misc_object, standing_at
from trace_dag.scenario.openscenario_people import person, person_reference_ahead_m
from trace_dag.scenario.openscenario_vehicles import rear_axle_ahead_m, vehicle
from trace_dag.sim.surface import NetworkSurface
from trace_dag.sim.types import Body, SimulationLog, VehicleLog
from trace_dag.states.objects import FixedObject

if TYPE_CHECKING:
    from scenariogeneration import xosc

AUTHOR = "trace-dag"
CONTROLLER = "free_vehicle_controller"

_AFTER_CONTACT_S = 5.0  # how long a scenario with a free participant goes on after the recorded contact
_BEFORE_END_S = 0.0005
_TRAJECTORY = "_trajectory"  # end of the names of trajectories
_AFTER_COLLISION_S = 1.0  # and after one it gets into
_LICENCE = ("CC0-1.0", "https://creativecommons.org/publicdomain/zero/1.0/")
_XML_PARSER = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)


@dataclass(frozen=True)
class Flavour:
    """The form of OpenSCENARIO: 1.2 or that of CARLA's ScenarioRunner, and which vehicle (``VEH_NO``) is free."""

    carla: bool = False
    free: int | None = None


class OpenScenarios:
    """A simulated crash as OpenSCENARIO, in any flavour. Values that all flavours share are computed once."""

    def __init__(self, record: CrashRecord, network: RoadNetwork, log: SimulationLog) -> None:
        self._record = record
        self._log = log
        paths = np.concatenate([np.stack([each.x_m, each.y_m], axis=-1) for each in log.vehicles])
        self._surface = NetworkSurface(network).around(paths)
        self._motions: dict[int, PlayedMotion] = {}
        self._driven: dict[tuple[int, float], _Driven] = {}  # by vehicle and reference point

    def write(self, flavour: Flavour | None = None, *, map_file: str = "map.xodr") -> bytes:
        """One scenario as XML. ``map_file`` is the map's path relative to the scenario. Byte for byte reproducible.

        Raises :class:`ValueError` if the free vehicle is not in the log, or is a person.
        """
        from scenariogeneration import xosc

        flavour, record, log = flavour or Flavour(), self._record, self._log
        if flavour.free is not None and flavour.free not in log.bodies:
            raise ValueError(f"vehicle {flavour.free} is not among those simulated, {sorted(log.bodies)}")
        if flavour.free is not None and log.bodies[flavour.free].is_figure:
            raise ValueError(f"{party_label(flavour.free)} is a person; only vehicles can be left to a controller")
        minor_version = use_version(carla=flavour.carla)
        shown = _shown_bodies(log, flavour)
        logged = [each for each in log.vehicles if each.number in shown]
        driven = {party_label(each.number): self._followed(each, flavour) for each in logged}
        scenario = xosc.Scenario(
            f"Fatal crash {record.key}, reconstructed" + (f", V{flavour.free} free" if flavour.free else ""),
            AUTHOR,
            xosc.ParameterDeclarations(),
            _entities(log, flavour),
            _storyboard(record, log, flavour, driven),
            xosc.RoadNetwork(roadfile=map_file),
            xosc.Catalog(),
            osc_minor_version=minor_version,
            license=None if flavour.carla else xosc.License("CC0 1.0", _LICENCE[1], _LICENCE[0]),
            creation_date=datetime.datetime(record.year or record.case_year, record.month or 1, record.day or 1),
        )
        root = etree.fromstring(_as_bytes(scenario), _XML_PARSER)
        lines = {}
        for trajectory in root.iter("Trajectory"):
            (polyline,) = trajectory.iter("Polyline")
            name = trajectory.get("name", "").removesuffix(_TRAJECTORY)
            lines[f">{name}</Polyline>"] = _polyline(driven[name], depth=sum(1 for _ in polyline.iterancestors()))
            for vertex in list(polyline):
                polyline.remove(vertex)
            polyline.text = name
        etree.indent(root, " ")
        text = etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode()
        for place, vertices in lines.items():
            text = text.replace(place, vertices)
        return text.encode() + b"\n"

    def _followed(self, vehicle: VehicleLog, flavour: Flavour) -> _Driven:
        """A vehicle's motion: all of it or, if another one is free, up to where it would first touch that one."""
        place = vehicle.number, _reference_ahead_m(self._log, vehicle.number, flavour)
        if place not in self._driven:
            if vehicle.number not in self._motions:
                self._motions[vehicle.number] = PlayedMotion.of(self._log, vehicle, self._surface)
            driven = self._motions[vehicle.number].of_point(place[1])
            self._driven[place] = _Driven([round(time_s, 6) for time_s in driven.time_s.tolist()], _poses(driven))
        whole = self._driven[place]
        until_s = _followed_until_s(self._log, vehicle.number, flavour.free)
        count = sum(time_s <= until_s + SAME_TIME_S for time_s in whole.time_s)
        if count == 1 < len(whole.time_s):  # it stood until then, and one vertex is not a trajectory
            return _Driven([whole.time_s[0], round(until_s, 6)], [whole.poses[0]] * 2)
        return _Driven(whole.time_s[:count], whole.poses[:count])


_Pose = tuple[float, ...]  # x, y, z (m), heading, pitch, roll (rad), as they are written


class _Driven(NamedTuple):
    """A motion as written in a scenario: times in seconds and places of the reference point."""

    time_s: list[float]
    poses: list[_Pose]


def _as_bytes(scenario: xosc.Scenario) -> bytes:
    from xml.etree import ElementTree  # scenariogeneration builds with it; nothing is parsed here

    return bytes(ElementTree.tostring(scenario.get_element()))


def _polyline(driven: _Driven, *, depth: int) -> str:
    """The vertices of a polyline as text, with the polyline's end tag.

    Thousands of vertices are nine tenths of a scenario: written as elements one by one, indented and parsed they took
    nine tenths of the time.
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
    """The trailer that a body is."""
    return log.trailers[party_of_body(number)] if log.bodies[number].is_trailer else None


def _shown_bodies(log: SimulationLog, flavour: Flavour) -> dict[int, Body]:
    """The bodies of a scenario, by number. A trailer is an object of its own, that follows its own trajectory: revision
    1.2 cannot couple two. Behind a vehicle that is left to a controller none would follow, so that there is none; nor
    for CARLA, which spawns no two vehicles that overlap, as tractor and semitrailer do."""
    free = () if flavour.free is None else (flavour.free,)
    return {
        number: body
        for number, body in sorted(log.bodies.items())
        if not (body.is_trailer and (flavour.carla or party_of_body(number) in free))
    }


def _followed_until_s(log: SimulationLog, number: int, free: int | None) -> float:
    """The time until which a vehicle follows its motion: if another one is free, until it would first touch that
    one."""
    pair = {party_of_body(number), free}
    touching = [contact.time_s for contact in log.contacts if {contact.number_1, contact.number_2} == pair]
    return min(touching, default=math.inf)


def _entities(log: SimulationLog, flavour: Flavour) -> xosc.Entities:
    from scenariogeneration import xosc

    entities = xosc.Entities()
    first = min(log.bodies) if flavour.free is None else flavour.free
    for number, body in _shown_bodies(log, flavour).items():
        reference_m = _reference_ahead_m(log, number, flavour)
        if body.is_figure:
            made = person(number, body, reference_ahead_m=reference_m, carla=flavour.carla)
        else:
            pulled = _trailer(log, number)
            made = vehicle(number, body, reference_ahead_m=reference_m, carla=flavour.carla, trailer=pulled)
        if flavour.carla:
            made.add_property("type", "ego_vehicle" if number == first else "simulation")
        said = "trailer_of_fars_vehicle_number" if body.is_trailer else "fars_vehicle_number"
        made.add_property("fars_party_number" if body.is_figure else said, str(party_of_body(number)))
        controller = _controller() if number == flavour.free and not flavour.carla else None
        entities.add_scenario_object(party_label(number), made, controller)
    for item in _shown_objects(log, flavour):
        entities.add_scenario_object(party_label(item.number), misc_object(item))
    return entities


def _shown_objects(log: SimulationLog, flavour: Flavour) -> tuple[FixedObject, ...]:
    """The fixed objects of a scenario: ScenarioRunner takes the props of CARLA's library alone."""
    return () if flavour.carla else log.objects


def _controller() -> xosc.Controller:
    from scenariogeneration import xosc

    properties = xosc.Properties()
    properties.add_property("module", "external_control")  # ScenarioRunner's for an ego driven from outside
    properties.add_property("esminiController", "ExternalController")
    return xosc.Controller(CONTROLLER, properties)


def _storyboard(
    record: CrashRecord, log: SimulationLog, flavour: Flavour, driven: Mapping[str, _Driven]
) -> xosc.StoryBoard:
    from scenariogeneration import xosc

    init = xosc.Init()
    surroundings = environment(record, carla=flavour.carla)
    if surroundings is not None:
        init.add_global_action(surroundings)
    act = xosc.Act("reconstruction", _at_start("start_act", flavour))
    shown = _shown_bodies(log, flavour)
    for logged in log.vehicles:
        if logged.number not in shown:
            continue
        name = party_label(logged.number)
        speed_mps = round(float(logged.speed_mps[0]), 3) + 0.0
        init.add_init_action(name, xosc.TeleportAction(xosc.WorldPosition(*driven[name].poses[0])))
        init.add_init_action(
            name,
            xosc.AbsoluteSpeedAction(
                max(speed_mps, 0.0) if flavour.carla else speed_mps,
                xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0.0),
            ),
        )
        if logged.number == flavour.free:
            init.add_init_action(name, _handing_over(flavour))
        else:
            act.add_maneuver_group(_follow(name, driven[name], flavour))
    for item in _shown_objects(log, flavour):
        init.add_init_action(party_label(item.number), standing_at(item))
    story = xosc.Story("crash")
    story.add_act(act)
    storyboard = xosc.StoryBoard(init, _stop(log, flavour))
    storyboard.add_story(story)
    return storyboard


def _handing_over(flavour: Flavour) -> xosc.ControllerAction:
    """Gives a vehicle to its controller; revision 1.0 wants it assigned, and every override stated."""
    from scenariogeneration import xosc

    if not flavour.carla:
        return xosc.ControllerAction(activateControllerAction=xosc.ActivateControllerAction(True, True))
    override = xosc.OverrideControllerValueAction()
    for pedal in (override.set_throttle, override.set_brake, override.set_clutch, override.set_parkingbrake):
        pedal(False, 0.0)
    override.set_steeringwheel(False, 0.0)
    override.set_gear(False, 0.0)
    return xosc.ControllerAction(xosc.AssignControllerAction(_controller()), override)


def _follow(name: str, driven: _Driven, flavour: Flavour) -> xosc.ManeuverGroup:
    from scenariogeneration import xosc

    trajectory = xosc.Trajectory(f"{name}{_TRAJECTORY}", closed=False)
    # Only its ends: they are replaced by all vertices, which are written as text.
    ends = [xosc.WorldPosition(*driven.poses[k]) for k in (0, -1)]
    trajectory.add_shape(xosc.Polyline([driven.time_s[0], driven.time_s[-1]], ends))
    action = xosc.FollowTrajectoryAction(
        trajectory,
        xosc.FollowingMode.position,
        reference_domain=xosc.ReferenceContext.absolute,
        scale=1.0,
        offset=0.0,
    )
    # 1.1 renamed the priority.
    event = xosc.Event(f"{name}_follow", xosc.Priority.overwrite if flavour.carla else xosc.Priority.override)
    event.add_trigger(_at_start(f"{name}_start", flavour))
    event.add_action(f"{name}{_TRAJECTORY}", action)
    manoeuvre = xosc.Maneuver(f"{name}_maneuver")
    manoeuvre.add_event(event)
    group = xosc.ManeuverGroup(f"{name}_group")
    group.add_actor(name)
    group.add_maneuver(manoeuvre)
    return group


def _poses(motion: TimedPoses) -> list[_Pose]:
    places = (_rounded(values, 5) for values in (motion.x_m, motion.y_m, motion.z_m))
    angles = (_rounded(values, 6) for values in (motion.heading_rad, motion.pitch_rad, motion.roll_rad))
    return list(zip(*places, *angles, strict=True))


def _rounded(values: FloatArray, digits: int) -> list[float]:
    whole: list[float] = (values.round(digits) + 0.0).tolist()  # no minus before a zero
    return whole


def _at_start(name: str, flavour: Flavour) -> xosc.ValueTrigger:
    from scenariogeneration import xosc

    rule = xosc.Rule.greaterThan if flavour.carla else xosc.Rule.greaterOrEqual  # which 1.0 does not have
    return xosc.ValueTrigger(name, 0.0, xosc.ConditionEdge.none, xosc.SimulationTimeCondition(0.0, rule))


def _stop(log: SimulationLog, flavour: Flavour) -> xosc.ValueTrigger | xosc.Trigger:
    """At the end of the motion; with a vehicle free, some time after the recorded contact or a collision it has."""
    from scenariogeneration import xosc

    def after(time_s: float) -> xosc.ValueTrigger:
        # A little before the last vertex, else a player goes one frame beyond it: the sum of its steps is not exactly
        # the time.
        condition = xosc.SimulationTimeCondition(round(time_s - _BEFORE_END_S, 4), xosc.Rule.greaterThan)
        return xosc.ValueTrigger("stop_time", 0.0, xosc.ConditionEdge.none, condition, triggeringpoint="stop")

    if flavour.free is None:
        return after(log.duration_s)
    free = party_label(flavour.free)
    contact = log.first_contact
    trigger = xosc.Trigger("stop")
    triggers = [after((contact.time_s if contact else log.duration_s) + _AFTER_CONTACT_S)]
    triggers += [
        xosc.EntityTrigger(
            f"stop_collision_{party_label(number)}",
            _AFTER_COLLISION_S,
            xosc.ConditionEdge.none,
            xosc.CollisionCondition(party_label(number)),
            free,
            triggeringpoint="stop",
        )
        for number in sorted([*_shown_bodies(log, flavour), *(item.number for item in _shown_objects(log, flavour))])
        if number != flavour.free
    ]
    for each in triggers:
        group = xosc.ConditionGroup("stop")
        group.add_condition(each)
        trigger.add_conditiongroup(group)
    return trigger
