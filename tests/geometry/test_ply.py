"""PLY files against their bytes and trimesh's reader."""

import io
import struct

import numpy as np
import pytest
import trimesh

from jointsdf.geometry.ply import binary_ply

CORNERS = np.array([[0.1, 0.2, 0.3], [1 / 3, -2.0, 1e-7], [4e9, 5.0, -0.0]])
HEADER = b"""ply
format binary_little_endian 1.0
comment a triangle
element vertex 3
property double x
property double y
property double z
element face 1
property list uchar int vertex_indices
property int label
property uchar red
end_header
"""


def test_bytes_of_one_triangle() -> None:
    columns = {"label": np.array([-1], dtype=np.int32), "red": np.array([200], dtype=np.uint8)}
    expected = HEADER + struct.pack("<9d", *CORNERS.ravel()) + struct.pack("<B3iiB", 3, 0, 1, 2, -1, 200)
    assert binary_ply(CORNERS, np.array([[0, 1, 2]]), columns, "a triangle") == expected


def test_single_precision_stays_single() -> None:
    data = binary_ply(CORNERS.astype(np.float32), np.array([[0, 1, 2]]), {}, "x")
    assert b"property float z" in data
    assert data.endswith(struct.pack("<9f", *CORNERS.astype(np.float32).ravel()) + struct.pack("<B3i", 3, 0, 1, 2))


@pytest.mark.parametrize("count", [0, 1, 1000])
def test_trimesh_reads_back_positions_faces_and_columns(count: int) -> None:
    rng = np.random.default_rng(count)
    vertices, faces = rng.normal(size=(500, 3)) * 1e3, rng.integers(0, 500, (count, 3))
    columns = {
        "label": rng.integers(-1, 2**31 - 1, count).astype(np.int32),
        "red": rng.integers(0, 256, count).astype(np.uint8),
    }
    data = binary_ply(vertices, faces, columns, "random")
    raw = trimesh.exchange.ply.load_ply(io.BytesIO(data))["metadata"]["_ply_raw"]
    read = raw["vertex"]["data"]
    np.testing.assert_array_equal(np.stack([read[axis] for axis in "xyz"], axis=1), vertices)
    assert read["x"].dtype == np.float64
    if count:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type="ply", process=False)
        np.testing.assert_array_equal(mesh.vertices, vertices)
        np.testing.assert_array_equal(mesh.faces, faces)
        for name, column in columns.items():
            np.testing.assert_array_equal(raw["face"]["data"][name].ravel(), column)
