"""The SIREN trunk: sizes, initialisation, the tapped feature."""

import math
import re

import pytest
import torch
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.model import trunk as trunk_module
from jointsdf.model.trunk import SirenTrunk
from jointsdf.values import BOX

ROOT6 = math.sqrt(6)


def fills(parameter: Tensor, bound: float) -> bool:
    """Whether values look uniform in +-bound."""
    return bool(0.9 * bound < parameter.abs().max() <= bound * (1 + 1e-6) and parameter.min() < 0 < parameter.max())


def test_trunk_has_the_papers_parameters() -> None:
    assert sum(p.numel() for p in SirenTrunk().parameters()) == 264_449


@pytest.mark.parametrize("hidden_omega", [1.0, 30.0])
def test_every_trunk_layer_starts_in_its_bounds(hidden_omega: float) -> None:
    torch.manual_seed(0)
    trunk = SirenTrunk(hidden_omega=hidden_omega)
    first, *hidden = trunk.sine_layers
    assert [layer.omega for layer in trunk.sine_layers] == [30.0, *[hidden_omega] * 4]
    assert fills(first.linear.weight, 1 / 3)
    assert fills(first.linear.bias, 1 / math.sqrt(3))
    for layer in hidden:
        assert fills(layer.linear.weight, ROOT6 / 16 / hidden_omega)
        assert fills(layer.linear.bias, 1 / 16 / hidden_omega)
    assert fills(trunk.output.weight, 1e-5)
    assert 0 < trunk.output.bias.abs() <= 1e-5


def test_hidden_omega_one_and_thirty_start_as_the_same_function() -> None:
    points = torch.rand(200, 3) * 2 - 1
    answers = []
    for hidden_omega in (1.0, 30.0):
        torch.manual_seed(5)
        trunk = SirenTrunk(hidden_omega=hidden_omega)
        answers.append(trunk(points))
    torch.testing.assert_close(answers[0][1], answers[1][1], rtol=0, atol=2e-5)
    torch.testing.assert_close(answers[0][0], answers[1][0], rtol=0, atol=1e-8)
    assert answers[0][0].abs().max() < 256 * 1e-5 + 1e-5


@pytest.mark.parametrize("tap", [1, 2, 3, 4, 5])
def test_head_sees_the_tapped_layer_and_the_point(tap: int) -> None:
    trunk = SirenTrunk(tap=tap)
    points = torch.rand(7, 3)
    hidden = points
    for layer in trunk.sine_layers[:tap]:
        hidden = layer(hidden)
    features = trunk(points)[1]
    assert trunk.feature_width == features.shape[1] == 259
    torch.testing.assert_close(features, torch.cat([hidden, points], -1), rtol=0, atol=1e-6)


def test_default_tap_is_the_third_layer() -> None:
    assert SirenTrunk().tap == 3


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"tap": 0}, "tap=0"),
        ({"tap": 6}, "tap=6"),
        ({"depth": 0}, "depth=0"),
        ({"width": 0}, "width=0"),
        ({"omega": 0.0}, "omega=0"),
        ({"hidden_omega": 0.0}, "hidden_omega=0"),
        ({"init": "cube"}, "init=cube"),
    ],
)
@pytest.mark.usefixtures("as_in_training")
def test_impossible_trunks_are_input_errors(wrong: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=re.escape(named)):
        SirenTrunk(**wrong)


def check_sphere(trunk: SirenTrunk) -> None:
    points = (torch.rand(4000, 3, generator=torch.Generator().manual_seed(9)) * 2 - 1) * BOX
    distances = points.norm(dim=-1) - trunk_module.SPHERE_RADIUS
    with torch.no_grad():
        sdf = trunk(points)[0]
    assert (sdf - distances).square().mean().sqrt() < 0.1
    assert (sdf[distances < 0] < 0).float().mean() > 0.85
    assert (sdf[distances > 0] > 0).float().mean() > 0.95


def test_sphere_start_has_the_right_sign_and_is_close() -> None:
    torch.manual_seed(0)
    check_sphere(SirenTrunk(init="sphere", width=128, depth=3))


@pytest.mark.slow
@pytest.mark.parametrize("hidden_omega", [1.0, 30.0])
def test_full_sphere_start(hidden_omega: float) -> None:
    torch.manual_seed(0)
    check_sphere(SirenTrunk(init="sphere", hidden_omega=hidden_omega))
