"""Binary glTF 2.0 files (Khronos, ISO/IEC 12113) of part-labelled meshes.

glTF is in metres with the y axis up. The root node `file_units` takes the file frame there, so that what is below it is
in file units; each part is a node below it. Positions are float32 as glTF demands, about the middle of the mesh and in
half its longest side, rounded up to a power of two: wherever the mesh is and however large, each coordinate is within
2^-25 of the longest side of what it was, besides the rounding of float64, and equal positions stay equal.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt32
from numpy import ndarray

from jointsdf.values import LabelledMesh, Unit
from jointsdf.viewing.palette import part_colours

ROOT = "file_units"
FLOAT, UINT, VERTICES, INDICES = 5126, 5125, 34962, 34963  # codes of glTF
Z_TO_Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # quaternion: a quarter turn about x
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"


def glb_bytes(mesh: LabelledMesh, unit: Unit, up: str = "z") -> bytes:
    """The content of a GLB file, with a named node and material per part.

    Args:
        mesh: File frame; it has faces.
        unit: Of the file frame.
        up: The axis of the file frame that points up, `y` or `z`.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = low + (high - low) / 2
    scale = 2.0 ** np.frexp(np.abs(mesh.vertices - middle).max())[1]
    root: dict[str, Any] = {"name": ROOT, "scale": [unit.metres] * 3}
    if up == "z":
        root["rotation"] = Z_TO_Y_UP
    extras = {"unit": unit.name, "metres": unit.metres, "known": unit.known, "up": up}
    gltf: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "jointsdf", "extras": {"jointsdf": extras}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [root],
        **{name: [] for name in ("meshes", "materials", "accessors", "bufferViews")},
    }
    arrays: list[bytes] = []
    for number, part in enumerate(np.unique(mesh.labels).tolist()):
        vertices, faces = np.unique(mesh.faces[mesh.labels == part], return_inverse=True)
        _add_array(gltf, arrays, ((mesh.vertices[vertices] - middle) / scale).astype("<f4"))
        _add_array(gltf, arrays, faces.astype("<u4").reshape(-1))
        name = "unlabelled" if part < 0 else f"part_{part}"
        primitive = {"attributes": {"POSITION": 2 * number}, "indices": 2 * number + 1, "material": number}
        gltf["meshes"].append({"name": name, "primitives": [primitive]})
        gltf["materials"].append(_material(name, part))
        gltf["nodes"].append({"name": name, "mesh": number, "translation": middle.tolist(), "scale": [scale] * 3})
    root["children"] = list(range(1, len(gltf["nodes"])))
    binary = b"".join(arrays)
    gltf["buffers"] = [{"byteLength": len(binary)}]
    return _container(gltf, binary)


def _add_array(
    gltf: dict[str, Any], arrays: list[bytes], array: Float32[ndarray, "v 3"] | UInt32[ndarray, " i"]
) -> None:
    """Add positions or vertex indices to the buffer, with their view and accessor; both are multiples of 4 bytes."""
    positions = array.ndim == 2
    offset, content = sum(map(len, arrays)), array.tobytes()
    view = {"buffer": 0, "byteOffset": offset, "byteLength": len(content), "target": VERTICES if positions else INDICES}
    accessor: dict[str, Any] = {"bufferView": len(gltf["bufferViews"]), "count": len(array)}
    if positions:
        box = {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessor |= {"componentType": FLOAT, "type": "VEC3", **box}
    else:
        accessor |= {"componentType": UINT, "type": "SCALAR"}
    gltf["bufferViews"].append(view)
    gltf["accessors"].append(accessor)
    arrays.append(content)


def _material(name: str, part: int) -> dict[str, Any]:
    """A part's colour, linear as glTF stores it: the inverse sRGB curve (IEC 61966-2-1)."""
    srgb = part_colours(np.array([part]))[0] / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    factors = {"baseColorFactor": [*linear.round(6).tolist(), 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": name, "doubleSided": True, "pbrMetallicRoughness": factors}


def _container(gltf: Mapping[str, Any], binary: bytes) -> bytes:
    """The file of a JSON and a binary chunk, each padded to 4 bytes."""
    text = json.dumps(gltf, separators=(",", ":"), allow_nan=False).encode()
    chunks = [(JSON_CHUNK, text + b" " * (-len(text) % 4)), (BINARY_CHUNK, binary + b"\0" * (-len(binary) % 4))]
    body = b"".join(len(content).to_bytes(4, "little") + kind + content for kind, content in chunks)
    return MAGIC + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body
