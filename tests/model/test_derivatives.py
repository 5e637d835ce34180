"""Derivatives against finite differences and against surfaces of known curvature."""

import math
from collections.abc import Callable

import pytest
import torch
from analytic import cylinder_distance, sphere_distance
from sine_networks import NETWORKS, network, plain, random_points, relative
from torch import Tensor

from jointsdf.model.derivatives import autograd_gradient, autograd_hessian, autograd_mixed, mixed_stencil, tangent_frame
from jointsdf.model.fused.evaluate import evaluate

Field = Callable[[Tensor], Tensor]


def frame_at(grad: Tensor, angles: Tensor) -> tuple[Tensor, Tensor]:
    return tangent_frame(torch.nn.functional.normalize(grad.detach(), dim=-1), angles)


def central(field: Field, points: Tensor, direction: Tensor, h: float = 2e-4) -> Tensor:
    """Fourth-order central difference along a direction per point; of each component where the field has several."""
    near = field(points + h * direction) - field(points - h * direction)
    far = field(points + 2 * h * direction) - field(points - 2 * h * direction)
    return (8 * near - far) / (12 * h)


@pytest.mark.parametrize("sizes", NETWORKS, ids=str)
def test_gradient_equals_finite_differences(sizes: tuple[int, int, float, float]) -> None:
    trunk, (points, _) = network(*sizes), random_points()

    def value(at: Tensor) -> Tensor:
        return plain(trunk, at)[0]

    with torch.no_grad():
        grad = evaluate(trunk.sine_layers, trunk.output, points, grad=True).grad
        differences = [central(value, points, axis.expand_as(points)) for axis in torch.eye(3, dtype=torch.float64)]
    assert relative(grad, torch.stack(differences, -1)) < 1e-6


NORMALS = torch.tensor(
    [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [1, 0, -0.0], [1e-9, -1e-9, -1], [1e-9, 1e-9, 1]],
    dtype=torch.float64,
)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_tangent_frame_is_orthonormal_everywhere(dtype: torch.dtype) -> None:
    random = torch.randn(2000, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    normals = torch.nn.functional.normalize(torch.cat([NORMALS, random]), dim=-1).to(dtype)
    angles = torch.linspace(0, 7, len(normals), dtype=dtype)
    u, v = tangent_frame(normals, angles)
    frames = torch.stack([u, v, normals], 1)
    tolerance = 20 * torch.finfo(dtype).eps
    torch.testing.assert_close(
        frames @ frames.transpose(1, 2), torch.eye(3, dtype=dtype).expand_as(frames), rtol=0, atol=tolerance
    )
    torch.testing.assert_close(torch.cross(u, v, dim=-1), normals, rtol=0, atol=tolerance)


def test_tangent_frame_turns_about_the_normal_by_the_angle() -> None:
    normals = torch.nn.functional.normalize(NORMALS, dim=-1)
    angles = torch.linspace(-3, 3, len(normals), dtype=torch.float64)
    u0, v0 = tangent_frame(normals, torch.zeros_like(angles))
    u, v = tangent_frame(normals, angles)
    torch.testing.assert_close(u, angles.cos()[:, None] * u0 + angles.sin()[:, None] * v0, rtol=0, atol=1e-15)
    torch.testing.assert_close(v, angles.cos()[:, None] * v0 - angles.sin()[:, None] * u0, rtol=0, atol=1e-15)


def sphere(points: Tensor) -> Tensor:
    return sphere_distance(points, 0.4)


def plane(points: Tensor) -> Tensor:
    """Planes as level sets; not linear, so that the Hessian is not zero everywhere."""
    return torch.sinh(points @ torch.tensor([0.6, 0.0, 0.8], dtype=points.dtype) - 0.1)


def cylinder(points: Tensor) -> Tensor:
    return cylinder_distance(points, 0.4)


@pytest.mark.parametrize("field", [sphere, plane])
def test_flat_and_umbilic_surfaces_give_zero_in_every_frame(field: Field) -> None:
    points, angles = random_points()
    points.requires_grad_()
    u, v = frame_at(autograd_gradient(field, points), angles)
    zeros = torch.zeros(len(points), dtype=torch.float64)
    torch.testing.assert_close(autograd_mixed(field, points, u, v), zeros, rtol=0, atol=1e-12)
    torch.testing.assert_close(mixed_stencil(field, points, u, v, 0.05), zeros, rtol=0, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 4, 1.2, math.pi / 2])
@pytest.mark.parametrize("radius", [0.2, 0.4, 0.9])
def test_cylinder_gives_sine_cosine_over_radius(angle: float, radius: float) -> None:
    turn = torch.linspace(0, 6, 20, dtype=torch.float64)
    outward = torch.stack([turn.cos(), turn.sin(), torch.zeros_like(turn)], -1)
    around = torch.stack([-turn.sin(), turn.cos(), torch.zeros_like(turn)], -1)
    along = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64).expand_as(outward)
    points = (radius * outward + 0.3 * along).requires_grad_()
    u = math.cos(angle) * along + math.sin(angle) * around
    v = math.cos(angle) * around - math.sin(angle) * along
    expected = torch.full_like(turn, math.sin(angle) * math.cos(angle) / radius)
    torch.testing.assert_close(autograd_mixed(cylinder, points, u, v), expected, rtol=0, atol=1e-12)
    torch.testing.assert_close(mixed_stencil(cylinder, points, u, v, 1e-3), expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("spacing", [0.05, 0.5])
def test_stencil_is_exact_for_cubics(spacing: float) -> None:
    generator = torch.Generator().manual_seed(0)
    cubic = torch.randn(3, 3, 3, dtype=torch.float64, generator=generator)
    square = torch.randn(3, 3, dtype=torch.float64, generator=generator)

    def polynomial(x: Tensor) -> Tensor:
        return torch.einsum("ijk,ni,nj,nk->n", cubic, x, x, x) + torch.einsum("ij,ni,nj->n", square, x, x) + x[:, 0] + 2

    points, _ = random_points()
    u, v = torch.randn(2, len(points), 3, dtype=torch.float64, generator=generator)
    orders = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
    expected = sum(torch.einsum("ijk,ni,nj,nk->n", cubic.permute(p), points, u, v) for p in orders)
    expected = expected + torch.einsum("ij,ni,nj->n", square + square.T, u, v)
    torch.testing.assert_close(mixed_stencil(polynomial, points, u, v, spacing), expected, rtol=0, atol=1e-10)


def test_hessian_of_a_quadratic_form_is_its_symmetric_matrix() -> None:
    generator = torch.Generator().manual_seed(0)
    matrix = torch.randn(3, 3, dtype=torch.float64, generator=generator)
    points, _ = random_points()
    found = autograd_hessian(lambda x: torch.einsum("ij,ni,nj->n", matrix, x, x), points.requires_grad_())
    torch.testing.assert_close(found, (matrix + matrix.T).expand_as(found), rtol=0, atol=1e-14)


@pytest.mark.parametrize("sizes", NETWORKS, ids=str)
def test_hessian_of_the_network_equals_finite_differences_of_its_gradient(sizes: tuple[int, int, float, float]) -> None:
    trunk, (points, _) = network(*sizes), random_points()

    def gradient(at: Tensor) -> Tensor:
        return evaluate(trunk.sine_layers, trunk.output, at, grad=True).grad

    with torch.no_grad():
        hessian = evaluate(trunk.sine_layers, trunk.output, points, hessian=True).hessian
        rows = [central(gradient, points, axis.expand_as(points)) for axis in torch.eye(3, dtype=torch.float64)]
    assert relative(hessian, torch.stack(rows, 1)) < 1e-6
    assert torch.equal(hessian, hessian.mT) or relative(hessian, hessian.mT) < 1e-14
