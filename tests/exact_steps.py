"""Steps of a fit in which the field is an exact signed distance, and others made by hand."""

import math
from collections.abc import Callable

import torch
from analytic import box_distance, cylinder_distance, sphere_distance
from torch import Tensor

from jointsdf.model.derivatives import autograd_gradient, autograd_hessian, autograd_mixed, tangent_frame
from jointsdf.values import FieldValues, Step

Field = Callable[[Tensor], Tensor]
NONE, NOWHERE = torch.zeros(0), torch.zeros(0, 3)
RADIUS = 0.6
HALF = torch.tensor([0.7, 0.5, 0.3], dtype=torch.float64)


def sphere(points: Tensor) -> Tensor:
    return sphere_distance(points, RADIUS)


def cylinder(points: Tensor) -> Tensor:
    return cylinder_distance(points, RADIUS)


def box(points: Tensor) -> Tensor:
    return box_distance(points, HALF)


def plane(points: Tensor) -> Tensor:
    return points[:, 2] + 0 * points.square().sum(-1) - 0.1  # the zero keeps a graph for the second derivative


def uniform(count: int = 500, seed: int = 0) -> Tensor:
    return torch.rand(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) * 2.2 - 1.1


def onto(field: Field, points: Tensor) -> Tensor:
    """The points moved to the zero level set along the gradient of an exact distance."""
    for _ in range(3):  # a box's corner regions need a second look
        points = points.detach().requires_grad_()
        points = points - field(points).detach()[:, None] * autograd_gradient(field, points).detach()
    return points.detach()


def exact_step(field: Field) -> Step:
    """A step in which the field is its own exact signed distance."""

    def values(points: Tensor) -> FieldValues:
        points = points.clone().requires_grad_()
        grad = autograd_gradient(field, points)
        angles = torch.linspace(0, 2 * math.pi, len(points), dtype=torch.float64)
        u, v = tangent_frame(torch.nn.functional.normalize(grad.detach(), dim=-1), angles)
        mixed, hessian = autograd_mixed(field, points, u, v), autograd_hessian(field, points)
        return FieldValues(field(points), grad, mixed, hessian=hessian)

    surface, pool = onto(field, uniform(seed=1)), uniform(seed=2)
    fields = {
        "manifold": values(surface),
        "non_manifold": values(uniform(seed=3)),
        "shell": values(surface + 0.02 * uniform(seed=4)),
        "pool": values(pool),
        "far": values(uniform(seed=5)),
    }
    normals = torch.nn.functional.normalize(autograd_gradient(field, surface.clone().requires_grad_()), dim=-1).detach()
    known = autograd_gradient(field, uniform(seed=5).requires_grad_()).detach()
    return Step(fields, torch.zeros(len(surface), dtype=torch.int64), normals, field(pool), known)


def step_of(**fields: FieldValues) -> Step:
    return Step(fields, torch.zeros(0, dtype=torch.int64), NOWHERE, NONE)


def pool_step(found: Tensor, known: list[float]) -> Step:
    nothing = torch.zeros(0, dtype=torch.int64)
    return Step({"pool": FieldValues(found)}, nothing, NOWHERE, torch.tensor(known, dtype=torch.float64))
