"""Every part has its points in any ten steps on end, however small it is and however many there are."""

import numpy as np
import pytest
import torch
from scipy.stats import kstest

from jointsdf.data.point_cloud import Cloud
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.errors import InputError
from jointsdf.values import LabelledMesh


def strip(parts: int, share: float) -> LabelledMesh:
    """A flat strip, its parts side by side: the first is the largest, every other one has that share of the area."""
    ends = np.concatenate([[0.0], 1 - (parts - 1) * share + share * np.arange(parts)])
    vertices = np.array([[x, y, 0.0] for x in ends for y in (0.0, 1.0)])
    quads = 2 * np.arange(parts)[:, None] + np.array([0, 2, 3, 1])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return LabelledMesh(vertices, faces, np.tile(np.arange(parts), 2))


@pytest.mark.parametrize(("parts", "share"), [(200, 1e-4), (33, 1e-4), (7, 0.01), (1, 0.0)])
def test_every_part_has_its_points_in_any_ten_steps_on_end(parts: int, share: float) -> None:
    """With the numbers of `fast`, over 400 steps from the first one and from a later one."""
    counts = Counts(1000, 1, 1, 1, balanced=0.2, regions=0.15, creases=0.2, borders=0.15, per_part=24)
    sizes = {"region_points": 3000, "part_points": 30_000, "border_points": 3000}
    cloud = Cloud.of(strip(parts, share), count=3000, seed=0, **sizes)
    sampler = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0)
    for first in (0, 1_234_567):
        labels = [sampler.draw(step).labels.numpy() for step in range(first, first + 400)]
        drawn = np.stack([np.bincount(step, minlength=parts) for step in labels])
        assert (drawn.sum(axis=1) == 1000).all()
        upto = np.concatenate([np.zeros((1, parts), dtype=int), drawn.cumsum(axis=0)])
        assert (upto[10:] - upto[:-10]).min() >= 24


def test_without_turns_a_small_part_is_missed() -> None:
    """What the test above would find: the draw at random, and from points uniform over the area."""
    counts = Counts(1000, 1, 1, 1, balanced=0.25)
    sampler = Sampler(Cloud.of(strip(200, 1e-4), count=3000, seed=0), np.zeros((0, 3)), np.zeros(0), counts, 0)
    ten = np.concatenate([sampler.draw(step).labels.numpy() for step in range(10)])
    assert np.bincount(ten, minlength=200).min() == 0


def test_the_points_dealt_to_a_part_are_spread_over_all_of_it() -> None:
    cloud = Cloud.of(strip(40, 1e-3), count=200, seed=0, part_points=4000)
    counts = Counts(1000, 1, 1, 1, balanced=1.0, per_part=1)
    sampler = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0)
    drawn = [sampler.draw(step) for step in range(100)]
    labels = torch.cat([step.labels for step in drawn]).numpy()
    np.testing.assert_array_equal(np.bincount(labels, minlength=40), 2500)
    places = cloud.normalisation.inverse(torch.cat([step.manifold for step in drawn]).double().numpy())[labels == 7]
    assert 60 < len(np.unique(places, axis=0)) <= 100
    assert kstest(np.unique(places, axis=0)[:, 1], "uniform").pvalue > 0.01


def test_a_negative_number_of_points_a_part_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"data\.counts\.per_part=-1: give a"):
        Counts(1000, 1, 1, 1, per_part=-1)
