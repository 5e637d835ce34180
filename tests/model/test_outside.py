"""The field outside the training box: a lower bound of the distance, with its gradient."""

import numpy as np
import pytest
import torch
from torch import Tensor

from jointsdf.model.field import JointField
from jointsdf.model.outside import extend, onto_box, outside_box
from jointsdf.model.query import OutsideBoxWarning
from jointsdf.values import BOX, UNMOVED

HALF = torch.tensor([0.3, 0.5, 0.9], dtype=torch.float64)  # of a cuboid within the box


def cuboid(points: Tensor) -> Tensor:
    """Signed distance to the cuboid."""
    q = points.abs() - HALF
    return q.clamp(min=0).norm(dim=1) + q.max(dim=1).values.clamp(max=0)


def extended(points: Tensor) -> tuple[Tensor, Tensor]:
    """Its extension, and the extension's gradient by the formula."""
    points = points.detach().requires_grad_()
    projected = onto_box(points)
    at = projected.detach().requires_grad_()
    grad = torch.autograd.grad(cuboid(at).sum(), at)[0]
    sdf, grad = extend(points, projected, cuboid(projected), grad)
    assert grad is not None
    return sdf, grad


def around(count: int = 2000, reach: float = 4.0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(0).uniform(-reach, reach, (count, 3)))


def test_the_bound_holds_and_is_most_of_the_distance() -> None:
    points = around()
    bound, _ = extended(points)
    known, outside = cuboid(points), outside_box(points)
    assert outside.sum() > 1000
    assert (bound <= known + 1e-12).all()
    assert (bound / known)[outside].min() > 0.7
    assert (bound / known)[outside].median() > 0.75
    torch.testing.assert_close(bound[~outside], known[~outside], rtol=0, atol=0)


def test_the_bound_is_exact_straight_out_of_a_face() -> None:
    points = torch.tensor([[0.2, 0.4, 3.0], [-7.0, 0.1, 0.0]], dtype=torch.float64)
    bound, grad = extended(points)
    expected = [((3.0 - BOX) ** 2 + (BOX - 0.9) ** 2) ** 0.5, ((7.0 - BOX) ** 2 + (BOX - 0.3) ** 2) ** 0.5]
    assert bound.tolist() == pytest.approx(expected)
    assert grad[0, :2].tolist() == [0, 0]


def test_its_gradient_is_that_of_autograd_and_leads_to_the_shape() -> None:
    points = around().requires_grad_()
    projected = onto_box(points)
    by_graph = torch.autograd.grad(extend(points, projected, cuboid(projected), None).sdf.sum(), points)[0]
    bound, grad = extended(points)
    torch.testing.assert_close(grad, by_graph)
    assert (grad.norm(dim=1) <= 1 + 1e-12).all()
    outside = outside_box(points)
    stepped = cuboid(points - bound[:, None] * grad)
    assert (stepped < cuboid(points))[outside].all()


def test_it_is_continuous_at_the_box() -> None:
    face = torch.from_numpy(np.random.default_rng(1).uniform(-BOX, BOX, (500, 3)))
    face[:, 1] = BOX
    outward = torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64)
    within, beyond = extended(face - 1e-5 * outward)[0], extended(face + 1e-5 * outward)[0]
    assert outside_box(face + 1e-5 * outward).all()
    torch.testing.assert_close(within, beyond, rtol=0, atol=2e-5)


@pytest.mark.filterwarnings("ignore::jointsdf.model.query.OutsideBoxWarning")
def test_queries_agree_in_every_way_and_far_away() -> None:
    torch.manual_seed(0)
    field = JointField({"width": 16, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), UNMOVED).eval()
    points = around(200).float()
    both, alone = field.query(points, what=("sdf", "gradient")), field.query(points, what="sdf")
    torch.testing.assert_close(both.sdf, alone.sdf, rtol=1e-5, atol=1e-5)
    with_graph = field.query(points.requires_grad_(), what=("sdf", "gradient"), differentiable=True)
    torch.testing.assert_close(with_graph.gradient, both.gradient, rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(
        torch.autograd.grad(with_graph.sdf.sum(), points, create_graph=True)[0], both.gradient, rtol=1e-4, atol=1e-4
    )
    assert torch.isfinite(torch.autograd.grad(with_graph.gradient.square().sum(), points)[0]).all()
    far = field.query(np.array([[1e6, 0.0, 0.0], [0.0, -1e6, 1e6]]), what=("sdf", "gradient"))
    np.testing.assert_allclose(far.sdf, [1e6, 2**0.5 * 1e6], rtol=1e-5)
    np.testing.assert_allclose(far.gradient, [[1, 0, 0], [0, -(0.5**0.5), 0.5**0.5]], atol=1e-5)


def test_the_warning_says_what_the_values_are() -> None:
    field = JointField({"width": 8, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), UNMOVED).eval()
    with pytest.warns(OutsideBoxWarning, match="their distances are lower bounds, their parts -1"):
        field.query([[0.0, 0.0, 2.0]], what="sdf")
