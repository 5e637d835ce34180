"""Areas, normals and edges against known shapes and a search edge by edge."""

import numpy as np
import pytest
import trimesh
from solids import halves, labelled, strip

from jointsdf.geometry.mesh import border_edges, edge_keys, face_areas, face_normals, relative_area
from jointsdf.values import LabelledMesh


def test_areas_of_a_strip() -> None:
    mesh = strip([2, 1, 4, 3], [7, 5, 5, -1], height=3.0)
    np.testing.assert_allclose(face_areas(mesh), [3, 3, 1.5, 1.5, 6, 6, 4.5, 4.5])


def test_face_normals_follow_the_winding() -> None:
    vertices = np.array([[0.0, 0, 0], [2.0, 0, 0], [0, 3.0, 0]])
    normals = face_normals(vertices, np.array([[0, 1, 2], [0, 2, 1], [0, 0, 1]]))
    np.testing.assert_array_equal(normals, [[0, 0, 1], [0, 0, -1], [0, 0, 0]])


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_relative_area_of_a_box(scale: float) -> None:
    box = labelled(trimesh.creation.box(scale * np.array([4.0, 2.0, 1.0])))
    assert relative_area(box) == pytest.approx(2 * (8 + 4 + 2) / 4)


def test_edge_keys_are_equal_for_the_two_sides_of_an_edge() -> None:
    keys = edge_keys(np.array([[0, 1, 2], [2, 1, 3]]), 4)
    assert keys.tolist() == [1, 6, 2, 6, 7, 11]


def test_border_edges_of_a_cube_are_its_twelve_edges() -> None:
    mesh = labelled(trimesh.creation.box())
    normals = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
    sides = np.unique(normals.round(6), axis=0, return_inverse=True)[1].reshape(-1)
    edges = border_edges(LabelledMesh(mesh.vertices, mesh.faces, sides))
    assert len({tuple(edge) for edge in edges}) == len(edges) == 12
    np.testing.assert_allclose(np.linalg.norm(np.diff(mesh.vertices[edges], axis=1), axis=2), 1.0)
    five = np.where(sides == 0, -1, sides)  # borders with an unlabelled side are none
    assert len(border_edges(LabelledMesh(mesh.vertices, mesh.faces, five))) == 8


def test_border_edges_equal_a_search_edge_by_edge() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    labels = np.random.default_rng(3).choice([-1, 2, 5, 9], len(ball.faces), p=[0.1, 0.7, 0.1, 0.1])
    sides: dict[tuple[int, int], set[int]] = {}
    for face, label in zip(ball.faces.tolist(), labels.tolist(), strict=True):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            sides.setdefault((min(a, b), max(a, b)), set()).add(label)
    wanted = sorted(list(edge) for edge, met in sides.items() if len(met - {-1}) > 1)
    assert border_edges(labelled(ball, labels)).tolist() == wanted


def test_boundary_edge_of_three_faces_is_found_whatever_their_order() -> None:
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    vertices = np.random.default_rng(0).random((5, 3))
    for labels in ([1, 1, 2], [1, 2, 1], [2, 1, 1]):
        assert border_edges(LabelledMesh(vertices, fan, np.array(labels))).tolist() == [[0, 1]]


def test_one_label_has_no_border() -> None:
    for mesh in (halves((4, 4)), halves((4, -1))):
        assert len(border_edges(mesh)) == 0
