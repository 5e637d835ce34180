"""The cells of a grid that the zero level set of a field passes through, without evaluating the field elsewhere.

Blocks are halved, from those of the coarse lattice down to single cells, and an octant is skipped, without evaluating
anything of it, if no zero can be within it. That is told from the values at the corners of its block alone, in one of
two ways (`octants.py`):
    while the field is nowhere steeper than a bound, a guess: 1.25 times the steepest slope between points of the coarse
    lattice around, and at least that of the median block;
    while the field is nowhere farther from what is interpolated between those corners than it was at the corners
    themselves, when the block was an octant and they were evaluated.
The guesses are checked: of a quarter of the octants skipped in coarse blocks, and of a 32nd of the finer ones, one grid
point is drawn and evaluated. Where the field is steeper than the bound between that point and a corner, or farther from
the interpolated value than was believed, 1.25 times what was seen is believed there and in the coarse blocks around.
What was skipped there is judged and checked anew, until no check fails. Then the surface is sought between any two
points found on opposite sides, and followed wherever it leaves the cells found so far.

Guaranteed, for any field:
    a component of the dense grid's surface is found if it alone lies between the two ends of an edge of the coarse
    lattice, or between a point that a check drew and the corners of its block; and every component of which a cell is
    found is complete, so the sparse mesh has no hole that the dense mesh has not.
Guaranteed, as far as the field keeps the final bounds: all of the surface.
Not guaranteed: a closed component, all of it in skipped octants, around no point of the lattice, and so small and steep
that no point drawn by a check lies within it or on flanks that break a bound. Of one that spans a coarse block, 2.0
points are drawn on average; of one of few cells, most often none.
"""

import logging
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.extraction.continuation import NOTHING, Pairs, across_lattice, add_between, follow
from jointsdf.extraction.pruning import (
    Believed,
    Halved,
    Skipped,
    coarse_blocks,
    corrected,
    extents,
    halved,
    judged,
    of_lattice,
    rows,
)
from jointsdf.extraction.sparse_grid import CORNERS, Grid

log = logging.getLogger(__name__)

COARSE_CHECKS, FINE_CHECKS = 1 / 4, 1 / 32  # share of the skipped octants that are checked
BATCH = 1 << 14  # blocks handled at once

NONE_HALVED = Halved(NOTHING, np.zeros(0, dtype=np.float32), np.zeros((0, 8), dtype=bool))
NONE_SKIPPED = Skipped(*NONE_HALVED, np.zeros((0, 8), dtype=bool))


def cells_near_surface(grid: Grid) -> None:
    """Add to the grid every cell that the zero level set passes through, corners evaluated."""
    rng, believed = np.random.default_rng(0), of_lattice(grid)
    strides = [grid.stride >> level for level in range(grid.stride.bit_length() - 1)]  # ..., 4, 2
    lattice = np.indices(believed.slopes.shape).reshape(3, -1).T
    skipped = dict.fromkeys(strides, NONE_SKIPPED)
    waiting = dict.fromkeys(strides, NONE_HALVED)
    waiting[grid.stride] = halved(grid, lattice, np.full(len(lattice), np.inf), grid.stride)
    pairs = [across_lattice(grid)]
    while any(len(asked.blocks) for asked in waiting.values()):
        fresh = _refine(grid, believed, waiting)
        seen, opposite = _check(grid, fresh, rng)
        believed, changed = corrected(believed, seen)
        pairs.append(opposite)
        for stride in strides:
            known = Skipped(*_joined([skipped[stride], fresh[stride]]))
            anew = changed[coarse_blocks(grid, known.blocks, stride)]
            waiting[stride], skipped[stride] = Halved(*rows(known, anew)[:3]), rows(known, ~anew)
        if changed.any():
            log.debug("checks failed in or beside %d blocks; slopes at most %.3g", changed.sum(), believed.slopes.max())
    add_between(grid, Pairs(*_joined(pairs)))
    follow(grid)


def _refine(grid: Grid, believed: Believed, waiting: dict[int, Halved]) -> dict[int, Skipped]:
    """Halve blocks until their octants can be skipped or are single cells; what was skipped, by the blocks' stride."""
    skipped, reached = {}, NONE_HALVED
    for stride, asked in waiting.items():
        together = Halved(*_joined([asked, reached]))
        parts = [judged(grid, believed, rows(together, part), stride) for part in _batches(len(together.blocks))]
        skipped[stride] = Skipped(*_joined([NONE_SKIPPED, *(outside for _, outside in parts)]))
        reached = Halved(*_joined([NONE_HALVED, *(within for within, _ in parts if within is not None)]))
    return skipped


def _check(grid: Grid, skipped: dict[int, Skipped], rng: np.random.Generator) -> tuple[Believed, Pairs]:
    """What is seen of the field in each coarse block, at random grid points of skipped octants there; 0 without.

    Also the points drawn that are not on the side of a corner of their block, and that corner.
    """
    seen, pairs = Believed(*np.zeros((2, *[len(grid.lines) - 1] * 3))), [Pairs(NOTHING, NOTHING)]
    for stride, (blocks, bends, octants, bent) in skipped.items():
        share = COARSE_CHECKS if stride == grid.stride else FINE_CHECKS
        drawn = np.argwhere(octants & (rng.random(octants.shape) < share))
        for part in _batches(len(drawn)):
            which, octant = drawn[part].T
            asked, half = blocks[which], stride // 2
            inside = CORNERS[octant] * half + rng.integers(0, half, asked.shape)
            inside[(inside == 0).all(axis=1)] = half  # no corner
            ends = extents(grid, asked, stride)
            inside = np.minimum(inside, ends)
            points, corners = asked * stride + inside, (asked * stride)[:, None] + CORNERS * ends[:, None]
            values, coarse = grid.corner_values(asked, stride), coarse_blocks(grid, asked, stride)
            found = grid.sample(points) if stride == grid.stride else grid.evaluate(points)  # kept near the surface
            apart = grid.spacing * np.linalg.norm(corners - points[:, None], axis=2)
            rise = np.abs(values - found[:, None])
            slopes = np.divide(rise, apart, out=np.zeros_like(apart), where=apart > 0).max(axis=1)
            np.maximum.at(seen.slopes, coarse, slopes)
            away = np.abs(found - (_weights(inside / ends) * values).sum(axis=1)) / bends[which]
            np.maximum.at(seen.bends, coarse, np.where(bent[which, octant], away, 0))
            opposite = (values > 0) != (found > 0)[:, None]
            some = opposite.any(axis=1)
            pairs.append(Pairs(corners[some, opposite[some].argmax(axis=1)], points[some]))
    return seen, Pairs(*_joined(pairs))


def _weights(inside: Float[ndarray, "n 3"]) -> Float[ndarray, "n 8"]:
    """What each corner of the unit cube counts in the trilinear interpolation at points of it."""
    return np.asarray(np.where(CORNERS, inside[:, None], 1 - inside[:, None]).prod(axis=-1))


def _batches(count: int) -> Iterator[slice]:
    for start in range(0, count, BATCH):
        yield slice(start, start + BATCH)


def _joined(parts: Sequence[tuple[ndarray, ...]]) -> tuple[ndarray, ...]:
    """Tables of the same columns below one another."""
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
