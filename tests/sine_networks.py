"""Small sine networks in float64, and the same in plain torch operations, apart from the code under test."""

import math

import torch
from torch import Tensor

from jointsdf.model.trunk import SirenTrunk

NETWORKS = [  # width, depth, omega, hidden_omega
    (16, 1, 30.0, 30.0),
    (16, 2, 30.0, 1.0),
    (24, 3, 10.0, 30.0),
    (32, 5, 30.0, 30.0),
    (32, 5, 30.0, 1.0),
    (8, 7, 5.0, 2.0),
]


def network(width: int, depth: int, omega: float, hidden_omega: float) -> SirenTrunk:
    torch.manual_seed(width + depth)
    trunk = SirenTrunk(width=width, depth=depth, omega=omega, hidden_omega=hidden_omega, tap=1).double()
    torch.nn.init.uniform_(trunk.output.weight, -1, 1)
    return trunk


def plain(trunk: SirenTrunk, points: Tensor, tap: int = 1) -> tuple[Tensor, Tensor]:
    """f and the tapped activations."""
    hidden, activations = points, []
    for layer in trunk.sine_layers:
        hidden = torch.sin(layer.omega * (hidden @ layer.linear.weight.T + layer.linear.bias))
        activations.append(hidden)
    return (hidden @ trunk.output.weight.T + trunk.output.bias)[:, 0], activations[tap - 1]


def random_points(count: int = 40) -> tuple[Tensor, Tensor]:
    """Points in the training box, and an angle for each."""
    generator = torch.Generator().manual_seed(3)
    points = torch.rand(count, 3, dtype=torch.float64, generator=generator) * 2.2 - 1.1
    return points, torch.rand(count, dtype=torch.float64, generator=generator) * 2 * math.pi


def relative(a: Tensor, b: Tensor) -> float:
    """Relative distance of a from b."""
    return ((a.double() - b.double()).norm() / b.double().norm()).item()
