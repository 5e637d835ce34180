"""The stream of steps: the same for any number of workers, and from any step on."""

from collections.abc import Iterator
from itertools import islice

import pytest
from clouds import COUNTS, same_samples, sampler_of

from jointsdf.data.datamodule import ShapeDataModule, StepStream
from jointsdf.values import Samples, Shape


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_stream_is_the_same_for_any_number_of_workers(box_shape: Shape, workers: int) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    data = ShapeDataModule(sampler, workers)
    for step, samples in enumerate(islice(data.train_dataloader(), 5)):
        assert same_samples(samples, sampler.draw(step))


def test_stream_goes_on_from_any_step(box_shape: Shape) -> None:
    sampler = sampler_of(box_shape, COUNTS)
    whole: Iterator[Samples] = iter(StepStream(sampler, 0))
    for late, early in zip(islice(StepStream(sampler, 7), 3), islice(whole, 7, 10), strict=True):
        assert same_samples(late, early)
