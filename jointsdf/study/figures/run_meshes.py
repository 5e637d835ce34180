"""Ground truth and prediction of one run: parts matched by linear assignment, errors per face."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.optimize import linear_sum_assignment

from jointsdf.errors import InputError
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import face_areas
from jointsdf.shapes.labels.columns import read_own_labels
from jointsdf.shapes.stored import stored_mesh_truth
from jointsdf.values import LabelledMesh, Shape
from jointsdf.viewing.error_view import centroids, face_distances

MESH = "mesh.ply"


@dataclass(frozen=True)
class Pair:
    """Ground truth and prediction of one run, file frame, original part ids.

    Attributes:
        truth: Ground truth.
        predicted: Extracted mesh.
    """

    truth: Shape
    predicted: LabelledMesh

    @cached_property
    def size(self) -> float:
        """Longest side of the ground truth's box, file units."""
        corners = self.truth.mesh.vertices
        return float(np.ptp(corners, axis=0).max())

    @cached_property
    def matched(self) -> LabelledMesh:
        """The prediction with the part ids of the ground truth: the linear assignment of largest shared area.

        Parts without a counterpart get new ids, after all others.
        """
        ids, columns = np.unique(self.predicted.labels, return_inverse=True)
        wanted, rows = np.unique(self._true_labels, return_inverse=True)
        shared = np.zeros((len(ids), len(wanted)))
        np.add.at(shared, (columns, rows), face_areas(self.predicted))
        shared[:, wanted < 0] = 0.0
        left, right = linear_sum_assignment(shared, maximize=True)
        names = 1 + max(ids.max(initial=0), wanted.max(initial=0)) + np.arange(len(ids))
        good = shared[left, right] > 0
        names[left[good]] = wanted[right[good]]
        return replace(self.predicted, labels=names[columns])

    @cached_property
    def error(self) -> Float[ndarray, " f"]:
        """Distance of each predicted face's centroid to the ground truth, as a share of its longest side."""
        return face_distances(self.predicted, self.truth.mesh) / self.size

    @cached_property
    def missed(self) -> Float[ndarray, " g"]:
        """Distance of each true face's centroid to the prediction, as a share of the truth's longest side."""
        return face_distances(self.truth.mesh, self.predicted) / self.size

    @cached_property
    def wrong(self) -> Bool[ndarray, " f"]:
        """Predicted faces whose label differs from that of the true face closest to their centroid."""
        different: ndarray = self.predicted.labels != self._true_labels
        return different & (self._true_labels >= 0)

    @cached_property
    def _true_labels(self) -> Int[ndarray, " f"]:
        _, closest = ClosestPoint(self.truth.mesh).query(centroids(self.predicted))
        labels: ndarray = self.truth.mesh.labels[closest]
        return labels


def load_pair(folder: Path, trust: Collection[str] = ()) -> Pair:
    """Load the meshes of a finished run.

    Args:
        folder: The run folder.
        trust: Modules whose classes its config may name.

    Raises:
        InputError: The run folder has no mesh, or its ground truth has changed. One line.
    """
    path = folder / MESH
    if not path.is_file():
        raise InputError(f"{path} is not there")
    _, truth = stored_mesh_truth(folder, trust)
    return Pair(truth, read_own_labels(path))
