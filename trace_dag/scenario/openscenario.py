"""A simulated crash as OpenSCENARIO: replayed by everyone, or with the ego free.

Three files are made of one log: OpenSCENARIO 1.2 with a timed trajectory per participant, the same with the ego left to
a controller, and the 1.0 form that CARLA's ScenarioRunner (0.9.16) accepts. Positions are of the body's centre on the
road surface, in the map's own frame (metres, radians counter-clockwise from east), times in seconds from the start of
the reconstruction. Every entity's reference point is its body's centre, and its bounding box and axles are declared
relative to that, so that players which ignore the box's offset and players which apply it agree.

Sources: ASAM OpenSCENARIO XML 1.0.0 and 1.2.0; ScenarioRunner ``openscenario_parser.py`` for what 1.0 files it reads:
``FollowTrajectoryAction`` in the Story only, polylines only, a ``time`` on every vertex. It mirrors y and heading into
CARLA's frame by itself, unless the header's description begins with ``CARLA:``.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.geometry import FloatArray
from trace_dag.sim.types import Body, SimulationLog, VehicleLog

if TYPE_CHECKING:
    from scenariogeneration import xosc

AUTHOR = "trace-dag"
VERTEX_STEP_S = 0.05
"""Time between vertices away from the impact; around it every logged step is kept."""

_IMPACT_WINDOW_S = 0.5
_WHEELBASE_SHARE = 0.58  # of the body's length: typical of passenger cars (2.7 m of 4.65 m)
_TRACK_SHARE = 0.85  # of the body's width
_WHEEL_DIAMETER_M = 0.65
_MAX_STEER_RAD = 0.6
_MAX_SPEED_MPS = 90.0
_MAX_ACCELERATION_MPS2 = 12.0
# A blueprint of CARLA 0.9.16 for each class, for players that choose the body by name.
_CARLA_BLUEPRINTS = {
    VehicleClass.CAR: "vehicle.lincoln.mkz_2020",
    VehicleClass.SUV: "vehicle.nissan.patrol",
    VehicleClass.PICKUP: "vehicle.tesla.cybertruck",
    VehicleClass.VAN: "vehicle.mercedes.sprinter",
    VehicleClass.LIGHT_TRUCK: "vehicle.carlamotors.carlacola",
    VehicleClass.TRUCK: "vehicle.carlamotors.firetruck",
    VehicleClass.TRACTOR_TRAILER: "vehicle.carlamotors.firetruck",
    VehicleClass.BUS: "vehicle.mitsubishi.fusorosa",
    VehicleClass.MOTORCYCLE: "vehicle.yamaha.yzf",
    VehicleClass.OTHER: "vehicle.lincoln.mkz_2020",
}


@dataclass(frozen=True)
class Flavour:
    """Which OpenSCENARIO is written: its minor revision, and the participant (``VEH_NO``) left to a controller."""

    minor_revision: int = 2
    free_ego: int | None = None

    @property
    def for_scenario_runner(self) -> bool:
        """Revision 1.0 is written for CARLA's ScenarioRunner, which takes nothing later."""
        return self.minor_revision == 0


def write_openscenario(
    record: CrashRecord, log: SimulationLog, *, map_file: str = "map.xodr", flavour: Flavour | None = None
) -> bytes:
    """The scenario as XML. ``map_file`` is the map's path relative to the scenario. Byte for byte reproducible."""
    from scenariogeneration import xosc

    flavour = flavour or Flavour()
    storyboard = _storyboard(log, flavour)
    scenario = xosc.Scenario(
        f"Fatal crash {record.key}, reconstructed",
        AUTHOR,
        xosc.ParameterDeclarations(),
        _entities(log, flavour),
        storyboard,
        xosc.RoadNetwork(roadfile=map_file),
        xosc.Catalog(),
        osc_minor_version=flavour.minor_revision,
        creation_date=datetime.datetime(record.year or record.case_year, record.month or 1, record.day or 1),
    )
    root = etree.fromstring(_as_bytes(scenario))
    etree.indent(root, "  ")
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def read_trajectories(data: bytes) -> dict[str, FloatArray]:
    """The trajectories of a scenario by entity, shape (n, 5): time (s), x, y, z (m), heading (radians)."""
    root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True))
    trajectories: dict[str, FloatArray] = {}
    for group in root.iter("ManeuverGroup"):
        entity = group.find("Actors/EntityRef")
        vertices = group.findall(".//Polyline/Vertex")
        if entity is None or not vertices:
            continue
        rows = []
        for vertex in vertices:
            position = vertex.find("Position/WorldPosition")
            if position is None:
                continue
            rows.append([float(vertex.get("time", "nan")), *(float(position.get(axis, "0")) for axis in "xyzh")])
        trajectories[entity.get("entityRef", "")] = np.array(rows)
    return trajectories


def entity_name(number: int) -> str:
    """The scenario's name for a FARS vehicle number."""
    return f"V{number}"


def _as_bytes(scenario: xosc.Scenario) -> bytes:
    from xml.etree import ElementTree  # scenariogeneration builds with it; nothing is parsed here

    return bytes(ElementTree.tostring(scenario.get_element()))


def _entities(log: SimulationLog, flavour: Flavour) -> xosc.Entities:
    from scenariogeneration import xosc

    entities = xosc.Entities()
    for vehicle in log.vehicles:
        body = log.bodies[vehicle.number]
        controller = None
        if vehicle.number == flavour.free_ego:
            properties = xosc.Properties()
            properties.add_property("module", "external_control")
            controller = xosc.Controller("ego_controller", properties)
        entities.add_scenario_object(entity_name(vehicle.number), _vehicle(vehicle.number, body, flavour), controller)
    return entities


def _vehicle(number: int, body: Body, flavour: Flavour) -> xosc.Vehicle:
    from scenariogeneration import xosc

    categories = {
        VehicleClass.MOTORCYCLE: xosc.VehicleCategory.motorbike,
        VehicleClass.BUS: xosc.VehicleCategory.bus,
        VehicleClass.VAN: xosc.VehicleCategory.van,
        VehicleClass.LIGHT_TRUCK: xosc.VehicleCategory.truck,
        VehicleClass.TRUCK: xosc.VehicleCategory.truck,
        VehicleClass.TRACTOR_TRAILER: xosc.VehicleCategory.semitrailer,
    }
    half_wheelbase_m = _WHEELBASE_SHARE * body.length_m / 2
    track_m = _TRACK_SHARE * body.width_m
    name = _CARLA_BLUEPRINTS[body.vehicle_class] if flavour.for_scenario_runner else f"{body.vehicle_class}_{number}"
    vehicle = xosc.Vehicle(
        name,
        categories.get(body.vehicle_class, xosc.VehicleCategory.car),
        xosc.BoundingBox(
            round(body.width_m, 3),
            round(body.length_m, 3),
            round(body.height_m, 3),
            0.0,
            0.0,
            round(body.height_m / 2, 3),
        ),
        xosc.Axle(
            _MAX_STEER_RAD, _WHEEL_DIAMETER_M, round(track_m, 3), round(half_wheelbase_m, 3), _WHEEL_DIAMETER_M / 2
        ),
        xosc.Axle(0.0, _WHEEL_DIAMETER_M, round(track_m, 3), round(-half_wheelbase_m, 3), _WHEEL_DIAMETER_M / 2),
        _MAX_SPEED_MPS,
        _MAX_ACCELERATION_MPS2,
        _MAX_ACCELERATION_MPS2,
        mass=None if flavour.for_scenario_runner else round(body.mass_kg, 1),
    )
    first_or_ego = number == (flavour.free_ego or 1)
    vehicle.add_property("type", "ego_vehicle" if flavour.for_scenario_runner and first_or_ego else "simulation")
    vehicle.add_property("fars_vehicle_number", str(number))
    return vehicle


def _storyboard(log: SimulationLog, flavour: Flavour) -> xosc.StoryBoard:
    from scenariogeneration import xosc

    init = xosc.Init()
    act = xosc.Act("reconstruction", _at_time(0.0, "start_act"))
    for vehicle in log.vehicles:
        name = entity_name(vehicle.number)
        init.add_init_action(name, xosc.TeleportAction(_position(vehicle, 0)))
        init.add_init_action(
            name,
            xosc.AbsoluteSpeedAction(
                round(float(vehicle.speed_mps[0]), 3),
                xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0.0),
            ),
        )
        if vehicle.number != flavour.free_ego:
            act.add_maneuver_group(_follow(vehicle, log, flavour))
    story = xosc.Story("crash")
    story.add_act(act)
    storyboard = xosc.StoryBoard(init, _at_time(float(log.duration_s), "stop", point="stop"))
    storyboard.add_story(story)
    return storyboard


def _follow(vehicle: VehicleLog, log: SimulationLog, flavour: Flavour) -> xosc.ManeuverGroup:
    from scenariogeneration import xosc

    name = entity_name(vehicle.number)
    kept = _vertex_indices(vehicle, log)
    trajectory = xosc.Trajectory(f"{name}_trajectory", closed=False)
    trajectory.add_shape(
        xosc.Polyline([round(float(vehicle.time_s[i]), 4) for i in kept], [_position(vehicle, i) for i in kept])
    )
    action = xosc.FollowTrajectoryAction(
        trajectory,
        xosc.FollowingMode.position,
        reference_domain=xosc.ReferenceContext.absolute,
        scale=1.0,
        offset=0.0,
    )
    # 1.1 renamed the priority.
    priority = xosc.Priority.overwrite if flavour.minor_revision == 0 else xosc.Priority.override
    event = xosc.Event(f"{name}_follow", priority)
    event.add_trigger(_at_time(0.0, f"{name}_start"))
    event.add_action(f"{name}_trajectory", action)
    manoeuvre = xosc.Maneuver(f"{name}_maneuver")
    manoeuvre.add_event(event)
    group = xosc.ManeuverGroup(f"{name}_group")
    group.add_actor(name)
    group.add_maneuver(manoeuvre)
    return group


def _vertex_indices(vehicle: VehicleLog, log: SimulationLog) -> list[int]:
    """Every logged step near the first contact, elsewhere one each ``VERTEX_STEP_S``; always the first and last."""
    contact_s = log.first_contact.time_s if log.first_contact else -np.inf
    kept: list[int] = []
    last_s = -np.inf
    for i, time_s in enumerate(vehicle.time_s):
        near_impact = abs(float(time_s) - contact_s) <= _IMPACT_WINDOW_S
        if near_impact or time_s - last_s >= VERTEX_STEP_S - 1e-9 or i == len(vehicle.time_s) - 1:
            kept.append(i)
            last_s = float(time_s)
    return kept


def _position(vehicle: VehicleLog, index: int) -> xosc.WorldPosition:
    from scenariogeneration import xosc

    return xosc.WorldPosition(
        round(float(vehicle.x_m[index]), 4),
        round(float(vehicle.y_m[index]), 4),
        round(float(vehicle.z_m[index]), 4),
        round(float(vehicle.heading_rad[index]), 5),
        0.0,
        0.0,
    )


def _at_time(time_s: float, name: str, point: str = "start") -> xosc.ValueTrigger:
    from scenariogeneration import xosc

    rule = xosc.Rule.greaterThan
    return xosc.ValueTrigger(
        name,
        0.0,
        xosc.ConditionEdge.none,
        xosc.SimulationTimeCondition(round(time_s, 3), rule),
        triggeringpoint=point,
    )
