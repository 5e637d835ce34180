"""Borders between parts along creases: how far the predicted border polyline is from the true one."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from jointsdf.errors import require_number
from jointsdf.geometry.mesh import border_edges
from jointsdf.geometry.segments import nearest_segment, points_along
from jointsdf.metrics import creases, score_without_labels
from jointsdf.values import SurfaceSamples

COLUMNS = ("crease_border_p99", "crease_border_back_p99")


@dataclass(frozen=True)
class CreaseBorders:
    """Distance between predicted and true borders of parts, on borders that are creases: 99th percentiles by length.

        crease_border_p99        of d(p, B) over the points p of the predicted border whose nearest of B is a crease
        crease_border_back_p99   of d(b, predicted border) over the points b of the true borders on creases

    B: all true borders. The first does not see a part that is not there, the second no border too many. Lengths in the
    frame of the samples, where the longest side is 1. NaN where either mesh has no labels or no border, where no true
    border is on a crease (of the first also where no point is nearest to one), and for an empty prediction. A mesh
    against itself scores 0: that is the floor.

    Args:
        spacing: Largest distance between points along a border, in the frame of the meshes.

    Raises:
        InputError: A spacing below 0.00001.
    """

    spacing: float = 0.0005

    def __post_init__(self) -> None:
        """Check the spacing."""
        require_number("evaluation crease_borders.spacing", self.spacing, 1e-5)

    @property
    def ceilings(self) -> tuple[str, ...]:
        """Both columns: what grid and face rule alone cost."""
        return COLUMNS

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        nothing = dict.fromkeys(COLUMNS, math.nan)
        if score_without_labels(predicted, truth) is not None:
            return nothing
        (starts, ends, _), (true_starts, true_ends, sharp) = _border(predicted), _border(truth)
        if len(starts) == 0 or not sharp.any():
            return nothing
        points, lengths, _ = points_along(starts, ends, self.spacing)
        distances, nearest = nearest_segment(points, true_starts, true_ends)
        points, back_lengths, _ = points_along(true_starts[sharp], true_ends[sharp], self.spacing)
        back, _ = nearest_segment(points, starts, ends)
        counted = sharp[nearest]
        percentiles = _percentile(distances[counted], lengths[counted]), _percentile(back, back_lengths)
        return dict(zip(COLUMNS, percentiles, strict=True))


def _border(
    samples: SurfaceSamples,
) -> tuple[Float[ndarray, "e 3"], Float[ndarray, "e 3"], Bool[ndarray, " e"]]:
    """Ends of the border edges of some length, in the frame of the samples, and which are creases."""
    edges, count = border_edges(samples.mesh), len(samples.mesh.vertices)
    starts, ends = samples.mesh.vertices[edges.T].astype(np.float64)
    long = (starts != ends).any(axis=1)
    sharp = np.isin(edges @ [count, 1], creases(samples).edges @ [count, 1])
    return samples.frame.forward(starts[long]), samples.frame.forward(ends[long]), sharp[long]


def _percentile(values: Float[ndarray, " n"], weights: Float[ndarray, " n"]) -> float:
    if len(values) == 0:
        return math.nan
    return float(np.percentile(values, 99, weights=weights, method="inverted_cdf"))
