"""The refit of the last layer: at the minimum that independent solvers find, for every head, and nothing else moves."""

import signal
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch
from command_line import train
from run_folders import assert_same_weights, checkpoint, weights
from scipy.optimize import minimize
from steps import stop_at
from test_variants import head_knobs, names
from torch.nn.functional import cross_entropy

from jointsdf.model.field import JointField
from jointsdf.threads import large_pieces
from jointsdf.training import fit
from jointsdf.training.last_layer import Regression, below_last_layer, last_layer, refit_last_layer
from jointsdf.values import UNMOVED, LabelledPoints

PARTS = 4


def regression(penalty: float = 0.05, points: int = 400, width: int = 5, parts: int = PARTS) -> Regression:
    """Classes that overlap, features of very different scales, and a start that is not 0."""
    generator = torch.Generator().manual_seed(3)
    scales = torch.tensor([1.0, 10.0, 0.1, 3.0, 1.0])[:width]
    raw = torch.randn(points, width, generator=generator)
    chosen = (
        raw @ torch.randn(width, parts, generator=generator) + torch.randn(points, parts, generator=generator)
    ).argmax(1)
    features = torch.cat([raw * scales, torch.ones(points, 1)], 1)
    return Regression(features, chosen, 0.1 * torch.randn(parts, width + 1, generator=generator), penalty)


def loss_in_double(problem: Regression, matrix: torch.Tensor) -> torch.Tensor:
    """Its definition, by torch's own cross-entropy."""
    fit = cross_entropy(problem.features.double() @ matrix.T, problem.labels, reduction="sum")
    return (fit + problem.penalty / 2 * (matrix - problem.start.double()).square().sum()) / len(problem.features)


def newton(problem: Regression) -> torch.Tensor:
    """The minimum by Newton's method in a trust region, with autograd's gradient and Hessian in float64."""
    shape = problem.start.shape

    def value(flat: torch.Tensor) -> torch.Tensor:
        return loss_in_double(problem, flat.reshape(shape))

    def gradient(flat: np.ndarray) -> np.ndarray:
        point = torch.from_numpy(flat).requires_grad_()
        return torch.autograd.grad(value(point), point)[0].numpy()

    found = minimize(
        lambda flat: value(torch.from_numpy(flat)).item(),
        problem.start.double().numpy().ravel(),
        jac=gradient,
        hess=lambda flat: torch.autograd.functional.hessian(value, torch.from_numpy(flat)).numpy(),
        method="trust-exact",
        options={"gtol": 1e-11},
    )
    return torch.from_numpy(found.x).reshape(shape)


@pytest.mark.parametrize("penalty", [1e-3, 0.05, 30.0])
def test_the_solution_is_the_minimum_that_newtons_method_finds(penalty: float) -> None:
    problem = regression(penalty)
    found, exact = problem.solve(200).double().requires_grad_(), newton(problem)
    loss = loss_in_double(problem, found)
    (slope,) = torch.autograd.grad(loss, found)
    start = problem.start.double().requires_grad_()
    (first,) = torch.autograd.grad(loss_in_double(problem, start), start)
    assert slope.norm() < 3e-4 * first.norm()  # the products are of float32
    assert loss.item() == pytest.approx(loss_in_double(problem, exact).item(), rel=1e-6)
    scores, wanted = (problem.features.double() @ matrix.detach().T for matrix in (found, exact))
    torch.testing.assert_close(scores, wanted, atol=2e-2, rtol=2e-3)


def test_whitened_features_need_few_iterations() -> None:
    problem = regression()
    losses = [loss_in_double(problem, problem.solve(count).double()).item() for count in (0, 5, 15, 200)]
    assert losses == sorted(losses, reverse=True)
    assert losses[2] - losses[3] < 1e-3 * (losses[0] - losses[3])


def test_the_whitener_is_the_root_of_the_weighted_moments() -> None:
    problem = regression()
    rows = problem.features.double().numpy()
    scores = np.exp(rows @ problem.start.double().numpy().T)
    unsure = 1 - (scores / scores.sum(1, keepdims=True)).max(1)
    moments = (rows * unsure[:, None]).T @ rows + problem.penalty * np.eye(rows.shape[1])
    root = problem.whitener().numpy()
    np.testing.assert_allclose(root @ root.T, moments / len(rows), rtol=1e-5)
    np.testing.assert_array_equal(root, np.tril(root))


def test_a_strong_prior_keeps_the_layer() -> None:
    problem = regression(penalty=1e9)
    torch.testing.assert_close(problem.solve(20), problem.start, atol=1e-5, rtol=1e-5)


def field_with(head: str, parts: int = PARTS) -> JointField:
    torch.manual_seed(1)
    knobs = {"name": head, **head_knobs(head)}
    ids = np.arange(0 if head == "none" else parts) * 10
    return JointField({"width": 32, "depth": 3, "tap": 2}, knobs, ids, UNMOVED).eval()


def quarters(count: int, seed: int = 0) -> LabelledPoints:
    """Points of a square, whose quarters are the parts."""
    points = np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * [1, 1, 0]
    return LabelledPoints(points, (points[:, 0] > 0) + 2 * (points[:, 1] > 0))


def right(field: JointField, given: LabelledPoints) -> float:
    return float((field.network_part(given.points.astype(np.float32)) == 10 * given.labels).mean())


@pytest.mark.parametrize("head", [name for name in names("head") if name != "none"])
def test_the_refit_finds_the_parts_and_moves_the_last_layer_alone(head: str) -> None:
    field, other = field_with(head), quarters(1000, seed=5)
    before = deepcopy(field.state_dict())
    assert right(field, other) < 0.6
    refit_last_layer(field, quarters(3000), 40)
    assert right(field, other) > 0.9
    after = field.state_dict()
    moved = {name for name in before if not torch.equal(before[name], after[name])}
    layer = last_layer(field.head)
    assert {id(field.get_parameter(name)) for name in moved} == {id(layer.weight), id(layer.bias)}


@pytest.mark.parametrize("head", [name for name in names("head") if name != "none"])
def test_a_heads_logits_are_its_last_layer_of_what_is_below(head: str) -> None:
    field, points = field_with(head), quarters(600).points.astype(np.float32)
    below = below_last_layer(field, points)
    with torch.no_grad():
        logits = field.head(field.trunk(torch.from_numpy(points))[1])
        torch.testing.assert_close(last_layer(field.head)(below), logits, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize(
    ("head", "parts", "labels", "iterations"),
    [("none", 0, 0, 9), ("siren", 1, 0, 9), ("siren", 3, -1, 9), ("siren", 3, 1, 0)],
    ids=["no head", "one part", "no labels", "no iterations"],
)
def test_nothing_is_refitted_where_there_is_nothing_to_tell(
    head: str, parts: int, labels: int, iterations: int
) -> None:
    field = field_with(head, parts)
    before = deepcopy(field.state_dict())
    refit_last_layer(field, quarters(50)._replace(labels=np.full(50, labels)), iterations)
    assert_same_weights(before, field.state_dict())


@pytest.mark.parametrize(("turned", "moves"), [(False, True), (True, False)])
def test_the_judges_decide_and_are_not_learned_from(turned: bool, moves: bool) -> None:
    """Judges whose labels are those of the field from the start are against any change of these."""
    field, given, judges = field_with("siren"), quarters(3000), quarters(500, seed=3)
    before, expected = deepcopy(field.state_dict()), field_with("siren")
    refit_last_layer(expected, given, 40)
    labels = field.network_part(judges.points.astype(np.float32)) // 10 if turned else judges.labels
    both = [np.concatenate(column) for column in ((given.points, judges.points), (given.labels, labels))]
    refit_last_layer(field, LabelledPoints(*both, judges=500), 40)
    assert_same_weights(field.state_dict(), expected.state_dict() if moves else before)


def test_unlabelled_points_do_not_count() -> None:
    given, one, two = quarters(800), field_with("siren"), field_with("siren")
    hidden = np.arange(800) % 2 == 0
    refit_last_layer(one, given._replace(labels=np.where(hidden, -1, given.labels)), 9)
    refit_last_layer(two, LabelledPoints(given.points[~hidden], given.labels[~hidden]), 9)
    assert_same_weights(one.state_dict(), two.state_dict())


def test_any_number_of_threads_solves_to_the_same_bits() -> None:
    problem = replace(regression(points=10_000), penalty=0.01)
    before = torch.get_num_threads()
    try:
        found = []
        for threads in (1, 2):
            torch.set_num_threads(threads)
            with large_pieces():
                found.append(problem.solve(8))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(*found)


@pytest.mark.filterwarnings("default")
def test_a_stopped_run_is_refitted_as_one_that_was_not_stopped(tmp_path, monkeypatch) -> None:
    settings = ("head=deep_skip", "trainer.refit=6", "data.border_points=200", "data.part_points=100")
    calls: list[int] = []
    monkeypatch.setattr(fit, "refit_last_layer", lambda *given: calls.append(given[2]) or refit_last_layer(*given))
    assert train(tmp_path / "whole", *settings).code == 0
    with monkeypatch.context() as patch:
        stop_at(patch, 2, signal.SIGTERM)
        assert train(tmp_path / "stopped", *settings).code == 143
    assert checkpoint(tmp_path / "stopped")["global_step"] == 3
    assert train(tmp_path / "stopped", *settings).code == 0
    assert_same_weights(weights(tmp_path / "whole"), weights(tmp_path / "stopped"))
    assert calls == [6, 6], "one for each finished fit"
