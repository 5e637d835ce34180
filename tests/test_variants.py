"""What every head, loss and optimizer must keep; found by their yaml files, so a new one is tested by existing."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from clouds import sampler_of
from exact_steps import box, cylinder, exact_step, plane, sphere
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from torch import nn
from torch.optim import Adam, Optimizer

from jointsdf.data.sampler import Counts
from jointsdf.losses.schedule import Schedule
from jointsdf.model.field import JointField
from jointsdf.model.heads import HEADS
from jointsdf.training.module import JointSDFModule, merged_needs
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import Samples, Shape, Step

CONF = Path(__file__).parents[1] / "conf"
POINT_SETS = {"manifold", "non_manifold", "shell", "pool", "far"}


def names(group: str) -> list[str]:
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


def config(*overrides: str) -> DictConfig:
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", [*overrides])


def head_knobs(name: str) -> dict[str, Any]:
    settings: Any = OmegaConf.to_container(config(f"head={name}").head, resolve=True)
    assert settings.pop("name") == name
    return settings


def build_head(name: str, classes: int = 5, inputs: int = 35, seed: int = 0) -> nn.Module:
    torch.manual_seed(seed)
    return HEADS[name](inputs, 0 if name == "none" else classes, **head_knobs(name))


def objective(name: str) -> dict[str, Any]:
    return instantiate(config(f"loss={name}").loss, _convert_="all")


@pytest.fixture
def samples(box_shape: Shape) -> Samples:
    counts = Counts(manifold=128, non_manifold=128, shell=128, pool=128, far=64, balanced=0.5)
    return sampler_of(box_shape, counts, pool_size=2000).draw(0)


def test_every_head_of_the_registry_has_its_yaml() -> None:
    assert set(names("head")) == set(HEADS)


@pytest.mark.parametrize("name", names("head"))
@pytest.mark.parametrize("classes", [1, 2, 40])
def test_head_gives_a_logit_per_point_and_class(name: str, classes: int) -> None:
    expected = 0 if name == "none" else classes
    assert build_head(name, classes)(torch.rand(7, 35)).shape == (7, expected)


@pytest.mark.parametrize("name", names("head"))
def test_head_has_finite_gradients_at_double_backward(name: str) -> None:
    head = build_head(name)
    features = torch.rand(9, 35, requires_grad=True)
    (slope,) = torch.autograd.grad(head(features).square().sum(), features, create_graph=True)
    assert slope.isfinite().all()
    parameters = list(head.parameters())
    if not parameters:
        return
    found = torch.autograd.grad(slope.square().sum(), parameters, allow_unused=True)
    assert all(g is None or g.isfinite().all() for g in found)
    assert any(g is not None and g.norm() > 0 for g in found)


@pytest.mark.parametrize("name", names("head"))
def test_head_is_deterministic_under_the_seed(name: str) -> None:
    features = torch.rand(9, 35)

    def answer(seed: int, draw: int) -> torch.Tensor:
        head = build_head(name, seed=seed).train()
        torch.manual_seed(draw)
        return head(features)

    assert torch.equal(answer(0, 1), answer(0, 1))
    assert name == "none" or not torch.equal(answer(0, 1), answer(1, 1))
    head = build_head(name).eval()
    assert torch.equal(head(features), head(features))


@pytest.mark.parametrize("name", names("head"))
def test_head_grows_by_one_row_of_its_classifier_per_class(name: str) -> None:
    count = {k: sum(p.numel() for p in build_head(name, k).parameters()) for k in (3, 4, 9)}
    row = 0 if name == "none" else head_knobs(name)["widths"][-1] + 1
    assert count[4] - count[3] == row
    assert count[9] - count[3] == 6 * row


@pytest.mark.parametrize("name", names("head"))
def test_head_starts_without_an_opinion(name: str) -> None:
    logits = build_head(name, 6).eval()(torch.rand(50, 35) * 2 - 1)
    assert name == "none" or (logits.softmax(-1) - 1 / 6).abs().max() < 0.1 / 6


@pytest.mark.parametrize("name", names("loss"))
def test_loss_names_its_terms_weights_and_schedules_alike(name: str) -> None:
    loss = objective(name)
    assert set(loss) == {"terms", "weights", "schedules"}
    assert loss["terms"].keys() == loss["weights"].keys()
    assert loss["schedules"].keys() <= loss["terms"].keys()
    assert all(isinstance(schedule, Schedule) for schedule in loss["schedules"].values())
    assert all(weight >= 0 for weight in loss["weights"].values())


@pytest.mark.parametrize("name", names("loss"))
def test_every_term_is_a_finite_scalar_not_below_zero(
    small_field: Callable[..., JointField], samples: Samples, name: str
) -> None:
    loss = objective(name)
    field = small_field("siren").eval()
    module = module_of(field, loss)
    for term_name, term in loss["terms"].items():
        assert term.needs.keys() <= POINT_SETS
        field.zero_grad()
        value = term(module.evaluate(samples, term.needs))  # what it says it needs is all it gets
        assert value.shape == (), term_name
        assert value.isfinite(), term_name
        assert value >= 0, term_name
        value.backward()
        found = [p.grad for p in field.parameters() if p.grad is not None]
        assert all(g.isfinite().all() for g in found), term_name
        assert any(g.norm() > 0 for g in found), term_name


@pytest.mark.parametrize("name", names("loss"))
def test_terms_do_not_depend_on_the_others(small_field: Callable[..., JointField], samples: Samples, name: str) -> None:
    loss = objective(name)
    module = module_of(small_field("siren").eval(), loss)
    together = module.evaluate(samples, merged_needs(loss["terms"]))
    for term in loss["terms"].values():
        torch.testing.assert_close(term(together), term(module.evaluate(samples, term.needs)), rtol=1e-5, atol=1e-7)


def exact_step_with_logits(distance: Callable[[torch.Tensor], torch.Tensor]) -> Step:
    """A step whose field is an exact distance and prefers no part."""
    step = exact_step(distance)
    manifold = step.fields["manifold"]
    logits = torch.zeros(len(manifold.sdf), 3, dtype=manifold.sdf.dtype)
    return replace(step, fields={**step.fields, "manifold": replace(manifold, logits=logits)})


@pytest.mark.parametrize("name", names("loss"))
def test_exactly_the_terms_that_say_so_are_zero_on_an_exact_distance(name: str) -> None:
    steps = [exact_step_with_logits(distance) for distance in (sphere, box, plane, cylinder)]
    for term_name, term in objective(name)["terms"].items():
        largest = max(term(step).item() for step in steps)
        assert getattr(term, "zero_on_exact_distance", False) == (largest < 1e-12), (term_name, largest)


def module_of(field: JointField, loss: Mapping[str, Any], optimizer: Callable[..., Optimizer] = Adam) -> JointSDFModule:
    return JointSDFModule(field, Objective(**loss), optimizer, FitSettings(1000))


@pytest.mark.parametrize("name", names("optimizer"))
def test_optimizer_lowers_the_loss_in_twenty_steps(
    small_field: Callable[..., JointField], box_shape: Shape, name: str
) -> None:
    counts = Counts(manifold=200, non_manifold=200, shell=200, pool=400)
    sampler = sampler_of(box_shape, counts, pool_size=4000)
    field = small_field("siren", width=64, normalisation=sampler.cloud.normalisation).eval()
    loss = objective("joint")
    module = module_of(field, loss, instantiate(config(f"optimizer={name}").optimizer))
    optimizer = module.configure_optimizers()["optimizer"]
    held_out = sampler.draw(1000)
    before = module.training_step(held_out, 0).item()
    for step in range(20):
        optimizer.zero_grad()
        module.training_step(sampler.draw(step), step).backward()
        module.configure_gradient_clipping(optimizer)
        optimizer.step()
    assert module.training_step(held_out, 0).item() < 0.99 * before
