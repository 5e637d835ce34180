"""Label consistency: smoothness of the predicted labels over the predicted surface."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial import KDTree

from jointsdf.metrics import score_without_labels
from jointsdf.values import UNLABELLED, SurfaceSamples


@dataclass(frozen=True)
class Consistency:
    """Share of a predicted sample's nearest predicted samples with its own label, mean over anchors: `consistency`.

    The anchor itself is not among its neighbours. Samples labelled -1 are left out. NaN where either mesh has no
    labels, where the prediction is empty, and with a single sample.

    Args:
        neighbours: Neighbours per anchor (all others, if there are fewer).
        anchors: Number of anchors (all samples, if there are fewer).
        seed: Of the choice of anchors.
    """

    neighbours: int = 10
    anchors: int = 1000
    seed: int = 0
    floors: ClassVar[tuple[str, ...]] = ("consistency",)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if score_without_labels(predicted, truth) is not None:
            return {"consistency": math.nan}
        labelled = predicted.labels != UNLABELLED
        labels = predicted.labels[labelled]
        if len(labels) < 2:
            return {"consistency": math.nan}
        tree = predicted.tree if labelled.all() else KDTree(predicted.points[labelled])
        count = min(self.neighbours, len(labels) - 1)
        chosen = np.random.default_rng(self.seed).choice(len(labels), min(self.anchors, len(labels)), replace=False)
        _, near = tree.query(tree.data[chosen], k=count + 1)
        # Samples at the anchor's own place may be listed before it, or push it off the list.
        others = near != chosen[:, None]
        others[others.all(axis=1), -1] = False
        same = labels[near] == labels[chosen, None]
        return {"consistency": float(same[others].mean())}
