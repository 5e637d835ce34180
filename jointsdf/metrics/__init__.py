"""Metrics of a reconstruction, one file per family; here the protocol, shared searches and label counts.

A metric is a frozen dataclass whose call takes the samples of two surfaces in one frame and returns columns of the
result row. It never moves geometry. Searches between two sample sets are cached, so that several metrics share them;
search trees of a mesh serve its samples in every frame.
"""

import math
from dataclasses import replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.creases import REACH, Creases, find_creases
from jointsdf.geometry.distance import ClosestPoint, spatial_order
from jointsdf.geometry.segments import nearest_segment
from jointsdf.values import LabelledMesh, SurfaceSamples


@runtime_checkable
class Metric(Protocol):
    """Protocol of a metric. Keys are CSV columns; a part that the ground truth lacks has no key.

    Two optional class attributes, tuples of keys, request reference scores: `floors` for `<key>_floor` (the ground
    truth against itself, sampled twice) and `ceilings` for `<key>_ceiling` (the best mesh that the grid can give).
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
    """Exact nearest neighbours of two non-empty sample sets in each other, by k-d trees; cached."""
    return Matching(*_nearest(predicted.points, truth), *_nearest(truth.points, predicted))


def _nearest(points: Float[ndarray, "n 3"], among: SurfaceSamples) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    order = spatial_order(points)
    distances, nearest = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    distances[order], nearest[order] = among.tree.query(points[order], workers=-1)
    return distances, nearest


@cached_by_identity
def closest_point(mesh: LabelledMesh) -> ClosestPoint:
    """Closest-point search on a mesh; cached."""
    return ClosestPoint(mesh)


@cached_by_identity
def project(samples: SurfaceSamples, onto: SurfaceSamples) -> Projection:
    """Exact closest point on the mesh of `onto` for each of `samples`, both in one frame; cached."""
    distances, faces = closest_point(onto.mesh).query(onto.frame.inverse(samples.points))
    return Projection(distances / onto.frame.scale, faces)


@cached_by_identity
def creases(samples: SurfaceSamples) -> Creases:
    """Creases of the mesh of `samples`, in the frame of the samples, where the reach is `REACH`; cached."""
    frame = samples.frame
    found = find_creases(samples.mesh, REACH * frame.scale)
    return replace(found, starts=frame.forward(found.starts), ends=frame.forward(found.ends))


@cached_by_identity
def match_creases(samples: SurfaceSamples, onto: SurfaceSamples) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    """Nearest crease of `onto` for each of `samples`, both in one frame; cached.

    Returns:
        The exact distance, infinite where `onto` has no crease, and the index of the crease's piece, 0 there.
    """
    found = creases(onto)
    if len(found.starts) == 0:
        return np.full(len(samples.points), math.inf), np.zeros(len(samples.points), dtype=np.int64)
    return nearest_segment(samples.points, found.starts, found.ends)


def score_without_labels(predicted: SurfaceSamples, truth: SurfaceSamples) -> float | None:
    """Value of every label score where labels cannot be compared; None where they can.

    Returns:
        NaN if either mesh has no label at all; 0 if there is no predicted sample but the truth has labels.
    """
    if len(truth.mesh.part_ids) == 0:
        return math.nan
    if len(predicted.points) == 0:
        return 0.0
    return math.nan if len(predicted.mesh.part_ids) == 0 else None


def confusion_matrix(
    true: Int[ndarray, " n"], predicted: Int[ndarray, " n"], part_ids: Int[ndarray, " k"]
) -> Int[ndarray, "k k+1"]:
    """Confusion matrix: row = true part, column = predicted part, last column = any other label.

    Args:
        true: True label of each sample. Samples whose label is not in `part_ids` (-1: unlabelled) do not count.
        predicted: Predicted label of each sample.
        part_ids: The parts of the ground truth, ascending.

    >>> confusion_matrix(np.array([2, 2, 5, -1]), np.array([2, 5, 9, 2]), np.array([2, 5]))
    array([[1, 1, 0],
           [0, 0, 1]])
    """
    parts = len(part_ids)
    counted = np.isin(true, part_ids)
    rows = np.searchsorted(part_ids, true[counted])
    columns = np.searchsorted(part_ids, predicted[counted])
    known = part_ids[np.minimum(columns, parts - 1)] == predicted[counted]
    cells = rows * (parts + 1) + np.where(known, columns, parts)
    return np.bincount(cells, minlength=parts * (parts + 1)).reshape(parts, parts + 1)


def label_scores(counts: Int[ndarray, "k k+1"]) -> tuple[Float[ndarray, " k"], float]:
    """IoU of each true part and the accuracy, from one confusion matrix.

    Returns:
        TP / (TP + FP + FN) per part, 0 for a part that no sample has on either side; and sum TP / number of samples,
        NaN without samples.

    >>> label_scores(np.array([[3, 1, 0], [0, 4, 0]]))
    (array([0.75, 0.8 ]), 0.875)
    """
    right = np.diagonal(counts)
    union = counts.sum(axis=1) + counts[:, :-1].sum(axis=0) - right
    total = int(counts.sum())
    return right / np.maximum(union, 1), float(right.sum() / total) if total else math.nan
