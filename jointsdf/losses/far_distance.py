"""Signed-distance regression away from the surface."""

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class FarDistance:
    """Mean over the pool of  |d| / (|d| + band) |f - d|, d the known signed distance.

    It leaves detail at the surface to `NearDistance`, whose weight falls as this one rises.

    Args:
        band: Distance at which an error counts half as much as far away, network length units.

    Differs from:
        Not in the paper, which has points only.

    Raises:
        InputError: The band is not above 0.
    """

    band: float = 0.1
    zero_on_exact_distance: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the range."""
        if not self.band > 0:
            raise InputError(f"loss.terms.far_distance.band={self.band}: must be above 0")

    @property
    def needs(self) -> Needs:
        """The value of f on the pool points."""
        return {"pool": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        away = step.pool_distances.abs()
        return (away / (away + self.band) * (step.fields["pool"].sdf - step.pool_distances).abs()).mean()
