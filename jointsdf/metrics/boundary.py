"""Boundary F1: position of the borders between parts."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.mesh import border_edges
from jointsdf.geometry.segments import points_along
from jointsdf.metrics import score_without_labels
from jointsdf.values import LabelledMesh, SurfaceSamples


@dataclass(frozen=True)
class Boundary:
    """F1 of points along the borders between parts, at a distance tolerance: `boundary_f1`, or another column.

    Precision is the share of the predicted border's length within the tolerance of the true border, recall the
    reverse. 1 where neither mesh has a border, 0 where only one has, and for an empty prediction; NaN where either
    mesh has no labels. Edges next to unlabelled faces are no border. Neighbouring faces must share vertex indices.

    Args:
        spacing: Largest distance between points along an edge, in the frame of the meshes.
        tolerance: In the frame of the meshes, where the longest side is 1.
        column: Name of the score.
    """

    spacing: float = 0.001
    tolerance: float = 0.01
    column: str = "boundary_f1"

    @property
    def ceilings(self) -> tuple[str, ...]:
        """The column, of which the grid's ceiling is scored."""
        return (self.column,)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        default = score_without_labels(predicted, truth)
        if default is not None:
            return {self.column: default}
        found, wanted = self._points(predicted), self._points(truth)
        if len(found[0]) == 0 or len(wanted[0]) == 0:
            return {self.column: float(len(found[0]) == len(wanted[0]))}
        precision, recall = self._share_near(*found, wanted[0]), self._share_near(*wanted, found[0])
        return {self.column: 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0}

    def _points(self, samples: SurfaceSamples) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
        scale = samples.frame.scale
        starts, ends = samples.mesh.vertices[_border(samples.mesh).T].astype(np.float64)
        points, lengths, _ = points_along(starts, ends, self.spacing * scale)
        return samples.frame.forward(points), lengths / scale

    def _share_near(
        self, points: Float[ndarray, "n 3"], lengths: Float[ndarray, " n"], others: Float[ndarray, "m 3"]
    ) -> float:
        distances, _ = KDTree(others).query(points, distance_upper_bound=self.tolerance, workers=-1)
        return float(lengths[np.isfinite(distances)].sum() / lengths.sum())


@cached_by_identity
def _border(mesh: LabelledMesh) -> Int[ndarray, "e 2"]:
    return border_edges(mesh)
