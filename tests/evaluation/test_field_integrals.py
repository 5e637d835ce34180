"""Volume, area, centre and inertia of analytic solids from their distances alone, and of meshes."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance, sphere_distance
from solids import labelled

from jointsdf.errors import InputError
from jointsdf.evaluation.field_integrals import extrapolate, integrate, measure_field
from jointsdf.evaluation.mass_properties import inertia_of, measure_mesh
from jointsdf.geometry.cut_cube import cut_cubes

MIDDLE = np.array([0.113, -0.071, 0.037])
HALF = np.array([0.61, 0.43, 0.29])
RADIUS = 0.7


def ball(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    away = points - MIDDLE
    return sphere_distance(away, RADIUS), away / np.linalg.norm(away, axis=1, keepdims=True)


def box(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    away = points - MIDDLE
    values, step = box_distance(away, HALF), 1e-6
    ahead = [box_distance(away + step * axis, HALF) - box_distance(away - step * axis, HALF) for axis in np.eye(3)]
    return values, np.stack(ahead, axis=1) / (2 * step)


def sides(points: np.ndarray) -> np.ndarray:
    """Part 4 above the middle, part 9 below."""
    return np.where(points[:, 2] > MIDDLE[2], 4, 9)


def test_a_cut_cube_has_the_volume_of_random_points() -> None:
    generator = np.random.default_rng(0)
    points = generator.uniform(-0.5, 0.5, (200_000, 3))
    slopes = np.concatenate([generator.standard_normal((20, 3)), np.eye(3), -np.eye(3), [[1, 1, 0], [0, -1, 1e-4]]])
    values = generator.uniform(-0.6, 0.6, len(slopes)) * np.abs(slopes).sum(axis=1)
    found = cut_cubes(values, slopes)
    inside = values[:, None] + slopes @ points.T < 0
    np.testing.assert_allclose(found.volume, inside.mean(axis=1), atol=5e-3)
    np.testing.assert_allclose(found.moment, inside @ points / len(points), atol=3e-3)
    lengths, h = np.linalg.norm(slopes, axis=1), 1e-5
    shell = cut_cubes(values - h * lengths, slopes).volume - cut_cubes(values + h * lengths, slopes).volume
    np.testing.assert_allclose(found.area, shell / (2 * h), atol=5e-3)
    assert cut_cubes(np.array([-1.0, 1.0]), np.zeros((2, 3))).volume.tolist() == [1, 0]


def test_a_ball_is_of_second_order_and_better_extrapolated() -> None:
    exact = 4 / 3 * np.pi * RADIUS**3
    errors = [abs(integrate(ball, sides, halvings).volume - exact) / exact for halvings in (0, 1, 2)]
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3
    found = extrapolate(ball, sides, 128)
    assert float(found("volume")) == pytest.approx(exact, rel=2e-5)
    np.testing.assert_allclose(found("first") / found("volume"), MIDDLE, atol=1e-6)
    inertia = inertia_of(float(found("volume")), found("first"), found("second"))
    np.testing.assert_allclose(inertia, 0.4 * exact * RADIUS**2 * np.eye(3), atol=2e-4 * exact)
    areas = {part: measure.area for part, measure in found.fine.parts.items()}
    assert sum(areas.values()) == pytest.approx(4 * np.pi * RADIUS**2, rel=1e-4)
    assert areas == pytest.approx(dict.fromkeys((4, 9), 2 * np.pi * RADIUS**2), rel=5e-3)  # a cell is of one part
    np.testing.assert_allclose(found.fine.parts[4].centroid, MIDDLE + np.array([0, 0, RADIUS / 2]), atol=2e-3)


def test_a_box_has_its_volume_centre_and_inertia() -> None:
    exact = 8 * HALF.prod()
    found = extrapolate(box, sides, 128)
    assert float(found("volume")) == pytest.approx(exact, rel=1e-3)
    np.testing.assert_allclose(found("first") / found("volume"), MIDDLE, atol=2e-4)
    inertia = inertia_of(float(found("volume")), found("first"), found("second"))
    squares = HALF**2
    np.testing.assert_allclose(inertia, exact / 3 * np.diag(squares.sum() - squares), atol=2e-3 * exact)
    area = sum(part.area for part in found.fine.parts.values())
    assert area == pytest.approx(8 * (HALF[0] * HALF[1] + HALF[1] * HALF[2] + HALF[2] * HALF[0]), rel=5e-3)


def test_a_mesh_far_away_has_its_measures() -> None:
    far = np.array([1e6, -2e6, 3e6])
    mesh = labelled(trimesh.creation.box(2 * HALF).apply_translation(far), [5] * 4 + [8] * 8)
    found, exact = measure_mesh(mesh), 8 * HALF.prod()
    assert found.volume == pytest.approx(exact, rel=1e-6)
    np.testing.assert_allclose(found.centre, far, atol=1e-6)
    squares = HALF**2
    np.testing.assert_allclose(found.inertia, exact / 3 * np.diag(squares.sum() - squares), atol=1e-6)
    assert found.area == pytest.approx(sum(part.area for part in found.parts.values()))
    assert list(found.parts) == [5, 8]


def test_a_field_is_measured_in_file_units_and_an_odd_grid_is_refused(small_field) -> None:
    field = small_field("siren").eval()
    found, again = measure_field(field, 64), extrapolate(field.network_differential, field.network_part, 64)
    assert found.volume == pytest.approx(float(again("volume")) * 25.0**3)
    assert set(found.parts) <= set(field.part_ids.tolist())
    for resolution in (100, 32, 0):
        with pytest.raises(InputError, match=f"resolution={resolution}: give an integer"):
            measure_field(field, resolution)


def test_an_empty_field_has_no_volume_and_no_centre(small_field) -> None:
    field = small_field("siren").eval()
    field.trunk.output.bias.data += 9.0
    found = measure_field(field, 64)
    assert (found.volume, found.area, found.parts) == (0, 0, {})
    assert np.isnan(found.centre).all()
