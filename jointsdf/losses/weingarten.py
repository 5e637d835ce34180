"""Off-diagonal Weingarten (ODW) loss: prefers flat and singly curved surfaces."""

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Mixed, Needs
from jointsdf.values import Step

SHORTEST = 1e-12  # of a gradient that is divided by


@dataclass(frozen=True)
class Weingarten:
    """Off-diagonal entry of the shape operator in a random tangent frame (paper, L_ODW):

        mean over shell of |S_12|,   S_12 = u^T H v / |grad f|

    Zero where the level set is flat or umbilic; on a cylinder of radius r, |sin(2 angle)| / (2 r).

    Differs from:
        The released FlatCAD code does not divide by |grad f|: `normalised=False`.

    Attributes:
        normalised: Whether to divide by |grad f|.
        derivative: `exact`, or `finite_difference` by the symmetric stencil.
        spacing: h of the stencil, network length units.
    """  # noqa: D415

    normalised: bool = True
    derivative: Literal["exact", "finite_difference"] = "exact"
    spacing: float = 0.05

    def __post_init__(self) -> None:
        """Check derivative and spacing.

        Raises:
            InputError: Neither exact nor finite_difference, or a spacing that is not positive.
        """
        if self.derivative not in ("exact", "finite_difference"):
            raise InputError(f"weingarten.derivative={self.derivative}: accepted are exact, finite_difference")
        if self.spacing <= 0:
            raise InputError(f"weingarten.spacing={self.spacing}: must be > 0")

    @property
    def needs(self) -> Needs:
        """Gradient and mixed derivative on the shell."""
        return {"shell": frozenset({"grad", Mixed(self.derivative, self.spacing)})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in 1 / network length."""
        shell = step.fields["shell"]
        assert shell.mixed is not None
        assert shell.grad is not None
        sizes = shell.mixed.abs()
        if self.normalised:
            sizes = sizes / shell.grad.norm(dim=-1).clamp_min(SHORTEST)
        return sizes.mean()
