"""The eikonal term by hand."""

import re
from collections.abc import Callable

import pytest
import torch
from exact_steps import (
    step_of,
)

from jointsdf.errors import InputError
from jointsdf.losses.eikonal import Eikonal
from jointsdf.values import FieldValues, Step


def eikonal_step() -> Step:
    lengths = {"manifold": [1.0, 2.0], "shell": [0.5], "non_manifold": [3.0, 0.0, 1.0]}
    return step_of(
        **{
            name: FieldValues(
                torch.zeros(len(sizes)), torch.tensor([[0.6 * s, 0.0, -0.8 * s] for s in sizes], dtype=torch.float64)
            )
            for name, sizes in lengths.items()
        }
    )


@pytest.mark.parametrize(
    ("form", "on", "expected"),
    [
        ("abs", ["manifold", "shell"], (0 + 1 + 0.5) / 3),
        ("squared", ["manifold", "shell"], (0 + 9 + 0.5625) / 3),
        ("quadratic", ["manifold", "shell"], (0 + 1 + 0.25) / 3),
        ("abs", ["manifold", "non_manifold", "shell"], (0 + 1 + 2 + 1 + 0 + 0.5) / 6),
        ("squared", ["manifold", "non_manifold", "shell"], (0 + 9 + 64 + 1 + 0 + 0.5625) / 6),
        ("abs", ["shell"], 0.5),
        ("quadratic", ["non_manifold"], (4 + 1 + 0) / 3),
    ],
)
def test_eikonal_by_hand(form: str, on: list[str], expected: float) -> None:
    term = Eikonal(form, on)
    assert term(eikonal_step()).item() == pytest.approx(expected, rel=1e-12)
    assert set(term.needs) == set(on)


@pytest.mark.parametrize("form", ["abs", "squared", "quadratic"])
def test_eikonal_has_a_finite_gradient_where_the_field_is_flat(form: str) -> None:
    grad = torch.tensor([[0.0, 0.0, 0.0], [1e-30, 0.0, 0.0], [1.0, 0.0, 0.0]], requires_grad=True)
    Eikonal(form, ["shell"])(step_of(shell=FieldValues(torch.zeros(3), grad))).backward()
    assert grad.grad is not None
    assert grad.grad.isfinite().all()


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Eikonal("cubed"), "eikonal.form=cubed: accepted are squared, abs, quadratic"),
        (lambda: Eikonal("abs", ["manifold", "nowhere"]), "nowhere"),
        (lambda: Eikonal("abs", []), "eikonal.on=[]"),
    ],
)
def test_bad_values_are_input_errors_of_one_line(make: Callable[[], object], named: str) -> None:
    with pytest.raises(InputError, match=f"^[^\\n]*{re.escape(named)}[^\\n]*$"):
        make()
