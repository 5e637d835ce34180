"""Planes of points on both faces of an edge, on a line, and too few of them."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from jointsdf.data.local_planes import fit_planes


def neighbour_offsets(points: np.ndarray, count: int = 16) -> np.ndarray:
    return points[KDTree(points).query(points, count + 1)[1][:, 1:]] - points[:, None]


def test_neighbours_on_the_other_face_of_an_edge_do_not_tilt_a_plane() -> None:
    floor, wall = np.random.default_rng(0).uniform(0, 1, (2, 3000, 2))
    points = np.concatenate([np.insert(floor, 2, 0, axis=1), np.insert(wall, 0, 0, axis=1)])
    normals, found = fit_planes(neighbour_offsets(points))
    expected = np.repeat([2, 0], 3000)
    near = points[np.arange(6000), 2 - expected] < 0.02  # of the edge: least squares is off by 8 degrees at 94% of them
    cosines = np.abs(normals[np.arange(6000), expected])
    assert near.sum() > 100
    assert found[near].mean() > 0.9
    assert (cosines[near & found] > np.cos(np.radians(1))).mean() > 0.95
    assert (cosines[~near & found] > 1 - 1e-9).mean() > 0.99


@pytest.mark.parametrize("count", [1, 2, 16])
def test_points_on_a_line_have_no_plane(count: int) -> None:
    line = np.linspace(0, 1, 50)[:, None] * np.array([1.0, 2.0, 3.0])
    assert not fit_planes(neighbour_offsets(line, count).reshape(50, count, 3))[1].any()
