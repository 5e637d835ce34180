"""Dihedral angles, pairs of faces and smooth regions of known solids."""

import numpy as np
import pytest
import trimesh
from solids import labelled

from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.shapes.builtin.construction import Construction, box
from jointsdf.values import LabelledMesh


def angle_bracket() -> LabelledMesh:
    """A foot and a wall at a right angle, with one concave crease of length 4."""
    part = Construction()
    part.add("foot", box((0, 0, 0), (10, 4, 2)))
    part.add("wall", box((0, 0, 0), (2, 4, 10)))
    return part.mesh()


def test_dihedral_angles_are_exact() -> None:
    graph = face_graph(angle_bracket())
    creases = np.abs(graph.angles) > 0.1
    np.testing.assert_allclose(np.abs(graph.angles[creases]), np.pi / 2)
    np.testing.assert_allclose(graph.lengths[creases & (graph.angles < 0)].sum(), 4.0)


@pytest.mark.parametrize("flipped", [False, True])
def test_pairs_are_those_of_trimesh_whatever_the_winding(flipped: bool) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    mesh = labelled(ball)
    if flipped:
        faces = np.where(np.arange(len(mesh.faces))[:, None] % 3 == 0, mesh.faces[:, ::-1], mesh.faces)
        mesh = LabelledMesh(mesh.vertices, faces, mesh.labels)
    graph = face_graph(mesh)
    assert sorted(map(sorted, graph.pairs.tolist())) == sorted(map(sorted, ball.face_adjacency.tolist()))
    order = np.lexsort(np.sort(graph.pairs, axis=1).T)
    theirs = np.lexsort(np.sort(ball.face_adjacency, axis=1).T)
    np.testing.assert_allclose(np.abs(graph.angles[order]), ball.face_adjacency_angles[theirs], atol=1e-6)


def test_an_edge_of_four_faces_joins_those_that_traverse_it_in_opposite_directions() -> None:
    pair = trimesh.util.concatenate([trimesh.creation.box().apply_translation((s, s, 0)) for s in (0, 1)])
    pair.merge_vertices()
    graph = face_graph(labelled(pair))
    counts = np.unique(np.sort(pair.edges, axis=1), axis=0, return_counts=True)[1]
    assert counts.tolist().count(4) == 1
    assert len(graph.pairs) == counts.tolist().count(2) + 4


def test_a_cylinder_of_twelve_segments_is_one_smooth_region() -> None:
    tube = trimesh.creation.cylinder(1, 6, sections=12)
    side = labelled(tube.submesh([np.abs(tube.face_normals[:, 2]) < 0.5], append=True))
    assert smooth_regions(face_graph(side), None).max() == 0
    assert smooth_regions(face_graph(labelled(tube)), None).max() + 1 == 3


def test_regions_are_whole_patches_where_these_are_known() -> None:
    mesh = labelled(trimesh.creation.box().subdivide().subdivide())
    patches = np.where(mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0, 3, 8)
    unknown = np.where(patches == 3, 3, -1)
    graph = face_graph(mesh)
    np.testing.assert_array_equal(
        smooth_regions(graph, unknown)[patches == 3], smooth_regions(graph, patches)[patches == 3]
    )
    assert smooth_regions(graph, unknown).max() + 1 == 1 + 5, "five sides of the half without patches"
