"""F-score against brute force and a known gap."""

import numpy as np
import pytest
from surface_samples import cloud, directions

from jointsdf.metrics.f_score import FScore


def test_f_score_equals_brute_force(clouds):
    predicted, truth = clouds
    distances = np.linalg.norm(predicted.points[:, None] - truth.points[None], axis=2)
    to_truth, to_predicted = distances.min(axis=1), distances.min(axis=0)
    precision, recall = (to_truth < 0.02).mean(), (to_predicted < 0.02).mean()
    assert 0.1 < precision < 0.9
    assert FScore(threshold=0.02)(predicted, truth)["f1"] == pytest.approx(2 / (1 / precision + 1 / recall))


def test_f_score_of_concentric_spheres_jumps_at_their_gap():
    rays = directions(np.random.default_rng(0), 500)
    predicted, truth = cloud(0.45 * rays, normals=-rays), cloud(0.5 * rays, normals=rays)
    assert FScore(threshold=0.051)(predicted, truth)["f1"] == 1.0
    assert FScore(threshold=0.049)(predicted, truth)["f1"] == 0.0
