"""The off-diagonal Weingarten term on surfaces of known curvature."""

import math
import re
from collections.abc import Callable

import pytest
import torch
from exact_steps import (
    RADIUS,
    Field,
    cylinder,
    exact_step,
    plane,
    sphere,
    step_of,
)
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Mixed
from jointsdf.losses.weingarten import Weingarten
from jointsdf.model.derivatives import autograd_gradient, autograd_mixed
from jointsdf.values import FieldValues, Step


@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("field", [sphere, plane])
def test_weingarten_is_zero_on_umbilic_and_flat_surfaces(field: Field, normalised: bool) -> None:
    assert Weingarten(normalised)(exact_step(field)).item() == pytest.approx(0, abs=1e-12)


def cylinder_step(angle: float, steepness: float) -> Step:
    turn = torch.linspace(0, 6, 50, dtype=torch.float64)
    zero = torch.zeros_like(turn)
    points = (RADIUS * torch.stack([turn.cos(), turn.sin(), zero], -1)).requires_grad_()
    around, along = torch.stack([-turn.sin(), turn.cos(), zero], -1), torch.stack([zero, zero, zero + 1], -1)
    u, v = math.cos(angle) * along + math.sin(angle) * around, math.cos(angle) * around - math.sin(angle) * along

    def field(at: Tensor) -> Tensor:
        return steepness * cylinder(at)

    shell = FieldValues(field(points), autograd_gradient(field, points), autograd_mixed(field, points, u, v))
    return step_of(shell=shell)


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 4, 2.0])
@pytest.mark.parametrize("steepness", [1.0, 2.5])
def test_weingarten_on_a_cylinder(angle: float, steepness: float) -> None:
    """|sin 2a| / 2r for any steepness of the field; the unnormalised form scales with it."""
    expected = abs(math.sin(2 * angle)) / (2 * RADIUS)
    step = cylinder_step(angle, steepness)
    assert Weingarten(normalised=True)(step).item() == pytest.approx(expected, abs=1e-12)
    assert Weingarten(normalised=False)(step).item() == pytest.approx(steepness * expected, abs=1e-12)


def test_weingarten_has_a_finite_gradient_where_the_field_is_flat() -> None:
    grad = torch.zeros(2, 3, requires_grad=True)
    mixed = torch.zeros(2, requires_grad=True)
    Weingarten()(step_of(shell=FieldValues(torch.zeros(2), grad, mixed))).backward()
    assert grad.grad is not None
    assert mixed.grad is not None
    assert grad.grad.isfinite().all()
    assert mixed.grad.isfinite().all()


def test_weingarten_asks_for_its_own_derivative() -> None:
    assert Weingarten().needs == {"shell": frozenset({"grad", Mixed("exact", 0.05)})}
    assert Mixed("finite_difference", 0.01) in Weingarten(derivative="finite_difference", spacing=0.01).needs["shell"]


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Weingarten(derivative="guess"), "weingarten.derivative=guess: accepted are exact, finite_difference"),
        (lambda: Weingarten(spacing=0.0), "weingarten.spacing=0.0: must be > 0"),
    ],
)
def test_bad_values_are_input_errors_of_one_line(make: Callable[[], object], named: str) -> None:
    with pytest.raises(InputError, match=f"^[^\\n]*{re.escape(named)}[^\\n]*$"):
        make()
