"""The trunk and its starts, the heads' layers, and the joint field in file units."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from jointsdf.errors import InputError
from jointsdf.model import trunk as trunk_module
from jointsdf.model.field import JointField
from jointsdf.model.heads import HEADS
from jointsdf.model.layers import SineLayer
from jointsdf.model.trunk import SirenTrunk
from jointsdf.values import BOX, Normalisation

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


NORMALISATION = Normalisation(np.array([100.0, -20.0, 3.5]), 47.0)


def file_points(count: int = 60) -> np.ndarray:
    return NORMALISATION.inverse(np.random.default_rng(0).uniform(-1.1, 1.1, (count, 3)))


@pytest.mark.parametrize("head", HEADS)
def test_query_speaks_file_units_and_original_part_ids(small_field: BuildField, head: str) -> None:
    field = small_field(head, normalisation=NORMALISATION).eval()
    points = file_points()
    answer = field.query(torch.from_numpy(points))
    inside = torch.from_numpy(NORMALISATION.forward(points).astype(np.float32))
    sdf, features = field.trunk(inside)
    torch.testing.assert_close(answer.sdf, sdf * 47.0, rtol=1e-5, atol=1e-4)
    torch.testing.assert_close(answer.logits, field.head(features), rtol=0, atol=1e-5)
    if head == "none":
        assert answer.logits.shape == (60, 0)
        assert (answer.part == -1).all()
    else:
        assert answer.part.tolist() == [(3, 7, 12, 40)[k] for k in answer.logits.argmax(-1)]
        assert len(set(answer.part.tolist())) > 1
    np.testing.assert_array_equal(field.network_part(inside.numpy()), answer.part.numpy())
    np.testing.assert_allclose(field.network_sdf(inside.numpy()) * 47.0, answer.sdf.numpy(), rtol=1e-5, atol=1e-4)


def test_query_gradient_equals_finite_differences_in_file_units(small_field: BuildField) -> None:
    field = small_field("siren", normalisation=NORMALISATION, omega=8.0).eval()
    field.trunk.double()
    field.head.double()
    points, h = torch.from_numpy(file_points()), 1e-3
    steps = [h * axis for axis in torch.eye(3, dtype=torch.float64)]
    expected = [(field.query(points + s).sdf - field.query(points - s).sdf) / (2 * h) for s in steps]
    torch.testing.assert_close(field.query(points).gradient, torch.stack(expected, -1), rtol=0, atol=1e-6)


def test_query_far_from_the_origin_loses_nothing_to_float32(small_field: BuildField) -> None:
    """Normalised in double precision: parts drawn kilometres from the origin keep their shape."""
    near = small_field("siren", normalisation=Normalisation(np.zeros(3), 10.0)).eval()
    far = small_field("siren", normalisation=Normalisation(np.full(3, 1e6), 10.0)).eval()
    points = torch.rand(50, 3, dtype=torch.float64) * 20 - 10
    torch.testing.assert_close(far.query(points + 1e6).sdf, near.query(points).sdf, rtol=0, atol=1e-4)


def test_query_drops_nothing_in_training_mode_and_keeps_the_mode(small_field: BuildField) -> None:
    field = small_field("relu").train()
    points = torch.rand(50, 3) * 20
    first, second = field.query(points), field.query(points)
    torch.testing.assert_close(first.logits, second.logits, rtol=0, atol=0)
    assert field.head.training


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("hidden_omega", [1.0, 30.0])
def test_save_and_load_give_the_same_field(
    small_field: BuildField, tmp_path: Path, head: str, hidden_omega: float
) -> None:
    field = small_field(head, normalisation=NORMALISATION, hidden_omega=hidden_omega).eval()
    field.save(tmp_path / "field.ckpt")
    torch.load(tmp_path / "field.ckpt", weights_only=True)
    loaded = JointField.load(tmp_path / "field.ckpt")
    points = torch.from_numpy(file_points())
    for before, after in zip(field.query(points), loaded.query(points), strict=True):
        torch.testing.assert_close(after, before, rtol=0, atol=0)
    assert loaded.arguments == field.arguments
    assert loaded.normalisation.scale == 47.0
    np.testing.assert_array_equal(loaded.normalisation.centre, NORMALISATION.centre)
    assert not loaded.training


def test_loading_a_sphere_start_does_not_fit_the_sphere_again(
    small_field: BuildField, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SirenTrunk, "_fit_to_sphere", lambda _: None)
    field = small_field("siren", init="sphere")
    field.save(tmp_path / "field.ckpt")
    monkeypatch.setattr(SirenTrunk, "_fit_to_sphere", lambda _: pytest.fail("fitted"))
    assert JointField.load(tmp_path / "field.ckpt").arguments["trunk"]["init"] == "sphere"


@pytest.mark.parametrize("part_ids", [(5,), (0, 1), tuple(range(2, 82, 2))])
def test_any_number_of_parts_survives_the_file(
    small_field: BuildField, tmp_path: Path, part_ids: tuple[int, ...]
) -> None:
    field = small_field("hybrid", part_ids)
    field.save(tmp_path / "field.ckpt")
    answer = JointField.load(tmp_path / "field.ckpt").query(torch.rand(500, 3) * 50 - 25)
    assert answer.logits.shape == (500, len(part_ids))
    assert set(answer.part.tolist()) <= set(part_ids)


def test_field_of_another_number_of_parts_is_an_input_error(small_field: BuildField, tmp_path: Path) -> None:
    path = tmp_path / "field.ckpt"
    small_field("siren", (1, 2, 3)).save(path)
    stored = torch.load(path, weights_only=True)
    stored["state"]["part_ids"] = torch.arange(5)
    torch.save(stored, path)
    with pytest.raises(InputError, match=r"field\.ckpt: not a readable field checkpoint"):
        JointField.load(path)


def test_damaged_files_are_input_errors_of_one_line(small_field: BuildField, tmp_path: Path) -> None:
    path = tmp_path / "field.ckpt"
    small_field("siren").save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    torch.save({"state": {"centre": 1.0}}, path)
    no_tensor = path.read_bytes()
    damaged = [whole[: int(share * len(whole))] for share in np.linspace(0, 0.999, 40)]
    damaged += [rng.bytes(size) for size in (1, 2, 10, 100, 100, 1000)]
    damaged += [no_tensor, b"\x80\x022.", b"\x80\x02]q\x00a.", b"a text file\n"]
    for data in damaged:
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"^[^\n]*field\.ckpt: not a readable[^\n]*$"):
            JointField.load(path)


def test_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such field checkpoint"):
        JointField.load(tmp_path / "field.ckpt")


def test_unknown_head_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"head=relux: accepted are relu, siren"):
        JointField({}, {"name": "relux"}, np.arange(3), NORMALISATION)


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    "head",
    [
        {"name": "siren", "widths": [256], "omega": 30.0},
        {"name": "relu", "widths": [256, 128], "dropout": 1.5},
        {"name": "hybrid", "widths": [256, 128], "omega": 30.0},
        {"name": "deep_skip", "widths": [8, 8, 8, 8], "omega": 30.0, "dropout": 0.2},
    ],
    ids=lambda head: head["name"],
)
def test_wrong_head_arguments_are_input_errors(head: dict[str, object]) -> None:
    with pytest.raises(InputError, match=f"^head {head['name']} with [^\n]*$"):
        JointField({}, head, np.arange(3), NORMALISATION)


def test_many_points_are_answered_in_chunks(small_field, monkeypatch: pytest.MonkeyPatch) -> None:
    field = small_field()
    points = torch.rand(50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 40
    whole = field.query(points)
    monkeypatch.setattr("jointsdf.model.field.CHUNK", 7)
    for name, chunked in field.query(points)._asdict().items():
        torch.testing.assert_close(chunked, getattr(whole, name), rtol=1e-5, atol=1e-6)
