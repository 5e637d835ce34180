"""The draws of a run: a function of (seed, step), on the analytic surface, in the right numbers."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from clouds import COUNTS, in_file_units, same_samples, sampler_of
from scipy.stats import kstest

from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import SHELL_NEIGHBOUR, Sampler
from jointsdf.data.samples import draw_cloud, prepare_samples
from jointsdf.errors import InputError
from jointsdf.geometry.distance import network_distance
from jointsdf.values import BOX, LabelledMesh, Shape


def test_counts_and_types_of_a_step(box_shape: Shape) -> None:
    samples = sampler_of(box_shape, COUNTS).draw(0)
    sizes = (300, 300, 300, 200, 250, 250, 150, 150, 0, 0)
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
    assert same_samples(sampler.draw(4), again.draw(4))
    for one, two in ((sampler.draw(4), sampler.draw(5)), (sampler.draw(4), other.draw(4))):
        assert not any(torch.equal(x, y) for x, y in zip(one, two, strict=True) if len(x))


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
        {"creases": -0.1},
        {"borders": 1.1},
        {"shell_offset": -0.1},
    ],
    ids=str,
)
def test_impossible_counts_are_input_errors(wrong: dict[str, float]) -> None:
    ((name, value),) = wrong.items()
    with pytest.raises(InputError, match=f"data.counts.{name}={value}: give a"):
        replace(COUNTS, **wrong)


def test_far_points_have_the_gradient_of_the_distance_and_change_no_other_draw(box_shape: Shape) -> None:
    settings = SampleSettings(cloud_size=400, pool_size=3000, pool_near=0.6)
    cloud = draw_cloud(box_shape, settings, seed=0)
    plain, far = (
        prepare_samples(box_shape, cloud, replace(COUNTS, far=count), settings, 0).draw(3) for count in (0, 500)
    )
    assert same_samples(plain, far._replace(far=plain.far, far_gradients=plain.far_gradients))
    assert len(plain.far) == 0
    assert len(far.far) == 500
    points = far.far.double().numpy()
    exact = network_distance(box_shape, cloud.normalisation)
    step = 1e-6
    slopes = [
        (exact.signed(points + step * axis) - exact.signed(points - step * axis)) / (2 * step) for axis in np.eye(3)
    ]
    right = np.linalg.norm(np.stack(slopes, axis=1) - far.far_gradients.double().numpy(), axis=1) < 1e-3
    assert right.mean() > 0.98  # all but points that two faces are equally close to
    pool = {tuple(point) for point in np.float32(draw_pool(cloud, count=3000, near_share=0.6, seed=0)[1800:]).tolist()}
    assert {tuple(point) for point in far.far.tolist()} <= pool


def test_a_negative_count_of_far_points_is_refused() -> None:
    with pytest.raises(InputError, match=r"data\.counts\.far"):
        replace(COUNTS, far=-1)
