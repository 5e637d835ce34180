"""Derivatives of a sine network by closed form, so that one ordinary backward gives every parameter gradient.

With a_i = omega_i (W_i h_{i-1} + b_i), h_i = sin a_i, c_i = cos a_i and f = w . h_L + b:

    gradient   d_i = omega_i c_i g_i,  g_{i-1} = d_i W_i,  g_L = w,  grad f = g_0          (explicit reverse)
    H t        a'_i = omega_i W_i h'_{i-1},  h'_i = c_i a'_i,  h'_0 = t                     (forward over reverse)
               d'_i = omega_i (c_i g'_i - h_i a'_i g_i),  g'_{i-1} = d'_i W_i,  g'_L = 0,  H t = g'_0

The same quantities by plain autograd are `autograd_gradient` and `autograd_mixed`: slower, for any function,
the oracle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import linear, normalize

from jointsdf.layers import SineLayer, sine_cosine

ScalarField = Callable[[Float[Tensor, "n 3"]], Float[Tensor, " n"]]


class Trace(NamedTuple):
    """One pass through the sine layers, kept for the passes that follow it.

    Attributes:
        sdf: f(x).
        sines: h_i of each layer.
        cosines: c_i of each layer; empty when no derivative was asked for.
    """

    sdf: Float[Tensor, " n"]
    sines: list[Float[Tensor, "n w"]]
    cosines: list[Float[Tensor, "n w"]]


@dataclass(frozen=True)
class Mixed:
    """How to compute the mixed second derivative u^T H v.

    Attributes:
        derivative: `exact` (closed form) or `finite_difference` (symmetric four-point stencil).
        spacing: h of the stencil, network length units; the paper's follow-up uses 0.05.
    """

    derivative: Literal["exact", "finite_difference"] = "exact"
    spacing: float = 0.05


def trace(layers: Sequence[SineLayer], output: nn.Linear, points: Float[Tensor, "n 3"], *, with_cosines: bool) -> Trace:
    """Evaluate f and keep what the derivative passes need."""
    hidden = points
    sines: list[Tensor] = []
    cosines: list[Tensor] = []
    for layer in layers:
        argument = layer.omega * layer.linear(hidden)
        if with_cosines:
            hidden, cosine = sine_cosine(argument)
            cosines.append(cosine)
        else:
            hidden = torch.sin(argument)
        sines.append(hidden)
    return Trace(linear(hidden, output.weight, output.bias).squeeze(-1), sines, cosines)


def gradient(
    layers: Sequence[SineLayer], output: nn.Linear, traced: Trace
) -> tuple[Float[Tensor, "n 3"], list[Float[Tensor, "n w"]]]:
    """Gradient of f by explicit reverse.

    Returns:
        The gradient, dimensionless in the frame of the points, and the adjoints g_i of every layer's output.
    """
    adjoint = output.weight.expand_as(traced.sines[-1])
    adjoints: list[Tensor] = []
    for layer, cosine in zip(reversed(layers), reversed(traced.cosines), strict=True):
        adjoints.append(adjoint)
        adjoint = (layer.omega * cosine * adjoint) @ layer.linear.weight
    return adjoint, adjoints[::-1]


def hessian_vector(
    layers: Sequence[SineLayer],
    traced: Trace,
    adjoints: list[Float[Tensor, "n w"]],
    tangents: Float[Tensor, "n 3"],
) -> Float[Tensor, "n 3"]:
    """H t at every point by forward over reverse, t being the point's own tangent vector."""
    tangent = tangents
    argument_tangents: list[Tensor] = []
    for layer, cosine in zip(layers, traced.cosines, strict=True):
        argument_tangents.append(layer.omega * (tangent @ layer.linear.weight.T))
        tangent = cosine * argument_tangents[-1]
    adjoint_tangent: Tensor | None = None
    for i in range(len(layers) - 1, -1, -1):
        curvature = -traced.sines[i] * argument_tangents[i] * adjoints[i]
        if adjoint_tangent is not None:
            curvature = torch.addcmul(curvature, traced.cosines[i], adjoint_tangent)
        adjoint_tangent = (layers[i].omega * curvature) @ layers[i].linear.weight
    assert adjoint_tangent is not None
    return adjoint_tangent


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


def mixed_derivative(
    layers: Sequence[SineLayer],
    output: nn.Linear,
    points: Float[Tensor, "n 3"],
    angles: Float[Tensor, " n"],
    how: Mixed,
) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
    """f, grad f and u^T H v in one go, (u, v) being the detached tangent frame of each point turned by its angle.

    Args:
        layers: The sine layers.
        output: The linear layer after them.
        points: Where, in the network frame.
        angles: Rotation of each frame, radians.
        how: Exact or by finite differences.

    Returns:
        sdf (network length), gradient, mixed second derivative (1 / network length).
    """
    traced = trace(layers, output, points, with_cosines=True)
    grad, adjoints = gradient(layers, output, traced)
    u, v = tangent_frame(normalize(grad.detach(), dim=-1), angles)
    if how.derivative == "exact":
        return traced.sdf, grad, (hessian_vector(layers, traced, adjoints, u) * v).sum(-1)

    def value(at: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        return trace(layers, output, at, with_cosines=False).sdf

    return traced.sdf, grad, mixed_stencil(value, points, u, v, how.spacing)


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
