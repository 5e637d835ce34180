"""Signed distances by hand."""

import torch
from exact_steps import pool_step

from jointsdf.losses.signed_distance import SignedDistance


def test_signed_distance_by_hand() -> None:
    step = pool_step(torch.tensor([1.0, -1.0, 0.0], dtype=torch.float64), [0.0, -1.0, 0.5])
    assert SignedDistance()(step).item() == 0.5
