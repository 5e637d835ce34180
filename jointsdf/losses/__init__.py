"""Loss terms: each is a frozen dataclass that says what it `needs` and maps one `Step` to a scalar.

`needs` names, for each point set of the step, what must be evaluated there: `sdf`, `grad`, `logits`, or a `Mixed`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor

from jointsdf.values import Step


@dataclass(frozen=True)
class Mixed:
    """How to compute the mixed second derivative u^T H v.

    Attributes:
        derivative: `exact` (closed form) or `finite_difference` (symmetric four-point stencil).
        spacing: h of the stencil, network length units; the paper's follow-up uses 0.05.
    """

    derivative: Literal["exact", "finite_difference"] = "exact"
    spacing: float = 0.05


Needs = Mapping[str, frozenset[str | Mixed]]


@runtime_checkable
class Term(Protocol):
    """What every loss term is."""

    @property
    def needs(self) -> Needs:
        """What must be evaluated, per point set."""
        ...

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, unweighted."""
        ...
