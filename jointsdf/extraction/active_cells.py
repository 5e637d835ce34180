"""Active cells, those that the zero level set passes through, by adaptive subdivision with spot checks.

Blocks are halved, from those of the coarse lattice down to single cells. An octant is pruned, without evaluating
anything of it, if the values at the corners of its block rule out a zero by one of two bounds (`pruning.py`):
    slope: the field is nowhere steeper than 1.25 times the steepest slope between points of the coarse lattice around,
    and at least that of the median block;
    interpolation error: the field is nowhere farther from the trilinear interpolation between those corners than it was
    at the corners themselves, when the block was an octant and they were evaluated.
Both are guesses, and are checked (`spot_checks.py`): in a quarter of the octants pruned in coarse blocks, and in a 32nd
of the finer ones, one random grid point is evaluated. Where the field is steeper than the bound between that point and
a corner, or farther from the interpolation, the bound becomes 1.25 times what was seen, there and in the coarse blocks
around, and what was pruned there is tested and checked anew, until no check fails. Then the surface is found by
bisection between any two points on opposite sides, and tracked from cell to cell (`continuation.py`).

Guaranteed, for any field:
    a component of the dense grid's surface is found if it alone lies between the two ends of an edge of the coarse
    lattice, or between a point that a check drew and the corners of its block; and every component of which a cell is
    found is complete, so the sparse mesh has no hole that the dense mesh has not.
Guaranteed, as far as the field stays within the final bounds: all of the surface.
Not guaranteed: a closed component, all of it in pruned octants, around no point of the lattice, and so small and steep
that no point drawn by a check lies within it or on flanks that break a bound. Of one that spans a coarse block, 2.0
points are drawn on average; of one of few cells, most often none.
"""

import logging

import numpy as np

from jointsdf.extraction.blocks import (
    NO_PENDING,
    NO_PRUNED,
    PendingBlocks,
    PrunedBlocks,
    batches,
    coarse_index,
    concatenate,
    queue_octants,
    select,
)
from jointsdf.extraction.continuation import bisect_sign_changes, lattice_sign_changes, track_surface
from jointsdf.extraction.pruning import Bounds, bounds_from_lattice, prune, widen_bounds
from jointsdf.extraction.sparse_grid import Grid
from jointsdf.extraction.spot_checks import spot_check

log = logging.getLogger(__name__)

BATCH = 1 << 14  # blocks pruned at once


def activate_cells(grid: Grid) -> None:
    """Activate every cell that the zero level set passes through, its corners evaluated."""
    rng, bounds = np.random.default_rng(0), bounds_from_lattice(grid)
    strides = [grid.stride >> level for level in range(grid.stride.bit_length() - 1)]  # ..., 4, 2
    lattice = np.indices(bounds.slope.shape).reshape(3, -1).T
    pruned = dict.fromkeys(strides, NO_PRUNED)
    pending = dict.fromkeys(strides, NO_PENDING)
    pending[grid.stride] = queue_octants(grid, lattice, np.full(len(lattice), np.inf), grid.stride)
    changes = [lattice_sign_changes(grid)]
    while any(len(table.blocks) for table in pending.values()):
        newly_pruned = _subdivide(grid, bounds, pending)
        observed, opposite = spot_check(grid, newly_pruned, rng)
        changes.append(opposite)
        bounds, widened = widen_bounds(bounds, observed)
        for stride in strides:
            table = concatenate([pruned[stride], newly_pruned[stride]])
            doubtful = widened[coarse_index(grid, table.blocks, stride)]
            pending[stride], pruned[stride] = select(table, doubtful).reopen(), select(table, ~doubtful)
        if widened.any():
            log.debug("checks failed in or beside %d blocks; slopes at most %.3g", widened.sum(), bounds.slope.max())
    bisect_sign_changes(grid, concatenate(changes))
    track_surface(grid)


def _subdivide(grid: Grid, bounds: Bounds, pending: dict[int, PendingBlocks]) -> dict[int, PrunedBlocks]:
    """Halve blocks until their octants are pruned or single cells; what was pruned, by the blocks' stride."""
    pruned, reached = {}, NO_PENDING
    for stride, table in pending.items():
        blocks = concatenate([table, reached])
        parts = [prune(grid, bounds, select(blocks, part), stride) for part in batches(len(blocks.blocks), BATCH)]
        pruned[stride] = concatenate([NO_PRUNED, *(outside for _, outside in parts)])
        reached = concatenate([NO_PENDING, *(inside for inside, _ in parts if inside is not None)])
    return pruned
