"""Fields whose level sets are known, and comparisons of the surfaces extracted from them."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from analytic import box_distance, sphere_distance, torus_distance

from jointsdf.extraction import spot_checks
from jointsdf.extraction.extractor import Surface
from jointsdf.values import BOX

Sdf = Callable[[np.ndarray], np.ndarray]
CELL = 2 * BOX / 127  # at 128 grid points


def without_spot_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no octant for a check."""
    monkeypatch.setattr(spot_checks, "COARSE_SHARE", 0)
    monkeypatch.setattr(spot_checks, "FINE_SHARE", 0)


def ball(centre: tuple[float, float, float], radius: float) -> Sdf:
    return lambda points: sphere_distance(points - np.array(centre), radius)


def drilled_box(points: np.ndarray) -> np.ndarray:
    return np.maximum(box_distance(points, (0.83, 0.61, 0.37)), 0.293 - np.hypot(points[:, 0], points[:, 1]))


def torus(points: np.ndarray) -> np.ndarray:
    return torus_distance(points, 0.61, 0.17)


def far_apart(points: np.ndarray) -> np.ndarray:
    return np.minimum(ball((0.45, 0.5, 0.4), 0.4)(points), ball((-0.71, -0.67, -0.73), 3 * CELL)(points))


def plate(points: np.ndarray) -> np.ndarray:
    return box_distance(points - np.array([0, 0, 0.0071]), (0.8, 0.7, 0.75 * CELL))


def stepped(signed: np.ndarray, high: float, slope: float) -> np.ndarray:
    """A field that is flat but for a band around the zero of another: steep there, and nowhere else."""
    return np.clip(slope * signed, -high, high)


def as_trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def assert_same(sparse: Surface, dense: Surface) -> None:
    np.testing.assert_array_equal(sparse.faces, dense.faces)
    np.testing.assert_allclose(sparse.vertices, dense.vertices, atol=1e-6, rtol=0)
    assert len(dense.faces) > 0
