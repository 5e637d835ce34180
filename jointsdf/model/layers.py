"""Sine layers and the initialisations that keep their activations in distribution (SIREN, Sec. 3.2)."""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

FEW_THREADS = 2  # up to here numpy's sine on one core is faster than torch's on all


def sine_(argument: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
    """Sine in place, without gradient."""
    if _by_numpy(argument):
        np.sin(argument.numpy(), out=argument.numpy())
        return argument
    return argument.sin_()


def cosine(argument: Float[Tensor, "*size"], out: Float[Tensor, "*size"] | None = None) -> Float[Tensor, "*size"]:
    """Cosine, without gradient; in the memory of `out` where it is given."""
    found = torch.empty_like(argument) if out is None else out
    if _by_numpy(argument):
        np.cos(argument.numpy(), out=found.numpy())
        return found
    return torch.cos(argument, out=found)


def _by_numpy(argument: Tensor) -> bool:
    """True if numpy is faster: on one core half of torch's time in float32, with an error of 7e-8 instead of 4e-8."""
    return argument.dtype is torch.float32 and not argument.is_cuda and torch.get_num_threads() <= FEW_THREADS


class SineLayer(nn.Module):
    """Sine layer `sin(omega (W x + b))` (SIREN; Sitzmann et al., 2020).

    Args:
        in_features: Inputs.
        out_features: Units.
        omega: Frequency that multiplies the pre-activation.
        weight_bound: W starts uniform in +- this bound.
        bias_bound: b starts uniform in +- this bound; 1 / sqrt(in_features) by default.
    """

    def __init__(
        self,
        in_features: int,
        out_features: int,
        *,
        omega: float,
        weight_bound: float,
        bias_bound: float | None = None,
    ) -> None:
        super().__init__()
        self.omega = omega
        self.linear = nn.Linear(in_features, out_features)
        start_uniform(self.linear, weight_bound, 1 / math.sqrt(in_features) if bias_bound is None else bias_bound)

    def forward(self, inputs: Float[Tensor, "n i"]) -> Float[Tensor, "n o"]:
        """Activations; without gradients in one matrix, which the sine overwrites."""
        if torch.is_grad_enabled():
            return torch.sin(self.omega * self.linear(inputs))
        weight, bias = self.linear.weight, self.linear.bias
        return sine_(torch.addmm(bias, inputs, weight.T, beta=self.omega, alpha=self.omega))


def hidden_sine(in_features: int, out_features: int, *, omega: float) -> SineLayer:
    """Sine layer after the first: W ~ U(+-sqrt(6/n)/omega), so that any omega starts as the same function.

    The bias bound is divided by omega for the same reason.
    """
    return SineLayer(
        in_features,
        out_features,
        omega=omega,
        weight_bound=math.sqrt(6 / in_features) / omega,
        bias_bound=1 / math.sqrt(in_features) / omega,
    )


def start_uniform(linear: nn.Linear, weight_bound: float, bias_bound: float) -> nn.Linear:
    """Draw a linear layer's weights and biases uniform in +- the two bounds, in place."""
    nn.init.uniform_(linear.weight, -weight_bound, weight_bound)
    nn.init.uniform_(linear.bias, -bias_bound, bias_bound)
    return linear


def classifier(in_features: int, num_classes: int) -> nn.Linear:
    """Last layer of every head: weights and biases U(+-1e-3), so that logits start near uniform."""
    return start_uniform(nn.Linear(in_features, num_classes), 1e-3, 1e-3)


def kaiming(in_features: int, out_features: int) -> nn.Linear:
    """Linear layer before a ReLU: Kaiming-uniform weights (He et al., 2015), bias U(+-1/sqrt(in_features))."""
    linear = nn.Linear(in_features, out_features)
    return start_uniform(linear, math.sqrt(6 / in_features), 1 / math.sqrt(in_features))
