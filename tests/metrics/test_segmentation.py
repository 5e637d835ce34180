"""Labels by nearest neighbour against torchmetrics."""

import math

import numpy as np
import pytest
import torch
from surface_samples import cloud
from torchmetrics.functional.classification import multiclass_jaccard_index

from jointsdf.metrics.segmentation import Segmentation
from jointsdf.values import LabelledMesh, SurfaceSamples


def test_segmentation_equals_torchmetrics_on_carried_labels():
    rng = np.random.default_rng(2)
    truth = cloud(rng.random((400, 3)), rng.integers(0, 6, 400))
    nearest = rng.permutation(400)
    carried = truth.labels[nearest]
    labels = np.where(rng.random(400) < 0.7, carried, rng.integers(0, 6, 400))
    predicted = cloud(truth.points[nearest] + 1e-6, labels)
    found = Segmentation()(predicted, truth)
    oracle = [torch.from_numpy(array) for array in (labels, carried)]
    assert found["miou"] == pytest.approx(multiclass_jaccard_index(*oracle, num_classes=6).item(), abs=1e-6)
    per_part = multiclass_jaccard_index(*oracle, num_classes=6, average=None)
    assert [found[f"iou_{k}"] for k in range(6)] == pytest.approx(per_part.tolist(), abs=1e-6)
    assert found["acc"] == pytest.approx((labels == carried).mean())
    assert (found["parts_pred"], found["parts_gt"]) == (6, 6)


def test_parts_keep_their_ids_and_a_missed_part_scores_zero():
    points = np.eye(3)
    found = Segmentation()(cloud(points, [4, 4, 9]), cloud(points, [4, 7, 9]))
    assert found == {
        "miou": pytest.approx(0.5), "acc": pytest.approx(2 / 3), "iou_4": 0.5, "iou_7": 0.0, "iou_9": 1.0,
        "parts_pred": 2.0, "parts_gt": 3.0,
    }  # fmt: skip


def test_part_on_the_mesh_that_no_sample_hits_scores_zero():
    sampled = cloud(np.eye(3), [0, 0, 1])
    mesh = LabelledMesh(
        np.r_[sampled.mesh.vertices, sampled.mesh.vertices[:3]],
        np.r_[sampled.mesh.faces, [[9, 10, 11]]],
        np.r_[sampled.mesh.labels, [2]],
    )
    truth = SurfaceSamples(mesh, sampled.points, sampled.normals, sampled.faces)
    assert Segmentation()(sampled, truth)["miou"] == pytest.approx(2 / 3)


def test_unlabelled_true_samples_do_not_count_and_unlabelled_predictions_are_wrong():
    points = np.eye(3)
    assert Segmentation()(cloud(points, [0, 1, 1]), cloud(points, [0, 1, -1]))["acc"] == 1.0
    found = Segmentation()(cloud(points, [0, 1, -1]), cloud(points, [0, 1, 1]))
    assert (found["acc"], found["iou_1"], found["parts_pred"]) == (pytest.approx(2 / 3), 0.5, 2.0)


def test_no_labelled_match_at_all_leaves_acc_undefined():
    predicted = cloud([[0, 0, 0]], [1])
    found = Segmentation()(predicted, cloud([[0, 0, 0], [9, 9, 9]], [-1, 1]))
    assert math.isnan(found["acc"])
    assert found["miou"] == 0.0
