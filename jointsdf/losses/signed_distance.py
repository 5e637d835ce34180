"""Exact signed distances of the mesh, kept in the loss."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class SignedDistance:
    """Mean over pool of |f - d|, d the exact signed distance to the mesh.

    Differs from:
        Not in the paper, which has points only. A CAD user has the mesh, and this term is what keeps thin walls.
    """

    @property
    def needs(self) -> Needs:
        """The value of f on the pool points."""
        return {"pool": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        return (step.fields["pool"].sdf - step.pool_distances).abs().mean()
