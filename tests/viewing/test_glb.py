"""GLB files: valid by the rules of glTF 2.0, metres and y up for a reader of its own, file units below `file_units`."""

import io
import json
from typing import Any

import numpy as np
import pytest
import trimesh
from labelled_meshes import box, by_side

from jointsdf.values import ASSUMED_UNIT, LabelledMesh, Unit
from jointsdf.viewing.glb import glb_bytes

SIDES = np.array([30.0, 10.0, 20.0])
PARTS = np.unique(box(by_side).labels)[1:] - 1  # of a block, with the unlabelled side left out
COMPONENTS = {5126: np.dtype("<f4"), 5125: np.dtype("<u4")}


def block(corner: np.ndarray) -> LabelledMesh:
    """A block with its least corner there, a part per side, one side unlabelled."""
    cube = box(by_side)
    low, high = cube.vertices.min(axis=0), cube.vertices.max(axis=0)
    return LabelledMesh((cube.vertices - low) / (high - low) * SIDES + corner, cube.faces, cube.labels - 1)


def parse(content: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of a GLB file, by the layout in the specification."""
    assert (content[:4], int.from_bytes(content[4:8], "little")) == (b"glTF", 2)
    assert int.from_bytes(content[8:12], "little") == len(content)
    length = int.from_bytes(content[12:16], "little")
    text, rest = content[20 : 20 + length], content[20 + length :]
    assert (content[16:20], length % 4, rest[4:8]) == (b"JSON", 0, b"BIN\0")
    assert int.from_bytes(rest[:4], "little") == len(rest) - 8
    return json.loads(text), rest[8:]


def array(gltf: dict[str, Any], binary: bytes, accessor: dict[str, Any]) -> np.ndarray:
    view, kind = gltf["bufferViews"][accessor["bufferView"]], COMPONENTS[accessor["componentType"]]
    assert view["byteOffset"] % 4 == 0
    values = np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], kind)
    return values.reshape(-1, 3) if accessor["type"] == "VEC3" else values


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(
    ("unit", "corner"),
    [(ASSUMED_UNIT, 0.0), (Unit("in", 0.0254), -5.0), (Unit("m", 1.0), 4e6), (Unit("mm", 1e-3), -4e6)],
)
def test_a_viewer_sees_metres_with_y_up(unit: Unit, corner: float, up: str) -> None:
    mesh = block(np.full(3, corner))
    bounds = trimesh.load_scene(io.BytesIO(glb_bytes(mesh, unit, up)), file_type="glb").bounds
    low, high = np.full(3, corner), np.full(3, corner) + SIDES
    if up == "z":  # (x, y, z) -> (x, z, -y)
        low, high = np.array([low[0], low[2], -high[1]]), np.array([high[0], high[2], -low[1]])
    np.testing.assert_allclose(bounds, np.array([low, high]) * unit.metres, rtol=1e-14, atol=1e-7 * 30 * unit.metres)


@pytest.mark.parametrize("corner", [0.0, 4e6, -4e6 + 1 / 3])
@pytest.mark.parametrize("scale", [1e-300, 1e-6, 1.0, 1e9, 1e60])
def test_below_file_units_are_the_coordinates_of_the_file(corner: float, scale: float) -> None:
    """To half a step of float32 at half the longest side, which is 2^-25 of it, and two roundings of float64."""
    mesh = block(np.full(3, corner))
    mesh = LabelledMesh(mesh.vertices * scale, mesh.faces, mesh.labels)
    bound = SIDES.max() * scale * 2**-25 + 2 * np.spacing(np.abs(mesh.vertices).max())
    gltf, binary = parse(glb_bytes(mesh, Unit("in", 0.0254)))
    root, *parts = gltf["nodes"]
    assert (root["name"], root["children"]) == ("file_units", [1, 2, 3, 4, 5, 6])
    assert [node["name"] for node in parts] == ["unlabelled", *(f"part_{part}" for part in PARTS)]
    for node, part in zip(parts, (-1, *PARTS), strict=True):
        primitive = gltf["meshes"][node["mesh"]]["primitives"][0]
        keys = primitive["attributes"]["POSITION"], primitive["indices"]
        positions, indices = (array(gltf, binary, gltf["accessors"][key]) for key in keys)
        placed = positions.astype(np.float64)[indices] * node["scale"] + node["translation"]
        expected = mesh.vertices[mesh.faces[mesh.labels == part]].reshape(-1, 3)
        np.testing.assert_allclose(placed, expected, rtol=0, atol=bound)


def test_the_file_keeps_the_rules_of_gltf() -> None:
    gltf, binary = parse(glb_bytes(block(np.zeros(3)), Unit("in", 0.0254)))
    assert gltf["asset"]["version"] == "2.0"
    assert gltf["asset"]["extras"] == {"jointsdf": {"unit": "in", "metres": 0.0254, "known": True, "up": "z"}}
    assert gltf["scenes"][gltf["scene"]] == {"nodes": [0]}
    assert gltf["buffers"] == [{"byteLength": len(binary)}]
    for accessor in gltf["accessors"]:
        values, view = array(gltf, binary, accessor), gltf["bufferViews"][accessor["bufferView"]]
        assert len(values) == accessor["count"]
        if accessor["type"] == "VEC3":
            assert view["target"] == 34962
            assert (accessor["min"], accessor["max"]) == (values.min(axis=0).tolist(), values.max(axis=0).tolist())
        else:
            assert view["target"] == 34963
    for material in gltf["materials"]:
        assert material["doubleSided"]
        assert all(0 <= factor <= 1 for factor in material["pbrMetallicRoughness"]["baseColorFactor"])
