"""Measures of a reconstruction: one file per family, and here what several families share.

A metric is a frozen dataclass whose call takes the samples of two surfaces in one frame and returns columns of the
result row. It never moves geometry. Searches between two sample sets run once, whichever metrics ask for them, and what
is known of a mesh serves its samples in every frame.
"""

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.distance import ClosestPoint, spatial_order
from jointsdf.values import LabelledMesh, SurfaceSamples


@runtime_checkable
class Metric(Protocol):
    """What evaluation calls. Keys are CSV columns; a part that the ground truth lacks has no key.

    Two optional class attributes, tuples of keys, ask for companions: `floors` for `<key>_floor` (the ground truth
    against itself, sampled twice) and `ceilings` for `<key>_ceiling` (the best mesh the extraction grid can give).
    """

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction. No predicted samples: NaN for lengths and angles, 0 for scores; never an exception."""
        ...


class Matching(NamedTuple):
    """Nearest neighbours between two sample sets, both directions. Lengths in the frame of the samples.

    Attributes:
        to_truth: Distance of each predicted sample to its nearest true sample.
        nearest_truth: Index of that true sample.
        to_predicted: Distance of each true sample to its nearest predicted sample.
        nearest_predicted: Index of that predicted sample.
    """

    to_truth: Float[ndarray, " p"]
    nearest_truth: Int[ndarray, " p"]
    to_predicted: Float[ndarray, " t"]
    nearest_predicted: Int[ndarray, " t"]


class Projection(NamedTuple):
    """Closest points of samples on a mesh.

    Attributes:
        distances: Distance of each sample to the mesh, in the frame of the samples.
        faces: Index of the closest face of the mesh.
    """

    distances: Float[ndarray, " n"]
    faces: Int[ndarray, " n"]


@cached_by_identity
def match(predicted: SurfaceSamples, truth: SurfaceSamples) -> Matching:
    """Nearest neighbours of two non-empty sample sets in each other, exact."""
    return Matching(*_nearest(predicted.points, truth), *_nearest(truth.points, predicted))


def _nearest(points: Float[ndarray, "n 3"], among: SurfaceSamples) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    order = spatial_order(points)
    distances, nearest = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    distances[order], nearest[order] = among.tree.query(points[order], workers=-1)
    return distances, nearest


@cached_by_identity
def closest_point(mesh: LabelledMesh) -> ClosestPoint:
    """Closest points on a mesh."""
    return ClosestPoint(mesh)


@cached_by_identity
def project(samples: SurfaceSamples, onto: SurfaceSamples) -> Projection:
    """Closest point of the mesh under `onto` for every one of `samples`, exact; both in one frame."""
    distances, faces = closest_point(onto.mesh).query(onto.frame.inverse(samples.points))
    return Projection(distances / onto.frame.scale, faces)


def unscored(predicted: SurfaceSamples, truth: SurfaceSamples) -> float | None:
    """The value of every label score where labels cannot be compared; None where they can.

    Returns:
        NaN if either mesh has no label at all; 0 if there is no predicted sample but the truth has labels.
    """
    if len(truth.mesh.part_ids) == 0:
        return math.nan
    if len(predicted.points) == 0:
        return 0.0
    return math.nan if len(predicted.mesh.part_ids) == 0 else None


def confusion(
    true: Int[ndarray, " n"], predicted: Int[ndarray, " n"], part_ids: Int[ndarray, " k"]
) -> Int[ndarray, "k k+1"]:
    """Count pairs of labels: row = true part, column = predicted part, last column = any other label.

    Args:
        true: True label of each sample. Samples whose label is not in `part_ids` (-1: unlabelled) do not count.
        predicted: Predicted label of each sample.
        part_ids: The parts of the ground truth, ascending.
    """
    parts = len(part_ids)
    counted = np.isin(true, part_ids)
    rows = np.searchsorted(part_ids, true[counted])
    columns = np.searchsorted(part_ids, predicted[counted])
    known = part_ids[np.minimum(columns, parts - 1)] == predicted[counted]
    cells = rows * (parts + 1) + np.where(known, columns, parts)
    return np.bincount(cells, minlength=parts * (parts + 1)).reshape(parts, parts + 1)


def label_scores(counts: Int[ndarray, "k k+1"]) -> tuple[Float[ndarray, " k"], float]:
    """IoU of each true part and the share of right labels, from one confusion matrix.

    Returns:
        TP / (TP + FP + FN) per part, 0 for a part that no sample has on either side; and sum TP / number of samples,
        NaN without samples.
    """
    right = np.diagonal(counts)
    union = counts.sum(axis=1) + counts[:, :-1].sum(axis=0) - right
    total = int(counts.sum())
    return right / np.maximum(union, 1), float(right.sum() / total) if total else math.nan
