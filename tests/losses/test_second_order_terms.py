"""Terms of the whole Hessian on surfaces of known curvature, and by hand."""

import math
import re

import pytest
import torch
from exact_steps import RADIUS, Field, cylinder, exact_step, onto, plane, sphere, step_of, uniform
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses.divergence import Divergence
from jointsdf.losses.gaussian_curvature import GaussianCurvature
from jointsdf.losses.singular_hessian import SingularHessian
from jointsdf.model.derivatives import autograd_gradient, autograd_hessian
from jointsdf.values import FieldValues, Step

UNLIMITED = Divergence(0.0, math.inf)
CURVATURE = [GaussianCurvature(normalised) for normalised in (True, False)]


def step_on(field: Field, steepness: float = 1.0) -> Step:
    """A step with all points on the zero level set of an exact distance; the field is so many times the distance."""

    def steep(at: Tensor) -> Tensor:
        return steepness * field(at)

    points = onto(field, uniform(60)).requires_grad_()
    values = FieldValues(steep(points), autograd_gradient(steep, points), hessian=autograd_hessian(steep, points))
    return step_of(shell=values, non_manifold=values)


@pytest.mark.parametrize(
    ("field", "laplacian", "gaussian"),
    [(sphere, 2 / RADIUS, 1 / RADIUS**2), (cylinder, 1 / RADIUS, 0.0), (plane, 0.0, 0.0)],
)
def test_values_on_surfaces_of_known_curvature(field: Field, laplacian: float, gaussian: float) -> None:
    step = step_on(field)
    assert UNLIMITED(step).item() == pytest.approx(laplacian, abs=1e-12)
    assert SingularHessian()(step).item() == pytest.approx(0, abs=1e-12)
    for term in CURVATURE:
        assert term(step).item() == pytest.approx(gaussian, abs=1e-12)


@pytest.mark.parametrize("steepness", [0.2, 3.0])
def test_gaussian_curvature_does_not_depend_on_steepness_and_the_released_form_does(steepness: float) -> None:
    true = 1 / RADIUS**2
    assert CURVATURE[0](step_on(sphere, steepness)).item() == pytest.approx(true, rel=1e-10)
    assert CURVATURE[1](step_on(sphere, steepness)).item() == pytest.approx(true * steepness**2, rel=1e-10)


def test_off_the_surface_the_curvature_is_that_of_the_level_set() -> None:
    step = exact_step(sphere)
    radii = step.fields["shell"].sdf + RADIUS
    assert CURVATURE[0](step).item() == pytest.approx((1 / radii**2).mean().item(), rel=1e-10)


def any_step(count: int = 30) -> Step:
    """Gradients and Hessians of any size."""
    generator = torch.Generator().manual_seed(0)
    grad = torch.randn(count, 3, dtype=torch.float64, generator=generator)
    half = torch.randn(count, 3, 3, dtype=torch.float64, generator=generator)
    values = FieldValues(torch.zeros(count), grad, hessian=(half + half.mT) * 5)
    return step_of(shell=values, non_manifold=values)


def test_determinants_equal_those_by_elimination() -> None:
    shell = any_step().fields["shell"]
    grad, hessian = shell.grad, shell.hessian
    assert SingularHessian()(any_step()).item() == pytest.approx(
        torch.linalg.det(hessian).abs().mean().item(), rel=1e-10
    )
    bordered = torch.zeros(len(grad), 4, 4, dtype=torch.float64)
    bordered[:, :3, :3], bordered[:, :3, 3], bordered[:, 3, :3] = hessian, grad, grad
    determinants = torch.linalg.det(bordered).abs()
    for term, power in zip(CURVATURE, (4, 2), strict=True):
        assert term(any_step()).item() == pytest.approx(
            (determinants / grad.norm(dim=1) ** power).mean().item(), rel=1e-10
        )


def test_divergence_is_limited_on_both_sides() -> None:
    traces = torch.tensor([0.0, -0.04, 0.5, -7.0, 60.0, -1e4], dtype=torch.float64)
    hessian = (traces[:, None, None] * torch.diag(torch.tensor([2.0, -3.0, 2.0]))).requires_grad_()
    step = step_of(non_manifold=FieldValues(traces, hessian=hessian))
    loss = Divergence()(step)
    assert loss.item() == pytest.approx((0.1 + 0.1 + 0.5 + 7 + 50 + 50) / 6, rel=1e-12)
    assert UNLIMITED(step).item() == pytest.approx(traces.abs().mean().item(), rel=1e-12)
    (slope,) = torch.autograd.grad(loss, hessian)
    pulls = torch.tensor([0.0, 0, 1, -1, 0, 0], dtype=torch.float64)
    torch.testing.assert_close(6 * slope, pulls[:, None, None] * torch.eye(3, dtype=torch.float64))


@pytest.mark.parametrize("term", [Divergence(), SingularHessian(), *CURVATURE], ids=str)
def test_a_flat_field_has_a_finite_gradient(term: Divergence | SingularHessian | GaussianCurvature) -> None:
    grad, hessian = torch.zeros(4, 3, requires_grad=True), torch.zeros(4, 3, 3, requires_grad=True)
    values = FieldValues(torch.zeros(4), grad, hessian=hessian)
    slopes = torch.autograd.grad(term(step_of(shell=values, non_manifold=values)), [grad, hessian], allow_unused=True)
    assert all(slope is None or slope.isfinite().all() for slope in slopes)


@pytest.mark.parametrize("limits", [(-0.1, 50.0), (1.0, 1.0), (5.0, 2.0), (math.nan, 1.0)])
def test_limits_without_sense_are_refused_in_one_line(limits: tuple[float, float]) -> None:
    named = f"loss.terms.divergence.low={limits[0]} high={limits[1]}"
    with pytest.raises(InputError, match=f"^{re.escape(named)}[^\\n]*$"):
        Divergence(*limits)
