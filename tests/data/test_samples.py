"""Distances and normals of a run's points, from the mesh and from the cloud alone, and settings that are refused."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
import trimesh
from clouds import COUNTS, in_file_units, sampler_of

from jointsdf.data import point_cloud, samples
from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import Counts
from jointsdf.data.samples import OFF_SURFACE, draw_cloud, labelled_points, prepare_samples
from jointsdf.data.surfels import Surfels
from jointsdf.errors import InputError
from jointsdf.geometry.distance import network_distance
from jointsdf.model.far_grid import FarGrid
from jointsdf.values import BOX, Samples, Shape


def test_pool_holds_exact_distances_in_the_network_frame(
    box_shape: Shape, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    drawn = sampler.draw(3)
    assert drawn.pool.abs().max() <= BOX + 1e-6
    expected = box_distance(in_file_units(sampler.cloud, drawn.pool)) / sampler.cloud.normalisation.scale
    np.testing.assert_allclose(drawn.pool_distances.numpy(), expected, atol=2e-6)
    assert (expected < 0).any()
    assert (expected > 0).any()


def test_no_pool_where_none_is_asked_for(box_shape: Shape) -> None:
    drawn = sampler_of(box_shape, COUNTS, pool_size=0).draw(0)
    assert drawn.pool.shape == (0, 3)
    assert drawn.pool_distances.shape == (0,)


@pytest.mark.parametrize(
    "options",
    [
        {"label_fraction": -0.1},
        {"label_fraction": 1.5},
        {"cloud_size": 0},
        {"cloud_size": 1},
        {"pool_size": -1},
        {"region_points": -1},
        {"crease_points": -1},
        {"border_points": -1},
        {"pool_near": 1.5},
        {"seed": -1},
    ],
    ids=str,
)
def test_impossible_data_is_an_input_error(box_shape: Shape, options: dict[str, float]) -> None:
    ((name, value),) = options.items()
    with pytest.raises(InputError, match=f"{name}={value}: give a"):
        sampler_of(box_shape, COUNTS, **options)


def test_normals_and_distances_estimated_from_the_cloud_are_near_the_exact_ones(box_shape: Shape) -> None:
    counts = Counts(manifold=2000, non_manifold=10, shell=10, pool=400)
    sampler = sampler_of(box_shape, counts, cloud_size=20000, pool_size=5000, region_points=500, distances="cloud")
    cloud = Cloud.of(box_shape.mesh, count=20000, region_points=500, seed=0)
    found = sampler.cloud.normals
    np.testing.assert_array_equal(found[:20000], Surfels(Cloud.of(box_shape.mesh, count=20000, seed=0).points).normals)
    assert not found[20000:].any(), "of other points than the uniform ones nothing is estimated"
    assert ((found * cloud.normals).sum(axis=1)[found.any(axis=1)] > 0.9).mean() > 0.99
    pool = draw_pool(cloud, count=5000, near_share=0.5, seed=0)
    assert len(sampler.pool) > 0.9 * len(pool), "known down to the surface"
    exact = network_distance(box_shape, cloud.normalisation).signed(sampler.pool)
    errors = np.abs(sampler.pool_distances - exact)
    assert np.quantile(errors[np.abs(exact) < 0.03], 0.9) < 1e-6
    np.testing.assert_allclose(sampler.pool_distances, exact, atol=0.03)


def test_with_distances_from_the_cloud_nothing_of_the_mesh_but_points_reaches_a_step(
    box_shape: Shape, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = Counts(manifold=200, non_manifold=10, shell=100, pool=200, shell_offset=0.01)

    def drawn() -> Samples:
        return sampler_of(box_shape, counts, cloud_size=5000, pool_size=5000, distances="cloud").draw(3)

    honest = drawn()
    monkeypatch.setattr(point_cloud, "face_normals", lambda _, faces: np.full((len(faces), 3), np.nan))
    monkeypatch.setattr(samples, "network_distance", lambda *_: pytest.fail("the mesh was asked"))
    for one, other in zip(honest, drawn(), strict=True):
        np.testing.assert_array_equal(one.numpy(), other.numpy())
    assert honest.normals.any()


@pytest.mark.parametrize("count", [2, 8])
def test_a_cloud_that_leaves_no_free_space_is_refused(count: int, box_shape: Shape) -> None:
    counts = Counts(manifold=10, non_manifold=10, shell=10, pool=10)
    with pytest.raises(InputError, match=f"{count} points leave no free space"):
        prepare_samples(
            box_shape,
            Cloud.of(box_shape.mesh, count=count, seed=0),
            counts,
            SampleSettings(100, 500, distances="cloud"),
            0,
        )


def test_an_unknown_source_is_refused() -> None:
    with pytest.raises(InputError, match=r"data\.distances=guess: accepted are mesh, cloud"):
        SampleSettings(100, 10, distances="guess")


@pytest.mark.parametrize("distances", ["mesh", "cloud"])
def test_a_grid_gets_what_the_run_knows_and_the_pool_what_the_grid_leaves(distances: str, box_shape: Shape) -> None:
    counts = Counts(manifold=10, non_manifold=10, shell=10, pool=10, far=10)
    settings = SampleSettings(cloud_size=5000, pool_size=3000, distances=distances)
    cloud = Cloud.of(box_shape.mesh, count=5000, seed=0)
    alone = prepare_samples(box_shape, cloud, counts, settings, 0)
    far = FarGrid(24)
    beside = prepare_samples(box_shape, cloud, counts, settings, 0, far)
    kept = np.abs(alone.pool_distances) < far.outer
    assert 300 < kept.sum() < 0.95 * len(kept)
    np.testing.assert_array_equal(beside.pool, alone.pool[kept])
    np.testing.assert_array_equal(beside.pool_distances, alone.pool_distances[kept])
    np.testing.assert_array_equal(beside.pool_gradients, alone.pool_gradients[kept])
    assert beside.pool_gradients.any() == (distances == "mesh")
    points = np.random.default_rng(0).uniform(-1.1, 1.1, (500, 3))
    exact = network_distance(box_shape, cloud.normalisation).signed(points)
    away = np.abs(exact) > far.outer
    errors = np.abs(far(torch.from_numpy(points)).numpy() - exact)[away]
    assert np.quantile(errors, 0.8) < 0.01 < errors.max() < 0.1, "but for ridges of the distance"


def test_labelled_points_lie_off_the_surface_with_the_part_of_the_closest_side(
    box_shape: Shape, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    settings = SampleSettings(cloud_size=200, pool_size=0, part_points=4000, border_points=2000, label_fraction=0.9)
    cloud = draw_cloud(box_shape, settings, 0)
    points, labels, judges = labelled_points(box_shape, cloud, settings, 0)
    assert judges == 0, "every point is learned from where there are few"
    off = box_distance(cloud.normalisation.inverse(points)) / cloud.normalisation.scale
    inner = off[off < 0]  # outside, beyond an edge, the distance is that to the edge
    assert 0.44 < len(inner) / len(off) < 0.52, "half, but for points on edges, which stay on the other side's plane"
    assert np.sqrt((inner**2).mean()) == pytest.approx(OFF_SURFACE, rel=0.1)
    np.testing.assert_array_equal(labels == -1, cloud.labels == -1)
    own = labels == cloud.labels
    assert 0.9 < own.mean() < 1, "near an edge another side may be the closest"
    exact = trimesh.Trimesh(box_shape.mesh.vertices, box_shape.mesh.faces, process=False)
    for index in np.flatnonzero(~own & (labels != -1))[:40]:
        at = cloud.normalisation.inverse(points[index : index + 1])
        nearest = trimesh.triangles.closest_point(exact.triangles, np.repeat(at, len(exact.faces), 0))
        distances = np.linalg.norm(nearest - at, axis=1)
        by_part = [distances[box_shape.mesh.labels == part].min() for part in cloud.part_ids]
        assert by_part[labels[index]] == pytest.approx(min(by_part), abs=1e-9)


def test_judges_are_the_last_of_the_labelled_points(box_shape: Shape) -> None:
    settings = SampleSettings(cloud_size=200, pool_size=0, distances="cloud", part_points=40_000)
    cloud = draw_cloud(box_shape, settings, 0)
    points, _, judges = labelled_points(box_shape, cloud, settings, 0)
    assert len(points) == len(cloud.points)
    np.testing.assert_array_equal(points[-judges:], cloud.points[cloud.judging()])
    assert len(np.unique(points, axis=0)) == len(np.unique(cloud.points, axis=0)), "each point once"


def test_labelled_points_of_a_cloud_stay_where_they_are(box_shape: Shape) -> None:
    settings = SampleSettings(cloud_size=200, pool_size=0, distances="cloud")
    cloud = draw_cloud(box_shape, settings, 0)
    points, labels, _ = labelled_points(box_shape, cloud, settings, 0)
    np.testing.assert_array_equal(points, cloud.points)
    np.testing.assert_array_equal(labels, cloud.labels)


def test_without_distances_no_sample_has_a_normal_or_a_distance(box_shape: Shape) -> None:
    settings = SampleSettings(cloud_size=200, pool_size=0, distances="none")
    cloud = draw_cloud(box_shape, settings, 0)
    assert cloud.normals.any()
    sampler = prepare_samples(box_shape, cloud, COUNTS, settings, 0)
    drawn = sampler.draw(0)
    assert not drawn.normals.any()
    assert drawn.pool_distances.numel() == 0
    assert len(drawn.manifold) == COUNTS.manifold
    with pytest.raises(InputError, match=r"trunk\.far=grid: data\.distances=none"):
        prepare_samples(box_shape, cloud, COUNTS, settings, 0, FarGrid(16))
    with pytest.raises(InputError, match=r"data\.distances=none tells no distances to data\.pool_size=5"):
        SampleSettings(cloud_size=200, pool_size=5, distances="none")
