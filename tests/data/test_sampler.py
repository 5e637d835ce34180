"""The draws of a run: a function of (seed, step), on the analytic surface, in the right numbers."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch
from clouds import sampler_of
from scipy.stats import kstest

from jointsdf.data.datamodule import ShapeDataModule, StepStream
from jointsdf.data.point_cloud import Cloud, pool_points, stream
from jointsdf.data.sampler import SHELL_NEIGHBOUR, Counts, Sampler
from jointsdf.errors import InputError
from jointsdf.values import BOX, LabelledMesh, Samples, Shape

COUNTS = Counts(manifold=300, non_manifold=200, shell=250, pool=150)


def same(a: Samples, b: Samples) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def in_file_units(cloud: Cloud, points: torch.Tensor) -> np.ndarray:
    return cloud.normalisation.inverse(points.double().numpy())


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


def test_counts_and_types_of_a_step(box_shape: Shape) -> None:
    samples = sampler_of(box_shape, COUNTS).draw(0)
    sizes = (300, 300, 300, 200, 250, 250, 150, 150)
    assert tuple(len(tensor) for tensor in samples) == sizes
    assert samples.labels.dtype == torch.int64
    assert {tensor.dtype for name, tensor in samples._asdict().items() if name != "labels"} == {torch.float32}


def test_manifold_points_are_the_clouds_with_their_labels(box_shape: Shape) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    samples = sampler.draw(11)
    label_of = {
        tuple(p): k for p, k in zip(sampler.cloud.points.astype(np.float32).tolist(), sampler.cloud.labels, strict=True)
    }
    assert [label_of[tuple(p)] for p in samples.manifold.tolist()] == samples.labels.tolist()


def test_points_are_uniform_in_the_box_and_angles_in_the_circle(box_shape: Shape) -> None:
    counts = replace(COUNTS, non_manifold=5000, shell=5000)
    samples = sampler_of(box_shape, counts, pool_size=0).draw(0)
    for axis in samples.non_manifold.double().numpy().T:
        assert kstest(axis, "uniform", (-BOX, 2 * BOX)).pvalue > 0.01
    assert kstest(samples.angles.double().numpy(), "uniform", (0, 2 * np.pi)).pvalue > 0.01


def test_steps_and_seeds_differ_and_repeat(box_shape: Shape) -> None:
    sampler, again = sampler_of(box_shape, COUNTS), sampler_of(box_shape, COUNTS)
    other = Sampler(sampler.cloud, sampler.pool, sampler.pool_distances, COUNTS, seed=1)
    assert same(sampler.draw(4), again.draw(4))
    for one, two in ((sampler.draw(4), sampler.draw(5)), (sampler.draw(4), other.draw(4))):
        assert not any(torch.equal(x, y) for x, y in zip(one, two, strict=True))


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_stream_is_the_same_for_any_number_of_workers(box_shape: Shape, workers: int) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    data = ShapeDataModule(sampler, workers)
    for step, samples in enumerate(islice(data.train_dataloader(), 5)):
        assert same(samples, sampler.draw(step))


def test_stream_goes_on_from_any_step(box_shape: Shape) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    whole: Iterator[Samples] = iter(StepStream(sampler, 0))
    for late, early in zip(islice(StepStream(sampler, 7), 3), islice(whole, 7, 10), strict=True):
        assert same(late, early)


def test_shell_widths_are_the_distances_to_the_51st_neighbour(box_shape: Shape) -> None:
    sampler = sampler_of(box_shape, COUNTS, cloud_size=400)
    points = sampler.cloud.points
    distances = np.sort(np.linalg.norm(points[:, None] - points[None], axis=2), axis=1)
    assert SHELL_NEIGHBOUR == 51
    np.testing.assert_allclose(sampler.shell_widths[:, 0], distances[:, 51], rtol=1e-12)  # column 0 is the point itself


def test_small_cloud_uses_its_farthest_neighbour(box_shape: Shape) -> None:
    sampler = Sampler(Cloud.of(box_shape.mesh, count=10, seed=0), np.zeros((0, 3)), np.zeros(0), COUNTS, seed=0)
    points = sampler.cloud.points
    farthest = np.linalg.norm(points[:, None] - points[None], axis=2).max(axis=1)
    np.testing.assert_allclose(sampler.shell_widths[:, 0], farthest, rtol=1e-12)


def still(sampler: Sampler) -> Sampler:
    """The same draws without the Gaussian noise."""
    sampler.shell_widths = np.zeros_like(sampler.shell_widths)
    return sampler


def test_shell_noise_has_the_points_own_width(box_shape: Shape) -> None:
    counts = replace(COUNTS, shell=20000)
    noisy = sampler_of(box_shape, counts, pool_size=0)
    widths = noisy.shell_widths
    points = noisy.draw(0).shell.double().numpy()
    centres = still(noisy).draw(0).shell.double().numpy()
    order = {tuple(p): i for i, p in enumerate(noisy.cloud.points.astype(np.float32).tolist())}
    own = widths[[order[tuple(p)] for p in centres.astype(np.float32).tolist()]]
    assert kstest(((points - centres) / own).ravel(), "norm").pvalue > 0.01


def test_shell_offset_is_drawn_for_every_point_along_its_normal(
    box_shape: Shape, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    sampler = sampler_of(box_shape, replace(COUNTS, shell=4000, shell_offset=0.1), pool_size=0)
    shell = still(sampler).draw(0).shell
    scale = sampler.cloud.normalisation.scale
    offsets = box_distance(in_file_units(sampler.cloud, shell)) / scale
    outward = offsets[offsets > 0]
    assert len(np.unique(np.round(outward, 6))) > 0.9 * len(outward)
    assert len(outward) / 4000 == pytest.approx(0.5, abs=0.03)
    assert kstest(outward, "uniform", (0, 0.1)).pvalue > 0.01


@pytest.mark.parametrize(("balanced", "least", "most"), [(0.0, 0, 30), (0.5, 1000, 1180), (1.0, 2100, 2400)])
def test_balanced_share_meets_a_tiny_part(balanced: float, least: int, most: int) -> None:
    small, large = np.array([[0.0, 0, 0], [0.04, 0, 0], [0, 0.04, 0]]), np.array([[1.0, 0, 0], [2, 0, 0], [1, 1, 0]])
    mesh = LabelledMesh(np.concatenate([small, large]), np.array([[0, 1, 2], [3, 4, 5]]), np.array([9, 2]))
    cloud = Cloud.of(mesh, count=5000, seed=0)
    assert 0 < (cloud.labels == 1).sum() < 20
    sampler = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), replace(COUNTS, manifold=4500, balanced=balanced), 0)
    assert least <= (sampler.draw(0).labels == 1).sum() <= most


def test_balanced_share_with_few_or_no_labels(box_shape: Shape) -> None:
    counts = replace(COUNTS, balanced=1.0)
    few = sampler_of(box_shape, counts, label_fraction=0.1, pool_size=0).draw(0)
    assert (few.labels >= 0).all()
    none = sampler_of(box_shape, counts, label_fraction=0.0, pool_size=0).draw(0)
    assert (none.labels == -1).all()


def test_pool_holds_exact_distances_in_the_network_frame(
    box_shape: Shape, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    samples = sampler.draw(3)
    assert samples.pool.abs().max() <= BOX + 1e-6
    expected = box_distance(in_file_units(sampler.cloud, samples.pool)) / sampler.cloud.normalisation.scale
    np.testing.assert_allclose(samples.pool_distances.numpy(), expected, atol=2e-6)
    assert (expected < 0).any()
    assert (expected > 0).any()


def test_pool_is_near_the_surface_and_everywhere(
    box: LabelledMesh, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    cloud = Cloud.of(box, count=5000, seed=0)
    points = pool_points(cloud, count=10001, near_share=0.5, seed=0)
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


def test_no_pool_where_none_is_asked_for(box_shape: Shape) -> None:
    samples = sampler_of(box_shape, COUNTS, pool_size=0).draw(0)
    assert samples.pool.shape == (0, 3)
    assert samples.pool_distances.shape == (0,)


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


@pytest.mark.parametrize(
    "wrong",
    [
        {"manifold": 0},
        {"non_manifold": -1},
        {"shell": 0},
        {"pool": 0},
        {"balanced": 1.1},
        {"balanced": -0.1},
        {"regions": 1.1},
        {"borders": 1.1},
        {"shell_offset": -0.1},
    ],
    ids=str,
)
def test_impossible_counts_are_input_errors(wrong: dict[str, float]) -> None:
    ((name, value),) = wrong.items()
    with pytest.raises(InputError, match=f"data.counts.{name}={value}: give a"):
        replace(COUNTS, **wrong)
