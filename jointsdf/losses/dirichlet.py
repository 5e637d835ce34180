"""Manifold (Dirichlet) loss: mean |f| on the surface."""

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class Dirichlet:
    """Mean over manifold of |f| (paper, L_DM), which pulls the zero level set to the surface."""

    zero_on_exact_distance: ClassVar[bool] = True

    @property
    def needs(self) -> Needs:
        """The value of f on the manifold points."""
        return {"manifold": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        return step.fields["manifold"].sdf.abs().mean()
