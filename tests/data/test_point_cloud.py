"""The training cloud on an analytic surface, its labels, and the pool about it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from jointsdf.data.point_cloud import Cloud, draw_pool, stream
from jointsdf.values import BOX, LabelledMesh


def test_streams_are_their_own() -> None:
    draws = [stream(*key).random(4).tolist() for key in ((0, 0), (0, 1), (1, 0), (0, 3, 0), (0, 3, 1), (0, 3, 2))]
    assert len({tuple(draw) for draw in draws}) == 6
    assert stream(5, 3, 17).random(4).tolist() == stream(5, 3, 17).random(4).tolist()


def test_cloud_is_normalised_by_its_mean_and_largest_coordinate(box: LabelledMesh) -> None:
    cloud = Cloud.of(box, count=3000, seed=0)
    np.testing.assert_allclose(cloud.points.mean(axis=0), 0, atol=1e-12)
    assert np.abs(cloud.points).max() == pytest.approx(1, abs=1e-12)


def test_cloud_lies_on_the_box_with_its_normals_and_parts(
    box: LabelledMesh, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    cloud = Cloud.of(box, count=3000, seed=0)
    points = cloud.normalisation.inverse(cloud.points)
    np.testing.assert_allclose(box_distance(points), 0, atol=1e-9)
    np.testing.assert_allclose(cloud.normalisation.forward(points), cloud.points, atol=1e-12)
    np.testing.assert_allclose(box_distance(points + 0.5 * cloud.normals), 0.5, atol=1e-9)  # they point outward
    np.testing.assert_array_equal(cloud.part_ids, [3, 7, 12, 40])
    x, z = cloud.normals[:, 0], cloud.normals[:, 2]
    expected = np.select([x > 0.5, x < -0.5, z > 0.5], [3, 7, 12], 40)
    np.testing.assert_array_equal(cloud.part_ids[cloud.labels], expected)


def test_cloud_depends_on_the_seed_alone(box: LabelledMesh) -> None:
    first, again, other = (Cloud.of(box, count=500, seed=seed).points for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any(axis=1).all()


@pytest.mark.parametrize(("fraction", "kept"), [(0.0, 0), (0.1, 200), (0.5, 1000), (1.0, 2000)])
def test_label_fraction_keeps_that_share(box: LabelledMesh, fraction: float, kept: int) -> None:
    whole, part = (Cloud.of(box, count=2000, seed=0, label_fraction=share) for share in (1.0, fraction))
    labelled = part.labels != -1
    assert labelled.sum() == kept
    np.testing.assert_array_equal(part.labels[labelled], whole.labels[labelled])
    np.testing.assert_array_equal(part.points, whole.points)
    np.testing.assert_array_equal(part.part_ids, whole.part_ids)


def test_unlabelled_faces_give_unlabelled_points(box: LabelledMesh) -> None:
    mesh = replace(box, labels=np.where(box.labels == 7, -1, box.labels))
    cloud = Cloud.of(mesh, count=2000, seed=0)
    np.testing.assert_array_equal(cloud.part_ids, [3, 12, 40])
    np.testing.assert_array_equal(cloud.labels == -1, cloud.normals[:, 0] < -0.5)
    unlabelled = Cloud.of(replace(box, labels=np.full(len(box.faces), -1)), count=2000, seed=0)
    assert (unlabelled.labels == -1).all()
    assert len(unlabelled.part_ids) == 0


def test_pool_is_near_the_surface_and_everywhere(
    box: LabelledMesh, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    cloud = Cloud.of(box, count=5000, seed=0)
    points = draw_pool(cloud, count=10001, near_share=0.5, seed=0)
    assert points.shape == (10001, 3)
    assert np.abs(points).max() <= BOX
    near, far = points[:5000], points[5000:]
    distances = np.abs(box_distance(cloud.normalisation.inverse(near))) / cloud.normalisation.scale
    assert np.quantile(distances, 0.9) < 0.1
    for low, high in ((0, 2e-3), (2e-3, 2e-2), (2e-2, 0.4)):  # every scale is met
        assert ((distances >= low) & (distances < high)).mean() > 0.1
    for axis in range(3):
        assert kstest(far[1::2, axis], "uniform", (-BOX, 2 * BOX)).pvalue > 0.01
        assert kstest(far[::2, axis], "arcsine", (-BOX, 2 * BOX)).pvalue > 0.01
