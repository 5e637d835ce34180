"""Creases told from roundings: boxes whose edges are rounded by a radius, and a crease that a field blurs."""

from collections.abc import Callable

import numpy as np
import pytest
from analytic import box_distance
from scipy.spatial.transform import Rotation

from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.sharpening import SharpMesh, sharpen
from jointsdf.values import BOX

RESOLUTION = 72
CELL = 2 * BOX / (RESOLUTION - 1)
TURN = Rotation.from_euler("xyz", [0.31, 0.77, 0.23]).as_matrix()
SIDES = np.array([0.62, 0.47, 0.35])


def rounded_box(points: np.ndarray, radius: float) -> np.ndarray:
    """The distance to a box whose edges are rounded."""
    return box_distance(points @ TURN, tuple(SIDES - radius)) - radius


def chamfered_box(points: np.ndarray, width: float) -> np.ndarray:
    """A box whose edges along z are cut off at 45 degrees; the cut has this width."""
    local = np.abs(points @ TURN) - SIDES
    cut = (local[:, 0] + local[:, 1]) / np.sqrt(2) + width / 2
    return np.maximum(local.max(axis=1), cut)


def sharpened(sdf: Callable[[np.ndarray], np.ndarray]) -> SharpMesh:
    def differential(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        gradients = [(sdf(points + step) - sdf(points - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
        return sdf(points), np.stack(gradients, axis=1)

    surface = Extraction(RESOLUTION).surface(sdf)
    return sharpen(surface.vertices, surface.faces, differential, CELL)


@pytest.mark.parametrize("cells", [4.0, 6.0])
def test_roundings_of_four_cells_and_more_stay(cells: float) -> None:
    mesh = sharpened(lambda points: rounded_box(points, cells * CELL))
    assert not mesh.on_crease.any()


@pytest.mark.parametrize("cells", [0.25, 0.5])
def test_roundings_of_half_a_cell_are_creases_that_the_field_has_blurred(cells: float) -> None:
    mesh = sharpened(lambda points: rounded_box(points, cells * CELL))
    off = np.sort(np.abs(np.abs(mesh.vertices[mesh.on_crease] @ TURN) - SIDES), axis=1)[:, 1]
    assert np.quantile(off, 0.95) < 0.02 * CELL
    assert mesh.on_crease.sum() > 2 * 8 * SIDES.sum() / CELL / 2


def test_a_chamfer_of_three_cells_has_a_crease_on_either_side() -> None:
    mesh = sharpened(lambda points: chamfered_box(points, 3 * CELL))
    local = np.abs(mesh.vertices[mesh.on_crease] @ TURN) - SIDES
    cut = (local[:, 0] + local[:, 1]) / np.sqrt(2) + 1.5 * CELL
    side = np.sort(np.abs(np.concatenate([local, cut[:, None]], axis=1)), axis=1)[:, 1]  # 0 where two surfaces meet
    assert np.quantile(side, 0.95) < 0.02 * CELL
    on_cut = np.abs(cut) < 0.02 * CELL
    assert np.count_nonzero(on_cut & (np.abs(local[:, 0]) < 0.02 * CELL)) > 2 * SIDES[2] / CELL
    assert np.count_nonzero(on_cut & (np.abs(local[:, 1]) < 0.02 * CELL)) > 2 * SIDES[2] / CELL
