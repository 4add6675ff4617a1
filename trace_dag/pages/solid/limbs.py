"""Segments of people and animals as nodes: each moves by itself, from joint to joint."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.gltf import Node
from trace_dag.pages.solid.tracks import place_keys, turn_keys
from trace_dag.pages.solid.vehicle_shapes import Parts


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
