"""The distance away from the surface: a cubic B-spline on a coarse grid, into which the network's field is blended.

A distance is smooth far from its surface but for the medial axis, so a coarse grid holds it well, while the network
keeps its capacity for the surface. Cubic B-splines (Unser, "Splines: A Perfect Fit for Signal and Image Processing",
1999) make the grid twice continuously differentiable, and so does the blend.
"""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.ndimage import spline_filter
from torch import Tensor, nn

from jointsdf.errors import require_integer
from jointsdf.values import BOX

INNER, OUTER = 0.85, 1.7  # distances, in cells, between which the network gives way to the grid
EXTENSION = 8  # grid points added on each side by odd reflection, so that the spline has no bend at the rim
EXCESS, SLACK = 1.02, 0.002  # a coefficient is at most EXCESS |d| + SLACK: ridges of the distance are not overshot
STEPS = 32767  # of the coefficients' 16 bits
TAPS = 4  # coefficients along each axis that a point depends on

# Signed distance at points of the network frame; 0 where it is not known.
Distance = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


class FarGrid(nn.Module):
    """Signed distance on a grid over the training box, and its blend with a field that is right near the surface.

    With g the grid's value, f the near field's, and s the quintic smoothstep from 0 to 1 for |g| between `inner` and
    `outer`, the whole field is f + s (g - f): f alone near the surface, g alone far away.

    Args:
        resolution: Grid points along each axis of the box.

    Attributes:
        coefficients: Of the spline, in whole `step`s; 0 before `fill`, when the blend is the near field everywhere.
        step: Network length units.
        inner: |g| up to which the field is the near one, network length units.
        outer: |g| from which it is the grid.

    Raises:
        InputError: A resolution out of range.
    """

    coefficients: Tensor
    step: Tensor

    def __init__(self, resolution: int) -> None:
        super().__init__()
        require_integer("trunk.far_resolution", resolution, 8, 512)
        self.resolution, self.cell = resolution, 2 * BOX / (resolution - 1)
        self.inner, self.outer = INNER * self.cell, OUTER * self.cell
        self.register_buffer("coefficients", torch.zeros((resolution + 2,) * 3, dtype=torch.int16))
        self.register_buffer("step", torch.tensor(1.0))

    def fill(self, distance: Distance) -> None:
        """Fit the spline to a distance at the grid points; the field takes the near one's values where that is 0.

        Args:
            distance: Is asked at all grid points, the outermost of them one cell outside the box.
        """
        axis = np.arange(-1, self.resolution + 1) * self.cell - BOX
        points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        values = distance(points).reshape((len(axis),) * 3)
        limits = EXCESS * np.abs(values) + SLACK
        extended = np.pad(values, EXTENSION, mode="reflect", reflect_type="odd")
        kept = (slice(EXTENSION, -EXTENSION),) * 3
        fitted = np.clip(spline_filter(extended, order=3, mode="mirror")[kept], -limits, limits)
        step = float(np.abs(fitted).max()) / STEPS or 1.0
        self.step = torch.tensor(step, dtype=torch.float32)
        self.coefficients = torch.from_numpy(np.rint(fitted / step).astype(np.int16))

    def forward(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        """The spline at points of the box, network frame; differentiable by the points."""
        known, shares = self._neighbourhoods(points)
        weights = _weights(shares)
        return _contract(known, weights[:, 0], weights[:, 1], weights[:, 2])

    def value_and_gradient(self, points: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """The spline and its gradient at points of the box, without a graph."""
        known, shares = self._neighbourhoods(points)
        (x, y, z), (dx, dy, dz) = _weights(shares).unbind(1), (_slopes(shares) / self.cell).unbind(1)
        along_z, slope_z = (known @ z[:, None, :, None]).squeeze(-1), (known @ dz[:, None, :, None]).squeeze(-1)
        plane, along_y, slope = (
            torch.einsum("nij,nj->ni", *pair) for pair in ((along_z, y), (along_z, dy), (slope_z, y))
        )
        gradient = torch.stack([(plane * dx).sum(-1), (along_y * x).sum(-1), (slope * x).sum(-1)], -1)
        return (plane * x).sum(-1), gradient

    def second_derivatives(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3 3"]:
        """Second derivatives of the spline at points of the box, without a graph."""
        known, shares = self._neighbourhoods(points)
        of_order = (_weights(shares), _slopes(shares) / self.cell, _bends(shares) / self.cell**2)
        hessian = points.new_zeros(len(points), 3, 3)
        for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            taps = [of_order[(axis == row) + (axis == column)][:, axis] for axis in range(3)]
            hessian[:, row, column] = hessian[:, column, row] = _contract(known, *taps)
        return hessian

    def share(self, values: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
        """Share of the grid in the blend, 0..1, by the grid's values."""
        x = self._way(values)
        return x**3 * (x * (6 * x - 15) + 10)

    def blend(self, values: Float[Tensor, " n"], near: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
        """The whole field, from the grid's values and the near field's at the same points."""
        return near + self.share(values) * (values - near)

    def blend_gradient(
        self,
        grid: tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]],
        near: tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]],
    ) -> Float[Tensor, "n 3"]:
        """Gradient of `blend`, from values and gradients of the grid and of the near field."""
        (values, slopes), (other, other_slopes) = grid, near
        x = self._way(values)
        growth = 30 * (x * (1 - x)) ** 2 / (self.outer - self.inner) * values.sign()
        along = self.share(values)[:, None]
        return other_slopes + along * (slopes - other_slopes) + (growth * (values - other))[:, None] * slopes

    def blend_second_derivatives(
        self,
        grid: tuple[Float[Tensor, " n"], Float[Tensor, "n 3"], Float[Tensor, "n 3 3"]],
        near: tuple[Float[Tensor, " n"], Float[Tensor, "n 3"], Float[Tensor, "n 3 3"]],
    ) -> Float[Tensor, "n 3 3"]:
        """Second derivatives of `blend`, from values, gradients and second derivatives of grid and near field."""
        (values, slopes, bends), (other, other_slopes, other_bends) = grid, near
        x, width = self._way(values), self.outer - self.inner
        growth = 30 * (x * (1 - x)) ** 2 / width * values.sign()
        change = 60 * x * (1 - x) * (1 - 2 * x) / width**2
        crossed = slopes[:, :, None] * (slopes - other_slopes)[:, None]
        along, difference = self.share(values)[:, None, None], (values - other)[:, None, None]
        blended = other_bends + along * (bends - other_bends) + growth[:, None, None] * (crossed + crossed.mT)
        squared = slopes[:, :, None] * slopes[:, None]
        return blended + difference * (growth[:, None, None] * bends + change[:, None, None] * squared)

    def _way(self, values: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
        """Way from `inner` to `outer`, 0..1, by the grid's values."""
        return ((values.abs() - self.inner) / (self.outer - self.inner)).clamp(0, 1)

    def _neighbourhoods(self, points: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 4 4 4"], Float[Tensor, "n 3"]]:
        """Coefficients about each point, and its place within its cell, 0..1 along each axis."""
        at = (points + BOX) / self.cell
        first = at.detach().floor().clamp(0, self.resolution - 2)
        size = self.resolution + 2
        x, y, z = (first.long()[..., None] + torch.arange(TAPS, device=points.device)).unbind(1)
        places: Int[Tensor, "n 4 4 4"] = ((x * size)[:, :, None] + y[:, None])[..., None] * size + z[:, None, None]
        return self.coefficients.reshape(-1)[places].to(points) * self.step.to(points), at - first


def _contract(
    known: Float[Tensor, "n 4 4 4"], x: Float[Tensor, "n 4"], y: Float[Tensor, "n 4"], z: Float[Tensor, "n 4"]
) -> Float[Tensor, " n"]:
    return torch.einsum("nijk,ni,nj,nk->n", known, x, y, z)


def _weights(shares: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3 4"]:
    """Uniform cubic B-splines of the four neighbours."""
    t, u = shares, 1 - shares
    return torch.stack([u**3, 3 * t**3 - 6 * t**2 + 4, 3 * u**3 - 6 * u**2 + 4, t**3], -1) / 6


def _slopes(shares: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3 4"]:
    """Their derivatives."""
    t, u = shares, 1 - shares
    return torch.stack([-(u**2), 3 * t**2 - 4 * t, 4 * u - 3 * u**2, t**2], -1) / 2


def _bends(shares: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3 4"]:
    """Their second derivatives."""
    t, u = shares, 1 - shares
    return torch.stack([u, 3 * t - 2, 3 * u - 2, t], -1)
