"""Sides of planes by what is free on both of their sides."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from jointsdf.data.free_space import FreeSpace
from jointsdf.data.orientation import orient_planes


class Sheet(FreeSpace):
    """Free space about a flat sheet: outside above it, and below it but for a strip, where it is not known."""

    def __init__(self, points: np.ndarray, strip: float) -> None:
        self.tree, self._strip = KDTree(points), strip

    def sign(self, points: np.ndarray) -> np.ndarray:
        return np.where((points[:, 2] < 0) & (points[:, 0] > self._strip), 0, 1)


@pytest.mark.parametrize("leaky", [False, True])
def test_points_with_free_space_on_both_sides_speak_against_a_side_of_their_group(leaky: bool) -> None:
    places = np.linspace(-0.5, 0.5, 41)
    points = np.stack([*np.meshgrid(places, places), np.zeros((41, 41))], axis=-1).reshape(-1, 3)
    space = Sheet(points, strip=0.4)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    neighbours = space.tree.query(points, 13)[1][:, 1:]
    found = orient_planes(points, space, normals, np.ones(len(points), dtype=bool), neighbours, leaky=leaky)
    beside = points[:, 0] > 0.42
    assert (found[beside] == 1).all()
    assert (found[points[:, 0] < 0.38] == (0 if leaky else 1)).all()
