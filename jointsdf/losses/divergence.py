"""Divergence loss: prefers fields whose gradient has no sources (DiGS)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class Divergence:
    """Mean over non_manifold of |div grad f|, limited to low..high:

        min(max(|Laplacian f|, low), high),   Laplacian f = trace H

    On an exact distance the Laplacian is the sum of the principal curvatures of the level set: 2 / r on a sphere.

    Source: Ben-Shabat, Koneputugodage and Gould, "DiGS: Divergence guided shape implicit neural representation for
    unoriented point clouds" (CVPR 2022); limits of the released code.

    Attributes:
        low: Below it a Laplacian costs the same, 1 / network length; 0 for no limit.
        high: Above it too; infinity for no limit.
    """  # noqa: D415

    low: float = 0.1
    high: float = 50.0

    def __post_init__(self) -> None:
        """Check the limits.

        Raises:
            InputError: They are not 0 <= low < high.
        """
        if not 0 <= self.low < self.high:
            raise InputError(f"loss.terms.divergence.low={self.low} high={self.high}: give 0 <= low < high")

    @property
    def needs(self) -> Needs:
        """The Hessian on the non-manifold points."""
        return {"non_manifold": frozenset({"hessian"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in 1 / network length."""
        hessian = step.fields["non_manifold"].hessian
        assert hessian is not None, "it was asked for"
        laplacian = torch.diagonal(hessian, dim1=1, dim2=2).sum(1)
        return laplacian.abs().clamp(self.low, self.high).mean()
