"""Distances of samples to the other surface itself, free of the noise between two sample sets."""

import math
from dataclasses import dataclass

import numpy as np

from jointsdf.metrics import project
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class SurfaceDistance:
    """Distance of samples to the closest point of the other mesh: `surface_mean`, `surface_p99`, `surface_max`.

    Samples of both surfaces are pooled. Lengths in the frame of the samples, where the longest side is 1: 0.005 is
    0.5%. NaN for an empty prediction.
    """

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if len(predicted.points) == 0:
            return dict.fromkeys(("surface_mean", "surface_p99", "surface_max"), math.nan)
        pooled = np.concatenate([project(predicted, truth).distances, project(truth, predicted).distances])
        return {
            "surface_mean": float(pooled.mean()),
            "surface_p99": float(np.percentile(pooled, 99)),
            "surface_max": float(pooled.max()),
        }
