"""Fused training pass through the sine layers, forward and backward by hand, in the fewest matrix products.

With a_i = W_i h_{i-1} + b_i (omega_i multiplied into both), h_i = sin a_i, c_i = cos a_i and f = w . h_L + b:

    gradient   d_i = c_i g_i,  g_{i-1} = d_i W_i,  g_L = w,  grad f = g_0                (explicit reverse)
    H u        p_i = W_i t_{i-1},  t_i = c_i p_i,  t_0 = u                               (forward over reverse)
               e_i = c_i q_i - h_i p_i g_i,  q_{i-1} = e_i W_i,  q_L = 0,  H u = q_0
    H          P_i = W_i (c_{i-1} P_{i-1}),  P_1 = W_1,  H = - sum_i P_i^T diag(h_i g_i) P_i

H u is the Hessian-vector product of Pearlmutter, "Fast Exact Multiplication by the Hessian" (1994). H is the chain rule
of second order: sine alone is curved, so each layer adds what its own second derivative -h_i makes of its Jacobian P_i.
A value costs one pass of products over the layers, the gradient one more, u^T H v two more, H three more; the backward
half (`backward.py`) costs twice as many. Plain autograd repeats passes and keeps several times the memory.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize

from jointsdf.model.derivatives import tangent_frame
from jointsdf.model.fused.backward import OutputBars, ParameterBars, backward
from jointsdf.model.fused.forward import Layers, Record, gradient, hessian, hessian_vector, value
from jointsdf.model.layers import SineLayer
from jointsdf.threads import over_threads, pieces


class Evaluation(NamedTuple):
    """Outputs of one pass; None where not asked for.

    Attributes:
        sdf: f(x), network length units.
        feature: Activations h of the tapped layer.
        grad: Gradient of f, dimensionless.
        mixed: u^T H v, (u, v) being the tangent frame of the detached gradient, 1 / network length.
        hessian: H, 1 / network length.
    """

    sdf: Float[Tensor, " n"]
    feature: Float[Tensor, "n w"] | None
    grad: Float[Tensor, "n 3"] | None
    mixed: Float[Tensor, " n"] | None
    hessian: Float[Tensor, "n 3 3"] | None


def evaluate(
    layers: Sequence[SineLayer],
    output: nn.Linear,
    points: Float[Tensor, "n 3"],
    *,
    grad: bool = False,
    angles: Float[Tensor, " n"] | None = None,
    hessian: bool = False,
    tap: int | None = None,
    backward_dtype: torch.dtype | None = None,
) -> Evaluation:
    """Evaluate the field, and its derivatives on demand, differentiable once with respect to the parameters.

    Args:
        layers: The sine layers.
        output: The linear layer after them.
        points: Where, network frame; no gradient flows to them.
        grad: Also give the gradient.
        angles: Rotation of each point's tangent frame about the gradient, radians; gives `grad` and `mixed`.
        hessian: Also give `grad` and the Hessian.
        tap: Layer whose activations to give, 1 = the first.
        backward_dtype: Precision of the backward pass's matrix products; None: the parameters' own. It does not touch
            the outputs, whose signs decide the direction of a step.

    >>> layer, output = SineLayer(3, 8, omega=30.0, weight_bound=1 / 3), nn.Linear(8, 1)
    >>> evaluate([layer], output, torch.zeros(2, 3), grad=True).grad.shape
    torch.Size([2, 3])
    """
    parameters = [parameter for layer in layers for parameter in (layer.linear.weight, layer.linear.bias)]
    outputs = _SinePass.apply(  # type: ignore[no-untyped-call]
        points,
        angles,
        _Request(grad or angles is not None or hessian, hessian, tap, backward_dtype),
        [layer.omega for layer in layers],
        *parameters,
        *output.parameters(),
    )
    return Evaluation(*outputs)


class _Request(NamedTuple):
    """Options of `evaluate`; `grad` is also set where second derivatives are wanted."""

    grad: bool
    hessian: bool
    tap: int | None
    backward_dtype: torch.dtype | None


class _SinePass(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        points: Tensor,
        angles: Tensor | None,
        request: _Request,
        omegas: list[float],
        *parameters: Tensor,
    ) -> tuple[Tensor | None, ...]:
        net = _scale(parameters, omegas, request.backward_dtype)

        def run(piece: tuple[Tensor, Tensor | None]) -> tuple[Record, Evaluation]:
            return _run_piece(net, *piece, request)

        count = pieces(points)
        turned = [None] * count if angles is None else angles.tensor_split(count)
        records, parts = zip(*over_threads(run, zip(points.tensor_split(count), turned, strict=True)), strict=True)
        ctx.net, ctx.records, ctx.omegas, ctx.tap = net, records, omegas, request.tap
        ctx.set_materialize_grads(False)
        return tuple(None if column[0] is None else torch.cat(column) for column in zip(*parts, strict=True))

    @staticmethod
    def backward(ctx: Any, *bars: Tensor | None) -> tuple[Tensor | None, ...]:
        sizes = [len(record.points) for record in ctx.records]
        by_piece = zip(*([None] * len(sizes) if bar is None else bar.split(sizes) for bar in bars), strict=True)

        def run(piece: tuple[Record, tuple[Tensor | None, ...]]) -> ParameterBars:
            return backward(ctx.net, piece[0], ctx.tap, OutputBars(*piece[1]))

        total, *others = over_threads(run, zip(ctx.records, by_piece, strict=True))
        for other in others:  # in the order of the pieces, whichever came first
            total.add(other)
        total.unscale(ctx.omegas)
        del ctx.records, ctx.net
        return None, None, None, None, *total.in_order()


def _scale(parameters: Sequence[Tensor], omegas: list[float], backward_dtype: torch.dtype | None) -> Layers:
    """Multiply omega into the weights and biases, given as W_1, b_1, W_2, ..., w, b."""
    *inner, output, offset = parameters
    weights = [omega * weight for omega, weight in zip(omegas, inner[::2], strict=True)]
    biases = [omega * bias for omega, bias in zip(omegas, inner[1::2], strict=True)]
    return Layers(weights, biases, output, offset, [weight.to(backward_dtype or weight.dtype) for weight in weights])


def _run_piece(net: Layers, points: Tensor, angles: Tensor | None, request: _Request) -> tuple[Record, Evaluation]:
    """Forward half of one piece."""
    record = Record(points)
    sdf, grad, mixed = value(net, record), gradient(net, record) if request.grad else None, None
    if angles is not None and grad is not None:
        record.frame = tangent_frame(normalize(grad, dim=-1), angles)
        mixed = (hessian_vector(net, record) * record.frame[1]).sum(-1)
    feature = record.sines[request.tap - 1] if request.tap else None
    return record, Evaluation(sdf, feature, grad, mixed, hessian(net, record) if request.hessian else None)
