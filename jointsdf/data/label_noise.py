"""Wrong labels of a point cloud: those that next to no neighbour shares (edited nearest neighbours, Wilson 1972)."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.values import UNLABELLED

NEIGHBOURS = 12
LEAST_SUPPORT = 0.25  # share of a point's labelled neighbours that have its label; with less the label is wrong
ALONE = 1.5  # neighbours: a label that fewer share is alone
LEAST_WRONG = (
    0.003  # share of labels that are alone, below which all are believed: small parts have such points as well
)


def doubtful_labels(points: Float[ndarray, "n 3"], labels: Int[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Mark of the labels that are probably wrong; none where next to no label is alone.

    A right label near a border has about half its neighbours' support, a wrong one that of few. The other labels are
    not changed: a vote would move borders, and take the smallest parts away.

    Args:
        points: The cloud.
        labels: Class of each point, -1 where unlabelled.
    """
    labelled = np.flatnonzero(labels != UNLABELLED)
    doubtful = np.zeros(len(labels), dtype=bool)
    if len(labelled) <= NEIGHBOURS:
        return doubtful
    near = KDTree(points[labelled]).query(points[labelled], NEIGHBOURS + 1, workers=-1)[1][:, 1:]
    shared = (labels[labelled][near] == labels[labelled][:, None]).sum(axis=1)
    if (shared < ALONE).mean() > LEAST_WRONG:
        doubtful[labelled] = shared < LEAST_SUPPORT * NEIGHBOURS
    return doubtful
