"""The normals term by hand."""

import math

import pytest
import torch
from exact_steps import (
    NONE,
)

from jointsdf.losses.normals import Normals
from jointsdf.values import FieldValues, Step


def test_normals_by_hand() -> None:
    """A right angle costs the root of two, a length of 3 costs 2, a flat field 1; and that has a finite gradient."""
    grad = torch.tensor([[0.0, 1, 0], [1, 0, 0], [3, 0, 0], [0, 0, 0]], dtype=torch.float64, requires_grad=True)
    normals = torch.tensor([[1.0, 0, 0]] * 4, dtype=torch.float64)
    step = Step({"manifold": FieldValues(torch.zeros(4), grad)}, torch.zeros(4, dtype=torch.int64), normals, NONE)
    loss = Normals()(step)
    assert loss.item() == pytest.approx((math.sqrt(2) + 0 + 2 + 1) / 4, rel=1e-12)
    (slope,) = torch.autograd.grad(loss, grad)
    half = math.sqrt(0.5)
    torch.testing.assert_close(4 * slope, torch.tensor([[-half, half, 0], [0] * 3, [1, 0, 0], [-1, 0, 0]]).double())


def test_points_without_a_normal_do_not_count() -> None:
    grad = torch.tensor([[0.0, 1, 0], [5, 5, 5], [3, 0, 0]], dtype=torch.float64, requires_grad=True)
    normals = torch.tensor([[1.0, 0, 0], [0, 0, 0], [1, 0, 0]], dtype=torch.float64)
    fields, labels = {"manifold": FieldValues(torch.zeros(3), grad)}, torch.zeros(3, dtype=torch.int64)
    loss = Normals()(Step(fields, labels, normals, NONE))
    assert loss.item() == pytest.approx((math.sqrt(2) + 2) / 2, rel=1e-12)
    assert not torch.autograd.grad(loss, grad)[0][1].any()
    nothing = Normals()(Step(fields, labels, 0 * normals, NONE))
    assert nothing.item() == 0
    assert not torch.autograd.grad(nothing, grad)[0].any()
