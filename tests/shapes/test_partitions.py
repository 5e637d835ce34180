"""Walls between bodies that touch, in one mesh of merged vertices."""

import numpy as np
import pytest
import trimesh
from damaged_meshes import box, in_box, joined, loaded, wrong_signs

from jointsdf.shapes.partitions import wind_partitions

CORNERS = np.stack(np.unravel_index(np.arange(27), (3, 3, 3)), axis=1) - 1.0


def mirrored(at: np.ndarray) -> trimesh.Trimesh:
    """A box whose sides are cut by the diagonals of its neighbours' walls."""
    mesh = box(1.0)
    mesh.vertices = mesh.vertices * (-1, 1, 1) + at
    mesh.invert()
    return mesh


def soup(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


@pytest.mark.parametrize("count", [2, 27])
@pytest.mark.parametrize("one_diagonal", [True, False])
@pytest.mark.parametrize("apart", [True, False])
def test_bodies_that_touch_are_right_whichever_are_inside_out(count: int, one_diagonal: bool, apart: bool) -> None:
    inverted = np.random.default_rng(0).random(27) < 0.4
    inverted[1] = True
    boxes = []
    for middle, turned in zip(CORNERS[:count], inverted, strict=False):
        boxes.append(mirrored(middle) if one_diagonal and middle.sum() % 2 else box(1.0, tuple(middle)))
        if turned:
            boxes[-1].invert()
    shape = loaded(*(joined(*boxes) if apart else soup(*joined(*boxes))))
    assert (len(shape.mesh.faces), shape.dropped, shape.watertight) == (12 * count, 0, apart)
    within = in_box(3.0) if count == 27 else in_box((1.0, 1.0, 2.0), (-1.0, -1.0, -0.5))
    assert wrong_signs(shape, within) == 0


@pytest.mark.parametrize("turned", [0b00, 0b01, 0b10, 0b11])
def test_two_walls_with_one_border_face_away_from_each_other(turned: int) -> None:
    walls = [np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 1, 3], [1, 2, 3]])]  # one square, two diagonals
    faces = np.concatenate([wall[:, :: -1 if turned >> side & 1 else 1] for side, wall in enumerate(walls)])
    found = wind_partitions(faces, np.array([0, 0, 1, 1]), np.array([True, True]))
    normal = np.array([1, 1]) * (1 - 2 * np.array([turned & 1, turned >> 1])) * (1 - 2 * found)
    assert normal.sum() == 0


@pytest.mark.parametrize("inside_out", [True, False])
def test_an_undecided_side_closes_the_decided_ones(inside_out: bool) -> None:
    faces = np.array(trimesh.creation.icosphere(1).faces)
    faces[7] = faces[7, ::-1] if inside_out else faces[7]
    patch = (np.arange(len(faces)) == 7).astype(int)
    assert wind_partitions(faces, patch, np.array([False, True])).tolist() == [False, inside_out]


@pytest.mark.parametrize("turned", [[], [0], [1, 2], [0, 2], [0, 1, 2]])
def test_undecided_faces_beside_each_other_follow_the_decided_ones(turned: list[int]) -> None:
    faces = np.array(trimesh.creation.icosphere(1).faces)
    around = np.flatnonzero((faces == faces[0, 0]).any(axis=1))  # all faces at one vertex
    patch = np.zeros(len(faces), dtype=np.int64)
    patch[around] = 1 + np.arange(len(around))
    faces[around[turned]] = faces[around[turned], ::-1]
    found = wind_partitions(faces, patch, np.arange(len(around) + 1) > 0)
    assert np.flatnonzero(found).tolist() == [1 + index for index in turned]
