"""The field outside the training box: a lower bound of the distance, from the value at the nearest point of the box.

The shape lies in the box, which is convex. So from x, with p its projection onto the box, every point q of the shape is
seen at |x - q|^2 >= |x - p|^2 + |p - q|^2, and the distance of x is at least the root of |x - p|^2 + d(p)^2.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from jointsdf.values import BOX

ROUNDING = 1e-6  # relative to the box, before a point counts as outside


class Extended(NamedTuple):
    """Values in the whole space, network frame.

    Attributes:
        sdf: Signed distance within the box, a lower bound of the distance outside; network length units.
        grad: Its gradient, dimensionless; None where it was not asked for.
    """

    sdf: Float[Tensor, " n"]
    grad: Float[Tensor, "n 3"] | None


def outside_box(points: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
    """Points of the network frame outside the training box.

    >>> outside_box(torch.tensor([[0.0, 0.0, 1.1], [0.0, 0.0, 1.2]])).tolist()
    [False, True]
    """
    return (points.abs() > BOX * (1 + ROUNDING)).any(dim=1)


def onto_box(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Project points onto the training box; those inside stay where they are.

    >>> onto_box(torch.tensor([[0.0, -1.0, 3.0]])).tolist()
    [[0.0, -1.0, 1.100000023841858]]
    """
    return torch.where(outside_box(points)[:, None], points.clamp(-BOX, BOX), points)


def extend(
    points: Float[Tensor, "n 3"],
    projected: Float[Tensor, "n 3"],
    sdf: Float[Tensor, " n"],
    grad: Float[Tensor, "n 3"] | None,
) -> Extended:
    """Extend the field's values at projected points to the points themselves, differentiably.

    Outside, the value is the root of |x - p|^2 + f(p)^2, and its gradient ((x - p) + f(p) J grad f(p)) / value; J, the
    derivative of the projection, drops the axes along which x was moved.

    Args:
        points: Where, network frame.
        projected: By `onto_box`.
        sdf: f at the projected points.
        grad: Its gradient there.
    """
    outside = outside_box(points)
    if not bool(outside.any()):
        return Extended(sdf, grad)
    away = points - projected
    squared = torch.where(outside, away.square().sum(dim=1) + sdf.square(), torch.ones_like(sdf))
    bound = squared.sqrt()
    if grad is not None:
        kept = torch.where(away == 0, grad, torch.zeros_like(grad))
        grad = torch.where(outside[:, None], (away + sdf[:, None] * kept) / bound[:, None], grad)
    return Extended(torch.where(outside, bound, sdf), grad)
