"""Normal consistency: agreement of the normals of nearest samples."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.metrics import match
from jointsdf.values import SurfaceSamples

FORMS = ("cosine", "axes")


@dataclass(frozen=True)
class NormalConsistency:
    """Mean agreement of each sample's normal with that of its nearest neighbour, both directions, halved: `nc`.

        cosine: abs(n1 . n2)        axes: abs(n1_x n2_x) + abs(n1_y n2_y) + abs(n1_z n2_z)

    Blind to flipped normals. NaN for an empty prediction.

    Args:
        form: "cosine"; or "axes", which is never smaller: the arithmetic of FlatCAD's published numbers.

    Raises:
        InputError: `form` is neither.
    """

    form: str = "cosine"
    floors: ClassVar[tuple[str, ...]] = ("nc",)

    def __post_init__(self) -> None:
        """Check the form."""
        if self.form not in FORMS:
            raise InputError(f"normal consistency form={self.form!r}: use one of {', '.join(FORMS)}")

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if len(predicted.points) == 0:
            return {"nc": math.nan}
        found = match(predicted, truth)
        forward = self._agreement(predicted.normals, truth.normals[found.nearest_truth])
        backward = self._agreement(truth.normals, predicted.normals[found.nearest_predicted])
        return {"nc": (forward + backward) / 2}

    def _agreement(self, first: Float[ndarray, "n 3"], second: Float[ndarray, "n 3"]) -> float:
        products = first * second
        per_point = np.abs(products.sum(axis=1)) if self.form == "cosine" else np.abs(products).sum(axis=1)
        return float(per_point.mean())
