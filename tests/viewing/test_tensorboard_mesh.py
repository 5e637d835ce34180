"""Meshes of TensorBoard's mesh tab: upright, in one frame, within its number of vertices."""

import numpy as np
import trimesh
from labelled_meshes import box, by_side, sphere

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.values import LabelledMesh
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.tensorboard_mesh import VERTICES, decimate, fits, scene, to_arrays


def test_faces_keep_their_colour_and_place_and_stand_upright() -> None:
    mesh = LabelledMesh(box(by_side).vertices * [30, 10, 20] + 500, box(by_side).faces, box(by_side).labels)
    vertices, colours, faces = to_arrays(mesh, mesh, "z")
    assert vertices.shape == colours.shape == (1, 24, 3)  # 6 sides, 4 corners each
    assert faces.shape == (1, 12, 3)
    for corner in range(3):
        np.testing.assert_array_equal(colours[0][faces[0, :, corner]], part_colours(mesh.labels))
    np.testing.assert_allclose(vertices[0].min(axis=0), [-1, -2 / 3, -1 / 3], atol=1e-6)
    found = vertices[0][faces[0]].astype(float) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # (x, y, z) -> (x, -z, y)
    np.testing.assert_allclose(found * 15 + 500, mesh.vertices[mesh.faces], atol=1e-4)
    vertices = to_arrays(mesh, mesh, "y")[0]
    np.testing.assert_allclose(vertices[0].min(axis=0), [-1, -1 / 3, -2 / 3], atol=1e-6)


def test_meshes_that_are_compared_share_a_frame() -> None:
    truth, fit = sphere(2.0), sphere(1.0)
    assert np.abs(to_arrays(truth, truth, "z").vertices).max() == 1
    assert np.abs(to_arrays(fit, truth, "z").vertices).max() == 0.5


def test_the_camera_is_above_and_in_front() -> None:
    x, y, z = scene()["camera"]["position"]
    assert x > 0
    assert y > 0
    assert z > 0


def test_a_large_mesh_is_decimated_within_a_bound_and_keeps_its_parts() -> None:
    fine = trimesh.creation.box((4, 3, 2))
    for _ in range(7):
        fine = fine.subdivide()
    sides = np.argmax(np.abs(fine.face_normals), axis=1)
    mesh = LabelledMesh(np.array(fine.vertices), np.array(fine.faces), sides.astype(np.int64))
    assert len(mesh.vertices) > VERTICES
    assert not fits(mesh)
    small = decimate(mesh)
    assert small is not None
    assert fits(small)
    assert set(small.labels) == {0, 1, 2}
    assert ClosestPoint(small).query(mesh.vertices)[0].max() < 1e-4 * 4 * 2
    coarse = sphere(1.0)
    assert decimate(coarse) is coarse
