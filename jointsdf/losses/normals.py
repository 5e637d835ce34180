"""Normals loss: deviation of the gradient at the surface from the known normals."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class Normals:
    """Mean of |grad f - n| over the manifold points that have a unit normal n; 0 without any.

    It covers direction and length: no eikonal term is needed on the same points.

    Differs from:
        Not in the paper, which has points only. IGR (Gropp et al., "Implicit geometric regularization for learning
        shapes", 2020, eq. 4) has the same term.
    """

    zero_on_exact_distance: ClassVar[bool] = True

    @property
    def needs(self) -> Needs:
        """The gradient on the manifold points."""
        return {"manifold": frozenset({"grad"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, dimensionless."""
        grad = step.fields["manifold"].grad
        assert grad is not None, "it was asked for"
        known = step.normals.any(dim=-1)
        return torch.where(known, (grad - step.normals).norm(dim=-1), 0).sum() / known.sum().clamp(min=1)
