"""Signed-distance regression, weighted towards the surface, with a hinge on the sign everywhere."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Needs
from jointsdf.values import Step


@dataclass(frozen=True)
class NearDistance:
    """Mean over the pool of  band / (|d| + band) |f - d|  +  side max(0, min(|d|, clear) / 2 - sign(d) f).

    d is the known signed distance. The first part favours detail at the surface: an error counts half as much at a
    distance of `band`. The second removes sheets far from the surface, where the first is weak.

    Args:
        band: Network length units.
        side: Weight of a value on the wrong side, relative to an error at the surface.
        clear: Distance from the surface beyond which |f| must be at least half of this; network length units.

    Differs from:
        Not in the paper, which has points only; see `SignedDistance`. DeepSDF (Park et al. 2019) clamps both values
        instead, and a sheet far from the surface then has no gradient.

    Raises:
        InputError: One of them is not above 0.
    """

    band: float = 0.01
    side: float = 0.5
    clear: float = 0.1
    zero_on_exact_distance: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("band", "side", "clear"):
            if not getattr(self, name) > 0:
                raise InputError(f"loss.terms.signed_distance.{name}={getattr(self, name)}: must be above 0")

    @property
    def needs(self) -> Needs:
        """The value of f on the pool points."""
        return {"pool": frozenset({"sdf"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in network length units."""
        found, known = step.fields["pool"].sdf, step.pool_distances
        away = known.abs()
        errors = self.band / (away + self.band) * (found - known).abs()
        sides = torch.relu(away.clamp(max=self.clear) / 2 - known.sign() * found)
        return (errors + self.side * sides).mean()
