"""Chamfer distances between two sample sets."""

import math
from dataclasses import dataclass
from typing import ClassVar

from jointsdf.metrics import match
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class Chamfer:
    """Mean distance (`cd_l1`) and mean squared distance (`cd_l2`) to the nearest sample of the other surface.

        cd_l1 = 100 (mean d(P->G) + mean d(G->P)) / 2,   cd_l2 the same with d^2

    Stored times 100, as the paper's tables print them. NaN for an empty prediction.
    """

    floors: ClassVar[tuple[str, ...]] = ("cd_l1", "cd_l2")

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if len(predicted.points) == 0:
            return {"cd_l1": math.nan, "cd_l2": math.nan}
        found = match(predicted, truth)
        return {
            "cd_l1": 50.0 * float(found.to_truth.mean() + found.to_predicted.mean()),
            "cd_l2": 50.0 * float((found.to_truth**2).mean() + (found.to_predicted**2).mean()),
        }
