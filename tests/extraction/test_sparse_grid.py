"""Points that the grid evaluates: each once, at unrounded coordinates."""

import numpy as np
import pytest
from level_sets import torus

from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.sparse_grid import Grid
from jointsdf.values import BOX


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_no_point_is_evaluated_twice_and_coordinates_are_not_rounded(method: str) -> None:
    seen: list[np.ndarray] = []

    def recorded(points: np.ndarray) -> np.ndarray:
        seen.append(points)
        return torus(points)

    surface = Extraction(64, method).surface(recorded)
    points = np.concatenate(seen)
    assert points.dtype == np.float32
    assert len(points) == round(surface.evaluated * 64**3)
    twice = len(points) - len(np.unique(points, axis=0))
    assert twice <= (0 if method == "dense" else 0.02 * len(points)), "only checks may meet a point again"
    index = (points.astype(np.float64) + BOX) / (2 * BOX / 63)
    assert np.abs(index - np.rint(index)).max() < 63 * 1e-7  # half a float32 unit, in cells


def test_a_repeated_point_is_evaluated_once_and_has_the_value_of_its_place() -> None:
    asked: list[np.ndarray] = []

    def recorded(points: np.ndarray) -> np.ndarray:
        asked.append(points)
        return points @ np.array([1.0, 10.0, 100.0])

    grid = Grid(recorded, 65, 100)
    asked.clear()
    points = np.random.default_rng(0).integers(0, 4, (300, 3)) + np.array([30, 1, 60])
    expected = (points * grid.spacing - BOX) @ np.array([1.0, 10.0, 100.0])
    for _ in range(2):
        np.testing.assert_allclose(grid.evaluate(points), expected, rtol=1e-5)
    on_lattice = (points % grid.stride == 0).all(axis=1) | (points == grid.last).all(axis=1)
    assert len(np.concatenate(asked)) == len(np.unique(points[~on_lattice], axis=0))
