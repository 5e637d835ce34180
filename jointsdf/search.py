"""The cells of a grid that the zero level set of a field passes through, without evaluating the field elsewhere.

A block of cells is skipped if no zero can be within it, from the values at its corners alone, in one of two ways:
    while the field is nowhere steeper than a bound, a guess: 1.25 times the steepest slope between points of the coarse
    lattice around, and at least that of the median block;
    where the block is an octant of one that was evaluated at its corners, edges, faces and centre: while the field is
    nowhere farther from what is interpolated between corners than 1.25 times what was found there.
Every guess is checked: in each coarse block that was skipped, and in a share of the finer ones, the field is evaluated
at a random grid point. Where it is steeper than the bound between that point and a corner, the bound is raised there
and in the blocks around; where it is so far from the interpolated value that its sign could differ, interpolation is
no longer trusted there. What was skipped there is judged and checked anew, until no check fails. Then the surface is
followed wherever it leaves the cells found so far.

Guaranteed, for any field:
    every component of the dense grid's surface that passes through one evaluated cell is complete, so the sparse mesh
    has no hole that the dense mesh has not; and a component is found if a point of the coarse lattice lies within it.
Guaranteed, as far as the field keeps the final bounds: all of the surface.
Not guaranteed: a closed component, all of it in skipped blocks, around no lattice point, and so small and steep that
no random point meets its flanks. The chance of missing one is the product, over the coarse blocks that it reaches
into, of the share of each block's grid points that keep the bound; within a halved block, of three in four octants
nobody asks.
"""

import logging
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.grid import CORNERS, Grid

log = logging.getLogger(__name__)

SAFETY = 1.25  # on the steepest slope, and the largest distance from interpolation, seen: to bound those not seen
CHECKED = 0.25  # share of the skipped blocks finer than the coarse lattice's that are checked
FOLLOWED = 4  # cells along an edge of the blocks that are added where the surface leaves the cells found
BATCH = 1 << 17  # blocks handled at once
ACROSS = ((1, 2), (0, 2), (0, 1))  # the other two axes
THIRDS = np.array(list(product((0, 1, 2), repeat=3)))  # a block's points at half its stride
# Largest distance of a corner of the unit cube (second axis) to a point of its octant (first axis).
REACH = np.sqrt(np.array([0.75, 1.5, 2.25, 3.0]))[np.abs(CORNERS[:, None] - CORNERS[None]).sum(axis=-1)]

Blocks = Int[ndarray, "_ 3"]  # of some stride: in units of that stride
NO_BLOCKS: Blocks = np.zeros((0, 3), dtype=np.int64)


class Judged(NamedTuple):
    """Blocks of one stride, and how far the field in each may be from what is interpolated between its corners.

    Attributes:
        blocks: In units of the stride.
        bends: Largest distance that is believed, network length units; infinite: not known.
    """

    blocks: Blocks
    bends: Float[ndarray, " _"]


def cells_near_surface(grid: Grid) -> None:
    """Add to the grid every cell that the zero level set passes through, corners evaluated."""
    rng = np.random.default_rng(0)
    bounds = _lattice_slopes(grid)
    strides = [grid.stride >> level for level in range(grid.stride.bit_length() - 1)]  # ..., 4, 2
    skipped = {stride: NO_BLOCKS for stride in strides}
    waiting = skipped | {grid.stride: np.indices(bounds.shape).reshape(3, -1).T}
    while any(map(len, waiting.values())):
        fresh = _refine(grid, bounds, waiting)
        steepest, refuted = _check(grid, fresh, rng, bounds)
        bounds = np.maximum(bounds, maximum_filter(np.where(refuted, SAFETY * steepest, 0), size=3))
        raised = maximum_filter(refuted, size=3)
        for stride in strides:
            skipped[stride] = np.concatenate([skipped[stride], fresh[stride].blocks])
            anew = raised[tuple((skipped[stride] * stride // grid.stride).T)]
            waiting[stride], skipped[stride] = skipped[stride][anew], skipped[stride][~anew]
        if refuted.any():
            log.debug("checks failed in %d blocks; slope bound now at most %.3g", refuted.sum(), bounds.max())
    _follow(grid)


def _lattice_slopes(grid: Grid) -> Float[ndarray, "b b b"]:
    """A bound on the slope in each coarse block, by the lattice points of the block and those around it."""
    lengths, blocks = np.diff(grid.lines) * grid.spacing, len(grid.lines) - 1
    rises = [np.diff(grid.lattice.astype(np.float64), axis=axis) for axis in range(3)]
    squared = [(rise / np.expand_dims(lengths, rest)) ** 2 for rise, rest in zip(rises, ACROSS, strict=True)]
    slopes = np.zeros((blocks,) * 3)
    for corner in CORNERS:  # of a block: its three edges there
        edges = np.zeros((blocks,) * 3)
        for axis, along in enumerate(squared):
            edges += along[
                tuple(slice(side, side + blocks) if i != axis else slice(None) for i, side in enumerate(corner))
            ]
        slopes = np.maximum(slopes, np.sqrt(edges))
    return SAFETY * np.maximum(maximum_filter(slopes, size=3), np.median(slopes))


def _refine(grid: Grid, bounds: Float[ndarray, "b b b"], waiting: dict[int, Blocks]) -> dict[int, Judged]:
    """Halve the waiting blocks until they can be skipped or are single cells; the skipped ones by stride."""
    skipped, halves = {}, Judged(NO_BLOCKS, np.zeros(0))
    for stride, blocks in waiting.items():
        found = Judged(np.concatenate([blocks, halves.blocks]), np.append(np.full(len(blocks), np.inf), halves.bends))
        parts = [_judge(grid, bounds, part, stride) for part in _parts(found)]
        skipped[stride] = _joined([outside for _, outside in parts])
        halves = _joined([_halve(grid, part, stride) for reached, _ in parts for part in _batches(reached)])
    grid.add_cells(halves.blocks)
    return skipped


def _judge(grid: Grid, bounds: Float[ndarray, "b b b"], judged: Judged, stride: int) -> tuple[Blocks, Judged]:
    """The blocks that a zero may lie in, and the others, with the bend that must hold where the slope does not tell.

    No zero is in a block with corners of one sign where they rule out each octant, or where all are beyond the bend.
    """
    values = grid.corner_values(judged.blocks, stride)
    sizes = np.abs(values)
    allowed = np.min([(sizes / reach).max(axis=1) for reach in REACH], axis=0) / (stride * grid.spacing)
    ruled_out = allowed > bounds[tuple((judged.blocks * stride // grid.stride).T)]
    skipped = ~mixed(values) & (ruled_out | (sizes.min(axis=1) > judged.bends))
    bends = np.where(ruled_out, np.inf, judged.bends)
    return judged.blocks[~skipped], Judged(judged.blocks[skipped], bends[skipped])


def _halve(grid: Grid, blocks: Blocks, stride: int) -> Judged:
    """The eight blocks of half the stride in each, corners evaluated; without those beyond the grid's last point."""
    half = stride // 2
    points = np.minimum((2 * blocks[:, None] + THIRDS) * half, grid.last)
    grid.evaluate(points.reshape(-1, 3))
    interpolated = grid.corner_values(blocks, stride) @ _weights(THIRDS / 2).T
    bends = SAFETY * np.abs(grid.at(points) - interpolated).max(axis=1)
    halves = (2 * blocks[:, None] + CORNERS).reshape(-1, 3)
    within = (halves * half < grid.last).all(axis=1)
    return Judged(halves[within], np.repeat(bends, len(CORNERS))[within])


def _check(
    grid: Grid, skipped: dict[int, Judged], rng: np.random.Generator, bounds: Float[ndarray, "b b b"]
) -> tuple[Float[ndarray, "b b b"], Bool[ndarray, "b b b"]]:
    """Steepest slope between a random grid point of each checked block and its corners, by coarse block; 0 without.

    Also where that is beyond the bound, or the point farther from the interpolated value than the bend.
    """
    steepest, bent = np.zeros(bounds.shape), np.zeros(bounds.shape, dtype=bool)
    for stride, judged in skipped.items():
        checked = rng.random(len(judged.blocks)) < (CHECKED if stride < grid.stride else 1)
        for blocks, bends in _parts(Judged(judged.blocks[checked], judged.bends[checked])):
            inside = rng.integers(0, stride + 1, blocks.shape)
            inside[(inside % stride == 0).all(axis=1), 0] = stride // 2  # no corner
            points = np.minimum(blocks * stride + inside, grid.last)
            corners = np.minimum((blocks[:, None] + CORNERS) * stride, grid.last)
            apart = grid.spacing * np.linalg.norm(corners - points[:, None], axis=2)
            values, found = grid.corner_values(blocks, stride), grid.sample(points)
            rise = np.abs(values - found[:, None])
            slopes = np.divide(rise, apart, out=np.zeros_like(apart), where=apart > 0).max(axis=1)
            coarse = tuple((blocks * stride // grid.stride).T)
            np.maximum.at(steepest, coarse, slopes)
            interpolated = (_weights(inside / stride) * values).sum(axis=1)
            np.logical_or.at(bent, coarse, np.abs(found - interpolated) > bends)
    return steepest, (steepest > bounds) | bent


def _weights(inside: Float[ndarray, "n 3"]) -> Float[ndarray, "n 8"]:
    """What each corner of the unit cube counts in the trilinear interpolation at points of it."""
    return np.asarray(np.where(CORNERS, inside[:, None], 1 - inside[:, None]).prod(axis=-1))


def _follow(grid: Grid) -> None:
    """Add the whole block of `FOLLOWED`^3 cells around every cell that the surface enters from those found so far."""
    points, inside = (np.indices((FOLLOWED + more,) * 3).reshape(3, -1).T for more in (1, 0))
    cells = grid.all_cells()
    while len(cells):
        entered = np.unique(np.concatenate([_entered(grid, batch) for batch in _batches(cells)]), axis=0)
        added = [entered[:0]]
        for batch in _batches(entered, BATCH // len(points)):
            grid.evaluate(np.minimum(batch[:, None] * FOLLOWED + points, grid.last).reshape(-1, 3))
            around = (batch[:, None] * FOLLOWED + inside).reshape(-1, 3)
            around = around[(around < grid.last).all(axis=1)]
            added.append(around[~grid.has_cells(around)])
            grid.add_cells(added[-1])
        cells = np.concatenate(added)


def _entered(grid: Grid, cells: Blocks) -> Blocks:
    """Blocks of the cells that are not found yet and share a face with the given ones that the surface cuts."""
    values = grid.corner_values(cells, 1)
    cut = mixed(values)
    cells, values = cells[cut], values[cut]
    blocks = [np.zeros((0, 3), dtype=np.int64)]
    for axis, side in product(range(3), (0, 1)):
        across = cells[mixed(values[:, CORNERS[:, axis] == side])] + (2 * side - 1) * np.eye(3, dtype=np.int64)[axis]
        across = across[((across >= 0) & (across < grid.last)).all(axis=1)]
        blocks.append(across[~grid.has_cells(across)] // FOLLOWED)
    return np.concatenate(blocks)


def mixed(values: Float[ndarray, "n c"]) -> Bool[ndarray, " n"]:
    """Whether the corners of each cell or face lie on both sides; a zero lies on both."""
    return np.logical_not((values > 0).all(axis=1) | (values < 0).all(axis=1))


def _batches(blocks: Blocks, size: int = BATCH) -> Iterator[Blocks]:
    for start in range(0, len(blocks), size):
        yield blocks[start : start + size]


def _parts(judged: Judged) -> Iterator[Judged]:
    for start in range(0, len(judged.blocks), BATCH):
        yield Judged(*(column[start : start + BATCH] for column in judged))


def _joined(parts: list[Judged]) -> Judged:
    blocks = np.concatenate([NO_BLOCKS, *(part.blocks for part in parts)])
    return Judged(blocks, np.concatenate([np.zeros(0), *(part.bends for part in parts)]))
