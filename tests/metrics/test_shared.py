"""Searches and label counts that several metrics share, and inputs without labels or samples."""

import gc
import math
import weakref

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from sklearn.metrics import accuracy_score, confusion_matrix, jaccard_score
from surface_samples import NO_SAMPLES, cloud, cube, labelled, score

from jointsdf.evaluation.protocol import sample_surface
from jointsdf.metrics import confusion_matrix as count_confusion
from jointsdf.metrics import label_scores, match, project
from jointsdf.metrics.boundary import Boundary
from jointsdf.metrics.chamfer import Chamfer
from jointsdf.metrics.consistency import Consistency
from jointsdf.metrics.exact_labels import ExactLabels
from jointsdf.metrics.f_score import FScore
from jointsdf.metrics.normal_consistency import NormalConsistency
from jointsdf.metrics.segmentation import Segmentation
from jointsdf.metrics.surface_distance import SurfaceDistance
from jointsdf.values import LabelledMesh

LABEL_METRICS = [Segmentation(), Consistency(), ExactLabels(), Boundary()]
LABEL_KEYS = {"miou", "acc", "consistency", "miou_exact", "acc_exact", "boundary_f1"}


def test_a_search_runs_once_and_is_forgotten_with_its_samples(clouds):
    predicted, truth = clouds[0], cloud(clouds[1].points)
    for search in (match, project):
        assert search(predicted, truth)[0] is search(predicted, truth)[0]
        assert search(truth, predicted)[0] is not search(predicted, truth)[0]
    kept = [weakref.ref(match(predicted, truth).to_truth), weakref.ref(project(predicted, truth).faces)]
    del truth
    gc.collect()
    assert [reference() for reference in kept] == [None, None]


def test_projection_equals_brute_force_on_triangles():
    samples = sample_surface(labelled(trimesh.creation.icosphere(subdivisions=1, radius=0.7)), 200, 0)
    onto = sample_surface(cube(), 1, 0)
    triangles = onto.mesh.vertices[onto.mesh.faces]
    closest = np.array([trimesh.triangles.closest_point(triangles, np.tile(p, (12, 1))) for p in samples.points])
    distances = np.linalg.norm(closest - samples.points[:, None], axis=2)
    found = project(samples, onto)
    np.testing.assert_allclose(found.distances, distances.min(axis=1), atol=1e-12)
    np.testing.assert_allclose(distances[np.arange(200), found.faces], distances.min(axis=1), atol=1e-12)


def test_label_scores_equal_scikit_learn():
    rng = np.random.default_rng(1)
    part_ids = np.array([0, 3, 4, 17, 20])  # 20 is in neither; 5 is predicted only
    true = rng.choice([-1, 0, 3, 4, 17], 4000)
    predicted = np.where(rng.random(4000) < 0.6, true, rng.choice([-1, 0, 3, 5, 17], 4000))
    counts = count_confusion(true, predicted, part_ids)
    iou, acc = label_scores(counts)
    kept = true >= 0
    reference = (true[kept], predicted[kept])
    every = [*part_ids, -1, 5]
    full = confusion_matrix(*reference, labels=every)
    assert (counts == np.c_[full[:5, :5], full[:5, 5:].sum(axis=1)]).all()
    np.testing.assert_allclose(iou, jaccard_score(*reference, labels=part_ids, average=None, zero_division=0))
    assert acc == pytest.approx(accuracy_score(*reference))
    assert iou[4] == 0
    assert iou[2] < 1


def label_columns(predicted: LabelledMesh, truth: LabelledMesh) -> dict[str, float]:
    columns = {}
    for metric in LABEL_METRICS:
        columns |= score(metric, predicted, truth, count=500)
    return columns


@pytest.mark.parametrize("missing", ["prediction", "truth", "both"])
def test_label_scores_are_nan_without_labels(missing):
    with_labels, without = cube(labels=np.arange(12) // 2), cube(labels=np.full(12, -1))
    pair = {"prediction": (without, with_labels), "truth": (with_labels, without), "both": (without, without)}[missing]
    found = label_columns(*pair)
    assert {key for key in LABEL_KEYS if math.isnan(found[key])} == LABEL_KEYS
    assert found["parts_pred"] == (6 if missing == "truth" else 0)
    assert found["parts_gt"] == (6 if missing == "prediction" else 0)
    per_part = {key for key in found if key.startswith("iou_")}
    assert len(per_part) == found["parts_gt"]
    assert all(math.isnan(found[key]) for key in per_part)


def test_single_part_everywhere_is_perfect():
    one = cube(labels=np.full(12, 3))
    found = label_columns(one, one)
    assert {key: found[key] for key in LABEL_KEYS} == dict.fromkeys(LABEL_KEYS, 1.0)
    assert (found["iou_3"], found["parts_pred"], found["parts_gt"]) == (1.0, 1.0, 1.0)


def test_empty_prediction_scores_zero_and_its_lengths_are_nan():
    truth = cube(labels=np.arange(12) // 2)
    found = label_columns(EMPTY, truth)
    for metric in (Chamfer(), NormalConsistency(), FScore(), SurfaceDistance()):
        found |= metric(NO_SAMPLES, sample_surface(truth, 100, 0))
    zero = {key for key in found if found[key] == 0}
    assert zero == LABEL_KEYS - {"consistency"} | {"f1", "parts_pred"} | {f"iou_{part}" for part in range(6)}
    undefined = {key for key in found if math.isnan(found[key])}
    assert undefined == {"cd_l1", "cd_l2", "nc", "surface_mean", "surface_p99", "surface_max", "consistency"}
    assert found.keys() - zero - undefined == {"parts_gt"}
