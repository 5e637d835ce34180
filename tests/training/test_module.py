"""The training step: only what counts is evaluated, the sum is the weighted sum, and bad numbers stop the run."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn.functional import normalize
from torch.optim import Adam, Optimizer

from jointsdf.errors import InputError
from jointsdf.losses import Mixed
from jointsdf.losses.cross_entropy import CrossEntropy
from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.losses.eikonal import Eikonal
from jointsdf.losses.schedule import Schedule
from jointsdf.losses.sign_agnostic import SignAgnostic
from jointsdf.losses.signed_distance import SignedDistance
from jointsdf.losses.weingarten import Weingarten
from jointsdf.model.field import JointField
from jointsdf.optimizers import MuonAdam
from jointsdf.training.module import JointSDFModule, NonFiniteLossError, merged_needs
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import Samples, Step

BuildField = Callable[..., JointField]
TERMS = {
    "dirichlet": Dirichlet(),
    "sign_agnostic": SignAgnostic(),
    "eikonal": Eikonal("abs", ["manifold", "shell"]),
    "weingarten": Weingarten(),
    "signed_distance": SignedDistance(),
    "cross_entropy": CrossEntropy(),
}
WEIGHTS = {
    "dirichlet": 7000.0,
    "sign_agnostic": 600.0,
    "eikonal": 50.0,
    "weingarten": 10.0,
    "signed_distance": 7000.0,
    "cross_entropy": 100.0,
}


class Constant:
    """A term of a given value that counts its calls."""

    needs: Mapping[str, frozenset[str | Mixed]] = {"manifold": frozenset({"sdf"})}

    def __init__(self, value: float) -> None:
        self.value, self.calls = value, 0

    def __call__(self, step: Step) -> Tensor:
        self.calls += 1
        return step.fields["manifold"].sdf.sum() * 0 + self.value


class Stepped(JointSDFModule):
    """The module at a step of our choice, logging into a dictionary."""

    at = 0
    logged: Mapping[str, float] = {}

    @property
    def global_step(self) -> int:
        return self.at

    def log_scalars(self, scalars: Mapping[str, Tensor]) -> None:
        self.logged = {**self.logged, **{name: value.item() for name, value in scalars.items()}}


def samples_of(count: int = 24, seed: int = 0) -> Samples:
    g = torch.Generator().manual_seed(seed)
    manifold, non_manifold, shell, pool = (torch.rand(4, count, 3, generator=g) * 2 - 1).unbind()
    labels, normals = torch.arange(count) % 4, normalize(manifold, dim=-1)
    angles = torch.rand(count, generator=g) * 6
    gradients = normalize(pool + 2, dim=-1)
    return Samples(
        manifold, labels, normals, non_manifold, shell, angles, pool, pool[:, 0] * 0.5, pool.flip(0), gradients
    )


def module_of(
    field: JointField,
    terms: Mapping[str, Callable[[Step], Tensor]] = TERMS,
    weights: Mapping[str, float] = WEIGHTS,
    schedules: Mapping[str, Schedule] | None = None,
    optimizer: Callable[..., Optimizer] = Adam,
    **options: float,
) -> Stepped:
    settings = FitSettings(**{"max_steps": 100, "seed": 0, **options})
    return Stepped(field, Objective(terms, weights, schedules or {}), optimizer, settings)


@pytest.mark.parametrize("head", ["relu", "siren", "hybrid", "deep_skip", "none"])
def test_step_is_the_weighted_sum_of_its_terms(small_field: BuildField, head: str) -> None:
    module = module_of(small_field(head).eval())
    samples = samples_of()
    if head == "none":
        samples = samples._replace(labels=torch.full((24,), -1))
    total = module.training_step(samples, 0)
    step = module.evaluate(samples, merged_needs(TERMS))
    expected = {name: term(step).item() for name, term in TERMS.items()}
    assert {name: module.logged[f"loss/{name}"] for name in TERMS} == expected
    assert total.item() == pytest.approx(sum(WEIGHTS[name] * value for name, value in expected.items()), rel=1e-5)
    assert module.logged["loss/total"] == total.item()
    total.backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in module.field.parameters())


def test_step_values_are_the_fields_own(small_field: BuildField) -> None:
    field = small_field("siren").eval()
    samples = samples_of()
    step = module_of(field).evaluate(samples, merged_needs(TERMS))
    for name, values in step.fields.items():
        points = getattr(samples, name).clone().requires_grad_()
        sdf, features = field.trunk(points)
        torch.testing.assert_close(values.sdf, sdf, rtol=0, atol=1e-5)
        if values.grad is not None:
            (grad,) = torch.autograd.grad(sdf.sum(), points, retain_graph=True)
            torch.testing.assert_close(values.grad, grad, rtol=1e-4, atol=1e-4)
        if values.logits is not None:
            torch.testing.assert_close(values.logits, field.head(features), rtol=0, atol=1e-4)
    present = {n: (v.grad is not None, v.mixed is not None, v.logits is not None) for n, v in step.fields.items()}
    assert present == {
        "manifold": (True, False, True),
        "non_manifold": (False, False, False),
        "shell": (True, True, False),
        "pool": (False, False, False),
    }


def test_point_sets_that_no_active_term_needs_are_not_evaluated(small_field: BuildField) -> None:
    module = module_of(small_field(), weights={**dict.fromkeys(WEIGHTS, 0.0), "sign_agnostic": 1.0})
    seen: list[str] = []
    module.evaluate = lambda samples, needs: (seen.extend(needs), JointSDFModule.evaluate(module, samples, needs))[1]
    module.training_step(samples_of(), 0)
    assert seen == ["non_manifold"]


def test_terms_of_weight_or_factor_zero_are_not_evaluated(small_field: BuildField) -> None:
    terms = {name: Constant(1.0) for name in ("on", "off", "faded")}
    fade = Schedule("linear", [[0.0, 1.0], [0.5, 0.0]])
    module = module_of(small_field(), terms, {"on": 2.0, "off": 0.0, "faded": 4.0}, {"faded": fade})
    totals = []
    for module.at in (0, 25, 50, 99):
        module.logged = {}
        totals.append(module.training_step(samples_of(), 0).item())
    assert totals == [6.0, 4.0, 2.0, 2.0]
    assert {name: term.calls for name, term in terms.items()} == {"on": 4, "off": 0, "faded": 2}
    assert set(module.logged) == {"loss/on", "loss/total"}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_term_that_is_not_finite_stops_the_run_by_its_name_and_step(small_field: BuildField, value: float) -> None:
    module = module_of(small_field(), {"good": Constant(1.0), "bad": Constant(value)}, {"good": 1.0, "bad": 1.0})
    module.at = 37
    with pytest.raises(NonFiniteLossError, match=rf"^loss term bad is {value} at step 37: [^\n]*$"):
        module.training_step(samples_of(), 0)


def test_a_broken_network_names_the_first_term(small_field: BuildField) -> None:
    field = small_field()
    with torch.no_grad():
        field.trunk.output.weight.fill_(math.nan)
    with pytest.raises(NonFiniteLossError, match="loss term dirichlet is nan at step 0"):
        module_of(field).training_step(samples_of(), 0)


@pytest.mark.parametrize("head", ["relu", "hybrid"])
def test_dropout_is_a_function_of_seed_and_step(small_field: BuildField, head: str) -> None:
    def loss(seed: int, at: int, disturb: int) -> float:
        module = module_of(small_field(head).train(), {"ce": CrossEntropy()}, {"ce": 1.0}, seed=seed)
        module.at = at
        torch.rand(disturb)
        return module.training_step(samples_of(), 0).item()

    assert loss(3, 5, 0) == loss(3, 5, 17)
    assert len({loss(3, 5, 0), loss(3, 6, 0), loss(4, 5, 0), loss(5, 3, 0)}) == 4


def test_rate_is_constant_by_default(small_field: BuildField) -> None:
    assert {module_of(small_field()).rate(step) for step in (0, 50, 99)} == {1.0}


@pytest.mark.parametrize("factor", [1.0, 0.25])
def test_a_factor_on_the_trunk_leaves_the_head_alone(small_field: BuildField, factor: float) -> None:
    optimizer = partial(MuonAdam, lr=1e-3, muon_lr=2e-3)
    found = module_of(small_field("siren"), optimizer=optimizer, trunk_rate=factor).configure_optimizers()
    rates = {group["name"]: group["lr"] for group in found["optimizer"].param_groups}
    assert rates == {"hidden": 2e-3 * factor, "trunk": 1e-3 * factor, "head": 1e-3}
    assert found["lr_scheduler"]["scheduler"].state_dict()["lr_lambdas"] == [None] * 3


def test_cosine_rate_falls_to_zero(small_field: BuildField) -> None:
    rate = module_of(small_field(), cosine=True).rate
    assert rate(0) == 1
    assert rate(25) == pytest.approx(0.5 * (1 + math.sqrt(0.5)))
    assert rate(50) == pytest.approx(0.5)
    assert rate(100) == rate(150) == pytest.approx(0, abs=1e-12)


def test_warmup_rises_linearly(small_field: BuildField) -> None:
    rate = module_of(small_field(), warmup=0.1).rate
    assert [rate(step) for step in range(10)] == pytest.approx([0.1 * (k + 1) for k in range(10)])
    assert rate(10) == rate(99) == 1
    both = module_of(small_field(), warmup=0.1, cosine=True).rate
    assert both(4) == pytest.approx(0.5 * 0.5 * (1 + math.cos(math.pi * 0.04)))


def test_optimizer_rates_follow_the_schedule_for_every_group(small_field: BuildField) -> None:
    build = partial(MuonAdam, lr=2e-4, muon_lr=1e-3)
    module = module_of(small_field(), optimizer=build, cosine=True, head_lr=5e-3)
    configured = module.configure_optimizers()
    optimizer, scheduler = configured["optimizer"], configured["lr_scheduler"]["scheduler"]
    for _ in range(50):
        optimizer.step()
        scheduler.step()
    assert configured["lr_scheduler"]["interval"] == "step"
    rates = {group["name"]: group["lr"] for group in optimizer.param_groups}
    assert rates == {name: pytest.approx(0.5 * lr) for name, lr in (("hidden", 1e-3), ("trunk", 2e-4), ("head", 5e-3))}


def test_clipping_treats_trunk_and_head_apart(small_field: BuildField) -> None:
    module = module_of(small_field(), clip=10.0)
    trunk, head = list(module.field.trunk.parameters()), list(module.field.head.parameters())
    for p in trunk:
        p.grad = torch.full_like(p, 100.0)
    for p in head:
        p.grad = torch.full_like(p, 1e-3)
    norm = math.sqrt(sum(p.numel() for p in trunk)) * 100
    module.configure_gradient_clipping(Adam(module.parameters()))
    assert torch.cat([p.grad.flatten() for p in trunk]).norm().item() == pytest.approx(10, rel=1e-4)
    assert all((p.grad == 1e-3).all() for p in head)
    assert module.logged["gradient_norm/trunk"] == pytest.approx(norm, rel=1e-4)


@pytest.mark.parametrize("part", ["trunk", "head"])
def test_a_gradient_that_is_not_finite_stops_the_run(small_field: BuildField, part: str) -> None:
    module = module_of(small_field())
    module.at = 12
    for p in module.field.parameters():
        p.grad = torch.zeros_like(p)
    next(getattr(module.field, part).parameters()).grad.fill_(math.inf)
    with pytest.raises(NonFiniteLossError, match=f"^gradient norm of the {part} is (inf|nan) at step 12: "):
        module.configure_gradient_clipping(Adam(module.parameters()))


def test_needs_are_merged_per_point_set() -> None:
    merged = merged_needs(
        {"d": Dirichlet(), "e": Eikonal("abs", ["manifold", "shell"]), "w": Weingarten(), "c": CrossEntropy()}
    )
    assert merged == {
        "manifold": frozenset({"sdf", "grad", "logits"}),
        "shell": frozenset({"grad", Mixed("exact", 0.05)}),
    }


def test_two_different_derivatives_on_one_set_are_refused() -> None:
    exact, stencil = Weingarten(), Weingarten(derivative="finite_difference", spacing=0.02)
    message = r"^loss\.terms\.a and loss\.terms\.b want different mixed derivatives on shell: [^\n]*$"
    with pytest.raises(InputError, match=message):
        merged_needs({"a": exact, "b": stencil})
    with pytest.raises(InputError, match="different mixed derivatives"):
        merged_needs({"a": replace(stencil, spacing=0.05), "b": stencil})
    assert merged_needs({"a": exact, "b": replace(exact, normalised=False)}) == exact.needs


def test_a_step_leaves_the_process_generator_as_it_is(small_field: BuildField) -> None:
    module = module_of(small_field("relu").train(), {"ce": CrossEntropy()}, {"ce": 1.0})
    before = torch.get_rng_state()
    module.training_step(samples_of(), 0)
    assert torch.equal(torch.get_rng_state(), before)


def test_a_step_without_labels_does_not_move_the_head(small_field: BuildField) -> None:
    module = module_of(small_field("siren"), {"ce": CrossEntropy()}, {"ce": 1.0})
    samples = samples_of()
    samples = samples._replace(labels=torch.from_numpy(np.full(24, -1)))
    module.training_step(samples, 0).backward()
    assert all((p.grad == 0).all() for p in module.field.head.parameters())
