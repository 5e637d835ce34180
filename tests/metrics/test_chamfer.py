"""Chamfer distances against brute force and known gaps."""

import numpy as np
import pytest
from surface_samples import cloud, directions

from jointsdf.metrics.chamfer import Chamfer


def test_distances_equal_brute_force(clouds):
    predicted, truth = clouds
    distances = np.linalg.norm(predicted.points[:, None] - truth.points[None], axis=2)
    to_truth, to_predicted = distances.min(axis=1), distances.min(axis=0)
    found = Chamfer()(predicted, truth)
    assert found["cd_l1"] == pytest.approx(100 * (to_truth.mean() + to_predicted.mean()) / 2, rel=1e-12)
    assert found["cd_l2"] == pytest.approx(100 * ((to_truth**2).mean() + (to_predicted**2).mean()) / 2, rel=1e-12)


def test_parallel_planes_are_their_distance_apart():
    rng = np.random.default_rng(0)
    points = np.c_[rng.random((500, 2)), np.zeros(500)]
    found = Chamfer()(cloud(points + np.array([0, 0, 0.02])), cloud(points))
    assert found["cd_l1"] == pytest.approx(2.0, rel=1e-12)
    assert found["cd_l2"] == pytest.approx(0.04, rel=1e-12)


def test_concentric_spheres_are_their_gap_apart():
    rays = directions(np.random.default_rng(0), 500)
    predicted, truth = cloud(0.45 * rays, normals=-rays), cloud(0.5 * rays, normals=rays)
    assert Chamfer()(predicted, truth)["cd_l1"] == pytest.approx(5.0, rel=1e-9)
