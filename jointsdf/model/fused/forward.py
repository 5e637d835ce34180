"""Forward half of the fused pass (formulas in `evaluate.py`), recorded for `backward.py`: value, gradient, H u, H."""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.model.layers import cosine, sine_


@dataclass(frozen=True)
class Layers:
    """The network's parameters with omega multiplied into the sine layers.

    Attributes:
        weights: W_i.
        biases: b_i.
        output: w, one row.
        offset: b, one number.
        low_precision: W_i in the precision of the backward products.
    """

    weights: list[Tensor]
    biases: list[Tensor]
    output: Tensor
    offset: Tensor
    low_precision: list[Tensor]


@dataclass
class Record:
    """Quantities of one piece of points that the backward pass needs; lists run over the layers.

    Attributes:
        points: x, network frame.
        sines: h_i.
        cosines: c_i.
        adjoints: g_i.
        argument_tangents: p_i.
        adjoint_tangents: q_i; None for the last layer, where it is 0.
        frame: Tangent frame (u, v).
        jacobians: P_i, for each point a row per axis.
    """

    points: Tensor
    sines: list[Tensor] = field(default_factory=list)
    cosines: list[Tensor] = field(default_factory=list)
    adjoints: list[Tensor] = field(default_factory=list)
    argument_tangents: list[Tensor] = field(default_factory=list)
    adjoint_tangents: list[Tensor | None] = field(default_factory=list)
    frame: tuple[Tensor, Tensor] | None = None
    jacobians: list[Tensor] = field(default_factory=list)

    def inputs(self, i: int) -> Tensor:
        """h_{i-1}."""
        return self.sines[i - 1] if i else self.points

    def tangent(self, i: int) -> Tensor:
        """t_{i-1}."""
        assert self.frame is not None
        return self.cosines[i - 1] * self.argument_tangents[i - 1] if i else self.frame[0]

    def output_jacobian(self, i: int) -> Tensor:
        """Jacobian of h_{i-1} above the first layer: c_{i-1} P_{i-1}."""
        return self.cosines[i - 1][:, None] * self.jacobians[i - 1]

    def curvature(self, i: int) -> Tensor:
        """e_i."""
        negative = self.sines[i] * self.argument_tangents[i] * self.adjoints[i]
        q = self.adjoint_tangents[i]
        return negative.neg_() if q is None else torch.addcmul(negative.neg_(), self.cosines[i], q)


def value(net: Layers, record: Record) -> Float[Tensor, " n"]:
    """f; records h_i and c_i."""
    hidden = record.points
    for weight, bias in zip(net.weights, net.biases, strict=True):
        argument = torch.addmm(bias, hidden, weight.T)
        record.cosines.append(cosine(argument))
        hidden = sine_(argument)
        record.sines.append(hidden)
    return torch.addmv(net.offset.expand(len(hidden)), hidden, net.output[0])


def gradient(net: Layers, record: Record) -> Float[Tensor, "n 3"]:
    """Gradient of f, after `value`; records g_i."""
    adjoint = net.output.expand_as(record.sines[-1])
    for weight, c in zip(reversed(net.weights), reversed(record.cosines), strict=True):
        record.adjoints.insert(0, adjoint)
        adjoint = (c * adjoint) @ weight
    return adjoint


def hessian_vector(net: Layers, record: Record) -> Float[Tensor, "n 3"]:
    """H u, after `gradient`, u being the first tangent of the record's frame; records p_i and q_i."""
    assert record.frame is not None
    tangent = record.frame[0]
    for weight, c in zip(net.weights, record.cosines, strict=True):
        record.argument_tangents.append(tangent @ weight.T)
        tangent = c * record.argument_tangents[-1]
    record.adjoint_tangents = [None] * len(net.weights)
    for i in range(len(net.weights) - 1, 0, -1):
        record.adjoint_tangents[i - 1] = record.curvature(i) @ net.weights[i]
    return record.curvature(0) @ net.weights[0]


def hessian(net: Layers, record: Record) -> Float[Tensor, "n 3 3"]:
    """H, after `gradient`; records P_i."""
    total = torch.zeros(len(record.points), 3, 3, dtype=record.points.dtype, device=record.points.device)
    for i, weight in enumerate(net.weights):
        jacobian = record.output_jacobian(i) @ weight.T if i else weight.T.expand(len(record.points), -1, -1)
        record.jacobians.append(jacobian)
        total -= ((record.sines[i] * record.adjoints[i])[:, None] * jacobian) @ jacobian.mT
    return total
