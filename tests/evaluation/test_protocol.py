"""Protocols end to end, and the samples that they draw."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from blocks import CONFIG, OFF, PROTOCOLS, TRUTH, block
from labelled_meshes import EMPTY
from scipy.stats import chisquare

from jointsdf.errors import InputError
from jointsdf.evaluation.protocol import GroundTruth, Protocol, bounding_frame, sample_surface
from jointsdf.metrics import project
from jointsdf.metrics.chamfer import Chamfer
from jointsdf.metrics.exact_labels import ExactLabels
from jointsdf.metrics.f_score import FScore
from jointsdf.values import LabelledMesh

FLOORS = {f"{key}_floor" for key in ("cd_l1", "cd_l2", "nc", "f1", "miou", "acc", "consistency")}
EDGES = {"edge_cd", "edge_f1", "edge_f1_fine", "crease_angle_error", "crease_length_ratio", "false_crease_length"}
BORDERS = {"crease_border_p99", "crease_border_back_p99"}
SURFACES = {"crease_nc", "flatness"}
LENGTHS = EDGES - {"edge_f1", "edge_f1_fine", "crease_length_ratio"} | BORDERS | SURFACES
LENGTHS |= {f"{key}_ceiling" for key in LENGTHS}  # and angles: undefined of nothing
CEILINGS = {
    f"{key}_ceiling"
    for key in (
        "miou_exact",
        "acc_exact",
        "boundary_f1",
        "boundary_f1_fine",
        "parts",
        "specks",
        *EDGES,
        *BORDERS,
        *SURFACES,
    )
}
SCORED = {"parts_ceiling": "parts_pred"}  # where the column has another name


def without_labels(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(mesh.vertices, mesh.faces, np.full(len(mesh.faces), -1))


def small(name: str, points: int = 2000) -> dict[str, Protocol]:
    """A configured protocol, with fewer points."""
    protocol = PROTOCOLS[name]
    return {name: Protocol(name=name, points=points, frame=protocol.frame, metrics=protocol.metrics)}


def scores(predicted: LabelledMesh, truth: LabelledMesh, ceiling=None, name="unit", points=2000) -> dict[str, float]:
    reference = GroundTruth(truth, small(name, points))
    return reference.scores(predicted)[name] | reference.references(ceiling)[name]


def test_samples_lie_in_their_faces_with_their_normals():
    samples = sample_surface(OFF, 3000, 0)
    assert samples.points.dtype == np.float64
    corners = OFF.vertices[OFF.faces[samples.faces]]
    weights = trimesh.triangles.points_to_barycentric(corners, samples.points)
    assert weights.min() >= -1e-9
    np.testing.assert_allclose(np.einsum("nc,ncd->nd", weights, corners), samples.points, atol=1e-9)
    np.testing.assert_allclose(samples.normals, trimesh.triangles.normals(corners)[0], atol=1e-9)
    assert (samples.labels == OFF.labels[samples.faces]).all()
    assert project(samples, samples).distances.max() < 1e-9


def test_samples_are_uniform_by_area_between_and_within_faces():
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 1, 4], [1, 2, 4]])  # the third has no area
    mesh = LabelledMesh(vertices, faces, np.zeros(4, dtype=np.int64))
    samples = sample_surface(mesh, 40_000, 3)
    areas = trimesh.triangles.area(vertices[faces])
    counts = np.bincount(samples.faces, minlength=4)
    assert counts[2] == 0
    kept = areas > 0
    assert chisquare(counts[kept], areas[kept] / areas.sum() * counts.sum()).pvalue > 1e-3
    inside = samples.points[samples.faces == 0][:, :2] / [4, 1]  # the triangle x + y < 1: four equal quarters
    quarters = [inside[:, 0] > 0.5, inside[:, 1] > 0.5, inside.sum(axis=1) < 0.5]
    found = [*(part.sum() for part in quarters), (~np.any(quarters, axis=0)).sum()]
    assert chisquare(found).pvalue > 1e-3


def test_samples_are_a_function_of_the_seed():
    first, again, other = (sample_surface(TRUTH, 50, seed) for seed in (5, 5, 6))
    assert np.array_equal(first.points, again.points)
    assert np.array_equal(first.faces, again.faces)
    assert not np.array_equal(first.points, other.points)


@pytest.mark.parametrize("mesh", [EMPTY, LabelledMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), np.zeros(1, int))])
def test_mesh_without_area_gets_no_samples(mesh):
    assert sample_surface(mesh, 50, 0).points.shape == (0, 3)


def test_bounding_frame_centres_and_scales_the_used_vertices():
    used = block()
    mesh = LabelledMesh(np.r_[used.vertices, [[1e6, 0, 0]]], used.faces, used.labels)
    unit = bounding_frame(mesh).forward(used.vertices)
    np.testing.assert_allclose(unit.max(axis=0), [0.5, 1 / 3, 1 / 6], atol=1e-12)
    np.testing.assert_allclose(unit.min(axis=0), [-0.5, -1 / 3, -1 / 6], atol=1e-12)


def test_configuration_is_the_specified_protocols():
    assert CONFIG.primary in PROTOCOLS
    found = {name: (p.name, p.points, p.frame, p.metrics["normal_consistency"].form) for name, p in PROTOCOLS.items()}
    assert found == {"unit": ("unit", 30_000, "truth", "cosine"), "flatcad": ("flatcad", 100_000, "own", "axes")}
    assert PROTOCOLS["unit"].metrics.keys() == PROTOCOLS["flatcad"].metrics.keys()
    assert PROTOCOLS["unit"].metrics["f_score"].threshold == 0.005


@pytest.mark.parametrize("name", PROTOCOLS)
def test_row_has_exactly_these_columns(name):
    found = scores(OFF, TRUTH, name=name)
    plain = {"nc", "f1", "miou", "acc", "consistency", "parts_pred", "parts_gt", "iou_2", "iou_7", "cd_l1", "cd_l2"}
    exact = {"surface_mean", "surface_p99", "surface_max", "miou_exact", "acc_exact", "boundary_f1", "boundary_f1_fine"}
    topology = {"components", "components_gt", "euler", "euler_gt", "volume", "volume_gt", "specks"}
    assert found.keys() == plain | exact | topology | EDGES | BORDERS | SURFACES | FLOORS | CEILINGS


def test_perfect_prediction_scores_its_floor_and_the_exact_best():
    found = scores(TRUTH, TRUTH)
    for key in FLOORS:
        assert found[key] == found[key.removesuffix("_floor")], key
    assert found["cd_l1_floor"] > 0.5  # noise between two clouds, not zero
    exact = ("surface_max", "miou_exact", "acc_exact", "boundary_f1", "boundary_f1_fine")
    assert [found[key] for key in exact] == pytest.approx([0, 1, 1, 1, 1], abs=1e-9)
    assert (found["volume"], found["volume_gt"]) == pytest.approx((6 / 27, 6 / 27))


def test_floor_and_truth_do_not_depend_on_the_prediction():
    one, other, none = scores(OFF, TRUTH), scores(block(size=0.7), TRUTH), scores(EMPTY, TRUTH)
    for key in [*FLOORS, "parts_gt", "euler_gt", "volume_gt"]:
        assert one[key] == other[key] == none[key], key
        assert math.isfinite(one[key])


def test_ceiling_is_the_score_of_the_ceiling_mesh():
    found, perfect = scores(TRUTH, TRUTH, ceiling=OFF), scores(OFF, TRUTH, ceiling=None)
    for key in CEILINGS:
        assert found[key] == pytest.approx(
            perfect[SCORED.get(key, key.removesuffix("_ceiling"))], rel=0, abs=0, nan_ok=True
        )
        assert math.isnan(perfect[key])
    assert all(
        found[f"{key}_ceiling"] < 1 for key in ("miou_exact", "acc_exact", "boundary_f1", "edge_f1", "crease_nc")
    )
    assert found["flatness_ceiling"] == pytest.approx(0.01)


def test_truth_frame_sees_scale_and_place_where_own_frame_does_not():
    moved = LabelledMesh(TRUTH.vertices * 1.5 + [3.0, 0, 0], TRUTH.faces, TRUTH.labels)
    unit, own = scores(moved, TRUTH, name="unit"), scores(moved, TRUTH, name="flatcad")
    assert own["cd_l1"] == pytest.approx(own["cd_l1_floor"], rel=1e-6)
    assert unit["cd_l1"] > 20 * unit["cd_l1_floor"]
    assert unit["volume"] == pytest.approx(1.5**3 * unit["volume_gt"])
    assert own["volume"] == pytest.approx(own["volume_gt"])


@pytest.mark.parametrize("name", PROTOCOLS)
def test_common_move_and_scale_is_without_meaning(name):
    def moved(mesh):
        return LabelledMesh(mesh.vertices * 25.4 + [100.0, -7, 3], mesh.faces, mesh.labels)

    expected = scores(OFF, TRUTH, ceiling=OFF, name=name)
    assert scores(moved(OFF), moved(TRUTH), ceiling=moved(OFF), name=name) == pytest.approx(
        expected, rel=1e-6, abs=1e-9, nan_ok=True
    )


def test_narrow_input_types_are_measured_in_float64():
    def narrow(mesh):
        return LabelledMesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), mesh.labels.astype(np.int32))

    assert scores(narrow(OFF), narrow(TRUTH)) == pytest.approx(scores(OFF, TRUTH), rel=1e-3, abs=1e-4, nan_ok=True)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_empty_prediction_is_a_row_not_an_exception(name):
    found = scores(EMPTY, TRUTH, ceiling=EMPTY, name=name)
    undefined = {key for key, value in found.items() if math.isnan(value)} - LENGTHS
    assert {key for key in LENGTHS if math.isnan(found[key])} == LENGTHS
    assert undefined == {"cd_l1", "cd_l2", "nc", "surface_mean", "surface_p99", "surface_max", "consistency"}
    zero = (
        "f1",
        "miou",
        "acc",
        "miou_exact",
        "acc_exact",
        "boundary_f1",
        "boundary_f1_fine",
        "components",
        "volume",
        "edge_f1",
        "edge_f1_fine",
        "crease_length_ratio",
        *(CEILINGS - LENGTHS),
    )
    assert [found[key] for key in zero] == [0.0] * len(zero)


def test_geometry_is_measured_without_labels():
    found, expected = scores(without_labels(OFF), TRUTH), scores(OFF, TRUTH)
    labels = {
        "miou",
        "acc",
        "consistency",
        "iou_2",
        "iou_7",
        "miou_exact",
        "acc_exact",
        "boundary_f1",
        "boundary_f1_fine",
        "crease_angle_error",  # the edges of OFF are too far away
        *BORDERS,
        *CEILINGS,
    }
    assert {key for key, value in found.items() if math.isnan(value)} == labels
    assert found["parts_pred"] == 0
    kept = found.keys() - labels - {"parts_pred"}
    assert {key: found[key] for key in kept} == {key: expected[key] for key in kept}


def test_unlabelled_truth_has_no_label_floor_and_no_parts():
    found = scores(without_labels(OFF), without_labels(TRUTH))
    assert {key for key in FLOORS if math.isnan(found[key])} == {"miou_floor", "acc_floor", "consistency_floor"}
    assert found["parts_gt"] == 0
    assert not any(key.startswith("iou_") for key in found)


def test_bad_settings_are_one_line():
    with pytest.raises(InputError, match=r"frame='box': use one of truth, own"):
        Protocol(name="p", points=10, frame="box", metrics={})
    with pytest.raises(InputError, match=r"points=0"):
        Protocol(name="p", points=0, frame="own", metrics={})
    twice = {"p": Protocol(name="p", points=10, frame="own", metrics={"a": FScore(), "b": FScore(threshold=0.01)})}
    with pytest.raises(InputError, match=r"'b' repeats the column 'f1'"):
        GroundTruth(TRUTH, twice).scores(TRUTH)


def test_floors_run_only_for_the_metrics_that_ask():
    protocol = {"p": Protocol(name="p", points=100, frame="own", metrics={"a": Chamfer(), "b": ExactLabels()})}
    reference = GroundTruth(TRUTH, protocol)
    assert reference.scores(TRUTH)["p"].keys() == {"cd_l1", "cd_l2", "miou_exact", "acc_exact"}
    expected = {"cd_l1_floor", "cd_l2_floor", "miou_exact_ceiling", "acc_exact_ceiling"}
    assert reference.references(TRUTH)["p"].keys() == expected


@pytest.mark.skipif("JOINTSDF_ABC" not in os.environ, reason="JOINTSDF_ABC does not name a folder of ABC shapes")
def test_floors_of_a_real_shape_are_in_the_known_range():
    folder = Path(os.environ["JOINTSDF_ABC"]) / "abc_0049"
    mesh = trimesh.load_mesh(folder / "mesh.ply", process=False)
    labels = np.load(folder / "patches.npy").astype(np.int64)
    shape = LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), labels)
    truth = GroundTruth(shape, {"unit": PROTOCOLS["unit"]})
    found = truth.references(None)["unit"] | truth.scores(shape)["unit"]
    assert 0.155 <= found["cd_l1_floor"] <= 0.780
    assert found["f1_floor"] == pytest.approx(0.775, abs=0.2)
    assert found["acc_floor"] == pytest.approx(0.977, abs=0.02)
    assert found["miou_floor"] == pytest.approx(0.897, abs=0.08)
    assert found["consistency_floor"] == pytest.approx(0.935, abs=0.05)
    assert (found["parts_gt"], found["components_gt"]) == (15, 1)
    assert (found["surface_max"], found["acc_exact"]) == pytest.approx((0, 1), abs=1e-6)
