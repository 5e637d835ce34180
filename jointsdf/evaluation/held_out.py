"""Scores of a mesh where a point cloud is all that is known: by points that were held out of the fit."""

import math

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.data.held_out import mark_held_out
from jointsdf.evaluation.protocol import PREDICTED_SEED, sample_surface
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.topology import topology
from jointsdf.values import UNLABELLED, LabelledMesh, Scan

SAMPLES = 30_000  # of the surface, area-uniform
MOST = 100_000  # held-out points that are asked
COVERED = 5.0  # distance of a point of the surface from the cloud up to which it is covered, in median spacings


def held_out_scores(scan: Scan, mesh: LabelledMesh) -> dict[str, float]:
    """Score a mesh by the held-out points of its cloud; lengths are shares of the longest side of the points' box.

    Args:
        scan: The cloud; its held-out points are those that no training cloud of it holds.
        mesh: The reconstruction, file frame. May be empty.

    Returns:
        `held_out_mean`, `held_out_p99`: distance of held-out points to the surface, noise of the points included;
        `to_cloud_mean`, `to_cloud_p99`: distance of area-uniform points of the surface to the nearest point of the
        whole cloud, spacing of the points included; `uncovered`: share of the area farther from the cloud than five
        median spacings; `held_out_acc`, `held_out_miou`: labels of the closest faces at labelled held-out points, NaN
        without labels; `components`, `euler` and `parts_pred` of the mesh. Distances are NaN for an empty mesh.
    """
    held = np.flatnonzero(mark_held_out(scan.points))
    held = held[:: -(-len(held) // MOST)]
    found = topology(mesh)
    scores = {"components": float(found["components"]), "euler": float(found["euler"])}
    distances, labels = np.full(len(held), math.nan), np.full(len(held), UNLABELLED)
    if not mesh.is_empty:
        distances, faces = ClosestPoint(mesh).query(scan.points[held])
        labels = mesh.labels[faces]
    scores |= {"held_out_mean": float(distances.mean()), "held_out_p99": float(np.quantile(distances, 0.99))}
    scores |= _to_cloud(scan, mesh)
    lengths = ("held_out_mean", "held_out_p99", "to_cloud_mean", "to_cloud_p99")
    scores |= {name: scores[name] / scan.side for name in lengths}
    scores |= label_scores(scan.labels[held], labels, scan.part_ids)
    parts = math.nan if len(scan.part_ids) == 0 else float(len(mesh.part_ids))
    return scores | {"parts_pred": parts}


def _to_cloud(scan: Scan, mesh: LabelledMesh) -> dict[str, float]:
    """Distances of the surface to the cloud, file units, and the share of it that the cloud does not cover."""
    tree, samples = KDTree(scan.points), sample_surface(mesh, SAMPLES, PREDICTED_SEED).points
    if len(samples) == 0:
        return dict.fromkeys(("to_cloud_mean", "to_cloud_p99", "uncovered"), math.nan)
    some = scan.points[:: -(-len(scan.points) // SAMPLES)]
    spacing = float(np.median(tree.query(some, [2], workers=-1)[0]))
    away = tree.query(samples, workers=-1)[0]
    uncovered = float((away > COVERED * spacing).mean())
    return {"to_cloud_mean": float(away.mean()), "to_cloud_p99": float(np.quantile(away, 0.99)), "uncovered": uncovered}


def label_scores(
    true: Int[ndarray, " n"], predicted: Int[ndarray, " n"], part_ids: Int[ndarray, " k"]
) -> dict[str, float]:
    """Accuracy, and mean over the parts of intersection over union, at labelled points; NaN where there is none.

    >>> label_scores(np.array([1, 1, 2, -1]), np.array([1, 2, 2, 2]), np.array([1, 2]))
    {'held_out_acc': 0.6666666666666666, 'held_out_miou': 0.5}
    """
    true, predicted = true[true != UNLABELLED], predicted[true != UNLABELLED]
    if len(true) == 0:
        return {"held_out_acc": math.nan, "held_out_miou": math.nan}
    ious: Float[ndarray, " k"] = np.array(
        [
            ((true == part) & (predicted == part)).sum() / max(1, ((true == part) | (predicted == part)).sum())
            for part in part_ids
        ]
    )
    return {"held_out_acc": float((true == predicted).mean()), "held_out_miou": float(ious.mean())}
