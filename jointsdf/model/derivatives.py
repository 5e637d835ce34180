"""The derivatives of a sine network that the losses use, and the same of any function by plain autograd, the oracle.

Training takes them from `sine_pass`, which computes value and derivatives together; `trace` and `gradient` are for
asking a fitted field.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import linear

from jointsdf.model.layers import SineLayer

ScalarField = Callable[[Float[Tensor, "n 3"]], Float[Tensor, " n"]]


class Trace(NamedTuple):
    """One pass through the sine layers, kept for the gradient.

    Attributes:
        sdf: f(x).
        sines: h_i of each layer.
        cosines: c_i of each layer; empty when no derivative was asked for.
    """

    sdf: Float[Tensor, " n"]
    sines: list[Float[Tensor, "n w"]]
    cosines: list[Float[Tensor, "n w"]]


def trace(layers: Sequence[SineLayer], output: nn.Linear, points: Float[Tensor, "n 3"], *, with_cosines: bool) -> Trace:
    """Evaluate f and keep what `gradient` needs."""
    hidden = points
    sines: list[Tensor] = []
    cosines: list[Tensor] = []
    for layer in layers:
        argument = layer.omega * layer.linear(hidden)
        if with_cosines:
            cosines.append(torch.cos(argument))
        hidden = torch.sin(argument)
        sines.append(hidden)
    return Trace(linear(hidden, output.weight, output.bias).squeeze(-1), sines, cosines)


def gradient(layers: Sequence[SineLayer], output: nn.Linear, traced: Trace) -> Float[Tensor, "n 3"]:
    """Gradient of f by explicit reverse, dimensionless in the frame of the points."""
    adjoint = output.weight.expand_as(traced.sines[-1])
    for layer, cosine in zip(reversed(layers), reversed(traced.cosines), strict=True):
        adjoint = (layer.omega * cosine * adjoint) @ layer.linear.weight
    return adjoint


def tangent_frame(
    normals: Float[Tensor, "n 3"], angles: Float[Tensor, " n"]
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """An orthonormal tangent frame (u, v) of each unit normal, turned about it by the angle in radians.

    The unturned frame is the branchless one of Duff et al., "Building an Orthonormal Basis, Revisited" (2017).
    """
    x, y, z = normals.unbind(-1)
    sign = torch.where(z >= 0, torch.ones_like(z), -torch.ones_like(z))
    a = -1 / (sign + z)
    b = x * y * a
    first = torch.stack([1 + sign * x * x * a, sign * b, -sign * x], -1)
    second = torch.stack([b, sign + y * y * a, -y], -1)
    cosine, sine = torch.cos(angles)[:, None], torch.sin(angles)[:, None]
    return cosine * first + sine * second, cosine * second - sine * first


def mixed_stencil(
    field: ScalarField,
    points: Float[Tensor, "n 3"],
    u: Float[Tensor, "n 3"],
    v: Float[Tensor, "n 3"],
    spacing: float,
) -> Float[Tensor, " n"]:
    """u^T H v by the symmetric stencil [f(++) - f(+-) - f(-+) + f(--)] / (4 h^2), exact for cubics."""
    corners = torch.cat([points + spacing * (s * u + t * v) for s in (1, -1) for t in (1, -1)])
    pp, pm, mp, mm = field(corners).chunk(4)
    return (pp - pm - mp + mm) / (4 * spacing**2)


def autograd_gradient(field: ScalarField, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Gradient of f by reverse-mode autograd, graph kept. The points must require grad."""
    (grad,) = torch.autograd.grad(field(points).sum(), points, create_graph=True)
    return grad


def autograd_mixed(
    field: ScalarField, points: Float[Tensor, "n 3"], u: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]
) -> Float[Tensor, " n"]:
    """u^T H v by a Hessian-vector product in double backward, graph kept. The points must require grad."""
    along_v = (autograd_gradient(field, points) * v).sum()
    (hessian_v,) = torch.autograd.grad(along_v, points, create_graph=True)
    return (u * hessian_v).sum(-1)
