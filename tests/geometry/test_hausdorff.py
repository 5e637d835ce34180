"""Certified one-sided distances: against closed forms, and against many points on the faces."""

import numpy as np
import pytest
import trimesh

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.hausdorff import faces_beyond
from jointsdf.values import LabelledMesh


def grid(count: int, height: float = 0.0) -> LabelledMesh:
    """The unit square, cut into `count` squared times two triangles."""
    axis = np.linspace(0, 1, count + 1)
    vertices = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.full((count + 1,) * 2, height)], axis=-1)
    corner = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return LabelledMesh(vertices.reshape(-1, 3), faces, np.zeros(len(faces), dtype=np.int64))


@pytest.mark.parametrize(("mine", "others"), [(1, 7), (7, 1), (5, 7), (1, 1)])
def test_parallel_squares_are_their_distance_apart(mine: int, others: int) -> None:
    here, other = grid(mine), ClosestPoint(grid(others, 0.01))
    assert not faces_beyond(here.vertices, here.faces, other, 0.01 + 1e-12).any()
    assert faces_beyond(here.vertices, here.faces, other, 0.01 - 1e-12).all()


def test_one_raised_vertex_is_found_from_both_sides() -> None:
    flat, bumpy = grid(1), grid(8)
    at = int(np.argmin(np.linalg.norm(bumpy.vertices - [0.375, 0.625, 0], axis=1)))
    bumpy.vertices[at, 2] = 0.02
    found = faces_beyond(bumpy.vertices, bumpy.faces, ClosestPoint(flat), 0.0199)
    np.testing.assert_array_equal(found, (bumpy.faces == at).any(axis=1))
    # from the flat side the bump is as far as the foot of its apex from its steepest slope
    away = 0.02 / np.sqrt(1 + (0.02 / 0.125) ** 2 * 2)
    assert not faces_beyond(flat.vertices, flat.faces, ClosestPoint(bumpy), 0.02).any()
    assert faces_beyond(flat.vertices, flat.faces, ClosestPoint(bumpy), 0.99 * away).tolist() == [False, True]


@pytest.mark.parametrize("seed", range(3))
def test_many_points_on_the_faces_agree(seed: int) -> None:
    """A face that is not found has no point beyond the bound; one that is found has one near it, at the bound."""
    rng = np.random.default_rng(seed)
    one, other = trimesh.creation.icosphere(1), trimesh.creation.icosphere(2)
    vertices = np.array(one.vertices) * rng.uniform(0.95, 1.05, (len(one.vertices), 1))
    target = LabelledMesh(np.array(other.vertices), np.array(other.faces), np.zeros(len(other.faces), dtype=np.int64))
    cuts = 12
    weights = np.array([(i, j, cuts - i - j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]) / cuts
    points = np.einsum("pk,fkd->fpd", weights, vertices[one.faces])
    farthest = np.array([all_pairs(np.array(other.triangles), each).max() for each in points])
    bound = float(np.median(farthest))
    found = faces_beyond(vertices, np.array(one.faces), ClosestPoint(target), bound)
    gap = np.linalg.norm(np.diff(vertices[one.faces], axis=1), axis=2).max() / cuts  # from these points, at most
    assert found[farthest > bound].all()
    assert (farthest[found] > bound - gap).all()
    assert 20 < found.sum() < 60


def all_pairs(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of each point from the nearest triangle, by trimesh, every one tried."""
    pairs = np.repeat(triangles, len(points), axis=0), np.tile(points, (len(triangles), 1))
    closest = trimesh.triangles.closest_point(*pairs).reshape(len(triangles), len(points), 3)
    return np.linalg.norm(closest - points, axis=2).min(axis=0)
