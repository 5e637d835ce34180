"""Exact gradient and second derivatives of the whole field, and the principal curvatures of its level sets.

The shape operator of a level set at a point is H / |g| in the tangent plane, g being the gradient and H the second
derivatives (Goldman, "Curvature formulas for implicit curves and surfaces", 2005). Its eigenvalues are the principal
curvatures: positive where the surface bends away from its outward normal g, 1 / r on a sphere that is negative inside.
"""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from jointsdf.model.derivatives import tangent_frame
from jointsdf.model.far_grid import FarGrid
from jointsdf.model.fused.evaluate import evaluate
from jointsdf.model.trunk import SirenTrunk

PIECE = 4096  # points; the Jacobians of five layers of width 256 take 60 MB


class Differential(NamedTuple):
    """Gradient and second derivatives, network frame.

    Attributes:
        grad: Dimensionless.
        hessian: Symmetric, 1 / network length.
    """

    grad: Float[Tensor, "n 3"]
    hessian: Float[Tensor, "n 3 3"]


class ShapeOperator(NamedTuple):
    """The shape operator of level sets, 1 / length of its frame.

    Attributes:
        frame: Two orthonormal tangents u and v of each point, as columns.
        matrix: Symmetric, in that frame.
    """

    frame: Float[Tensor, "n 3 2"]
    matrix: Float[Tensor, "n 2 2"]

    @property
    def principal(self) -> Float[Tensor, "n 2"]:
        """Principal curvatures, the larger one first."""
        mean = (self.matrix[:, 0, 0] + self.matrix[:, 1, 1]) / 2
        half = torch.hypot((self.matrix[:, 0, 0] - self.matrix[:, 1, 1]) / 2, self.matrix[:, 0, 1])
        return torch.stack([mean + half, mean - half], dim=1)


@torch.no_grad()
def second_derivatives(trunk: SirenTrunk, far: FarGrid | None, points: Float[Tensor, "n 3"]) -> Differential:
    """Gradient and second derivatives of the whole field at points of the training box, without a graph."""
    found = [_of_piece(trunk, far, piece) for piece in points.split(PIECE)]
    return Differential(torch.cat([each.grad for each in found]), torch.cat([each.hessian for each in found]))


def _of_piece(trunk: SirenTrunk, far: FarGrid | None, points: Float[Tensor, "n 3"]) -> Differential:
    near = evaluate(trunk.sine_layers, trunk.output, points, hessian=True)
    assert near.grad is not None
    assert near.hessian is not None
    if far is None:
        return Differential(near.grad, near.hessian)
    values, slopes = far.value_and_gradient(points)
    grid = values, slopes, far.second_derivatives(points)
    hessian = far.blend_second_derivatives(grid, (near.sdf, near.grad, near.hessian))
    return Differential(far.blend_gradient((values, slopes), (near.sdf, near.grad)), hessian)


def shape_operator(differential: Differential) -> ShapeOperator:
    """The shape operator of the level set through each point.

    >>> towards = torch.tensor([[0.0, 0.0, 1.0]])
    >>> of_cylinder = torch.diag(torch.tensor([0.5, 0.0, 0.0]))[None]  # radius 2, about the y axis
    >>> shape_operator(Differential(towards, of_cylinder)).principal
    tensor([[0.5000, 0.0000]])
    """
    grad, hessian = differential
    lengths = grad.norm(dim=1).clamp_min(torch.finfo(grad.dtype).tiny)
    frame = torch.stack(tangent_frame(normalize(grad, dim=1), torch.zeros_like(lengths)), dim=2)
    return ShapeOperator(frame, frame.mT @ hessian @ frame / lengths[:, None, None])
