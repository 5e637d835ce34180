"""Closest points of analytic level sets, and of fields, also from outside the training box."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from analytic import box_distance, cylinder_distance, sphere_distance
from torch import Tensor

from jointsdf.model.closest import FOOT, find_closest
from jointsdf.model.derivatives import autograd_gradient, autograd_hessian
from jointsdf.model.field import JointField
from jointsdf.model.level_set import ClosestPoints, UnreachedWarning
from jointsdf.model.outside import extend, onto_box
from jointsdf.model.query import OutsideBoxWarning
from jointsdf.model.second_derivatives import Differential
from jointsdf.values import Normalisation

Sdf = Callable[[Tensor], Tensor]
HALF = torch.tensor([0.7, 0.5, 0.3], dtype=torch.float64)


def ellipsoid(points: Tensor) -> Tensor:
    """No distance: its gradient is up to three times too long or short."""
    return ((points / HALF).square().sum(dim=1) - 1) * 0.3


def first_of(sdf: Sdf) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
    """Value and gradient by autograd, outside the training box those of the bound."""

    def first(points: Tensor) -> tuple[Tensor, Tensor]:
        projected = onto_box(points)
        at = projected.detach().requires_grad_()
        with torch.enable_grad():
            grad = autograd_gradient(sdf, at).detach()
        found = extend(points, projected, sdf(projected), grad)
        assert found.grad is not None
        return found.sdf, found.grad

    return first


def second_of(sdf: Sdf) -> Callable[[Tensor], Differential]:
    def second(points: Tensor) -> Differential:
        at = points.detach().requires_grad_()
        with torch.enable_grad():
            return Differential(autograd_gradient(sdf, at).detach(), autograd_hessian(sdf, at).detach())

    return second


def around(reach: float, count: int = 400) -> Tensor:
    return torch.from_numpy(np.random.default_rng(0).uniform(-reach, reach, (count, 3)))


def on_sphere(points: Tensor) -> Tensor:
    return 0.6 * points / points.norm(dim=1, keepdim=True)


def on_cylinder(points: Tensor) -> Tensor:
    flat = points * torch.tensor([1.0, 1.0, 0.0], dtype=points.dtype)
    return 0.6 * flat / flat.norm(dim=1, keepdim=True) + (points - flat)


def on_box(points: Tensor) -> Tensor:
    """Outside the clamped point; inside the face that is nearest."""
    clamped = torch.minimum(torch.maximum(points, -HALF), HALF)
    inside = (clamped == points).all(dim=1)
    axis = (HALF - points.abs()).argmin(dim=1)
    rows = torch.arange(len(points))
    pushed = points.clone()
    pushed[rows, axis] = HALF[axis] * points[rows, axis].sign()
    return torch.where(inside[:, None], pushed, clamped)


@pytest.mark.parametrize(
    ("sdf", "exact", "reach"),
    [
        (lambda at: sphere_distance(at, 0.6), on_sphere, 1.0),
        (lambda at: sphere_distance(at, 0.6), on_sphere, 8.0),
        (lambda at: cylinder_distance(at, 0.6), on_cylinder, 1.0),
        (lambda at: box_distance(at, HALF.tolist()), on_box, 1.0),
    ],
    ids=["sphere", "sphere from afar", "cylinder", "box"],
)
def test_it_is_the_closest_point_of_an_analytic_shape(
    sdf: Sdf, exact: Callable[[Tensor], Tensor], reach: float
) -> None:
    points = around(reach)
    found = find_closest(points, first_of(sdf), second_of(sdf))
    assert found.reached.all()
    assert sdf(found.places).abs().max() < 1e-9
    apart = (found.places - exact(points)).norm(dim=1)
    assert (apart <= 1.01 * FOOT * (points - found.places).norm(dim=1) + 1e-9).all()


def test_of_a_field_that_is_no_distance_it_is_the_foot_point() -> None:
    """Outside an ellipsoid there is one foot point: none of a hundred thousand points of the surface is nearer."""
    points = around(1.0)
    points = points[ellipsoid(points) > 0.05]
    found = find_closest(points, first_of(ellipsoid), second_of(ellipsoid))
    assert found.reached.all()
    normals = first_of(ellipsoid)(found.places)[1]
    way = points - found.places
    cosine = (way * normals).sum(dim=1) / way.norm(dim=1) / normals.norm(dim=1)
    assert cosine.min() > np.cos(2 * FOOT)
    unit = torch.from_numpy(np.random.default_rng(1).standard_normal((100_000, 3)))
    surface = unit / unit.norm(dim=1, keepdim=True) * HALF
    nearest = torch.cdist(points, surface).min(dim=1).values
    assert (way.norm(dim=1) <= nearest * (1 + FOOT**2) + 1e-9).all()
    straight = find_closest(points, first_of(ellipsoid), lambda at: Differential(way_of(at, points), no_bend(at)))
    assert ((points - straight.places).norm(dim=1) > nearest + 1e-3).any()  # the gradient alone ends elsewhere


def way_of(places: Tensor, points: Tensor) -> Tensor:
    """Normals by which every place is a foot point already."""
    return points[: len(places)] - places


def no_bend(places: Tensor) -> Tensor:
    return places.new_zeros(len(places), 3, 3)


def test_the_middle_of_a_sphere_finds_its_surface_and_no_surface_is_named(small_field) -> None:
    sphere: Sdf = lambda at: sphere_distance(at, 0.6)  # noqa: E731
    found = find_closest(torch.zeros(1, 3, dtype=torch.float64), first_of(sphere), second_of(sphere))
    assert found.reached.tolist() == [True]
    assert found.places.norm(dim=1).tolist() == pytest.approx([0.6])
    field: JointField = small_field("siren").eval()
    torch.nn.init.constant_(field.trunk.output.bias, 9.0)
    with pytest.warns(UnreachedWarning, match="from 2 of 2 points no surface was reached, first from row 0"):
        answer = field.closest([[5.0, -3.0, 11.0], [6.0, -3.0, 11.0]])
    assert np.isnan(answer.point).all()
    assert np.isnan(answer.distance).all()


@pytest.mark.filterwarnings("ignore::jointsdf.model.query.OutsideBoxWarning")
@pytest.mark.filterwarnings("ignore::jointsdf.model.level_set.UnreachedWarning")
def test_closest_points_of_a_field_are_on_its_surface_in_file_units() -> None:
    frame = Normalisation(np.array([100.0, -20.0, 3.5]), 47.0)
    torch.manual_seed(0)
    field = JointField({"width": 16, "depth": 2, "tap": 1, "init": "sphere"}, {"name": "none"}, np.arange(0), frame)
    points = frame.inverse(around(1.6, 50).numpy())
    answer = field.eval().closest(points)
    reached = np.isfinite(answer.distance)  # this field has hollows away from its surface, where |f| is least
    assert reached.sum() > 45
    points, answer = points[reached], ClosestPoints(answer.point[reached], answer.distance[reached])
    assert np.abs(field.query(answer.point, what="sdf").sdf).max() < 47 * 2e-5
    np.testing.assert_allclose(np.linalg.norm(points - answer.point, axis=1), answer.distance, rtol=1e-5, atol=1e-3)
    slopes = field.query(answer.point, what="gradient").gradient.astype(np.float64)
    way = points - answer.point
    sine = np.linalg.norm(np.cross(way, slopes), axis=1) / np.linalg.norm(slopes, axis=1)
    assert (sine < 2 * FOOT * answer.distance + 47 * 2e-5).mean() > 0.9
    one = field.closest(points[0].tolist())
    assert one.point == pytest.approx(answer.point[0].tolist(), abs=1e-3)
    assert isinstance(one.distance, float)
    assert OutsideBoxWarning in field._said
