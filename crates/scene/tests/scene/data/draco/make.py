"""Writes the models of this folder: a wavy grid, compressed by Google's Draco (pip install DracoPy==2.2.0 numpy)."""

import json
import pathlib

import DracoPy
import numpy as np

SIDE = 20
LEVELS = [0, 4, 7, 10]

i = np.arange(SIDE * SIDE)
x, y = i % SIDE, i // SIDE
positions = np.stack([x * 0.125, y * 0.125, np.sin(x * 0.3) + np.cos(y * 0.2)], axis=1)
normals = np.stack([-2.4 * np.cos(x * 0.3), 1.6 * np.sin(y * 0.2), np.ones(SIDE * SIDE)], axis=1)
normals /= np.linalg.norm(normals, axis=1)[:, None]
uvs = np.stack([x, y], axis=1) / 40.0
colors = np.stack([x, y, x + y, 255 - x], axis=1).astype(np.uint8)
square = np.arange((SIDE - 1) ** 2)
a = square % (SIDE - 1) + square // (SIDE - 1) * SIDE
faces = np.stack([a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE], axis=1).reshape(-1, 3)


def glb(document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunk = lambda kind, data: len(data).to_bytes(4, "little") + kind + data
    body = chunk(b"JSON", text) + chunk(b"BIN\0", binary)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


for level in LEVELS:
    stream = DracoPy.encode(
        positions.astype(np.float32), faces.astype(np.uint32), compression_level=level,
        quantization_bits=14, normals=normals, normal_quantization_bits=10,
        tex_coord=uvs, tex_coord_quantization_bits=12, colors=colors,
    )  # fmt: skip
    # By Draco's kinds of attributes: position, normal, colour, texture coordinate.
    names = ["POSITION", "NORMAL", "COLOR_0", "TEXCOORD_0"]
    ids = {names[a["attribute_type"]]: a["unique_id"] for a in DracoPy.decode(stream).attributes}
    count = SIDE * SIDE
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_draco_mesh_compression"],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2, "TEXCOORD_0": 3}, "indices": 4,
            "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": ids}},
        }]}],
        "accessors": [
            {"componentType": 5126, "type": "VEC3", "count": count},
            {"componentType": 5126, "type": "VEC3", "count": count},
            {"componentType": 5121, "type": "VEC4", "count": count, "normalized": True},
            {"componentType": 5126, "type": "VEC2", "count": count},
            {"componentType": 5125, "type": "SCALAR", "count": faces.size},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(stream)}],
        "buffers": [{"byteLength": len(stream)}],
    }  # fmt: skip
    path = pathlib.Path(__file__).parent / f"grid-level-{level}.glb"
    path.write_bytes(glb(document, stream))
