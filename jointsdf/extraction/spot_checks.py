"""Spot checks of pruned octants: one random grid point each, evaluated against the bounds that pruned them."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.extraction.blocks import (
    NO_CHANGES,
    Blocks,
    PrunedBlocks,
    SignChanges,
    batches,
    coarse_index,
    concatenate,
    extents,
    select,
)
from jointsdf.extraction.pruning import Bounds
from jointsdf.extraction.sparse_grid import CORNERS, Grid, Points

COARSE_SHARE, FINE_SHARE = 1 / 4, 1 / 32  # of the octants pruned in coarse and in finer blocks that are checked
BATCH = 1 << 14  # points checked at once


def spot_check(grid: Grid, pruned: dict[int, PrunedBlocks], rng: np.random.Generator) -> tuple[Bounds, SignChanges]:
    """Evaluate a random grid point in a share of the pruned octants.

    Args:
        grid: Of the field.
        pruned: By stride.
        rng: Chooses octants and points.

    Returns:
        The largest slope and interpolation error met in each coarse block, 0 where nothing was checked; and the points
        that are not on the side of a corner of their block, each (second) with that corner (first).
    """
    observed, changes = Bounds(*np.zeros((2, *[len(grid.lines) - 1] * 3))), [NO_CHANGES]
    for stride, table in pruned.items():
        share = COARSE_SHARE if stride == grid.stride else FINE_SHARE
        drawn = np.argwhere(table.octants & (rng.random(table.octants.shape) < share))
        for part in batches(len(drawn), BATCH):
            which, octant = drawn[part].T
            rows = select(table, which)
            inside = _draw_offsets(grid, rows.blocks, octant, stride, rng)
            changes.append(_observe(grid, rows, octant, inside, stride, observed))
    return observed, concatenate(changes)


def _draw_offsets(
    grid: Grid, blocks: Blocks, octant: Int[ndarray, " n"], stride: int, rng: np.random.Generator
) -> Points:
    """Offset of a random grid point of one octant of each block from the block's lowest corner, never a corner."""
    half = stride // 2
    inside = CORNERS[octant] * half + rng.integers(0, half, blocks.shape)
    inside[(inside == 0).all(axis=1)] = half
    return np.minimum(inside, extents(grid, blocks, stride))


def _observe(
    grid: Grid, rows: PrunedBlocks, octant: Int[ndarray, " n"], inside: Points, stride: int, observed: Bounds
) -> SignChanges:
    """Evaluate points at offsets inside blocks, raise `observed` to what they show, and return the sign changes."""
    lowest, ends, coarse = (
        rows.blocks * stride,
        extents(grid, rows.blocks, stride),
        coarse_index(grid, rows.blocks, stride),
    )
    points, corners = lowest + inside, lowest[:, None] + CORNERS * ends[:, None]
    values = grid.corner_values(rows.blocks, stride)
    # Points in coarse blocks are mostly far from the surface: not worth the memory of a brick.
    found = grid.sample(points) if stride == grid.stride else grid.evaluate(points)
    apart = grid.spacing * np.linalg.norm(corners - points[:, None], axis=2)
    rises = np.abs(values - found[:, None])
    slopes = np.divide(rises, apart, out=np.zeros_like(apart), where=apart > 0).max(axis=1)
    np.maximum.at(observed.slope, coarse, slopes)
    errors = np.abs(found - (_trilinear_weights(inside / ends) * values).sum(axis=1)) / rows.interpolation_error
    by_interpolation = rows.by_interpolation[np.arange(len(octant)), octant]
    np.maximum.at(observed.error_ratio, coarse, np.where(by_interpolation, errors, 0))
    opposite = (values > 0) != (found > 0)[:, None]
    some = opposite.any(axis=1)
    return SignChanges(corners[some, opposite[some].argmax(axis=1)], points[some])


def _trilinear_weights(fractions: Float[ndarray, "n 3"]) -> Float[ndarray, "n 8"]:
    """Weight of each corner of the unit cube in the trilinear interpolation at points of it."""
    return np.asarray(np.where(CORNERS, fractions[:, None], 1 - fractions[:, None]).prod(axis=-1))
