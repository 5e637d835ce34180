"""Welding of tessellated bodies."""

import numpy as np
import trimesh

from jointsdf.shapes.readers.step_bodies import weld


def solid(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


def test_welding_drops_degenerate_faces_with_their_patches() -> None:
    box = trimesh.creation.box()
    vertices, faces = box.vertices[box.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    vertices, faces = np.vstack([vertices, vertices[:3]]), np.insert(faces, 5, [0, 36, 7], axis=0)
    patches = np.insert(np.arange(12), 5, 5)
    welded, triangles, bodies, kept = weld(np.array(vertices), faces, patches, np.zeros(13, dtype=int))
    assert len(welded) == 8
    assert set(bodies) == {0}
    assert np.flatnonzero(~kept).tolist() == [5]
    np.testing.assert_array_equal(welded[triangles], box.vertices[box.faces])


def test_welding_keeps_bodies_apart_that_coincide() -> None:
    box = trimesh.creation.box()
    vertices = np.vstack([box.vertices[box.faces].reshape(-1, 3)] * 3)
    patches = np.repeat(np.arange(18), 2)
    welded, triangles, bodies, _ = weld(vertices, np.arange(108).reshape(-1, 3), patches, np.zeros(36, dtype=int))
    assert len(welded) == 24
    assert bodies.tolist() == np.repeat(np.arange(3), 12).tolist()
    assert solid(welded, triangles).body_count == 3
    assert solid(welded, triangles).is_watertight


def test_an_open_shell_joins_no_product_that_lies_at_its_rim() -> None:
    box = trimesh.creation.box()
    up = box.face_normals[:, 2] > 0.5
    lidless = box.vertices[box.faces[~up]].reshape(-1, 3)
    vertices = np.vstack([lidless, lidless])
    patches = np.repeat(np.arange(20), 1)
    _, _, bodies, _ = weld(vertices, np.arange(60).reshape(-1, 3), patches, np.repeat([0, 1], 10))
    assert bodies.tolist() == [0] * 10 + [1] * 10
