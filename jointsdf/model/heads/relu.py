"""ReLU head: the plain classifier of the paper's comparison."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import require_number
from jointsdf.model.layers import classifier, kaiming


class ReluHead(nn.Module):
    """Part logits through two ReLU layers with dropout after the first (paper, Sec. "Network Architecture").

    Args:
        in_features: Width of [f; x].
        num_classes: Number of parts, K.
        widths: Units of the two hidden layers.
        dropout: Share of the first hidden layer's units dropped in training.
    """

    def __init__(self, in_features: int, num_classes: int, *, widths: Sequence[int], dropout: float) -> None:
        super().__init__()
        require_number("head.dropout", dropout, 0, 1)
        one, two = widths
        self.layers = nn.Sequential(
            kaiming(in_features, one),
            nn.ReLU(),
            nn.Dropout(dropout),
            kaiming(one, two),
            nn.ReLU(),
            classifier(two, num_classes),
        )

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        """Part logits."""
        logits: Tensor = self.layers(features)
        return logits
