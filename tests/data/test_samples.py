"""Distances and normals of a run's points, from the mesh and from the cloud alone, and settings that are refused."""

from collections.abc import Callable

import numpy as np
import pytest
from clouds import COUNTS, in_file_units, sampler_of

from jointsdf.data import point_cloud, samples
from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.data.sampler import Counts
from jointsdf.data.samples import SampleSettings, prepare_samples
from jointsdf.data.surfels import Surfels
from jointsdf.errors import InputError
from jointsdf.geometry.distance import network_distance
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
