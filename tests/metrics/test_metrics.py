"""Metrics against brute force, scikit-learn, torchmetrics and shapes with known answers."""

import gc
import math
import weakref

import numpy as np
import pytest
import torch
import trimesh
from sklearn.metrics import accuracy_score, confusion_matrix, jaccard_score
from torchmetrics.functional.classification import multiclass_jaccard_index

from jointsdf.errors import InputError
from jointsdf.evaluation.protocol import sample_surface
from jointsdf.metrics import confusion, label_scores, match, project
from jointsdf.metrics.boundary import Boundary, points_along
from jointsdf.metrics.chamfer import Chamfer
from jointsdf.metrics.consistency import Consistency
from jointsdf.metrics.exact_labels import ExactLabels
from jointsdf.metrics.f_score import FScore
from jointsdf.metrics.normal_consistency import NormalConsistency
from jointsdf.metrics.segmentation import Segmentation
from jointsdf.metrics.surface_distance import SurfaceDistance
from jointsdf.metrics.topology import Topology
from jointsdf.values import LabelledMesh, SurfaceSamples

EMPTY = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
NO_SAMPLES = sample_surface(EMPTY, 10, 0)


def cloud(points, labels=None, normals=None) -> SurfaceSamples:
    """Samples that are a mesh of their own: one tiny triangle per point, so that any label per point is possible."""
    points = np.asarray(points, dtype=float)
    count = len(points)
    labels = np.zeros(count, dtype=np.int64) if labels is None else np.asarray(labels)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1)) if normals is None else normals
    corners = points[:, None] + 1e-9 * np.array([[1, 0, 0], [0, 1, 0], [-1, -1, 0]])
    faces = np.arange(3 * count).reshape(-1, 3)
    return SurfaceSamples(LabelledMesh(corners.reshape(-1, 3), faces, labels), points, normals, np.arange(count))


def directions(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def labelled(mesh: trimesh.Trimesh, labels=None) -> LabelledMesh:
    labels = np.zeros(len(mesh.faces), dtype=np.int64) if labels is None else np.asarray(labels)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), labels)


def cube(shift=(0.0, 0.0, 0.0), labels=None) -> LabelledMesh:
    box = trimesh.creation.box(extents=(1, 1, 1))
    box.apply_translation(shift)
    return labelled(box, labels)


def plate(border_at) -> LabelledMesh:
    """The square [0, 1]^2 in cells of 0.005 x 0.02; label 1 where x > border_at(y), which must fall on cell lines."""
    x, y = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 51), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(200)[:, None] * 51 + np.arange(50)).reshape(-1)
    faces = np.stack([first, first + 51, first + 52, first, first + 52, first + 1], axis=1).reshape(-1, 3)
    centre = vertices[faces].mean(axis=1)
    return LabelledMesh(vertices, faces, (centre[:, 0] > border_at(centre[:, 1])).astype(np.int64))


def score(metric, predicted: LabelledMesh, truth: LabelledMesh, count=2000) -> dict[str, float]:
    return metric(sample_surface(predicted, count, 1), sample_surface(truth, count, 2))


# Nearest neighbours and what is made of them


@pytest.fixture
def clouds():
    rng = np.random.default_rng(0)
    return [cloud(rng.random((n, 3)) * 0.3, rng.integers(-1, 5, n), directions(rng, n)) for n in (300, 200)]


def test_distances_equal_brute_force(clouds):
    predicted, truth = clouds
    distances = np.linalg.norm(predicted.points[:, None] - truth.points[None], axis=2)
    to_truth, to_predicted = distances.min(axis=1), distances.min(axis=0)
    found = Chamfer()(predicted, truth)
    assert found["cd_l1"] == pytest.approx(100 * (to_truth.mean() + to_predicted.mean()) / 2, rel=1e-12)
    assert found["cd_l2"] == pytest.approx(100 * ((to_truth**2).mean() + (to_predicted**2).mean()) / 2, rel=1e-12)
    precision, recall = (to_truth < 0.02).mean(), (to_predicted < 0.02).mean()
    assert 0.1 < precision < 0.9
    assert FScore(threshold=0.02)(predicted, truth)["f1"] == pytest.approx(2 / (1 / precision + 1 / recall))


@pytest.mark.parametrize("form", ["cosine", "axes"])
def test_normal_consistency_equals_a_loop(clouds, form):
    predicted, truth = clouds

    def one_way(first, second):
        total = 0.0
        for point, normal in zip(first.points, first.normals, strict=True):
            other = second.normals[np.argmin(((second.points - point) ** 2).sum(axis=1))]
            total += (
                abs(normal @ other) if form == "cosine" else sum(abs(a * b) for a, b in zip(normal, other, strict=True))
            )
        return total / len(first.points)

    expected = (one_way(predicted, truth) + one_way(truth, predicted)) / 2
    assert NormalConsistency(form=form)(predicted, truth)["nc"] == pytest.approx(expected, rel=1e-12)


def test_parallel_planes_are_their_distance_apart():
    rng = np.random.default_rng(0)
    points = np.c_[rng.random((500, 2)), np.zeros(500)]
    found = Chamfer()(cloud(points + np.array([0, 0, 0.02])), cloud(points))
    assert found["cd_l1"] == pytest.approx(2.0, rel=1e-12)
    assert found["cd_l2"] == pytest.approx(0.04, rel=1e-12)


def test_concentric_spheres_are_their_gap_apart():
    rays = directions(np.random.default_rng(0), 500)
    predicted, truth = cloud(0.45 * rays, normals=-rays), cloud(0.5 * rays, normals=rays)
    assert Chamfer()(predicted, truth)["cd_l1"] == pytest.approx(5.0, rel=1e-9)
    assert NormalConsistency()(predicted, truth)["nc"] == pytest.approx(1.0, rel=1e-12)
    assert FScore(threshold=0.051)(predicted, truth)["f1"] == 1.0
    assert FScore(threshold=0.049)(predicted, truth)["f1"] == 0.0


def test_axes_form_exceeds_the_cosine_of_crossed_normals():
    first, second = np.array([[0.6, 0.8, 0.0]]), np.array([[0.8, -0.6, 0.0]])
    predicted, truth = cloud([[0, 0, 0]], normals=first), cloud([[0, 0, 0]], normals=second)
    assert NormalConsistency(form="cosine")(predicted, truth)["nc"] == pytest.approx(0.0, abs=1e-15)
    assert NormalConsistency(form="axes")(predicted, truth)["nc"] == pytest.approx(0.96)


def test_unknown_form_is_refused():
    with pytest.raises(InputError, match=r"'angle'.*cosine, axes"):
        NormalConsistency(form="angle")


def test_a_search_runs_once_and_is_forgotten_with_its_samples(clouds):
    predicted, truth = clouds[0], cloud(clouds[1].points)
    for search in (match, project):
        assert search(predicted, truth)[0] is search(predicted, truth)[0]
        assert search(truth, predicted)[0] is not search(predicted, truth)[0]
    kept = [weakref.ref(match(predicted, truth).to_truth), weakref.ref(project(predicted, truth).faces)]
    del truth
    gc.collect()
    assert [reference() for reference in kept] == [None, None]


# Labels by nearest neighbour


def test_label_scores_equal_scikit_learn():
    rng = np.random.default_rng(1)
    part_ids = np.array([0, 3, 4, 17, 20])  # 20 is in neither; 5 is predicted only
    true = rng.choice([-1, 0, 3, 4, 17], 4000)
    predicted = np.where(rng.random(4000) < 0.6, true, rng.choice([-1, 0, 3, 5, 17], 4000))
    counts = confusion(true, predicted, part_ids)
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


# Label consistency


def test_consistency_equals_a_loop():
    rng = np.random.default_rng(3)
    points, labels = rng.random((400, 3)), rng.integers(0, 3, 400)
    samples = cloud(points, labels)
    shares = []
    for i in range(400):
        order = np.argsort(((points - points[i]) ** 2).sum(axis=1), kind="stable")
        near = [j for j in order if j != i][:10]
        shares.append(np.mean(labels[near] == labels[i]))
    assert Consistency()(samples, samples)["consistency"] == pytest.approx(np.mean(shares), rel=1e-12)


def test_consistency_of_a_subset_of_anchors_is_seeded():
    rng = np.random.default_rng(3)
    samples = cloud(rng.random((400, 3)), rng.integers(0, 3, 400))
    first, again, other = (Consistency(anchors=50, seed=s)(samples, samples)["consistency"] for s in (0, 0, 1))
    assert first == again != other


def test_anchor_is_never_its_own_neighbour():
    # Ties hide which entry is the anchor: of 30 points in one place, it may not be among its own 10 nearest.
    places, labels = np.repeat([[0.0, 0, 0], [1, 0, 0]], [30, 10], axis=0), np.r_[np.full(30, 50), np.arange(10)]
    mixed = cloud(places, labels)
    assert Consistency(neighbours=9)(mixed, mixed)["consistency"] == 0.75
    distinct = cloud(np.zeros((5, 3)), np.arange(5))
    assert Consistency(neighbours=2)(distinct, distinct)["consistency"] == 0.0


def test_consistency_leaves_unlabelled_samples_out():
    points = np.c_[np.arange(6.0), np.zeros((6, 2))]
    samples = cloud(points, [0, -1, 0, -1, 1, 1])
    assert Consistency(neighbours=1)(samples, samples)["consistency"] == 1.0


def test_consistency_of_few_samples():
    two = cloud(np.eye(3)[:2], [0, 1])
    assert Consistency()(two, two)["consistency"] == 0.0
    one = cloud([[0, 0, 0]], [0])
    assert math.isnan(Consistency()(one, one)["consistency"])


# The surfaces themselves


def test_shifted_cube_has_the_integrated_distance():
    shift = 0.1
    found = score(SurfaceDistance(), cube(shift=(shift, 0, 0)), cube(), count=40_000)
    # Outer end: shift. Inner end: the nearest of shift and four sides. Sides: a strip that sticks out by 0..shift.
    mean = (shift + (1 - (1 - 2 * shift) ** 3) / 6 + 4 * shift**2 / 2) / 6
    assert found["surface_mean"] == pytest.approx(mean, rel=0.02)
    assert found["surface_p99"] == pytest.approx(shift, rel=1e-9)
    assert found["surface_max"] == pytest.approx(shift, rel=1e-9)


def test_surface_distance_is_free_of_sampling_noise_and_sees_a_far_sheet_on_either_side():
    far = trimesh.util.concatenate(
        [trimesh.creation.box(), trimesh.creation.box(extents=(0.1, 0.1, 0.1)).apply_translation((5, 0, 0))]
    )
    assert score(SurfaceDistance(), cube(), cube())["surface_max"] == pytest.approx(0.0, abs=1e-12)
    for pair in ((labelled(far), cube()), (cube(), labelled(far))):
        assert score(SurfaceDistance(), *pair, count=20_000)["surface_max"] == pytest.approx(4.55, rel=1e-3)


def test_projection_equals_brute_force_on_triangles():
    samples = sample_surface(labelled(trimesh.creation.icosphere(subdivisions=1, radius=0.7)), 200, 0)
    onto = sample_surface(cube(), 1, 0)
    triangles = onto.mesh.vertices[onto.mesh.faces]
    closest = np.array([trimesh.triangles.closest_point(triangles, np.tile(p, (12, 1))) for p in samples.points])
    distances = np.linalg.norm(closest - samples.points[:, None], axis=2)
    found = project(samples, onto)
    np.testing.assert_allclose(found.distances, distances.min(axis=1), atol=1e-12)
    np.testing.assert_allclose(distances[np.arange(200), found.faces], distances.min(axis=1), atol=1e-12)


# Labels of the closest face


def test_half_of_the_faces_mislabelled_gives_their_share_of_the_samples():
    truth = cube(labels=np.arange(12) // 2)
    wrong = truth.labels.copy()
    wrong[::2] = (wrong[::2] + 1) % 6
    samples = sample_surface(cube(labels=wrong), 5000, 1)
    found = ExactLabels()(samples, sample_surface(truth, 50, 2))
    true = truth.labels[samples.faces]
    assert found["acc_exact"] == accuracy_score(true, samples.labels)
    assert found["acc_exact"] == pytest.approx(0.5, abs=0.03)
    assert found["miou_exact"] == pytest.approx(jaccard_score(true, samples.labels, average="macro"))


def test_exact_labels_ignore_unlabelled_faces_and_score_a_missed_part_zero():
    truth = cube(labels=np.r_[np.full(6, -1), np.full(4, 2), [8, 8]])
    assert score(ExactLabels(), cube(labels=truth.labels), truth) == {"miou_exact": 1.0, "acc_exact": 1.0}
    only_two = score(ExactLabels(), cube(labels=np.full(12, 2)), truth, count=20_000)
    assert only_two["acc_exact"] == pytest.approx(2 / 3, abs=0.02)
    assert only_two["miou_exact"] == pytest.approx(1 / 3, abs=0.01)


# Borders between parts


@pytest.mark.parametrize(("shift", "expected"), [(0.0, 1.0), (0.005, 1.0), (0.015, 0.0), (0.1, 0.0)])
def test_displaced_border_counts_up_to_the_tolerance(shift, expected):
    assert score(Boundary(), plate(lambda _: 0.5 + shift), plate(lambda _: 0.5))["boundary_f1"] == expected


def test_border_that_leaves_counts_by_length():
    away = plate(lambda y: np.where(y < 0.3, 0.5, 0.55))
    found = score(Boundary(), away, plate(lambda _: 0.5))["boundary_f1"]
    precision, recall = (0.3 + 0.01) / (1.0 + 0.05), 0.3 + 0.01  # the last 0.01: around the corner
    assert found == pytest.approx(2 * precision * recall / (precision + recall), abs=0.002)


def test_meshes_without_border():
    one, two = cube(labels=np.zeros(12, int)), cube(labels=np.arange(12) // 2)
    assert score(Boundary(), one, one)["boundary_f1"] == 1.0
    assert score(Boundary(), one, two)["boundary_f1"] == 0.0
    assert score(Boundary(), two, one)["boundary_f1"] == 0.0


def test_points_along_edges_are_even_and_carry_the_length():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0.0004, 0], [1, 0.0004, 0]])
    mesh = LabelledMesh(vertices, np.zeros((0, 3), int), np.zeros(0, int))
    points, lengths = points_along(mesh, np.array([[0, 1], [1, 2], [2, 3]]), 0.001)
    assert len(points) == 1001
    np.testing.assert_allclose(points[:1000, 0], (np.arange(1000) + 0.5) / 1000, atol=1e-12)
    np.testing.assert_allclose(points[1000], [1, 0.0002, 0], atol=1e-15)
    assert lengths.sum() == pytest.approx(1.0004)


# Pieces, holes, volume


def test_topology_is_reported_for_both_meshes_and_sees_orientation():
    inside_out = LabelledMesh(cube().vertices, cube().faces[:, ::-1].copy(), cube().labels)
    found = score(Topology(), inside_out, labelled(trimesh.creation.torus(1.0, 0.3)))
    assert found["volume"] == pytest.approx(-1.0)
    assert (found["components"], found["euler"], found["components_gt"], found["euler_gt"]) == (1, 2, 1, 0)
    assert found["volume_gt"] == pytest.approx(2 * np.pi**2 * 0.09, rel=0.05)


# Nothing to measure


LABEL_METRICS = [Segmentation(), Consistency(), ExactLabels(), Boundary()]
LABEL_KEYS = {"miou", "acc", "consistency", "miou_exact", "acc_exact", "boundary_f1"}


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
