"""Fields that are steep where the coarse lattice is not: found by checks, and only by them."""

import numpy as np
import pytest
from analytic import box_distance
from level_sets import CELL, Sdf, as_trimesh, assert_same, ball, stepped, without_spot_checks
from scipy.spatial import KDTree

from jointsdf.extraction import active_cells
from jointsdf.extraction.blocks import PrunedBlocks, SignChanges
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.pruning import Bounds
from jointsdf.extraction.sparse_grid import Grid
from jointsdf.extraction.spot_checks import spot_check
from jointsdf.values import BOX


def far_sheet(points: np.ndarray) -> np.ndarray:
    """A ball, and far from it a closed sheet 1.5 cells thick between two planes of the coarse lattice."""
    sheet = box_distance(points - (np.array([0, 0, 102 * CELL - BOX])), (0.9, 0.9, 0.75 * CELL))
    return np.minimum(ball((0, 0, -0.5), 0.3)(points), stepped(sheet, 0.2, 10))


def floater(points: np.ndarray) -> np.ndarray:
    """A ball, and far from it one of radius 1.5 cells amid eight points of the coarse lattice, 20 times steeper."""
    small = ball(tuple(np.array([98, 98, 106]) * CELL - BOX), 1.5 * CELL)(points)
    return np.minimum(ball((-0.3, -0.3, -0.5), 0.3)(points), stepped(small, 0.6, 20))


def steep_noise(points: np.ndarray) -> np.ndarray:
    """A ball, and a far region where a wave shorter than the coarse lattice reaches below zero here and there."""
    waves = np.prod(np.sin(points * np.array([97.0, 89.0, 83.0])), axis=1)
    envelope = np.exp(-((points - 0.6) ** 2).sum(axis=1) / 0.1)
    return ball((-0.3, -0.3, -0.5), 0.4)(points) - 2.0 * envelope * waves


@pytest.mark.parametrize("sdf", [far_sheet, floater, steep_noise], ids=lambda sdf: sdf.__name__)
def test_checks_find_what_the_slope_between_lattice_points_does_not_show(
    sdf: Sdf, monkeypatch: pytest.MonkeyPatch
) -> None:
    dense = Extraction(128, "dense").surface(sdf)
    assert as_trimesh(dense).body_count > 1
    sparse = Extraction(128).surface(sdf)
    assert_same(sparse, dense)
    assert sparse.evaluated < 0.5
    without_spot_checks(monkeypatch)
    assert len(Extraction(128).surface(sdf).faces) < len(dense.faces), "no test of the checks: found without them"


def test_a_failed_check_reopens_what_a_misleading_interpolation_pruned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pockets of one grid point each above a plane, all between the points of halved blocks: only checks see them."""
    odd = np.arange(17, 112, 2)
    centres = np.array([(x, y, 65) for x in odd for y in odd]) * CELL - BOX
    tree = KDTree(centres)

    def sdf(points: np.ndarray) -> np.ndarray:
        return points[:, 2] - 3 * CELL * np.maximum(0, 1 - tree.query(points)[0] / (0.9 * CELL))

    def pockets() -> int:
        return int(as_trimesh(Extraction(128).surface(sdf)).body_count) - 1

    found = pockets()
    without_spot_checks(monkeypatch)
    assert pockets() == 0, "no test of the checks: found without them"
    assert found > len(centres) / 3


def test_components_that_a_check_met_are_in_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Floaters of radius 2 cells, between the points of a lattice of 8: a check finds some of them, by chance."""
    cell = 2 * BOX / 189
    lines = 8 * np.arange(2, 22, 2) + 4
    centres = np.stack(np.meshgrid(lines, lines, lines), axis=-1).reshape(-1, 3) * cell - BOX
    tree, met = KDTree(centres), []

    def sdf(points: np.ndarray) -> np.ndarray:
        return np.clip(5 * (tree.query(points)[0] / cell - 2), -0.2, 0.5)

    def recorded(grid: Grid, pruned: dict[int, PrunedBlocks], rng: np.random.Generator) -> tuple[Bounds, SignChanges]:
        observed, changes = spot_check(grid, pruned, rng)
        met.extend(tree.query(changes.second * grid.spacing - BOX)[1])
        return observed, changes

    monkeypatch.setattr(active_cells, "spot_check", recorded)
    mesh = as_trimesh(Extraction(190).surface(sdf))
    assert len(centres) / 20 < len(set(met)) < len(centres)
    bodies = tree.query(np.array([part.centroid for part in mesh.split(only_watertight=False)]))[1]
    assert set(met) <= set(bodies)
    assert len(bodies) == len(set(bodies))


def test_most_tiny_floaters_at_random_places_are_found() -> None:
    """Radius 1.8 cells, within a flank of 1.1 cells: about as small and steep as a field on this grid can be."""
    found = 0
    for seed in range(12):
        centre = np.random.default_rng(seed).uniform(0.1, 0.9, 3)

        def sdf(points: np.ndarray, centre: np.ndarray = centre) -> np.ndarray:
            small = stepped(ball(tuple(centre), 1.8 * 2 * BOX / 63)(points), 0.6, 15)
            return np.minimum(ball((-0.4, -0.4, -0.4), 0.3)(points), small)

        found += as_trimesh(Extraction(64).surface(sdf)).body_count == 2
    assert found >= 10
