"""Label consistency against a loop."""

import math

import numpy as np
import pytest
from surface_samples import cloud

from jointsdf.metrics.consistency import Consistency


def test_consistency_equals_a_loop():
    rng = np.random.default_rng(3)
    points, labels = rng.random((400, 3)), rng.integers(0, 3, 400)
    samples = cloud(points, labels)
    shares = []
    for i in range(400):
        order = np.argsort(((points - points[i]) ** 2).sum(axis=1), kind="stable")
        near = [j for j in order if j != i][:10]
        shares.append(np.mean(labels[near] == labels[i]))
    assert Consistency()(samples, samples)["consistency"] == pytest.approx(np.mean(shares), rel=1e-12)


def test_consistency_of_a_subset_of_anchors_is_seeded():
    rng = np.random.default_rng(3)
    samples = cloud(rng.random((400, 3)), rng.integers(0, 3, 400))
    first, again, other = (Consistency(anchors=50, seed=s)(samples, samples)["consistency"] for s in (0, 0, 1))
    assert first == again != other


def test_anchor_is_never_its_own_neighbour():
    # Ties hide which entry is the anchor: of 30 points in one place, it may not be among its own 10 nearest.
    places, labels = np.repeat([[0.0, 0, 0], [1, 0, 0]], [30, 10], axis=0), np.r_[np.full(30, 50), np.arange(10)]
    mixed = cloud(places, labels)
    assert Consistency(neighbours=9)(mixed, mixed)["consistency"] == 0.75
    distinct = cloud(np.zeros((5, 3)), np.arange(5))
    assert Consistency(neighbours=2)(distinct, distinct)["consistency"] == 0.0


def test_consistency_leaves_unlabelled_samples_out():
    points = np.c_[np.arange(6.0), np.zeros((6, 2))]
    samples = cloud(points, [0, -1, 0, -1, 1, 1])
    assert Consistency(neighbours=1)(samples, samples)["consistency"] == 1.0


def test_consistency_of_few_samples():
    two = cloud(np.eye(3)[:2], [0, 1])
    assert Consistency()(two, two)["consistency"] == 0.0
    one = cloud([[0, 0, 0]], [0])
    assert math.isnan(Consistency()(one, one)["consistency"])
