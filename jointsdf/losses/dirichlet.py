"""Manifold (Dirichlet) loss."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class Dirichlet:
    """Pulls the surface to the zero level set: mean over manifold of |f| (paper, L_DM)."""

    @property
    def needs(self) -> Needs:
        """The value of f on the manifold points."""
        return {"manifold": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        return step.fields["manifold"].sdf.abs().mean()
