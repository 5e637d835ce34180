"""Tangent frames and second derivatives of scalar fields, by a stencil and by autograd (the tests' oracle).

Training takes exact derivatives from `fused.evaluate`, which computes value and derivatives together.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

ScalarField = Callable[[Float[Tensor, "n 3"]], Float[Tensor, " n"]]


def tangent_frame(
    normals: Float[Tensor, "n 3"], angles: Float[Tensor, " n"]
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """Orthonormal tangent frame (u, v) of each unit normal, turned about it by the angle in radians.

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
    """u^T H v by the symmetric stencil [f(++) - f(+-) - f(-+) + f(--)] / (4 h^2), exact for cubics.

    Args:
        field: f.
        points: Centres of the stencils.
        u: First direction at each point.
        v: Second direction at each point.
        spacing: h, length units of the points.

    >>> x, y, _ = torch.eye(3)[:, None]
    >>> mixed_stencil(lambda at: at[:, 0] * at[:, 1], torch.zeros(1, 3), x, y, 0.5)
    tensor([1.])
    """
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


def autograd_hessian(field: ScalarField, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3 3"]:
    """Hessian by double backward, row by row, graph kept. The points must require grad."""
    grad = autograd_gradient(field, points)
    rows = [torch.autograd.grad(grad[:, k].sum(), points, create_graph=True)[0] for k in range(3)]
    return torch.stack(rows, 1)
