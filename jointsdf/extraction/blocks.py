"""Tables of blocks and points of the grid, one row each, and the operations that all tables share.

A block is a cube of `stride`^3 cells, `stride` a power of two, addressed in units of the stride; its octants are the
eight blocks of half the stride within it, in the order of `CORNERS`.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.sparse_grid import CORNERS, NO_POINTS, Grid, Points

Blocks = Int[ndarray, "_ 3"]
Octants = Bool[ndarray, "_ 8"]


class PendingBlocks(NamedTuple):
    """Blocks of one stride, corners evaluated, with octants that are still to be tested for a zero.

    Attributes:
        blocks: In units of the stride.
        interpolation_error: Largest distance of the field at their corners from the interpolation between the corners
            of the block that they are an octant of, network length units; infinite where that is not known.
        octants: Marks those to be tested.
    """

    blocks: Blocks
    interpolation_error: Float[ndarray, " _"]
    octants: Octants


class PrunedBlocks(NamedTuple):
    """Blocks of one stride with octants that hold no zero, as far as the bounds hold.

    Attributes:
        blocks: In units of the stride.
        interpolation_error: As in `PendingBlocks`.
        octants: Marks the pruned ones.
        by_interpolation: Marks those of them that the bound on the interpolation error alone rules out.
    """

    blocks: Blocks
    interpolation_error: Float[ndarray, " _"]
    octants: Octants
    by_interpolation: Octants

    def reopen(self) -> PendingBlocks:
        """The same blocks with the pruned octants to be tested anew."""
        return PendingBlocks(self.blocks, self.interpolation_error, self.octants)


class SignChanges(NamedTuple):
    """Pairs of grid points on opposite sides of the surface."""

    first: Points
    second: Points


Table = TypeVar("Table", PendingBlocks, PrunedBlocks, SignChanges)

NO_MARKS: Octants = np.zeros((0, 8), dtype=bool)
NO_PENDING = PendingBlocks(NO_POINTS, np.zeros(0, dtype=np.float32), NO_MARKS)
NO_PRUNED = PrunedBlocks(NO_POINTS, np.zeros(0, dtype=np.float32), NO_MARKS, NO_MARKS)
NO_CHANGES = SignChanges(NO_POINTS, NO_POINTS)


def queue_octants(grid: Grid, blocks: Blocks, interpolation_error: Float[ndarray, " n"], stride: int) -> PendingBlocks:
    """Mark all octants of blocks as to be tested, but for those beyond the grid's last point."""
    octants = ((2 * blocks[:, None] + CORNERS) * (stride // 2) < grid.last).all(axis=2)
    return PendingBlocks(blocks, interpolation_error.astype(np.float32), octants)


def coarse_index(grid: Grid, blocks: Blocks, stride: int) -> tuple[Int[ndarray, " n"], ...]:
    """Index, along each axis, of the coarse block that contains each block."""
    return tuple((blocks * stride // grid.stride).T)


def extents(grid: Grid, blocks: Blocks, stride: int) -> Int[ndarray, "n 3"]:
    """Cells along the edges of each block: the stride, but fewer at the grid's end."""
    return np.minimum((blocks + 1) * stride, grid.last) - blocks * stride


def select(table: Table, rows: Bool[ndarray, " n"] | Int[ndarray, " m"] | slice) -> Table:
    """Some rows of a table."""
    return type(table)(*(column[rows] for column in table))


def concatenate(tables: Sequence[Table]) -> Table:
    """The rows of at least one table, in order."""
    return type(tables[0])(*(np.concatenate(columns) for columns in zip(*tables, strict=True)))


def batches(count: int, size: int) -> Iterator[slice]:
    """Consecutive slices of at most `size` rows.

    >>> list(batches(5, 2))
    [slice(0, 2, None), slice(2, 4, None), slice(4, 6, None)]
    """
    for start in range(0, count, size):
        yield slice(start, start + size)
