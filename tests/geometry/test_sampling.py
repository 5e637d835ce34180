"""Random points on meshes: on the surface, in the shares of the areas, at every distance from the borders."""

import numpy as np
import pytest
import trimesh
from scipy.stats import chisquare, kstest
from solids import distance_to_halves, halves, labelled

from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.sampling import BESIDE, sample_beside_creases, sample_by_area, sample_near_borders


def test_sampling_by_area_meets_faces_in_proportion_to_their_area() -> None:
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(30, 3))
    faces = rng.permutation(30).reshape(10, 3)
    faces = np.concatenate([faces, [[4, 4, 9]]])  # a face without area is never met
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    _, chosen = sample_by_area(vertices, faces, areas, 20000, np.random.default_rng(0))
    counts = np.bincount(chosen, minlength=11)
    assert counts[10] == 0
    assert chisquare(counts[:10], 20000 * areas[:10] / areas.sum()).pvalue > 0.01


def test_sampling_by_area_fills_a_triangle_evenly() -> None:
    vertices = np.array([[0.0, 0, 0], [2.0, 0, 0], [0, 3.0, 0]])
    points, _ = sample_by_area(vertices, np.array([[0, 1, 2]]), np.ones(1), 20000, np.random.default_rng(0))
    s, t = points[:, 0] / 2, points[:, 1] / 3
    assert (points[:, 2] == 0).all()
    assert s.min() >= 0
    assert t.min() >= 0
    assert (s + t).max() <= 1 + 1e-12
    quarter = np.select([s > 0.5, t > 0.5, s + t < 0.5], [0, 1, 2], 3)  # the four congruent triangles
    assert chisquare(np.bincount(quarter)).pvalue > 0.01
    assert kstest(s, lambda x: 1 - (1 - np.clip(x, 0, 1)) ** 2).pvalue > 0.01


def test_points_near_borders_lie_on_the_surface_with_the_label_of_their_side() -> None:
    mesh = halves()
    points, faces = sample_near_borders(mesh, 5000, np.random.default_rng(0))
    np.testing.assert_allclose(distance_to_halves(points), 0, atol=1e-12)
    clear = np.abs(points[:, 0] - 0.5) > 1e-9
    np.testing.assert_array_equal(mesh.labels[faces][clear], np.where(points[:, 0] > 0.5, 4, 9)[clear])


def test_points_near_borders_meet_every_distance_and_both_sides_alike() -> None:
    points, _ = sample_near_borders(halves(), 20000, np.random.default_rng(0))
    offset = points[:, 0] - 0.5  # the border is the square x = 0.5
    assert (offset > 0).mean() == pytest.approx(0.5, abs=0.02)
    for low, high in ((0, 1e-3), (1e-3, 1e-2), (1e-2, 0.1)):  # half the longest side is 2
        assert ((np.abs(offset) >= low) & (np.abs(offset) < high)).mean() > 0.1, (low, high)
    assert np.abs(offset).max() == pytest.approx(0.4, abs=0.15)  # four times the widest noise
    sides = np.abs(points[:, 1:]).argmax(axis=1)
    assert sides.mean() == pytest.approx(0.5, abs=0.02)  # uniform along the border


def test_without_borders_there_are_no_points_near_them() -> None:
    for mesh in (halves((4, 4)), halves((4, -1))):
        assert [len(values) for values in sample_near_borders(mesh, 100, np.random.default_rng(0))] == [0, 0]


def test_points_beside_creases_are_uniform_along_them_at_every_distance_and_on_both_sides_alike() -> None:
    mesh = halves()  # sides 4, 2, 2 about (0.5, 0, 0)
    points, faces = sample_beside_creases(mesh, 20000, np.random.default_rng(0))
    assert len(points) == 20000
    np.testing.assert_allclose(distance_to_halves(points), 0, atol=1e-12)
    normals = face_normals(mesh.vertices, mesh.faces)[faces]
    inward = np.sort([2, 1, 1] - np.abs(points - [0.5, 0, 0]), axis=1)  # distances to the planes, own side first
    np.testing.assert_allclose(inward[:, 0], 0, atol=1e-12)
    assert kstest(inward[:, 1] / 2, "uniform", (BESIDE[0], BESIDE[1] - BESIDE[0])).pvalue > 0.01
    side = np.abs(normals).argmax(axis=1)
    other = np.where(np.arange(3) == side[:, None], np.inf, [2, 1, 1] - np.abs(points - [0.5, 0, 0])).argmin(axis=1)
    counts = np.zeros((3, 3))
    np.add.at(counts, (side, other), 1)  # of points on a side, by the side beyond the crease
    lengths = np.array([[0, 1, 1], [1, 0, 2], [1, 2, 0]]) / 8
    np.testing.assert_allclose(counts / 20000, lengths, atol=0.01)


def test_points_beside_creases_of_a_thin_plate_stay_on_their_side_and_a_ball_has_none() -> None:
    plate = labelled(trimesh.creation.box((2, 2, 0.006)))  # its rim is narrower than most distances
    points, faces = sample_beside_creases(plate, 3000, np.random.default_rng(0))
    np.testing.assert_allclose(np.abs(points[:, 2]).max(), 0.003, atol=1e-12)
    normals = face_normals(plate.vertices, plate.faces)[faces]
    np.testing.assert_allclose(np.abs(points * normals).max(axis=1), np.abs(normals) @ [1, 1, 0.003], atol=1e-9)
    rim = np.abs(normals[:, 2]) < 0.5
    assert 0.2 < rim.mean() < 0.5 < len(points) / 3000 < 0.9
    ball = labelled(trimesh.creation.icosphere(4))
    assert [len(found) for found in sample_beside_creases(ball, 100, np.random.default_rng(0))] == [0, 0]
