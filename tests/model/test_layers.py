"""Sine layers and starting values against SIREN's theory and plain torch."""

import math

import pytest
import torch
from torch import nn

from jointsdf.model.layers import FEW_THREADS, SineLayer, classifier, cosine, hidden_sine, kaiming, sine_


def fills(parameter: torch.Tensor, bound: float) -> bool:
    """Whether values look uniform in +-bound: all inside, the extremes near it, the variance bound^2 / 3."""
    inside = parameter.abs().max() <= bound * (1 + 1e-6)
    second_moment = parameter.double().square().mean() / (bound**2 / 3)
    return bool(
        inside and parameter.max() > 0.9 * bound and parameter.min() < -0.9 * bound and abs(second_moment - 1) < 0.15
    )


def test_sine_layer_multiplies_weights_and_bias_by_omega() -> None:
    layer = SineLayer(3, 5, omega=7.0, weight_bound=0.4).double()
    points = torch.randn(6, 3, dtype=torch.float64)
    expected = torch.sin(7.0 * (points @ layer.linear.weight.T + layer.linear.bias))
    torch.testing.assert_close(layer(points), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("omega", [1.0, 15.0, 30.0])
def test_hidden_layer_starts_in_bounds_divided_by_omega(omega: float) -> None:
    torch.manual_seed(0)
    layer = hidden_sine(256, 256, omega=omega)
    assert fills(layer.linear.weight, math.sqrt(6 / 256) / omega)
    assert fills(layer.linear.bias, 1 / 16 / omega)


def test_bias_bound_is_one_over_root_of_the_inputs() -> None:
    torch.manual_seed(0)
    layer = SineLayer(9, 4000, omega=30.0, weight_bound=1 / 3)
    assert fills(layer.linear.weight, 1 / 3)
    assert fills(layer.linear.bias, 1 / 3)


def test_classifier_starts_in_a_thousandth() -> None:
    torch.manual_seed(0)
    layer = classifier(128, 40)
    assert fills(layer.weight, 1e-3)
    assert 5e-4 < layer.bias.abs().max() <= 1e-3


def test_kaiming_layer() -> None:
    torch.manual_seed(0)
    layer = kaiming(259, 256)
    assert fills(layer.weight, math.sqrt(6 / 259))
    assert layer.bias.abs().max() <= 1 / math.sqrt(259)


def test_activations_keep_siren_distribution_through_the_layers() -> None:
    """With a ~ N(0, s): E[sin^2 a] = (1 - exp(-2 s)) / 2, and s of the next layer is 2 E[sin^2 a] + 1 / (3 n)."""
    torch.manual_seed(0)
    width = 256
    layers: list[nn.Module] = [SineLayer(3, width, omega=30.0, weight_bound=1 / 3)]
    layers += [hidden_sine(width, width, omega=30.0) for _ in range(4)]
    hidden = torch.rand(4000, 3) * 2.2 - 1.1
    power = 0.5  # the first layer's argument spans many periods: arcsine-distributed
    for index, layer in enumerate(layers):
        hidden = layer(hidden).detach()
        assert hidden.square().mean().item() == pytest.approx(power, rel=0.1), f"layer {index}"
        assert abs(hidden.mean().item()) < 0.05
        power = (1 - math.exp(-2 * (2 * power + 1 / (3 * width)))) / 2


@pytest.mark.parametrize("threads", [1, FEW_THREADS + 1])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_sine_and_cosine_are_as_exact_as_their_numbers(threads: int, dtype: torch.dtype) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        argument = 40 * torch.randn(1001, 16, generator=torch.Generator().manual_seed(0), dtype=dtype)
        exact = argument.double().clone()
        found_cosine, found_sine = cosine(argument), sine_(argument)
    finally:
        torch.set_num_threads(before)
    assert found_sine is argument
    atol = 1e-7 if dtype is torch.float32 else 1e-15
    torch.testing.assert_close(found_sine.double(), torch.sin(exact), rtol=0, atol=atol)
    torch.testing.assert_close(found_cosine.double(), torch.cos(exact), rtol=0, atol=atol)
