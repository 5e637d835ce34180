"""Newton-Schulz iterations against the singular value decomposition, in float64."""

import numpy as np
import pytest
import torch
from numpy.polynomial import Polynomial

from jointsdf.errors import InputError
from jointsdf.optimizers import ITERATIONS, Muon, MuonAdam, orthogonalise
from jointsdf.training.matrix_products import Products

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


def test_products_name_their_precision() -> None:
    assert Products().dtype("backward") is None
    assert Products(backward="bfloat16").dtype("backward") is torch.bfloat16
    assert Products(backward="bfloat16").dtype("orthogonalisation") is None
