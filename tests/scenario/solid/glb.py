"""A reader of GLB files that shares no code with the writer: the standard's chunks, accessors and samplers.

glTF 2.0 Specification, sections 4.4 (binary layout), 3.6 (accessors) and 3.11 with appendix C (interpolation).
"""

from __future__ import annotations

import json
import struct

import numpy as np
from scipy.spatial.transform import Rotation

_COMPONENTS = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """``json`` is the document; times in seconds, frame of the file's children of its root: x east, y north, z up."""

    def __init__(self, data: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json = json.loads(data[20 : 20 + size])
        binary, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0"
        self._binary = data[28 + size : 28 + size + binary]
        self.nodes = {node["name"]: (number, node) for number, node in enumerate(self.json["nodes"])}

    def values(self, accessor: int) -> np.ndarray:
        said = self.json["accessors"][accessor]
        view = self.json["bufferViews"][said["bufferView"]]
        width = _WIDTHS[said["type"]]
        found = np.frombuffer(
            self._binary, _COMPONENTS[said["componentType"]], said["count"] * width, view["byteOffset"]
        )
        return found.reshape(-1, width).astype(float)

    def at(self, name: str, path: str, times_s: np.ndarray) -> np.ndarray:
        """What a node's property is at some times, shape (n, k): as animated, or as it always is."""
        number, node = self.nodes[name]
        (animation,) = self.json["animations"]
        for channel in animation["channels"]:
            if channel["target"] == {"node": number, "path": path}:
                sampler = animation["samplers"][channel["sampler"]]
                keys, values = self.values(sampler["input"])[:, 0], self.values(sampler["output"])
                values = values.reshape(len(keys), -1)
                return _sampled(times_s, keys, values, sampler["interpolation"], turns=path == "rotation")
        return np.repeat([node[path]], len(times_s), axis=0)

    def of_kind(self, kind: str) -> list[dict]:
        return [n for n in self.json["nodes"] if n.get("extras", {}).get("trace_dag", {}).get("kind") == kind]


def _sampled(times: np.ndarray, keys: np.ndarray, values: np.ndarray, way: str, *, turns: bool) -> np.ndarray:
    times = np.clip(times, keys[0], keys[-1])
    if way == "STEP":
        return values[np.searchsorted(keys, times, side="right") - 1]
    if len(keys) == 1:
        return np.repeat(values, len(times), axis=0)
    if turns:
        before = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
        one, two = Rotation.from_quat(values[before]), Rotation.from_quat(values[before + 1])
        share = (times - keys[before]) / (keys[before + 1] - keys[before])
        return (one * Rotation.from_rotvec(share[:, None] * (one.inv() * two).as_rotvec())).as_quat()
    return np.stack([np.interp(times, keys, column) for column in values.T], axis=-1)
