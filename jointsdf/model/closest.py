"""Closest points of a zero level set: along the gradient onto the surface, then along the surface to the foot point.

The way to the surface is sphere tracing along the gradient (Hart, 1996), close to it Newton's steps f g / |g|^2. Where
the field is a distance, that ends at the closest point. Where it is nearly one, or a lower bound as outside the
training box, the end is moved along the surface by Newton's method on the squared distance, whose Hessian there is
I + d S, with the shape operator S and the distance d along the outward normal; each step is taken back onto the surface
and accepted only where it is nearer. Of several closest points one is found; of several local minima, one of them.
"""

from collections.abc import Callable
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import normalize

from jointsdf.model.second_derivatives import Differential, shape_operator

REACHED = {torch.float32: 1e-5, torch.float64: 1e-10}  # |f| of a point on the surface, network length units
STEPS, NEAR = 64, 0.05  # onto the surface, at most; |f| from which a step is no longer than f, network length units
FLATTEST = 0.1  # gradient that a Newton step divides by at least
FOOT_STEPS, FOOT = 6, 1e-3  # along the surface, at most; angle off the normal that is left, radians
LEAST = 0.2  # eigenvalue of I + d S: less is beyond a focal point, where no closest point is near
SMALLEST = 1 / 4  # share of a step along the surface that is tried

First = Callable[[Float[Tensor, "n 3"]], tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]]  # value, gradient
Second = Callable[[Float[Tensor, "n 3"]], Differential]


class Closest(NamedTuple):
    """Closest points, in the frame of the points asked.

    Attributes:
        places: On the surface, where it was reached.
        reached: Whether it was.
    """

    places: Float[Tensor, "n 3"]
    reached: Bool[Tensor, " n"]


def find_closest(points: Float[Tensor, "n 3"], first: First, second: Second) -> Closest:
    """Find the closest point of the zero level set to each point.

    Args:
        points: Network frame, anywhere.
        first: Value and gradient anywhere; a lower bound of the distance away from the surface.
        second: Gradient and second derivatives at points of the surface.
    """
    places, reached = onto_surface(points, first)
    share = torch.ones_like(points[:, 0])  # of the next step along the surface
    active = reached.nonzero()[:, 0]
    for _ in range(FOOT_STEPS):
        step, angle = _along_surface(points[active], places[active], second)
        moving = angle > FOOT
        active, step = active[moving], step[moving]
        if not len(active):
            break
        there = onto_surface(places[active] + share[active, None] * step, first, STEPS // 8)
        before, after = ((points[active] - at).norm(dim=1) for at in (places[active], there.places))
        better = there.reached & (after < before)
        places[active[better]] = there.places[better]
        share[active] = torch.where(better, torch.ones_like(after), share[active] / 2)
        active = active[share[active] >= SMALLEST]
    return Closest(places, reached)


def onto_surface(points: Float[Tensor, "n 3"], first: First, steps: int = STEPS) -> Closest:
    """Steps along the gradient until |f| is within the tolerance; each is halved for a point whose |f| grew.

    Args:
        points: Network frame, anywhere.
        first: As for `find_closest`.
        steps: At most.
    """
    places, tolerance = points.clone(), REACHED[points.dtype]
    reached = torch.zeros(len(points), dtype=torch.bool, device=points.device)
    share, before = torch.ones_like(points[:, 0]), torch.full_like(points[:, 0], torch.inf)
    active = torch.arange(len(points), device=points.device)
    for _ in range(steps):
        sdf, grad = first(places[active])
        arrived = sdf.abs() <= tolerance
        reached[active[arrived]] = True
        active, sdf, grad = active[~arrived], sdf[~arrived], grad[~arrived]
        if not len(active):
            break
        share[active] = torch.where(sdf.abs() < before[active], share[active], share[active] / 2)
        before[active] = sdf.abs()
        lengths = grad.norm(dim=1)
        least = torch.where(sdf.abs() < NEAR, FLATTEST, 1.0).to(lengths)
        direction = torch.where(lengths[:, None] > 0, normalize(grad, dim=1), grad.new_tensor([1.0, 0.0, 0.0]))
        places[active] -= (share[active] * sdf / torch.maximum(lengths, least))[:, None] * direction
    return Closest(places, reached)


def _along_surface(
    points: Float[Tensor, "n 3"], places: Float[Tensor, "n 3"], second: Second
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, " n"]]:
    """Newton step along the surface towards the foot point; angle between normal and way to the point, radians.

    The angle is 0 where the point is on the surface but for rounding.
    """
    found = second(places)
    way, operator = points - places, shape_operator(found)
    along = (operator.frame.mT @ way[:, :, None])[:, :, 0]
    distance, tangential = way.norm(dim=1), along.norm(dim=1)
    height = (way * normalize(found.grad, dim=1)).sum(dim=1)
    least = 1 + (height[:, None] * operator.principal).min(dim=1).values
    lift = (LEAST - least).clamp_min(0)  # on the diagonal: I + d S is then positive definite
    hessian = height[:, None, None] * operator.matrix
    a, b, c = 1 + lift + hessian[:, 0, 0], hessian[:, 0, 1], 1 + lift + hessian[:, 1, 1]
    solved = torch.stack([c * along[:, 0] - b * along[:, 1], a * along[:, 1] - b * along[:, 0]], dim=1)
    step = (operator.frame @ (solved / (a * c - b * b)[:, None])[:, :, None])[:, :, 0]
    angle = tangential / distance.clamp_min(torch.finfo(distance.dtype).tiny)
    return step, torch.where(tangential > REACHED[points.dtype], angle, torch.zeros_like(angle))
