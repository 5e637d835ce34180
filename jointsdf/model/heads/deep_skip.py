"""Deep sine head whose input and first hidden layer are fed again to its third."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import require_number
from jointsdf.model.layers import SineLayer, classifier, hidden_sine


class DeepSkipHead(nn.Module):
    """Part logits through four sine layers with a skip: h3 sees [h2; h1; f; x] (paper, Sec. "Network Architecture").

    Args:
        in_features: Width of [f; x].
        num_classes: Number of parts, K.
        widths: Units of the four hidden layers.
        omega: Frequency of the first layer; the later ones have frequency 1.
    """

    def __init__(self, in_features: int, num_classes: int, *, widths: Sequence[int], omega: float) -> None:
        super().__init__()
        require_number("head.omega", omega, 1e-6, 1e6)
        one, two, three, four = widths
        self.first = SineLayer(in_features, one, omega=omega, weight_bound=1 / in_features)
        self.second = hidden_sine(one, two, omega=1.0)
        self.third = hidden_sine(two + one + in_features, three, omega=1.0)
        self.fourth = hidden_sine(three, four, omega=1.0)
        self.classifier = classifier(four, num_classes)

    def forward(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        """Part logits."""
        first = self.first(features)
        second = self.second(first)
        third = self.third(torch.cat([second, first, features], -1))
        logits: Tensor = self.classifier(self.fourth(third))
        return logits
