"""Corners that rounding has moved apart."""

import numpy as np
import pytest
import trimesh
from damaged_meshes import loaded

from jointsdf.shapes.arrays import from_arrays
from jointsdf.shapes.welding import weld


def soup(steps: int, *, scale: float = 1.0, offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of a ball, each with corners of its own, moved by so many float32 steps at most along each axis."""
    corners = (trimesh.creation.icosphere(3).triangles.reshape(-1, 3) * scale + offset).astype(np.float32)
    moves = np.random.default_rng(0).integers(-steps, steps + 1, corners.shape)
    corners = corners + moves * np.spacing(np.abs(corners).max())
    return corners.astype(np.float64), np.arange(len(corners)).reshape(-1, 3)


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1e4, 4e6)])
def test_a_soup_is_welded_to_a_body(caplog: pytest.LogCaptureFixture, scale: float, offset: float) -> None:
    shape = loaded(*soup(1, scale=scale, offset=offset))
    assert shape.watertight
    assert shape.welded > 2500
    assert f"{shape.welded} vertices within" in caplog.text
    assert (len(shape.mesh.vertices), len(shape.mesh.faces)) == (642, 1280)
    solid = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(trimesh.creation.icosphere(3).volume * scale**3, rel=1e-2)


def test_both_sides_of_a_soup_are_welded_to_one_body() -> None:
    vertices, faces = soup(1)
    shape = loaded(vertices, np.concatenate([faces, faces[:, ::-1]]))
    assert (shape.watertight, len(shape.mesh.faces), shape.dropped) == (True, 1280, 1280)
    solid = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(trimesh.creation.icosphere(3).volume, rel=1e-5)


def test_closed_meshes_and_the_rims_of_holes_are_left_alone() -> None:
    ball = trimesh.creation.icosphere(4)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    assert weld("it", vertices, faces) is None
    assert weld("it", vertices, faces[40:]) is None
    twice = np.concatenate([vertices, vertices + 1e-9])  # closed bodies at almost one place
    assert weld("it", twice, np.concatenate([faces, faces + len(vertices)])) is None


def test_corners_further_apart_than_the_tolerance_are_not_welded() -> None:
    corners = trimesh.creation.icosphere(3).triangles.reshape(-1, 3)
    moved = corners + np.random.default_rng(0).uniform(-1e-4, 1e-4, corners.shape)
    assert weld("it", moved, np.arange(len(moved)).reshape(-1, 3)) is None


def test_patches_that_are_whole_but_apart_by_a_rounding_are_welded() -> None:
    solid = trimesh.creation.cylinder(1.0, 2.0, sections=64)
    side = np.round(solid.face_normals[:, 2]).astype(int)
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    for which in (-1, 0, 1):
        used, corners = np.unique(solid.faces[side == which], return_inverse=True)
        moved = solid.vertices[used].astype(np.float32)
        moved = np.nextafter(moved, np.float32(which * np.inf if which else 0.0))
        faces = np.concatenate([faces, corners.reshape(-1, 3) + len(vertices)])
        vertices = np.concatenate([vertices, moved.astype(np.float64)])
    shape = loaded(vertices, faces)
    assert (shape.watertight, shape.welded, len(shape.mesh.vertices)) == (True, 128, len(solid.vertices))


def test_where_float32_is_too_coarse_nothing_is_welded() -> None:
    vertices, faces = soup(1, scale=10.0, offset=1e6)
    assert weld("it", vertices, faces) is None


def test_labels_follow_their_faces_past_those_that_welding_closes() -> None:
    vertices, faces = soup(1)
    sliver = vertices[[0]] + [[0, 0, 0], [1e-7, 0, 0], [0, 1e-7, 0]]
    labels = np.insert(np.arange(len(faces)), 7, 9999)
    faces = np.insert(faces, 7, len(vertices) + np.arange(3), axis=0)
    shape = from_arrays(np.concatenate([vertices, sliver]), faces, labels=labels, name="it")
    assert (shape.watertight, shape.dropped) == (True, 1)
    assert shape.mesh.labels.tolist() == list(range(1280))
