"""Noise, outliers and rims of clouds whose surface is known."""

import numpy as np
import pytest
import trimesh
from clouds import cloud_of
from scipy.spatial import KDTree

from jointsdf.geometry.cloud_statistics import count_rims, estimate_noise, mark_outliers

SOLIDS = {
    "sphere": trimesh.creation.icosphere(5, 0.7),
    "box": trimesh.creation.box((2, 1.5, 1)),
    "plate": trimesh.creation.box((2, 2, 0.1)),
    "cylinder": trimesh.creation.cylinder(0.4, 2, sections=96),
}


def sphere(count: int, noise: float, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points + generator.normal(0, noise, (count, 3))


def box(count: int, noise: float) -> np.ndarray:
    generator = np.random.default_rng(0)
    points = generator.uniform(-1, 1, (count, 3))
    points[np.arange(count), generator.integers(3, size=count)] = generator.choice([-1.0, 1.0], count)
    return points + generator.normal(0, noise, (count, 3))


@pytest.mark.parametrize("noise", [0.002, 0.01, 0.02])
@pytest.mark.parametrize("make", [sphere, box])
def test_noise_is_found_across_curved_and_creased_surfaces(make, noise: float) -> None:
    points = make(20000, noise)
    found = estimate_noise(points, np.arange(0, 20000, 40), KDTree(points))
    assert found == pytest.approx(noise, rel=0.15)


@pytest.mark.parametrize(("make", "most"), [(sphere, 2e-5), (box, 0.0)])
def test_without_noise_next_to_none_is_found(make, most: float) -> None:
    points = make(20000, 0.0)
    assert estimate_noise(points, np.arange(0, 20000, 40), KDTree(points)) <= most * 2


@pytest.mark.parametrize("noise", [0.001, 0.004, 0.012])
@pytest.mark.parametrize("solid", SOLIDS)
def test_noise_of_solids_is_found(solid: str, noise: float) -> None:
    points = cloud_of(SOLIDS[solid], 8000).points
    noisy = points + noise * np.random.default_rng(1).standard_normal(points.shape)
    assert estimate_noise(noisy, np.arange(0, 8000, 4), KDTree(noisy)) == pytest.approx(noise, rel=0.15)


@pytest.mark.parametrize(
    ("solid", "count"), [*((name, 8000) for name in SOLIDS), ("sphere", 1500), ("box", 1500), ("cylinder", 1500)]
)
def test_an_exact_cloud_has_next_to_none(solid: str, count: int) -> None:
    """Not even where it is sparse, and neighbourhoods reach over edges; but for plates thinner than its gaps."""
    points = cloud_of(SOLIDS[solid], count).points
    tree = KDTree(points)
    assert estimate_noise(points, np.arange(count), tree) < 0.01 * np.median(tree.query(points, [17])[0])


@pytest.mark.parametrize("count", [5, 20])
def test_a_few_points_have_finite_noise(count: int) -> None:
    points = np.random.default_rng(0).random((count, 3))
    assert np.isfinite(estimate_noise(points, np.arange(count), KDTree(points)))


def test_sparse_regions_of_a_cloud_are_no_outliers() -> None:
    """The density falls tenfold from one end to the other."""
    points, generator = cloud_of(SOLIDS["box"], 20_000).points, np.random.default_rng(2)
    along = (points[:, 0] - points[:, 0].min()) / np.ptp(points[:, 0])
    points = points[generator.random(len(points)) < 0.1**along]
    every = np.concatenate([points, generator.uniform(-1.1, 1.1, (80, 3))])
    marks = mark_outliers(KDTree(every).query(every, [9])[0][:, 0])
    assert marks[: len(points)].mean() < 0.002
    away = KDTree(points).query(every)[0] > 0.3
    assert away.sum() > 20
    assert marks[away].all()


def test_noise_scales_with_the_cloud() -> None:
    points, asked = sphere(3000, 0.01), np.arange(300)
    one, large = (estimate_noise(scale * points, asked, KDTree(scale * points)) for scale in (1.0, 1000.0))
    assert large == pytest.approx(1000 * one, rel=1e-6)


def test_points_that_are_alone_are_outliers() -> None:
    points = np.concatenate([sphere(5000, 0.0), np.random.default_rng(1).uniform(-3, 3, (50, 3))])
    away = np.abs(np.linalg.norm(points, axis=1) - 1) > 0.4
    marked = mark_outliers(KDTree(points).query(points, [9])[0][:, 0])
    assert marked[away].all()
    assert marked[:5000].mean() < 0.001


def test_rims_are_those_of_the_holes() -> None:
    points = sphere(20000, 0.0)
    reach = 0.2
    assert count_rims(points, KDTree(points), reach) == (0, 0)
    for axes, holes in (((2,), 1), ((0, 2), 2), ((0, 1, 2), 3)):
        open_ = points[(points[:, axes] < 0.9).all(axis=1)]
        rims, at_rims = count_rims(open_, KDTree(open_), reach)
        assert rims == holes
        at = open_[np.max(open_[:, axes], axis=1) > 0.88]
        assert 0 < at_rims < 1.2 * len(at)
