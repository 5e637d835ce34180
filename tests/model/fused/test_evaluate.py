"""The hand-written pass against plain autograd, for every order, head, objective and size of network."""

import itertools
from collections.abc import Callable
from pathlib import Path

import hydra
import pytest
import torch
from hydra import compose, initialize_config_dir
from sine_networks import NETWORKS, network, plain, random_points, relative
from torch import Tensor
from torch.nn.functional import normalize

from jointsdf import threads
from jointsdf.losses import Mixed, Needs
from jointsdf.model.derivatives import autograd_gradient, autograd_hessian, autograd_mixed, mixed_stencil, tangent_frame
from jointsdf.model.field import JointField
from jointsdf.model.fused.evaluate import Evaluation, evaluate
from jointsdf.model.trunk import SirenTrunk
from jointsdf.training.module import JointSDFModule, merged_needs
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import FieldValues, Samples, Step

CONF = str(Path(__file__).parents[3] / "conf")
WANTED = ["value", "grad", "mixed", "mixed and hessian"]
DERIVATIVES = ("exact", "finite_difference")
Sizes = tuple[int, int, float, float]


def oracle(trunk: SirenTrunk, points: Tensor, angles: Tensor, tap: int = 1) -> Evaluation:
    """Every output by double backward."""
    points = points.clone().requires_grad_()
    sdf, feature = plain(trunk, points, tap)
    grad = autograd_gradient(lambda at: plain(trunk, at)[0], points)
    u, v = tangent_frame(torch.nn.functional.normalize(grad.detach(), dim=-1), angles)
    mixed = autograd_mixed(lambda at: plain(trunk, at)[0], points, u, v)
    return Evaluation(sdf, feature, grad, mixed, autograd_hessian(lambda at: plain(trunk, at)[0], points))


def parameter_gradients(trunk: SirenTrunk, loss: Tensor) -> list[Tensor]:
    found = torch.autograd.grad(loss, list(trunk.parameters()), allow_unused=True)
    return [torch.zeros_like(p) if g is None else g for p, g in zip(trunk.parameters(), found, strict=True)]


@pytest.mark.parametrize("chunk", [7, 40])
@pytest.mark.parametrize("tap", [None, 1, "last"])
@pytest.mark.parametrize("wanted", WANTED)
@pytest.mark.parametrize("sizes", NETWORKS, ids=str)
def test_values_and_parameter_gradients_equal_double_backward(
    monkeypatch: pytest.MonkeyPatch, sizes: Sizes, wanted: str, tap: int | str | None, chunk: int
) -> None:
    monkeypatch.setattr(threads, "MAX_PIECE_POINTS", chunk)
    trunk, (points, angles) = network(*sizes), random_points()
    layer = sizes[1] if tap == "last" else tap
    expected = oracle(trunk, points, angles, layer or 1)
    found = evaluate(
        trunk.sine_layers,
        trunk.output,
        points,
        grad=wanted == "grad",
        angles=angles if "mixed" in wanted else None,
        hessian="hessian" in wanted,
        tap=layer,
    )
    given = [a is not None for a in found]
    assert given == [True, tap is not None, wanted != "value", "mixed" in wanted, "hessian" in wanted]
    generator = torch.Generator().manual_seed(0)
    losses = []
    for values in (found, expected):
        losses.append(torch.zeros((), dtype=torch.float64))
        for value, asked in zip(values, given, strict=True):
            if asked:
                factors = torch.randn(value.shape, dtype=torch.float64, generator=generator.manual_seed(value.ndim))
                losses[-1] = losses[-1] + (factors * value).sum() + value.abs().sum()
    for a, b, asked in zip(found, expected, given, strict=True):
        assert not asked or relative(a, b) < 1e-10
    pairs = zip(*(parameter_gradients(trunk, loss) for loss in losses), strict=True)
    assert all(relative(a, b) < 1e-10 for a, b in pairs)


@pytest.mark.parametrize("number", [2, 3])
def test_pieces_on_several_threads_give_the_same(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    monkeypatch.setattr(threads, "MIN_PIECE_POINTS", 5)
    trunk, (points, angles) = network(24, 4, 10.0, 30.0), random_points()
    results = []
    for count in (1, number):
        torch.set_num_threads(count)
        try:
            assert threads.pieces(points) == count
            found = evaluate(trunk.sine_layers, trunk.output, points, angles=angles, hessian=True, tap=2)
            losses = sum((value**2).sum() for value in found if value is not None)
            results.append([*found, *parameter_gradients(trunk, losses)])
        finally:
            torch.set_num_threads(1)
    for alone, together in zip(*results, strict=True):
        assert relative(together, alone) < 1e-12


@pytest.mark.parametrize("output", range(5), ids=Evaluation._fields)
def test_a_loss_of_one_output_alone_gets_its_gradient(output: int) -> None:
    """An output that no loss uses sends no adjoint back."""
    trunk, (points, angles) = network(24, 3, 10.0, 30.0), random_points()
    found = evaluate(trunk.sine_layers, trunk.output, points, angles=angles, hessian=True, tap=2)[output]
    expected = oracle(trunk, points, angles, tap=2)[output]
    pairs = list(zip(*(parameter_gradients(trunk, (v**2).sum()) for v in (found, expected)), strict=True))
    assert all(relative(a, b) < 1e-10 for a, b in pairs if b.norm() > 0)
    assert all(not a.any() for a, b in pairs if b.norm() == 0)


def oracle_step(module: JointSDFModule, samples: Samples, needs: Needs) -> Step:
    """`module.evaluate` by double backward: a pass per quantity, nothing shared."""
    fields, trunk = {}, module.field.trunk
    for name, wanted in needs.items():
        points = getattr(samples, name)
        angles = samples.angles[: len(points)]
        values = oracle(trunk, points, angles, trunk.tap)
        mixed = values.mixed
        if Mixed("finite_difference") in wanted:
            u, v = tangent_frame(torch.nn.functional.normalize(values.grad.detach(), dim=-1), angles)
            mixed = mixed_stencil(lambda at: plain(trunk, at)[0], points, u, v, 0.05)
        logits = module.field.head(torch.cat([values.feature, points], -1)) if "logits" in wanted else None
        fields[name] = FieldValues(values.sdf, values.grad, mixed, logits, values.hessian)
    return Step(fields, samples.labels, samples.normals, samples.pool_distances, samples.far_gradients)


def samples_of(dtype: torch.dtype, count: int = 24) -> Samples:
    g = torch.Generator().manual_seed(0)
    manifold, non_manifold, shell, pool = (torch.rand(4, count, 3, generator=g, dtype=dtype) * 2 - 1).unbind()
    angles = torch.rand(count, generator=g, dtype=dtype) * 6
    labels, normals = torch.arange(count) % 4, normalize(manifold, dim=-1)
    gradients = normalize(pool + 2, dim=-1)
    return Samples(
        manifold, labels, normals, non_manifold, shell, angles, pool, pool[:, 0] * 0.5, pool.flip(0), gradients
    )


def total(module: JointSDFModule, step: Step) -> Tensor:
    weights = module.objective.active_weights(0.0)
    return torch.stack([weight * module.objective.terms[name](step) for name, weight in weights.items()]).sum()


HEADS = ("relu", "siren", "hybrid", "deep_skip", "none")
OURS = [[loss, f"weingarten.derivative={way}"] for loss in ("paper", "flatcad", "joint", "mesh") for way in DERIVATIVES]
PUBLISHED = [
    *(["igr"], ["digs"], ["digs", "divergence.low=0.0", "divergence.high=1e9"], ["singular_hessian"]),
    *(["gaussian_curvature"], ["gaussian_curvature", "gaussian_curvature.normalised=true"]),
]


@pytest.mark.parametrize(
    ("loss", "head"),
    [*itertools.product(OURS, HEADS), *itertools.product(PUBLISHED, ["siren"])],
    ids=lambda given: given if isinstance(given, str) else " ".join(given),
)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32], ids=str)
def test_every_objective_and_head_has_the_oracles_gradients(
    small_field: Callable[..., JointField], dtype: torch.dtype, loss: list[str], head: str
) -> None:
    with initialize_config_dir(CONF, version_base=None):
        cfg = compose("config", [f"loss={loss[0]}", *(f"loss.terms.{setting}" for setting in loss[1:])])
    objective = hydra.utils.instantiate(cfg.loss, _convert_="all")
    weights = objective["weights"] | ({"cross_entropy": 0} if head == "none" else {})
    field = small_field(head).eval().to(dtype)
    torch.nn.init.uniform_(field.trunk.output.weight, -1, 1)
    module = JointSDFModule(
        field, Objective(objective["terms"], weights, objective["schedules"]), torch.optim.Adam, FitSettings(100)
    )
    samples = samples_of(dtype)
    needs = merged_needs({name: module.objective.terms[name] for name in module.objective.active_weights(0.0)})
    parameters = dict(field.named_parameters())
    gradients = [
        dict(zip(parameters, torch.autograd.grad(total(module, step), list(parameters.values())), strict=True))
        for step in (module.evaluate(samples, needs), oracle_step(module, samples, needs))
    ]
    for name in parameters:
        assert relative(gradients[0][name], gradients[1][name]) < (1e-10 if dtype == torch.float64 else 1e-4), name


def test_low_precision_touches_the_backward_pass_alone() -> None:
    trunk, (points, angles) = network(64, 4, 30.0, 30.0).float(), random_points(400)
    points, angles = points.float(), angles.float()
    runs = [
        evaluate(trunk.sine_layers, trunk.output, points, angles=angles, hessian=True, tap=2, backward_dtype=dtype)
        for dtype in (None, torch.bfloat16)
    ]
    for exact, low in zip(*runs, strict=True):
        assert torch.equal(exact, low)
    losses = [
        run.sdf.abs().sum() + run.grad.square().sum() + run.mixed.abs().sum() + 0.1 * run.hessian.abs().sum()
        for run in runs
    ]
    for exact, low in zip(*(parameter_gradients(trunk, loss) for loss in losses), strict=True):
        assert exact.dtype == low.dtype == torch.float32
        assert relative(low, exact) < 0.02
        if exact.ndim == 2 and exact.shape[0] == exact.shape[1]:
            assert relative(low, exact) > 2e-4, "rounded to bfloat16: float32 would be at 1e-7"


def test_stencil_in_the_network_converges_to_the_exact_derivative_at_second_order() -> None:
    trunk, (points, angles) = network(32, 3, 5.0, 30.0), random_points()
    exact = evaluate(trunk.sine_layers, trunk.output, points, angles=angles)
    u, v = tangent_frame(torch.nn.functional.normalize(exact.grad, dim=-1), angles)
    coarse, fine = (
        relative(mixed_stencil(lambda at: plain(trunk, at)[0], points, u, v, h), exact.mixed) for h in (2e-3, 1e-3)
    )
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4, rel=0.02)
