"""Signed-distance regression: mean |f - d| to the exact distance of the mesh."""

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class SignedDistance:
    """Mean over pool of |f - d|, d the exact signed distance to the mesh.

    Differs from:
        Not in the paper, which has points only. A CAD user has the mesh, and this term preserves thin walls.
    """

    zero_on_exact_distance: ClassVar[bool] = True

    @property
    def needs(self) -> Needs:
        """The value of f on the pool points."""
        return {"pool": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        return (step.fields["pool"].sdf - step.pool_distances).abs().mean()
