"""FlatCAD's objective the way its released code evaluates it: plain autograd, every point set on its own.

The gradient with respect to the points is taken on all three sets, though on the uniform one nothing uses it; for the
curvature term the near points go through the network a second time, for a Hessian-vector product by double backward;
and that is done at weight 0 as well. 28 passes of matrix products over a point set where 21 suffice, 15 at weight 0.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from jointsdf.model.derivatives import ScalarField, autograd_mixed, tangent_frame
from jointsdf.values import FieldValues, Samples, Step


def evaluate(field: ScalarField, samples: Samples) -> Step:
    """The field and its derivatives at every point set, graph kept.

    Args:
        field: Plain network, points -> sdf.
        samples: Points of one step.
    """
    fields = {name: _with_gradient(field, getattr(samples, name)) for name in ("manifold", "non_manifold", "shell")}
    again = samples.shell.clone().requires_grad_()
    grad = fields["shell"].grad
    assert grad is not None
    u, v = tangent_frame(normalize(grad.detach(), dim=-1), samples.angles)
    mixed = autograd_mixed(field, again, u, v)
    fields["shell"] = FieldValues(fields["shell"].sdf, grad, mixed)
    return Step(fields, samples.labels, samples.normals, samples.pool_distances)


def _with_gradient(field: ScalarField, points: Float[Tensor, "n 3"]) -> FieldValues:
    points = points.clone().requires_grad_()
    sdf = field(points)
    (grad,) = torch.autograd.grad(sdf.sum(), points, create_graph=True)
    return FieldValues(sdf, grad)
