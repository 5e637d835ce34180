"""Loss terms: each is a frozen dataclass that says what it `needs` and maps one `Step` to a scalar.

`needs` names, for each point set of the step, what must be evaluated there: `sdf`, `grad`, `logits`, or a `Mixed`.
"""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor

from jointsdf.model.derivatives import Mixed
from jointsdf.values import Step

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
