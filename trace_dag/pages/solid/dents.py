"""Dents of contacts: the movement of a vehicle's points, from the depth in the log.

The depth and the direction are the log's; the shape is for the eye: a flat face across the push, fading out beside it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.pages.solid.gltf import Keys
from trace_dag.pages.solid.vehicle_shapes import Parts
from trace_dag.simulation.types import Contact

LEAST_M: Final = 0.03
"""Less is not seen."""
_WHOLE_M, _NOTHING_M = 0.55, 1.25  # beside the contact: pressed in wholly up to here, and not at all from there on
_LEAST_S: Final = 0.05


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
