"""Continuation: from cells and sign changes on the surface to all cells of the components that they are on.

As in Bloomenthal, "Polygonization of Implicit Surfaces" (1988), but block by block.
"""

from itertools import product

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from jointsdf.extraction.blocks import SignChanges, batches
from jointsdf.extraction.sparse_grid import CORNERS, NO_POINTS, Grid, Points

SIDE = 4  # cells along an edge of the blocks that are activated where the surface leaves the active cells
BATCH = 1 << 17  # cells, or points, handled at once


def lattice_sign_changes(grid: Grid) -> SignChanges:
    """The edges of the coarse lattice whose ends lie on opposite sides of the surface."""
    outside, lows, highs = grid.lattice > 0, [NO_POINTS], [NO_POINTS]
    for axis, step in enumerate(np.eye(3, dtype=np.int64)):
        edges = np.argwhere(np.diff(outside, axis=axis))
        lows.append(grid.lines[edges])
        highs.append(grid.lines[edges + step])
    return SignChanges(np.concatenate(lows), np.concatenate(highs))


def bisect_sign_changes(grid: Grid, changes: SignChanges) -> None:
    """Activate a cell on the surface between the points of each pair, by bisection."""
    first, second = changes
    outside = grid.evaluate(first) > 0
    while len(first):
        close = np.abs(first - second).max(axis=1) <= 1
        cells = np.minimum(np.minimum(first, second)[close], grid.last - 1)
        grid.evaluate((cells[:, None] + CORNERS).reshape(-1, 3))
        grid.activate(cells)
        first, second, outside = first[~close], second[~close], outside[~close]
        middles = (first + second) // 2
        alike = ((grid.evaluate(middles) > 0) == outside)[:, None]
        first, second = np.where(alike, middles, first), np.where(alike, second, middles)


def track_surface(grid: Grid) -> None:
    """Activate the block of `SIDE`^3 cells around every cell that the surface enters, until it leaves none."""
    points, inside = (np.indices((SIDE + more,) * 3).reshape(3, -1).T for more in (1, 0))
    cells = grid.active_cells()
    while len(cells):
        entered = [_find_entered_blocks(grid, cells[part]) for part in batches(len(cells), BATCH)]
        blocks, added = np.unique(np.concatenate(entered), axis=0), [NO_POINTS]
        for part in batches(len(blocks), BATCH // len(points)):
            lowest = SIDE * blocks[part][:, None]
            grid.evaluate(np.minimum(lowest + points, grid.last).reshape(-1, 3))
            around = (lowest + inside).reshape(-1, 3)
            around = around[(around < grid.last).all(axis=1)]
            added.append(around[~grid.is_active(around)])
            grid.activate(added[-1])
        cells = np.concatenate(added)


def _find_entered_blocks(grid: Grid, cells: Points) -> Points:
    """Blocks of the inactive cells beyond those faces of the given cells that the surface cuts, with repeats."""
    values = grid.corner_values(cells, 1)
    cut = straddles_zero(values)
    cells, values = cells[cut], values[cut]
    blocks = [NO_POINTS]
    for axis, side in product(range(3), (0, 1)):
        cut = straddles_zero(values[:, CORNERS[:, axis] == side])
        across = cells[cut] + (2 * side - 1) * np.eye(3, dtype=np.int64)[axis]
        across = across[((across >= 0) & (across < grid.last)).all(axis=1)]
        blocks.append(across[~grid.is_active(across)] // SIDE)
    return np.concatenate(blocks)


def straddles_zero(values: Float[ndarray, "n c"]) -> Bool[ndarray, " n"]:
    """Mark the cells or faces whose corners lie on both sides of the surface; a zero lies on both.

    >>> straddles_zero(np.array([[1.0, 2.0], [-1.0, 2.0], [0.0, 2.0]])).tolist()
    [False, True, True]
    """
    return np.logical_not((values > 0).all(axis=1) | (values < 0).all(axis=1))
