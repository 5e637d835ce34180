"""Newton-Schulz iterations against the singular value decomposition, in float64."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.polynomial import Polynomial
from torch import nn
from torch.optim import Adam

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.model.trunk import SirenTrunk
from jointsdf.optimizers import ITERATIONS, Muon, MuonAdam, orthogonalise, parameter_groups

BuildField = Callable[..., JointField]

SHAPES = [(3, 20, 20), (1, 30, 12), (2, 12, 30)]
REACHED = {"five": (0.002, 0.68, 1.22), "four": (0.003, 0.80, 1.20), "three": (0.01, 0.73, 1.27)}


def matrices(shape: tuple[int, int, int]) -> torch.Tensor:
    return torch.randn(shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def applied(iterations: str, values: np.ndarray) -> np.ndarray:
    """The polynomials in turn, by numpy."""
    for a, b, c in ITERATIONS[iterations]:
        values = Polynomial([0, a, 0, b, 0, c])(values)
    return values


@pytest.mark.parametrize("iterations", ITERATIONS)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_the_singular_values_alone_change_and_each_by_the_polynomials(
    shape: tuple[int, int, int], iterations: str
) -> None:
    given = matrices(shape)
    found = orthogonalise(given, ITERATIONS[iterations])
    for matrix, turned in zip(given, found, strict=True):
        u, s, vh = np.linalg.svd(matrix.numpy(), full_matrices=False)
        expected = u * applied(iterations, s / np.linalg.norm(s)) @ vh
        np.testing.assert_allclose(turned.numpy(), expected, atol=1e-12)


@pytest.mark.parametrize("iterations", ITERATIONS)
def test_the_result_is_near_the_polar_factor(iterations: str) -> None:
    least, low, high = REACHED[iterations]
    reached = applied(iterations, np.linspace(least, 1, 100_001))
    assert low - 0.01 < reached.min() < low + 0.01
    assert high - 0.02 < reached.max() < high + 0.01
    given = torch.linalg.qr(matrices((1, 20, 20)))[0] * torch.linspace(0.1, 1, 20, dtype=torch.float64)
    u, s, vh = torch.linalg.svd(given)
    assert float((s / s.norm()).min()) > least
    cosine = (orthogonalise(given, ITERATIONS[iterations]) * (u @ vh)).sum() / np.sqrt(20)
    assert cosine / orthogonalise(given, ITERATIONS[iterations]).norm() > 0.98


@pytest.mark.parametrize("iterations", ["four", "three"])
def test_each_polynomial_is_the_best_of_its_degree_on_what_the_one_before_leaves(iterations: str) -> None:
    """Its error is largest, with alternating signs, once more often than it has coefficients (Chebyshev)."""
    low, high = REACHED[iterations][0], 1.0
    for a, b, c in ITERATIONS[iterations]:
        p = Polynomial([0, a, 0, b, 0, c])
        turns = sorted(r.real for r in p.deriv().roots() if abs(r.imag) < 1e-9 and low < r.real < high)
        errors = 1 - p(np.array([low, *turns, high]))
        np.testing.assert_allclose(errors * [1, -1, 1, -1], errors[0], atol=1e-4)
        low, high = 1 - abs(errors[0]), 1 + abs(errors[0])


def test_matrices_do_not_mix_and_a_zero_one_stays() -> None:
    given = matrices((4, 20, 20))
    given[2] = 0
    found = orthogonalise(given, ITERATIONS["five"])
    for k in range(4):
        alone = orthogonalise(given[k : k + 1], ITERATIONS["five"])[0]
        torch.testing.assert_close(found[k], alone, rtol=0, atol=1e-13)
    assert not found[2].any()


@pytest.mark.parametrize("dtype", [None, torch.bfloat16], ids=str)
def test_the_precision_is_the_one_that_is_asked_for(dtype: torch.dtype | None) -> None:
    given = matrices((2, 64, 64)).float()
    exact = orthogonalise(given.double(), ITERATIONS["five"])
    found = orthogonalise(given, ITERATIONS["five"], dtype)
    error = float((found - exact).norm() / exact.norm())
    assert found.dtype == torch.float32
    assert error < 1e-5 if dtype is None else 1e-3 < error < 5e-2


def test_matrices_of_several_shapes_and_none_without_a_gradient_move() -> None:
    shapes = [(8, 8), (6, 3), (8, 8), (3, 6), (8, 8)]
    parameters = [torch.nn.Parameter(torch.zeros(shape)) for shape in shapes]
    for k, parameter in enumerate(parameters[:-1]):
        parameter.grad = torch.randn(parameter.shape, generator=torch.Generator().manual_seed(k))
    Muon(parameters, lr=0.1, momentum=0.5).step()
    for parameter in parameters[:-1]:
        assert parameter.grad is not None
        tall = max(1.0, parameter.shape[0] / parameter.shape[1]) ** 0.5
        expected = -0.1 * tall * orthogonalise(parameter.grad[None] * 0.75, ITERATIONS["five"])[0]
        torch.testing.assert_close(parameter.data, expected, rtol=1e-4, atol=1e-6)
    assert not parameters[-1].any()


def test_an_unknown_iteration_is_one_line() -> None:
    groups = [{"name": "hidden", "params": [torch.nn.Parameter(torch.eye(4))]}]
    with pytest.raises(InputError, match=r"^optimizer\.iterations=six: accepted are five, four, three$"):
        MuonAdam(groups, lr=1e-3, muon_lr=1e-3, iterations="six")


def test_the_state_of_torchs_muon_is_refused_by_name() -> None:
    def groups() -> list[dict]:
        return [
            {"name": "hidden", "params": [torch.nn.Parameter(torch.eye(4))]},
            {"name": "trunk", "params": [torch.nn.Parameter(torch.ones(4))]},
        ]

    before = groups()
    muon, adam = torch.optim.Muon(before[:1], lr=1e-3), torch.optim.Adam(before[1:], lr=1e-3)
    for group in before:
        for parameter in group["params"]:
            parameter.grad = torch.ones_like(parameter)
    muon.step()
    adam.step()
    ours = MuonAdam(groups(), lr=1e-3, muon_lr=1e-3)
    with pytest.raises(InputError, match=r"state of torch\.optim\.Muon.*resume=never starts the fit over"):
        ours.load_state_dict({"muon": muon.state_dict(), "adam": adam.state_dict()})


def test_groups_hold_every_parameter_once(small_field: BuildField) -> None:
    field = small_field("siren", depth=4)
    groups = {group["name"]: group for group in parameter_groups(field.trunk, field.head, head_lr=0.5)}
    assert [p.shape for p in groups["hidden"]["params"]] == [(16, 16)] * 3
    grouped = [id(p) for group in groups.values() for p in group["params"]]
    assert sorted(grouped) == sorted(id(p) for p in field.parameters())
    assert groups["head"]["lr"] == 0.5
    assert "lr" not in groups["trunk"]


def test_a_field_without_a_head_has_no_head_group(small_field: BuildField) -> None:
    field = small_field("none")
    assert [group["name"] for group in parameter_groups(field.trunk, field.head)] == ["hidden", "trunk"]


def test_muon_on_a_trunk_of_one_layer_is_an_input_error(small_field: BuildField) -> None:
    field = small_field("none", depth=1, tap=1)
    with pytest.raises(InputError, match=r"trunk\.depth >= 2"):
        MuonAdam(parameter_groups(field.trunk, field.head), lr=1e-3, muon_lr=1e-3)


def train(field: JointField, optimizer: MuonAdam, steps: range) -> None:
    for step in steps:
        optimizer.zero_grad()
        sdf, features = field.trunk(torch.rand(32, 3, generator=torch.Generator().manual_seed(step)))
        (sdf.square().mean() + field.head(features).square().mean()).backward()
        optimizer.step()


def muon_of(field: JointField) -> MuonAdam:
    return MuonAdam(parameter_groups(field.trunk, field.head, head_lr=3e-3), lr=1e-3, muon_lr=2e-3)


def test_muon_adam_continues_identically_from_its_state(small_field: BuildField) -> None:
    straight = small_field("siren")
    train(straight, muon_of(straight), range(8))

    first = small_field("siren")
    optimizer = muon_of(first)
    train(first, optimizer, range(4))
    resumed = small_field("siren", seed=1)
    resumed.load_state_dict(first.state_dict())
    other = muon_of(resumed)
    other.load_state_dict(optimizer.state_dict())
    train(resumed, other, range(4, 8))
    for a, b in zip(straight.parameters(), resumed.parameters(), strict=True):
        assert torch.equal(a, b)
    assert [g["lr"] for g in other.param_groups] == [2e-3, 1e-3, 3e-3]
    other.param_groups[0]["lr"] = 0.5  # the schedulers' groups are the optimizers' own
    assert other.muon.param_groups[0]["lr"] == 0.5


def test_muon_adam_state_is_plain_values(small_field: BuildField, tmp_path: Path) -> None:
    field = small_field("siren")
    optimizer = muon_of(field)
    train(field, optimizer, range(2))
    torch.save(optimizer.state_dict(), tmp_path / "state")
    torch.load(tmp_path / "state", weights_only=True)


def stepped(optimizers: Callable[[SirenTrunk], list[torch.optim.Optimizer]], steps: int = 3) -> SirenTrunk:
    """A trunk after a few steps along gradients of its own."""
    torch.manual_seed(0)
    trunk = SirenTrunk(width=16, depth=3)
    made = optimizers(trunk)
    for step in range(steps):
        for index, p in enumerate(trunk.parameters()):
            p.grad = torch.randn(p.shape, generator=torch.Generator().manual_seed(100 * step + index))
        for optimizer in made:
            optimizer.step()
    return trunk


@pytest.mark.parametrize("dtype", [torch.bfloat16, None], ids=str)
def test_muon_adam_is_torchs_muon_on_the_hidden_matrices_and_adam_on_the_rest(dtype: torch.dtype | None) -> None:
    """torch's takes bfloat16 on every machine: to its accuracy the steps are the same."""

    def ours(trunk: SirenTrunk) -> list[torch.optim.Optimizer]:
        optimizer = MuonAdam(parameter_groups(trunk, nn.Identity()), lr=1e-3, muon_lr=2e-3, momentum=0.9)
        optimizer.muon.dtype = dtype
        return [optimizer]

    def theirs(trunk: SirenTrunk) -> list[torch.optim.Optimizer]:
        hidden = [layer.linear.weight for layer in trunk.sine_layers[1:]]
        rest = [p for p in trunk.parameters() if not any(p is h for h in hidden)]
        return [torch.optim.Muon(hidden, lr=2e-3, weight_decay=0.0, momentum=0.9), Adam(rest, lr=1e-3)]

    start, found, expected = stepped(ours, 0), stepped(ours), stepped(theirs)
    for (name, a), b, before in zip(found.named_parameters(), expected.parameters(), start.parameters(), strict=True):
        if a.shape == (16, 16):
            assert (a - b).norm() < 0.05 * (b - before).norm(), name
            assert not torch.equal(a, before)
        else:
            assert torch.equal(a, b), name


def test_closure_is_called_once_and_its_loss_returned(small_field: BuildField) -> None:
    field, points = small_field("siren"), torch.rand(8, 3)
    optimizer = muon_of(field)
    losses: list[float] = []

    def closure() -> float:
        loss = field.trunk(points)[0].square().mean()
        loss.backward()
        losses.append(loss.item())
        return loss.item()

    with torch.no_grad():  # as Lightning steps: the closure turns gradients on by itself
        assert optimizer.step(closure) == losses[0]
    assert len(losses) == 1
    assert field.trunk(points)[0].square().mean().item() < losses[0]
