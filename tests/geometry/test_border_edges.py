"""Edges between parts, against a search edge by edge."""

import numpy as np
import trimesh
from surface_samples import cube

from jointsdf.geometry.mesh import border_edges
from jointsdf.values import LabelledMesh


def test_border_edges_of_a_cube_are_its_twelve_edges():
    mesh = cube()
    normals = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
    sides = np.unique(normals.round(6), axis=0, return_inverse=True)[1].reshape(-1)
    edges = border_edges(LabelledMesh(mesh.vertices, mesh.faces, sides))
    assert len({tuple(edge) for edge in edges}) == len(edges) == 12
    np.testing.assert_allclose(np.linalg.norm(np.diff(mesh.vertices[edges], axis=1), axis=2), 1.0)
    kept = np.where(sides == 0, -1, sides)  # borders with an unlabelled side are none
    assert len(border_edges(LabelledMesh(mesh.vertices, mesh.faces, kept))) == 8


def test_border_edges_equal_a_search_edge_by_edge():
    ball = trimesh.creation.icosphere(subdivisions=2)
    labels = np.random.default_rng(3).choice([-1, 2, 5, 9], len(ball.faces), p=[0.1, 0.7, 0.1, 0.1])
    sides: dict[tuple[int, int], set[int]] = {}
    for face, label in zip(ball.faces.tolist(), labels.tolist(), strict=True):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            sides.setdefault((min(a, b), max(a, b)), set()).add(label)
    wanted = sorted(list(edge) for edge, met in sides.items() if len(met - {-1}) > 1)
    assert border_edges(LabelledMesh(np.array(ball.vertices), np.array(ball.faces), labels)).tolist() == wanted


def test_boundary_edge_of_three_faces_is_found_whatever_their_order():
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    vertices = np.random.default_rng(0).random((5, 3))
    for labels in ([1, 1, 2], [1, 2, 1], [2, 1, 1]):
        assert border_edges(LabelledMesh(vertices, fan, np.array(labels))).tolist() == [[0, 1]]
