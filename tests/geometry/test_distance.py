"""Exact distances against analytic shapes and brute force over all triangles."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from solids import labelled

from jointsdf.geometry.distance import AWAY, PIECES, ClosestPoint, ExactDistance, group_by_side, split_long_faces
from jointsdf.values import LabelledMesh

HALF = np.array([0.7, 0.5, 0.3])


def box() -> LabelledMesh:
    return labelled(trimesh.creation.box(extents=2 * HALF))


def uniform(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.1, 1.1, (count, 3))


def segment_distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    along = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
    return np.linalg.norm(points - start - along[:, None] * (end - start), axis=1)


def triangle_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance to one triangle: to its plane over its inside, else to the nearest edge."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    height = (points - corners[0]) @ normal
    edges = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    over = np.all([(points - a) @ np.cross(normal, b - a) >= 0 for a, b in edges], axis=0)
    return np.where(over, np.abs(height), np.min([segment_distance(points, a, b) for a, b in edges], axis=0))


def test_box_is_exact_with_its_sign() -> None:
    points = uniform(5000)
    np.testing.assert_allclose(
        ExactDistance(box(), watertight=True).signed(points), box_distance(points, HALF), atol=1e-12
    )


def test_sphere_is_exact_up_to_the_faceting() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.8)
    points = uniform(5000)
    sagitta = 0.8 - np.linalg.norm(ball.triangles_center, axis=1).min()
    error = ExactDistance(labelled(ball), watertight=True).signed(points) - (np.linalg.norm(points, axis=1) - 0.8)
    assert error.min() > -1e-12  # the polyhedron lies inside the sphere, so no distance is too small
    assert error.max() < sagitta + 1e-12


@pytest.mark.parametrize("watertight", [True, False])
def test_value_and_face_equal_brute_force(watertight: bool) -> None:
    mesh = labelled(trimesh.creation.torus(0.7, 0.25, major_sections=9, minor_sections=6))
    points = uniform(400)
    brute = np.stack([triangle_distance(points, corners) for corners in mesh.vertices[mesh.faces]])
    exact = ExactDistance(mesh, watertight=watertight)
    np.testing.assert_allclose(np.abs(exact.signed(points)), brute.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(brute[exact.closest_face(points), np.arange(400)], brute.min(axis=0), atol=1e-12)
    signed, normals = exact.one_sided(points)
    np.testing.assert_array_equal(signed, exact.signed(points))
    a, b, c = mesh.vertices[mesh.faces[exact.closest_face(points)].T]
    outward = np.cross(b - a, c - a)
    np.testing.assert_allclose(normals, outward / np.linalg.norm(outward, axis=1, keepdims=True), atol=1e-12)


def test_split_faces_cover_the_same_surface_and_know_their_face() -> None:
    mesh = labelled(trimesh.creation.box((2, 1e-3, 0.3)))
    whole = mesh.vertices[mesh.faces]
    pieces, face = split_long_faces(whole, 0.05)
    assert np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2).max() <= 0.05
    areas = [np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2 for t in (pieces, whole)]
    np.testing.assert_allclose(np.bincount(face, areas[0]), areas[1], rtol=1e-12)
    outside = triangle_distance(pieces.reshape(-1, 3)[:900], whole[face[0]])[np.repeat(face == face[0], 3)[:900]]
    np.testing.assert_allclose(outside, 0, atol=1e-12)
    assert len(split_long_faces(whole, 1e-9)[0]) <= PIECES


def test_long_faces_give_the_same_distance_as_brute_force() -> None:
    mesh = labelled(trimesh.creation.cylinder(0.4, 2.0, sections=7))
    points = uniform(400, seed=5)
    brute = np.stack([triangle_distance(points, corners) for corners in mesh.vertices[mesh.faces]])
    distances, faces = ClosestPoint(mesh).query(points)
    assert faces.max() < len(mesh.faces)
    np.testing.assert_allclose(distances, brute.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(brute[faces, np.arange(400)], brute.min(axis=0), atol=1e-12)


def test_winding_sign_agrees_with_the_pseudonormal_on_a_closed_mesh() -> None:
    points = uniform(5000, seed=1)
    by_winding = ExactDistance(box(), watertight=False).signed(points)
    np.testing.assert_allclose(by_winding, box_distance(points, HALF), atol=1e-12)


def test_sign_stays_right_far_from_a_hole() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.8)
    kept = ball.triangles_center[:, 2] < 0.75
    assert 20 < (~kept).sum() < 0.05 * len(kept)
    mesh = LabelledMesh(np.array(ball.vertices), np.array(ball.faces)[kept], np.zeros(kept.sum(), dtype=np.int64))
    points = uniform(20000, seed=2)
    radius = np.linalg.norm(points, axis=1)
    far = (np.abs(radius - 0.8) > 0.005) & (np.linalg.norm(points - [0, 0, 0.8], axis=1) > 0.6)
    signed = ExactDistance(mesh, watertight=False).signed(points[far])
    np.testing.assert_array_equal(signed < 0, radius[far] < 0.8)


def test_frame_and_unit_are_the_meshs() -> None:
    shifted = LabelledMesh(box().vertices * 250 + [1e4, -3e4, 5e3], box().faces, box().labels)
    points = uniform(500)
    signed = ExactDistance(shifted, watertight=True).signed(points * 250 + [1e4, -3e4, 5e3])
    np.testing.assert_allclose(signed, 250 * box_distance(points, HALF), atol=1e-7)


@pytest.mark.parametrize("watertight", [True, False])
def test_every_point_has_its_own_answer_in_any_company(watertight: bool) -> None:
    points = uniform(1000)
    exact = ExactDistance(box(), watertight=watertight)
    signed, faces = exact.signed(points), exact.closest_face(points)
    some = np.random.default_rng(0).permutation(1000)[:300]
    np.testing.assert_array_equal(exact.signed(points[some]), signed[some])
    np.testing.assert_array_equal(exact.closest_face(points[some]), faces[some])
    same = np.repeat(points[:1], 5, axis=0)
    np.testing.assert_array_equal(exact.signed(same), signed[:1].repeat(5))


@pytest.mark.parametrize("watertight", [True, False])
def test_no_points_and_float32_points(watertight: bool) -> None:
    exact = ExactDistance(box(), watertight=watertight)
    assert exact.signed(np.zeros((0, 3))).shape == (0,)
    assert exact.closest_face(np.zeros((0, 3))).shape == (0,)
    points = uniform(50).astype(np.float32)
    assert exact.signed(points).dtype == np.float64
    np.testing.assert_allclose(exact.signed(points), box_distance(points.astype(np.float64), HALF), atol=1e-12)


def test_a_fold_does_not_turn_the_space_that_it_is_nearest_to() -> None:
    """A small body inside out beside a box: the pseudonormal alone takes half of the outside for inside."""
    box, inverted = trimesh.creation.box((2, 2, 2)), trimesh.creation.icosphere(1, 0.01)
    inverted.apply_translation((1.3, 0, 0))
    inverted.invert()
    both = trimesh.util.concatenate([box, inverted])
    mesh = labelled(both)
    exact = ExactDistance(mesh, watertight=True)
    points = np.random.default_rng(0).uniform(-2, 2, (20000, 3))
    beyond = np.abs(points).max(axis=1) - 1
    found = exact.signed(points)
    far = np.abs(found) > AWAY * 2.31  # the longest side
    np.testing.assert_array_equal(found[far] > 0, beyond[far] > 0)
    nearest_to_the_fold = np.linalg.norm(points - (1.3, 0, 0), axis=1) < np.maximum(beyond, 0)
    assert nearest_to_the_fold.mean() > 0.005
    assert (exact.signed(points[nearest_to_the_fold]) > 0).all()  # whoever is asked along with them
    around = np.random.default_rng(1).normal((1.3, 0, 0), 0.02, (20000, 3))
    outside = np.linalg.norm(around - (1.3, 0, 0), axis=1) > 0.01 + 2 * AWAY * 2.31
    close = np.concatenate([points, around[outside]])
    assert (exact.signed(close)[len(points) :] > 0).all()  # the fold is known from afar, and signs agree close to it


def test_points_that_no_surface_separates_are_one_group() -> None:
    line = np.stack([np.linspace(-1, 1, 40), np.zeros(40), np.zeros(40)], axis=1)
    deepest, group = group_by_side(line, np.abs(line[:, 0]))  # the surface is the plane x = 0
    assert sorted(deepest.tolist()) == [0, 39]
    np.testing.assert_array_equal(group == group[0], line[:, 0] < 0)
    deepest, group = group_by_side(line[:1], np.ones(1))
    assert (deepest.tolist(), group.tolist()) == ([0], [0])


def test_folded_bodies_that_overlap_are_inside_of_either() -> None:
    other = HALF * (1.0, 0.4, 1.0) + (0.0, 0.3, 0.1)
    both = trimesh.util.concatenate([trimesh.creation.box(extents=2 * HALF), trimesh.creation.box(extents=2 * other)])
    points = uniform(5000)
    inside = (np.abs(points) < HALF).all(axis=1) | (np.abs(points) < other).all(axis=1)
    signed = ExactDistance(labelled(both), watertight=True, folded=True).signed(points)
    np.testing.assert_array_equal(signed < 0, inside)
    nearest = np.minimum(*(np.abs(box_distance(points, half)) for half in (HALF, other)))
    np.testing.assert_allclose(np.abs(signed), nearest, atol=1e-9)
