"""Wrong labels stand alone among their neighbours; right ones near borders and of small parts do not."""

import numpy as np
import pytest

from jointsdf.data.label_noise import doubtful_labels
from jointsdf.data.point_cloud import stream

POINTS = np.append(stream(0, 1).random((20_000, 2)), np.zeros((20_000, 1)), axis=1)
PARTS = (POINTS[:, 0] > 0.5) + 2 * (POINTS[:, 1] > 0.3)
PARTS[np.linalg.norm(POINTS - [0.8, 0.8, 0], axis=1) < 0.03] = 4  # 0.3% of the area


def flipped(share: float) -> np.ndarray:
    wrong = stream(0, 2).random(len(PARTS)) < share
    return np.where(wrong, (PARTS + stream(0, 3).integers(1, 5, len(PARTS))) % 5, PARTS)


def test_right_labels_are_believed() -> None:
    assert not doubtful_labels(POINTS, PARTS).any()


@pytest.mark.parametrize("share", [0.01, 0.05, 0.1])
def test_wrong_labels_are_found_and_right_ones_kept(share: float) -> None:
    labels = flipped(share)
    found, wrong = doubtful_labels(POINTS, labels), labels != PARTS
    assert found[wrong].mean() > 0.95
    assert found[~wrong].mean() < 0.003
    assert found[~wrong & (PARTS == 4)].mean() < 0.1, "the smallest part keeps its points"


def test_unlabelled_points_neither_vote_nor_are_found() -> None:
    labels = flipped(0.05)
    hidden = stream(0, 4).random(len(labels)) < 0.5
    some = np.where(hidden, -1, labels)
    found = doubtful_labels(POINTS, some)
    assert not found[hidden].any()
    np.testing.assert_array_equal(found[~hidden], doubtful_labels(POINTS[~hidden], labels[~hidden]))
    assert not doubtful_labels(POINTS, np.full(len(labels), -1)).any()
