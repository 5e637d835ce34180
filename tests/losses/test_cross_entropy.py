"""The segmentation term against torch's."""

import math

import pytest
import torch
from exact_steps import (
    NONE,
)
from torch import Tensor

from jointsdf.losses.cross_entropy import CrossEntropy
from jointsdf.values import FieldValues, Step


def segmentation_step(labels: list[int], logits: Tensor) -> Step:
    values = FieldValues(torch.zeros(len(labels)), logits=logits)
    return Step({"manifold": values}, torch.tensor(labels, dtype=torch.int64), torch.zeros(len(labels), 3), NONE)


def test_cross_entropy_is_torchs_mean_over_labelled_points() -> None:
    logits = torch.randn(6, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    labels = [2, -1, 0, 3, -1, 1]
    loss = CrossEntropy()(segmentation_step(labels, logits))
    expected = torch.nn.functional.cross_entropy(logits[[0, 2, 3, 5]], torch.tensor([2, 0, 3, 1]))
    torch.testing.assert_close(loss, expected, rtol=1e-14, atol=0)
    (found,), (wanted,) = torch.autograd.grad(loss, logits), torch.autograd.grad(expected, logits)
    torch.testing.assert_close(found, wanted, rtol=0, atol=1e-16)
    assert (found[[1, 4]] == 0).all()


def test_cross_entropy_of_uniform_logits_is_log_k() -> None:
    loss = CrossEntropy()(segmentation_step([0, 6, 3], torch.zeros(3, 7, dtype=torch.float64)))
    assert loss.item() == pytest.approx(math.log(7), rel=1e-12)


@pytest.mark.parametrize("classes", [0, 1, 5])
def test_cross_entropy_without_labels_is_zero_with_a_zero_gradient(classes: int) -> None:
    source = torch.randn(4, 8, requires_grad=True)
    loss = CrossEntropy()(segmentation_step([-1] * 4, source[:, :classes]))
    loss.backward()
    assert loss.item() == 0
    assert source.grad is not None
    assert (source.grad == 0).all()
