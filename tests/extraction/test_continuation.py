"""Surfaces found by sign changes and tracked, where neither slopes nor checks find them."""

import numpy as np
import pytest
from level_sets import CELL, as_trimesh, assert_same, ball, without_spot_checks
from scipy.spatial import KDTree

from jointsdf.extraction.extractor import Extraction
from jointsdf.values import BOX

TURN = np.linspace(0, 1, 400)
WIRE = KDTree(np.stack([0.8 * np.cos(9 * TURN), 0.8 * np.sin(9 * TURN), 1.7 * TURN - 0.8], axis=1))


def truncated_tube(points: np.ndarray) -> np.ndarray:
    """A ball with a helical wire 2 cells thick, cut off at +-0.4 cells: the coarse grid misses most of the wire."""
    nearest = WIRE.query(points)[0]
    return np.clip(np.minimum(nearest - CELL, ball((0.8, 0, -0.8), 0.2)(points)), -0.4 * CELL, 0.4 * CELL)


def test_surface_is_tracked_where_the_coarse_grid_sees_no_slope() -> None:
    sparse = Extraction(128, "sparse").surface(truncated_tube)
    assert_same(sparse, Extraction(128, "dense").surface(truncated_tube))
    assert sparse.evaluated < 0.1


@pytest.mark.parametrize(("resolution", "stride"), [(128, 4), (190, 8), (400, 16)])
def test_every_ball_around_a_point_of_the_coarse_lattice_is_found(
    resolution: int, stride: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Radius 1.5 cells, amid a flat field: neither slopes nor interpolation show them, and no check is made."""
    cell = 2 * BOX / (resolution - 1)
    lines = stride * np.arange(3, resolution // stride - 3, 6)
    centres = np.stack(np.meshgrid(lines, lines, lines), axis=-1).reshape(-1, 3) * cell - BOX
    tree = KDTree(centres)
    without_spot_checks(monkeypatch)
    surface = Extraction(resolution).surface(lambda points: np.clip(tree.query(points)[0] / cell - 1.5, -0.2, 0.5))
    mesh = as_trimesh(surface)
    assert mesh.body_count == len(centres) >= 8
    assert mesh.is_watertight
    assert surface.evaluated < 0.08
