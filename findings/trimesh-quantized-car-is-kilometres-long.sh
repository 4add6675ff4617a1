#!/usr/bin/env bash
# Expected: glTF 2.0, "Accessor Data Types": where an accessor is "normalized", a 16-bit integer c stands for c / 32767.
#   KHR_mesh_quantization allows such positions, and a reader without an extension that is listed in
#   extensionsRequired has to refuse the file.
# Happens: trimesh loads the file without an error and takes the integers for metres: a car of 4.5 m is 147 km long.
#   The same car with float positions is right; pygltflib shows that the file says "normalized".
# Version: trimesh 5.2.0 with pygltflib 1.16.5 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q trimesh==5.2.0 pygltflib==1.16.5 numpy
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import numpy as np
import pygltflib
import trimesh

# A wedge inside the unit cube, which its node scales to a car of 4.5 by 1.5 by 1.8 m.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0]])
FACES = np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3], dtype=np.uint16)


def write(path, quantized):
    if quantized:
        positions = np.zeros((4, 4), dtype=np.int16)  # Vertices begin at multiples of four bytes.
        positions[:, :3] = CORNERS * 32767
    else:
        positions = CORNERS.astype(np.float32)
    data = positions.tobytes() + FACES.tobytes()
    extensions = ["KHR_mesh_quantization"] if quantized else []
    gltf = pygltflib.GLTF2(
        scene=0,
        scenes=[pygltflib.Scene(nodes=[0])],
        nodes=[pygltflib.Node(mesh=0, name="car", scale=[4.5, 1.5, 1.8])],
        meshes=[pygltflib.Mesh(primitives=[pygltflib.Primitive(attributes=pygltflib.Attributes(POSITION=0), indices=1)])],
        accessors=[
            pygltflib.Accessor(
                bufferView=0,
                componentType=pygltflib.SHORT if quantized else pygltflib.FLOAT,
                normalized=quantized,
                count=4,
                type="VEC3",
                min=[0, 0, 0],
                max=[32767] * 3 if quantized else [1, 1, 1],
            ),
            pygltflib.Accessor(bufferView=1, componentType=pygltflib.UNSIGNED_SHORT, count=12, type="SCALAR"),
        ],
        bufferViews=[
            pygltflib.BufferView(
                buffer=0, byteLength=positions.nbytes, byteStride=positions.strides[0], target=pygltflib.ARRAY_BUFFER
            ),
            pygltflib.BufferView(
                buffer=0, byteOffset=positions.nbytes, byteLength=FACES.nbytes, target=pygltflib.ELEMENT_ARRAY_BUFFER
            ),
        ],
        buffers=[pygltflib.Buffer(byteLength=len(data))],
        extensionsUsed=extensions,
        extensionsRequired=extensions,
    )
    gltf.set_binary_blob(data)
    gltf.save_binary(path)
    return trimesh.load_scene(path).extents.round(1).tolist()


print(f"trimesh {version('trimesh')}, pygltflib {version('pygltflib')}")
as_float, as_integer = write("float.glb", False), write("quantized.glb", True)
read_back = pygltflib.GLTF2().load("quantized.glb")
print("extents of the car with float positions:", as_float)
print("extents of the car with normalized 16-bit positions:", as_integer)
print("the file: normalized", read_back.accessors[0].normalized, "required", read_back.extensionsRequired)
assert as_float == [4.5, 1.5, 1.8]
assert as_integer == [147451.5, 49150.5, 58980.6]
assert read_back.accessors[0].normalized and read_back.extensionsRequired == ["KHR_mesh_quantization"]
print(f"trimesh makes the car {as_integer[0] / as_float[0]:.0f} times too long")
PY
venv/bin/python find.py
