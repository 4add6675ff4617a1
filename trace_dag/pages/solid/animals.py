"""An animal, moved as the log has its landmarks: standing, trotting, thrown, lying.

Only the embedded back-end simulates animals, and its logs have their landmarks.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.gltf import Material, Node
from trace_dag.pages.solid.limbs import frames, length, move_node
from trace_dag.pages.solid.shapes import revolve
from trace_dag.pages.solid.tracks import body_turns
from trace_dag.pages.solid.vehicle_shapes import Parts
from trace_dag.simulation.quadrupeds import LANDMARKS, build
from trace_dag.simulation.types import Body, VehicleLog

_LEGS: Final = Material("#4A3A2C")
_MUZZLE: Final = Material("#2A211A")
_EAR: Final = 0.9  # of the head's radius


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
        segment("head", poll, nose, _head(length(poll, nose), 0.34 * b.trunk_m, coat)),
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


def _head(length_m: float, radius_m: float, coat: Material) -> Parts:
    """Build the head along z from the poll to the nose, with ears and a dark muzzle."""
    half = length_m / 2
    skull = revolve(np.array([-half - 0.5 * radius_m, -half, 0.0, half]), np.array([0.5, 1.0, 0.8, 0.5]) * radius_m, 8)
    muzzle = revolve(np.array([half, half + 0.4 * radius_m]), np.array([0.5, 0.3]) * radius_m, 8)
    ear = revolve(np.array([-0.6, 0.0, 0.6]) * radius_m, np.array([0.1, 0.28, 0.05]) * radius_m, 6)
    ears = [
        (coat, ear.moved((-_EAR * radius_m, sign * 0.8 * radius_m, -half - 0.4 * radius_m))) for sign in (1.0, -1.0)
    ]
    return [(coat, skull), (_MUZZLE, muzzle), *ears]
