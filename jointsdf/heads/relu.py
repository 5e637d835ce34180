"""ReLU head: the plain classifier of the paper's comparison."""

from itertools import pairwise

from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.layers import classifier, kaiming


class ReluHead(nn.Module):
    """Part logits through two ReLU layers with dropout after the first (paper, Sec. "Network Architecture").

    Args:
        in_features: Width of [f; x].
        num_classes: Number of parts, K.
        widths: Units of the two hidden layers.
        dropout: Share of the first hidden layer's units dropped in training.
    """

    def __init__(self, in_features: int, num_classes: int, *, widths: tuple[int, int], dropout: float) -> None:
        super().__init__()
        first, second = (kaiming(i, o) for i, o in pairwise((in_features, *widths)))
        self.layers = nn.Sequential(
            first, nn.ReLU(), nn.Dropout(dropout), second, nn.ReLU(), classifier(widths[1], num_classes)
        )

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        """Part logits."""
        logits: Tensor = self.layers(features)
        return logits
