"""People, their mounts, and animals, moved by the landmarks in the log: standing, walking, riding, thrown, lying.

A log without landmarks (CARLA's walkers) has one place and heading: such people walk, ride or stand upright there, with
the gait of :func:`trace_dag.simulation.figures.walking`.

Only the embedded back-end simulates animals, and its logs have their landmarks.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.gltf import Material, Node, body_turns, place_keys, rolling_keys, turn_keys
from trace_dag.pages.solid.shapes import ball, box, join_shapes, revolve
from trace_dag.pages.solid.vehicle_shapes import Parts, bicycle_parts, bicycle_wheel_parts, conveyance_parts
from trace_dag.simulation.figures import PLACE_OF_LANDMARK, RIDDEN_LANDMARKS, RIDING, Posture, root_height, walking
from trace_dag.simulation.quadrupeds import LANDMARKS, build
from trace_dag.simulation.types import Body, BodyKind, VehicleLog

_SKIN: Final = Material("#B98A6A")
_HAIR: Final = Material("#3B2A20")
_TROUSERS: Final = Material("#2F3642")
_SHOES: Final = Material("#1B1C1E")
_HIP_ASIDE, _SHOULDER_ASIDE, _SHOULDER_BELOW = 0.050, 0.120, 0.025  # of the stature, as the simulation's figures
_HIP, _KNEE, _NECK, _SHOULDER, _ARM, _SOLE = 0.530, 0.285, 0.825, 0.800, 0.36, 0.03
_LEGS: Final = Material("#4A3A2C")
_MUZZLE: Final = Material("#2A211A")
_EAR: Final = 0.9  # of the head's radius


def person_nodes(log: VehicleLog, body: Body, name: str, colour: str) -> list[Node]:
    """Return the segments of a person in clothes of one colour, and of the mount, each a node that moves by itself.

    >>> from trace_dag.simulation.body_sizes import person_body
    >>> nodes = person_nodes(log.vehicles[0], person_body(BodyKind.PEDESTRIAN, 40), "P1", "#009E73")
    >>> len(nodes)  # torso, head, and on each side an arm, a thigh and a shank
    8
    """
    places = landmarks(log, body)
    left = body_turns(log).apply([0.0, 1.0, 0.0])
    h = body.height_m
    pelvis, neck = places["pelvis"], places["neck"]
    spine = frames(neck - pelvis, left)
    aside = spine.apply([0.0, 1.0, 0.0])
    clothes = Material(colour)

    def limb(part: str, start: FloatArray, end: FloatArray, parts: Parts) -> Node:
        return move_node(f"{name} {part}", parts, log.time_s, (start + end) / 2, frames(end - start, aside))

    nodes = [move_node(f"{name} torso", _torso(h, clothes), log.time_s, pelvis, spine)]
    head = frames(places["head"] - neck, left)
    nodes.append(move_node(f"{name} head", _head(h), log.time_s, places["head"], head))
    for side, sign in (("l", 1.0), ("r", -1.0)):
        shoulder = neck + sign * _SHOULDER_ASIDE * h * aside - _SHOULDER_BELOW * h * spine.apply([0.0, 0.0, 1.0])
        hip = pelvis + sign * _HIP_ASIDE * h * left
        hand, knee, foot = (places[f"{each}_{side}"] for each in ("hand", "knee", "foot"))
        nodes.append(limb(f"arm {side}", shoulder, hand, _arm(length(shoulder, hand), h, clothes)))
        nodes.append(limb(f"thigh {side}", hip, knee, _thigh(length(hip, knee), h)))
        nodes.append(limb(f"shank {side}", knee, foot, _shank(length(knee, foot), h)))
    if "front" in places:
        nodes.append(_ridden(log, body, name, places, left))
    return nodes


def landmarks(log: VehicleLog, body: Body) -> dict[str, FloatArray]:
    """Return the points of a person in the local frame by name, each of shape (n, 3)."""
    place = np.column_stack([log.x_m, log.y_m, log.z_m])
    if log.landmarks_m.shape[1]:
        points = log.landmarks_m.reshape(len(log.time_s), -1, 3)
        names = [name for name, k in PLACE_OF_LANDMARK.items() if k < points.shape[1]]
        return {name: place + points[:, PLACE_OF_LANDMARK[name]] for name in names}
    speed = np.hypot(log.velocity_x_mps, log.velocity_y_mps)
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(log.x_m), np.diff(log.y_m)))])
    rides = body.kind is BodyKind.CYCLIST
    figures = []
    for v, s in zip(speed.tolist(), gone.tolist(), strict=True):
        on_foot = body.kind is BodyKind.PEDESTRIAN
        posture = RIDING if rides else walking(body.height_m, v, s) if on_foot else Posture()
        figures.append(_upright(body, posture))
    c, s = np.cos(log.heading_rad), np.sin(log.heading_rad)
    points = np.array([list(figure.values()) for figure in figures])
    x, y, z = (points[..., k] for k in range(3))
    turned = np.stack([c[:, None] * x - s[:, None] * y, s[:, None] * x + c[:, None] * y, z], axis=-1)
    return {name: place + turned[:, k] for k, name in enumerate(figures[0])}


def _upright(body: Body, posture: Posture) -> dict[str, tuple[float, float, float]]:
    """Return points of a figure in a posture, relative to the place on the road below it: ahead, left, up."""
    h = body.height_m
    root = root_height(body, posture)

    def along(length: float, angle: float) -> tuple[float, float]:
        """Return a point at some height above a joint, leaning forward by an angle."""
        return length * h * math.sin(angle), length * h * math.cos(angle)

    back = posture.pelvis + posture.lumbar / 2
    neck_x, neck_z = along(_NECK - _HIP, back)
    head_x, head_z = along(1 - _NECK - 0.07, posture.pelvis + posture.lumbar + posture.neck)
    points = {
        "pelvis": (0.0, 0.0, root),
        "neck": (neck_x, 0.0, root + neck_z),
        "head": (neck_x + head_x, 0.0, root + neck_z + head_z),
    }
    for k, (side, sign) in enumerate((("l", 1.0), ("r", -1.0))):
        shoulder_x, shoulder_z = along(_SHOULDER - _HIP, back)
        arm_x, arm_z = along(_ARM, posture.pelvis + posture.lumbar + posture.shoulders[k])
        points[f"hand_{side}"] = (shoulder_x - arm_x, sign * _SHOULDER_ASIDE * h, root + shoulder_z - arm_z)
        thigh = posture.pelvis + posture.hips[k]
        thigh_x, thigh_z = along(_HIP - _KNEE, thigh)
        shank_x, shank_z = along(_KNEE - _SOLE, thigh + posture.knees[k])
        aside = sign * _HIP_ASIDE * h
        points[f"knee_{side}"] = (-thigh_x, aside, root - thigh_z)
        points[f"foot_{side}"] = (-thigh_x - shank_x, aside, root - thigh_z - shank_z)
    if body.kind is BodyKind.CYCLIST:
        size = body.length_m / 1.72
        points |= {"front": (0.52 * size, 0.0, 0.34 * size), "rear": (-0.52 * size, 0.0, 0.34 * size)}
        points["top"] = (0.38 * size, 0.0, 1.0 * size)
    elif body.kind is BodyKind.CONVEYANCE:
        half = body.length_m / 2
        points |= {"front": (half, 0.0, 0.05), "rear": (-half, 0.0, 0.05), "top": (0.0, 0.0, 0.1)}
    return points


def _ridden(log: VehicleLog, body: Body, name: str, places: dict[str, FloatArray], left: FloatArray) -> Node:
    front, rear, top = (places[each] for each in RIDDEN_LANDMARKS)
    middle = (front + rear) / 2
    ahead = front - rear
    hubs = length(rear, front)
    if body.kind is not BodyKind.CYCLIST:
        parts = conveyance_parts(max(hubs, 0.2))
        up = np.cross(ahead, left)
        return move_node(f"{name} conveyance", parts, log.time_s, middle, frames(up, np.cross(up, ahead)))
    up = top - middle
    turns = frames_ahead(ahead, up)
    reach = turns.inv().apply(top - middle).mean(axis=0)
    parts, radius = bicycle_parts(hubs, (float(reach[0]), float(reach[2])))
    bicycle = move_node(f"{name} bicycle", parts, log.time_s, middle, turns)
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(middle[:, 0]), np.diff(middle[:, 1])))])
    for end, x in (("front", hubs / 2), ("rear", -hubs / 2)):
        wheel = Node(f"{name} {end} wheel", bicycle_wheel_parts(radius), translation=(x, 0.0, 0.0))
        wheel.moves["rotation"] = rolling_keys(log.time_s, gone / radius)
        bicycle.children.append(wheel)
    return bicycle


def _torso(h: float, clothes: Material) -> Parts:
    """Build the torso from the hips up, with the origin at the hips; broader than deep."""
    heights = np.array([-0.05, 0.0, 0.06, 0.16, 0.235, 0.275, 0.30]) * h
    trunk = revolve(heights, np.array([0.055, 0.085, 0.078, 0.095, 0.105, 0.075, 0.03]) * h, 10)
    flattened = trunk.turned(np.diag([0.72, 1.0, 1.0]))
    return [(clothes, flattened)]


def _head(h: float) -> Parts:
    radius = 0.040 * h + 0.042
    face = ball(radius, 1.15, 6, 10)
    hair = ball(radius * 1.06, 1.0, 6, 10).moved((-0.25 * radius, 0.0, 0.28 * radius))
    return [(_SKIN, face), (_HAIR, hair)]


def _arm(length: float, h: float, clothes: Material) -> Parts:
    sleeve = revolve(np.array([-0.5, 0.0, 0.38]) * length, np.array([0.034, 0.030, 0.024]) * h)
    hand = revolve(np.array([0.36, 0.42, 0.5, 0.55]) * length, np.array([0.018, 0.024, 0.024, 0.012]) * h)
    return [(clothes, sleeve), (_SKIN, hand)]


def _thigh(length: float, h: float) -> Parts:
    return [(_TROUSERS, revolve(np.array([-0.55, -0.3, 0.52]) * length, np.array([0.050, 0.050, 0.036]) * h))]


def _shank(length: float, h: float) -> Parts:
    """Build the shank along z from the knee to the sole; toes point to -x, which is ahead for a leg that hangs down."""
    leg = revolve(np.array([-0.54, -0.2, 0.45]) * length, np.array([0.036, 0.036, 0.024]) * h)
    low = 0.5 * length
    shoe = box((-0.11 * h, -0.026 * h, low - 0.03 * h), (0.04 * h, 0.026 * h, low + 0.03 * h))
    return [(_TROUSERS, leg), (_SHOES, join_shapes([shoe]))]


# --- limbs -----------------------------------------------------------------------------------------------------------
def move_node(name: str, parts: Parts, time_s: FloatArray, places: FloatArray, turns: Rotation) -> Node:
    """Return a node with places and rotations at each time; shapes (n,), (n, 3) and n turns.

    >>> turns = Rotation.identity(2)
    >>> move_node("arm", [], np.array([0.0, 1.0]), np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]]), turns).translation
    [0.0, 0.0, 1.0]
    """
    node = Node(name, parts, translation=places[0].tolist(), rotation=turns[0].as_quat().tolist())
    node.moves = {"translation": place_keys(time_s, places), "rotation": turn_keys(time_s, turns)}
    return node


def frames(up: FloatArray, left: FloatArray) -> Rotation:
    """Return rotations with the z axis along ``up`` and the y axis as near to ``left`` as possible.

    Both have shape (n, 3).

    >>> up, left = np.array([[0.0, 0.0, 2.0]]), np.array([[0.0, 1.0, 0.0]])
    >>> frames(up, left).magnitude().tolist()  # as it stands: not turned at all
    [0.0]
    """
    z = _unit(up, np.array([0.0, 0.0, 1.0]))
    y = _unit(left - (left * z).sum(axis=1)[:, None] * z, np.array([0.0, 1.0, 0.0]))
    x = _unit(np.cross(y, z), np.array([1.0, 0.0, 0.0]))
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


def frames_ahead(ahead: FloatArray, up: FloatArray) -> Rotation:
    """Return rotations with the x axis along ``ahead`` and the z axis as near to ``up`` as possible.

    >>> ahead, up = np.array([[0.0, 3.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    >>> frames_ahead(ahead, up).magnitude().round(4).tolist()  # a quarter turn to the left, rad
    [1.5708]
    """
    x = _unit(ahead, np.array([1.0, 0.0, 0.0]))
    z = _unit(up - (up * x).sum(axis=1)[:, None] * x, np.array([0.0, 0.0, 1.0]))
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


def _unit(vectors: FloatArray, otherwise: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=1)[:, None]
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), otherwise)


def length(one: FloatArray, two: FloatArray) -> float:
    """Return the mean distance of two points over time (m).

    >>> length(np.zeros((2, 3)), np.array([[3.0, 4.0, 0.0], [0.0, 3.0, 4.0]]))
    5.0
    """
    return float(np.linalg.norm(two - one, axis=1).mean())


# --- animals ---------------------------------------------------------------------------------------------------------
def animal_places(log: VehicleLog) -> dict[str, FloatArray]:
    """Return the points of an animal in the local frame by name, each of shape (n, 3)."""
    place = np.column_stack([log.x_m, log.y_m, log.z_m])
    points = log.landmarks_m.reshape(len(log.time_s), -1, 3)
    return {name: place + points[:, k] for k, name in enumerate(LANDMARKS)}


def animal_nodes(log: VehicleLog, body: Body, name: str, colour: str) -> list[Node]:
    """Return the segments of an animal in a coat of one colour, each a node that moves by itself.

    >>> from dataclasses import replace
    >>> from trace_dag.crash.record import VehicleClass
    >>> from trace_dag.simulation.types import BodyKind
    >>> deer = Body(BodyKind.ANIMAL, VehicleClass.OTHER, 1.6, 0.4, 1.4, 80.0)
    >>> points = np.random.default_rng(0).normal(size=(len(log.vehicles[0].time_s), 3 * len(LANDMARKS)))
    >>> len(animal_nodes(replace(log.vehicles[0], landmarks_m=points), deer, "deer", "#8A6A44"))  # 8 are of its legs
    11
    """
    places, b = animal_places(log), build(body)
    left = body_turns(log).apply([0.0, 1.0, 0.0])
    coat = Material(colour)

    def segment(part: str, start: FloatArray, end: FloatArray, parts: Parts) -> Node:
        return move_node(f"{name} {part}", parts, log.time_s, (start + end) / 2, frames(end - start, left))

    rump, withers, poll, nose = (places[each] for each in ("rump", "withers", "poll", "nose"))
    spine = frames(withers - rump, left)
    ahead, below = spine.apply([0.0, 0.0, 1.0]), spine.apply([1.0, 0.0, 0.0])
    chest = withers + 0.4 * b.trunk_m * ahead - 0.5 * b.trunk_m * below
    nodes = [
        segment("trunk", rump, withers, _trunk(length(rump, withers), b.trunk_m, coat)),
        segment("neck", chest, poll, _tapered(length(chest, poll), 0.55 * b.trunk_m, 0.32 * b.trunk_m, coat)),
        segment("head", poll, nose, _animal_head(length(poll, nose), 0.34 * b.trunk_m, coat)),
    ]
    for leg in ("fl", "fr", "hl", "hr"):
        aside = (1.0 if leg.endswith("l") else -1.0) * b.aside_m
        end = withers if leg.startswith("f") else rump
        joint = end + aside * left + (0.4 * b.trunk_m) * below
        knee, foot = places[f"knee_{leg}"], places[f"foot_{leg}"]
        upper = _tapered(length(joint, knee), 0.085 * body.height_m, 0.035 * body.height_m, coat)
        lower = _tapered(length(knee, foot), 0.032 * body.height_m, 0.022 * body.height_m, _LEGS)
        nodes += [segment(f"upper {leg}", joint, knee, upper), segment(f"lower {leg}", knee, foot, lower)]
    return nodes


def _trunk(spine_m: float, radius_m: float, coat: Material) -> Parts:
    """Build the trunk along z from the rump to the withers, about its middle; rounded at both ends."""
    half = spine_m / 2
    heights = np.array([-half - radius_m, -half - 0.6 * radius_m, -half, 0.0, half, half + 0.6 * radius_m])
    radii = np.array([0.25, 0.80, 0.98, 0.94, 1.0, 0.72]) * radius_m
    return [(coat, revolve(heights, radii, 12))]


def _tapered(length_m: float, thick_m: float, thin_m: float, coat: Material) -> Parts:
    """Build a part along z about its middle, thick at its beginning and thin at its end."""
    half = length_m / 2
    middle_m = (thick_m + thin_m) / 2
    return [(coat, revolve(np.array([-half, 0.0, half]), np.array([thick_m, middle_m, thin_m]), 8))]


def _animal_head(length_m: float, radius_m: float, coat: Material) -> Parts:
    """Build the head along z from the poll to the nose, with ears and a dark muzzle."""
    half = length_m / 2
    skull = revolve(np.array([-half - 0.5 * radius_m, -half, 0.0, half]), np.array([0.5, 1.0, 0.8, 0.5]) * radius_m, 8)
    muzzle = revolve(np.array([half, half + 0.4 * radius_m]), np.array([0.5, 0.3]) * radius_m, 8)
    ear = revolve(np.array([-0.6, 0.0, 0.6]) * radius_m, np.array([0.1, 0.28, 0.05]) * radius_m, 6)
    ears = [
        (coat, ear.moved((-_EAR * radius_m, sign * 0.8 * radius_m, -half - 0.4 * radius_m))) for sign in (1.0, -1.0)
    ]
    return [(coat, skull), (_MUZZLE, muzzle), *ears]
