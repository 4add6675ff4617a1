"""Writes glTF 2.0 as one binary file (GLB): triangles, materials, nodes, and key frames.

Only what a crash needs of the standard (Khronos, glTF 2.0 Specification, 2021; ISO/IEC 12113). Frame: the project's, x
east, y north, z up, under one root node that turns it to glTF's y up; readers that turn it back, as Blender does, have
the local frame again.

All numbers lie on a grid, vertices on one of 1/1024 m, key frames on one of 1/4096 (s, m, parts of a quaternion): finer
than the precision of a reconstruction, and better compressed by gzip.

Motion is places and rotations of a body, with no more keys than needed to follow the log. Quaternions are x, y, z, w,
as in glTF.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.shapes import Mesh
from trace_dag.scenario.polylines import simplify_in_time
from trace_dag.simulation.types import VehicleLog
from trace_dag.version import __version__

Channel = Literal["translation", "rotation", "scale", "weights"]

FLOAT, USHORT, UINT = 5126, 5123, 5125
"""Component types."""
WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
"""Numbers to an item of each type."""
_TYPES: Final = {width: name for name, width in WIDTHS.items()}
_VERTICES, _TRIANGLES = 34962, 34963  # targets of buffer views
_VERTEX_GRID, _KEY_GRID = 1024, 4096  # parts of a unit
_Z_UP: Final = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # a quarter turn about x: z up becomes y up
_JSON, _BINARY = 0x4E4F534A, 0x004E4942  # chunk types
PLACE_M: Final = 0.003
"""Between key frames a body is off its logged place by so much at most."""
TURN: Final = 0.001
"""And the parts of its quaternion by so much: a turn of 0.1 degrees."""
_LARGEST_TURN_RAD: Final = 1.5  # from key to key: a quaternion knows no more than half a turn


@dataclass(frozen=True)
class Material:
    """The look of a surface: ``colour`` as ``#RRGGBB``, opacity from 0 to 1; a glowing one is bright in the dark, too.

    ``layer`` orders coplanar surfaces, from 0 up, for the viewer.
    """

    colour: str
    opacity: float = 1.0
    roughness: float = 0.9
    glows: bool = False
    both_sides: bool = False
    layer: int = 0


@dataclass(eq=False)
class Node:
    """A node of the scene: its parts by material, its children, and its motion.

    ``rotation`` is a unit quaternion x, y, z, w; ``extras`` is for readers of the file. ``dents`` are offsets of the
    vertices of each part.
    """

    name: str
    parts: Sequence[tuple[Material, Mesh]] = ()
    children: list[Node] = field(default_factory=list)
    translation: Sequence[float] | None = None
    rotation: Sequence[float] | None = None
    scale: Sequence[float] | None = None
    extras: Mapping[str, Any] | None = None
    dents: Sequence[Sequence[FloatArray]] = ()
    moves: dict[Channel, Keys] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Keys:
    """Key frames: times (s), shape (n,), and values, shape (n, k).

    Between two of them the values change evenly, or stay as they are with ``step``.
    """

    time_s: FloatArray
    values: FloatArray
    step: bool = False


def write_glb(nodes: Sequence[Node], *, title: str, copyright_notice: str) -> bytes:
    """Return the nodes as a file, in a scene of that title.

    Equal input gives equal bytes.

    >>> write_glb([], title="a crash", copyright_notice="CC0")[:4]
    b'glTF'
    """
    return _Writer(title, copyright_notice).written(nodes)


class _Writer:
    def __init__(self, title: str, copyright_notice: str) -> None:
        self._title, self._copyright = title, copyright_notice
        self._binary = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._known: dict[tuple[bytes, int | None], int] = {}
        self._materials: dict[Material, int] = {}
        self._meshes: list[dict[str, Any]] = []
        self._nodes: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._sampler_of: dict[tuple[int, int, bool], int] = {}
        self._channels: list[dict[str, Any]] = []

    def written(self, nodes: Sequence[Node]) -> bytes:
        children = [self._add(node) for node in nodes]
        self._nodes.append({"name": self._title, "rotation": _Z_UP, "children": children})
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"trace-dag {__version__}", "copyright": self._copyright},
            "scene": 0,
            "scenes": [{"name": self._title, "nodes": [len(self._nodes) - 1]}],
            "nodes": self._nodes,
            "materials": [_material(each) for each in self._materials],
            "meshes": self._meshes,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._binary)}],
        }
        if self._channels:
            document["animations"] = [{"name": "crash", "channels": self._channels, "samplers": self._samplers}]
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        chunks = _chunk(_JSON, text, b" ") + _chunk(_BINARY, bytes(self._binary), b"\0")
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _add(self, node: Node) -> int:
        said: dict[str, Any] = {"name": node.name}
        for name in ("translation", "rotation", "scale"):
            if (value := getattr(node, name)) is not None:
                said[name] = [float(each) for each in value]
        if node.extras:
            said["extras"] = dict(node.extras)
        if node.parts:
            said["mesh"] = self._mesh(node)
        if node.children:
            said["children"] = [self._add(child) for child in node.children]
        self._nodes.append(said)
        number = len(self._nodes) - 1
        for channel, keys in node.moves.items():
            self._channels.append(
                {"sampler": self._sampler(keys, channel), "target": {"node": number, "path": channel}}
            )
        return number

    def _mesh(self, node: Node) -> int:
        primitives = []
        for k, (material, mesh) in enumerate(node.parts):
            small = len(mesh.points_m) < 65535
            indices = mesh.triangles.astype("<u2" if small else "<u4").reshape(-1)
            primitive: dict[str, Any] = {
                "attributes": {"POSITION": self._points(mesh.points_m)},
                "indices": self._accessor(indices, USHORT if small else UINT, 1, _TRIANGLES),
                "material": self._materials.setdefault(material, len(self._materials)),
            }
            if node.dents:
                primitive["targets"] = [{"POSITION": self._points(dents[k])} for dents in node.dents]
            primitives.append(primitive)
        said: dict[str, Any] = {"name": node.name, "primitives": primitives}
        if node.dents:
            said["weights"] = [0.0] * len(node.dents)
        self._meshes.append(said)
        return len(self._meshes) - 1

    def _points(self, points: FloatArray) -> int:
        return self._accessor(_on_grid(points, _VERTEX_GRID), FLOAT, 3, _VERTICES, bounded=True)

    def _sampler(self, keys: Keys, channel: Channel) -> int:
        time_s = _on_grid(keys.time_s, _KEY_GRID)
        later = np.diff(time_s, prepend=-np.inf) > 0.0
        times = self._accessor(time_s[later], FLOAT, 1, bounded=True)
        values = _on_grid(keys.values[later], _KEY_GRID)
        one = 1 if channel == "weights" else values.shape[1]
        made = (times, self._accessor(values.reshape(-1, one), FLOAT, one), keys.step)
        if made not in self._sampler_of:
            self._sampler_of[made] = len(self._samplers)
            way = "STEP" if keys.step else "LINEAR"
            self._samplers.append({"input": made[0], "output": made[1], "interpolation": way})
        return self._sampler_of[made]

    def _accessor(
        self, values: NDArray[Any], component: int, width: int, target: int | None = None, *, bounded: bool = False
    ) -> int:
        """Store an array once, and return its accessor."""
        data = values.tobytes()
        known = (data, target if target else width)
        if known in self._known:
            return self._known[known]
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target:
            view["target"] = target
        self._binary += data + b"\0" * (-len(data) % 4)
        self._views.append(view)
        said: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": component,
            "count": values.size // width,
            "type": _TYPES[width],
        }
        if bounded:
            rows = values.reshape(-1, width)
            said |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(said)
        self._known[known] = len(self._accessors) - 1
        return self._known[known]


def _on_grid(values: FloatArray, parts: int) -> NDArray[np.float32]:
    return (np.rint(values * parts) / parts + 0.0).astype("<f4")  # no -0.0, which is the same place in other bytes


def _material(material: Material) -> dict[str, Any]:
    colour = [_linear(int(material.colour[k : k + 2], 16) / 255) for k in (1, 3, 5)]
    surface = {"baseColorFactor": [*colour, material.opacity], "metallicFactor": 0.0}
    said: dict[str, Any] = {"pbrMetallicRoughness": surface | {"roughnessFactor": material.roughness}}
    if material.opacity < 1.0:
        said["alphaMode"] = "BLEND"
    if material.glows:
        said["emissiveFactor"] = colour
    if material.both_sides:
        said["doubleSided"] = True
    if material.layer:
        said["extras"] = {"layer": material.layer}
    return said


def _linear(value: float) -> float:
    """Return a colour component, 0 to 1, converted from sRGB (IEC 61966-2-1) to linear, as glTF requires."""
    return round(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4, 5)


def _chunk(kind: int, data: bytes, filler: bytes) -> bytes:
    padded = data + filler * (-len(data) % 4)
    return struct.pack("<II", len(padded), kind) + padded


# --- key frames ------------------------------------------------------------------------------------------------------
def place_keys(time_s: FloatArray, places_m: FloatArray) -> Keys:
    """Return the key frames of a way, shape (n, 3).

    >>> time_s = np.array([0.0, 1.0, 2.0])
    >>> place_keys(time_s, np.column_stack([time_s, 0 * time_s, 0 * time_s])).time_s.tolist()  # straight at one speed
    [0.0, 2.0]
    """
    kept = simplify_in_time(time_s, places_m, PLACE_M)
    return Keys(time_s[kept], places_m[kept])


def turn_keys(time_s: FloatArray, turns: Rotation) -> Keys:
    """Return the key frames of a rotation over time.

    Two successive rotations must differ by less than half a turn.

    >>> turn_keys(np.array([0.0, 1.0, 2.0]), Rotation.identity(3)).time_s.tolist()  # it does not turn
    [0.0, 2.0]
    """
    values = turns.as_quat()
    flipped = np.cumprod(np.where((values[1:] * values[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    values[1:] *= flipped[:, None]  # the same turn has two quaternions: the one nearer to the last
    kept = simplify_in_time(time_s, values, TURN)
    return Keys(time_s[kept], values[kept])


def size_keys(time_s: FloatArray, sizes: FloatArray) -> Keys:
    """Return the key frames of an object that is visible (1) or not (0), shape (n,).

    >>> size_keys(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0])).time_s.tolist()  # shows from 1 s on
    [0.0, 1.0]
    """
    changes = np.flatnonzero(np.diff(sizes, prepend=np.nan))
    return Keys(time_s[changes], np.repeat(sizes[changes, None], 3, axis=1), step=True)


def rolling_keys(time_s: FloatArray, angles_rad: FloatArray) -> Keys:
    """Return the key frames of a wheel that has rotated by some angles about the axis to its left.

    >>> rolling_keys(np.array([0.0, 1.0]), np.zeros(2)).time_s.tolist()  # it stands
    [0.0]
    """
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angles_rad)))])
    steps = math.ceil(turned[-1] / _LARGEST_TURN_RAD)
    if not steps:
        return Keys(time_s[:1], Rotation.identity(1).as_quat())
    times = np.unique(np.interp(np.linspace(0.0, turned[-1], steps + 1), turned, time_s))
    at = np.interp(times, time_s, angles_rad)
    return Keys(times, np.column_stack([0 * at, np.sin(at / 2), 0 * at, np.cos(at / 2)]))


def body_places(log: VehicleLog) -> FloatArray:
    """Return the positions of a body's middle, shape (n, 3)."""
    return np.column_stack([log.x_m, log.y_m, log.z_m + log.above_road_m])


def body_turns(log: VehicleLog) -> Rotation:
    """Return the rotation of a body: heading, pitch and roll in this order about its own axes up, left and ahead."""
    angles = np.column_stack([log.heading_rad, log.pitch_rad, log.roll_rad])
    return Rotation.from_euler("ZYX", angles)
