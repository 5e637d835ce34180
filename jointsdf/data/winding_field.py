"""Winding number of an oriented point cloud on a grid: the Poisson equation, solved by FFT.

The winding number of a solid is its indicator, 1 inside and 0 outside; that of a cloud is the sum of the dipoles of its
points, their normals times their areas (Barill et al. 2018). Its gradient is the field of these dipoles, so that it
solves a Poisson equation (Kazhdan, Bolitho and Hoppe 2006), here on a periodic grid about the training box.
"""

from itertools import product

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy import fft
from scipy.ndimage import map_coordinates

from jointsdf.values import BOX

HALF = 1.15 * BOX  # half side of the grid: wider than the box, so that its periodic images are far
MOST_CELLS = 160  # along each axis
LEAST_CELLS = 32
CELL = 0.6  # width, in spacings of the points, where `MOST_CELLS` allow it
CORNERS = np.array(list(product((0, 1), repeat=3)))


class WindingField:
    """The winding number on a grid, as a function of the points' dipoles.

    Args:
        points: The cloud, network frame, inside the training box.
        spacing: Typical distance between neighbours, network length units.

    Attributes:
        cell: Width of a cell, and of the Gaussian that smooths the winding number, network length units.
    """

    def __init__(self, points: Float[ndarray, "n 3"], spacing: float) -> None:
        self._cells = int(np.clip(2 * HALF / (CELL * spacing), LEAST_CELLS, MOST_CELLS))
        self.cell = 2 * HALF / self._cells
        place = self._place(points)
        low = np.floor(place).astype(np.int64)
        beyond = place - low
        self._corners = [np.ravel_multi_index((low + corner).T, (self._cells,) * 3) for corner in CORNERS]
        self._shares = [np.where(corner, beyond, 1 - beyond).prod(axis=1) for corner in CORNERS]
        along, last = (2 * np.pi * waves(self._cells, self.cell) for waves in (fft.fftfreq, fft.rfftfreq))
        self._waves = [wave.astype(np.float32) for wave in (along[:, None, None], along[:, None], last)]
        squares = self._waves[0] ** 2 + self._waves[1] ** 2 + self._waves[2] ** 2
        smoothing = np.exp(-0.5 * self.cell**2 * squares)
        self._filter = smoothing / np.maximum(squares, np.finfo(np.float32).tiny)  # and the inverse of the Laplacian

    def solve(self, dipoles: Float[ndarray, "n 3"]) -> Float[ndarray, "c c c"]:
        """The winding number at the centres of the cells; its mean over the rim is 0.

        Args:
            dipoles: Outward normals times areas, of the points.
        """
        divergence = sum(
            wave * fft.rfftn(self._splat(dipoles[:, axis]), workers=-1) for axis, wave in enumerate(self._waves)
        )
        values = fft.irfftn(1j * divergence * self._filter, s=(self._cells,) * 3, workers=-1)
        return values - np.mean([values[0].mean(), values[:, 0].mean(), values[:, :, 0].mean()])

    def at(self, values: Float[ndarray, "c c c"], points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Values of `solve` at points of the box, trilinear between the centres of the cells."""
        return map_coordinates(values, self._place(points).T, order=1, mode="nearest")

    def centre(self, indices: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Points at indices of cells, as fractions."""
        return (indices + 0.5) * self.cell - HALF

    def _place(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Indices of cells at points, as fractions."""
        return (points + HALF) / self.cell - 0.5

    def _splat(self, weights: Float[ndarray, " n"]) -> Float[ndarray, "c c c"]:
        """Density of the points' weights, each shared out to the eight centres about it."""
        shares = zip(self._corners, self._shares, strict=True)
        total = sum(np.bincount(corner, share * weights, self._cells**3) for corner, share in shares)
        return (np.asarray(total) / self.cell**3).astype(np.float32).reshape((self._cells,) * 3)
