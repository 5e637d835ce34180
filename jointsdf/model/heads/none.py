"""No segmentation: the FlatCAD baseline of the paper's paired table."""

from jaxtyping import Float
from torch import Tensor, nn


class NoHead(nn.Module):
    """A head without parameters and without classes.

    Args:
        in_features: Width of its input; unused.
        num_classes: Must be 0.
    """

    def __init__(self, in_features: int, num_classes: int) -> None:  # noqa: ARG002 (the heads' common signature)
        super().__init__()
        if num_classes != 0:
            raise ValueError(f"head none has no classes, got num_classes={num_classes}")

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n 0"]:
        """No logits."""
        return features[:, :0]
