"""Labels against the closest true face."""

import numpy as np
import pytest
from sklearn.metrics import accuracy_score, jaccard_score
from surface_samples import cube, score

from jointsdf.evaluation.protocol import sample_surface
from jointsdf.metrics.exact_labels import ExactLabels


def test_half_of_the_faces_mislabelled_gives_their_share_of_the_samples():
    truth = cube(labels=np.arange(12) // 2)
    wrong = truth.labels.copy()
    wrong[::2] = (wrong[::2] + 1) % 6
    samples = sample_surface(cube(labels=wrong), 5000, 1)
    found = ExactLabels()(samples, sample_surface(truth, 50, 2))
    true = truth.labels[samples.faces]
    assert found["acc_exact"] == accuracy_score(true, samples.labels)
    assert found["acc_exact"] == pytest.approx(0.5, abs=0.03)
    assert found["miou_exact"] == pytest.approx(jaccard_score(true, samples.labels, average="macro"))


def test_exact_labels_ignore_unlabelled_faces_and_score_a_missed_part_zero():
    truth = cube(labels=np.r_[np.full(6, -1), np.full(4, 2), [8, 8]])
    assert score(ExactLabels(), cube(labels=truth.labels), truth) == {"miou_exact": 1.0, "acc_exact": 1.0}
    only_two = score(ExactLabels(), cube(labels=np.full(12, 2)), truth, count=20_000)
    assert only_two["acc_exact"] == pytest.approx(2 / 3, abs=0.02)
    assert only_two["miou_exact"] == pytest.approx(1 / 3, abs=0.01)
