"""Denoised clouds lie nearer to the surface, keep edges, and tell which side is outside where noisy ones do not."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from clouds import cloud_of

from jointsdf.data.cloud_estimate import estimate_from_cloud, find_surfels
from jointsdf.data.denoising import denoise
from jointsdf.data.point_cloud import Cloud, draw_pool, stream

BOX_EXTENTS = (2.0, 1.5, 1.0)


def noisy(cloud: Cloud, noise: float) -> np.ndarray:
    return cloud.points + noise * stream(0, 1).standard_normal(cloud.points.shape)


def box_cloud(count: int = 10_000) -> Cloud:
    return cloud_of(trimesh.creation.box(BOX_EXTENTS), count)


def to_box(cloud: Cloud, points: np.ndarray) -> np.ndarray:
    """Exact signed distance of the box, network frame."""
    centre = cloud.normalisation.forward(np.zeros((1, 3)))[0]
    return box_distance(points - centre, np.array(BOX_EXTENTS) / 2 / cloud.normalisation.scale)


def test_an_exact_cloud_is_left_as_it_is() -> None:
    assert denoise(box_cloud().points) is None


@pytest.mark.parametrize("noise", [0.002, 0.005, 0.01])
def test_points_of_a_box_come_to_lie_on_it(noise: float) -> None:
    cloud = box_cloud()
    found = denoise(noisy(cloud, noise))
    assert found is not None
    points, normals = found
    before, after = (np.abs(to_box(cloud, places)) for places in (noisy(cloud, noise), points))
    assert after.mean() < 0.45 * before.mean()
    assert np.quantile(after, 0.98) < 1.2 * noise, "edges are not rounded beyond the noise"
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    cosines = np.abs((normals * cloud.normals).sum(axis=1))
    assert np.median(cosines) > np.cos(np.radians(3))
    assert (cosines > np.cos(np.radians(10))).mean() > 0.9


def test_denoising_moves_points_along_with_the_frame() -> None:
    """Turned, scaled and shifted points have turned, scaled and shifted answers."""
    points = noisy(box_cloud(2000), 0.005)
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]
    found, moved = denoise(points), denoise(3 * points @ turn.T + 5)
    assert found is not None
    assert moved is not None
    np.testing.assert_allclose(moved[0], 3 * found[0] @ turn.T + 5, atol=1e-6)
    np.testing.assert_allclose(np.abs((moved[1] * (found[1] @ turn.T)).sum(axis=1)), 1, atol=1e-6)


@pytest.mark.parametrize("noise", [0.002, 0.006])
def test_normals_of_a_tube_point_away_from_its_wall_in_the_bore_as_well(noise: float) -> None:
    """Noise closes the bore to the free space around the noisy points; denoised ones leave it open."""
    tube = trimesh.creation.annulus(0.08, 0.14, 2, sections=64)
    cloud = cloud_of(tube, 12_000)
    cloud = Cloud(noisy(cloud, noise), cloud.normals, cloud.labels, cloud.part_ids, cloud.normalisation, cloud.uniform)
    for denoised in (False, True):
        found, surfels = find_surfels(cloud, denoised=denoised)
        known = found.normals.any(axis=1)
        assert len(surfels.points) == found.uniform
        right = (found.normals * cloud.normals).sum(axis=1)[known] > 0
        if denoised:
            assert known.mean() > 0.9
            assert right.mean() > 0.995
        else:
            assert known.mean() < 0.6


def test_a_noisy_cloud_with_stray_points_tells_distances() -> None:
    exact = box_cloud()
    points = noisy(exact, 0.006)
    stray = np.arange(0, len(points), 100)
    points[stray] = stream(0, 4).uniform(-1.1, 1.1, (len(stray), 3))
    cloud = Cloud(points, exact.normals, exact.labels, exact.part_ids, exact.normalisation, exact.uniform)
    pool = draw_pool(exact, count=8000, near_share=0.6, seed=0)
    found, places, distances, distance = estimate_from_cloud(cloud, pool, denoised=True)
    assert found.uniform == len(found.points) == len(found.labels) < len(points) - 0.5 * len(stray)
    assert len(places) > 0.85 * len(pool)
    truth = to_box(exact, places)
    wrong = np.sign(distances) != np.sign(truth)
    assert not (wrong & (np.abs(truth) > 0.02)).any()
    assert np.abs(distances - truth).mean() < 0.004
    np.testing.assert_array_equal(distance(places), distances)
