"""Errors of a field as a distance: of scaled, shifted and folded distances of a cube, whose errors are known."""

import math

import numpy as np
import pytest
import trimesh

from jointsdf.errors import InputError
from jointsdf.geometry.distance import ExactDistance
from jointsdf.metrics.distance import BANDS, COLUMNS, Distance, UnitField, find_probes, score_field
from jointsdf.values import LabelledMesh

HALF = 0.5
BOX = np.array([[-0.6, -0.6, -0.6], [0.6, 0.6, 0.6]])
COUNT = 4000


def exact_distance(mesh: trimesh.Trimesh) -> ExactDistance:
    faces = np.asarray(mesh.faces, dtype=np.int64)
    return ExactDistance(LabelledMesh(np.array(mesh.vertices), faces, np.zeros(len(faces), int)), watertight=True)


CUBE = exact_distance(trimesh.creation.box((1.0, 1.0, 1.0)))


def cube(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance to the unit cube and its gradient, in closed form."""
    q = np.abs(points) - HALF
    outside = np.maximum(q, 0)
    length = np.linalg.norm(outside, axis=1)
    inner = np.eye(3)[q.argmax(axis=1)]
    gradient = np.where((length > 0)[:, None], outside / np.maximum(length, 1e-300)[:, None], inner)
    return length + np.minimum(q.max(axis=1), 0), gradient * np.where(points < 0, -1, 1)


def scaled(factor: float, shift: float = 0.0) -> UnitField:
    def field(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, gradients = cube(points)
        return factor * values + shift, factor * gradients

    return field


def test_probes_are_the_closed_form() -> None:
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (COUNT, 3))
    probes, (values, gradients) = find_probes(CUBE, points), cube(points)
    np.testing.assert_allclose(probes.distances, values, atol=1e-12)
    ordered = np.sort(np.abs(points) - HALF, axis=1)
    single = (ordered[:, 2] > 0) | (ordered[:, 2] - ordered[:, 1] > 1e-9)  # inside, where one face is the closest
    np.testing.assert_allclose(probes.directions[single], gradients[single], atol=1e-6)


def test_the_exact_distance_has_no_error() -> None:
    scores = Distance(COUNT)(cube, CUBE, BOX)
    assert set(scores) == {f"{name}{suffix}" for name in COLUMNS for suffix in BANDS}
    for column, value in scores.items():
        if column.startswith("sdf_ratio"):
            assert value == pytest.approx(1, abs=1e-9), column
        else:
            assert value == pytest.approx(0, abs=1e-5), column


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_a_scaled_distance(factor: float) -> None:
    scores = Distance(COUNT)(scaled(factor), CUBE, BOX)
    for suffix, width in BANDS.items():
        for column in ("sdf_relative_mean", "sdf_relative_p99", "eikonal_error"):
            assert scores[column + suffix] == pytest.approx(0.5), column + suffix
        assert scores["sdf_ratio" + suffix] == pytest.approx(factor)
        assert scores["gradient_angle_p95" + suffix] == pytest.approx(0, abs=1e-5)
        assert scores["sign_error" + suffix] == 0
        if factor == 0.5 or width < 0.001 / 0.48:
            assert scores["overshoot" + suffix] == 0
    if factor > 1:  # beyond |d| = 0.001 / (1.5 - 1.02), a share of the band that is uniform in |d|
        assert scores["overshoot_b5"] == pytest.approx(1 - 0.001 / 0.48 / 0.05, abs=0.03)


def test_a_shifted_distance_has_the_errors_and_signs_of_its_shift() -> None:
    scores = Distance(COUNT)(scaled(1, shift=0.0005), CUBE, BOX)
    for suffix in BANDS:
        assert scores["sdf_error_mean" + suffix] == pytest.approx(0.0005)
        assert scores["sdf_error_p99" + suffix] == pytest.approx(0.0005)
    assert scores["sign_error_b01"] == pytest.approx(0.25, abs=0.03)  # of the inner half, half is below 0.0005
    assert scores["sign_error_b5"] == pytest.approx(0.005, abs=0.005)


def test_a_turned_gradient_has_the_angle_of_its_turn() -> None:
    turn = trimesh.transformations.rotation_matrix(math.radians(10), [1, 1, 1])[:3, :3]
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (COUNT, 3))
    axis = np.array([1, 1, 1]) / math.sqrt(3)
    probes = find_probes(CUBE, points)
    scores = score_field(probes.distances, probes.directions @ turn.T, probes, beyond=0.02)
    sines = np.linalg.norm(np.cross(probes.directions, axis), axis=1)
    angles = np.degrees(2 * np.arcsin(np.clip(sines * math.sin(math.radians(5)), 0, 1)))
    assert scores["gradient_angle_median"] == pytest.approx(np.median(angles))
    assert scores["gradient_angle_p95"] == pytest.approx(np.percentile(angles, 95))


def test_a_false_sheet_is_a_wrong_sign() -> None:
    def field(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, gradients = cube(points)
        return np.where(points[:, 0] > 0.55, -values, values), gradients

    scores = Distance(COUNT)(field, CUBE, BOX)
    assert scores["sign_error"] == pytest.approx(0.05 / 1.2, abs=0.01)
    assert (scores["sign_error_b01"], scores["sign_error_b1"]) == (0, 0)


def test_bands_hold_as_many_points_as_are_asked_for_within_them() -> None:
    seen: list[np.ndarray] = []

    def field(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        seen.append(points)
        return cube(points)

    Distance(COUNT)(field, CUBE, BOX)
    for points, width in zip(seen, BANDS.values(), strict=True):
        assert len(points) == COUNT
        assert np.abs(cube(points)[0]).max() < width
    assert (seen[0].min(axis=0) >= BOX[0]).all()
    assert (seen[0].max(axis=0) <= BOX[1]).all()
    assert np.ptp(seen[0], axis=0) == pytest.approx([1.2] * 3, rel=0.01)
    assert np.abs(cube(seen[3])[0]).mean() == pytest.approx(0.025, rel=0.05)


def test_what_no_point_tells_is_nan() -> None:
    probes = find_probes(CUBE, np.array([[HALF, 0.0, 0.0]]))
    scores = score_field(np.zeros(1), np.array([[1.0, 0, 0]]), probes, beyond=0.02)
    told = {"sdf_error_mean": 0, "sdf_error_p99": 0, "eikonal_error": 0, "overshoot": 0, "sign_error": 0}
    assert {name: value for name, value in scores.items() if not math.isnan(value)} == told


def test_no_points_are_refused() -> None:
    with pytest.raises(InputError, match="points"):
        Distance(0)
