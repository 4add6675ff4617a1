"""A GLB as pages hold it: the same numbers in fewer bytes, to be compressed.

Neighbouring vertices, triangles and key frames are near each other. So of each accessor, component by component, the
differences from one number to the next are kept, as whole numbers of the grid that :mod:`trace_dag.scenario.solid.gltf`
writes on. They become numbers from 0 up (0, -1, 1, -2, ... as 0, 1, 2, 3, ...), and of all of them the first byte is
kept, then the second, and so on. What gzip makes of it is 40 % of what it makes of the GLB. ``model()`` of the page
(``templates/replay_solid.js``) makes the GLB again, byte for byte.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trace_dag.scenario.solid.gltf import FLOAT, UINT, USHORT, WIDTHS, grid_of

_TYPES = {FLOAT: "<f4", USHORT: "<u2", UINT: "<u4"}


def packed_glb(glb: bytes) -> bytes:
    """A file of :func:`trace_dag.scenario.solid.gltf.write_glb`: all before its numbers as it is, then the numbers."""
    start = 28 + int.from_bytes(glb[12:16], "little")  # of the content of its second chunk
    document = json.loads(glb[20 : start - 8])
    differences = [_differences(document, accessor, glb[start:]) for accessor in document["accessors"]]
    numbers = np.concatenate(differences) if differences else np.empty(0, np.int32)
    from_0_up = (numbers << 1) ^ (numbers >> 31)
    return glb[:start] + from_0_up.astype("<i4").view(np.uint8).reshape(-1, 4).T.tobytes()


def _differences(document: Mapping[str, Any], accessor: Mapping[str, Any], content: bytes) -> NDArray[np.int32]:
    view, width = document["bufferViews"][accessor["bufferView"]], WIDTHS[accessor["type"]]
    kind = accessor["componentType"]
    values = np.frombuffer(content, _TYPES[kind], accessor["count"] * width, view["byteOffset"])
    whole = np.rint(values.astype(float) * (grid_of(view) if kind == FLOAT else 1)).astype(np.int32)
    differences: NDArray[np.int32] = np.diff(whole.reshape(-1, width), axis=0, prepend=np.int32(0))
    return differences.T.reshape(-1)
