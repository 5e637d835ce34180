"""The shared SIREN trunk: sine layers, signed distance, and the feature that a head sees."""

from collections.abc import Sequence
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import InputError, require_integer, require_number, require_one_of
from jointsdf.model.layers import SineLayer, hidden_sine, start_uniform
from jointsdf.values import BOX

SPHERE_RADIUS = 0.5  # network length units; about the size of a part in its box


class SirenTrunk(nn.Module):
    """SIREN shared by both outputs: sine layers, and a linear layer for the signed distance.

    Args:
        width: Units per layer.
        depth: Sine layers.
        omega: Frequency of the first layer, omega_0.
        hidden_omega: Frequency of the other layers. Any value starts as the same function; hidden weights learn faster
            the larger it is (the paper's text: 1; the released FlatCAD code: 30).
        tap: Number of the layer whose activations the head sees, from 1.
        init: `siren`: output near zero, the paper's. `sphere`: all layers fitted to a sphere's signed distance, which
            fixes the sign of the field.

    Raises:
        InputError: A value out of range.
    """

    def __init__(
        self,
        *,
        width: int = 256,
        depth: int = 5,
        omega: float = 30.0,
        hidden_omega: float = 30.0,
        tap: int = 3,
        init: Literal["siren", "sphere"] = "siren",
    ) -> None:
        super().__init__()
        require_integer("trunk.width", width, 1, 65536)
        require_integer("trunk.depth", depth, 1, 256)
        require_number("trunk.omega", omega, 1e-6, 1e6)
        require_number("trunk.hidden_omega", hidden_omega, 1e-6, 1e6)
        if not isinstance(tap, int) or not 1 <= tap <= depth:
            raise InputError(f"trunk.tap={tap}: accepted are 1..{depth}, the trunk's layers")
        require_one_of("trunk.init", init, ("siren", "sphere"))
        self.tap = tap
        hidden = [hidden_sine(width, width, omega=hidden_omega) for _ in range(depth - 1)]
        self.layers = nn.ModuleList([SineLayer(3, width, omega=omega, weight_bound=1 / 3), *hidden])
        self.output = start_uniform(nn.Linear(width, 1), 1e-5, 1e-5)
        if init == "sphere":
            self._fit_to_sphere()

    @property
    def sine_layers(self) -> Sequence[SineLayer]:
        """The sine layers in order."""
        return [layer for layer in self.layers if isinstance(layer, SineLayer)]

    @property
    def feature_width(self) -> int:
        """Width of a head's input [f; x]."""
        return self.sine_layers[self.tap - 1].linear.out_features + 3

    def forward(self, points: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, " n"], Float[Tensor, "n i"]]:
        """Signed distance and the head's input [f; x], network frame."""
        hidden = feature = points
        for number, layer in enumerate(self.sine_layers, 1):
            hidden = layer(hidden)
            feature = hidden if number == self.tap else feature
        sdf: Tensor = self.output(hidden).squeeze(-1)
        return sdf, torch.cat([feature, points], -1)

    def _fit_to_sphere(self, steps: int = 200, samples: int = 1000) -> None:
        """Fit f(x) = |x| - radius on random points of the box, by Adam in about a second."""
        optimizer = torch.optim.Adam(self.parameters(), lr=3e-4)
        for _ in range(steps):
            points = (torch.rand(samples, 3) * 2 - 1) * BOX
            loss = (self(points)[0] - (points.norm(dim=-1) - SPHERE_RADIUS)).abs().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
