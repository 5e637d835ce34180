"""Second derivatives of the whole field against autograd, and curvatures of analytic level sets."""

import numpy as np
import pytest
import torch
from analytic import box_distance, cylinder_distance, sphere_distance, torus_distance
from torch import Tensor

from jointsdf.model.derivatives import autograd_gradient, autograd_hessian
from jointsdf.model.field import JointField
from jointsdf.model.second_derivatives import Differential, second_derivatives, shape_operator
from jointsdf.values import BOX, Normalisation

FRAME = Normalisation(np.array([100.0, -20.0, 3.5]), 47.0)


def around(count: int = 300) -> Tensor:
    return torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (count, 3)))


def by_autograd(sdf, points: Tensor) -> Differential:
    at = points.detach().requires_grad_()
    return Differential(autograd_gradient(sdf, at).detach(), autograd_hessian(sdf, at).detach())


def principal(sdf, points: Tensor) -> np.ndarray:
    return shape_operator(by_autograd(sdf, points)).principal.numpy()


def test_curvatures_of_analytic_shapes() -> None:
    points = around()
    radius, across = points.norm(dim=1).numpy(), points[:, :2].norm(dim=1).numpy()
    ones = np.ones(2)
    np.testing.assert_allclose(principal(lambda at: sphere_distance(at, 0.5), points), 1 / radius[:, None] * ones)
    expected = np.stack([1 / across, 0 * across], axis=1)
    np.testing.assert_allclose(principal(lambda at: cylinder_distance(at, 0.5), points), expected, atol=1e-12)
    inside = points / 4
    np.testing.assert_allclose(principal(lambda at: box_distance(at, (0.9, 0.7, 0.5)), inside), 0, atol=1e-12)
    # whatever the length of the gradient, and with the other sign where the outside is within
    np.testing.assert_allclose(principal(lambda at: at.square().sum(1), points), 1 / radius[:, None] * ones)
    np.testing.assert_allclose(principal(lambda at: 0.5 - at.norm(dim=1), points), -1 / radius[:, None] * ones)


def test_the_larger_curvature_is_first_also_on_the_inner_side_of_a_torus() -> None:
    ring, tube = 0.6, 0.2
    angle = torch.linspace(0, 6, 50, dtype=torch.float64)
    across = ring + tube * angle.cos()
    points = torch.stack([across * np.cos(0.3), across * np.sin(0.3), tube * angle.sin()], 1)

    def torus(at: Tensor) -> Tensor:
        return torch.hypot(torch.hypot(at[:, 0], at[:, 1]) - ring, at[:, 2]) - tube

    assert np.abs(torus_distance(points.numpy(), ring, tube)).max() < 1e-12
    found = principal(torus, points)
    np.testing.assert_allclose(found[:, 0], 1 / tube)
    np.testing.assert_allclose(found[:, 1], (angle.cos() / across).numpy(), atol=1e-12)
    assert found[:, 1].min() < 0


@pytest.mark.parametrize("far", ["none", "grid"])
def test_second_derivatives_of_the_whole_field_are_those_of_autograd(far: str) -> None:
    torch.manual_seed(0)
    trunk = {"width": 16, "depth": 3, "tap": 1, "omega": 4.0, "hidden_omega": 4.0, "far": far, "far_resolution": 16}
    field = JointField(trunk, {"name": "none"}, np.arange(0), FRAME).double().eval()
    torch.nn.init.uniform_(field.trunk.output.weight, -0.3, 0.3)
    if field.far is not None:
        field.far.fill(lambda points: np.linalg.norm(points, axis=1) - 0.5)
        field.far.step = field.far.step.double()
        shares = field.far.share(field.far(around()))
        assert ((shares > 0) & (shares < 1)).sum() > 30
        assert (shares == 1).sum() > 30

    def whole(points: Tensor) -> Tensor:
        near = field.trunk(points)[0]
        return near if field.far is None else field.far.blend(field.far(points), near)

    found, expected = second_derivatives(field.trunk, field.far, around()), by_autograd(whole, around())
    torch.testing.assert_close(found.grad, expected.grad)
    torch.testing.assert_close(found.hessian, expected.hessian, rtol=1e-9, atol=1e-9)


def test_curvatures_of_a_field_are_in_file_units_and_unknown_outside_the_box() -> None:
    torch.manual_seed(0)
    field = JointField({"width": 16, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), FRAME).double().eval()
    points = FRAME.inverse(np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 1.05 * BOX]]))
    with pytest.warns(UserWarning, match="outside the training box"):
        found = field.curvatures(points)
    assert np.isnan(found.principal[1]).all()
    expected = principal(lambda at: field.trunk((at - field.centre) / field.scale)[0], torch.from_numpy(points[:1]))
    np.testing.assert_allclose(found.principal[:1], expected, rtol=1e-9)
    assert found.mean[0] == pytest.approx(expected.mean())
    assert found.gaussian[0] == pytest.approx(expected.prod())
    assert field.curvatures(points[0].tolist()).mean == pytest.approx(expected.mean())
