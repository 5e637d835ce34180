"""First hits of rays with shapes of known distance."""

import numpy as np
import trimesh

from jointsdf.geometry.rays import ray_hits, ray_lengths, successive_hits

BOX = trimesh.creation.box((1.0, 0.6, 0.4))
HALF = np.array([0.5, 0.3, 0.2])


def directions(count: int, seed: int = 0) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_rays_from_inside_a_box_meet_its_nearest_side() -> None:
    origins, ways = np.random.default_rng(1).uniform(-0.9, 0.9, (500, 3)) * HALF, directions(500)
    to_sides = (np.sign(ways) * HALF - origins) / ways
    lengths, faces = ray_hits(np.array(BOX.triangles), origins, ways)
    np.testing.assert_allclose(lengths, to_sides.min(axis=1), rtol=1e-4, atol=1e-6)
    axis = np.abs(BOX.face_normals[faces]).argmax(axis=1)
    np.testing.assert_array_equal(axis, to_sides.argmin(axis=1))
    outward = np.einsum("nd,nd->n", BOX.face_normals[faces], ways)
    assert (outward > 0).all()


def test_rays_towards_a_sphere_meet_it_where_the_quadratic_says() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    origins, ways = 0.9 * directions(1000, seed=2), directions(1000, seed=3)
    along = -np.einsum("nd,nd->n", origins, ways)
    apart = np.linalg.norm(origins + along[:, None] * ways, axis=1)
    clear = np.abs(apart - 0.5) > 0.02  # not beside the silhouette, where facets decide
    hits = (apart < 0.5) & (along > 0)
    lengths, faces = ray_hits(np.array(ball.triangles), origins, ways)
    np.testing.assert_array_equal(np.isfinite(lengths[clear]), hits[clear])
    np.testing.assert_array_equal(faces[clear] >= 0, hits[clear])
    met = clear & hits
    assert met.sum() > 50
    expected = along[met] - np.sqrt(0.25 - apart[met] ** 2)
    np.testing.assert_allclose(lengths[met], expected, atol=4e-3)


def test_the_first_of_several_faces_is_met_from_either_side() -> None:
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    corners = np.stack([square + np.array([0, 0, height]) for height in (0.0, 0.25, 1.0)])
    origins = np.array([[0.0, 0, 2], [0, 0, 0.5], [0, 0, 0.5], [0, 0, -1]])
    ways = np.array([[0.0, 0, -1], [0, 0, -1], [0, 0, 1], [0, 0, 1]])
    lengths, faces = ray_hits(corners, origins, ways)
    assert faces.tolist() == [2, 1, 2, 0]
    assert lengths.tolist() == [1.0, 0.25, 0.5, 1.0]


def test_a_miss_is_infinite_and_has_no_face() -> None:
    lengths, faces = ray_hits(np.array(BOX.triangles), np.array([[2.0, 0, 0]]), np.array([[1.0, 0, 0]]))
    assert (lengths.tolist(), faces.tolist()) == ([np.inf], [-1])
    assert lengths.dtype == np.float64


def test_lengths_alone_are_those_of_the_hits() -> None:
    origins, ways = directions(100, seed=4), directions(100, seed=5)
    both = ray_hits(np.array(BOX.triangles), origins, ways)
    np.testing.assert_array_equal(ray_lengths(np.array(BOX.triangles), origins, ways), both[0])
    assert 0 < np.isfinite(both[0]).sum() < 100


def test_rays_are_followed_through_every_shell_up_to_their_reach() -> None:
    shells = [trimesh.creation.icosphere(4, radius) for radius in (0.1, 0.2, 0.3, 0.4)]
    corners = np.concatenate([np.array(shell.triangles) for shell in shells])
    ways, reach = directions(400, seed=4), np.repeat([0.05, 0.25, 0.35, np.inf], 100)
    rounds = list(successive_hits(corners, np.zeros((400, 3)), ways, reach))
    met = np.full((400, 4), -1)
    for turn, (rays, faces) in enumerate(rounds):
        met[rays, turn] = faces // len(shells[0].faces)
    expected = np.where(np.arange(4) < np.repeat([0, 2, 3, 4], 100)[:, None], np.arange(4), -1)
    np.testing.assert_array_equal(met, expected)
