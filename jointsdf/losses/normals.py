"""Normals: the gradient of a signed distance at the surface."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class Normals:
    """Mean of |grad f - n| over the manifold points that have a unit normal n; 0 without any.

    Direction and length in one: no eikonal term is needed on the same points beside it.

    Differs from:
        Not in the paper, which has points only. IGR (Gropp et al. 2020, eq. 4) has the same term.
    """

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
