"""Hybrid head: one sine layer, then ReLU."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import require_number
from jointsdf.model.layers import SineLayer, classifier, kaiming


class HybridHead(nn.Module):
    """Part logits through a sine layer with dropout and a ReLU layer (paper, Sec. "Network Architecture").

    Args:
        in_features: Width of [f; x].
        num_classes: Number of parts, K.
        widths: Units of the sine and of the ReLU layer.
        omega: Frequency of the sine layer.
        dropout: Share of the sine layer's units dropped in training.
    """

    def __init__(
        self, in_features: int, num_classes: int, *, widths: Sequence[int], omega: float, dropout: float
    ) -> None:
        super().__init__()
        require_number("head.omega", omega, 1e-6, 1e6)
        require_number("head.dropout", dropout, 0, 1)
        one, two = widths
        self.layers = nn.Sequential(
            SineLayer(in_features, one, omega=omega, weight_bound=1 / in_features),
            nn.Dropout(dropout),
            kaiming(one, two),
            nn.ReLU(),
            classifier(two, num_classes),
        )

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        """Part logits."""
        logits: Tensor = self.layers(features)
        return logits
