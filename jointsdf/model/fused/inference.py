"""Inference pass: value, gradient by reverse mode, head; formulas as in `evaluate.py`, nothing kept for training.

A value costs one pass of matrix products over the layers and its gradient one more, by the transposed weights; forward
mode would cost three more, one for each axis. Only the cosines are kept on the way up, and only for the gradient. A
thread takes a piece of points through trunk and head in memory of its own, small enough to stay in cache, and the next
piece overwrites it.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float, Shaped
from torch import Tensor, nn

from jointsdf.model.fused.forward import Layers
from jointsdf.model.layers import SineLayer, cosine, sine_
from jointsdf.threads import over_threads, pieces, workers

PIECE = 512  # points; their matrices take 0.5 MB each at width 256


class TappedHead(NamedTuple):
    """What is computed from the activations f of one sine layer.

    Attributes:
        tap: Number of the layer, from 1.
        head: From [f; x] to answers, a row for each point; called from several threads.
    """

    tap: int
    head: Callable[[Float[Tensor, "n i"]], Shaped[Tensor, "n ..."]]


class Inferred(NamedTuple):
    """Answers of one pass; None where not asked for.

    Attributes:
        sdf: f(x), network length units.
        grad: Gradient of f, dimensionless.
        head: Of the head, by rows.
    """

    sdf: Float[Tensor, " n"] | None
    grad: Float[Tensor, "n 3"] | None
    head: Shaped[Tensor, "n ..."] | None


class _Memory:
    """One thread's matrices, by name; their memory is reused from piece to piece."""

    def __init__(self, like: Tensor) -> None:
        self.like = like
        self.flat: dict[Hashable, Tensor] = {}

    def matrix(self, name: Hashable, rows: int, columns: int) -> Tensor:
        """A matrix of any content."""
        if name not in self.flat or len(self.flat[name]) < rows * columns:
            self.flat[name] = self.like.new_empty(rows * columns)
        return self.flat[name][: rows * columns].view(rows, columns)


@torch.no_grad()
def infer(
    layers: Sequence[SineLayer],
    output: nn.Linear,
    points: Float[Tensor, "n 3"],
    *,
    sdf: bool = True,
    grad: bool = False,
    tapped: TappedHead | None = None,
) -> Inferred:
    """Evaluate the field, its gradient and a head on demand, without gradients to the parameters.

    Args:
        layers: The sine layers.
        output: The linear layer after them.
        points: Where, network frame, in the parameters' precision.
        sdf: Whether to give the value; without it and the gradient, layers above the tapped one are left out.
        grad: Whether to give the gradient.
        tapped: The head to apply.

    >>> layer, output = SineLayer(3, 8, omega=30.0, weight_bound=1 / 3), nn.Linear(8, 1)
    >>> found = infer([layer], output, torch.zeros(2, 3), grad=True)
    >>> found.sdf.shape, found.grad.shape, found.head
    (torch.Size([2]), torch.Size([2, 3]), None)
    """
    weights = [layer.omega * layer.linear.weight for layer in layers]
    biases = [layer.omega * layer.linear.bias for layer in layers]
    net = Layers(weights, biases, output.weight, output.bias, weights)
    count = pieces(points, most=PIECE)
    values = points.new_empty(len(points)) if sdf else None
    grads = torch.empty_like(points) if grad else None
    memories = [_Memory(points) for _ in range(workers())]

    def run(piece: tuple[Tensor, Tensor | None, Tensor | None]) -> Tensor | None:
        memory = memories.pop()  # never empty: there is one for each thread
        try:
            return _run_piece(net, *piece, tapped, memory)
        finally:
            memories.append(memory)

    columns = ([None] * count if column is None else column.tensor_split(count) for column in (points, values, grads))
    answers = [answer for answer in over_threads(run, zip(*columns, strict=True)) if answer is not None]
    return Inferred(values, grads, torch.cat(answers) if answers else None)


def _run_piece(
    net: Layers,
    points: Tensor,
    sdf: Tensor | None,
    grad: Tensor | None,
    tapped: TappedHead | None,
    memory: _Memory,
) -> Tensor | None:
    """Write one piece's values and gradients in place; return the head's answers."""
    hidden, answers, cosines = points, None, []
    for number, (weight, bias) in enumerate(zip(net.weights, net.biases, strict=True), 1):
        out = memory.matrix(("hidden", number % 2), len(points), len(weight))
        argument = torch.addmm(bias, hidden, weight.T, out=out)
        if grad is not None:
            cosines.append(cosine(argument, memory.matrix(("cosine", number), *argument.shape)))
        hidden = sine_(argument)
        if tapped and number == tapped.tap:
            answers = tapped.head(_beside(hidden, points, memory))
            if sdf is grad is None:
                return answers
    if sdf is not None:
        torch.addmv(net.offset.expand(len(points)), hidden, net.output[0], out=sdf)
    if grad is not None:
        _write_gradient(net, cosines, grad, memory)
    return answers


def _beside(hidden: Tensor, points: Tensor, memory: _Memory) -> Tensor:
    """[f; x]."""
    width = hidden.shape[1]
    features = memory.matrix("features", len(points), width + points.shape[1])
    features[:, :width] = hidden
    features[:, width:] = points
    return features


def _write_gradient(net: Layers, cosines: list[Tensor], grad: Tensor, memory: _Memory) -> None:
    """g_0 by d_i = c_i g_i and g_{i-1} = d_i W_i from g_L = w; d_i takes the memory of c_i."""
    adjoint = net.output
    for number in range(len(cosines) - 1, -1, -1):
        product, weight = cosines[number].mul_(adjoint), net.weights[number]
        adjoint = torch.mm(
            product, weight, out=memory.matrix("adjoint", len(grad), weight.shape[1]) if number else grad
        )
