"""The training pass through the sine layers, forward and backward by hand: the fewest matrix products there can be.

With a_i = W_i h_{i-1} + b_i (omega_i multiplied into both), h_i = sin a_i, c_i = cos a_i and f = w . h_L + b:

    gradient   d_i = c_i g_i,  g_{i-1} = d_i W_i,  g_L = w,  grad f = g_0                (explicit reverse)
    H u        p_i = W_i t_{i-1},  t_i = c_i p_i,  t_0 = u                               (forward over reverse)
               e_i = c_i q_i - h_i p_i g_i,  q_{i-1} = e_i W_i,  q_L = 0,  H u = q_0

A value costs one pass of products over the layers, the gradient one more, u^T H v two more; the adjoints of these
straight lines (written x_bar) cost twice as many. Plain autograd repeats passes and keeps several times the memory.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize

from jointsdf.model.derivatives import tangent_frame
from jointsdf.model.fused.backward import backward
from jointsdf.model.fused.forward import Layers, Record, gradient, hessian_vector, value
from jointsdf.model.layers import SineLayer
from jointsdf.threads import over_threads, pieces


class Evaluation(NamedTuple):
    """What one pass gives; what was not asked for is None.

    Attributes:
        sdf: f(x), network length units.
        feature: Activations h of the tapped layer.
        grad: Gradient of f, dimensionless.
        mixed: u^T H v, (u, v) being the tangent frame of the detached gradient, 1 / network length.
    """

    sdf: Float[Tensor, " n"]
    feature: Float[Tensor, "n w"] | None
    grad: Float[Tensor, "n 3"] | None
    mixed: Float[Tensor, " n"] | None


def evaluate(
    layers: Sequence[SineLayer],
    output: nn.Linear,
    points: Float[Tensor, "n 3"],
    *,
    grad: bool = False,
    angles: Float[Tensor, " n"] | None = None,
    tap: int | None = None,
    backward_dtype: torch.dtype | None = None,
) -> Evaluation:
    """The field at the points and what else is asked for, differentiable once with respect to the parameters.

    Args:
        layers: The sine layers.
        output: The linear layer after them.
        points: Where, network frame; no gradient flows to them.
        grad: Whether to give the gradient.
        angles: Rotation of each point's tangent frame about the gradient, radians; gives `grad` and `mixed`.
        tap: Layer whose activations to give, 1 = the first.
        backward_dtype: Precision of the backward pass's matrix products; None: the parameters' own. The values, the
            gradient and the mixed derivative never suffer: their signs decide the direction of a step.
    """
    order = 2 if angles is not None else int(grad)
    parameters = [parameter for layer in layers for parameter in (layer.linear.weight, layer.linear.bias)]
    sdf, feature, gradient, mixed = _SinePass.apply(  # type: ignore[no-untyped-call]
        points,
        angles,
        (order, tap, backward_dtype),
        [layer.omega for layer in layers],
        *parameters,
        *output.parameters(),
    )
    return Evaluation(sdf, feature, gradient, mixed)


class _SinePass(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        points: Tensor,
        angles: Tensor | None,
        wanted: tuple[int, int | None, torch.dtype | None],
        omegas: list[float],
        *parameters: Tensor,
    ) -> tuple[Tensor | None, ...]:
        order, tap, dtype = wanted
        *inner, output, offset = parameters
        weights = [omega * weight for omega, weight in zip(omegas, inner[::2], strict=True)]
        biases = [omega * bias for omega, bias in zip(omegas, inner[1::2], strict=True)]
        net = Layers(weights, biases, output, offset, [weight.to(dtype or weight.dtype) for weight in weights])

        def ahead(piece: tuple[Tensor, Tensor | None]) -> tuple[Record, tuple[Tensor | None, ...]]:
            record = Record(piece[0])
            sdf, grad, mixed = value(net, record), gradient(net, record) if order else None, None
            if piece[1] is not None and grad is not None:
                record.frame = tangent_frame(normalize(grad, dim=-1), piece[1])
                mixed = (hessian_vector(net, record) * record.frame[1]).sum(-1)
            return record, (sdf, record.sines[tap - 1] if tap else None, grad, mixed)

        count = pieces(points)
        turned = [None] * count if angles is None else angles.tensor_split(count)
        records, parts = zip(*over_threads(ahead, zip(points.tensor_split(count), turned, strict=True)), strict=True)
        ctx.net, ctx.records, ctx.omegas, ctx.tap = net, records, omegas, tap
        ctx.set_materialize_grads(False)
        return tuple(None if column[0] is None else torch.cat(column) for column in zip(*parts, strict=True))

    @staticmethod
    def backward(ctx: Any, *outputs_bar: Tensor | None) -> tuple[Tensor | None, ...]:
        net: Layers = ctx.net
        sizes = [len(record.points) for record in ctx.records]
        bars = zip(*([None] * len(sizes) if bar is None else bar.split(sizes) for bar in outputs_bar), strict=True)

        def back(piece: tuple[Record, tuple[Tensor | None, ...]]) -> list[Tensor]:
            return backward(net, piece[0], ctx.tap, list(piece[1]))

        sums, *more = over_threads(back, zip(ctx.records, bars, strict=True))
        for others in more:  # in the order of the pieces, whichever came first
            for total, other in zip(sums, others, strict=True):
                total += other
        del ctx.records, ctx.net
        for i, omega in enumerate(ctx.omegas):
            sums[2 * i].mul_(omega)
            sums[2 * i + 1].mul_(omega)
        return None, None, None, None, *sums
