"""Segmentation heads: layers, initialisation, formulas, dropout."""

import math
from collections.abc import Callable

import pytest
import torch
from torch import Tensor, nn

from jointsdf.model.field import JointField
from jointsdf.model.heads import HEADS
from jointsdf.model.layers import SineLayer
from jointsdf.model.trunk import SirenTrunk

BuildField = Callable[..., JointField]
FULL_HEADS: dict[str, dict[str, object]] = {  # the sizes of the method
    "relu": {"widths": [256, 128], "dropout": 0.2},
    "siren": {"widths": [256, 128], "omega": 30.0},
    "hybrid": {"widths": [256, 128], "omega": 30.0, "dropout": 0.2},
    "deep_skip": {"widths": [256, 256, 256, 128], "omega": 30.0},
}
LAYERS = {  # (inputs, units) of every linear layer, the classifier apart
    "relu": [(259, 256), (256, 128)],
    "siren": [(259, 256), (256, 128)],
    "hybrid": [(259, 256), (256, 128)],
    "deep_skip": [(259, 256), (256, 256), (771, 256), (256, 128)],
}
ROOT6 = math.sqrt(6)
KAIMING = {("relu", 0), ("relu", 1), ("hybrid", 1)}


def fills(parameter: Tensor, bound: float) -> bool:
    """Whether values look uniform in +-bound."""
    return bool(0.9 * bound < parameter.abs().max() <= bound * (1 + 1e-6) and parameter.min() < 0 < parameter.max())


def head_of(name: str, classes: int = 4, seed: int = 0) -> nn.Module:
    torch.manual_seed(seed)
    return HEADS[name](259, classes, **FULL_HEADS[name])


@pytest.mark.parametrize("name", LAYERS)
def test_head_layers_and_their_starts(name: str) -> None:
    *hidden, last = [module for module in head_of(name).modules() if isinstance(module, nn.Linear)]
    assert [(layer.in_features, layer.out_features) for layer in hidden] == LAYERS[name]
    assert fills(last.weight, 1e-3)
    assert last.bias.abs().max() <= 1e-3
    for index, layer in enumerate(hidden):
        inputs = layer.in_features
        first_sine = index == 0 and (name, 0) not in KAIMING
        assert fills(layer.weight, 1 / 259 if first_sine else ROOT6 / math.sqrt(inputs)), f"layer {index}"
        if (name, index) in KAIMING:
            assert layer.bias.abs().max() <= 1 / math.sqrt(inputs)
        else:
            assert fills(layer.bias, 1 / math.sqrt(inputs)), f"layer {index}"


@pytest.mark.parametrize(
    ("name", "omegas", "dropouts"),
    [("relu", [], [0.2]), ("siren", [30, 1], []), ("hybrid", [30], [0.2]), ("deep_skip", [30, 1, 1, 1], [])],
)
def test_head_frequencies_and_dropout(name: str, omegas: list[float], dropouts: list[float]) -> None:
    modules = list(head_of(name).modules())
    assert [module.omega for module in modules if isinstance(module, SineLayer)] == omegas
    assert [module.p for module in modules if isinstance(module, nn.Dropout)] == dropouts
    assert any(isinstance(module, nn.ReLU) for module in modules) == (name in ("relu", "hybrid"))


@pytest.mark.parametrize("name", LAYERS)
def test_head_formula(name: str) -> None:
    """Every head written out again in plain operations."""
    head = head_of(name).double().eval()
    x = torch.rand(11, 259, dtype=torch.float64) * 2 - 1
    linears = [module for module in head.modules() if isinstance(module, nn.Linear)]

    def affine(i: int, inputs: Tensor) -> Tensor:
        return inputs @ linears[i].weight.T + linears[i].bias

    if name == "relu":
        hidden = affine(1, affine(0, x).clamp_min(0)).clamp_min(0)
    elif name == "siren":
        hidden = affine(1, (30 * affine(0, x)).sin()).sin()
    elif name == "hybrid":
        hidden = affine(1, (30 * affine(0, x)).sin()).clamp_min(0)
    else:
        first = (30 * affine(0, x)).sin()
        second = affine(1, first).sin()
        hidden = affine(3, affine(2, torch.cat([second, first, x], -1)).sin()).sin()
    torch.testing.assert_close(head(x), affine(-1, hidden), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["relu", "hybrid"])
def test_dropout_acts_on_the_first_hidden_layer_in_training_only(name: str) -> None:
    head, features = head_of(name), torch.rand(1, 259)
    kept: list[Tensor] = []
    (dropout,) = [module for module in head.modules() if isinstance(module, nn.Dropout)]
    dropout.register_forward_hook(lambda _module, inputs, output: kept.append((output != 0)[inputs[0] != 0]))
    head.train()
    for _ in range(200):
        head(features)
    assert torch.cat(kept).float().mean().item() == pytest.approx(0.8, abs=0.01)
    kept.clear()
    head.eval()(features)
    assert kept[0].all()


@pytest.mark.parametrize("name", LAYERS)
@pytest.mark.parametrize("classes", [1, 2, 7, 18, 40])
def test_logits_start_near_uniform_for_any_number_of_parts(name: str, classes: int) -> None:
    torch.manual_seed(0)
    trunk, head = SirenTrunk(), head_of(name, classes).eval()
    with torch.no_grad():
        probabilities = head(trunk(torch.rand(300, 3) * 2 - 1)[1]).softmax(-1)
    assert probabilities.shape == (300, classes)
    assert (probabilities * classes - 1).abs().max() < 0.1


def test_no_head_has_no_classes_and_no_parameters() -> None:
    head = HEADS["none"](259, 0)
    assert head(torch.rand(5, 259)).shape == (5, 0)
    assert list(head.parameters()) == []
    with pytest.raises(ValueError, match="num_classes=3"):
        HEADS["none"](259, 3)
