"""A module in pieces on several threads against the module at once, values and gradients, in float64."""

from collections.abc import Iterator

import pytest
import torch
from conftest import KNOBS
from torch import Tensor, nn

from jointsdf import threads
from jointsdf.model.fused.pieces import in_pieces
from jointsdf.model.heads import HEADS


@pytest.fixture(params=[1, 2, 3])
def number(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    monkeypatch.setattr(threads, "MIN_PIECE_POINTS", 5)
    torch.set_num_threads(request.param)
    yield request.param
    torch.set_num_threads(1)


def answers(module: nn.Module, *, together: bool) -> list[Tensor]:
    """Outputs, and the gradients of a loss on them by inputs and parameters."""
    inputs = torch.randn(31, 11, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    outputs = module(2 * inputs) if together else in_pieces(module, 2 * inputs)
    loss = (outputs.exp() * torch.arange(31)[:, None]).sum()
    return [outputs, *torch.autograd.grad(loss, [inputs, *module.parameters()])]


@pytest.mark.usefixtures("number")
@pytest.mark.parametrize("name", [name for name in HEADS if name != "none"])
def test_every_head_gives_the_same_in_pieces(name: str) -> None:
    head = HEADS[name](11, 4, **KNOBS[name]).double().eval()
    for alone, whole in zip(answers(head, together=False), answers(head, together=True), strict=True):
        torch.testing.assert_close(alone, whole, rtol=1e-12, atol=1e-12)


def test_every_thread_gets_one_piece(number: int) -> None:
    sizes: list[int] = []

    class Seen(nn.Linear):
        def forward(self, inputs: Tensor) -> Tensor:
            sizes.append(len(inputs))
            return super().forward(inputs)

    answers(Seen(11, 2).double(), together=False)
    assert sum(sizes) == 31
    assert len(sizes) == number


def test_a_head_without_layers_is_called_directly(number: int) -> None:
    head = HEADS["none"](11, 0)
    assert in_pieces(head, torch.zeros(40 * number, 11)).shape == (40 * number, 0)
