"""The non-manifold term by hand."""

import math

import pytest
import torch
from exact_steps import (
    step_of,
)

from jointsdf.losses.sign_agnostic import SignAgnostic
from jointsdf.values import FieldValues


def test_sign_agnostic_by_hand() -> None:
    sdf = torch.tensor([0.0, 0.01, -0.02], dtype=torch.float64)
    step = step_of(non_manifold=FieldValues(sdf))
    assert SignAgnostic()(step).item() == pytest.approx((1 + math.exp(-1) + math.exp(-2)) / 3, rel=1e-12)
    assert SignAgnostic(50.0)(step).item() == pytest.approx((1 + math.exp(-0.5) + math.exp(-1)) / 3, rel=1e-12)
