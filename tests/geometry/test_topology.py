"""Components against brute force, Euler characteristics and volumes of known solids."""

import numpy as np
import pytest
import trimesh
from solids import labelled

from jointsdf.geometry.topology import (
    component_volumes,
    components,
    count_cavities,
    count_components,
    edge_components,
    face_components,
    is_closed,
    is_consistent,
    side_uses,
    signed_volume,
    topology,
)
from jointsdf.values import LabelledMesh

TWO = trimesh.creation.icosphere() + trimesh.creation.box().apply_translation((9, 0, 0))
NO_FACES = np.zeros((0, 3), dtype=np.int64)


def flood(pairs: np.ndarray, count: int) -> list[int]:
    """The lowest node that each node is connected with, by spreading it along the edges until nothing changes."""
    lowest = list(range(count))
    while True:
        before = lowest.copy()
        for a, b in pairs.tolist():
            lowest[a] = lowest[b] = min(lowest[a], lowest[b])
        if lowest == before:
            return lowest


@pytest.mark.parametrize("edges", [0, 1, 20, 60, 200])
def test_components_equal_a_flood_fill_and_are_numbered_by_their_first_node(edges: int) -> None:
    pairs = np.random.default_rng(edges).integers(0, 80, (edges, 2))
    lowest = flood(pairs, 80)
    numbers = {node: number for number, node in enumerate(sorted(set(lowest)))}
    assert components(pairs, 80).tolist() == [numbers[node] for node in lowest]


def test_faces_that_share_a_vertex_are_connected() -> None:
    faces = np.random.default_rng(0).permutation(trimesh.util.concatenate([TWO, TWO, TWO]).faces)
    corners = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    lowest = np.array(flood(corners, int(faces.max()) + 1))[faces[:, 0]]
    found = face_components(faces)
    pairs = set(zip(found.tolist(), lowest.tolist(), strict=True))
    assert len(pairs) == len(set(found.tolist())) == len(set(lowest.tolist())) == count_components(faces) == 6
    assert sorted(set(found.tolist())) == list(range(6))


def test_one_shared_vertex_connects_two_faces() -> None:
    assert count_components(np.array([[0, 1, 2], [2, 3, 4], [5, 6, 7]])) == 2


def test_a_vertex_without_a_face_is_no_component() -> None:
    faces = np.array([[1, 2, 3], [7, 9, 8]])
    assert sorted(face_components(faces).tolist()) == [0, 1]
    assert count_components(faces) == 2


def test_no_faces_have_no_components() -> None:
    assert face_components(NO_FACES).tolist() == []
    assert count_components(NO_FACES) == 0
    empty = LabelledMesh(np.zeros((3, 3)), NO_FACES, np.zeros(0, dtype=np.int64))
    assert topology(empty) == {"components": 0.0, "euler": 0.0, "volume": 0.0}


@pytest.mark.parametrize(
    ("mesh", "pieces", "euler"),
    [
        (trimesh.creation.box(), 1, 2),
        (trimesh.creation.icosphere(), 1, 2),
        (trimesh.creation.torus(1.0, 0.3), 1, 0),
        (trimesh.creation.box() + trimesh.creation.box().apply_translation((2, 0, 0)), 2, 4),
        (TWO, 2, 4),
    ],
    ids=["box", "sphere", "torus", "two boxes", "two bodies"],
)
def test_topology_of_known_solids(mesh: trimesh.Trimesh, pieces: int, euler: int) -> None:
    found = topology(labelled(mesh))
    assert (found["components"], found["euler"]) == (pieces, euler)
    assert found["volume"] == pytest.approx(mesh.volume, rel=1e-9)


def test_unused_vertices_do_not_count() -> None:
    mesh = labelled(trimesh.creation.box())
    assert topology(LabelledMesh(np.r_[[[9.0, 9, 9]], mesh.vertices], mesh.faces + 1, mesh.labels)) == topology(mesh)


def test_volume_is_negative_inside_out_and_does_not_depend_on_place_or_rotation() -> None:
    box = trimesh.creation.box((1, 2, 3))
    assert signed_volume(np.array(box.vertices), np.array(box.faces)) == pytest.approx(6.0, rel=1e-12)
    assert signed_volume(np.array(box.vertices), np.array(box.faces)[:, ::-1]) == pytest.approx(-6.0, rel=1e-12)
    turn = trimesh.transformations.rotation_matrix(1.1, (1, 2, 3))[:3, :3]
    moved = np.array(box.vertices) @ turn.T + (1e4, -2e4, 3e4)
    assert signed_volume(moved, np.array(box.faces)) == pytest.approx(6.0, rel=1e-9)


def test_volume_of_a_shell_is_that_between_its_walls() -> None:
    inner = trimesh.creation.box((1, 1, 1))
    inner.invert()
    shell = trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), inner])
    found = topology(labelled(shell))
    assert (found["components"], found["euler"]) == (2, 4)
    assert found["volume"] == pytest.approx(7.0, rel=1e-12)


def test_faces_that_share_but_a_vertex_are_apart_by_edges() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 4, 5], [5, 4, 6]])
    number = edge_components(faces)
    assert number[0] == number[1] != number[2] == number[3]
    assert count_components(faces) == 1


def test_volume_and_cavities_by_component() -> None:
    hole = trimesh.creation.icosphere(2, 0.3)
    hole.invert()
    both = trimesh.util.concatenate([trimesh.creation.box((2.0, 3.0, 4.0)), hole])
    vertices, faces = np.array(both.vertices) + 100, np.array(both.faces)
    number = np.repeat([0, 1], [12, len(hole.faces)])
    np.testing.assert_allclose(component_volumes(vertices, faces, number), [24.0, hole.volume])
    assert count_cavities(vertices, faces) == 1
    assert count_cavities(vertices, faces[:12]) == 0


def test_sides_are_counted_as_by_hand() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3], [1, 2, 4]])  # a fin of three faces at the edge 1-2
    assert side_uses(faces).tolist() == [[1, 3, 1], [3, 1, 1], [3, 1, 1]]


@pytest.mark.parametrize(
    ("change", "closed", "consistent"),
    [
        (lambda faces: faces, True, True),
        (lambda faces: faces[:, ::-1], True, True),
        (lambda faces: faces[1:], False, True),
        (lambda faces: np.concatenate([faces[1:], faces[:1, ::-1]]), True, False),
        (lambda faces: np.concatenate([faces, faces[:1, ::-1]]), False, False),
    ],
)
def test_closed_and_consistent(change, closed: bool, consistent: bool) -> None:
    faces = change(np.array(trimesh.creation.icosphere(1).faces))
    assert (is_closed(faces), is_consistent(faces)) == (closed, consistent)
