"""The coarse grid of distances that stands for the field away from the surface."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy import ndarray
from scipy.interpolate import RegularGridInterpolator
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.model.far_grid import EXCESS, SLACK, FarGrid
from jointsdf.model.field import JointField
from jointsdf.values import BOX, UNMOVED

TRUNK = {"width": 16, "depth": 3, "tap": 2, "far": "grid", "far_resolution": 24}
HALF = np.array([0.4, 0.5, 0.8])


def ball(points: ndarray) -> ndarray:
    return np.linalg.norm(points, axis=1) - 0.5


def cuboid(points: ndarray) -> ndarray:
    q = np.abs(points) - HALF
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def plane(points: ndarray) -> ndarray:
    return points @ np.array([0.6, 0.0, -0.8]) + 0.1


def filled(distance: Callable[[ndarray], ndarray], resolution: int = 64) -> FarGrid:
    grid = FarGrid(resolution)
    grid.fill(distance)
    return grid


def anywhere(count: int = 4000, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).uniform(-BOX, BOX, (count, 3)))


def near(points: Tensor) -> Tensor:
    """A field that is no distance anywhere."""
    return torch.sin(5 * points).sum(dim=1) / 3


def test_a_linear_distance_is_itself_up_to_the_rim() -> None:
    grid, points = filled(plane), anywhere()
    corners = torch.tensor(np.stack(np.meshgrid(*[[-BOX, BOX]] * 3), -1).reshape(-1, 3))
    for at in (points, corners):
        values, slopes = grid.value_and_gradient(at)
        assert np.abs(values.numpy() - plane(at.numpy())).max() < 2 * float(grid.step)
        assert (slopes - torch.tensor([0.6, 0.0, -0.8], dtype=torch.float64)).abs().max() < 3e-3


@pytest.mark.parametrize("distance", [ball, cuboid])
def test_the_spline_interpolates_where_it_need_not_avoid_overshoot(distance: Callable[[ndarray], ndarray]) -> None:
    grid = filled(distance)
    axis = np.linspace(-BOX, BOX, 64)
    known = distance(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)).reshape((64,) * 3)
    oracle = RegularGridInterpolator((axis,) * 3, known, method="cubic")  # not-a-knot splines
    points = anywhere(300).numpy() * 0.8
    smooth = np.linalg.norm(points, axis=1) > 0.7 if distance is ball else cuboid(points) > 0.15
    errors = np.abs(grid(torch.from_numpy(points)).numpy() - oracle(points))[smooth]
    assert smooth.sum() > 50
    assert np.percentile(errors, 90) < 2e-4


def test_far_from_a_ball_it_is_the_distance_to_a_ten_thousandth() -> None:
    grid, points = filled(ball), anywhere()
    points = points[points.norm(dim=1) > 0.65]
    values, slopes = grid.value_and_gradient(points)
    assert (values - (points.norm(dim=1) - 0.5)).abs().max() < 2e-4
    assert ((slopes * points / points.norm(dim=1, keepdim=True)).sum(dim=1) - 1).abs().max() < 5e-3


@pytest.mark.parametrize("distance", [ball, cuboid])
def test_it_never_overshoots_the_distance(distance: Callable[[ndarray], ndarray]) -> None:
    grid, points = filled(distance, 32), anywhere(20000)
    values, known = grid(points).abs().numpy(), np.abs(distance(points.numpy()))
    far = values > grid.outer
    assert (values <= EXCESS * known + 2 * SLACK)[far].all()


def test_at_a_ridge_of_the_distance_it_stays_below_it() -> None:
    """Where an interpolating spline does not: within the middle of a cuboid, on a coarse grid."""
    grid = filled(lambda points: cuboid(points / 1.2) * 1.2, 16)
    points = anywhere(20000)
    known = -cuboid(points.numpy() / 1.2) * 1.2
    deep = known > grid.outer
    assert deep.sum() > 200
    assert (-grid(points).numpy() <= EXCESS * known + SLACK + 2 * float(grid.step))[deep].all()


def test_gradients_are_those_of_autograd_in_double_precision() -> None:
    grid, points = filled(cuboid, 24), anywhere().requires_grad_()
    values = grid(points)
    plain, slopes = grid.value_and_gradient(points.detach())
    torch.testing.assert_close(plain, values, rtol=0, atol=1e-12)
    torch.testing.assert_close(slopes, torch.autograd.grad(values.sum(), points)[0], rtol=0, atol=1e-11)


def test_the_blends_gradient_is_that_of_autograd() -> None:
    grid, points = filled(cuboid, 24), anywhere().requires_grad_()
    other = near(points)
    (other_slopes,) = torch.autograd.grad(other.sum(), points, retain_graph=True)
    blend = grid.blend(grid(points), other)
    (expected,) = torch.autograd.grad(blend.sum(), points)
    found = grid.blend_gradient(grid.value_and_gradient(points.detach()), (other.detach(), other_slopes))
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-11)
    mixed = (grid.share(grid(points)) > 0.01) & (grid.share(grid(points)) < 0.99)
    assert mixed.sum() > 100


def test_second_derivatives_have_no_jump_where_cells_meet_and_where_the_blend_begins_and_ends() -> None:
    grid = filled(ball, 24)

    def curvature(x: float) -> float:
        def field(at: Tensor) -> Tensor:
            points = torch.cat([at[None], torch.tensor([0.03, 0.02], dtype=torch.float64)])[None]
            return grid.blend(grid(points), near(points)).sum()

        return float(torch.autograd.functional.hessian(field, torch.tensor(x, dtype=torch.float64)))

    def value(x: float) -> float:
        return float(grid(torch.tensor([[x, 0.03, 0.02]], dtype=torch.float64)))

    at_inner, at_outer = (brent(lambda x, size=size: value(x) - size) for size in (grid.inner, grid.outer))
    for x in (at_inner, at_outer, -BOX + 18 * grid.cell, -BOX + 20 * grid.cell):
        below, above = curvature(x - 1e-7), curvature(x + 1e-7)
        assert abs(below - above) < 0.05  # a smoothstep that is only once differentiable jumps by hundreds


def brent(function: Callable[[float], float]) -> float:
    """Its zero between 0.5 and 1."""
    low, high = 0.5, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return low


@pytest.mark.parametrize("thickness", [1e-4, 0.02, 0.1])
def test_a_thin_plate_and_a_needle_are_left_to_the_network(thickness: float) -> None:
    """Wherever they lie between the grid points."""
    draws = np.random.default_rng(0)
    for _ in range(5):
        normal, place = draws.standard_normal(3), draws.uniform(-0.1, 0.1)
        normal /= np.linalg.norm(normal)
        along = draws.uniform(-0.7, 0.7, (500, 3))
        on_plate = along - (along @ normal - place)[:, None] * normal
        grid = filled(lambda x, n=normal, p=place: np.abs(x @ n - p) - thickness / 2, 48)
        assert (grid.share(grid(torch.from_numpy(on_plate + thickness / 2 * normal))) == 0).all()
        on_needle = draws.uniform(-0.7, 0.7, (500, 1)) * normal + place
        grid = filled(
            lambda x, n=normal, p=place: np.linalg.norm((x - p) - ((x - p) @ n)[:, None] * n, axis=1) - thickness / 2,
            48,
        )
        assert (grid.share(grid(torch.from_numpy(on_needle))) == 0).all() or thickness > 2 * grid.inner


def test_the_network_decides_where_no_distance_is_known() -> None:
    grid = filled(lambda points: np.where(points[:, 0] > 0, 0.0, ball(points)))
    points = anywhere()
    unknown, known = points[:, 0] > 0.1, (points[:, 0] < -0.15) & (points.norm(dim=1) > 0.65)
    blend, other = grid.blend(grid(points), near(points)), near(points)
    assert torch.equal(blend[unknown], other[unknown])
    assert (blend - (points.norm(dim=1) - 0.5))[known].abs().max() < 1e-3


def test_before_it_is_filled_the_field_is_the_networks() -> None:
    grid, points = FarGrid(16), anywhere()
    assert torch.equal(grid.blend(grid(points), near(points)), near(points))


@pytest.mark.parametrize("value", [7, 513])
def test_a_wrong_resolution_is_refused(value: int) -> None:
    with pytest.raises(InputError, match=rf"trunk\.far_resolution={value}"):
        JointField({**TRUNK, "far_resolution": value}, {"name": "none"}, np.arange(0), UNMOVED)


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(InputError, match=r"trunk\.far=tree: accepted are none, grid"):
        JointField({**TRUNK, "far": "tree"}, {"name": "none"}, np.arange(0), UNMOVED)


@pytest.fixture
def field() -> JointField:
    """An unfitted network, which is no distance, with the grid of a cuboid."""
    torch.manual_seed(0)
    made = JointField(TRUNK, {"name": "relu", "widths": [16, 8], "dropout": 0.0}, np.array([3, 8]), UNMOVED)
    torch.nn.init.normal_(made.trunk.output.weight, std=0.3)
    assert made.far is not None
    made.far.fill(cuboid)
    return made.eval()


def test_answers_do_not_depend_on_what_else_is_asked_for(field: JointField) -> None:
    points = anywhere(3000).float()
    alone, both = field.query(points, what="sdf"), field.query(points)
    slopes = field.query(points, what=("sdf", "gradient"))
    graph = field.query(points, differentiable=True)
    for other in (both, slopes, graph):
        torch.testing.assert_close(alone.sdf, other.sdf, rtol=0, atol=1e-5)
    for other in (both, graph):
        torch.testing.assert_close(slopes.gradient, other.gradient, rtol=1e-4, atol=2e-4)
    np.testing.assert_allclose(field.network_sdf(points.numpy()), alone.sdf, atol=1e-5)


def test_away_from_the_surface_the_field_is_the_distance(field: JointField) -> None:
    points = anywhere()
    known = cuboid(points.numpy())
    far = known > 2 * field.far.outer  # type: ignore[union-attr]
    assert np.abs(field.query(points.float()).sdf.numpy() - known)[far].max() < 0.01
    assert np.abs(field.trunk(points.float())[0].detach().numpy() - known)[far].max() > 0.3


def test_a_far_field_is_kept_in_the_fields_file(field: JointField, tmp_path: Path) -> None:
    field.save(tmp_path / "field.ckpt")
    again = JointField.load(tmp_path / "field.ckpt")
    points = anywhere(500).float()
    for one, other in zip(field.query(points), again.query(points), strict=True):
        assert torch.equal(one, other)
