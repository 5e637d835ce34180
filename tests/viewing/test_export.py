"""Files read back by trimesh; arrays for TensorBoard."""

from pathlib import Path

import numpy as np
import trimesh
from labelled_meshes import EMPTY, box, by_side, sphere

from jointsdf.values import LabelledMesh, Unit
from jointsdf.viewing.export import write_mesh
from jointsdf.viewing.palette import part_colours

TO_Y_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # (x, y, z) -> (x, z, -y)


def test_ply_and_labels_round_trip_exactly(tmp_path: Path) -> None:
    ball = sphere(1.0, subdivisions=3)
    labels = np.random.default_rng(0).integers(-1, 90, len(ball.faces))
    mesh = LabelledMesh(ball.vertices / 3 + [1e5, 2e5, 3e5], ball.faces, labels)
    write_mesh(tmp_path / "run", mesh)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [
        "labels.json",
        "labels.npy",
        "mesh.glb",
        "mesh.ply",
    ]
    read = trimesh.load_mesh(tmp_path / "run" / "mesh.ply", process=False)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.testing.assert_array_equal(read.visual.face_colors[:, :3], part_colours(labels))
    np.testing.assert_array_equal(read.metadata["_ply_raw"]["face"]["data"]["label"].reshape(-1), labels)
    stored = np.load(tmp_path / "run" / "labels.npy", allow_pickle=False)
    assert stored.dtype == np.int64
    np.testing.assert_array_equal(stored, labels)


def test_ply_says_the_unit(tmp_path: Path) -> None:
    write_mesh(tmp_path / "assumed", box(by_side))
    write_mesh(tmp_path / "inch", box(by_side), Unit("in", 0.0254))
    assert b"\ncomment unit mm 0.001 assumed\n" in (tmp_path / "assumed" / "mesh.ply").read_bytes()
    assert b"\ncomment unit in 0.0254\n" in (tmp_path / "inch" / "mesh.ply").read_bytes()


def test_glb_has_one_coloured_node_per_part(tmp_path: Path) -> None:
    mesh = box(lambda normals: by_side(normals) - 1)
    write_mesh(tmp_path, mesh)
    scene = trimesh.load_scene(tmp_path / "mesh.glb")
    names = {"unlabelled" if part < 0 else f"part_{part}": part for part in np.unique(mesh.labels)}
    assert set(scene.graph.nodes_geometry) == set(names)
    for name, part in names.items():
        geometry = scene.geometry[name]
        triangles = mesh.vertices[mesh.faces[mesh.labels == part]] @ TO_Y_UP * 1e-3
        placed = trimesh.transform_points(geometry.triangles.reshape(-1, 3), scene.graph[name][0])
        np.testing.assert_allclose(placed.reshape(-1, 3, 3), triangles, atol=1e-9)
        assert geometry.visual.material.doubleSided
        linear = np.array(geometry.visual.material.baseColorFactor[:3]) / 255
        srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(srgb * 255, part_colours(np.array([part]))[0], atol=6)


def test_empty_mesh_writes_a_valid_ply_and_labels(tmp_path: Path) -> None:
    write_mesh(tmp_path, box(by_side))
    write_mesh(tmp_path, EMPTY)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["labels.json", "labels.npy", "mesh.ply"]
    content = (tmp_path / "mesh.ply").read_bytes()
    assert content.endswith(b"end_header\n")
    assert b"element vertex 0\n" in content
    assert b"element face 0\n" in content
    assert np.load(tmp_path / "labels.npy").shape == (0,)
