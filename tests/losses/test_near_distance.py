"""Weighted signed distances by hand."""

import pytest
import torch
from exact_steps import pool_step

from jointsdf.errors import InputError
from jointsdf.losses.near_distance import NearDistance


def test_near_distance_by_hand() -> None:
    """At the surface an error counts whole, at the band half; a wrong side costs beside it, less clear than `clear`."""
    found = torch.tensor([0.01, -0.05, 0.03, 0.5], dtype=torch.float64)
    step = pool_step(found, [0.0, -0.02, -0.02, 0.58])
    errors = [0.01, 0.03 / 2, 0.05 / 2, 0.08 * 0.02 / 0.6]
    assert NearDistance(0.02, 0.3, 0.1)(step).item() == pytest.approx((sum(errors) + 0.3 * 0.04) / 4, rel=1e-12)


def test_a_sheet_far_from_the_surface_is_pushed_away_whatever_its_depth() -> None:
    found = torch.tensor([-0.9, -0.01, 0.04, 0.06], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(NearDistance(0.02, 1.0, 0.1)(pool_step(found, [0.9] * 4)), found)
    far = 0.02 / 0.92
    torch.testing.assert_close(4 * slope, -torch.tensor([1 + far, 1 + far, 1 + far, far], dtype=torch.float64))


@pytest.mark.parametrize("name", ["band", "side", "clear"])
def test_near_distance_refuses_a_number_without_sense(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}=0"):
        NearDistance(**{name: 0.0})
