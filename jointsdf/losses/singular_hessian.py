"""Singular Hessian loss: determinant of the Hessian near the surface."""

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor
from torch.linalg import cross

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class SingularHessian:
    """Mean over shell of |det H|.

    The Hessian of a distance is singular wherever it exists: |grad f| = 1 gives H grad f = 0. The term keeps critical
    points, with a regular Hessian, away from the surface.

    Source: Wang et al., "Neural-Singular-Hessian: implicit neural representation of unoriented point clouds by
    enforcing singular Hessian" (ACM TOG 2023).
    """

    zero_on_exact_distance: ClassVar[bool] = True

    @property
    def needs(self) -> Needs:
        """The Hessian on the shell."""
        return {"shell": frozenset({"hessian"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in 1 / network length cubed."""
        hessian = step.fields["shell"].hessian
        assert hessian is not None, "it was asked for"
        first, second, third = hessian.unbind(1)  # as a triple product it has a gradient at singular matrices too
        return (first * cross(second, third)).sum(-1).abs().mean()
