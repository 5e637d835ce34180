"""A module applied to points in large pieces, forward and backward, each piece on one thread."""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.threads import over_threads, pieces


def in_pieces(module: nn.Module, inputs: Float[Tensor, "n i"]) -> Float[Tensor, "n o"]:
    """`module(inputs)` for a module that treats each row by itself, differentiable once.

    Args:
        module: Draws no random numbers: threads would draw them in any order.
        inputs: One row per point.

    >>> in_pieces(nn.Identity(), torch.ones(2, 3)).shape
    torch.Size([2, 3])
    """
    parameters = list(module.parameters())
    if pieces(inputs) == 1 or not parameters:
        plain: Tensor = module(inputs)
        return plain
    together: Tensor = _InPieces.apply(module, inputs, *parameters)  # type: ignore[no-untyped-call]
    return together


class _InPieces(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, module: nn.Module, inputs: Tensor, *parameters: Tensor) -> Tensor:
        def run(piece: Tensor) -> tuple[Tensor, Tensor]:
            with torch.enable_grad():
                piece = piece.detach().requires_grad_()
                return piece, module(piece)

        ctx.graphs, ctx.parameters = over_threads(run, inputs.tensor_split(pieces(inputs))), parameters
        return torch.cat([outputs.detach() for _, outputs in ctx.graphs])

    @staticmethod
    def backward(ctx: Any, outputs_bar: Tensor) -> tuple[Tensor | None, ...]:
        bars = outputs_bar.split([len(outputs) for _, outputs in ctx.graphs])

        def run(graph: tuple[tuple[Tensor, Tensor], Tensor]) -> tuple[Tensor, ...]:
            (piece, outputs), bar = graph
            return torch.autograd.grad(outputs, [piece, *ctx.parameters], bar)

        inputs_bars, *shares = zip(*over_threads(run, zip(ctx.graphs, bars, strict=True)), strict=True)
        del ctx.graphs
        return None, torch.cat(inputs_bars), *(torch.stack(share).sum(0) for share in shares)
