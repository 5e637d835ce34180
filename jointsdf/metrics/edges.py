"""Edges: position, sharpness and length of the predicted creases against the true ones."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from jointsdf.errors import require_number
from jointsdf.geometry.creases import Creases
from jointsdf.geometry.segments import nearest_segment, points_along
from jointsdf.metrics import creases
from jointsdf.values import SurfaceSamples

MOST = 1_000_000  # points along the creases of a mesh, but for one a piece at least
COLUMNS = ("edge_cd", "edge_f1", "edge_f1_fine", "crease_angle_error", "crease_length_ratio", "false_crease_length")


class Along(NamedTuple):
    """Points along the creases of one surface, with the nearest crease of the other.

    Attributes:
        weights: Length of crease that each point stands for, in the frame of the samples.
        angles: Of the crease at each point, radians.
        distances: To the nearest crease of the other surface.
        other_angles: Of that crease, radians.
    """

    weights: Float[ndarray, " n"]
    angles: Float[ndarray, " n"]
    distances: Float[ndarray, " n"]
    other_angles: Float[ndarray, " n"]


@dataclass(frozen=True)
class Edges:
    """Chamfer distance and F1 of creases as in BSP-Net (Chen et al., CVPR 2020), here between curves.

    BSP-Net draws points of the surface near which normals differ, a band about each edge. Here the creases themselves
    are compared (`geometry/creases.py`: the surface turns by more than 32 degrees within 0.002 on either side), at
    points every `spacing` along them, by the exact distance d to the nearest crease of the other mesh, so that a mesh
    against itself scores 0 or 1: that is the floor. P: points of the prediction, G: of the truth, means by length.

        edge_cd               100 (mean d(P->G) + mean d(G->P)) / 2, percent of the longest side
        edge_f1, _fine        2 p r / (p + r), p = share of P with d <= tolerance, r = share of G
        crease_angle_error    mean over G with d <= tolerance of |angle - that of the nearest of P|, degrees
        crease_length_ratio   length of P / length of G: 2 for a chamfer in place of each edge, more for a staircase
        false_crease_length   length of P with d > tolerance, in longest sides

    Without a true crease all are NaN but `false_crease_length`. Where only the truth has creases, and for an empty
    prediction, the F1 and the ratio are 0, the others NaN (the false length of a mesh without crease: 0).

    Args:
        spacing: Largest distance between points along a crease, in the frame of the meshes; a millionth of the whole
            length, where that is more.
        tolerance: In the frame of the meshes, where the longest side is 1.
        fine: The tolerance of `edge_f1_fine`.

    Raises:
        InputError: A spacing below 0.00001, or a tolerance below 0.
    """

    spacing: float = 0.0005
    tolerance: float = 0.005
    fine: float = 0.002

    def __post_init__(self) -> None:
        """Check the lengths."""
        require_number("evaluation edges.spacing", self.spacing, 1e-5)
        require_number("evaluation edges.tolerance", self.tolerance, 0)
        require_number("evaluation edges.fine", self.fine, 0)

    @property
    def ceilings(self) -> tuple[str, ...]:
        """All columns: what grid and extraction alone cost."""
        return COLUMNS

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        scores = dict.fromkeys(COLUMNS, math.nan)
        found, wanted = self._compare(creases(predicted), creases(truth))
        if len(predicted.points):
            scores["false_crease_length"] = float(found.weights[found.distances > self.tolerance].sum())
        if len(wanted.weights) == 0:
            return scores
        scores |= {
            "edge_f1": self._f1(found, wanted, self.tolerance),
            "edge_f1_fine": self._f1(found, wanted, self.fine),
        }
        scores["crease_length_ratio"] = float(found.weights.sum() / wanted.weights.sum())
        if len(found.weights):
            scores["edge_cd"] = 50 * (_mean(found.distances, found.weights) + _mean(wanted.distances, wanted.weights))
            scores["crease_angle_error"] = self._angle_error(wanted)
        return scores

    def _compare(self, found: Creases, wanted: Creases) -> tuple[Along, Along]:
        return self._along(found, wanted), self._along(wanted, found)

    def _along(self, these: Creases, others: Creases) -> Along:
        total = float(np.linalg.norm(these.ends - these.starts, axis=1).sum())
        points, weights, piece = points_along(these.starts, these.ends, max(self.spacing, total / MOST))
        if len(others.starts) == 0:
            missing = np.full(len(points), math.inf)
            return Along(weights, these.angles[piece], missing, missing)
        distances, nearest = nearest_segment(points, others.starts, others.ends)
        return Along(weights, these.angles[piece], distances, others.angles[nearest])

    def _f1(self, found: Along, wanted: Along, tolerance: float) -> float:
        if len(found.weights) == 0:
            return 0.0
        precision, recall = (_mean(side.distances <= tolerance, side.weights) for side in (found, wanted))
        return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0

    def _angle_error(self, wanted: Along) -> float:
        near = wanted.distances <= self.tolerance
        errors = np.abs(wanted.angles - wanted.other_angles)[near]
        return math.degrees(_mean(errors, wanted.weights[near])) if near.any() else math.nan


def _mean(values: Float[ndarray, " n"] | Bool[ndarray, " n"], weights: Float[ndarray, " n"]) -> float:
    return float(np.average(values, weights=weights))
