"""Faces cut at part borders: same surface, labels exact to the bisection, finer than the vote."""

import numpy as np
import pytest
import trimesh
from numpy import ndarray

from jointsdf.extraction.face_labels import NEAREST_CUT, majority_labels, split_at_borders


def areas_by_label(vertices: ndarray, faces: ndarray, labels: ndarray) -> dict[int, float]:
    area = trimesh.triangles.area(vertices[faces])
    return {int(k): float(area[labels == k].sum()) for k in np.unique(labels)}


@pytest.fixture(scope="module")
def sphere() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=3)


def above(height: float):
    return lambda points: (points[:, 2] > height).astype(np.int64) * 7


def octant(points: ndarray) -> ndarray:
    return ((points[:, 0] > 0.05) + 2 * (points[:, 1] > 0.03) + 4 * (points[:, 2] > 0.01)).astype(np.int64)


def test_split_keeps_the_surface_and_closes_it(sphere: trimesh.Trimesh) -> None:
    vertices, faces, labels = split_at_borders(
        sphere.vertices.view(ndarray), sphere.faces.view(ndarray), octant(sphere.vertices), octant
    )
    cut = trimesh.Trimesh(vertices, faces, process=False)
    assert cut.is_watertight
    assert cut.is_winding_consistent
    assert cut.euler_number == 2
    assert cut.area == pytest.approx(sphere.area, rel=1e-12)
    assert cut.volume == pytest.approx(sphere.volume, rel=1e-12)
    assert len(labels) == len(faces) > len(sphere.faces)
    assert cut.area_faces.min() > 0


def test_split_labels_are_exact_to_the_bisection(sphere: trimesh.Trimesh) -> None:
    """On the faces of a plane's side the label changes within an edge's last bisection of the plane."""
    vertices, faces, labels = split_at_borders(
        sphere.vertices.view(ndarray), sphere.faces.view(ndarray), above(0.3)(sphere.vertices), above(0.3)
    )
    longest = sphere.edges_unique_length.max()
    heights = vertices[faces][:, :, 2]
    assert (heights[labels == 7].min(axis=1) > 0.3 - longest * NEAREST_CUT).all()
    assert (heights[labels == 0].max(axis=1) < 0.3 + longest * NEAREST_CUT).all()


def test_split_is_finer_than_the_vote(sphere: trimesh.Trimesh) -> None:
    """The cap above z = h of a unit sphere has area 2 pi (1 - h)."""
    vertices, faces = sphere.vertices.view(ndarray), sphere.faces.view(ndarray)
    at_vertices = above(0.3)(vertices)
    expected = 2 * np.pi * 0.7 / (4 * np.pi)
    voted = areas_by_label(vertices, faces, majority_labels(vertices, faces, at_vertices, above(0.3)))
    cut = areas_by_label(*split_at_borders(vertices, faces, at_vertices, above(0.3)))
    errors = [abs(areas[7] / sum(areas.values()) - expected) for areas in (voted, cut)]
    assert errors[1] < 1e-3
    assert errors[1] < errors[0] / 5


def test_three_labels_on_one_face_meet_at_its_centroid() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2]])

    def nearest(points: ndarray) -> ndarray:
        return np.linalg.norm(points[:, None] - vertices[None], axis=2).argmin(axis=1) + 10

    new_vertices, new_faces, labels = split_at_borders(vertices, faces, nearest(vertices), nearest)
    assert len(new_faces) == 6
    assert len(new_vertices) == 7
    assert sorted(labels) == [10, 10, 11, 11, 12, 12]
    normals = np.cross(*(new_vertices[new_faces[:, i]] - new_vertices[new_faces[:, 0]] for i in (1, 2)))
    assert (normals[:, 2] > 0).all()
    assert normals[:, 2].sum() == pytest.approx(1.0)
    assert (
        majority_labels(vertices, faces, nearest(vertices), nearest).tolist()
        == nearest(vertices[None].mean(1)).tolist()
    )


def test_no_edge_at_a_crease_is_cut() -> None:
    """Two faces at a crease edge (0, 1) keep to their sides, and a border that meets a crease ends at its vertex."""
    vertices = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0.5, 0], [-1, 0.5, 0], [1, -0.5, 0]])
    faces, on_crease = np.array([[0, 2, 1], [0, 1, 3], [0, 4, 2]]), np.array([True, True, False, False, False])

    def quadrant(points: np.ndarray) -> np.ndarray:
        return (points[:, 0] > 0).astype(np.int64) + 5 * (points[:, 1] > 0.1)

    found, cut, labels = split_at_borders(vertices, faces, quadrant(vertices), quadrant, on_crease)
    assert len(found) == 6, "the edge from 4 to 2 alone is cut"
    np.testing.assert_allclose(found[5], [1, 0.1, 0], atol=1 / 64)
    assert {(*sorted(face), label) for face, label in zip(cut.tolist(), labels.tolist(), strict=True)} == {
        (0, 1, 2, 6),
        (0, 1, 3, 5),
        (0, 2, 5, 6),
        (0, 4, 5, 1),
    }
    normals = np.cross(found[cut[:, 1]] - found[cut[:, 0]], found[cut[:, 2]] - found[cut[:, 0]])
    assert (normals[:, 2] > 0).all()
    assert normals[:, 2].sum() == pytest.approx(3.0)


def test_a_border_that_wavers_beside_a_crease_is_not_drawn_onto_it() -> None:
    """The crease is the line y = 0; the border runs along the row y = 1, whose labels alternate."""
    x, y = np.meshgrid(np.arange(9), np.arange(-2, 4), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(np.float64)
    lower = (6 * np.arange(8)[:, None] + np.arange(5)).ravel()
    faces = np.concatenate([np.stack([lower, lower + 6, lower + 7], 1), np.stack([lower, lower + 7, lower + 1], 1)])

    def above_wave(points: np.ndarray) -> np.ndarray:
        return (points[:, 1] > 1 + 0.3 * np.cos(np.pi * points[:, 0])).astype(np.int64)

    found, cut, labels = split_at_borders(vertices, faces, above_wave(vertices), above_wave, vertices[:, 1] == 0)
    border = [set(cut[labels == label].ravel()) for label in (0, 1)]
    assert found[list(border[0] & border[1]), 1].min() > 0.5
    assert areas_by_label(found, cut, labels)[1] == pytest.approx(16.0, abs=0.2)


def test_a_face_with_all_corners_on_creases_has_the_label_of_its_middle() -> None:
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    _, cut, labels = split_at_borders(
        vertices, faces, np.array([1, 2, 3]), lambda points: np.full(len(points), 9), np.ones(3, dtype=bool)
    )
    np.testing.assert_array_equal(cut, faces)
    assert labels.tolist() == [9]


def test_one_label_changes_nothing(sphere: trimesh.Trimesh) -> None:
    vertices, faces = sphere.vertices.view(ndarray), sphere.faces.view(ndarray)
    labels = np.full(len(vertices), 4)
    new_vertices, new_faces, new_labels = split_at_borders(
        vertices, faces, labels, lambda points: np.full(len(points), 4)
    )
    np.testing.assert_array_equal(new_vertices, vertices)
    np.testing.assert_array_equal(new_faces, faces)
    assert set(new_labels) == {4}


def test_an_empty_mesh_stays_empty() -> None:
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    pieces = split_at_borders(vertices, faces, np.zeros(0, dtype=np.int64), above(0.0))
    assert [len(piece) for piece in pieces] == [0, 0, 0]
