"""The contract of every metric that the evaluation configuration names."""

import math

import numpy as np
import pytest
from blocks import PROTOCOLS, block
from labelled_meshes import EMPTY
from scipy.spatial.transform import Rotation

from jointsdf.evaluation.protocol import bounding_frame, sample_surface
from jointsdf.values import LabelledMesh, SurfaceSamples

TRUTH, OFF = block(), block(labels_split=0.2, size=1.006)
METRICS = [(protocol, metric) for protocol in PROTOCOLS for metric in PROTOCOLS[protocol].metrics]
BEST = {"cd_l1": 0, "cd_l2": 0, "surface_mean": 0, "surface_p99": 0, "surface_max": 0} | dict.fromkeys(
    ("nc", "f1", "miou", "acc", "miou_exact", "acc_exact", "boundary_f1"), 1
)
BEST |= dict.fromkeys(("edge_cd", "crease_angle_error", "false_crease_length", "flatness"), 0)
BEST |= dict.fromkeys(("edge_f1", "edge_f1_fine", "crease_length_ratio", "crease_nc"), 1)

UNDEFINED = {"crease_border_p99", "crease_border_back_p99"}  # the borders of the blocks run across their sides


@pytest.fixture(params=METRICS, ids=lambda pair: f"{pair[0]}-{pair[1]}")
def metric(request):
    protocol, name = request.param
    return PROTOCOLS[protocol].metrics[name]


def unit_samples(mesh: LabelledMesh, seed: int) -> SurfaceSamples:
    framed = LabelledMesh(bounding_frame(TRUTH).forward(mesh.vertices), mesh.faces, mesh.labels)
    return sample_surface(framed, 1500, seed)


def test_identity_gives_the_best_value(metric):
    samples = unit_samples(TRUTH, 1)
    found = metric(samples, samples)
    assert all(type(value) is float for value in found.values())
    undefined = {key for key, value in found.items() if not math.isfinite(value)}
    assert undefined == found.keys() & UNDEFINED
    for key, value in found.items():
        best = 1 if key.startswith("iou_") else BEST.get(key)
        assert best is None or value == pytest.approx(best, abs=1e-9), key
        assert value == found.get(f"{key}_gt", value) or key in UNDEFINED, key


def test_nothing_predicted_raises_nothing_and_keeps_the_columns(metric):
    truth = unit_samples(TRUTH, 1)
    found = metric(sample_surface(EMPTY, 1500, 2), truth)
    assert found.keys() == metric(truth, truth).keys()
    assert all(type(value) is float for value in found.values())
    for key in found.keys() & BEST.keys():
        assert found[key] == 0 if BEST[key] == 1 and key not in ("nc", "crease_nc") else math.isnan(found[key]), key


def reordered(samples: SurfaceSamples, rng: np.random.Generator) -> SurfaceSamples:
    """The same samples on the same surface, with vertices, faces and corners of each face in another order."""
    mesh = samples.mesh
    new_vertex, new_face = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.faces))
    vertices, faces, labels = np.zeros_like(mesh.vertices), np.zeros_like(mesh.faces), np.zeros_like(mesh.labels)
    vertices[new_vertex] = mesh.vertices
    faces[new_face] = np.roll(new_vertex[mesh.faces], 1, axis=1)
    labels[new_face] = mesh.labels
    return SurfaceSamples(
        LabelledMesh(vertices, faces, labels), samples.points, samples.normals, new_face[samples.faces]
    )


def test_order_of_vertices_and_faces_is_without_meaning(metric):
    predicted, truth = unit_samples(OFF, 1), unit_samples(TRUTH, 2)
    rng = np.random.default_rng(0)
    found = metric(reordered(predicted, rng), reordered(truth, rng))
    assert found == pytest.approx(metric(predicted, truth), abs=1e-9, nan_ok=True)


def rotated(samples: SurfaceSamples, rotation: Rotation) -> SurfaceSamples:
    mesh = LabelledMesh(rotation.apply(samples.mesh.vertices), samples.mesh.faces, samples.mesh.labels)
    return SurfaceSamples(mesh, rotation.apply(samples.points), rotation.apply(samples.normals), samples.faces)


def test_common_rotation_is_without_meaning(metric):
    predicted, truth = unit_samples(OFF, 1), unit_samples(TRUTH, 2)
    quarter_turn_only = getattr(metric, "form", None) == "axes"
    rotation = Rotation.from_euler("xyz", [90, 0, 0] if quarter_turn_only else [20, 40, 70], degrees=True)
    found = metric(rotated(predicted, rotation), rotated(truth, rotation))
    assert found == pytest.approx(metric(predicted, truth), abs=1e-9, nan_ok=True)


def test_a_frame_gives_what_moving_the_mesh_gives(metric):
    frame = bounding_frame(TRUTH)
    found = metric(sample_surface(OFF, 1500, 1, frame), sample_surface(TRUTH, 1500, 2, frame))
    assert found == pytest.approx(metric(unit_samples(OFF, 1), unit_samples(TRUTH, 2)), abs=1e-9, nan_ok=True)


def test_metric_leaves_the_samples_alone(metric):
    predicted, truth = unit_samples(OFF, 1), unit_samples(TRUTH, 2)
    for samples in (predicted, truth):
        for array in (samples.points, samples.normals, samples.faces, *vars(samples.mesh).values()):
            array.setflags(write=False)
    metric(predicted, truth)


def test_metric_has_the_columns_that_it_asks_references_of(metric):
    truth = unit_samples(TRUTH, 1)
    assert {*getattr(metric, "floors", ()), *getattr(metric, "ceilings", ())} <= metric(truth, truth).keys()
