"""Octree pruning: octants of blocks that cannot hold a zero, by bounds on slope and interpolation error.

The bound on the slope is a Lipschitz constant, as in Kalra and Barr, "Guaranteed Ray Intersections with Implicit
Surfaces" (1989), but estimated from samples of the field.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.extraction.blocks import (
    PendingBlocks,
    PrunedBlocks,
    coarse_index,
    extents,
    queue_octants,
    select,
)
from jointsdf.extraction.sparse_grid import CORNERS, Grid

SAFETY = 1.25  # factor from the largest slope or interpolation error observed to the bound on those not observed
ROUNDING = np.float32(1e-6)  # of the field's float32, network length units: least interpolation error to go by
NEIGHBOURHOOD = 3  # coarse blocks along an axis: a block and those beside it
OTHER_AXES = ((1, 2), (0, 2), (0, 1))
CORNERS_OF_OCTANTS = (CORNERS[:, None] + CORNERS) @ np.array([9, 3, 1])  # index into a block's 3^3 half-stride points
# Largest distance of a corner of the unit cube (second axis) to a point of its octant (first axis): by the number of
# axes along which corner and octant are apart.
REACH = np.sqrt(np.array([0.75, 1.5, 2.25, 3], dtype=np.float32))[np.abs(CORNERS[:, None] - CORNERS).sum(axis=-1)]


class Bounds(NamedTuple):
    """Bounds on the field in each coarse block; or the largest values observed there.

    Attributes:
        slope: Steepest slope, dimensionless.
        error_ratio: Largest interpolation error within a block, in units of the block's own `interpolation_error`.
    """

    slope: Float[ndarray, "b b b"]
    error_ratio: Float[ndarray, "b b b"]


def bounds_from_lattice(grid: Grid) -> Bounds:
    """First guess: the slopes between lattice points in each block and around it, at least the median block's."""
    lengths, blocks = np.diff(grid.lines) * grid.spacing, len(grid.lines) - 1
    rises = [np.diff(grid.lattice.astype(np.float64), axis=axis) for axis in range(3)]
    squared = [(rise / np.expand_dims(lengths, rest)) ** 2 for rise, rest in zip(rises, OTHER_AXES, strict=True)]
    slope = np.zeros((blocks,) * 3)
    for corner in CORNERS:  # of a block: its three edges there
        edges = np.zeros((blocks,) * 3)
        for axis, along in enumerate(squared):
            edges += along[
                tuple(slice(side, side + blocks) if i != axis else slice(None) for i, side in enumerate(corner))
            ]
        slope = np.maximum(slope, np.sqrt(edges))
    slope = SAFETY * np.maximum(maximum_filter(slope, size=NEIGHBOURHOOD), np.median(slope))
    return Bounds(slope, np.ones_like(slope))


def widen_bounds(bounds: Bounds, observed: Bounds) -> tuple[Bounds, Bool[ndarray, "b b b"]]:
    """Raise bounds to `SAFETY` times what exceeds them, in that coarse block and those beside it.

    Returns:
        The bounds, and a mark for each coarse block where they may have changed.
    """
    widened, broken = [], np.zeros(observed.slope.shape, dtype=bool)
    for bound, found in zip(bounds, observed, strict=True):
        broken |= found > bound
        raised = maximum_filter(np.where(found > bound, SAFETY * found, 0), size=NEIGHBOURHOOD)
        widened.append(np.maximum(bound, raised))
    return Bounds(*widened), maximum_filter(broken, size=NEIGHBOURHOOD)


def prune(grid: Grid, bounds: Bounds, pending: PendingBlocks, stride: int) -> tuple[PendingBlocks | None, PrunedBlocks]:
    """Test octants for a zero; evaluate the corners of those that may hold one, and activate them if they are cells.

    No zero is in an octant that a corner of its block rules out by the slope, or whose own corners, interpolated, are
    all farther from 0 than the interpolation error, and on one side.

    Returns:
        The octants that may hold a zero, as blocks of half the stride; None if they are cells; and the pruned ones.
    """
    blocks, interpolation_error, octants = pending
    values, coarse, half = grid.corner_values(blocks, stride), coarse_index(grid, blocks, stride), stride // 2
    allowed = (np.abs(values)[:, None] / REACH).max(axis=2) / np.float32(stride * grid.spacing)
    by_slope = allowed > bounds.slope[coarse][:, None]
    interpolated = _interpolate(values, np.minimum(half / extents(grid, blocks, stride), 1).astype(np.float32))
    least, most = _over_octants(np.minimum, interpolated), _over_octants(np.maximum, interpolated)
    largest_error = (bounds.error_ratio[coarse] * interpolation_error)[:, None]
    by_interpolation = ~by_slope & (np.maximum(least, -most) > largest_error)
    reached, outside = octants & ~(by_slope | by_interpolation), octants & (by_slope | by_interpolation)
    pruned = PrunedBlocks(blocks, interpolation_error, outside, outside & by_interpolation)
    pruned = select(pruned, outside.any(axis=1))
    halves = (2 * blocks[:, None] + CORNERS)[reached]
    points = np.minimum((halves[:, None] + CORNERS) * half, grid.last)
    found = grid.evaluate(points.reshape(-1, 3)).reshape(-1, len(CORNERS))
    if half == 1:
        grid.activate(halves)
        return None, pruned
    errors = np.abs(found - interpolated.reshape(-1, 27)[:, CORNERS_OF_OCTANTS][reached]).max(axis=1)
    return queue_octants(grid, halves, np.maximum(errors, ROUNDING), half), pruned


def _interpolate(values: Float[ndarray, "n 8"], middles: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3 3"]:
    """Trilinear interpolation of a block's corners at its 27 points, the middle ones at a fraction of each edge."""
    cube = values.reshape(-1, 2, 2, 2)
    for axis in range(3):
        low, high = cube.take(0, axis=axis + 1), cube.take(1, axis=axis + 1)
        cube = np.stack([low, low + (high - low) * middles[:, axis, None, None], high], axis=axis + 1)
    return cube


def _over_octants(extreme: np.ufunc, cube: Float[ndarray, "n 3 3 3"]) -> Float[ndarray, "n 8"]:
    """Least or largest value at each octant's corners."""
    cube = extreme(cube[:, :-1], cube[:, 1:])
    cube = extreme(cube[:, :, :-1], cube[:, :, 1:])
    return np.asarray(extreme(cube[..., :-1], cube[..., 1:]).reshape(-1, 8))
