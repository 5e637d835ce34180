"""The surface followed from cell to cell, and found between points on opposite sides of it."""

from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.sparse_grid import CORNERS, Grid

FOLLOWED = 4  # cells along an edge of the blocks that are added where the surface leaves the cells found
TOGETHER = 1 << 17  # cells, or points, handled at once

Points = Int[ndarray, "_ 3"]  # of the grid; cells are addressed by their lowest corner
NOTHING: Points = np.zeros((0, 3), dtype=np.int64)


class Pairs(NamedTuple):
    """Grid points on opposite sides of the surface."""

    ones: Points
    others: Points


def across_lattice(grid: Grid) -> Pairs:
    """The ends of the coarse lattice's edges that lie on opposite sides."""
    outside, lows, highs = grid.lattice > 0, [NOTHING], [NOTHING]
    for axis, step in enumerate(np.eye(3, dtype=np.int64)):
        edges = np.argwhere(np.diff(outside, axis=axis))
        lows.append(grid.lines[edges])
        highs.append(grid.lines[edges + step])
    return Pairs(np.concatenate(lows), np.concatenate(highs))


def add_between(grid: Grid, pairs: Pairs) -> None:
    """Add a cell of the surface between the points of each pair, by bisection."""
    ones, others = pairs
    outside = grid.evaluate(ones) > 0
    while len(ones):
        close = np.abs(ones - others).max(axis=1) <= 1
        cells = np.minimum(np.minimum(ones, others)[close], grid.last - 1)
        grid.evaluate((cells[:, None] + CORNERS).reshape(-1, 3))
        grid.add_cells(cells)
        ones, others, outside = ones[~close], others[~close], outside[~close]
        middles = (ones + others) // 2
        alike = ((grid.evaluate(middles) > 0) == outside)[:, None]
        ones, others = np.where(alike, middles, ones), np.where(alike, others, middles)


def follow(grid: Grid) -> None:
    """Add the whole block of `FOLLOWED`^3 cells around every cell that the surface enters from those found so far."""
    points, inside = (np.indices((FOLLOWED + more,) * 3).reshape(3, -1).T for more in (1, 0))
    cells = grid.all_cells()
    while len(cells):
        entered = np.unique(np.concatenate([_entered(grid, part) for part in _parts(cells, TOGETHER)]), axis=0)
        added = [NOTHING]
        for batch in _parts(entered, TOGETHER // len(points)):
            grid.evaluate(np.minimum(batch[:, None] * FOLLOWED + points, grid.last).reshape(-1, 3))
            around = (batch[:, None] * FOLLOWED + inside).reshape(-1, 3)
            around = around[(around < grid.last).all(axis=1)]
            added.append(around[~grid.has_cells(around)])
            grid.add_cells(added[-1])
        cells = np.concatenate(added)


def _entered(grid: Grid, cells: Points) -> Points:
    """Blocks of the cells that are not found yet and share a face with the given ones that the surface cuts."""
    values = grid.corner_values(cells, 1)
    cut = mixed(values)
    cells, values = cells[cut], values[cut]
    blocks = [NOTHING]
    for axis, side in product(range(3), (0, 1)):
        across = cells[mixed(values[:, CORNERS[:, axis] == side])] + (2 * side - 1) * np.eye(3, dtype=np.int64)[axis]
        across = across[((across >= 0) & (across < grid.last)).all(axis=1)]
        blocks.append(across[~grid.has_cells(across)] // FOLLOWED)
    return np.concatenate(blocks)


def mixed(values: Float[ndarray, "n c"]) -> Bool[ndarray, " n"]:
    """Whether the corners of each cell or face lie on both sides; a zero lies on both."""
    return np.logical_not((values > 0).all(axis=1) | (values < 0).all(axis=1))


def _parts(points: Points, size: int) -> list[Points]:
    return [points[start : start + size] for start in range(0, len(points), size)]
