"""Gradient regression away from the surface."""

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class FarGradients:
    """Mean of |grad f - grad d| over the far points, d the exact signed distance; 0 without any.

    It covers direction and length: a value alone, off by a ripple of little height, may have any gradient.

    Differs from:
        Not in the paper, which has points only. The mesh tells the gradient: it leads away from the closest point.
    """

    zero_on_exact_distance: ClassVar[bool] = True

    @property
    def needs(self) -> Needs:
        """The gradient on the far points."""
        return {"far": frozenset({"grad"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, dimensionless."""
        grad = step.fields["far"].grad
        assert grad is not None, "it was asked for"
        return (grad - step.far_gradients).norm(dim=-1).sum() / max(len(grad), 1)
