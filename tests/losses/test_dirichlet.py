"""The manifold term by hand."""

import torch
from exact_steps import step_of

from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.values import FieldValues


def test_dirichlet_by_hand() -> None:
    assert Dirichlet()(step_of(manifold=FieldValues(torch.tensor([0.5, -1.5, 1.0])))).item() == 1.0
