"""Loss terms: frozen dataclasses that map one `Step` to a scalar, one file per term.

`needs` names, for each point set of the step, the values to evaluate there: `sdf`, `grad`, `hessian`, `logits`, or a
`Mixed`.
A term with the class attribute `zero_on_exact_distance = True` is zero where f is an exact signed distance.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor

from jointsdf.values import Step


@dataclass(frozen=True)
class Mixed:
    """Mixed second derivative u^T H v, and its method.

    Attributes:
        derivative: `exact` (closed form) or `finite_difference` (symmetric four-point stencil).
        spacing: h of the stencil, network length units; the paper's follow-up uses 0.05.
    """

    derivative: Literal["exact", "finite_difference"] = "exact"
    spacing: float = 0.05


Needs = Mapping[str, frozenset[str | Mixed]]


@runtime_checkable
class Term(Protocol):
    """Protocol of every loss term."""

    @property
    def needs(self) -> Needs:
        """Values to evaluate, per point set."""
        ...

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, unweighted."""
        ...
