"""Sine head: the trunk's own activation carried into the classifier."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import require_number
from jointsdf.model.layers import SineLayer, classifier, hidden_sine


class SirenHead(nn.Module):
    """Part logits through two sine layers (paper, Sec. "Network Architecture").

    Args:
        in_features: Width of [f; x].
        num_classes: Number of parts, K.
        widths: Units of the two hidden layers.
        omega: Frequency of the first layer; the second has frequency 1.
    """

    def __init__(self, in_features: int, num_classes: int, *, widths: Sequence[int], omega: float) -> None:
        super().__init__()
        require_number("head.omega", omega, 1e-6, 1e6)
        one, two = widths
        self.layers = nn.Sequential(
            SineLayer(in_features, one, omega=omega, weight_bound=1 / in_features),
            hidden_sine(one, two, omega=1.0),
            classifier(two, num_classes),
        )

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        """Part logits."""
        logits: Tensor = self.layers(features)
        return logits
