"""Eikonal loss: deviation of the gradient's length from one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Needs
from jointsdf.values import Step

POINT_SETS = ("manifold", "non_manifold", "shell", "pool")
FORMS = ("squared", "abs", "quadratic")


@dataclass(frozen=True)
class Eikonal:
    """Deviation from a unit gradient, in one of the published forms (paper, L_EIK).

        squared   mean of (|grad f|^2 - 1)^2      the paper
        abs       mean of | |grad f| - 1 |        the released FlatCAD code
        quadratic mean of (|grad f| - 1)^2        IGR (Gropp et al. 2020, eq. 2)

    Attributes:
        form: `squared`, `abs` or `quadratic`.
        on: The point sets whose union is averaged over.
    """

    form: Literal["squared", "abs", "quadratic"] = "abs"
    on: Sequence[str] = ("manifold", "shell")
    zero_on_exact_distance: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the two choices.

        Raises:
            InputError: Another form, or a point set that does not exist.
        """
        if self.form not in FORMS:
            raise InputError(f"eikonal.form={self.form}: accepted are {', '.join(FORMS)}")
        unknown = [name for name in self.on if name not in POINT_SETS]
        if unknown or not self.on:
            raise InputError(f"eikonal.on={list(self.on)}: accepted are one or more of {', '.join(POINT_SETS)}")

    @property
    def needs(self) -> Needs:
        """The gradient on every chosen point set."""
        return {name: frozenset({"grad"}) for name in self.on}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, dimensionless."""
        grads = [step.fields[name].grad for name in self.on]
        grad = torch.cat([grad for grad in grads if grad is not None])
        if self.form == "squared":
            return (grad.square().sum(-1) - 1).square().mean()
        errors = grad.norm(dim=-1) - 1
        return errors.abs().mean() if self.form == "abs" else errors.square().mean()
