"""Choice of the vertices that move onto creases, and the points where three planes meet."""

import numpy as np
import pytest

from jointsdf.extraction.crease_band import Band
from jointsdf.extraction.crease_snaps import corner_points, independent_set


@pytest.mark.parametrize("seed", range(5))
def test_an_independent_set_is_free_of_conflicts_and_cannot_grow(seed: int) -> None:
    generator = np.random.default_rng(seed)
    conflicts = generator.integers(0, 60, (80, 2))
    conflicts = conflicts[conflicts[:, 0] != conflicts[:, 1]]
    candidate, cost = generator.random(60) < 0.8, generator.random(60)
    chosen = independent_set(candidate, conflicts[candidate[conflicts].all(axis=1)], cost)
    assert not (chosen & ~candidate).any()
    assert not chosen[conflicts].all(axis=1).any()
    beside = np.zeros(60, dtype=bool)
    beside[conflicts[chosen[conflicts].any(axis=1)]] = True
    assert (chosen | beside)[candidate].all()
    assert chosen[np.flatnonzero(candidate)[cost[candidate].argmin()]]


def test_three_planes_meet_in_a_point_and_two_leave_a_line_open() -> None:
    generator = np.random.default_rng(0)
    normals = np.linalg.qr(generator.standard_normal((3, 3)))[0] + 0.2 * generator.standard_normal((3, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.concatenate([normals, normals[:1]])
    meet = np.array([0.1, -0.2, 0.3])
    in_plane = generator.standard_normal((4, 3))
    in_plane -= np.einsum("ij,ij->i", in_plane, normals)[:, None] * normals
    none = np.zeros(4, dtype=bool)
    band = Band(np.arange(4), np.arange(0), np.zeros((0, 3), int), in_plane, normals, meet + in_plane, normals, none)
    start = meet + 0.1
    point, on_line = corner_points(band, np.array([[0, 1, 2], [0, 1, 3]]), np.stack([start, start]), 1.0)
    np.testing.assert_allclose(point, meet, atol=1e-12)
    np.testing.assert_allclose(normals[:2] @ (on_line - meet), 0, atol=1e-12)
    line = np.cross(*normals[:2])
    assert line @ (on_line - start) == pytest.approx(0, abs=1e-12)
