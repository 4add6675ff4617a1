"""People and their mounts, moved by the landmarks in the log: standing, walking, riding, thrown, lying.

A log without landmarks (CARLA's walkers) has one place and heading: such people walk, ride or stand upright there, with
the gait of :func:`trace_dag.simulation.figures.walking`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.gltf import Material, Node
from trace_dag.pages.solid.limbs import frames, frames_ahead, length, move_node
from trace_dag.pages.solid.shapes import ball, box, join_shapes, revolve
from trace_dag.pages.solid.tracks import body_turns, rolling_keys
from trace_dag.pages.solid.two_wheelers import bicycle_parts, bicycle_wheel_parts, conveyance_parts
from trace_dag.pages.solid.vehicle_shapes import Parts
from trace_dag.simulation.figures import PLACE_OF_LANDMARK, RIDDEN_LANDMARKS, RIDING, Posture, root_height, walking
from trace_dag.simulation.types import Body, BodyKind, VehicleLog

_SKIN: Final = Material("#B98A6A")
_HAIR: Final = Material("#3B2A20")
_TROUSERS: Final = Material("#2F3642")
_SHOES: Final = Material("#1B1C1E")
_HIP_ASIDE, _SHOULDER_ASIDE, _SHOULDER_BELOW = 0.050, 0.120, 0.025  # of the stature, as the simulation's figures
_HIP, _KNEE, _NECK, _SHOULDER, _ARM, _SOLE = 0.530, 0.285, 0.825, 0.800, 0.36, 0.03


def person_nodes(log: VehicleLog, body: Body, name: str, colour: str) -> list[Node]:
    """Return the segments of a person in clothes of one colour, and of the mount, each a node that moves by itself.

    >>> from trace_dag.simulation.anthropometry import person_body
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
