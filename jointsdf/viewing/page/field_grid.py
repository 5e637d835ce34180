"""A coarse grid of signed distances as bytes, from which a page draws the isolines of any axis-aligned plane."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.ndimage import map_coordinates

from jointsdf.values import BOX, Normalisation

Evaluate = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]

MARGIN = 0.1  # around the shape, of its longest side
LEVELS = 127  # of a byte on either side of 0
PROBES = 2048  # random points at which the grid's error is measured
NEAR = 0.05  # of the longest side: how near to the surface that error counts


@dataclass(frozen=True)
class FieldGrid:
    """Signed distances on a grid, file frame and units; each is `largest * s * |s|` with `s = (byte - 128) / 127`.

    Attributes:
        values: Bytes, z slowest.
        low: First grid point.
        high: Last grid point.
        largest: Magnitude of the bytes 1 and 255.
        near_p99: 99th percentile of the error of trilinear interpolation within `NEAR` of the surface.
    """

    values: UInt8[ndarray, "n n n"]
    low: Float[ndarray, "3"]
    high: Float[ndarray, "3"]
    largest: float
    near_p99: float

    @property
    def decoded(self) -> Float[ndarray, "n n n"]:
        """The values that the bytes stand for."""
        share = (self.values.astype(np.float64) - (LEVELS + 1)) / LEVELS
        return self.largest * share * np.abs(share)


def sample_grid(
    evaluate: Evaluate, frame: Normalisation, low: Float[ndarray, "3"], high: Float[ndarray, "3"], count: int
) -> FieldGrid:
    """Evaluate signed distances on a grid around a box, and measure what interpolation in its bytes costs.

    Args:
        evaluate: Signed distance at points of the file frame, file units.
        frame: File frame -> network frame, whose training box the grid stays in.
        low: Lower corner of the box, file frame.
        high: Its upper corner.
        count: Grid points along each axis.
    """
    size = float((high - low).max())
    box = frame.inverse(np.array([[-BOX] * 3, [BOX] * 3]))
    low, high = np.maximum(low - MARGIN * size, box[0]), np.minimum(high + MARGIN * size, box[1])
    ticks = np.linspace(0, 1, count)
    z, y, x = np.meshgrid(ticks, ticks, ticks, indexing="ij")
    exact = evaluate(low + np.stack([x, y, z], axis=-1).reshape(-1, 3) * (high - low)).reshape(count, count, count)
    largest = float(np.abs(exact).max()) or 1.0
    roots = np.sign(exact) * np.sqrt(np.abs(exact) / largest)
    grid = FieldGrid((np.rint(roots * LEVELS) + LEVELS + 1).astype(np.uint8), low, high, largest, float("nan"))
    probes = np.random.default_rng(0).random((PROBES, 3))
    values = evaluate(low + probes * (high - low))
    found = map_coordinates(grid.decoded, probes[:, ::-1].T * (count - 1), order=1)
    near = np.abs(values) <= NEAR * size
    return replace(grid, near_p99=float(np.quantile(np.abs(found - values)[near], 0.99))) if near.any() else grid
