"""Distances and gradients away from the surface, by hand."""

import math

import pytest
import torch
from exact_steps import NONE, exact_step, pool_step, sphere

from jointsdf.errors import InputError
from jointsdf.losses.far_distance import FarDistance
from jointsdf.losses.far_gradients import FarGradients
from jointsdf.losses.near_distance import NearDistance
from jointsdf.values import FieldValues, Step


def far_step(grad: torch.Tensor, known: torch.Tensor) -> Step:
    fields = {"far": FieldValues(torch.zeros(len(grad)), grad)}
    return Step(fields, torch.zeros(0, dtype=torch.int64), torch.zeros(0, 3), NONE, known)


def test_far_distance_by_hand() -> None:
    """At the surface an error counts nothing, at the band half, far away whole; inside as outside."""
    found = torch.tensor([0.01, -0.05, 0.03, 0.5], dtype=torch.float64)
    step = pool_step(found, [0.0, -0.02, 0.02, 0.58])
    errors = [0.0, 0.03 / 2, 0.01 / 2, 0.08 * 0.58 / 0.6]
    assert FarDistance(0.02)(step).item() == pytest.approx(sum(errors) / 4, rel=1e-12)


def test_near_and_far_distance_of_one_band_add_up_to_every_error() -> None:
    found = torch.linspace(-1, 1, 41, dtype=torch.float64)
    step = pool_step(found, [0.3 * math.sin(7 * at) for at in range(41)])
    near = NearDistance(0.02, side=1e-9)(step)
    expected = (found - step.pool_distances).abs().mean()
    assert (near + FarDistance(0.02)(step)).item() == pytest.approx(expected.item(), rel=1e-6)


def test_far_gradients_by_hand() -> None:
    """A right angle costs the root of two, a length of 3 costs 2, a flat field 1; and that has a finite gradient."""
    grad = torch.tensor([[0.0, 1, 0], [1, 0, 0], [3, 0, 0], [0, 0, 0]], dtype=torch.float64, requires_grad=True)
    loss = FarGradients()(far_step(grad, torch.tensor([[1.0, 0, 0]] * 4, dtype=torch.float64)))
    assert loss.item() == pytest.approx((math.sqrt(2) + 0 + 2 + 1) / 4, rel=1e-12)
    (slope,) = torch.autograd.grad(loss, grad)
    half = math.sqrt(0.5)
    torch.testing.assert_close(4 * slope, torch.tensor([[-half, half, 0], [0] * 3, [1, 0, 0], [-1, 0, 0]]).double())


def test_without_far_points_the_term_is_zero() -> None:
    grad = torch.zeros(0, 3, requires_grad=True)
    assert FarGradients()(far_step(grad, torch.zeros(0, 3))).item() == 0


def test_a_wrong_value_far_away_has_a_slope_towards_the_right_one() -> None:
    step = exact_step(sphere)
    found = (step.pool_distances + 0.1).requires_grad_()
    fields = {"pool": FieldValues(found)}
    loss = FarDistance()(Step(fields, step.labels, step.normals, step.pool_distances))
    assert (torch.autograd.grad(loss, found)[0] >= 0).all()


def test_a_band_without_sense_is_refused() -> None:
    with pytest.raises(InputError, match=r"loss\.terms\.far_distance\.band=0"):
        FarDistance(0.0)
