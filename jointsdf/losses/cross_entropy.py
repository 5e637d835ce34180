"""Cross-entropy of the part logits (segmentation loss)."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from jointsdf.losses import Needs
from jointsdf.values import UNLABELLED, Step


@dataclass(frozen=True)
class CrossEntropy:
    """Mean over labelled manifold points of the cross-entropy of the part logits (paper, L_SEG).

    Unlabelled points carry no loss; a step without any labelled point, or a field without a head, gives zero.
    """

    @property
    def needs(self) -> Needs:
        """Part logits on the manifold points."""
        return {"manifold": frozenset({"logits"})}

    def __call__(self, step: Step) -> Float[Tensor, ""]:
        """The term, in nats."""
        logits = step.fields["manifold"].logits
        assert logits is not None
        if logits.shape[1] == 0:
            return logits.sum()
        total = functional.cross_entropy(logits, step.labels, ignore_index=UNLABELLED, reduction="sum")
        return total / (step.labels != UNLABELLED).sum().clamp_min(1)
