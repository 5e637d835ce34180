"""The joint field: answers in file units, and its file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from jointsdf.errors import InputError
from jointsdf.model import field as module
from jointsdf.model.field import JointField
from jointsdf.model.heads import HEADS
from jointsdf.model.sealed_file import checksum
from jointsdf.model.trunk import SirenTrunk
from jointsdf.values import Normalisation

BuildField = Callable[..., JointField]


NORMALISATION = Normalisation(np.array([100.0, -20.0, 3.5]), 47.0)


def file_points(count: int = 60) -> np.ndarray:
    return NORMALISATION.inverse(np.random.default_rng(0).uniform(-1.05, 1.05, (count, 3)))


@pytest.mark.parametrize("head", HEADS)
def test_query_speaks_file_units_and_original_part_ids(small_field: BuildField, head: str) -> None:
    field = small_field(head, normalisation=NORMALISATION).eval()
    points = file_points()
    answer = field.query(torch.from_numpy(points))
    inside = torch.from_numpy(NORMALISATION.forward(points).astype(np.float32))
    sdf, features = field.trunk(inside)
    torch.testing.assert_close(answer.sdf, sdf * 47.0, rtol=1e-5, atol=1e-3)
    torch.testing.assert_close(answer.logits, field.head(features), rtol=0, atol=1e-4)
    if head == "none":
        assert answer.logits.shape == (60, 0)
        assert (answer.part == -1).all()
    else:
        assert answer.part.tolist() == [(3, 7, 12, 40)[k] for k in answer.logits.argmax(-1)]
        assert len(set(answer.part.tolist())) > 1
    np.testing.assert_array_equal(field.network_part(inside.numpy()), answer.part.numpy())
    np.testing.assert_allclose(field.network_sdf(inside.numpy()) * 47.0, answer.sdf.numpy(), rtol=1e-5, atol=1e-3)
    sdf, gradient = field.network_differential(inside.numpy())
    np.testing.assert_allclose(sdf * 47.0, answer.sdf.numpy(), rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(gradient, answer.gradient.numpy(), rtol=1e-4, atol=1e-4)


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
    answer = JointField.load(tmp_path / "field.ckpt").query(torch.rand(500, 3) * 30 - 10)
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
    with pytest.raises(InputError, match=r"^head[. ][^\n]*$"):
        JointField({}, head, np.arange(3), NORMALISATION)


def test_many_points_are_answered_in_chunks(small_field, monkeypatch: pytest.MonkeyPatch) -> None:
    field = small_field()
    points = torch.rand(50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 20
    whole = field.query(points)
    monkeypatch.setattr(module, "CHUNK", 7)
    for name, chunked in field.query(points)._asdict().items():
        torch.testing.assert_close(chunked, getattr(whole, name), rtol=1e-5, atol=1e-6)


def test_load_takes_a_string(small_field: BuildField, tmp_path: Path) -> None:
    small_field().save(tmp_path / "field.ckpt")
    assert isinstance(JointField.load(str(tmp_path / "field.ckpt")), JointField)


@pytest.mark.parametrize("head", HEADS)
def test_a_file_in_half_precision_is_half_as_large_and_loads_as_float32(
    small_field: BuildField, tmp_path: Path, head: str
) -> None:
    field = small_field(head, normalisation=NORMALISATION, width=128).eval()
    whole, half = tmp_path / "field.ckpt", tmp_path / "half.ckpt"
    field.save(whole)
    field.save(half, half=True)
    assert 0.5 < half.stat().st_size / whole.stat().st_size < 0.7  # of a field as small as this, the rest counts
    assert torch.load(half, weights_only=True)["precision"] == "float16"
    loaded = JointField.load(half)
    for (name, before), after in zip(field.state_dict().items(), loaded.state_dict().values(), strict=True):
        assert before.dtype == after.dtype
        rounded = before.ndim == 2 and name not in ("trunk.layers.0.linear.weight", "trunk.output.weight")
        relative = 2**-11 if rounded else 0
        assert ((after - before).abs() <= relative * before.abs() + (2**-25 if rounded else 0)).all(), name
        assert torch.equal(before, after) != rounded, name
    points = torch.from_numpy(file_points())
    before, after = field.query(points), loaded.query(points)
    assert (after.sdf - before.sdf).abs().max() < 47.0 * value_bound(field.trunk)
    assert (after.part != before.part).sum() <= 1


def value_bound(trunk: SirenTrunk) -> float:
    """Bound of |f - f_half|: each layer adds omega sum_j |W_ij - half(W_ij)|, and passes on omega |W| of the last."""
    error = torch.zeros(trunk.sine_layers[0].linear.out_features, dtype=torch.float64)
    for layer in trunk.sine_layers[1:]:
        weight = layer.linear.weight.detach().double()
        rounding = (weight - weight.half().double()).abs().sum(1)
        error = layer.omega * (rounding + weight.half().double().abs() @ error)
    return float(trunk.output.weight.detach().double().abs()[0] @ error) + 1e-5


def test_the_usual_file_holds_float32_its_checksum_and_nothing_of_half_precision(
    small_field: BuildField, tmp_path: Path
) -> None:
    field = small_field()
    field.save(tmp_path / "field.ckpt")
    stored = torch.load(tmp_path / "field.ckpt", weights_only=True)
    assert stored.keys() == {"format", "trunk", "head", "state", "sha256"}
    assert stored["sha256"] == checksum({"format": 1, **field.arguments, "state": field.state_dict()})


def test_weights_beyond_half_precision_are_an_input_error(small_field: BuildField, tmp_path: Path) -> None:
    field = small_field()
    torch.nn.init.constant_(field.trunk.sine_layers[1].linear.weight, 7e4)
    field.save(tmp_path / "field.ckpt")
    with pytest.raises(InputError, match=r"^trunk\.layers\.1\.linear\.weight=7e\+04: float16 ends at 65504; [^\n]*$"):
        field.save(tmp_path / "half.ckpt", half=True)
