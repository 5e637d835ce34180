"""Non-manifold (sign-agnostic) loss: mean exp(-alpha |f|) off the surface."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import require_number
from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class SignAgnostic:
    """Mean over non_manifold of exp(-alpha |f|) (paper, L_DNM), which keeps the zero level set off empty space.

    Attributes:
        alpha: Decay per network length unit.
    """

    alpha: float = 100.0

    def __post_init__(self) -> None:
        """Check the decay."""
        require_number("loss.terms.sign_agnostic.alpha", self.alpha, 0)

    @property
    def needs(self) -> Needs:
        """The value of f on the non-manifold points."""
        return {"non_manifold": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in 0..1."""
        return torch.exp(-self.alpha * step.fields["non_manifold"].sdf.abs()).mean()
