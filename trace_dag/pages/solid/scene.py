"""A whole crash as glTF: the place, all parties, and the events, on the log's clock.

Names of nodes and their ``extras`` identify each node, so that a viewer can follow a body or look through a driver's
eyes: ``trace_dag.kind`` is ``body``, ``person``, ``object``, ``contact`` or ``place``.

Dents of contacts move a vehicle's points. The depth and the direction are the log's; the shape is for the eye: a flat
face across the push, fading out beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import VehicleClass
from trace_dag.pages.map_scene import MapScene, Window, window_of
from trace_dag.pages.solid.figures import animal_nodes, animal_places, landmarks, person_nodes
from trace_dag.pages.solid.gltf import (
    Keys,
    Material,
    Node,
    body_places,
    body_turns,
    place_keys,
    rolling_keys,
    size_keys,
    turn_keys,
    write_glb,
)
from trace_dag.pages.solid.ground import Terrain
from trace_dag.pages.solid.objects import object_parts
from trace_dag.pages.solid.roadside import areas_of, beside_roads, signs
from trace_dag.pages.solid.shapes import ball, join_shapes
from trace_dag.pages.solid.vehicle_shapes import BRAKE_LAMP, Parts, motorcycle_shape, vehicle_shape, wheel_parts
from trace_dag.scenario.drawn_shapes import CONTACT_COLOUR, body_colour, describe_object, is_ours, vehicle_colour
from trace_dag.simulation.objects import Resistance
from trace_dag.simulation.roadside_terrain import RoadsideTerrain
from trace_dag.simulation.types import BodyKind, Contact

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmFeature
    from trace_dag.pages.drive import AgentDrive
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.simulation.objects import FixedObject
    from trace_dag.simulation.types import Body, SimulationLog, VehicleLog

_AROUND_M: Final = 110.0  # of the motion: so much of the place is seen
_MOST_M: Final = 450.0  # from its middle
_CONTACT: Final = Material(CONTACT_COLOUR, opacity=0.85, glows=True)
_FLASH_S: Final = 0.25
_WAY_EVERY: Final = 2  # steps of the log: a metre or two of a fast vehicle
_STAR_M: Final = 0.22
_BRAKES: Final = 0.02  # of the pedal: lamps are on
LEAST_M: Final = 0.03
"""Less is not seen."""
_WHOLE_M, _NOTHING_M = 0.55, 1.25  # beside the contact: pressed in wholly up to here, and not at all from there on
_LEAST_S: Final = 0.05


def crash_glb(
    key: str,
    network: RoadNetwork,
    log: SimulationLog,
    drive: AgentDrive | None = None,
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> bytes:
    """Return the crash as one GLB file: the log's bodies in their poses on the road, with their dents.

    If an agent drives, the recorded vehicle is shown too, transparent. Equal input gives equal bytes.

    >>> crash_glb(record.key, network, log)[:4]
    b'glTF'
    """
    window = _window(log)
    ways = [np.column_stack([each.x_m, each.y_m, each.z_m])[::_WAY_EVERY] for each in log.vehicles]
    dug = [item for item in log.objects if item.resistance is Resistance.SLOPE]
    first = log.vehicles[0]
    rest = Pose(float(first.x_m[-1]), float(first.y_m[-1]), 0.0, float(first.z_m[-1]))
    place = _place(network, window, surroundings, ways, lambda: RoadsideTerrain(network, log.objects, rest), dug)
    nodes = [place, *(_object(item) for item in log.objects)]
    for vehicle in log.vehicles:
        body, colour = log.bodies[vehicle.number], body_colour(vehicle.number, log.bodies)
        nodes.append(_person(vehicle, body, colour) if body.is_figure else _vehicle(log, vehicle, body, colour))
    if drive is not None:
        nodes.append(_ghost(drive))
    nodes += [_contact(contact, k) for k, contact in enumerate(log.first_of_each)]
    return write_glb(nodes, title=f"Crash {key}", copyright_notice=network.attribution)


def place_glb(network: RoadNetwork, *, surroundings: Sequence[OsmFeature] = ()) -> bytes:
    """Return a road map without a crash as one GLB file.

    >>> place_glb(network)[:4]
    b'glTF'
    """
    return write_glb(
        [_place(network, window_of(network), surroundings)], title="Road map", copyright_notice=network.attribution
    )


def _place(
    network: RoadNetwork,
    window: Window,
    surroundings: Sequence[OsmFeature],
    ways: Sequence[FloatArray] = (),
    roadside: Callable[[], RoadsideTerrain] | None = None,
    dug: Sequence[FixedObject] = (),
) -> Node:
    scene = MapScene(network, window)
    areas = areas_of(surroundings, network.frame, window)
    level = roadside or (lambda: RoadsideTerrain(network, (), Pose(0.0, 0.0, 0.0)))
    terrain = Terrain(scene, window, areas, ways, level, dug)
    beside = beside_roads(surroundings, network.frame, terrain.heights, window)
    place = Node("place", extras={"trace_dag": {"kind": "place"}})
    place.children = [Node("roads and ground", terrain.parts)]
    for name, parts in (("signs", signs(scene, terrain.heights, window)), ("buildings and trees", beside)):
        if parts:
            place.children.append(Node(name, parts))
    return place


def _window(log: SimulationLog) -> Window:
    points = np.concatenate([np.stack([v.x_m, v.y_m], axis=-1) for v in log.vehicles])
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.minimum((high - low) / 2 + _AROUND_M, _MOST_M)
    (west, south), (east, north) = ((low + high) / 2 - half).tolist(), ((low + high) / 2 + half).tolist()
    return west, south, east, north


def _extras(kind: str, **said: Any) -> dict[str, Any]:
    return {"trace_dag": {"kind": kind, **said}}


def _vehicle(log: SimulationLog, vehicle: VehicleLog, body: Body, colour: str) -> Node:
    """Return a vehicle: a node with the pose of the body's middle, its shape, brake lamps and wheels below it."""
    rides = body.vehicle_class is VehicleClass.MOTORCYCLE
    shape = motorcycle_shape(body, colour) if rides else vehicle_shape(body, colour)
    name, down = party_label(vehicle.number), (0.0, 0.0, -body.height_m / 2)
    pressed = [each for each in log.contacts if crush_of(each, vehicle.number) > LEAST_M]
    shell = Node(f"{name} body", shape.parts, translation=down)
    if pressed:
        shell.dents = [dent(each, vehicle.number, shape.parts) for each in pressed]
        shell.moves["weights"] = dent_keys(pressed)
    lamps = Node(f"{name} brake lamps", [(BRAKE_LAMP, shape.brake_lamps)], translation=down, scale=(0.0, 0.0, 0.0))
    lamps.moves["scale"] = size_keys(vehicle.time_s, (vehicle.brake > _BRAKES).astype(float))
    node = _moving(name, vehicle, _extras("body", number=vehicle.number, label=name, eye=_above(shape.eye_m, body)))
    node.children = [shell, lamps]
    gone = np.concatenate(
        [[0.0], np.cumsum(np.diff(vehicle.time_s) * (vehicle.speed_mps[1:] + vehicle.speed_mps[:-1]) / 2)]
    )
    steer = turn_keys(vehicle.time_s, Rotation.from_rotvec(np.outer(vehicle.steer_rad, (0.0, 0.0, 1.0))))
    for k, wheel in enumerate(shape.wheels):
        spinning = Node(f"{name} wheel {k + 1}", wheel_parts(wheel.radius_m, wheel.width_m))
        spinning.moves["rotation"] = rolling_keys(vehicle.time_s, gone / wheel.radius_m)
        hub = Node(f"{name} hub {k + 1}", children=[spinning], translation=_above(wheel.at_m, body))
        if wheel.steered:
            hub.moves["rotation"] = steer
        node.children.append(hub)
    return node


def _ghost(drive: AgentDrive) -> Node:
    """Return the recorded vehicle that an agent replaced, as a transparent shape."""
    index, vehicle = next((k, v) for k, v in enumerate(drive.recorded.vehicles) if v.number == drive.number)
    rides = drive.body.vehicle_class is VehicleClass.MOTORCYCLE
    shape = (motorcycle_shape if rides else vehicle_shape)(drive.body, vehicle_colour(index))
    clear = Material(vehicle_colour(index), opacity=0.3)
    node = _moving(f"{party_label(drive.number)} as recorded", vehicle, _extras("ghost", number=drive.number))
    everything = join_shapes(mesh for _, mesh in shape.parts)
    node.children = [Node("recorded body", [(clear, everything)], translation=_above((0.0, 0.0, 0.0), drive.body))]
    return node


def _above(point_m: tuple[float, float, float], body: Body) -> list[float]:
    """Convert a point given above the road to one relative to the body's middle."""
    return [round(float(value), 4) for value in (*point_m[:2], point_m[2] - body.height_m / 2)]


def _moving(name: str, vehicle: VehicleLog, extras: dict[str, Any]) -> Node:
    places, turns = body_places(vehicle), body_turns(vehicle)
    node = Node(name, extras=extras, translation=places[0].tolist(), rotation=turns[0].as_quat().tolist())
    node.moves = {"translation": place_keys(vehicle.time_s, places), "rotation": turn_keys(vehicle.time_s, turns)}
    return node


def _person(vehicle: VehicleLog, body: Body, colour: str) -> Node:
    """Return a person or an animal: a node with the pose, and one for each segment, in the local frame."""
    name = party_label(vehicle.number)
    where = _moving(f"{name} middle", vehicle, {})
    animal = body.kind is BodyKind.ANIMAL
    eyes = animal_places(vehicle)["poll"] if animal else landmarks(vehicle, body)["head"]
    head = Node(f"{name} eyes", translation=eyes[0].tolist())
    head.moves["translation"] = place_keys(vehicle.time_s, eyes)
    segments = (animal_nodes if animal else person_nodes)(vehicle, body, name, colour)
    return Node(name, children=[where, head, *segments], extras=_extras("person", number=vehicle.number, label=name))


def _object(item: FixedObject) -> Node:
    turn = Rotation.from_rotvec((0.0, 0.0, item.pose.heading_rad)).as_quat().tolist()
    said = _extras("object", number=item.number, name=describe_object(item), placed_by_the_program=is_ours(item))
    where = (item.pose.x_m, item.pose.y_m, item.pose.z_m)
    return Node(f"object {item.number}: {item.name}", object_parts(item), translation=where, rotation=turn, extras=said)


def _contact(contact: Contact, k: int) -> Node:
    """Return a flash at the first touch of two bodies."""
    times: FloatArray = contact.time_s + np.array([-contact.time_s, 0.0, _FLASH_S])
    node = Node(
        f"contact {k + 1}",
        [(_CONTACT, ball(_STAR_M, 1.0, 2, 6))],
        translation=(contact.x_m, contact.y_m, contact.z_m),
        scale=(0.0, 0.0, 0.0),
        extras=_extras("contact", numbers=[contact.number_1, contact.number_2], time_s=round(contact.time_s, 4)),
    )
    node.moves["scale"] = size_keys(times, np.array([0.0, 1.0, 0.0]))
    return node


# --- dents -----------------------------------------------------------------------------------------------------------
def crush_of(contact: Contact, number: int) -> float:
    """Return the crush depth of a participant in a contact (m); 0 if it has no part in it.

    >>> crush_of(log.first_contact, 1) == log.first_contact.crush_1_m, crush_of(log.first_contact, 7)
    (True, 0.0)
    """
    one, two = contact.touched
    return {one: contact.crush_1_m, two: contact.crush_2_m}.get(number, 0.0)


def dent(contact: Contact, number: int, parts: Parts) -> list[FloatArray]:
    """Return offsets of the points of each part, shape (n, 3), in the vehicle's axes.

    >>> from trace_dag.pages.solid.shapes import Mesh
    >>> contact, no_triangles = log.first_contact, np.zeros((0, 3), int)
    >>> dent(contact, 1, [(None, Mesh(np.zeros((1, 3)), no_triangles))])[0].shape  # an offset for its only point
    (1, 3)
    """
    first = contact.touched[0] == number
    pose = contact.poses[number]
    depth = contact.crush_1_m if first else contact.crush_2_m
    out = _in_body(pose, contact.normal_x, contact.normal_y) * (1.0 if first else -1.0)
    x, y = pose.to_body(np.array([contact.x_m, contact.y_m])).tolist()
    place = np.array([x, y])
    along = np.array([-out[1], out[0]])
    everything = np.concatenate([mesh.points_m for _, mesh in parts])[:, :2]
    near = np.abs((everything - place) @ along) < _NOTHING_M
    # The face that was struck: as far out as the vehicle reaches there.
    face = float((everything[near] @ out).max()) if near.any() else float(place @ out)
    offsets = []
    for _, mesh in parts:
        points = mesh.points_m[:, :2]
        beside = np.abs((points - place) @ along)
        share = np.clip((_NOTHING_M - beside) / (_NOTHING_M - _WHOLE_M), 0.0, 1.0)
        share = share * share * (3 - 2 * share)
        pressed = np.maximum(points @ out - (face - depth), 0.0) * share
        moved = np.zeros_like(mesh.points_m)
        moved[:, :2] = -pressed[:, None] * out
        offsets.append(moved)
    return offsets


def dent_keys(contacts: list[Contact]) -> Keys:
    """Return the share of each dent over time: none before its contact, all at the end of it.

    >>> dent_keys([log.first_contact]).values[[0, -1]].tolist()  # none at first, all at last
    [[0.0], [1.0]]
    """
    ends = [(each.time_s, each.time_s + max(each.duration_s, _LEAST_S)) for each in contacts]
    times = np.unique(np.array([0.0, *(time for pair in ends for time in pair)]).round(4))
    values = [np.interp(times, np.round(pair, 4), [0.0, 1.0]) for pair in ends]
    return Keys(times, np.stack(values, axis=1))


def _in_body(pose: Pose, x: float, y: float) -> FloatArray:
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return np.array([c * x + s * y, -s * x + c * y])
